"""[stream] of a job -> `Stream`: pins that exist and that no servo has, a rate that goes with the clock.

In: the checked tables and the servos. Out: the stream, None where the job's engine is another one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from servogen.edges import PINS
from servogen.engines.stream.protocol import MOST_SERVOS
from servogen.engines.stream.settings import Stream, bit_units
from servogen.errors import did_you_mean
from servogen.job.schema import JobTable, StreamTable
from servogen.motion import JointTrajectory
from servogen.pic.device import OPEN_DRAIN_PIN
from servogen.robot.servo import Servo
from servogen.toml.file import Document, exact
from servogen.units import Clock, Cycles

ENGINE = "stream"


def stream_of(document: Document, table: JobTable, servos: Sequence[Servo], clock: Clock) -> Stream | None:
    """The serial line of a stream job. Raises InputError."""
    engine = table.firmware.engine
    if table.stream is None and engine != ENGINE:
        return None
    if engine not in (ENGINE, "auto"):
        raise document.error(
            "engine-unsupported",
            ("stream",),
            f"the {engine} engine hears no serial line",
            'write engine = "stream", or leave it',
        )
    given = table.stream or StreamTable()
    if len(servos) > MOST_SERVOS:
        raise document.error(
            "too-many-servos",
            ("servo", MOST_SERVOS),
            f"the stream engine has up to {MOST_SERVOS} servos, not {len(servos)}",
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
                "pin-in-use", key, f"{pin} is in use: {taken[pin]}", "the line has pins of its own"
            )
        taken[pin] = name
    _check_transmit_pin(document, given.transmit_pin, servos)
    made = Stream(
        given.baud,
        given.receive_pin,
        given.transmit_pin,
        exact(given.silence_s),
        given.fail_safe,
        document.place("stream", "baud"),
    )
    bit_units(made, clock)
    return made


def _check_transmit_pin(document: Document, pin: str | None, servos: Sequence[Servo]) -> None:
    """It must be able to go high, and a pulse's edge is a write to all of its port."""
    key = ("stream", "transmit_pin")
    if pin == OPEN_DRAIN_PIN:
        raise document.error(
            "open-drain", key, f"{OPEN_DRAIN_PIN} is an open drain: it cannot drive a line high"
        )
    beside = [servo.name for servo in servos if pin is not None and servo.pin[1] == pin[1]]
    if beside:
        raise document.error(
            "pin-in-use",
            key,
            f"{pin} is on the port of {beside[0]}",
            "the answers need a port without servos",
        )


def still(servos: Sequence[Servo], period: Cycles, clock: Clock) -> JointTrajectory:
    """The motion of a stream job that has none: the neutral pose."""
    names = tuple(servo.name for servo in servos)
    angles = np.array([[servo.neutral for servo in servos]])
    return JointTrajectory(names, clock, period, angles, 0)
