"""The command line of `jaxdyn`, one file a command.

`list`, `run`, `equations`, `fit`, `accuracy`, `chaos`, `vibration`, `hard`, `course`, `gallery` and
`info` are the commands, `app` puts them together; `shared` has their options, of which numbers may
be arithmetic (see `jaxdyn._arithmetic`: ``pi/2``), `screen` what they print, `docstrings` reads
names of scenes and solvers and values of `--set`, `completion` offers them to the shell, `topics`
finds what is about a word.

May import: `hard`, `drawing`, `symbolic`, `vibration`. Nothing here loads JAX before a command
needs it.

One more command is a function in a file of its own, and a call of `add` with an example in `app`.
"""
