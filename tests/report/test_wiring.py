"""What is connected to each pin, and the package as it is drawn, against the data sheet and the job file."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from servogen.engines.inputs import given
from servogen.engines.inputs.buttons import ButtonPin
from servogen.engines.inputs.commands import CommandButton, CommandButtons, CommandLine
from servogen.engines.inputs.tape import Tape
from servogen.job import Job, loads
from servogen.report.drawing import PALETTE
from servogen.report.wiring import open_drain, package, remarks, wires
from servogen.template_files import template_folder
from tests.engines.tape.tape_jobs import job as tape_job

CHIP = '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
SERVO = '[[servo]]\nname = "{name}"\npin = "{pin}"\nmodel = "futaba-s3001"\n'
ARM = CHIP + SERVO.format(name="arm", pin="RB0")
MOTION = "[motion]\nposes = [{ arm_deg = 0, hold_s = 0.1 }]\n"

SUPPLY = [  # DS35007: figure 6-1 and table 1-1, DIP-18
    (14, "VDD", "+5 V, 100 nF to VSS"),
    (5, "VSS", "ground, also of the servos' supply"),
    (4, "MCLR", "10 kOhm to VDD"),
    (16, "OSC1", "crystal, 22 pF to VSS"),
    (15, "OSC2", "crystal, 22 pF to VSS"),
]
OWN = "The servos take it from a supply of their own, not through the chip's."


def job(text: str) -> Job:
    return loads(text, "job.toml")


def listed(found: Job) -> list[tuple[int, str, str]]:
    return [(wire.number, wire.pin, wire.use) for wire in wires(found)]


def commanded(commands: Any) -> Job:
    plain = job(ARM + MOTION)
    return replace(plain, inputs=() if commands is None else (commands,))


def test_servos_come_first_and_the_supply_last() -> None:
    found = job(
        ARM
        + SERVO.format(name="hand", pin="RA1")
        + MOTION.replace("arm_deg = 0", "arm_deg = 0, hand_deg = 0")
    )
    assert listed(found) == [
        (6, "RB0", "signal of servo 'arm'"),
        (18, "RA1", "signal of servo 'hand'"),
        *SUPPLY,
    ]
    assert [wire.servo for wire in wires(found)] == [*found.servos, *[None] * 5]


def test_the_buttons_of_the_player_are_wired_to_the_rail_of_their_level() -> None:
    firmware = '[firmware]\nengine = "player"\nstart_pin = "RB1"\nstop_pin = "RB2"\nstop_level = "high"\n'
    found = job(ARM + MOTION + firmware)
    assert listed(found)[1:-5] == [
        (7, "RB1", "start button to ground, 10 kOhm pull-up to VDD"),
        (8, "RB2", "stop button to VDD, 10 kOhm pull-down to ground"),
    ]
    one = job(ARM + MOTION + firmware.replace('start_pin = "RB1"\n', ""))
    assert listed(one)[1:-5] == [(8, "RB2", "stop button to VDD, 10 kOhm pull-down to ground")]
    assert [*remarks(found)][2:] == [*found.buttons.text()]
    assert [*found.buttons.text()]


def test_a_walk_on_command_has_a_line_a_button_or_a_button_for_each_direction() -> None:
    line = commanded(CommandLine("RA4"))
    assert listed(line)[1:-5] == [(3, "RA4", "commands, 5 V, high at rest, 10 kOhm pull-up to VDD")]
    one = commanded(CommandButton(ButtonPin("RA3", 1)))
    assert listed(one)[1:-5] == [(2, "RA3", "walk button to VDD, 10 kOhm pull-down to ground")]
    several = commanded(CommandButtons({"forward": ButtonPin("RA0", 0), "left": ButtonPin("RB7", 1)}))
    assert listed(several)[1:-5] == [
        (17, "RA0", "forward button to ground, 10 kOhm pull-up to VDD"),
        (13, "RB7", "left button to VDD, 10 kOhm pull-down to ground"),
    ]
    for found in (line, one, several):
        commands: Any = found.commands
        assert [*remarks(found)][2:] == [*commands.text()]
    assert len([*remarks(commanded(None))]) == 2


@pytest.mark.parametrize(("transmit", "count"), [("", 1), ('transmit_pin = "RA2"\n', 2)])
def test_a_serial_line_has_an_input_and_perhaps_an_output(transmit: str, count: int) -> None:
    found = job(f"{ARM}[stream]\nbaud = 1200\n{transmit}")
    both = [
        (3, "RA4", "serial line in, 1200 baud, 5 V, idle high"),
        (1, "RA2", "serial line out, 5 V, idle high"),
    ]
    assert listed(found)[1:-5] == both[:count]


def test_a_servo_on_the_open_drain_needs_a_resistor() -> None:
    """DS35007 section 4.1: RA4 is an open drain."""
    assert [*open_drain(job(ARM + MOTION))] == []
    both = ARM.replace('"RB0"', '"RA4"\nopen_drain = true') + SERVO.format(name="b", pin="RB1")
    needed = "RA4 is open drain: it needs a pull-up resistor, 1 to 10 kOhm to VDD."
    assert [*open_drain(job(both + MOTION))] == [needed]


def test_the_peak_current_is_the_sum_of_those_that_are_known() -> None:
    """720 mA of a Futaba S3001 at stall (shown by `servogen robots`); a servo of one's own states none."""
    two = job(ARM + SERVO.format(name="b", pin="RB1") + MOTION)
    assert [*remarks(two)] == ["Peak current of the servos: 1440 mA (2 at once).", OWN]
    unknown = [
        replace(servo, model=replace(servo.model, max_a=None, name=name))
        for servo, name in zip(two.servos, ("z", "a"), strict=True)
    ]
    assert [*remarks(replace(two, servos=(two.servos[0], *unknown)))] == [
        "Peak current of the servos: 720 mA (1 at once).",
        "Peak current not stated by the maker of: a, z.",
        OWN,
    ]
    assert [*remarks(replace(two, servos=tuple(unknown)))] == [
        "Peak current not stated by the maker of: a, z.",
        OWN,
    ]


