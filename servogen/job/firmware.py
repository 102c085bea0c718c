"""[firmware] and [stream] of a job -> the choice of its program, its buttons and its serial line.

In: the validated tables, the servos, the clock. Out: `Firmware`, `Stream`; InputError for pins that do not
exist or are in use, a rate that the chip cannot receive at its clock, and what no engine does.
"""

from __future__ import annotations

from collections.abc import Sequence

from servogen.edges import PINS
from servogen.engines.player.buttons import Button, Buttons
from servogen.engines.registry import ENGINES, suitable
from servogen.engines.stream.protocol import MAX_SERVOS
from servogen.engines.stream.settings import Stream, bit_units
from servogen.errors import did_you_mean
from servogen.job.job import Firmware
from servogen.job.schema import FirmwareTable, JobTable, StreamTable
from servogen.pic.device import OPEN_DRAIN_PIN
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.toml.file import Document, exact
from servogen.units import Clock

AUTO = "auto"


def firmware_of(
    document: Document, table: JobTable, servos: Sequence[Servo], frame: Frame, clock: Clock
) -> tuple[Firmware, Stream | None]:
    """Return the program that a job wants, and its serial line if it has one. Raises InputError."""
    stream = _stream(document, table, servos, clock)
    wanted = table.firmware
    buttons = _buttons(document, wanted, servos)
    if wanted.engine == AUTO:
        if not suitable(stream is not None, buttons.any):
            raise document.error(
                "engine-unsupported",
                ("firmware", "start_pin" if buttons.start else "stop_pin"),
                "no engine reads both a serial line and buttons",
                "remove [stream], or start_pin and stop_pin",
            )
    elif check_frame := ENGINES[wanted.engine].check_frame:
        check_frame(servos, frame, clock)
    firmware = Firmware(
        wanted.dialect,
        wanted.engine,
        exact(wanted.soft_start_s),
        wanted.max_error_us,
        buttons,
        document.place("firmware", "soft_start_s"),
    )
    return firmware, stream


def _buttons(document: Document, table: FirmwareTable, servos: Sequence[Servo]) -> Buttons:
    """Return the start button and the emergency stop. Raises InputError."""
    buttons: dict[str, Button] = {}
    for name in ("start", "stop"):
        pin = getattr(table, f"{name}_pin")
        if pin is None:
            for key in (f"{name}_level", f"{name}_pulses"):
                if key in document.data.get("firmware", {}):
                    raise document.error(
                        "missing-key", ("firmware", key), f"there is no {name}_pin", "add it"
                    )
            continue
        where = ("firmware", f"{name}_pin")
        if table.engine != AUTO and not ENGINES[table.engine].buttons:
            raise document.error(
                "engine-unsupported",
                where,
                f"the {table.engine} engine reads no buttons",
                'write engine = "player"',
            )
        if pin not in PINS:
            raise document.error("unknown-pin", where, f"unknown pin '{pin}'", did_you_mean(pin, PINS))
        taken = {servo.pin: servo.name for servo in servos}
        taken |= {button.pin: name for name, button in buttons.items()}
        if pin in taken:
            raise document.error(
                "pin-in-use", where, f"{pin} is in use: {taken[pin]}", "a button needs its own pin"
            )
        level = int(getattr(table, f"{name}_level") == "high")
        buttons[name] = Button(pin, level, document.place(*where))
    return Buttons(buttons.get("start"), buttons.get("stop"), table.stop_pulses != "hold")


def _stream(document: Document, table: JobTable, servos: Sequence[Servo], clock: Clock) -> Stream | None:
    """Return the serial line of a job with [stream], or whose engine reads one. Raises InputError."""
    engine = table.firmware.engine
    serial = engine != AUTO and ENGINES[engine].serial
    if table.stream is None and not serial:
        return None
    if engine != AUTO and not serial:
        raise document.error(
            "engine-unsupported",
            ("stream",),
            f"the {engine} engine reads no serial line",
            'write engine = "stream", or omit engine',
        )
    given = table.stream or StreamTable()
    if len(servos) > MAX_SERVOS:
        raise document.error(
            "does-not-fit",
            ("servo", MAX_SERVOS),
            f"the stream engine drives up to {MAX_SERVOS} servos, not {len(servos)}",
        )
    taken = {servo.pin: servo.name for servo in servos}
    for name, pin in (("receive_pin", given.receive_pin), ("transmit_pin", given.transmit_pin)):
        if pin is None:
            continue
        key = ("stream", name)
        if pin not in PINS:
            raise document.error("unknown-pin", key, f"unknown pin '{pin}'", did_you_mean(pin, PINS))
        if pin in taken:
            raise document.error(
                "pin-in-use", key, f"{pin} is in use: {taken[pin]}", "the line needs its own pins"
            )
        taken[pin] = name
    _check_transmit_pin(document, given.transmit_pin, servos)
    stream = Stream(
        given.baud,
        given.receive_pin,
        given.transmit_pin,
        exact(given.silence_s),
        given.fail_safe,
        document.place("stream", "baud"),
    )
    bit_units(stream, clock)
    return stream


def _check_transmit_pin(document: Document, pin: str | None, servos: Sequence[Servo]) -> None:
    """Raise InputError for a pin that cannot drive a line high, or whose port has servos.

    A pulse's edge is a write to the whole of its port.
    """
    key = ("stream", "transmit_pin")
    if pin == OPEN_DRAIN_PIN:
        raise document.error(
            "open-drain", key, f"{OPEN_DRAIN_PIN} is an open drain: it cannot drive a line high"
        )
    neighbours = [servo.name for servo in servos if pin is not None and servo.pin[1] == pin[1]]
    if neighbours:
        raise document.error(
            "pin-in-use",
            key,
            f"{pin} is on the port of {neighbours[0]}",
            "the answers need a port without servos",
        )
