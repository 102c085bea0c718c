"""What is written is read again: every format, every clock, whatever the chunks."""

from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeTrace, edge_chunk, join
from servogen.errors import InputError, Location
from servogen.traces import SUFFIXES, edge_writer, read_edges, recorded, write_edges
from servogen.traces.vcd import vcd_times
from servogen.units import Clock, Cycles
from tests.campaigns import sampled
from tests.edges.rows import rows_of

Row = tuple[int, int, int]
MHZ4 = Clock(4_000_000)


@st.composite
def changes(draw: st.DrawFn) -> list[Row]:
    """Changes of pins in order: only real ones, at most one a pin and cycle."""
    steps = draw(
        st.lists(st.tuples(st.integers(0, 10**9), st.integers(0, 12), st.integers(0, 2)), max_size=60)
    )
    level = [UNDRIVEN] * len(PINS)
    touched: dict[int, int] = {}
    rows: list[Row] = []
    cycle = 0
    for step, pin, value in steps:
        cycle += step
        if level[pin] != value and touched.get(pin) != cycle:
            rows.append((cycle, pin, value))
            level[pin] = value
            touched[pin] = cycle
    return rows


def trace_of(rows: list[Row], clock: Clock, tail: int, cut: int) -> EdgeTrace:
    end = Cycles((rows[-1][0] if rows else 0) + tail)
    parts = [rows[:cut], [], rows[cut:]]
    return EdgeTrace(clock, tuple(edge_chunk(*zip(*part, strict=True)) for part in parts if part), end)


@settings(max_examples=150)
@given(
    rows=changes(),
    hz=st.sampled_from(
        [4_000_000, 20_000_000, 10_000_000, 8_000_000, 3_579_545, 32_768, 12_000_000, 1_843_200]
    ),
    tail=st.integers(1, 10**7),
    cut=st.integers(0, 60),
)
def test_vcd_and_jsonl_keep_every_change_and_vcd_the_end(
    rows: list[Row], hz: int, tail: int, cut: int
) -> None:
    trace = trace_of(rows, Clock(hz), tail, cut)
    with TemporaryDirectory() as folder:
        vcd, jsonl = Path(folder, "a.vcd"), Path(folder, "a.jsonl")
        write_edges(trace, vcd, jsonl)
        for path in (vcd, jsonl):
            assert rows_of(read_edges(path, trace.clock)) == rows
        assert read_edges(vcd, trace.clock).end == trace.end
        assert read_edges(jsonl, trace.clock, end=trace.end).end == trace.end


@settings(max_examples=100)
@given(rows=changes(), cut=st.integers(0, 60))
def test_csv_keeps_the_driven_changes(rows: list[Row], cut: int) -> None:
    trace = trace_of(rows, MHZ4, 1, cut)
    with TemporaryDirectory() as folder:
        path = Path(folder, "a.csv")
        write_edges(trace, path)
        level = [LOW] * len(PINS)
        expected = []
        for cycle, pin, value in rows:
            driven = HIGH if value == HIGH else LOW
            if level[pin] != driven:
                expected.append((cycle, pin, driven))
                level[pin] = driven
        assert rows_of(read_edges(path, MHZ4)) == expected
        lines = path.read_text().splitlines()
        assert lines == [
            "cycle,pin,level",
            *(f"{cycle},{PINS[pin]},{value}" for cycle, pin, value in expected),
        ]


@pytest.mark.parametrize("suffix", sampled(SUFFIXES))
def test_a_file_of_many_blocks_is_read_in_chunks_and_as_often_as_asked(tmp_path: Path, suffix: str) -> None:
    count = 150_000 if suffix == ".jsonl" else 350_000  # more than 4 MiB
    cycle = np.cumsum(np.random.default_rng(7).integers(1, 300, count))
    chunk = edge_chunk(cycle, np.full(count, PINS.index("RB3")), np.arange(count) % 2 ^ 1)
    trace = EdgeTrace(MHZ4, (chunk,), Cycles(int(cycle[-1]) + 1))
    write_edges(trace, tmp_path / f"a{suffix}")
    read = read_edges(tmp_path / f"a{suffix}", MHZ4)
    assert sum(1 for _ in read.chunks) > 1
    assert read.end == trace.end
    for _ in range(2):
        for got, put in zip(join(read.chunks), chunk, strict=True):
            assert np.array_equal(got, put)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_trace_without_edges_is_a_file_without_rows(tmp_path: Path, suffix: str) -> None:
    write_edges(EdgeTrace(MHZ4, (), Cycles(500)), tmp_path / f"a{suffix}")
    assert rows_of(read_edges(tmp_path / f"a{suffix}", MHZ4)) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_caller_may_cut_a_trace_or_say_that_it_goes_on(tmp_path: Path, suffix: str) -> None:
    rows = [(10, 5, HIGH), (20, 5, LOW), (30, 5, HIGH)]
    write_edges(trace_of(rows, MHZ4, 1, 1), tmp_path / f"a{suffix}")
    cut = read_edges(tmp_path / f"a{suffix}", MHZ4, end=30)
    assert (rows_of(cut), cut.end) == (rows[:2], 30)
    longer = read_edges(tmp_path / f"a{suffix}", MHZ4, end=1000)
    assert (rows_of(longer), longer.end) == (rows, 1000)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_same_edges_give_the_same_bytes_whatever_the_chunks(tmp_path: Path, suffix: str) -> None:
    rows = [
        (0, 5, LOW), (0, 6, LOW), (7, 5, HIGH), (7, 6, HIGH), (9, 5, LOW), (9, 6, UNDRIVEN), (12, 4, HIGH),
    ]  # fmt: skip
    written = set()
    for cut in range(len(rows) + 1):
        write_edges(trace_of(rows, MHZ4, 5, cut), tmp_path / f"a{suffix}")
        written.add((tmp_path / f"a{suffix}").read_bytes())
    assert len(written) == 1


