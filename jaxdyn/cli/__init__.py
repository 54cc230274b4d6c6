"""The command line of `jaxdyn`, one file per command.

`list`, `run`, `equations`, `fit`, `accuracy`, `chaos`, `vibration`, `hard`, `course`, `gallery` and
`info` are the commands, which `app` collects. `shared` has their options, whose numbers may be
arithmetic such as ``pi/2`` (see `jaxdyn._arithmetic`), `screen` their output; `messages` of
functions name options in place of arguments; `docstrings` reads names of scenes and solvers and
values of `--set`, `completion` offers them to the shell, and `topics` finds texts about a word.

May import: `hard`, `drawing`, `symbolic`, `vibration`. Nothing here loads JAX before a command
needs it.

To add a command, write a function in a file of its own, and a call of `add` with an example in
`app`.
"""
