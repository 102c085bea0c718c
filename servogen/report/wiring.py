"""What is connected to which pin of the chip: a table for every report, and the package seen from above.

In: a job. Out: `Wire`s, the servos' first, and `PackagePin`s with their places in a drawing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from servogen.engines.inputs import given
from servogen.engines.inputs.commands import CommandButton, CommandLine
from servogen.engines.inputs.tape import SDA, Tape
from servogen.engines.inputs.wire import FrameWire
from servogen.job import Job
from servogen.pic.device import OPEN_DRAIN_PIN, PACKAGE
from servogen.report.drawing import PALETTE
from servogen.robot.servo import Servo

PACKAGE_ROWS = len(PACKAGE) // 2
TOP, ROW = 24, 26
"""The first pin's y in the drawing, and the distance between pins."""


@dataclass(frozen=True, slots=True)
class Wire:
    """Pin `number` of the package, its name and connection; `servo` if that is a servo's signal."""

    number: int
    pin: str
    use: str
    servo: Servo | None = None


def wires(job: Job) -> Iterator[Wire]:
    """Yield the wires of the servos, the buttons, the lines, the supply and the crystal."""
    numbers = {pin.name: pin.number for pin in PACKAGE}
    for servo in job.servos:
        yield Wire(numbers[servo.pin], servo.pin, f"signal of servo '{servo.name}'", servo)
    buttons, stream = job.buttons, job.stream
    for name, button in (("start", buttons.start), ("stop", buttons.stop)):
        if button:
            yield Wire(numbers[button.pin], button.pin, f"{name} {button.text()}")
    commands = job.commands
    if isinstance(commands, CommandLine):
        yield Wire(numbers[commands.pin], commands.pin, "commands, 5 V, high at rest, 10 kOhm pull-up to VDD")
    elif isinstance(commands, CommandButton):
        button = commands.button
        yield Wire(numbers[button.pin], button.pin, f"{commands.name} {button.text()}")
    elif commands:
        for name, button in commands.buttons.items():
            yield Wire(numbers[button.pin], button.pin, f"{name} {button.text()}")
    if stream:
        pin = stream.receive_pin
        yield Wire(numbers[pin], pin, f"serial line in, {stream.baud} baud, 5 V, idle high")
        if stream.transmit_pin:
            yield Wire(numbers[stream.transmit_pin], stream.transmit_pin, "serial line out, 5 V, idle high")
    tape = given(job.inputs, Tape)
    if tape is not None:
        for line, pin in (("SCL (6)", tape.scl), ("SDA (5)", SDA)):
            yield Wire(numbers[pin], pin, f"{line} of the {tape.eeprom}, 4.7 kOhm to VDD")
        if tape.error_pin is not None:
            yield Wire(numbers[tape.error_pin], tape.error_pin, "out: high once the tape could not be read")
    chips = given(job.inputs, FrameWire)
    crystal, reset = ("crystal, 22 pF to VSS", "crystal, 22 pF to VSS"), "10 kOhm to VDD"
    if chips is not None:
        end = "from the first" if chips.follows else "to the second"
        use = f"wire {end} chip's {chips.other}{', 10 kOhm pull-down to ground' if chips.follows else ''}"
        yield Wire(numbers[chips.pin], chips.pin, use)
        if chips.restart and chips.follows:
            yield Wire(numbers[chips.restart], chips.restart, "MCLR of the first chip, through a jumper")
        elif chips.restart:
            reset += f", and {chips.restart} of the second chip through a jumper"
        if not chips.crystal_ppm:
            crystal = (
                ("OSC2 of the first chip", "nothing")
                if chips.follows
                else (crystal[0], f"{crystal[1]}, and OSC1 of the second chip")
            )
    for pin, use in (
        ("VDD", "+5 V, 100 nF to VSS"),
        ("VSS", "ground, also of the servos' supply"),
        ("MCLR", reset),
        ("OSC1", crystal[0]),
        ("OSC2", crystal[1]),
    ):
        yield Wire(numbers[pin], pin, use)


def open_drain(job: Job) -> Iterator[str]:
    """Yield what a servo on the open drain needs."""
    if any(servo.pin == OPEN_DRAIN_PIN for servo in job.servos):
        yield f"{OPEN_DRAIN_PIN} is open drain: it needs a pull-up resistor, 1 to 10 kOhm to VDD."


def remarks(job: Job) -> Iterator[str]:
    """Yield remarks: the current with all servos stalled, the servos' supply, the function of the inputs."""
    known = [servo.model.max_a for servo in job.servos if servo.model.max_a is not None]
    unknown = sorted({servo.model.name for servo in job.servos if servo.model.max_a is None})
    if known:
        yield f"Peak current of the servos: {round(1000 * sum(known))} mA ({len(known)} at once)."
    if unknown:
        yield f"Peak current not stated by the maker of: {', '.join(unknown)}."
    yield "The servos take it from a supply of their own, not through the chip's."
    if given(job.inputs, Tape) is not None:
        yield "The EEPROM holds tape.bin: pins 1 to 4 (A0 to A2, VSS) to ground, 8 (VCC) and 7 (WP) to +5 V."
    yield from job.buttons.text()
    if job.commands:
        yield from job.commands.text()


@dataclass(frozen=True, slots=True)
class PackagePin:
    """A leg of the chip in the drawing of its package: what is on it, and the colour if that is a servo."""

    number: int
    name: str
    servo: str
    colour: str
    y: int
    left: bool


def package(servos: Sequence[Servo], tape: Tape | None = None) -> tuple[PackagePin, ...]:
    """Return the DIP from above: pins 1 to 9 down the left side, 18 to 10 down the right."""
    lines = {tape.scl: "SCL, 4.7 kΩ", SDA: "SDA, 4.7 kΩ"} if tape else {}
    index = {servo.pin: number for number, servo in enumerate(servos)}
    pins = []
    for pin in PACKAGE:
        left = pin.number <= PACKAGE_ROWS
        row = pin.number - 1 if left else len(PACKAGE) - pin.number
        number = index.get(pin.name)
        servo = lines.get(pin.name, "") if number is None else servos[number].name
        colour = "" if number is None else PALETTE[number % len(PALETTE)]
        pins.append(
            PackagePin(
                number=pin.number, name=pin.name, servo=servo, colour=colour, y=TOP + ROW * row, left=left
            )
        )
    return tuple(pins)
