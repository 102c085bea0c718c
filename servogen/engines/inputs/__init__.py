"""What steers a program from outside: an input is stated by a job, and accepted or refused by an engine.

An engine's line in `registry` names the kinds of inputs that it accepts. Buttons and commands are keys of the
job file that several engines may read; an engine whose input is its own states it in a table of its own, an
`InputSection`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, ClassVar, Protocol, TypeVar

from pydantic import Field

from servogen.edges import PINS
from servogen.robot.servo import Servo
from servogen.toml.file import Document, Table
from servogen.toml.locations import Key
from servogen.units import Clock

PinName = Annotated[str, Field(json_schema_extra={"enum": list(PINS)})]
"""A pin; `check_free` says which name is meant."""


class EngineInput(Protocol):
    """An input of a program."""

    kind: ClassVar[str]
    """Its name in a sentence: "buttons", "a serial line"."""


class InputSection(Protocol):
    """A table of the job file that states the input of one engine: `SECTION` of the module in its line."""

    name: ClassVar[str]
    """The table's name in the file."""
    kind: ClassVar[str]
    """The kind of its input."""
    table: ClassVar[type[Table]]
    moves: ClassVar[bool]
    """Whether positions come from it, so that the job needs no motion."""

    def read(self, document: Document, given: Table, servos: Sequence[Servo], clock: Clock) -> EngineInput:
        """Return the input that the table `given` states. Raises InputError."""


Input = TypeVar("Input", bound=EngineInput)


def given(inputs: Iterable[EngineInput], kind: type[Input]) -> Input | None:
    """Return the input of a class among those of a job; None if there is none."""
    return next((each for each in inputs if isinstance(each, kind)), None)


def check_free(document: Document, key: Key, pin: str, used_pins: Mapping[str, str], hint: str) -> None:
    """Raise InputError if there is no such pin, or `used_pins`, users by pin, has one for it."""
    document.check_known("unknown-pin", key, pin, PINS, f"unknown pin '{pin}'")
    if pin in used_pins:
        raise document.error("pin-in-use", key, f"{pin} is in use: {used_pins[pin]}", hint)
