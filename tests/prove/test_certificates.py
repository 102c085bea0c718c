"""What the prover proves, the checker accepts; and only of that program."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from servogen.checker import Refused, check_certificate, read_certificate
from servogen.checker.certificate import fingerprint
from servogen.engines.board import board_of
from servogen.inputs import read_input
from servogen.pic.image import Image
from servogen.pic.isa import decode, encode
from servogen.programs import read_program, read_schedule
from servogen.prove import certificate, prove_for_all
from servogen.pulse import PulseSchedule
from tests.checker import certify
from tests.prove.attack import target

FIRMWARE = Path(__file__).parents[2] / "firmware"
PORTS = (5, 6)
LARGEST = 200_000
"""Bytes of a certificate that is kept."""


def certified(image: Image, schedule: PulseSchedule, text: bytes) -> bytes:
    proof = prove_for_all(image, schedule, options=board_of(schedule))
    assert proof.proven, proof.reason
    return certificate(proof, image, schedule, text)


@pytest.mark.parametrize("job", ["omni-square", "lab9-program"])
def test_the_committed_firmware_is_proven_and_its_certificate_valid(job: str) -> None:
    path = FIRMWARE / job / "schedule.json"
    image, text = read_program(FIRMWARE / job / "main.hex").image, read_input(path)
    packed = certified(image, read_schedule(path), text)
    assert len(packed) <= LARGEST
    claim = read_certificate(packed, "certificate")
    assert check_certificate(claim, image, text, str(path)).states == claim.count


@pytest.mark.campaign
def test_with_two_buttons_it_is_valid_of_that_program_only() -> None:
    """Each reading of a button, turned round, is a program that the certificate is refused of."""
    case = target("start and stop")
    packed = certified(case.image, case.schedule, case.text)
    claim = read_certificate(packed, "certificate")
    found = check_certificate(claim, case.image, case.text, "schedule.json")
    assert found.states == claim.count
    assert found.forks == 3 * found.states  # two buttons are read after each: one split, then two
    data = certify.unpack(packed)
    reads = [
        (address, row)
        for address, row in ((each, decode(word)) for each, word in case.image.program.items())
        if row is not None and row.instruction.tests_bit and row.f in PORTS
    ]
    assert len(reads) == 2
    for address, row in reads:
        opposite = {"BTFSS": "BTFSC", "BTFSC": "BTFSS"}[row.instruction.mnemonic]
        words = {**case.image.program, address: encode(opposite, f=row.f, b=row.b)}
        image = replace(case.image, program=words)
        data["image"] = fingerprint(image)
        with pytest.raises(Refused):
            check_certificate(certify.reread(data), image, case.text, "schedule.json")