def test_recorded_gives_the_edges_on_while_it_writes_them(tmp_path: Path) -> None:
    rows = [(10, 5, HIGH), (20, 5, LOW)]
    once = EdgeTrace(MHZ4, iter(trace_of(rows, MHZ4, 1, 1).chunks), Cycles(100))
    with edge_writer(tmp_path / "a.csv", MHZ4) as csv, edge_writer(tmp_path / "a.vcd", MHZ4) as vcd:
        assert rows_of(recorded(once, (csv, vcd))) == rows
    assert (tmp_path / "a.csv").read_text() == "cycle,pin,level\n10,RB0,1\n20,RB0,0\n"
    assert (tmp_path / "a.vcd").read_text().endswith("#10\n1&\n#20\n0&\n#100\n")


def test_an_unknown_ending_is_named(tmp_path: Path) -> None:
    for call in (
        lambda: read_edges(tmp_path / "a.txt", MHZ4),
        lambda: write_edges(EdgeTrace(MHZ4, (), Cycles(0)), tmp_path / "a.txt"),
    ):
        with pytest.raises(InputError, match=r"'\.txt' is not the suffix.*\n.*\.csv, \.jsonl, \.vcd"):
            call()


@pytest.mark.parametrize("wires", [{}, {"D0": "RB0"}])
@pytest.mark.parametrize("suffix", [".csv", ".JSONL"])
def test_rows_of_edges_have_no_wires_to_be_named(tmp_path: Path, suffix: str, wires: dict[str, str]) -> None:
    path = tmp_path / f"a{suffix}"
    with pytest.raises(InputError, match="its rows name the pins themselves") as refused:
        read_edges(path, MHZ4, wires=wires)
    told = refused.value.first
    assert (told.code, told.location) == ("conflicting-options", Location(str(path), key="--wire"))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_that_is_not_there_is_named(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_edges(tmp_path / f"none{suffix}", MHZ4)


@pytest.mark.parametrize(
    ("hz", "timescale", "steps"),
    [
        (4_000_000, (1, "us"), 1),  # 4 / 4 MHz = 1 µs
        (1_000_000, (1, "us"), 4),
        (20_000_000, (100, "ns"), 2),  # 200 ns
        (10_000_000, (100, "ns"), 4),  # 400 ns
        (16_000_000, (10, "ns"), 25),  # 250 ns
        (3_200_000, (10, "ns"), 125),  # 1.25 µs
        (12_800_000, (100, "ps"), 3125),  # 312.5 ns
    ],
)
def test_the_timescale_divides_the_instruction_cycle(hz: int, timescale: tuple[int, str], steps: int) -> None:
    times = vcd_times(Clock(hz))
    assert (times.timescale, times.steps_per_cycle, times.exact) == (timescale, steps, True)


def test_a_clock_that_does_not_divide_is_written_in_ps_with_its_error(tmp_path: Path) -> None:
    # 4 / 3 MHz = 1 333 333⅓ ps: thirds are at most ⅓ ps from a whole number.
    clock = Clock(3_000_000)
    times = vcd_times(clock)
    assert times.timescale == (1, "ps")
    assert times.worst_error_s == Fraction(1, 3 * 10**12)
    write_edges(trace_of([(1, 5, HIGH), (2, 5, LOW), (3_000_000, 5, HIGH)], clock, 1, 0), tmp_path / "a.vcd")
    text = (tmp_path / "a.vcd").read_text()
    assert "at most 0.333 ps off" in text
    assert [line for line in text.splitlines() if line.startswith("#")] == [
        "#0", "#1333333", "#2666667", "#4000000000000", "#4000001333333",
    ]  # fmt: skip
