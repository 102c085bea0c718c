"""A program that follows the wire of another chip, whatever that wire does: proven by both, or not."""

from __future__ import annotations

from dataclasses import replace
from shutil import which
from typing import Any

import pytest

from servogen.checker import Refused, check_certificate, read_certificate
from servogen.edges import HIGH, PINS, join
from servogen.engines.board import board_of
from servogen.pic.image import Image
from servogen.prove import Proof, certificate, prove_for_all
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import ButtonRule, Input
from servogen.simulator import Machine, SimulatorOptions, parse_stimuli
from servogen.units import Cycles
from servogen.workflows.certificates import second_witness
from tests.prove.gpsim_runs import gpsim_levels
from tests.prove.wire_judge import fault
from tests.prove.wired import LOOK, PERIOD, QUIET, WIRE, first_chip, schedules, second_chip, wait

SCHEDULE = schedules()[1]


def proven(image: Image, schedule: PulseSchedule = SCHEDULE) -> Proof:
    return prove_for_all(image, schedule, max_states=3000)


def changed(old: str, new: str) -> Image:
    """The second chip with a part of its text replaced."""
    return second_chip(old, new)


def pin_edges(image: Image, stimuli: str, options: SimulatorOptions, end: int) -> list[tuple[int, int, int]]:
    machine = Machine(image, SCHEDULE.clock, options, parse_stimuli(stimuli, "it.toml", SCHEDULE.clock))
    chunk = join(machine.stream(Cycles(end)))
    found, high = [], 0
    for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):
        now = int(level == HIGH)
        if high >> pin & 1 != now:
            high ^= 1 << pin
            found.append((cycle, ["RB0"].index(PINS[pin]), now))
    return found


@pytest.fixture(scope="module")
def right() -> Proof:
    return proven(second_chip())


def test_whatever_the_wire_does_whole_frames_follow_its_rises_and_both_witnesses_say_so(right: Proof) -> None:
    assert right.proven, right.reason
    text = SCHEDULE.json_text().encode()
    witness = second_witness(right, second_chip(), SCHEDULE, text)
    assert witness.text == "proven, checked"


WRONG = {
    "a pulse is a cycle longer": (wait(259), wait(260)),
    "a dip of a cycle counts as a rise": (
        LOOK,
        LOOK.replace("comf PORTA, w\n        andwf", "movf PORTA, w\n        xorwf"),
    ),
    "two cycles of lateness are not found": ("        movlw 2\n", "        movlw 1\n"),
    "a frame counts as quiet": ("wire    movlw 64", "wire    movlw 50"),
    "the last read of the look has no effect": (
        LOOK,
        LOOK.replace("        andwf PORTA, w\n        movwf", "        nop\n        movwf"),
    ),
    "the wire is looked at a cycle late": ("        nop\nlater", "        nop\n        nop\nlater"),
    "pulses go on without the wire": (
        "        btfss 0x23, 1\n        goto wire",
        "        goto $+1",
    ),
    "it never awaits a rise": ("        goto rise\n", "        goto wire\n"),
    "it sleeps while it awaits the rise": ("rise    btfss", "rise    sleep\n        btfss"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_program_that_does_otherwise_is_not_proven_and_a_counterexample_is_one(what: str) -> None:
    image = changed(*WRONG[what])
    assert image != second_chip()
    proof = proven(image)
    assert not proof.proven
    shown = proof.counterexample
    if shown is not None:
        stimuli = shown.stimulus(SCHEDULE.clock)
        end, begin = shown.cycle + 2 * PERIOD, 0 if shown.reset is None else shown.reset + 2
        wire = next(levels for pin, levels in shown.levels if pin == WIRE)
        assert fault(SCHEDULE, wire, pin_edges(image, stimuli, shown.options, end), begin, end)


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("a pulse is a cycle longer", "comes 1 cycle late"),
        ("a dip of a cycle counts as a rise", "is not the schedule's"),
        ("two cycles of lateness are not found", "the first pulse comes in cycle"),
        ("the wire is looked at a cycle late", "no pulse comes"),
        ("pulses go on without the wire", "is not the schedule's"),
    ],
)
def test_what_a_counterexample_says(what: str, says: str) -> None:
    shown = proven(changed(*WRONG[what])).counterexample
    assert shown is not None and says in shown.message


@pytest.mark.parametrize("what", WRONG)
def test_the_checker_refuses_the_right_programs_certificate_for_another_one(right: Proof, what: str) -> None:
    text, image = SCHEDULE.json_text().encode(), changed(*WRONG[what])
    claim = read_certificate(certificate(right, image, SCHEDULE, text), "it")
    with pytest.raises(Refused):
        check_certificate(claim, image, text, "schedule.json")


