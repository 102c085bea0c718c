"""Two chips: proven, checked if both are, and if the wire of one theorem is the wire of the other."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from servogen.cli.app import app
from servogen.errors import InputError
from servogen.outputs import write_text
from servogen.pic.image import Image, to_hex
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Pulse, Run
from servogen.units import Cycles
from servogen.workflows.pair_proof import PairProof, prove_pair
from tests.cli.conftest import wrong
from tests.prove.wired import PERIOD, first_chip, schedules, second_chip, wait

FIRST, SECOND = schedules()


def proof(
    first: PulseSchedule = FIRST,
    second: PulseSchedule = SECOND,
    images: tuple[Image, Image] | None = None,
) -> PairProof:
    texts = first.json_text().encode(), second.json_text().encode()
    return prove_pair((first, second), images or (first_chip(), second_chip()), texts, max_states=3000)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pair")
    for name, image, schedule in (("chip1", first_chip(), FIRST), ("chip2", second_chip(), SECOND)):
        (path / name).mkdir()
        write_text(path / name / "main.hex", to_hex(image))
        write_text(path / name / "schedule.json", schedule.json_text())
    return path


def invoke(*words: str) -> Result:
    return CliRunner().invoke(app, list(words))


def test_two_chips_are_proven_checked_and_what_is_left_open_is_said(folder: Path) -> None:
    answer = invoke("prove", str(folder))
    assert answer.exit_code == 0, answer.output
    assert answer.output.startswith("both chips: proven, checked")
    for says in (
        "no later than 8 ms after chip1",
        "is reset alone, has no pulses until chip1 begins anew",
        "chip1: proven, checked",
        "chip2: proven, checked",
        "of one crystal",
    ):
        assert says in answer.output


def test_the_answer_is_json_too(folder: Path) -> None:
    printed = invoke("prove", str(folder), "--json").output
    answer = json.loads(printed)
    assert wrong("prove", printed) == []
    assert answer["answer"] == "proven" and answer["chips"] == ["proven, checked"] * 2
    # Of 12008 cycles up to the first pulse, three frames and the quiet wire are the second chip's.
    assert answer["second_begins_late_cycles"] == 12008 - 3 * PERIOD - 1023 - 8


def test_an_option_that_one_chip_has_is_refused_for_two(folder: Path) -> None:
    refused = invoke("prove", str(folder), "--hold-inputs").exception
    assert isinstance(refused, InputError) and "of two chips together" in str(refused)


def moved(schedule: PulseSchedule, **loop: object) -> PulseSchedule:
    return replace(schedule, **loop)


NO_PULSE = Run(1, (None,))
LATE = Run(1, (Pulse(Cycles(1), Cycles(130)),))
SHORT = Run(1, (Pulse(Cycles(0), Cycles(7)),))
MISFITS = {
    "a frame without the wire's pulse": (moved(FIRST, loop=(FIRST.loop[0], NO_PULSE)), SECOND, "same cycle"),
    "a pulse of the wire a cycle late": (moved(FIRST, loop=(FIRST.loop[0], LATE)), SECOND, "same cycle"),
    "a pulse that is too short": (moved(FIRST, loop=(FIRST.loop[0], SHORT)), SECOND, "shorter than 16"),
    "another length of the motion": (moved(FIRST, loop=FIRST.loop[:1]), SECOND, "frames are not those"),
    "another place in the motion": (moved(FIRST, lead_in=()), SECOND, "frames are not those"),
    "another pin": (
        FIRST,
        replace(SECOND, wire=SECOND.wire and replace(SECOND.wire, source="RB5")),
        "RB5 of chip1 does not rise",
    ),
    "another period": (moved(FIRST, period=Cycles(1004)), SECOND, "different clocks or frames"),
}


@pytest.mark.parametrize("what", MISFITS)
def test_theorems_about_different_wires_do_not_make_one(what: str) -> None:
    first, second, says = MISFITS[what]
    found = proof(first, second)
    assert not found.proven and any(says in misfit for misfit in found.misfits)


def test_a_first_chip_that_begins_too_soon_after_a_reset_makes_no_pair() -> None:
    """The second one may still follow, or join, what was before the reset."""
    soon = first_chip("movlw 12", "movlw 6")
    found = proof(images=(soon, second_chip()))
    assert all(verdict.valid for verdict, _, _ in found.chips)
    assert not found.proven and "too soon after a reset" in found.summary()
    assert proof(images=(first_chip("movlw 12", "movlw 8"), second_chip())).checked


def test_a_second_chip_that_resets_the_first_has_to_do_so_for_2_us() -> None:
    """Parameter 30 of DS35007."""
    rule = SECOND.wire
    assert rule is not None
    short = replace(SECOND, wire=replace(rule, restart="RA4", pulled=Cycles(1)))
    assert "chip2 resets chip1 for 1 us; 2 are needed" in proof(second=short).misfits


def test_a_second_chip_that_takes_part_of_a_frame_for_quiet_makes_no_pair() -> None:
    """Reset alone it would begin in the midst of the motion: the wire is low for 870 of 1000 cycles."""
    assert SECOND.wire is not None
    second = replace(SECOND, wire=replace(SECOND.wire, quiet=Cycles(600)))
    found = proof(second=second, images=(first_chip(), second_chip("movlw 64", "movlw 38")))
    assert all(verdict.valid for verdict, _, _ in found.chips)
    assert not found.proven and "low for 600 cycles, less than a frame" in found.summary()


@pytest.mark.parametrize("chip", [0, 1])
def test_a_pair_with_one_wrong_program_is_not_proven_and_says_which(chip: int) -> None:
    images = [first_chip(), second_chip()]
    images[chip] = (first_chip, second_chip)[chip](wait((129, 259)[chip]), wait((130, 260)[chip]))
    found = proof(images=(images[0], images[1]))
    assert not found.proven and not found.chips[chip][0].valid and found.chips[1 - chip][0].valid
    assert f"(chip{chip + 1})" in found.summary() and "counterexample" in found.summary()


def test_what_the_checker_does_not_cover_is_proven_by_one_engine_only(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from servogen.workflows import certificates

    none = certificates.Witnessed(not_covered="it")
    monkeypatch.setattr(certificates, "second_witness", lambda *words: none)
    answer = invoke("prove", str(folder))
    assert answer.exit_code == 1 and "proven by one engine" in answer.output.splitlines()[0]
    assert invoke("prove", str(folder), "--accept-one-engine").exit_code == 0
