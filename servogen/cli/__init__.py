"""The command line: a module for each command, or for several that need the same imports."""

from servogen.cli.main import main

__all__ = ["main"]