def test_the_pins_are_drawn_in_two_even_rows_of_nine_inside_the_package() -> None:
    """Pins 1 to 9 from the top at the left, 10 to 18 from the bottom at the right, 26 apart."""
    servos = job(
        ARM + SERVO.format(name="b", pin="RA4").replace("model", "open_drain = true\nmodel") + MOTION
    ).servos
    pins = {pin.number: pin for pin in package(servos)}
    assert [pins[number].left for number in range(1, 19)] == [True] * 9 + [False] * 9
    for number in range(1, 10):
        assert pins[number].y == pins[19 - number].y == 24 + 26 * (number - 1)
    page = (Path(template_folder()) / "report.html.j2").read_text()
    body = re.search(r'<rect x="110" y="(\d+)" width="100" height="(\d+)"', page)
    assert body
    top, height = map(int, body.groups())
    assert top + 13 < pins[1].y < pins[9].y < top + height - 13  # half a row is free at both ends
    found = {number: (pin.servo, pin.colour) for number, pin in pins.items() if pin.servo or pin.colour}
    assert found == {6: ("arm", PALETTE[0]), 3: ("b", PALETTE[1])}


def test_the_thirteen_pins_have_colours_of_their_own_and_a_fourteenth_servo_the_first() -> None:
    servo = job(ARM + MOTION).servos[0]
    pins = [f"RB{n}" for n in range(8)] + [f"RA{n}" for n in range(5)]
    drawn = package([replace(servo, name=pin, pin=pin) for pin in pins])
    assert {pin.name: pin.colour for pin in drawn if pin.servo} == dict(zip(pins, PALETTE, strict=True))
    again = package(
        [*(replace(servo, name=pin, pin=pin) for pin in pins), replace(servo, name="x", pin="RB0")]
    )
    assert [(pin.servo, pin.colour) for pin in again if pin.name == "RB0"] == [("x", PALETTE[0])]


def test_the_bus_of_a_tape_stands_beside_its_pins_with_its_resistors() -> None:
    taped = tape_job(tape='scl_pin = "RA2"\nerror_pin = "RA0"', foot="RB2")
    tape = given(taped.inputs, Tape)
    drawn = {pin.name: pin.servo for pin in package(taped.servos, tape) if pin.servo}
    bus = {"RA2": "SCL, 4.7 kΩ", "RA4": "SDA, 4.7 kΩ"}
    assert drawn == {"RB0": "arm", "RB1": "hand", "RB2": "foot", **bus}
    uses = {wire.pin: wire.use for wire in wires(taped)}
    assert uses["RA2"] == "SCL (6) of the 24LC256, 4.7 kOhm to VDD" and "high once" in uses["RA0"]
