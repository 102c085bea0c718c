"""The proof for all inputs: what is proven, what is shown to be wrong, and that nothing wrong is proven.

A counterexample counts only if a plain run of the simulator makes a wrong edge: the tests run it again and
compare its edges with the schedule's.
"""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest

from servogen.edges import EdgeTrace
from servogen.engines.board import board_of
from servogen.pic.device import CONFIG_WATCHDOG_ON
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.programs import read_program, read_schedule
from servogen.prove import Proof, Quantifiers, certificate, prove_for_all
from servogen.prove.specification import Specification, Violation
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.pulse.schedule import Input
from servogen.simulator import Machine, SimulatorOptions
from servogen.units import Cycles
from servogen.verify import verify
from tests.campaigns import sampled
from tests.prove.replay import is_wrong

ROOT = Path(__file__).parent.parent.parent
STARTS = ROOT / "tests" / "verify" / "start_state"
FIRMWARE = ROOT / "firmware"


def proof_of(program: Path, schedule: PulseSchedule) -> Proof:
    return prove_for_all(read_program(program).image, schedule)


@pytest.mark.parametrize(
    "job", sampled(["hexapod-ripple", "omni-square", "lab8-program", "lab9-exercise"], 3)
)
@pytest.mark.parametrize("program", ["main.hex", "main.sdcc.hex"])
def test_the_committed_firmware_is_proven(job: str, program: str) -> None:
    found = proof_of(FIRMWARE / job / program, read_schedule(FIRMWARE / job / "schedule.json"))
    assert found.proven, found.reason


def test_a_program_that_depends_on_nothing_is_proven() -> None:
    found = proof_of(STARTS / "good.asm", read_schedule(STARTS / "schedule.json"))
    assert found.proven, found.reason
    assert found.states <= 4


@pytest.mark.parametrize("name", ["floatin", "ram", "latch", "wdt_pre2"])
def test_what_depends_on_the_start_has_a_counterexample_that_a_plain_run_shows(name: str) -> None:
    schedule = read_schedule(STARTS / "schedule.json")
    program = STARTS / f"{name}.asm"
    found = proof_of(program, schedule)
    assert not found.proven
    assert found.counterexample is not None, found.reason
    assert is_wrong(read_program(program).image, schedule, found.counterexample)


def test_an_oscillator_of_any_frequency_has_one_too() -> None:
    found = proof_of(STARTS / "rc.asm", read_schedule(STARTS / "schedule.json"))
    assert found.counterexample is not None
    assert found.counterexample.clock_hz == 3_600_000
    assert "1666.7 us long instead of 1500.0" in found.counterexample.message


def test_a_held_input_is_an_assumption() -> None:
    schedule = read_schedule(STARTS / "schedule.json")
    held = replace(schedule, inputs=(Input("RA2", 0),))
    found = proof_of(STARTS / "floatin.asm", held)
    assert found.proven, found.reason
    assert any("RA2 is held at 0" in each for each in found.assumptions)
    other = proof_of(STARTS / "floatin.asm", replace(schedule, inputs=(Input("RA2", 1),)))
    assert other.counterexample is not None


def test_one_changed_word_is_never_proven_unless_it_does_nothing() -> None:
    """A mutant of which a plain run of the whole motion makes a wrong edge is not proven."""
    schedule = read_schedule(FIRMWARE / "lab9-program" / "schedule.json")
    image = read_program(FIRMWARE / "lab9-program" / "main.hex").image
    rng = random.Random(13)
    wrong = shown = 0
    for _ in range(20):
        address = rng.choice(sorted(image.program))
        changed = image.program[address] ^ 1 << rng.randrange(14)
        mutant = replace(image, program={**image.program, address: changed})
        if follows(mutant, schedule):
            continue
        wrong += 1
        found = prove_for_all(mutant, schedule, max_states=5000)
        assert not found.proven, (address, changed)
        if found.counterexample is not None and found.counterexample.clock_hz is None:
            shown += 1
            assert is_wrong(mutant, schedule, found.counterexample)
    assert wrong >= 13
    assert shown >= 10


