"""Proofs that take from ten seconds to two minutes each.

`python -m tests.prove.long_proofs` runs them; options are pytest's, as in `-k tape`.
"""

from __future__ import annotations

import json
import re
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from shutil import which

import pytest

from servogen.edges import HIGH, OTHER_PINS, PINS
from servogen.engines.board import board_of, paired_machine
from servogen.engines.firmware import DIALECTS
from servogen.job import loads, plan_job
from servogen.pic.image import read_hex, to_hex
from servogen.pic.isa import encode
from servogen.prove import prove_for_all, tape
from servogen.simulator import Machine
from servogen.workflows.certificates import second_witness
from servogen.workflows.engines import planned
from servogen.workflows.job_build import build
from servogen.workflows.pair import build_pair, planned_pair
from tests.checker import certify
from tests.checker.test_certificate import refusal
from tests.engines.stream.stream_soak import JOBS
from tests.engines.tape.test_tape_commands import job as segments
from tests.prove.attack import servogen
from tests.prove.gpsim_runs import gpsim_levels
from tests.prove.stream_attack import edges_of, first_difference
from tests.prove.test_contract_proofs import BOTH, EITHER, UNWRITTEN, first_written_at_once, image, proof
from tests.prove.test_stream_lemmas import ARM, changed_text
from tests.prove.test_tape import proof_of, still
from tests.twin.eighteen import JOB as EIGHTEEN
from tests.workflows.test_advice import on_two_chips, refused, turning


def test_an_eeprom_that_holds_sda_for_a_clock_longer_is_not_covered(monkeypatch: pytest.MonkeyPatch) -> None:
    schedule, image = still()
    monkeypatch.setattr(tape, "MOST_LOW", 10)
    assert not proof_of(schedule, image).proven


def test_a_reader_that_clocks_once_too_few_times_is_not_proven() -> None:
    # Nine tries: an EEPROM that was just asked for a byte of zeros holds SDA in all of them.
    schedule, image = still()
    tries = [at for at, word in image.program.items() if word == encode("MOVLW", k=10)]
    assert tries
    for at in tries:
        proof = proof_of(schedule, replace(image, program=image.program | {at: encode("MOVLW", k=9)}))
        assert not proof.proven


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_segment_on_a_button_is_proven_and_checked(dialect: str) -> None:
    bow = ', { name = "bow", from_s = 0.02, to_s = 0.08 }'
    played = planned(segments('buttons = { wave = "RB6" }', old=bow))
    schedule, program = played.plan.schedule, played.make(dialect).compilation.image
    found = prove_for_all(program, schedule, max_states=2000)
    assert found.proven, found.reason
    assert second_witness(found, program, schedule, schedule.json_text().encode()).text == "proven, checked"


def test_levels_before_the_first_write_are_within_bounds_that_allow_for_them() -> None:
    assert proof(image(UNWRITTEN), EITHER.replace("[155, 155]", "[153, 155]")).proven
    program = first_written_at_once()
    assert proof(program, BOTH + "longer_us = 3\n").proven
    assert not proof(program, BOTH + "longer_us = 2\n").proven


@pytest.mark.skipif(which("gpsim") is None, reason="gpsim is not installed")
def test_gpsim_shows_the_same_edges_of_a_hexapod_on_two_chips() -> None:
    """Of eighteen servos, each chip by itself, as gpsim runs only the active one of two processors.

    A written TMR0 is a cycle ahead in gpsim (docs/simulator.md): the edges are that much earlier, and so is
    the wire, given to the second chip from the rise on with which it joins. With any other it has no pulse.
    """
    alone = EIGHTEEN.read_text().replace('restart = "RA4"', "")
    pair = planned_pair(plan_job(loads(alone, "alone.toml")))
    images, end, rule = pair.images(), 22 * pair.schedules[0].period, pair.schedules[1].wire
    edges = paired_machine(pair.schedules, images).run(end)
    assert rule is not None

    def seen(number: int, changes: list[tuple[int, int, int]]) -> list[tuple[int, int]]:
        schedule = pair.schedules[number]
        start = Machine(images[number], schedule.clock, board_of(schedule)).state()
        servos = [channel.pin for channel in schedule.channels]
        found = gpsim_levels(images[number], start, changes, end, servos)
        return [(cycle + 2, levels) for cycle, levels in found]

    own: list[dict[int, int]] = [{}, {}]
    wire: list[tuple[int, int]] = []
    levels = [0, 0]
    for cycle, pin, level in zip(*(column.tolist() for column in edges), strict=True):
        chip, bit = divmod(pin, OTHER_PINS)
        before, levels[chip] = levels[chip], levels[chip] & ~(1 << bit) | (level == HIGH) << bit
        if before != levels[chip]:
            own[chip][cycle] = levels[chip]
            if (chip, PINS[bit]) == (0, rule.source):
                wire.append((cycle, level))
    assert seen(0, []) == list(own[0].items()) and len(own[0]) == 90
    joins = [cycle for cycle, level in wire if level == HIGH][rule.frames]
    for early in (0, 1, 2):
        moments = [(cycle - 1 - early * (cycle >= joins), level) for cycle, level in wire]
        changes = [(cycle, PINS.index(rule.pin), level) for cycle, level in moments]
        assert seen(1, changes) == (list(own[1].items()) if early == 1 else [])
    assert len(own[1]) == 65


