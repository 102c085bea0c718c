"""[tape] of a job file: the serial EEPROM that holds the motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal, cast

from servogen.engines.inputs import InputSection, PinName, check_free
from servogen.engines.inputs.tape import SDA, Tape
from servogen.robot.servo import Servo
from servogen.toml.file import Document, Table
from servogen.units import Clock


class TapeTable(Table):
    """[tape]: the serial EEPROM of the tape engine."""

    eeprom: Literal["24LC64", "24LC128", "24LC256", "24LC512"] = "24LC256"
    scl_pin: Literal["RA0", "RA1", "RA2", "RA3"] = "RA3"
    on_error: Literal["release", "hold"] = "release"
    error_pin: PinName | None = None


class TapeSection:
    """The table, and what the bus demands of the pins."""

    name: ClassVar[str] = "tape"
    kind: ClassVar[str] = Tape.kind
    table: ClassVar[type[Table]] = TapeTable
    moves: ClassVar[bool] = False

    def read(self, document: Document, given: Table, servos: Sequence[Servo], clock: Clock) -> Tape:
        """Return the EEPROM. Raises InputError for pins that are in use."""
        wanted = cast(TapeTable, given)
        taken = {servo.pin: servo.name for servo in servos}
        hint = f"the bus needs {SDA} for SDA and a pin of RA0 to RA3 for SCL"
        check_free(document, ("tape", "scl_pin"), wanted.scl_pin, taken, hint)
        taken[wanted.scl_pin] = "SCL"
        check_free(document, ("tape",), SDA, taken, hint)
        taken[SDA] = "SDA"
        if wanted.error_pin is not None:
            check_free(document, ("tape", "error_pin"), wanted.error_pin, taken, "it needs a pin of its own")
            # A slot writes its whole port: the pin would go low in every slot of its port.
            neighbours = [servo.name for servo in servos if servo.pin[1] == wanted.error_pin[1]]
            if neighbours:
                raise document.error(
                    "pin-in-use",
                    ("tape", "error_pin"),
                    f"{wanted.error_pin} is on the port of {neighbours[0]}",
                    "the error pin needs a port without servos",
                )
        return Tape(wanted.eeprom, wanted.scl_pin, wanted.on_error, wanted.error_pin, document.place("tape"))


SECTION: InputSection = TapeSection()
