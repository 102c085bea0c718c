"""Two chips on one crystal: the second one keeps the wire's frame to the cycle, or has no pulses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from threading import Event

import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from servogen.cli.app import app
from servogen.edges import HIGH, LOW, OTHER_PINS, PINS, UNDRIVEN, EdgeChunk, EdgeTrace, join, part
from servogen.engines.board import board_of, machine_of, paired_machine
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.pic.assembler.assembly import assemble
from servogen.pic.device import device
from servogen.pic.image import Image, read_hex
from servogen.simulator import FirstChip, LevelChange, Levels, Machine, PairedMachine, Reset, Stimuli
from servogen.simulator.layout import MCLR_PIN
from servogen.simulator.machine import Observation
from servogen.units import Cycles
from servogen.watch import editing
from servogen.watch.subject import Setting
from servogen.workflows.certificates import prove_program
from servogen.workflows.engines import planned
from servogen.workflows.pair import PairBuild, PlayedPair, build_pair, judge_traces, planned_pair
from servogen.workflows.verification import checked_cycles, running
from tests.campaigns import sampled

JOB = """
[[chip]]
device = "PIC16F84"
clock_hz = 4_000_000
wire = "RB1"

[[chip]]
device = "PIC16F84"
clock_hz = 4_000_000
wire = "RA4"

[[servo]]
name = "a"
pin = "RB0"
model = "mpx-tiny-s"

[[servo]]
name = "b"
pin = "RB1"
model = "mpx-tiny-s"

[[servo]]
name = "c"
pin = "RB0"
model = "mpx-tiny-s"

[[servo]]
name = "d"
pin = "RA3"
model = "mpx-tiny-s"

[motion]
poses = [
    { a_deg = 60, b_deg = 90, c_deg = 120, d_deg = 90, move_s = 0.2, hold_s = 0.1 },
    { a_deg = 90, b_deg = 100, c_deg = 60, d_deg = 70, move_s = 0.2, hold_s = 0.1 },
]
"""

P = 20_000
"""Cycles of a frame."""

Wire = tuple[tuple[int, int], ...]


@pytest.fixture(scope="module")
def pair() -> PairBuild:
    return build_pair(plan_job(loads(JOB, "pair.toml")))


def leads(pair: PairBuild, span: int = 30 * P) -> EdgeTrace:
    """What the first chip does alone."""
    first = pair.chips[0]
    return running(first.plan.schedule, first.programs[0].image, Cycles(span)).stored()


def second_chip(pair: PairBuild, wire: Wire, *more: Reset) -> Machine:
    """The second chip with these levels on its wire, and `more` that happens to its pins."""
    second = pair.chips[1]
    schedule, levels = second.plan.schedule, Levels(PINS.index("RA4"), wire)
    return Machine(second.programs[0].image, schedule.clock, board_of(schedule), Stimuli([levels, *more]))


@pytest.fixture(scope="module")
def wire(pair: PairBuild) -> Wire:
    """The first 60 frames' levels of the wire."""
    edges = join(leads(pair).chunks)
    mine = edges.pin == PINS.index("RB1")
    levels = (edges.level[mine] == HIGH).astype(int)
    return ((0, 0), *zip(edges.cycle[mine].tolist(), levels.tolist(), strict=True))


def rises(wire: Wire) -> list[int]:
    return [cycle for cycle, level in wire if level]


def high_edges(pair: PairBuild, wire: Wire, *more: Reset, frames: int = 60) -> list[int]:
    """The cycles in which a pulse of the second chip begins, with this wire."""
    edges = second_chip(pair, wire, *more).run(frames * P)
    return sorted(set(edges.cycle[edges.level == HIGH].tolist()))


def test_both_chips_are_exact_and_zero_cycles_apart_in_every_dialect(pair: PairBuild) -> None:
    assert list(pair.verdicts) == ["c2c", "xc8", "sdcc"]
    assert all(verdict.exact and verdict.apart == 0 for verdict in pair.verdicts.values())


def test_chips_whose_frames_would_differ_are_refused() -> None:
    """At 20 MHz a pulse of more than 1.6 ms needs ticks of 64 cycles; a frame is a whole number of ticks."""
    chips = JOB.partition("[motion]")[0].replace("16F84", "16F84A").replace("4_000_000", "20_000_000")
    poses = "poses = [{ a_deg = 150, b_deg = 150, c_deg = 45, d_deg = 45, hold_s = 0.1 }]\n"
    job = plan_job(loads(f"{chips}[frame]\nperiod_us = 20_012.8\n[motion]\n{poses}", "pair.toml"))
    for made in (planned_pair, build_pair):
        with pytest.raises(InputError, match="frames differ: 100096 and 100064 cycles"):
            made(job)


