"""The command line of `orbits`: one file a command, put together in `app`; the top of it all."""
