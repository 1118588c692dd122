"""Runs the command line: ``python -m annelid``."""

from annelid.cli import main

if __name__ == "__main__":
    main()