def test_poses_reach_both_chips_in_the_same_frame(pair: PairBuild) -> None:
    """Four frames of the first chip are the second one's wait; from there on both play the same frame."""
    first, second = (build.plan.schedule for build in pair.chips)
    assert second.wire is not None and second.wire.frames == 4
    assert first.lead_in_frames - second.lead_in_frames == 4
    assert first.loop_frames == second.loop_frames


@pytest.mark.parametrize("shift", [*range(9), 12_345, 400_001])
def test_the_second_chip_finds_the_wires_cycle_whenever_it_began(
    pair: PairBuild, wire: Wire, shift: int
) -> None:
    moved = ((0, 0), *((cycle + shift, level) for cycle, level in wire[1:]))
    rule = pair.chips[1].plan.schedule.wire
    assert rule is not None
    begun = high_edges(pair, moved)
    assert begun[0] == rises(moved)[0] + 4 * P + rule.cycles


def later_from(frame: int, cycles: int) -> Callable[[Wire], Wire]:
    """The wire's edges come so much later from this rise on."""
    return lambda wire: tuple(
        (cycle + (cycles if cycle >= rises(wire)[frame] else 0), level) for cycle, level in wire
    )


def without(frame: int) -> Callable[[Wire], Wire]:
    """One pulse of the wire is missing."""
    return lambda wire: tuple(
        (cycle, level)
        for cycle, level in wire
        if not rises(wire)[frame] <= cycle < rises(wire)[frame] + P // 2
    )


def held_from(frame: int, level: int) -> Callable[[Wire], Wire]:
    return lambda wire: (
        *((cycle, before) for cycle, before in wire if cycle < rises(wire)[frame] - 100),
        (rises(wire)[frame] - 100, level),
    )


