"""Puts something in the place of a function, wherever a command has imported it from."""

import sys
from importlib import import_module
from types import ModuleType

import pytest

from servogen.cli.app import MODULES


def command_modules() -> list[ModuleType]:
    """The modules of the commands and of what they share."""
    for module in MODULES.values():
        import_module(f"servogen.cli.{module}")
    return [module for name, module in sys.modules.items() if name.startswith("servogen.cli.")]


def stand_in(monkeypatch: pytest.MonkeyPatch, where: ModuleType | str, name: str, value: object) -> None:
    """Put `value` in the place of `where.name`, there and under any name in the command line."""
    module = import_module(where) if isinstance(where, str) else where
    original = getattr(module, name)
    for importer in [module, *command_modules()]:
        for own in [own for own, found in vars(importer).items() if found is original]:
            monkeypatch.setattr(importer, own, value)
