"""Two chips with a crystal each: the second one's pulses keep their widths, within a stated jitter."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from servogen.cli import rig_command
from servogen.cli.app import app
from servogen.edges import (
    HIGH,
    LOW,
    OTHER_PINS,
    PAIR_NAMES,
    PINS,
    UNDRIVEN,
    EdgeChunk,
    edge_chunk,
    join,
    part,
)
from servogen.engines.board import board_of, machine_of
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.programs import read_pair
from servogen.simulator import Levels, Machine, Stimuli
from servogen.traces.captures import capture_writer
from servogen.units import Cycles
from servogen.watch.subject import Setting, load_subject, proven_sentence
from servogen.workflows.own_crystals import outwards
from servogen.workflows.pair import judge_pair
from servogen.workflows.pair_capture import Schedules, judge_pair_capture
from servogen.workflows.pair_proof import prove_pair
from tests.prove.wired import OWN_PPM, first_chip, own_schedules, own_second_chip
from tests.two_chips import ARM, TWO

OWN = TWO + 'restart = "RA4"\ncrystal_ppm = 100\n' + ARM.format(elbow="RB0")
NAMES = {pin: PAIR_NAMES[pin] for pin in (PINS.index("RB0"), OTHER_PINS + PINS.index("RB0"))}
LOOK = [encode("BTFSC", f=0x05, b=1)]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of the arm's build, and what was printed."""
    path = tmp_path_factory.mktemp("own")
    (path / "arm.toml").write_text(OWN)
    done = CliRunner().invoke(app, ["build", str(path / "arm.toml"), "-o", str(path / "b")])
    assert done.exit_code == 0, done.output
    return path / "b", done.output


@pytest.fixture(scope="module")
def schedules(built: tuple[Path, str]) -> Schedules:
    return read_pair(built[0])[0]


@pytest.fixture(scope="module")
def images(built: tuple[Path, str]) -> tuple[Image, Image]:
    return read_pair(built[0])[1]


def looks(image: Image) -> list[int]:
    """The addresses of the kernel's looks for the rise, which are two words apart."""
    there = [address for address, word in image.program.items() if word in LOOK]
    return [at for at in sorted(there) if {at - 2, at + 2} & {*there}]


def test_every_run_at_the_limits_of_both_crystals_is_exact_within_the_jitter_of_a_look_and_the_drift(
    schedules: Schedules, images: tuple[Image, Image]
) -> None:
    verdict = judge_pair(schedules, images)
    assert verdict.exact and verdict.jitter is not None
    # 20000 cycles at up to 200 ppm, and a look every 2.
    assert [float(each) for each in verdict.jitter.allowed_us] == pytest.approx([-4, 6], abs=0.01)
    least, most = verdict.jitter.seen_us
    assert -4 <= least < 0 < most <= 6
    assert verdict.summary().startswith("both chips: exact in 6 runs, each in its own cycles; chip2's pulses")


def test_a_second_chip_that_misses_a_look_is_reported(
    schedules: Schedules, images: tuple[Image, Image]
) -> None:
    first, second = images
    found = looks(second)
    assert len(found) == 11
    missing = {found[5]: encode("NOP"), found[5] + 1: encode("NOP")}
    wrong = replace(second, program={**second.program, **missing})
    verdict = judge_pair(schedules, (first, wrong))
    assert not verdict.exact and verdict.apart != 0


