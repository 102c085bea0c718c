"""The command line: one module per group of commands, with heavy imports inside, so that help is quick."""

from servogen.cli.main import main

__all__ = ["main"]
