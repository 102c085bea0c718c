"""The engines that there are: one line for each, smallest first.

Only names and facts that a job is checked against are here: loading a job does not load the compiler.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from servogen.engines.protocol import Engine


@dataclass(frozen=True, slots=True)
class Entry:
    """The module whose `ENGINE` is the engine, and whether it reads buttons or a serial line."""

    module: str
    buttons: bool = False
    serial: bool = False


ENGINES: Mapping[str, Entry] = MappingProxyType(
    {
        "sequence": Entry("servogen.engines.sequence.engine"),
        "player": Entry("servogen.engines.player.engine", buttons=True),
        "stream": Entry("servogen.engines.stream.engine", serial=True),
    }
)


def engine_named(name: str) -> Engine:
    """Returns the engine of that name."""
    return cast("Engine", import_module(ENGINES[name].module).ENGINE)
