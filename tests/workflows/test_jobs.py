"""The lab jobs, from their files to exact HEX files, and what happens when a thing is changed by one."""

import csv
import json
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from servogen.edges import EdgeChunk, EdgeTrace, join
from servogen.job import load, plan_job
from servogen.pic.image import Image, from_hex
from servogen.pic.isa import WORD_MASK
from servogen.pulse import from_json
from servogen.simulator import Machine
from servogen.workflows.engines import planned
from servogen.workflows.job_build import Build, build, checked_edges, judge_firmware, write
from servogen.workflows.verification import checked_cycles, judge_edges, running

ROOT = Path(__file__).parent.parent.parent
JOBS = ("lab8-program", "lab8-exercise", "lab9-program", "lab9-exercise")
MUTATIONS = 20


@cache
def built(name: str) -> Build:
    return build(plan_job(load(ROOT / "jobs" / f"{name}.toml")))


@pytest.fixture(scope="module", params=JOBS)
def job(request: pytest.FixtureRequest) -> Build:
    return built(request.param)


def test_every_edge_of_every_dialect_is_where_the_schedule_has_it(job: Build) -> None:
    for program in job.programs:
        verdict = program.verdict
        assert verdict.passed, verdict.reasons
        assert verdict.worst_edge_error == 0
        assert verdict.span.loop_repeats >= 2
        assert verdict.span.whole
    assert {program.firmware.dialect for program in job.programs} == {"c2c", "xc8", "sdcc"}


def test_all_dialects_make_the_same_edges_from_reset_on(job: Build) -> None:
    schedule = job.plan.schedule
    traces = [
        join(running(schedule, program.image, checked_cycles(schedule)).driven()) for program in job.programs
    ]
    first = traces[0]
    for trace in traces[1:]:
        assert all((one == other).all() for one, other in zip(first, trace, strict=True))


def test_a_job_is_built_to_the_same_bytes_twice(tmp_path: Path) -> None:
    again = build(plan_job(load(ROOT / "jobs" / "lab9-program.toml")))
    for folder, done in (("one", built("lab9-program")), ("two", again)):
        write(done, tmp_path / folder)
    one, two = ({file.name: file.read_bytes() for file in (tmp_path / f).iterdir()} for f in ("one", "two"))
    assert one == two
    assert sorted(one) == [
        "edges.csv",
        "main.c2c.c",
        "main.hex",
        "main.lst",
        "main.sdcc.c",
        "main.sdcc.hex",
        "main.vcd",
        "main.xc8.c",
        "main.xc8.hex",
        "report.txt",
        "schedule.json",
    ]


@dataclass(frozen=True)
class PulseSeen:
    rise: int
    width: int


def pulses_in(edges: Path, pin: str) -> list[PulseSeen]:
    """Read with nothing but the csv module."""
    with edges.open() as file:
        rows = [(int(row["cycle"]), int(row["level"])) for row in csv.DictReader(file) if row["pin"] == pin]
    return [
        PulseSeen(at, end - at)
        for (at, up), (end, down) in zip(rows[::2], rows[1::2], strict=True)
        if up > down
    ]


def test_exercise_8_4_in_its_edge_file(tmp_path: Path) -> None:
    """30, 90, 120 degrees are 1167, 1500, 1667 us; 2, 5, 3 s are 100, 250, 150 frames of 20 ms."""
    write(built("lab8-exercise"), tmp_path)
    pulses = pulses_in(tmp_path / "edges.csv", "RB0")
    one_round = [1167] * 100 + [1500] * 250 + [1667] * 150
    assert [pulse.width for pulse in pulses] == one_round * 3
    periods = {after.rise - before.rise for before, after in pairwise(pulses)}
    assert periods == {20_000}


def test_a_program_is_run_once_to_be_judged_written_and_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs: list[Machine] = []

    def counted(machine: Machine, cycles: int) -> Iterator[EdgeChunk]:
        runs.append(machine)
        return stream(machine, cycles)

    stream = Machine.stream
    made = planned(plan_job(load(ROOT / "jobs" / "lab8-program.toml")))
    firmware = made.make("c2c")
    monkeypatch.setattr(Machine, "stream", counted)
    program = judge_firmware(made.plan.schedule, firmware, stored=True)
    done = replace(built("lab8-program"), programs=(program,))
    write(done, tmp_path)
    assert len(runs) == 1
    monkeypatch.undo()
    seen = join(checked_edges(done).chunks)
    span = checked_cycles(done.plan.schedule)
    again = join(running(done.plan.schedule, program.image, span).until(checked_edges(done).end).chunks)
    assert all((column == repeated).all() for column, repeated in zip(seen, again, strict=True))


def test_the_schedule_in_the_folder_is_the_one_that_was_proven(tmp_path: Path, job: Build) -> None:
    write(job, tmp_path)
    text = (tmp_path / "schedule.json").read_text()
    assert from_json(text, "schedule.json") == job.plan.schedule
    assert set(json.loads(text)) == {
        "version",
        "device",
        "plan_error",
        "clock_hz",
        "period_cycles",
        "channels",
        "lead_in",
        "loop",
    }
    assert from_hex((tmp_path / "main.hex").read_text()) == job.programs[0].image
    report = (tmp_path / "report.txt").read_text()
    for row in job.plan.widths:
        assert f"{float(row.requested_us):.3f}" in report