def test_a_wire_that_stops_releases_the_pulses_until_it_was_quiet_and_rises_again(
    schedules: Schedules, images: tuple[Image, Image]
) -> None:
    schedule = schedules[1]
    rule, period = schedule.wire, int(schedule.period)
    assert rule is not None
    rises = [frame * period for frame in (*range(3, 8), *range(11, 15))]
    levels = [(rise + after, level) for rise in rises for after, level in ((0, 1), (1000, 0))]
    wire = Stimuli([Levels(PINS.index(rule.pin), ((0, 0), *levels))])
    edges = Machine(images[1], schedule.clock, board_of(schedule), wire).run(16 * period)
    mine = (edges.pin == PINS.index("RB0")) & (edges.level == 1)
    frames = sorted({(cycle - rule.cycles) // period for cycle in edges.cycle[mine].tolist()})
    assert frames == [*range(4, 8), *range(12, 15)]


@pytest.fixture(scope="module", params=[1 - 2e-4, 1 + 2e-4])
def recorded(request: pytest.FixtureRequest, schedules: Schedules, images: tuple[Image, Image]) -> EdgeChunk:
    """Two million cycles of both chips, in the first one's time, with the second one's rate."""
    first, second = schedules
    rate, rule, end = request.param, second.wire, 3_000_000
    assert rule is not None
    edges = machine_of(first, images[0]).run(end)
    wire = part(edges, edges.pin == PINS.index(rule.source))
    levels = zip((wire.cycle * rate).astype(int) + 1, wire.level == HIGH, strict=True)
    source = Levels(PINS.index(rule.pin), ((0, 0), *((int(cycle), int(level)) for cycle, level in levels)))
    machine = Machine(images[1], second.clock, board_of(second), Stimuli([source]))
    theirs = machine.run(int(end * rate))
    both = join((edges, edge_chunk(theirs.cycle / rate, theirs.pin + OTHER_PINS, theirs.level)))
    both = part(both, (both.level != UNDRIVEN) & np.isin(both.pin, list(NAMES)) & (both.cycle > 1_000_000))
    return both._replace(cycle=both.cycle - 1_000_000)


@pytest.mark.parametrize(("late", "agrees"), [(0, True), (40, False), (-40, False)])
def test_a_recording_of_both_agrees_within_the_jitter(
    schedules: Schedules, recorded: EdgeChunk, tmp_path: Path, late: int, agrees: bool
) -> None:
    edges = recorded._replace(cycle=recorded.cycle + np.where(recorded.pin >= OTHER_PINS, late, 0))
    with capture_writer(tmp_path / "it.vcd", 1_000_000, pins=NAMES) as writer:
        writer.add(edge_chunk([0, 0], list(NAMES), [LOW, LOW]))
        writer.add(part(edges, np.argsort(edges.cycle, kind="stable")))
        writer.finish(Cycles(1_970_000))
    assert judge_pair_capture(schedules, tmp_path / "it.vcd").agrees is agrees


def test_the_pair_is_proven_with_its_jitter_and_without_the_words_of_one_crystal() -> None:
    found = prove_pair(own_schedules(), (first_chip(frames=1), own_second_chip()), max_states=3000)
    assert found.checked, found.summary()
    text = "\n".join(found.lines())
    # 1000 cycles at up to 2002.002 ppm, and a look every 2; both bounds are rounded away from each other.
    assert "-2.1 to +4.1 µs from their places" in text
    assert f"off by {OWN_PPM} ppm or less" in text and "crystal is exact" not in text
    assert "one crystal" not in text and "levels of inputs change between instruction cycles" in text


@pytest.mark.parametrize(
    ("bounds", "says"),
    [
        ((-4.0004, 6.0004), "-4.1 to +6.1 µs"),
        ((-0.3, 0.7), "-0.3 to +0.7 µs"),
        ((0.01, 1.1), "+0.0 to +1.1 µs"),
    ],
)
def test_printed_bounds_contain_what_they_bound(bounds: tuple[float, float], says: str) -> None:
    least, most = (Fraction(str(each)) for each in bounds)
    assert outwards(least, most) == says


def test_a_built_pair_says_that_each_chip_has_its_crystal(built: tuple[Path, str]) -> None:
    folder, printed = built
    assert "6 runs of each pair" in printed
    report, page = ((folder / f"report.{kind}").read_text() for kind in ("txt", "html"))
    assert "Each chip has a crystal of its own, off by 100 ppm or less." in report
    assert "OSC1 of the second chip" not in report + page and "OSC2 of chip 1" not in page
    judged = json.loads(CliRunner().invoke(app, ["verify", str(folder), "--json"]).output)
    assert judged["exact"] and judged["jitter"]["runs"] == 6


@pytest.mark.parametrize(("text", "rates"), [(OWN, True), (OWN.replace("crystal_ppm = 100\n", ""), False)])
def test_watch_and_rig_say_that_they_run_two_crystals_at_equal_rates(
    text: str, rates: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "arm.toml").write_text(text)
    subject = load_subject(tmp_path / "arm.toml", Setting())
    assert subject.first_difference is None
    for shown in (subject, subject.showing(1)):
        assert ("both crystals at equal rates" in proven_sentence(shown)) is rates
    rig_command.paired_rig(plan_job(loads(text, "arm.toml")), None)
    assert ("both crystals at equal rates" in capsys.readouterr().err) is rates


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (OWN.replace('wire = "RB0"', 'wire = "RB0"\ncrystal_ppm = 50'), "crystal_ppm is a key of the second"),
        (OWN.replace("= 100", "= 0"), "crystal_ppm"),
        (OWN.replace("= 100", "= 1001"), "crystal_ppm"),
        (OWN.replace("= 100", '= "own"'), "crystal_ppm"),
    ],
)
def test_a_tolerance_that_is_none_is_refused_with_its_key(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        loads(text, "arm.toml")