def test_a_fault_that_no_idle_line_shows_has_a_counterexample(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "main.c"
    file.write_text(changed_text("speed[n] = value;", "speed[n] = value | 1;"))
    folder = JOBS.parent / "firmware" / "stream-arm"
    prove = ("prove", file, "--against", folder / "schedule.json", "--json")
    answer = json.loads(servogen(*prove, "--any-line", JOBS / "stream-arm.toml"))
    assert answer["answer"] == "counterexample"
    assert answer["states"] > 0, "with an idle line it is proven"
    assert not [text for text in answer["assumptions"] if "held" in text or "the EEPROM holds" in text]
    shown = answer["counterexample"]
    assert " cycles on RB1, not " in shown["message"]
    words = shlex.split(shown["command"])
    wrong = edges_of(words, ARM.clock, None)
    right = folder / "main.hex" if shown["eeprom"] is None else tmp_path / "right.hex"
    if shown["eeprom"] is not None:
        image = read_hex((folder / "main.hex").read_text(), "main.hex").image
        kept = read_hex(Path(words[2]).read_text(), words[2]).image.eeprom
        right.write_text(to_hex(replace(image, eeprom=kept)))
    assert (
        first_difference(wrong, edges_of([*words[:2], str(right), *words[3:]], ARM.clock, None))
        == (shown["cycle"])
    )
    with pytest.raises(AssertionError):  # exit code 2: a line cannot be held and have any waveform
        servogen(*prove, "--any-line", JOBS / "stream-arm.toml", "--hold-inputs")
    with pytest.raises(AssertionError):  # exit code 2: the answer is about every power-up
        servogen(*prove, "--any-line", JOBS / "stream-arm.toml", "--no-resets")
    with pytest.raises(AssertionError):  # exit code 2: another job's schedule
        servogen(*prove, "--any-line", JOBS / "stream-eight.toml")


def test_a_program_that_lets_an_interrupt_in_has_no_certificate() -> None:
    enabled = certify.plain_program(clear="bsf 0x0b,4\n bsf 0x0b,7")
    assert "a missing edge" in refusal(enabled, certify.schedule())


def test_of_a_turn_on_three_joints_a_leg_every_way_out_that_is_said_to_fit_does() -> None:
    """Shorter steps and a greater limit on one chip, or the same turn on two, which is proven."""
    error = refused(turning(15))
    assert error.code == "beyond-max-error" and error.hint is not None
    (fits,) = re.findall(r"what fits: (.*)", error.hint)
    turn, on_two, limit = fits.split("; or ")
    found = re.match(r"turn_deg = ([\d.]+) .* (\d+) words", turn)
    assert found is not None
    made = build(plan_job(loads(turning(float(found[1])), "my.toml")))
    assert made.exact and made.programs[0].firmware.compilation.words == int(found[2])
    found = re.match(r"max_error_us = (\d+) ", limit)
    assert found is not None
    text = turning(15).replace('engine = "player"', f'engine = "player"\nmax_error_us = {found[1]}')
    assert build(plan_job(loads(text, "my.toml"))).exact
    found = re.match(
        r"two chips .*, (.*) and those after it on the second .* (\d+) words or fewer each", on_two
    )
    assert found is not None
    pair = build_pair(plan_job(loads(on_two_chips(turning(15), found[1]), "my.toml")))
    assert pair.exact
    assert max(chip.programs[0].firmware.compilation.words for chip in pair.chips) == int(found[2])
    assert all(proof.checked for proof in pair.proofs().values())


if __name__ == "__main__":
    sys.exit(pytest.main([__file__, *sys.argv[1:]]))
