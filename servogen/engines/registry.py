"""The engines, one line for each, those with the smallest programs first.

Only names and facts that a job is checked against are here: loading a job does not load the compiler.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

from servogen.engines.inputs import InputSection
from servogen.engines.inputs.buttons import ControlButtons
from servogen.engines.inputs.commands import COMMANDS
from servogen.engines.inputs.serial import Stream
from servogen.engines.inputs.tape import Tape
from servogen.engines.inputs.wire import FrameWire
from servogen.pulse.slots import Frame, rises
from servogen.robot.servo import Servo
from servogen.units import Clock

if TYPE_CHECKING:
    from servogen.engines.protocol import Engine


@dataclass(frozen=True, slots=True)
class EngineEntry:
    """The module whose `ENGINE` is the engine; the kinds of inputs that it `accepts`, of which it has to have
    those that it `needs`.

    `section` is the module whose `SECTION` states an input of its own in a table of the job file.
    `check_frame` raises InputError if the servos' limits alone show that their pulses fit no frame, whatever
    the motion is.
    """

    module: str
    accepts: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    section: str | None = None
    check_frame: Callable[[Sequence[Servo], Frame, Clock], object] | None = None


ENGINES: Mapping[str, EngineEntry] = MappingProxyType(
    {
        "sequence": EngineEntry("servogen.engines.sequence.engine", check_frame=rises),
        "player": EngineEntry(
            "servogen.engines.player.engine", accepts=(ControlButtons.kind, COMMANDS, FrameWire.kind)
        ),
        "stream": EngineEntry(
            "servogen.engines.stream.engine",
            accepts=(Stream.kind,),
            needs=(Stream.kind,),
            section="servogen.engines.stream.section",
        ),
        "tape": EngineEntry(
            "servogen.engines.tape.engine",
            accepts=(Tape.kind, ControlButtons.kind, COMMANDS),
            needs=(Tape.kind,),
            section="servogen.engines.tape.section",
        ),
    }
)


def suitable(kinds: Collection[str]) -> tuple[str, ...]:
    """Return the names of the engines that accept inputs of these kinds, and need no others."""
    return tuple(name for name, entry in ENGINES.items() if {*entry.needs} <= {*kinds} <= {*entry.accepts})


def sections() -> dict[str, InputSection]:
    """Return the tables of the job file that engines have for inputs of their own, by the engines' names."""
    return {
        name: cast("InputSection", import_module(entry.section).SECTION)
        for name, entry in ENGINES.items()
        if entry.section is not None
    }


def engine_named(name: str) -> Engine:
    """Return the engine of that name."""
    return cast("Engine", import_module(ENGINES[name].module).ENGINE)
