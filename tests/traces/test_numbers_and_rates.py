"""Numbers as they are read and written, blocks of any size, timescales, rates, limits."""

from __future__ import annotations

import random
import zipfile
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeTrace, edge_chunk
from servogen.errors import InputError, Location
from servogen.traces import lines, read_edges, rows, sigrok, vcd, write_edges
from servogen.traces.captures import capture_writer, is_capture, read_capture, sampled_at
from servogen.traces.channels import parse_rate, pin_in, step_clock
from servogen.traces.lines import first_lines, last_line, line_blocks
from servogen.traces.vcd import VcdTimes, vcd_times
from servogen.units import Clock, Cycles
from tests.edges.rows import rows_of

MHZ4 = Clock(4_000_000)
Row = tuple[int, int, int]


def ints(*values: int) -> rows.Integers:
    return np.array(values, dtype=np.int64)


# -- numbers -------------------------------------------------------------------------------------------------


def test_values_are_rescaled_to_the_nearest_with_halves_up() -> None:
    rng = random.Random(3)
    for ratio in (Fraction(1), Fraction(1, 2), Fraction(3, 2), Fraction(4_000_000, 3), Fraction(7, 10**6)):
        for largest in (1, 100, 10**6, 10**12):
            values = sorted(rng.randrange(largest) for _ in range(20))
            expected = [int(value * ratio + Fraction(1, 2)) for value in values]
            assert rows.rescale(ints(*values), ratio).tolist() == expected
    assert rows.rescale(ints(1, 3, 5), Fraction(1, 2)).tolist() == [1, 2, 3]
    assert rows.rescale(ints(), Fraction(3)).tolist() == []
    # Beyond 64 bits in between: Python's integers.
    far = ints(0, 10**12 + 1)
    assert rows.rescale(far, Fraction(10**6, 3)).tolist() == [0, (2 * 10**6 * (10**12 + 1) + 3) // 6]


def test_digits_stand_right_aligned_and_tables_are_padded() -> None:
    for values in ([0], [7], [0, 9, 10, 99, 100, 12_345], [10**17, 5]):
        digits = rows.decimals(ints(*values))
        width = max(len(str(value)) for value in values)
        assert digits.shape == (len(values), width)
        assert rows.text(digits, rows.table(["\n"] * len(values))).decode().split() == [
            str(v) for v in values
        ]
        assert [bytes(row).lstrip(b"\0").decode() for row in digits] == [str(value) for value in values]
    table = rows.table(["a", "bcd"])
    assert [bytes(row) for row in table] == [b"a\0\0", b"bcd"]
    both = rows.joined(table, rows.table(["efghi"]))
    assert [bytes(row) for row in both] == [b"a\0\0\0\0", b"bcd\0\0", b"efghi"]
    chunk = edge_chunk(range(5), [0] * 5, [1] * 5)
    assert [len(block.cycle) for block in rows.blocks(chunk)] == [5]


CLOCKS = (1, 4, 3, 7, 32_768, 1_000_000, 1_843_200, 4_000_000, 10_000_000, 12_800_000, 16_000_000)


@pytest.mark.parametrize("hz", CLOCKS)
def test_the_timescale_is_the_longest_that_divides_a_cycle(hz: int) -> None:
    """IEEE 1364: a power of ten from 1 to 100 of a unit; 1 us, then 100 ns down to 1 ps."""
    units = [(1, "us", 6), *((m, u, p) for u, p in (("ns", 9), ("ps", 12)) for m in (100, 10, 1))]
    cycle = Fraction(4, hz)
    times = vcd_times(Clock(hz))
    for magnitude, unit, power in units:
        steps = cycle / Fraction(magnitude, 10**power)
        if steps.denominator == 1:
            assert times == VcdTimes((magnitude, unit), steps, Fraction(0))
            assert times.exact
            assert times.sentence() == f"one instruction cycle is exactly {int(cycle * 10**power)} {unit}"
            return
    steps = cycle * 10**12
    distances = [abs(n * steps - round(n * steps)) for n in range(steps.denominator)]
    assert times == VcdTimes((1, "ps"), steps, max(distances) / 10**12)
    assert not times.exact
    assert times.sentence() == (
        f"one instruction cycle is {float(steps):.6f} ps, which is not a whole number: each edge is at the "
        f"nearest ps, at most {float(max(distances)):.3f} ps off; the errors do not add up"
    )


# What sigrok-cli 0.7.2 (libsigrok 0.5.2) shows of a session with this samplerate.
RATES = {
    "200 kHz": 200_000, "1000 KHz": 10**6, "1000000": 10**6, "1 M": 10**6, "1M": 10**6, "1MHz": 10**6,
    "1 mhz": 10**6, "1 MHZ": 10**6, "1.5 MHz": 1_500_000, "1.5 kHz": 1500, "0.5 MHz": 500_000, "1 GHz": 10**9,
    "12 Hz": 12, "  1 MHz": 10**6, "+1 MHz": 10**6, "20.5 kHz": 20_500, ".5 MHz": 500_000,
}  # fmt: skip


@pytest.mark.parametrize(("text", "rate"), RATES.items())
def test_a_rate_is_read_as_sigrok_reads_it(text: str, rate: int) -> None:
    assert parse_rate(text, Location("x.sr")) == rate


@pytest.mark.parametrize(
    "text",
    [
        "0,1 MHz", "1 M Hz", "1e6", "1 Mhzz", "-1 MHz", "0x10", "1_000 Hz", "", "kHz", "0", "0 Hz", "1;MHz",
        "\N{FULLWIDTH DIGIT ONE} MHz", "1/8 channels at 24 MHz", "at 2 GHz.", "1 MHz 2", "1.5", "0.5 Hz",
        # sigrok reads 1, 1 and 501 Hz: it loses what comes directly after a fraction, or a part of it
        "1.5M", "1.5MHz", "1.5e3 Hz",
    ],
)  # fmt: skip
def test_a_rate_that_is_not_understood_whole_is_refused_with_its_text(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_rate(text, Location("x.sr"))
    assert caught.value.message == f"sampling rate '{text}' is not understood"


def test_a_step_is_the_cycle_of_a_clock_four_times_as_fast() -> None:
    place = Location("x.sr")
    assert step_clock(Fraction(1_500_000), place) == Clock(6_000_000)
    assert step_clock(Fraction(1, 4), place) == Clock(1)
    for rate in (Fraction(1, 3), Fraction(0), Fraction(-1)):
        with pytest.raises(InputError) as caught:
            step_clock(rate, place)
        assert caught.value.message == f"{float(rate):g} time steps per second are not a whole number"


@pytest.mark.parametrize(
    ("name", "pin"),
    [
        *((pin, pin) for pin in PINS), *((pin.lower(), pin) for pin in PINS),
        ("PORTA0", "RA0"), ("portb[7]", "RB7"), ("PORT_A1", None), ("R_B1", None), ("RA_3", "RA3"),
        ("x-RB2-y", "RB2"),
        ("RA5_RA1", "RA1"), ("RA7", None), ("RB8", None), ("ARB0", None), ("1RB0", None), ("RB0x", None),
        ("RB10", None), ("_RB0", "RB0"), ("RC0", None), ("RA", None),
    ],
)  # fmt: skip
def test_a_pin_is_found_in_the_name_of_a_wire(name: str, pin: str | None) -> None:
    assert pin_in(name) == (None if pin is None else PINS.index(pin))


# -- blocks --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 2, 3, 7, 64])
def test_lines_are_the_same_in_blocks_of_any_size(
    tmp_path: Path, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lines, "BLOCK_BYTES", size)
    path = tmp_path / "a.txt"
    for text in (b"", b"a", b"a\n", b"ab\r\ncd\n\nef", b"\n\n", b"one\ntwo\nthree\r\n", b"x\ry\n", b"end\r"):
        path.write_bytes(text)
        blocks = list(line_blocks(path))
        whole = b"".join(block for _, block in blocks)
        plain = text.replace(b"\r\n", b"\n").removesuffix(b"\r")
        assert whole == (plain if plain.endswith(b"\n") or not plain else plain + b"\n")
        number = 1
        for line, block in blocks:
            assert line == number
            assert block.endswith(b"\n")
            number += block.count(b"\n")
    path.write_bytes(b"skipped\nrest\n")
    assert next(line_blocks(path, 8, 2))[0] == 2
    assert b"".join(block for _, block in line_blocks(path, 8, 2)) == b"rest\n"


@pytest.mark.parametrize("suffix", [".csv", ".jsonl", ".vcd"])
@pytest.mark.parametrize("size", [40, 97])
def test_edges_are_the_same_in_blocks_of_any_size(
    tmp_path: Path, suffix: str, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = random.Random(size)
    cycles = np.cumsum([rng.choice((0, 1, 9, 90, 12_345)) for _ in range(200)])
    edges = [(int(c), rng.randrange(13), rng.randrange(2)) for c in cycles]
    trace = EdgeTrace(MHZ4, (edge_chunk(*zip(*edges, strict=True)),), Cycles(int(cycles[-1]) + 1))
    monkeypatch.setattr(rows, "BLOCK", 16)
    write_edges(trace, tmp_path / f"small{suffix}")
    monkeypatch.undo()
    write_edges(trace, tmp_path / f"large{suffix}")
    assert (tmp_path / f"small{suffix}").read_bytes() == (tmp_path / f"large{suffix}").read_bytes()
    wanted = rows_of(read_edges(tmp_path / f"large{suffix}", MHZ4))
    monkeypatch.setattr(lines, "BLOCK_BYTES", size)
    monkeypatch.setattr(lines, "TAIL_BYTES", 16)
    monkeypatch.setattr(vcd, "TAIL_BYTES", 16)
    read = read_edges(tmp_path / f"large{suffix}", MHZ4)
    assert sum(1 for _ in read.chunks) > 5
    assert rows_of(read) == wanted
    assert read.end == (trace.end if suffix == ".vcd" else wanted[-1][0] + 1)
    text = (tmp_path / f"large{suffix}").read_text()
    (tmp_path / f"bad{suffix}").write_text(text + "?wrong\n")
    with pytest.raises(InputError) as caught:
        rows_of(read_edges(tmp_path / f"bad{suffix}", MHZ4, end=10**9))
    place = caught.value.location
    assert place is not None and place.line == text.count("\n") + 1


@pytest.mark.parametrize("size", [1, 5, 8, 100])
def test_samples_are_the_same_in_blocks_of_any_size(
    tmp_path: Path, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = random.Random(size)
    samples = [rng.choice((0, 1, 0x102, 0x103)) for _ in range(60)]
    data = b"".join(sample.to_bytes(3, "little") for sample in samples)
    with zipfile.ZipFile(tmp_path / "a.sr", "w") as archive:
        archive.writestr(
            "metadata", "[device 1]\nsamplerate=1 MHz\nunitsize=3\nprobe1=RB0\nprobe2=x\nprobe9=RA1\n"
        )
        for number, cut in enumerate(range(0, len(data), 51), 1):
            archive.writestr(f"logic-1-{number}", data[cut : cut + 51])
    monkeypatch.setattr(sigrok, "BLOCK_SAMPLES", size)
    capture = read_capture(tmp_path / "a.sr")
    expected: list[Row] = []
    before: dict[int, int] = {}
    for at, sample in enumerate(samples):
        for pin, bit in sorted(((PINS.index("RB0"), 0), (PINS.index("RA1"), 8))):
            level = sample >> bit & 1
            if before.get(pin) != level:
                expected.append((at, pin, level))
            before[pin] = level
    assert sorted(rows_of(capture.trace)) == sorted(expected)
    assert capture.trace.end == 60


def test_the_longest_line_that_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (lines,):
        monkeypatch.setattr(module, "MAX_LINE_BYTES", 64)
        monkeypatch.setattr(module, "BLOCK_BYTES", 16)
        monkeypatch.setattr(module, "TAIL_BYTES", 8)
    path = tmp_path / "a.txt"
    path.write_bytes(b"ab\n" + b"x" * 64)
    assert [block for _, block in line_blocks(path)] == [b"ab\n", b"x" * 64 + b"\n"]
    assert first_lines(path, 3) == [b"ab\n", b"x" * 64, b""]
    assert last_line(path) == b"x" * 64
    path.write_bytes(b"ab\n" + b"x" * 65)
    for read in (lambda: list(line_blocks(path)), lambda: first_lines(path, 2)):
        with pytest.raises(InputError) as caught:
            read()
        assert caught.value.message == "the line is longer than 64 bytes"
        assert caught.value.location == Location(str(path), 2)
    path.write_bytes(b"ab\n" + b"x" * 2000)
    with pytest.raises(InputError) as caught:
        last_line(path)
    assert caught.value.message == "the last line is longer than 64 bytes"
    for text, last in (
        (b"", b""),
        (b"\n\n", b""),
        (b"one\ntwo\n\n \n", b"two"),
        (b"one", b"one"),
        (b" a b \r\n", b"a b"),
    ):
        path.write_bytes(text)
        assert last_line(path) == last


# -- files of other programs ---------------------------------------------------------------------------------

HEADER = "$timescale 1 us $end\n$var wire 1 ! RB0 $end\n$enddefinitions $end\n"
RB0 = PINS.index("RB0")


def read(tmp_path: Path, body: str, header: str = HEADER) -> EdgeTrace:
    (tmp_path / "a.vcd").write_text(header + body)
    return read_edges(tmp_path / "a.vcd", MHZ4)


@pytest.mark.parametrize(
    ("state", "level"),
    [
        ("0", LOW), ("l", LOW), ("L", LOW), ("1", HIGH), ("h", HIGH), ("H", HIGH), ("z", UNDRIVEN),
        ("Z", UNDRIVEN),
    ],
)  # fmt: skip
def test_each_state_of_a_wire_has_a_level(tmp_path: Path, state: str, level: int) -> None:
    other = HIGH if level != HIGH else LOW
    trace = read(tmp_path, f"#0\n{other}!\n#5\n{state}!\n#6\nb{other} !\n#7\nb{state} !\n#8\n")
    assert rows_of(trace) == [(0, RB0, other), (5, RB0, level), (6, RB0, other), (7, RB0, level)]


@pytest.mark.parametrize("value", ["b10", "b0_1", "r0.1", "s1", "bjunk1", "b"])
def test_the_vector_of_a_wire_is_read_whole(tmp_path: Path, value: str) -> None:
    """Its last character alone would be a level."""
    with pytest.raises(InputError, match="is not a value change of a VCD file"):
        rows_of(read(tmp_path, f"#0\n0!\n#5\n{value} !\n#9\n"))
    assert rows_of(read(tmp_path, "#0\n0!\n#5\nb0001 !\n#9\n")) == [(0, RB0, LOW), (5, RB0, HIGH)]


@pytest.mark.parametrize(
    ("unit", "cycle"),
    [("s", 10**6), ("ms", 10**3), ("us", 1), ("ns", Fraction(1, 10**3)), ("ps", Fraction(1, 10**6))],
)
@pytest.mark.parametrize("magnitude", [1, 10, 100])
def test_times_are_in_the_unit_of_the_timescale(
    tmp_path: Path, unit: str, cycle: Fraction, magnitude: int
) -> None:
    steps = 3_500_000
    trace = read(tmp_path, f"#0\n0!\n#{steps}\n1!\n", HEADER.replace("1 us", f"{magnitude} {unit}"))
    at = int(steps * magnitude * cycle + Fraction(1, 2))
    assert rows_of(trace) == [(0, RB0, LOW), (at, RB0, HIGH)]
    assert trace.end == at + 1


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("#0\n0!\n#5\n1!\n#4\n", "time '#4' is not allowed here"),
        ("#0\n0!\n#5x\n1!\n#6\n", "time '#5x' is not allowed here"),
        ("#0\n0!\n1\n#6\n", "'1' is not a value change of a VCD file"),
        ("#0\n0!\n$dumpall\n1!\n$end\n$what\n#6\n", "'$what' is not a value change of a VCD file"),
        ("#0\n" + "q" * 50 + "\n#6\n", f"'{'q' * 40}' is not a value change of a VCD file"),
    ],
)
def test_what_is_no_change_of_a_vcd_file(tmp_path: Path, body: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        rows_of(read(tmp_path, body))
    assert caught.value.message == message


def test_times_up_to_18_digits_and_10_to_the_17_cycles_are_read(tmp_path: Path) -> None:
    assert read(tmp_path, f"#0\n1!\n#{10**17}\n").end == 10**17
    with pytest.raises(InputError, match="is too late") as caught:
        read(tmp_path, f"#0\n1!\n#{10**17 + 1}\n")
    assert caught.value.hint == "below 10^17 instruction cycles; a step of this file is 1"
    with pytest.raises(InputError, match="is too late") as caught:
        read(tmp_path, f"#0\n1!\n#{10**18}\n", HEADER.replace("1 us", "1 ps"))
    assert caught.value.hint == "below 10^18 steps"
    assert rows_of(read(tmp_path, "#0\n1!\n#5.0\n0!\n#9\n")) == [(0, RB0, HIGH), (5, RB0, LOW)]


@pytest.mark.parametrize(
    ("row", "fine"),
    [
        ("0,RB0,1", True), ("999999999999999999,RB0,1", True), ("1000000000000000000,RB0,1", False),
        ("00,RB0,1", False), (",RB0,1", False), ("²,RB0,1", False),
        ("7,RA4,1", True), ("7,RA5,1", False), ("7,RB7,1", True), ("7,RB8,1", False), ("7,rB0,1", False),
        ("7;RB0,1", False), ("7,RB0;1", False), ("7,RB0,2", False), ("7,RB0,/", False), ("/,RB0,1", False),
        (":,RB0,1", False), ("7,RB0,1 ", False),
    ],
)  # fmt: skip
def test_a_row_of_csv(tmp_path: Path, row: str, fine: bool) -> None:
    (tmp_path / "a.csv").write_text(f"cycle,pin,level\n{row}\n")
    trace = read_edges(tmp_path / "a.csv", MHZ4)
    if fine:
        cycle, pin, level = row.split(",")
        assert rows_of(trace) == [(int(cycle), PINS.index(pin), int(level))]
        assert trace.end == int(cycle) + 1
    else:
        with pytest.raises(InputError) as caught:
            rows_of(trace)
        assert caught.value.location is not None and caught.value.location.line == 2


def test_rows_of_csv_are_in_order_over_different_lengths(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("cycle,pin,level\n9,RB0,1\n10,RB0,0\n10,RA0,1\n100,RB0,1\n")
    assert rows_of(read_edges(tmp_path / "a.csv", MHZ4)) == [(9, 5, 1), (10, 5, 0), (10, 0, 1), (100, 5, 1)]
    (tmp_path / "a.csv").write_text("cycle,pin,level\n100,RB0,1\n99,RB0,0\n")
    with pytest.raises(InputError, match="cycle 99 comes after cycle 100"):
        rows_of(read_edges(tmp_path / "a.csv", MHZ4))


def test_a_rate_is_given_only_to_a_capture_without_one(tmp_path: Path) -> None:
    """Saleae counts nanoseconds: at 1 MHz a sample is 1000 of them."""
    (tmp_path / "a.csv").write_text("Time [s],RB0\n0,1\n0.5,0\n")
    capture = read_capture(tmp_path / "a.csv")
    assert sampled_at(capture, 1_000_000).sample == 1000
    with capture_writer(tmp_path / "b.vcd", 2_000_000) as writer:
        writer.add(edge_chunk([0, 7], [RB0] * 2, [LOW, HIGH]))
        writer.finish(Cycles(9))
    with pytest.raises(InputError) as caught:
        sampled_at(read_capture(tmp_path / "b.vcd"), 5)
    assert (caught.value.message, caught.value.hint) == (
        "contains its sampling rate, 2e+06 Hz",
        "omit --rate",
    )
    write_edges(EdgeTrace(MHZ4, (edge_chunk([5], [RB0], [HIGH]),), Cycles(10)), tmp_path / "c.vcd")
    edges = read_capture(tmp_path / "c.vcd")
    assert (edges.sample, edges.missing, edges.pieces) == (1.0, None, ())
    assert not is_capture(tmp_path / "c.vcd")
    with pytest.raises(InputError, match="only a capture has a sampling rate"):
        sampled_at(edges, 5)