WRONG = {
    "a cycle late": later_from(12, 1),
    "a cycle early": later_from(12, -1),
    "a missing pulse": without(12),
    "held low": held_from(12, 0),
    "held high": held_from(12, 1),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_wire_releases_the_pulses_in_its_frame_for_good(
    pair: PairBuild, wire: Wire, what: str
) -> None:
    """The last pulse is that of the frame before; what begins again needs a quiet wire."""
    rule, right = pair.chips[1].plan.schedule.wire, rises(wire)
    assert rule is not None
    found = high_edges(pair, WRONG[what](wire))
    assert right[11] + rule.cycles <= found[-1] < right[12]
    assert len(found) == len([cycle for cycle in high_edges(pair, wire) if cycle < right[12]])


def test_the_verdict_on_a_wrong_wire_names_the_first_missing_edge(pair: PairBuild, wire: Wire) -> None:
    schedules = pair.chips[0].plan.schedule, pair.chips[1].plan.schedule
    first = leads(pair, checked_cycles(schedules[0]))
    wrong = second_chip(pair, WRONG["a cycle late"](wire)).run(first.end)
    verdict = judge_traces(schedules, (first, EdgeTrace(first.clock, [wrong], first.end)))
    assert verdict.chips[0].passed and not verdict.exact
    assert "frame 8" in verdict.chips[1].reasons[0] and "does not" in verdict.chips[1].reasons[0]


def test_a_wire_that_never_rises_gives_no_pulse(pair: PairBuild) -> None:
    assert high_edges(pair, ((0, 0),)) == []
    assert high_edges(pair, ((0, 1),)) == []


@pytest.mark.parametrize("offset", [0, 1, 777, 5_003, 19_999])
def test_a_reset_of_the_second_chip_releases_it_until_the_first_begins_anew(
    pair: PairBuild, wire: Wire, offset: int
) -> None:
    right = rises(wire)
    begin = right[10] + offset
    anew = tuple((cycle + 50 * P, level) for cycle, level in wire if cycle < right[10])
    again = (*((cycle, level) for cycle, level in wire if cycle < right[20]), (right[20], 0), *anew[1:])
    found = high_edges(pair, again, Reset(begin, begin + 50), frames=80)
    rule = pair.chips[1].plan.schedule.wire
    assert rule is not None
    assert [cycle for cycle in found if begin < cycle < right[0] + 50 * P] == []
    assert right[0] + 54 * P + rule.cycles in found


def rows(edges: EdgeChunk, beyond: int = 0) -> list[tuple[int, int, int]]:
    """The edges before the 40th frame, with numbers of pins as where the first chip is shown."""
    pins = (edges.pin.astype(int) + beyond) % (2 * OTHER_PINS)
    kept = edges.cycle < 40 * P - 2
    return sorted(zip(*(column[kept].tolist() for column in (edges.cycle, pins, edges.level)), strict=True))


@pytest.mark.parametrize("shown", [0, 1])
@pytest.mark.parametrize("step", [40 * P, 777])
def test_both_chips_in_one_machine_make_the_edges_of_each_alone(
    pair: PairBuild, wire: Wire, shown: int, step: int
) -> None:
    """However it is cut into runs, whichever of them is shown, and again from a snapshot."""
    first, second = (build.plan.schedule for build in pair.chips)
    images = pair.chips[0].programs[0].image, pair.chips[1].programs[0].image
    alone = (
        rows(machine_of(first, images[0]).run(40 * P)),
        rows(second_chip(pair, wire).run(40 * P), OTHER_PINS),
    )
    both = paired_machine((first, second), images, shown)
    begin = both.snapshot()
    for _ in range(2):
        seen = [both.run(step) for _ in range(-(-40 * P // step))]
        assert all((np.diff(chunk.cycle) >= 0).all() for chunk in seen)
        assert rows(join(seen), shown * OTHER_PINS) == sorted([*alone[0], *alone[1]])
        both.restore(begin)


def test_a_first_chip_without_edges_runs_ahead_of_it_by_less_than_a_second(pair: PairBuild) -> None:
    schedule, image = pair.chips[0].plan.schedule, pair.chips[0].programs[0].image
    first = Machine(image, schedule.clock)
    first.apply([LevelChange(0, MCLR_PIN, 0)])
    pieces = FirstChip(lambda: first, PINS.index("RB1"), PINS.index("RA4")).changes(schedule.clock)
    known, changes = next(pieces)
    assert 0 < known < schedule.clock.hz / 4 and len(changes) == 1  # low at first


@pytest.fixture(scope="module")
def restarting() -> PlayedPair:
    return planned_pair(
        plan_job(loads(JOB.replace('wire = "RA4"', 'wire = "RA1"\nrestart = "RA4"'), "it.toml"))
    )


@pytest.fixture(scope="module")
def images(restarting: PlayedPair) -> tuple[Image, Image]:
    return restarting.images()


@pytest.mark.parametrize("offset", [0, 744, 5_003])
def test_after_a_reset_of_the_second_chip_alone_both_begin_anew(
    restarting: PlayedPair, images: tuple[Image, Image], offset: int
) -> None:
    """All edges agree from there on, and the second chip is in the frame of the wire."""
    machine = paired_machine(restarting.schedules, images, shown=1)
    machine.run(40 * P + offset)
    begin, before = machine.cycles, machine.other.state().resets["mclr"]
    machine.apply([LevelChange(begin, MCLR_PIN, 0), LevelChange(begin + 50, MCLR_PIN, 1)])
    machine.run(1000)
    edges = machine.run(60 * P)
    assert machine.other.state().resets["mclr"] == before + 1
    first, second = (
        EdgeTrace(machine.clock, [chunk._replace(pin=chunk.pin % OTHER_PINS)], machine.cycles)
        for chunk in (part(edges, edges.pin >= OTHER_PINS), part(edges, edges.pin < OTHER_PINS))
    )
    verdict = judge_traces(restarting.schedules, (first, second))
    assert verdict.apart == 0 and all(each.agrees for each in verdict.chips)
    assert all((each.start or 0) > begin + 13 * P for each in verdict.chips)


@pytest.mark.parametrize("shown", [0, 1])
def test_the_first_chip_is_reset_in_one_cycle_however_the_run_is_cut(
    restarting: PlayedPair, images: tuple[Image, Image], shown: int
) -> None:
    """Whichever chip is shown, in one run, in small ones, by instructions that are noted, and from a
    snapshot.
    """

    def noted(machine: PairedMachine, end: int) -> EdgeChunk:
        trace = np.zeros((64, 4), dtype=np.int64)
        return join(edges for edges, _ in machine.observe(end, Observation(trace=trace)))

    whole = rows(paired_machine(restarting.schedules, images).run(15 * P))
    assert [edge[2] for edge in whole if edge[1] == OTHER_PINS + PINS.index("RA4")] == [LOW, UNDRIVEN]
    machine = paired_machine(restarting.schedules, images, shown)
    begin = machine.snapshot()
    parts = [machine.run(7) for _ in range(200)]
    assert rows(join([*parts, machine.run(15 * P - machine.cycles)]), shown * OTHER_PINS) == whole
    machine.restore(begin)
    parts = [noted(machine, 1500), machine.run(15 * P - 1500)]
    assert rows(join(parts), shown * OTHER_PINS) == whole


RESETS_FOR_EVER = """
        list p=16f84
        include "p16f84.inc"
        bsf STATUS, RP0
again   movlw 0x0F
        movwf TRISA
        movlw 0x1F
        movwf TRISA
        decfsz 0x20, f
        goto $-1
        goto again
        end
"""


def test_the_work_for_a_line_that_changes_for_ever_grows_with_the_time_only(
    restarting: PlayedPair, images: tuple[Image, Image], monkeypatch: pytest.MonkeyPatch
) -> None:
    second = assemble(RESETS_FOR_EVER, "it.asm", device("PIC16F84")).image
    machine = paired_machine(restarting.schedules, (images[0], second))
    run, ran = machine.other.run, list[int]()

    def counted(cycles: int) -> EdgeChunk:
        ran.append(cycles)
        return run(cycles)

    monkeypatch.setattr(machine.other, "run", counted)
    edges = machine.run(2 * P)
    assert np.count_nonzero(edges.pin == OTHER_PINS + PINS.index("RA4")) > 80
    assert sum(ran) < 5 * 2 * P


def test_frames_of_the_first_chip_begin_after_the_second_one_can_listen(pair: PairBuild, wire: Wire) -> None:
    """Its power-up timer may end 104 ms later (DS35007, parameter 33), and it waits for a quiet frame."""
    assert rises(wire)[0] >= 104_000 + 2 * P


@pytest.mark.parametrize(
    ("change", "to", "says"),
    [
        ('wire = "RB1"', 'wire = "RB5"', "no servo of the first chip is on RB5"),
        ('wire = "RA4"', 'wire = "RA3"', "RA3 is in use: d"),
        ('wire = "RA4"', 'wire = "RA4"\nrestart = "RA4"', "RA4 is in use: wire"),
        ('wire = "RA4"', 'wire = "RA4"\nrestart = "RA1"', "RA1 is no open drain"),
        ('wire = "RB1"', 'wire = "RB1"\nrestart = "RA4"', "the first chip does not restart"),
        ('wire = "RA4"', 'wire = "RA4"\nservos = ["c"]', "'servos' is missing"),
        ("[motion]", '[firmware]\nengine = "sequence"\n[motion]', "does not follow another chip"),
        ("[motion]", '[firmware]\nstart_pin = "RB7"\n[motion]', "two chips do not read buttons"),
        ('pin = "RA3"', 'pin = "RB0"', "two servos are on pin RB0: c and d"),
    ],
)
def test_a_pair_that_cannot_be_is_refused_with_the_reason(change: str, to: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        loads(JOB.replace(change, to), "pair.toml")


def test_no_single_program_plays_a_pair() -> None:
    with pytest.raises(InputError, match="no single program plays it"):
        planned(plan_job(loads(JOB, "pair.toml")))


def invoke(*words: str) -> Result:
    return CliRunner().invoke(app, list(words))


def test_build_writes_two_folders_that_verify_judges_together(tmp_path: Path) -> None:
    job = tmp_path / "pair.toml"
    job.write_text(JOB)
    built = invoke("build", str(job), "-o", str(tmp_path / "b"))
    assert built.exit_code == 0, built.output
    assert invoke("verify", str(tmp_path / "b")).exit_code == 0
    report = (tmp_path / "b/report.txt").read_text()
    assert "RB1 of chip1, also a servo's signal, to RA4 of chip2" in report and "proven" not in report
    (tmp_path / "b/chip2/main.hex").write_bytes((tmp_path / "b/chip1/main.hex").read_bytes())
    judged = invoke("verify", str(tmp_path / "b"))
    assert judged.exit_code == 1 and "both chips: NOT exact" in judged.output


@pytest.mark.parametrize("dialect", sampled(range(3), 1))
def test_the_second_chip_is_proven_for_every_wire_in_every_dialect(pair: PairBuild, dialect: int) -> None:
    second = pair.chips[1]
    text = second.plan.schedule.json_text().encode()
    verdict, _, witness = prove_program(second.programs[dialect].image, second.plan.schedule, text)
    assert verdict.text == "proven, checked" and witness is not None and witness.checked is not None


def test_the_page_that_builds_a_pair_is_answered_with_both_programs(
    pair: PairBuild, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(editing, "build_pair", lambda job: pair)
    monkeypatch.setattr(editing, "job_subject", lambda path, job, setting: None)
    file = tmp_path / "pair.toml"
    found, _ = editing.Editor(file, Setting()).handle({"do": "build", "text": JOB}, Event())
    assert found["is"] == "built" and found["exact"] and found["reasons"] == []
    assert list(found["files"]) == ["pair-chip1.hex", "pair-chip2.hex"]
    for text, build in zip(found["files"].values(), pair.chips, strict=True):
        assert read_hex(text, "built").image.program == build.programs[0].image.program