OTHER_RULES: dict[str, dict[str, Any]] = {
    "the pulses come a cycle later": {"cycles": Cycles(11)},
    "the first frame is another": {"frames": 2},
    "less counts as quiet": {"quiet": Cycles(QUIET - 16)},
    "more counts as quiet": {"quiet": Cycles(QUIET + 1)},
    "the wire is at another pin": {"pin": "RA2"},
}


@pytest.mark.parametrize("what", OTHER_RULES)
def test_a_program_is_not_proven_for_another_rule(what: str) -> None:
    assert SCHEDULE.wire is not None
    schedule = replace(SCHEDULE, wire=replace(SCHEDULE.wire, **OTHER_RULES[what]))
    proof = proven(second_chip(), schedule)
    assert not proof.proven


RESTART = f"""
        bsf STATUS, RP0
        movlw 0x0F
        movwf TRISA
{wait(20)}
        movlw 0x1F
        movwf TRISA
        bcf STATUS, RP0
"""
BEGIN = "wire    movlw 64"
RESTARTS = replace(SCHEDULE, wire=SCHEDULE.wire and replace(SCHEDULE.wire, restart="RA4", pulled=Cycles(22)))


@pytest.fixture(scope="module")
def restarts() -> Proof:
    return proven(changed(BEGIN, RESTART + BEGIN), RESTARTS)


def test_that_the_other_chip_is_reset_before_the_wire_is_read_is_proven_by_both(restarts: Proof) -> None:
    assert restarts.proven, restarts.reason
    image, text = changed(BEGIN, RESTART + BEGIN), RESTARTS.json_text().encode()
    assert second_witness(restarts, image, RESTARTS, text).text == "proven, checked"


NO_RESTART = {
    "never": BEGIN,
    "a cycle too short": RESTART.replace(wait(20), wait(19)) + BEGIN,
    "twice": RESTART + RESTART + BEGIN,
    "whenever the wire is awaited": BEGIN + RESTART,
    "without an end": RESTART.replace("movlw 0x1F", "movlw 0x0F") + BEGIN,
    "after a look at the wire": "        btfss PORTA, 1\n        nop\n" + RESTART + BEGIN,
}


@pytest.mark.parametrize("when", NO_RESTART)
def test_a_chip_that_resets_the_other_at_another_time_is_accepted_by_neither(
    restarts: Proof, when: str
) -> None:
    image, text = changed(BEGIN, NO_RESTART[when]), RESTARTS.json_text().encode()
    assert not proven(image, RESTARTS).proven
    claim = read_certificate(certificate(restarts, image, RESTARTS, text), "it")
    with pytest.raises(Refused, match=r"another chip|first chip"):
        check_certificate(claim, image, text, "schedule.json")


def logged(number: int, image: Image, changes: list[tuple[int, int, int]]) -> list[tuple[int, int]]:
    """(cycle, levels of all pins) at each change of a chip's pins in gpsim, which counts from 1 less."""
    schedule = schedules()[number]
    start = Machine(image, schedule.clock, board_of(schedule)).state()
    servos = [channel.pin for channel in schedule.channels]
    edges = gpsim_levels(
        image, start, [(cycle - 1, pin, level) for cycle, pin, level in changes], 30 * PERIOD, servos
    )
    return [(cycle + 1, levels) for cycle, levels in edges]


@pytest.mark.skipif(which("gpsim") is None, reason="gpsim is not installed")
def test_gpsim_shows_the_same_edges_of_both_chips() -> None:
    """It runs one chip at a time: the edges on the first one's pin are what the second one's pin gets."""
    wire, servo = PINS.index(WIRE), 1 << PINS.index("RB0")
    first = logged(0, first_chip(), [])
    assert first[0] == (12 * PERIOD + 8, servo)
    changes = [(cycle, wire, int(levels == servo)) for cycle, levels in first]
    seen = logged(1, second_chip(), changes)
    assert len(seen) == 30 and seen[0] == (first[0][0] + 3 * PERIOD + 10, servo)
    times, values = (
        [0, *column] for column in zip(*((cycle, level) for cycle, _, level in changes), strict=True)
    )
    text = f'[[level]]\npin = "{WIRE}"\nat_us = {times}\nlevel = {values}\n'
    own = pin_edges(second_chip(), text, board_of(SCHEDULE), 30 * PERIOD)
    assert [(cycle, level * servo) for cycle, _, level in own] == seen


BUTTON = Input("RB5", 0)


@pytest.mark.parametrize(
    "other",
    [
        replace(SCHEDULE, buttons=ButtonRule(BUTTON, None, True, 1)),
        replace(SCHEDULE, inputs=(BUTTON,)),
    ],
)
def test_a_schedule_that_also_has_other_inputs_is_not_proven_as_if_it_had_none(other: PulseSchedule) -> None:
    """The theorem of a wire says nothing of them, and the program does not read them."""
    found = proven(second_chip(), other)
    assert not found.proven and "reads other inputs" in found.reason