def follows(image: Image, schedule: PulseSchedule) -> bool:
    """Return whether a plain run of the whole motion makes the schedule's edges."""
    span = Cycles((schedule.lead_in_frames + 2 * schedule.loop_frames) * schedule.period)
    machine = Machine(image, schedule.clock, board_of(schedule, SimulatorOptions()), tracked=True)
    limit = Cycles(span + 50 * schedule.period)
    verdict = verify(expected(schedule), EdgeTrace(schedule.clock, machine.stream(limit), limit), span)
    return verdict.agrees and not machine.chip_dependent


def test_the_specification_names_the_first_wrong_edge() -> None:
    schedule = read_schedule(STARTS / "schedule.json")
    spec = Specification(schedule, None)
    state = spec.advance(spec.start(), [(100, 5, 1), (1600, 5, 0)], 5000)
    assert state.time == 4900
    for edges, message in (
        ([], "the rise of RB0 is missing"),
        ([(15_000, 5, 1)], "the rise of RB0 is not the schedule's"),
        ([(15_101, 5, 1)], "the rise of RB0 comes 1 cycle late"),
        ([(15_050, 6, 1), (15_100, 5, 1)], "the rise of RB1 is not the schedule's"),
        ([(15_100, 5, 1), (15_101, 6, 1)], "the rise of RB1 is not the schedule's"),
        ([(7, 5, 0), (15_100, 5, 1)], "the fall of RB0 is not the schedule's"),
    ):
        with pytest.raises(Violation) as wrong:
            spec.advance(state, edges, 15_200)
        assert wrong.value.message == message, edges
    assert spec.advance(state, [(15_100, 5, 1)], 15_100 + 1).time == 1


def test_without_its_quantifier_the_phase_of_tmr0_is_an_assumption() -> None:
    schedule = read_schedule(FIRMWARE / "hexapod-ripple" / "schedule.json")
    image = read_program(FIRMWARE / "hexapod-ripple" / "main.hex").image
    found = prove_for_all(image, schedule, Quantifiers(tmr0_phase=False))
    assert found.proven
    assert any("TMR0 counts" in each for each in found.assumptions)


@pytest.mark.parametrize("program", [("servo.c", "lab8-program"), ("PICIOR.c", "lab9-program")])
def test_the_printed_lab_programs_do_not_follow_the_corrected_schedules(program: tuple[str, str]) -> None:
    """They drive port B before they write it, and their frames are not 20 ms."""
    name, job = program
    file = ROOT / "tests" / "labs" / name
    schedule = read_schedule(FIRMWARE / job / "schedule.json")
    found = proof_of(file, schedule)
    assert found.counterexample is not None, found.reason
    assert is_wrong(read_program(file).image, schedule, found.counterexample)


def test_a_watchdog_that_is_left_on_changes_nothing_in_a_player() -> None:
    """Every chip's watchdog takes 7 ms at least, and the player clears it in time."""
    schedule = read_schedule(FIRMWARE / "hexapod-ripple" / "schedule.json")
    image = read_program(FIRMWARE / "hexapod-ripple" / "main.hex").image
    assert image.config is not None
    watched = replace(image, config=image.config | CONFIG_WATCHDOG_ON)
    found = prove_for_all(watched, schedule)
    assert found.proven, found.reason
    assert any("7 ms" in each for each in found.assumptions)
    nop, clrwdt = encode("NOP"), encode("CLRWDT")
    words = {address: nop if word == clrwdt else word for address, word in image.program.items()}
    unfed = replace(watched, program=words)
    assert prove_for_all(replace(unfed, config=image.config), schedule).proven
    shown = prove_for_all(unfed, schedule).counterexample
    assert shown is not None
    assert is_wrong(unfed, schedule, shown)


def test_a_certificate_is_the_same_each_time_and_only_a_proof_has_one() -> None:
    folder = FIRMWARE / "lab9-program"
    text = (folder / "schedule.json").read_bytes()
    image, schedule = read_program(folder / "main.hex").image, read_schedule(folder / "schedule.json")
    proof = prove_for_all(image, schedule)
    written = certificate(proof, image, schedule, text)
    assert len(written) < 200_000
    assert written == certificate(prove_for_all(image, schedule), image, schedule, text)
    with pytest.raises(ValueError, match="only a proof"):
        certificate(replace(proof, proven=False), image, schedule, text)
