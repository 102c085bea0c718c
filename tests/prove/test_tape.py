"""A program with a tape: proven for an EEPROM left in any state; other tapes, readers and devices are not."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from hashlib import sha256
from typing import Any

import pytest

from servogen.checker import Refused, check_certificate
from servogen.checker.certificate import fingerprint
from servogen.cli.schedule_proof import judged_pins
from servogen.edges import PINS
from servogen.engines.tape.content import sum_of
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.prove import Proof, prove_for_all
from servogen.prove.tape import LeftEEPROM, TapeBeside
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import TapeRule
from servogen.simulator.devices import React
from servogen.units import Clock
from servogen.workflows.certificates import Witnessed, cache_path, second_witness
from tests.checker import certify
from tests.engines.tape.tape_jobs import made, with_content

STILL = ("{ arm_deg = 30, hand_deg = 120, foot_deg = 80, hold_s = 0.1 }",)
SCL, SDA = 1, 2


@cache
def still() -> tuple[PulseSchedule, Image]:
    played, image = made(poses=STILL)
    return played.plan.schedule, image


@cache
def witnessed() -> tuple[Proof, Witnessed]:
    """The proof of the still pose, and what the checker says of it."""
    schedule, image = still()
    proof = proof_of(schedule, image)
    assert proof.proven, proof.reason
    return proof, second_witness(proof, image, schedule, schedule.json_text().encode())


def claimed() -> dict[str, Any]:
    """The certificate of the still pose."""
    return certify.unpack(witnessed()[1].certificate)


def refusal(data: dict[str, Any], schedule: PulseSchedule, image: Image) -> str:
    """What the checker says of a certificate whose head is that of the program and the tape."""
    assert schedule.tape is not None
    content = schedule.tape.content
    head = {"image": fingerprint(image), "tape": sha256(content).hexdigest()}
    text = schedule.json_text().encode()
    with pytest.raises(Refused) as refused:
        check_certificate(certify.reread(data | head), image, text, "schedule.json", tape=content)
    return str(refused.value)


def proof_of(schedule: PulseSchedule, image: Image) -> Proof:
    return prove_for_all(image, schedule, max_states=300)


def test_every_edge_is_the_schedules_whatever_state_the_eeprom_was_left_in() -> None:
    schedule, _ = still()
    proof, witness = witnessed()
    assert any("the EEPROM of the tape holds" in text for text in proof.assumptions)
    assert witness.text == "proven, checked" and witness.checked is not None
    assert any(text.startswith("every state of a tape's EEPROM") for text in witness.checked.over)
    assert judged_pins(schedule) == "all pins but RA3 and RA4, a tape's bus,"


def test_a_wrong_byte_whose_sum_is_right_has_a_counterexample() -> None:
    schedule, image = still()
    assert schedule.tape is not None
    data = bytearray(schedule.tape.content)
    data[3] ^= 1  # the first width; the record is of three full ones
    data[9] = sum_of(bytes(data[2:9]))
    proof = proof_of(with_content(schedule, bytes(data)), image)
    assert not proof.proven and proof.counterexample is not None


def test_a_certificate_is_of_one_tape() -> None:
    schedule, image = still()
    other = with_content(schedule, b"\0" * 40)
    assert schedule.tape is not None and other.tape is not None
    text = schedule.json_text().encode()
    claim = certify.reread(claimed())
    with pytest.raises(Refused, match="another tape"):
        check_certificate(claim, image, text, "schedule.json", tape=other.tape.content)
    assert cache_path(image, text, schedule.tape.content) != cache_path(image, text, other.tape.content)


def test_a_changed_byte_of_the_tape_is_refused_where_its_pulse_is() -> None:
    schedule, image = still()
    assert schedule.tape is not None
    data = bytearray(schedule.tape.content)
    data[12] ^= 1  # of the second record: its sum is wrong, and the pulses are released
    said = refusal(claimed(), with_content(schedule, bytes(data)), image)
    assert re.search("after state [0-9]+, at address 0x[0-9A-F]{3}, frame 6, cycle 1, .*missing edge", said)


def test_a_changed_state_of_the_eeprom_is_refused() -> None:
    schedule, image = still()
    columns = claimed()["columns"]
    first, *others = columns["tape_clock"]["delta"]
    for forged in ({"all": first}, {"delta": [first + 1, *others]}, {"delta": [first + 9 * 500, *others]}):
        data = claimed() | {"columns": columns | {"tape_clock": forged}}
        assert re.search("listed", refusal(data, schedule, image))


def without_a_fall(image: Image) -> Image:
    """A reader that lets go of SDA in the cycle in which SCL falls."""
    words = [encode("CLRF", f=5), encode("MOVLW", k=0x10), encode("MOVWF", f=5)]
    falls = [at for at in image.program if [image.program.get(at + n) for n in range(3)] == words]
    assert falls
    return replace(image, program=image.program | dict.fromkeys(falls, encode("NOP")))


def with_a_clock_less(image: Image) -> Image:
    """Nine tries: an EEPROM that was just asked for a byte of zeros holds SDA in all of them."""
    tries = [at for at, word in image.program.items() if word == encode("MOVLW", k=10)]
    assert tries
    return replace(image, program=image.program | dict.fromkeys(tries, encode("MOVLW", k=9)))


@pytest.mark.parametrize("wrong", [without_a_fall, with_a_clock_less])
def test_a_wrong_reader_is_refused_with_the_certificate_of_the_right_one(
    wrong: Callable[[Image], Image],
) -> None:
    schedule, image = still()
    assert "power-up, at address" in refusal(claimed(), schedule, wrong(image))


@pytest.mark.campaign
def test_a_reader_that_lets_go_of_sda_as_scl_falls_is_not_proven() -> None:
    schedule, image = still()
    assert not proof_of(schedule, without_a_fall(image)).proven


# The EEPROM


def left(content: bytes = b"\xa5") -> LeftEEPROM:
    eeprom = LeftEEPROM(content, "24LC256", Clock(4_000_000))
    for cycle, levels in ((10, SDA), (20, SCL | SDA)):
        assert eeprom.react(cycle, levels) == 0
    return eeprom


def clocked(eeprom: LeftEEPROM, cycle: int, bits: str) -> list[int]:
    """What it answers while SCL is high, for the bits that the chip gives."""
    answers, data = [], 0
    for at, bit in enumerate(bits):
        eeprom.react(cycle + 20 * at, data)
        data = SDA * int(bit)
        eeprom.react(cycle + 20 * at + 5, data)
        answers.append(eeprom.react(cycle + 20 * at + 10, data | SCL))
    return answers


def test_only_a_start_after_sda_was_seen_high_is_one_that_it_has_seen() -> None:
    for seen in (True, False):
        eeprom = left()
        assert not seen or eeprom.saw(1)
        eeprom.react(30, SCL)
        answers = clocked(eeprom, 40, "10100000" + "1")
        assert answers[-1] == (SDA | SDA << 2 if seen else 0)  # acknowledged, or not known


def test_what_is_read_without_an_address_is_not_known() -> None:
    eeprom = left()
    eeprom.saw(1)
    eeprom.react(30, SCL)
    assert clocked(eeprom, 40, "10100001" + "1" + "1111")[8:] == [0] * 5


def addressed_and_read(content: bytes, between: str) -> list[int]:
    """The answers to a read at address 0, which follows the address and some bits more."""
    eeprom = left(content)
    eeprom.saw(1)
    eeprom.react(30, SCL)
    bits = "101000001" + 2 * "000000001" + between
    clocked(eeprom, 40, bits)
    after = 40 + 20 * len(bits)
    for cycle, levels in ((after, SDA), (after + 10, SCL | SDA), (after + 20, SCL)):
        eeprom.react(cycle, levels)
    return clocked(eeprom, after + 30, "101000011" + "111111110" + "1")


def test_behind_the_bytes_of_the_tape_nothing_is_known() -> None:
    given = [0 if bit == "1" else SDA for bit in f"{0xA5:08b}"]
    known = [each | SDA << 2 for each in [*given, 0]]
    assert addressed_and_read(b"\xa5\x00", "")[9:] == [*known, SDA | SDA << 2]
    assert addressed_and_read(b"\xa5", "")[9:] == [*known, 0]


def test_a_start_within_a_byte_leaves_no_address() -> None:
    assert addressed_and_read(b"\xa5\x00", "111")[9:] == [0] * 10


def test_sda_that_falls_as_scl_rises_may_be_a_start() -> None:
    for before in (True, False):
        eeprom = left()
        eeprom.saw(1)
        answers = [
            eeprom.react(*each) for each in ((30, SCL), (40, 0), (50, SCL), (60, SCL | SDA), (70, SDA))
        ]
        assert answers == [SDA << 2, 0, SDA << 2, SDA << 2, 0]  # a start and a stop
        if before:
            eeprom.react(75, 0)
        assert eeprom.react(80, SCL) == (SDA << 2 if before else 0)


def test_a_start_is_not_certain_while_the_level_of_scl_was_not() -> None:
    scl, sda = 1 << PINS.index("RA3"), 1 << PINS.index("RA4")
    for doubt in (0, scl << len(PINS)):
        beside = TapeBeside(TapeRule("RA3", "RA4", "24LC256", b"\xa5"), Clock(4_000_000))
        told = React(beside.address)
        told(10, sda | doubt)
        told(30, sda)
        told(31, scl | sda)
        assert beside.saw(sda, sda)
        told(40, scl)
        told(50, 0)
        assert told(60, scl) == (0 if doubt else sda << len(PINS))


def test_it_holds_sda_for_nine_clocks_at_most() -> None:
    eeprom = left()
    possible = []
    for clock in range(10):
        possible.append(eeprom.saw(0))
        eeprom.react(30 + 20 * clock, SDA)
        eeprom.react(40 + 20 * clock, SCL | SDA)
    assert possible == [True] * 9 + [False]
