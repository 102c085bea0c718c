"""Why a run is refused, and how far one may go."""

from __future__ import annotations

import re

import numpy as np
import pytest

from servogen.checker import Checked, Refused, check, check_certificate, read_certificate
from servogen.checker.certificate import WIDTH as STATE_WIDTH
from servogen.checker.certificate import Certificate
from servogen.checker.check import Checker
from servogen.checker.plan import read_plan
from servogen.pic.image import Image
from tests.checker import certify
from tests.checker.certify import PERIOD, STOP, WIDTH
from tests.prove import attack

FRAME = 6
"""The address at which a frame of the test programs begins."""
PLAIN, SCHEDULE = certify.plain_program(), certify.schedule()
BUTTON, STOPPABLE = certify.button_program(), certify.schedule(STOP)


FAULTS = ("SLEEP while pulses are due",
          "a pin whose level is unknown or not driven", "a word that is not an instruction",
          "an edge that is not expected", "a stack of more than eight levels")  # fmt: skip


def refusal(image: Image, schedule: bytes, cuts: list[int]) -> str:
    with pytest.raises(Refused) as refused:
        certify.certify(image, schedule, cuts)
    return str(refused.value)


def verdict(packed: bytes, image: Image, schedule: bytes) -> Checked:
    return check_certificate(read_certificate(packed, "c"), image, schedule, "schedule.json")


@pytest.mark.parametrize(
    ("clear", "why"),
    [
        ("bsf 3,5\n bsf 8,1\n bcf 3,5", "an EEPROM write without its sequence"),
        ("sleep", "SLEEP while pulses are due"),
        ("movf 0x30,w\n movwf 0x0b", "an unknown value in a register"),
        ("bsf 3,5\n movf 0x30,w\n movwf 1\n bcf 3,5", "an unknown value in a register"),
        ("bsf 3,5\n movf 0x30,w\n movwf 6\n bcf 3,5", "an unknown value in a register"),
        ("bsf 3,5\n bsf 6,0\n bcf 3,5", "a pin whose level is unknown or not driven"),
        ("movf 0x30,w\n movwf 6", "a pin whose level is unknown or not driven"),
        ("dw 1", "a word that is not an instruction"),
        ("bsf 6,3", "an edge that is not expected"),
        ("call $+1\n call $+1\n call $+1\n call $+1\n call $+1\n call $+1\n call $+1\n call $+1\n call $+1",
         "a stack of more than eight levels"),
    ],
)  # fmt: skip
def test_what_a_program_does_between_its_pulses(clear: str, why: str) -> None:
    text = refusal(certify.plain_program(clear=clear), SCHEDULE, [FRAME])
    assert text.endswith(f": {why}")
    outside = why not in FAULTS
    assert text.endswith(f": the checker does not cover: {why}") == outside
    assert re.match(r"\d+ cycles after power-up, at address 0x\w{3}, frame 0, cycle \d+, high pins: ", text)


@pytest.mark.parametrize(("latch", "refused"), [("clrf 6", False), ("nop", True)])
def test_a_first_pulse_may_not_have_begun_before_on_a_chip_whose_latch_is_set(
    latch: str, refused: bool
) -> None:
    """RB0 is driven from its latch for five cycles, and then high: on some chips the pulse is longer."""
    start = certify.SET_UP.replace(" clrf 6\n bsf 3,5\n clrf 6", f" {latch}\n bsf 3,5\n movlw 0xFE\n movwf 6")
    end = f"{certify.delay(WIDTH - 1)} bcf 6,0\n{certify.delay(PERIOD - WIDTH - 3)} goto frame\n"
    program = certify.image_of(start + end)
    if refused:
        assert refusal(program, SCHEDULE, [FRAME + 1]).endswith("a pin whose level is unknown or not driven")
    else:
        certify.certify(program, SCHEDULE, [FRAME + 1])


@pytest.mark.parametrize(
    ("read", "why"),
    [
        ("movf 5,w\n btfss 5,4", "an input is read again"),
        ("btfsc 5,4\n nop\n btfss 5,4", "an input is read again"),
        ("btfss 5,0", "an input was not read in the frame"),
    ],
)
def test_an_input_is_read_once_in_each_frame(read: str, why: str) -> None:
    cuts = [FRAME, max(BUTTON.program)]
    assert refusal(certify.button_program(read=read), STOPPABLE, cuts).endswith(why)


def test_a_run_comes_to_a_cut_within_500_periods() -> None:
    text = refusal(PLAIN, SCHEDULE, [])
    cycles = int(text.split(" ", 1)[0])
    assert 500 * PERIOD <= cycles <= 500 * PERIOD + 1
    assert text.endswith("the cycle limit")


def test_a_frame_late_is_a_missing_edge_one_cycle_after_it_was_due() -> None:
    """The fall of the pulse is due in cycle 300 of the frame; a pulse of 310 cycles has none before 301."""
    text = refusal(certify.plain_program(width=WIDTH + 10), SCHEDULE, [FRAME])
    cycle = int(re.findall(r"frame 0, cycle (\d+)", text)[0])
    assert text.endswith("a missing edge")
    assert WIDTH + 1 <= cycle <= WIDTH + 2


def test_how_states_are_taken_together_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    packed = certify.certify(BUTTON, STOPPABLE, [FRAME, max(BUTTON.program)])
    found = verdict(packed, BUTTON, STOPPABLE)
    assert found.states == certify.unpack(packed)["count"] > 2
    for name, value in (("ROWS", 1), ("ROWS", 2), ("PAUSE", 1), ("PAUSE", 10_000)):
        with monkeypatch.context() as patched:
            patched.setattr(check, name, value)
            again = verdict(packed, BUTTON, STOPPABLE)
            assert (again.states, again.frames, again.cycles) == (found.states, found.frames, found.cycles)


def test_as_many_cycles_are_run_as_are_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    packed = certify.certify(PLAIN, SCHEDULE, [FRAME])
    monkeypatch.setattr(check, "MAX_CYCLES", FRAME + 2 * PERIOD)
    verdict(packed, PLAIN, SCHEDULE)
    monkeypatch.setattr(check, "MAX_CYCLES", FRAME + 2 * PERIOD - 1)
    with pytest.raises(Refused, match="more cycles, or ways, than are allowed"):
        verdict(packed, PLAIN, SCHEDULE)


def test_a_frame_in_which_nothing_is_read_twice_splits_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two ways from one: they are as many as may wait."""
    packed = certify.certify(BUTTON, STOPPABLE, [FRAME, max(BUTTON.program)])
    monkeypatch.setattr(check, "MAX_ROWS", 2 * certify.unpack(packed)["count"])
    verdict(packed, BUTTON, STOPPABLE)
    monkeypatch.setattr(check, "MAX_ROWS", 1)
    with pytest.raises(Refused, match="more cycles, or ways, than are allowed"):
        verdict(packed, BUTTON, STOPPABLE)


def test_a_forged_state_ends_the_check_before_the_other_ends_of_an_eeprom_write_are_followed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The program polls WR: a write that may be over in any of 1333 turns splits it as often."""
    case = attack.target("waits for the EEPROM")
    claim = Certificate(
        "", "", 0, {}, frozenset({max(case.image.program)}), [], np.zeros((0, STATE_WIDTH), np.int64)
    )
    monkeypatch.setattr(check, "MAX_RUNS", 10)
    with pytest.raises(Refused, match="the state is within no listed one"):
        Checker(case.image, read_plan(case.text, "schedule.json"), claim).check()
