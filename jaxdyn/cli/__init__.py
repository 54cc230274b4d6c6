"""The command line of `jaxdyn`, one file a command.

`list`, `run`, `accuracy` and `hard` are the commands, which `app` puts together; `shared` has their
options, `screen` what they print, `words` checks the names of scenes and solvers.

May import: `hard`, `drawing`. Nothing here loads JAX before a command needs it.

One more command is a function in a file of its own, and a call of `add` with an example in `app`.
"""
