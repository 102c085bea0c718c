"""The engines, one line for each, those with the smallest programs first.

Only names and facts that a job is checked against are here: loading a job does not load the compiler.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

from servogen.pulse.slots import Frame, rises
from servogen.robot.servo import Servo
from servogen.units import Clock

if TYPE_CHECKING:
    from servogen.engines.protocol import Engine


@dataclass(frozen=True, slots=True)
class EngineEntry:
    """The module whose `ENGINE` is the engine, and whether it reads buttons, a serial line, or commands for a
    walk.

    `check_frame` raises InputError if the servos' limits alone show that their pulses fit no frame, whatever
    the motion is.
    """

    module: str
    buttons: bool = False
    serial: bool = False
    commands: bool = False
    check_frame: Callable[[Sequence[Servo], Frame, Clock], object] | None = None


ENGINES: Mapping[str, EngineEntry] = MappingProxyType(
    {
        "sequence": EngineEntry("servogen.engines.sequence.engine", check_frame=rises),
        "player": EngineEntry("servogen.engines.player.engine", buttons=True, commands=True),
        "stream": EngineEntry("servogen.engines.stream.engine", serial=True),
    }
)


def suitable(serial: bool, buttons: bool, commands: bool = False) -> tuple[str, ...]:
    """Return the names of the engines that read a job's serial line, its buttons and its commands, if any."""
    return tuple(
        name
        for name, entry in ENGINES.items()
        if entry.serial == serial and (entry.buttons or not buttons) and (entry.commands or not commands)
    )


def engine_named(name: str) -> Engine:
    """Return the engine of that name."""
    return cast("Engine", import_module(ENGINES[name].module).ENGINE)
