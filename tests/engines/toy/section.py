"""[jumper]: an input of the toy's own, a pin that has to be high before the pulses begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, cast

from servogen.engines.inputs import InputSection, PinName, check_free
from servogen.robot.servo import Servo
from servogen.toml.file import Document, Table
from servogen.units import Clock


@dataclass(frozen=True, slots=True)
class Jumper:
    """The jumper's pin."""

    kind: ClassVar[str] = "a jumper"

    pin: str


class JumperTable(Table):
    """[jumper]"""

    pin: PinName = "RA4"


class JumperSection:
    """The table, whose pin no servo may have."""

    name: ClassVar[str] = "jumper"
    kind: ClassVar[str] = Jumper.kind
    table: ClassVar[type[Table]] = JumperTable
    moves: ClassVar[bool] = False

    def read(self, document: Document, given: Table, servos: Sequence[Servo], clock: Clock) -> Jumper:
        pin = cast(JumperTable, given).pin
        taken = {servo.pin: servo.name for servo in servos}
        check_free(document, ("jumper", "pin"), pin, taken, "the jumper needs a pin of its own")
        return Jumper(pin)


SECTION: InputSection = JumperSection()
