"""[stream] of a job file: the serial line of the stream engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal, cast

from pydantic import Field

from servogen.engines.inputs import InputSection, PinName, check_free
from servogen.engines.inputs.serial import Stream
from servogen.engines.stream.settings import bit_units
from servogen.pic.device import OPEN_DRAIN_PIN
from servogen.robot.servo import Servo
from servogen.toml.file import Document, Table, exact
from servogen.units import Clock


class StreamTable(Table):
    """[stream]: the serial line of the stream engine."""

    baud: int = Field(default=2400, gt=0)
    receive_pin: PinName = "RA4"
    transmit_pin: PinName | None = None
    silence_s: float = Field(default=1.0, gt=0, le=1_000_000.0)
    fail_safe: Literal["hold", "neutral", "off"] = "neutral"


class StreamSection:
    """The table, and what the line demands of the chip and of the servos' pins."""

    name: ClassVar[str] = "stream"
    kind: ClassVar[str] = Stream.kind
    table: ClassVar[type[Table]] = StreamTable
    moves: ClassVar[bool] = True

    def read(self, document: Document, given: Table, servos: Sequence[Servo], clock: Clock) -> Stream:
        """Return the serial line. Raises InputError, also for a rate that the chip cannot receive."""
        wanted = cast(StreamTable, given)
        taken = {servo.pin: servo.name for servo in servos}
        for name, pin in (("receive_pin", wanted.receive_pin), ("transmit_pin", wanted.transmit_pin)):
            if pin is not None:
                check_free(document, ("stream", name), pin, taken, "the line needs pins of its own")
                taken[pin] = name
        _check_transmit_pin(document, wanted.transmit_pin, servos)
        stream = Stream(
            baud=wanted.baud,
            receive_pin=wanted.receive_pin,
            transmit_pin=wanted.transmit_pin,
            silence_s=exact(wanted.silence_s),
            fail_safe=wanted.fail_safe,
            place=document.place("stream", "baud"),
        )
        bit_units(stream, clock)
        return stream


def _check_transmit_pin(document: Document, pin: str | None, servos: Sequence[Servo]) -> None:
    """Raise InputError for a pin that cannot drive a line high, or whose port has servos.

    Every edge of a pulse is a write to its whole port.
    """
    key = ("stream", "transmit_pin")
    if pin == OPEN_DRAIN_PIN:
        raise document.error(
            "open-drain", key, f"{OPEN_DRAIN_PIN} is an open drain and cannot drive a line high"
        )
    # Writes of the port for the line would change the moments of pulses on it.
    neighbours = [servo.name for servo in servos if pin is not None and servo.pin[1] == pin[1]]
    if neighbours:
        raise document.error(
            "pin-in-use",
            key,
            f"{pin} is on the port of {neighbours[0]}",
            "the transmit pin needs a port without servos",
        )


SECTION: InputSection = StreamSection()
