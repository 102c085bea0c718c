"""A program with a crystal of its own that follows the wire of another chip, whatever that wire does."""

from __future__ import annotations

from dataclasses import replace

import pytest

from servogen.checker import Refused, check_certificate, read_certificate
from servogen.errors import InputError
from servogen.pic.image import Image
from servogen.prove import Proof, certificate, prove_for_all
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import awaited_early
from servogen.units import Cycles
from servogen.workflows.certificates import second_witness
from tests.prove.wired import LOOKS, OWN_LOOK, OWN_PPM, PERIOD, own_schedules, own_second_chip, wait

SCHEDULE = own_schedules()[1]
TEXT = SCHEDULE.json_text().encode()


def proven(image: Image, schedule: PulseSchedule = SCHEDULE) -> Proof:
    return prove_for_all(image, schedule, max_states=3000)


@pytest.fixture(scope="module")
def right() -> Proof:
    return proven(own_second_chip())


def test_each_frame_follows_the_look_that_sees_its_rise_whatever_the_wire_does(right: Proof) -> None:
    """Also where the first rise is awaited as seldom as may be, every 4 cycles."""
    seldom = own_second_chip("rise    btfss", "rise    nop\n        btfss")
    for image, proof in ((own_second_chip(), right), (seldom, proven(seldom))):
        assert proof.proven, proof.reason
        assert second_witness(proof, image, SCHEDULE, TEXT).text == "proven, checked"


def test_looks_begin_before_any_rise_that_was_seen_four_cycles_late_and_end_after_the_latest() -> None:
    """The fastest and the slowest of two crystals, of 1 to 1000 ppm, at 1 to 5 million cycles a second."""
    for period in (1000, 20_000, 100_000):
        for ppm in (1, 30, 50, 100, 999, 1000):
            early = awaited_early(Cycles(period), ppm)
            fast, slow = 1 + ppm * 1e-6, 1 - ppm * 1e-6
            assert period - early < period * slow / fast - 4 < period * fast / slow < period + early
    assert awaited_early(Cycles(PERIOD), OWN_PPM) == LOOKS - 1


LOOK = "        btfsc PORTA, 1\n        goto {}\n"
WRONG = {
    "a look is missing": (3 * LOOK.format("one"), 2 * LOOK.format("one") + wait(2)),
    "the last look is missing": (LOOK.format("two") + "        goto wire", wait(2) + "        goto wire"),
    "the first look may be high": (OWN_LOOK.format(rose="one")[:50], wait(2)),
    "a look is a cycle late": (4 * LOOK.format("two"), "        nop\n" + 4 * LOOK.format("two")),
    "the pulse comes a cycle late": ("one\n" + wait(6), "one\n" + wait(7)),
    "the first rise is awaited too seldom": ("rise    btfss", "rise    goto $+1\n        btfss"),
    "pulses come without a rise": ("        goto wire\ntwo", "        nop\n        nop\ntwo"),
    "a frame counts as quiet": ("wire    movlw 64", "wire    movlw 50"),
    "looks at a quiet wire may miss a pulse": (wait(11) + "\n        decfsz", wait(111) + "\n        decfsz"),
    "an awaited rise may be missed": (
        "rise    btfss",
        "rise    nop\n" + wait(100) + "        btfss PORTA, 1\n        nop\n        btfss",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_program_that_looks_otherwise_is_accepted_by_neither_witness(right: Proof, what: str) -> None:
    image = own_second_chip(*WRONG[what])
    assert image != own_second_chip()
    assert not proven(image).proven
    claim = read_certificate(certificate(right, image, SCHEDULE, TEXT), "it")
    with pytest.raises(Refused):
        check_certificate(claim, image, TEXT, "schedule.json")


OTHER_RULES = [{"cycles": Cycles(11)}, {"crystal_ppm": 400}, {"quiet": Cycles(1024)}, {"frames": 2}]


@pytest.mark.parametrize("rule", OTHER_RULES)
def test_neither_witness_accepts_it_for_another_rule(right: Proof, rule: dict[str, int]) -> None:
    assert SCHEDULE.wire is not None
    other, image = replace(SCHEDULE, wire=replace(SCHEDULE.wire, **rule)), own_second_chip()
    assert not proven(image, other).proven
    text = other.json_text().encode()
    claim = read_certificate(certificate(right, image, other, text), "it")
    with pytest.raises((Refused, InputError)):
        check_certificate(claim, image, text, "schedule.json")
