"""Starts the command line: `python -m jaxdyn`."""

from jaxdyn.cli.app import main

if __name__ == "__main__":
    main()
