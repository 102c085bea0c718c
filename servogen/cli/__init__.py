"""The command line, a module a group of commands; heavy imports stand inside them, so that help is quick."""

from servogen.cli.main import main

__all__ = ["main"]