@pytest.mark.parametrize("stop", [KeyboardInterrupt, RuntimeError])
def test_a_build_that_is_interrupted_leaves_the_one_before_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop: type[BaseException]
) -> None:
    write(built("lab8-exercise"), tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def stopped(*_: object, **__: object) -> None:
        raise stop

    monkeypatch.setattr("servogen.workflows.job_build.write_edges", stopped)
    with pytest.raises(stop):
        write(built("lab9-program"), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def changed_words(image: Image, seed: str) -> Iterator[tuple[int, int, Image]]:
    """(address, bit, image) with one bit of one program word turned, `MUTATIONS` times."""
    random_bits = random.Random(seed)
    addresses = sorted(image.program)
    for _ in range(MUTATIONS):
        address, bit = random_bits.choice(addresses), random_bits.randrange(WORD_MASK.bit_length())
        program = {**image.program, address: image.program[address] ^ 1 << bit}
        yield address, bit, replace(image, program=program)


def test_a_turned_bit_is_proven_only_if_the_edges_are_truly_the_same(job: Build) -> None:
    schedule, image = job.plan.schedule, job.programs[0].image
    span = checked_cycles(schedule)
    right = edges_after_the_first(running(schedule, image, span), span)
    refused = 0
    for address, bit, other in changed_words(image, job.job.name):
        trace = running(schedule, other, span).stored()
        verdict = judge_edges(schedule, trace, span)
        same = edges_after_the_first(trace, span) == right
        assert verdict.passed == same, (hex(address), bit, verdict.reasons)
        refused += not verdict.passed
    assert refused > MUTATIONS // 4


def edges_after_the_first(trace: EdgeTrace, span: int) -> bytes:
    """All driven edges within `span` cycles of the first, times counted from it: the verdict's own words
    put another way."""
    edges = join(trace.driven())
    if not len(edges.cycle):
        return b""
    inside = edges.cycle < edges.cycle[0] + span
    cycle = edges.cycle[inside] - edges.cycle[0]
    return cycle.tobytes() + edges.pin[inside].tobytes() + edges.level[inside].tobytes()


def test_a_constant_changed_by_one_cycle_is_told_with_cycle_pin_and_frame() -> None:
    """The C's delay for 90 degrees made one microsecond longer: its first frame is frame 100."""
    from servogen.compiler import Options, Source, compile_sources

    done = built("lab8-exercise")
    firmware, schedule = done.programs[1].firmware, done.plan.schedule
    assert firmware.dialect == "xc8"
    high = next(
        line for line in firmware.text.split("arm high for 1500 us")[1].splitlines() if "_delay" in line
    )
    cycles = int(high.split("(")[1].split(")")[0])
    wrong = firmware.text.replace(f"_delay({cycles})", f"_delay({cycles + 1})")
    options = Options(dialect="xc8", device=done.job.device)
    image = compile_sources([Source(wrong, "wrong.c")], options).image
    verdict = judge_edges(schedule, running(schedule, image, checked_cycles(schedule)))
    assert not verdict.passed
    difference = verdict.difference
    assert difference is not None and difference.channel == "arm" and difference.frame == 100
    start = verdict.start or 0
    assert (difference.expected, difference.observed) == (
        start + 100 * 20_000 + 1500,
        start + 100 * 20_000 + 1501,
    )
    assert verdict.channels[0].width.error == 1


@pytest.mark.campaign
def test_a_dialect_whose_program_does_not_fit_is_left_out_and_told(tmp_path: Path) -> None:
    """SDCC's waits take more words: many positions fit the chip in the job's own dialect alone."""
    poses = ", ".join(f"{{ arm_deg = {30 + number}, hold_s = 0.2 }}" for number in range(40))
    text = (ROOT / "jobs" / "lab8-exercise.toml").read_text()
    text = re.sub(r"poses = \[.*?\n\]", f"poses = [{poses}]", text, flags=re.DOTALL)
    (tmp_path / "many.toml").write_text(text + '[firmware]\nengine = "sequence"\n')
    done = build(plan_job(load(tmp_path / "many.toml")))
    assert [program.firmware.dialect for program in done.programs] == ["c2c", "xc8"]
    assert done.exact
    assert [each.code for each in done.left_out] == ["dialect-left-out"]
    assert any("no program for sdcc" in str(warning) for warning in done.warnings)


def test_the_vcd_of_a_build_has_the_level_of_its_inputs(tmp_path: Path) -> None:
    """The serial line of a stream job idles high; it never changes, so that edges.csv has no row of it."""
    write(build(plan_job(load(ROOT / "jobs" / "stream-fast.toml"))), tmp_path)
    vcd = (tmp_path / "main.vcd").read_text()
    (code,) = re.findall(r"\$var wire 1 (\S+) inRA4 \$end", vcd)
    assert f"\n1{code}\n" in vcd.split("$dumpvars")[1].split("$end")[0]
    assert "RA4" not in (tmp_path / "edges.csv").read_text()
