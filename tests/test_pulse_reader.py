"""The laws of `Pulses`: what is complete, what the ends of a trace cut; chunks make no difference."""

from __future__ import annotations

import shutil
import subprocess
from copy import copy
from pathlib import Path
from random import Random

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeChunk, EdgeTrace, edge_chunk, part
from servogen.pulses import BEFORE_ALL, PulseReader, Pulses, joined, pulses
from servogen.units import Clock, Cycles

MHZ4 = Clock(4_000_000)
END = 1000
Row = tuple[int, int, int]
"""Cycle, pin, level."""
Found = tuple[int, int, int, bool]
"""Pin, rise, width, complete."""


def chunk(rows: list[Row]) -> EdgeChunk:
    return edge_chunk(*zip(*rows, strict=True)) if rows else edge_chunk((), (), ())


def read(*rows: Row) -> list[Found]:
    return told(pulses(EdgeTrace(MHZ4, (chunk(list(rows)),), Cycles(END))))


def told(found: Pulses) -> list[Found]:
    return list(zip(*(column.tolist() for column in found), strict=True))


def test_a_pulse_between_two_edges_is_complete() -> None:
    assert read((10, 5, HIGH), (25, 5, LOW)) == [(5, 10, 15, True)]


def test_a_pulse_that_the_end_cuts_off_falls_there_and_is_not_complete() -> None:
    assert read((10, 5, HIGH)) == [(5, 10, END - 10, False)]


def test_a_pin_that_is_high_when_the_trace_begins_was_not_seen_to_rise() -> None:
    assert read((0, 5, HIGH), (25, 5, LOW)) == [(5, 0, 25, False)]
    assert read((0, 5, HIGH)) == [(5, 0, END, False)]  # high throughout
    assert read((0, 5, HIGH), (0, 5, LOW)) == []  # the last level of cycle 0 is what it begins with


def test_a_reader_whose_rises_were_all_seen_counts_that_of_cycle_0() -> None:
    assert told(PulseReader(BEFORE_ALL)(chunk([(0, 5, HIGH), (25, 5, LOW)]))) == [(5, 0, 25, True)]


def test_a_pin_that_nothing_drives_is_low() -> None:
    assert read((10, 5, HIGH), (25, 5, UNDRIVEN)) == [(5, 10, 15, True)]
    assert read((10, 5, LOW), (12, 5, UNDRIVEN), (14, 5, LOW)) == []


def test_a_level_that_is_there_already_is_no_edge() -> None:
    assert read((10, 5, HIGH), (12, 5, HIGH), (25, 5, LOW), (30, 5, LOW)) == [(5, 10, 15, True)]
    assert read((30, 5, LOW)) == []


def test_pins_that_change_in_one_cycle_keep_their_order() -> None:
    rows = [(10, 8, HIGH), (10, 5, HIGH), (25, 8, LOW), (25, 5, LOW), (25, 5, HIGH), (30, 5, LOW)]
    assert read(*rows) == [(8, 10, 15, True), (5, 10, 15, True), (5, 25, 5, True)]


def test_a_pulse_within_one_cycle_has_no_width_and_is_one() -> None:
    assert read((10, 5, HIGH), (10, 5, LOW)) == [(5, 10, 0, True)]


def test_no_edges_are_no_pulses() -> None:
    assert read() == []


def random_rows(dice: Random) -> list[Row]:
    cycles = sorted(dice.choices(range(120), k=dice.randrange(40)))
    return [(cycle, dice.choice((0, 5, 12)), dice.choice((LOW, HIGH, UNDRIVEN))) for cycle in cycles]


def by_hand(rows: list[Row]) -> set[Found]:
    """Read each pin alone, cycle by cycle."""
    found: set[Found] = set()
    for pin in range(len(PINS)):
        high, rise = False, 0
        for cycle, other, level in rows:
            if other != pin or (level == HIGH) == high:
                continue
            high = not high
            if high:
                rise = cycle
            elif cycle > 0:
                found.add((pin, rise, cycle - rise, rise > 0))
        if high:
            found.add((pin, rise, END - rise, False))
    return found


@pytest.mark.parametrize("seed", range(30))
def test_chunks_cut_anywhere_give_what_a_reading_pin_by_pin_gives(seed: int) -> None:
    dice = Random(seed)
    rows = random_rows(dice)
    whole = chunk(rows)
    cuts = sorted(dice.choices(range(len(rows) + 1), k=dice.randrange(5)))
    reader = PulseReader()
    parts = [
        reader(part(whole, slice(begin, end)))
        for begin, end in zip([0, *cuts], [*cuts, len(rows)], strict=True)
    ]
    found = told(joined([*parts, reader.cut(END)]))
    assert found == read(*rows)
    assert set(found) == by_hand(rows) and len(found) == len(by_hand(rows))
    falls = [rise + width for _, rise, width, _ in found]
    assert falls == sorted(falls)


def test_a_copied_reader_goes_on_by_itself() -> None:
    reader = PulseReader()
    reader(chunk([(10, 5, HIGH)]))
    kept = copy(reader)
    assert told(reader(chunk([(25, 5, LOW)]))) == [(5, 10, 15, True)]
    assert (reader.high_since(5), kept.high_since(5)) == (None, 10)
    assert told(kept(chunk([(40, 5, LOW)]))) == [(5, 10, 30, True)]


def test_pulses_of_one_pin_and_complete_ones_are_taken_out() -> None:
    trace = [(1, 5, HIGH), (2, 8, HIGH), (3, 5, LOW), (4, 8, LOW), (5, 5, HIGH)]
    found = pulses(EdgeTrace(MHZ4, (chunk(trace),), Cycles(END)))
    assert told(found.of(5)) == [(5, 1, 2, True), (5, 5, END - 5, False)]
    assert told(found.of(5).whole()) == [(5, 1, 2, True)]
    assert found.fall.tolist() == [3, 4, END]


@pytest.mark.skipif(shutil.which("sigrok-cli") is None, reason="needs sigrok-cli")
def test_the_widths_are_those_that_sigrok_measures(tmp_path: Path) -> None:
    """Its decoder `timing` names the time between each two edges of a channel of a VCD file."""
    dice = Random(7)
    cycles = np.cumsum([dice.randrange(2, 900) for _ in range(40)])
    rows = [(int(cycle), 5, (HIGH, LOW)[number % 2]) for number, cycle in enumerate(cycles)]
    text = "$timescale 1us $end\n$var wire 1 ! RB0 $end\n$enddefinitions $end\n#0\n0!\n"
    text += "".join(f"#{cycle}\n{level}!\n" for cycle, _, level in rows) + f"#{rows[-1][0] + 50}\n"
    file = tmp_path / "wave.vcd"
    file.write_text(text)
    command = ["sigrok-cli", "-i", str(file), "-P", "timing:data=RB0", "-A", "timing=time"]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    times = [line.split()[1:3] for line in lines]
    between = [round(float(time) * (1000 if unit == "ms" else 1)) for time, unit in times]
    assert len(between) == len(rows) - 1
    trace = EdgeTrace(MHZ4, (chunk(rows),), Cycles(int(cycles[-1]) + 50))
    assert pulses(trace).width.tolist() == between[::2]
