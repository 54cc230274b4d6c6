"""The command line of `jaxdyn`: one file a command, put together in `app`; the top of it all."""
