"""Starts the command line: `python -m orbits`."""

from orbits.cli.app import main

if __name__ == "__main__":
    main()
