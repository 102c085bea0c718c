"""A recording of both chips: each is judged by its schedule, the second also by where the wire puts it."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from servogen.bench.virtual.analyser import AnalyserOptions
from servogen.bench.virtual.chip import SecondChip
from servogen.bench.virtual.rig import RigOptions
from servogen.bench.virtual.rig import rig as opened
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
from servogen.engines.board import board_of, paired_machine
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.simulator import PairedMachine, Stimulus
from servogen.traces.captures import capture_writer
from servogen.units import Cycles
from servogen.workflows.capture import capture
from servogen.workflows.pair import planned_pair
from servogen.workflows.pair_capture import judge_pair_capture
from tests.cli.conftest import wrong
from tests.two_chips import ARM, TWO

Pair = tuple[tuple[PulseSchedule, PulseSchedule], tuple[Image, Image]]
BEGIN, END = 1_402_345, 4_700_000
"""The part that is recorded, in cycles: three loops."""
NAMES = {pin: PAIR_NAMES[pin] for pin in (PINS.index("RB0"), OTHER_PINS + PINS.index("RB0"))}


@pytest.fixture(scope="module")
def pair() -> Pair:
    played = planned_pair(plan_job(loads(TWO + ARM.format(elbow="RB0"), "arm.toml")))
    first, second = (each.compilation.image for each in played.firmware())
    return played.schedules, (first, second)


@pytest.fixture(scope="module")
def edges(pair: Pair) -> EdgeChunk:
    made = paired_machine(*pair).run(END)
    made = part(made, (made.cycle >= BEGIN) & (made.level != UNDRIVEN) & np.isin(made.pin, list(NAMES)))
    return join((edge_chunk([0, 0], list(NAMES), [LOW, LOW]), made._replace(cycle=made.cycle - BEGIN)))


def recorded(path: Path, edges: EdgeChunk, change: Callable[[EdgeChunk], EdgeChunk] = lambda e: e) -> Path:
    """The samples of an analyser at 1 MHz whose clock is 100 ppm slower than the chips'."""
    made = change(edges)
    order = np.argsort(made.cycle, kind="stable")
    samples = np.ceil(made.cycle[order] * (1 - 1e-4)).astype(np.int64)
    with capture_writer(path, 1_000_000, pins=NAMES) as writer:
        writer.add(EdgeChunk(samples, made.pin[order], made.level[order]))
        writer.finish(Cycles(END - BEGIN))
    return path


def test_both_chips_agree_and_the_second_is_where_the_wire_puts_it(
    pair: Pair, edges: EdgeChunk, tmp_path: Path
) -> None:
    verdict = judge_pair_capture(pair[0], recorded(tmp_path / "both.vcd", edges))
    assert verdict.agrees and verdict.accepted(partial=False)
    assert verdict.apart is not None and abs(verdict.apart) < 0.3
    assert all(chip.ppm == pytest.approx(100, abs=1) for chip in verdict.chips)
    assert verdict.lines()[0].startswith("both chips: agree; chip2 is ")
    assert wrong("verify", json.dumps({"diagnostics": [], **verdict.to_json()})) == []


@pytest.mark.parametrize("late", [-40, -3, 3, 700])
def test_a_second_chip_whose_frame_is_elsewhere_does_not_agree(
    pair: Pair, edges: EdgeChunk, tmp_path: Path, late: int
) -> None:
    """Each chip alone agrees with its schedule: only the distance between them is wrong."""

    def moved(made: EdgeChunk) -> EdgeChunk:
        beyond = (made.pin >= OTHER_PINS) & (made.cycle > 0)
        return made._replace(cycle=made.cycle + late * beyond)

    verdict = judge_pair_capture(pair[0], recorded(tmp_path / "both.vcd", edges, moved))
    assert all(chip.agrees for chip in verdict.chips) and not verdict.agrees
    assert verdict.apart == pytest.approx(late, abs=0.4)


def test_a_missing_pulse_of_the_second_chip_is_its_own(pair: Pair, edges: EdgeChunk, tmp_path: Path) -> None:
    def without(made: EdgeChunk) -> EdgeChunk:
        rises = np.flatnonzero((made.pin >= OTHER_PINS) & (made.level == HIGH))
        falls = np.flatnonzero((made.pin >= OTHER_PINS) & (made.level == LOW) & (made.cycle > 0))
        keep = np.ones(len(made.cycle), dtype=bool)
        keep[[rises[40], falls[falls > rises[40]][0]]] = False
        return part(made, keep)

    verdict = judge_pair_capture(pair[0], recorded(tmp_path / "both.vcd", edges, without))
    assert verdict.chips[0].agrees and not verdict.chips[1].agrees and not verdict.agrees
    assert verdict.apart is None


def test_channels_are_found_by_name_or_by_the_wires_given(
    pair: Pair, edges: EdgeChunk, tmp_path: Path
) -> None:
    path = recorded(tmp_path / "both.vcd", edges)
    text = path.read_text().replace("1.RB0", "D0").replace("2.RB0", "D9")
    path.write_text(text)
    assert judge_pair_capture(pair[0], path, {"D0": "1.RB0", "D9": "2.RB0"}).agrees
    assert not judge_pair_capture(pair[0], path, {"D0": "2.RB0", "D9": "1.RB0"}).agrees
    with pytest.raises(InputError, match=r"has no 1-bit wire '1\.RB0'"):
        judge_pair_capture(pair[0], path)
    with pytest.raises(InputError, match="there are two chips"):
        judge_pair_capture(pair[0], path, {"D0": "RB0"})


def test_the_bench_of_both_chips_records_all_their_pins(pair: Pair, tmp_path: Path) -> None:
    """One analyser has the pins of both: 32 channels, of which the second chip's begin at 16."""
    schedules, (first, second) = pair

    def beside(first: Image, second: Image, stimulus: Stimulus | None) -> PairedMachine:
        return paired_machine(schedules, (first, second), stimulus=stimulus)

    options = RigOptions(analyser=AnalyserOptions(memory=100_000))
    ended = threading.Event()
    path, board = tmp_path / "both.vcd", board_of(schedules[0])
    with opened(first, schedules[0].clock, board, options, {}, SecondChip(second, beside)) as terminals:
        assert {"programmer", "programmer2", "analyser"} <= set(terminals.paths)
        serving = threading.Thread(target=terminals.serve, args=(ended.is_set,))
        serving.start()
        try:
            capture(path, terminals.paths["analyser"], schedules[0], 1.9, second=schedules[1])
        finally:
            ended.set()
            serving.join(30)
    verdict = judge_pair_capture(schedules, path)
    assert verdict.agrees and verdict.apart is not None
    assert path.read_text().count("$var wire 1 ") == 2 * len(PINS)
