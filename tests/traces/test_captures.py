"""Captures saved by other programs are read in their own time steps."""

import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from servogen.edges import HIGH, LOW, PINS, EdgeTrace, edge_chunk, join
from servogen.errors import InputError, Location
from servogen.traces import lines, sigrok, write_edges
from servogen.traces.captures import Capture, capture_writer, is_capture, read_capture
from servogen.units import Clock, Cycles

RA4, RB0, RB1 = PINS.index("RA4"), PINS.index("RB0"), PINS.index("RB1")
METADATA = """\
[global]
sigrok version=0.5.2

[device 1]
capturefile=logic-1
total probes=10
samplerate=1.5 MHz
total analog=1
probe1=RB0_arm
probe2=D1
probe10=RB1
analog11=A0
unitsize=2
"""


def rows_of(capture: Capture) -> list[tuple[int, int, int]]:
    return list(zip(*(column.tolist() for column in join(capture.trace.chunks)), strict=True))


def session(path: Path, members: dict[str, bytes], metadata: str = METADATA) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("version", "2")
        archive.writestr("metadata", metadata)
        for name, data in members.items():
            archive.writestr(name, data)
    return path


def samples(*runs: tuple[int, int]) -> bytes:
    """`count` samples of two bytes for each (value, count)."""
    return b"".join(value.to_bytes(2, "little") * count for value, count in runs)


def test_a_sigrok_session_is_read_sample_by_sample_over_its_parts(tmp_path: Path) -> None:
    first, second = samples((0x200, 7), (0x201, 5)), samples((0x201, 3), (0x002, 4), (0x003, 1))
    capture = read_capture(session(tmp_path / "a.sr", {"logic-1-2": second, "logic-1-1": first}))
    assert rows_of(capture) == [
        (0, RB0, LOW), (0, RB1, HIGH), (7, RB0, HIGH), (15, RB0, LOW), (15, RB1, LOW), (19, RB0, HIGH),
    ]  # fmt: skip
    assert (capture.trace.end, capture.trace.clock.hz, capture.sample) == (20, 6_000_000, 1)
    assert rows_of(capture) == rows_of(capture)


@pytest.mark.parametrize("parts", [(7, 9), (8, 7), (1,)])
def test_a_session_with_a_part_of_a_sample_is_damaged(tmp_path: Path, parts: tuple[int, ...]) -> None:
    """All later samples would have their bytes, and so their probes, exchanged."""
    members = {f"logic-1-{number}": bytes(size) for number, size in enumerate(parts, 1)}
    cut = next(name for name, data in members.items() if len(data) % 2)
    with pytest.raises(InputError, match=f"is damaged: '{cut}' ends within a sample"):
        read_capture(session(tmp_path / "a.sr", members))


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ((1, 3), "'logic-1-2' is missing before 'logic-1-3'"),
        ((2,), "'logic-1-1' is missing before 'logic-1-2'"),
        ((1, 2, 4, 7), "'logic-1-3' is missing before 'logic-1-4'"),
        (("01", 2), "'logic-1-1' is missing before 'logic-1-2'"),
    ],
)
def test_a_session_without_one_of_its_pieces_is_not_complete(
    tmp_path: Path, numbers: Sequence[int | str], words: str
) -> None:
    """What follows it would be seen too early; only the number of the last piece is not known."""
    members = {f"logic-1-{number}": bytes(6) for number in numbers}
    with pytest.raises(InputError, match=words):
        read_capture(session(tmp_path / "a.sr", members))


def test_a_session_holds_its_samples_in_one_file_or_in_pieces(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds samples both in 'logic-1' and in 'logic-1-1'"):
        read_capture(session(tmp_path / "a.sr", {"logic-1": bytes(6), "logic-1-1": bytes(6)}))


def test_a_session_with_two_files_of_one_name_is_ambiguous(tmp_path: Path) -> None:
    path = session(tmp_path / "a.sr", {"logic-1-1": bytes(6)})
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("logic-1-1", bytes(8))
    with pytest.raises(InputError, match="holds two files 'logic-1-1'"):
        read_capture(path)


def test_a_long_session_has_the_edges_of_its_samples(tmp_path: Path) -> None:
    level = np.repeat(np.arange(3000) % 2, np.random.default_rng(5).integers(1, 1500, 3000)).astype("<u2")
    capture = read_capture(session(tmp_path / "a.sr", {"logic-1": level.tobytes()}))
    edges = [(cycle, level) for cycle, pin, level in rows_of(capture) if pin == RB0]
    at = np.flatnonzero(np.diff(level)) + 1
    assert edges == [(0, 0), *zip(at.tolist(), level[at].tolist(), strict=True)]


@pytest.mark.parametrize(
    ("members", "metadata", "message"),
    [
        ({}, METADATA, "holds no samples"),
        ({"logic-1": b"ab"}, METADATA.replace("samplerate=1.5 MHz\n", ""), "does not contain its samplerate"),
        ({"logic-1": b"ab"}, METADATA.replace("unitsize=2", "unitsize=9"), "unitsize '9' is not allowed"),
        ({"logic-1": b"ab"}, METADATA.replace("unitsize=2", ""), "unitsize 'None' is not allowed"),
        ({"logic-1": b"ab"}, METADATA.replace("[device 1]", "[gadget]"), "no device in its metadata"),
        ({"logic-1": b"ab"}, "samplerate=1", "metadata that cannot be read"),
        ({"logic-1": b"ab"}, METADATA.replace("RB", "D"), "no wire that is named by a pin"),
    ],
)
def test_each_defect_of_a_session_has_its_message(
    tmp_path: Path, members: dict[str, bytes], metadata: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        read_capture(session(tmp_path / "a.sr", members, metadata))


def test_a_file_that_is_no_session_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.sr").write_bytes(b"not a zip")
    with pytest.raises(InputError, match="is not a sigrok session"):
        read_capture(tmp_path / "a.sr")
    with pytest.raises(InputError, match="No such file"):
        read_capture(tmp_path / "none.sr")


SALEAE = (
    "Time [s],RB0,RB1,Channel 2\n-0.000001000,0,1,0\n0.000000500,1,1,0\n0.001500500,0,1,0\n0.0016,0,0,1\n"
)


def test_saleae_csv_is_read_in_nanoseconds_from_its_first_row(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(SALEAE)
    capture = read_capture(tmp_path / "a.csv")
    assert rows_of(capture) == [
        (0, RB0, LOW), (0, RB1, HIGH), (1500, RB0, HIGH), (1_501_500, RB0, LOW), (1_601_000, RB1, LOW),
    ]  # fmt: skip
    assert (capture.trace.end, capture.trace.clock.hz, capture.sample) == (1_601_001, 4 * 10**9, None)


def test_the_older_header_and_other_names_are_read(tmp_path: Path) -> None:
    text = "Time[s], Channel 0, Channel 1\r\n0.000000000000000, 0, X\r\n0.5, 1, 1\r\n"
    (tmp_path / "a.csv").write_bytes(text.encode())
    capture = read_capture(tmp_path / "a.csv", {"Channel 0": "RA4"})
    assert rows_of(capture) == [(0, RA4, LOW), (500_000_000, RA4, HIGH)]


@pytest.mark.parametrize(("row", "line"), [("0,X,0", 2), ("0.5,x,1", 3), ("0.6, X ,1", 4)])
def test_a_channel_of_a_pin_whose_level_is_not_known_is_an_error(tmp_path: Path, row: str, line: int) -> None:
    rows = ["Time [s],RB0,Channel 1", "0,0,0", "0.5,1,X", "0.6,0,0", "0.7,1,1"]
    rows[line - 1] = row
    (tmp_path / "a.csv").write_text("\n".join(rows))
    with pytest.raises(InputError, match=r"the level of RB0 is not known \([xX]\)") as caught:
        rows_of(read_capture(tmp_path / "a.csv"))
    assert caught.value.location == Location(str(tmp_path / "a.csv"), line)


@pytest.mark.parametrize("comment", ["", "$comment #3 first $end\n"])
def test_a_capture_begins_at_its_first_time_stamp(tmp_path: Path, comment: str) -> None:
    """What the pins did before it is not in the file, as in one of a simulator that began to record late."""
    head = "$timescale 1 us $end\n$var wire 1 ! RB0 $end\n$enddefinitions $end\n"
    (tmp_path / "a.vcd").write_text(head + comment + "#500\n$dumpvars 0! $end\n#507\n1!\n#520\n")
    capture = read_capture(tmp_path / "a.vcd")
    assert (rows_of(capture), capture.trace.end) == ([(0, RB0, LOW), (7, RB0, HIGH)], 20)
    (tmp_path / "a.vcd").write_text(head + comment + "$dumpvars 0! $end\n#507\n1!\n#520\n")
    capture = read_capture(tmp_path / "a.vcd")
    assert (rows_of(capture), capture.trace.end) == ([(0, RB0, LOW), (507, RB0, HIGH)], 520)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("cycle,pin,level\n1,RB0,1\n", r"a\.csv:1: error: is not a digital CSV file of Saleae's"),
        ("", r"a\.csv:1: error: is not a digital CSV file"),
        (SALEAE.replace("RB", "D"), r"a\.csv:1: error: has no wire"),
        (SALEAE + "0.0017,0,0\n", r"a\.csv:6: error: '0.0017,0,0' does not have 4 fields"),
        (SALEAE + "0.0017,0,2,0\n", r"a\.csv:6: error: level '2' is not allowed.*\n.*0, 1, X"),
        (SALEAE.replace("0.001500500", "soon"), r"a\.csv:4: error: time 'soon' is not a number"),
        (SALEAE + "0.0001,0,0,0\n", r"a\.csv:6: error: a time is before"),
        ("Time [s],RB0\n", r"a\.csv:2: error: time '' is not a number"),
        (
            "Time [s],RB0\n2026-11-21T08:00:00Z,0\n",
            r"a\.csv:2: error: time '2026-11-21T08:00:00Z' is not a number",
        ),
    ],
)
def test_each_defect_of_a_saleae_file_has_its_place_and_message(
    tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        rows_of(read_capture(tmp_path / "a.csv"))


@pytest.mark.parametrize("size", [9, 1 << 22])
def test_a_row_of_saleae_is_named_by_its_line_in_blocks_of_any_size(
    tmp_path: Path, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever is wrong with it; the first of two such rows is named, unless it is only out of order."""
    monkeypatch.setattr(lines, "BLOCK_BYTES", size)
    good = ["Time [s],RB0,RB1", *(f"{n}.5e-3 , {n % 2},1" for n in range(1, 7))]
    for number in range(1, 7):
        for bad, message in (
            ("0.1,0", "'0.1,0' does not have 3 fields like the header"),
            ("0.1,0,1,1", "'0.1,0,1,1' does not have 3 fields like the header"),
            ("0.1,0,2", "level '2' is not allowed"),
            (",0,1", "time '' is not a number of seconds"),
            ("9e9,0,1", "time '9e9' is not a number of seconds"),
            ("0.1_0,0,1", "time '0.1_0' is not a number of seconds"),
            ("nan,0,1", "time 'nan' is not a number of seconds"),
            ("-9e9,0,1", "time '-9e9' is not a number of seconds"),
            ("0.0014,0,1", "a time is before that of the row above"),
        ):
            if number == 1 and message.startswith("a time"):
                continue
            later = [] if message.startswith("a time") else ["1,0,?"]
            text = [*good[:number], bad, *good[number + 1 :], *later, "2,0,0"]
            if number == 1:  # the time of the first row is where the capture begins
                text.insert(1, good[1])
            (tmp_path / "a.csv").write_text("\n".join(text) + "\n")
            with pytest.raises(InputError) as caught:
                rows_of(read_capture(tmp_path / "a.csv"))
            assert (caught.value.message, caught.value.location) == (
                message, Location(str(tmp_path / "a.csv"), number + 1 + (number == 1)),
            )  # fmt: skip
    (tmp_path / "a.csv").write_text("\n".join(good) + "\n")
    trace = read_capture(tmp_path / "a.csv").trace
    rises = [(10**6 * (n - 1), RB0, n % 2) for n in range(1, 7)]
    assert [row for row in rows_of(read_capture(tmp_path / "a.csv")) if row[1] == RB0] == rises
    assert trace.end == 5 * 10**6 + 1


def test_saleae_times_below_9e9_seconds_are_read(tmp_path: Path) -> None:
    """More nanoseconds do not fit 64 bits: 2^63 of them are 9.22e9 seconds."""
    (tmp_path / "a.csv").write_text("Time [s],RB0\n0,0\n8999999999,1\n")
    trace = read_capture(tmp_path / "a.csv").trace
    assert trace.end == 8_999_999_999 * 10**9 + 1
    for first, last, line in (("0", "9000000000", None), ("-9e9", "0", 2)):
        (tmp_path / "a.csv").write_text(f"Time [s],RB0\n{first},0\n{last},1\n")
        with pytest.raises(InputError, match="is not a number of seconds") as caught:
            read_capture(tmp_path / "a.csv")
        assert caught.value.location == Location(str(tmp_path / "a.csv"), line)


def test_pieces_of_a_session_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    """logic-1-10 comes after logic-1-9, whatever their order in the archive; logic-10 is another."""
    members = {f"logic-1-{n}": samples((n % 2, n)) for n in (10, 1, 9, 2, 11, *range(3, 9))} | {
        "logic-10": b"\1\0", "logic-1-x": b"\1\0", "xlogic-1-3": b"\1\0", "logic-1-0": b"\1\0",
    }  # fmt: skip
    capture = read_capture(session(tmp_path / "a.sr", members))
    rb0 = [(cycle, level) for cycle, pin, level in rows_of(capture) if pin == RB0]
    assert rb0 == [(n * (n - 1) // 2, n % 2) for n in range(1, 12)]
    assert capture.trace.end == 66


def test_probes_beyond_a_sample_are_none(tmp_path: Path) -> None:
    """A sample of two bytes has probes 1 to 16."""
    probes = "probe16=RA0\nprobe17=RA1\nprobe0=RA2\nprobe01=RA3\nprobe100=RA4\n"
    capture = read_capture(session(tmp_path / "a.sr", {"logic-1": samples((1 << 15, 1))}, METADATA + probes))
    assert rows_of(capture) == [(0, 0, HIGH), (0, RB0, LOW), (0, RB1, LOW)]


def test_the_directory_of_a_session_has_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of its files and bytes; a comment behind it has up to 65535 bytes (APPNOTE, section 4.3.16)."""
    path = session(tmp_path / "a.sr", {"logic-1": b"\0\0"})
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = b"x" * 65535
        count = len(archive.infolist())
    content = path.read_bytes()
    end = content.rindex(b"PK\5\6")
    directory = end - content.index(b"PK\1\2")
    for name, limit in (("MAX_MEMBERS", count), ("_MAX_DIRECTORY_BYTES", directory)):
        monkeypatch.setattr(sigrok, name, limit)
        assert read_capture(path).trace.end == 1
        monkeypatch.setattr(sigrok, name, limit - 1)
        with pytest.raises(InputError, match="is an archive of too many or too large files"):
            read_capture(path)
        monkeypatch.undo()
    # In front of the last record, the one that leads to that of an archive of more than 4 GiB: 20 bytes.
    path.write_bytes(content[:end] + b"PK\6\7" + bytes(16) + content[end:])
    with pytest.raises(InputError, match="is an archive of too many or too large files"):
        read_capture(path)
    for cut in (content[: end + 21], content[:end]):
        path.write_bytes(cut)
        with pytest.raises(InputError, match="is not a sigrok session"):
            read_capture(path)


def test_metadata_and_samples_up_to_their_limits_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = METADATA + "#" * ((1 << 16) - len(METADATA))
    assert read_capture(session(tmp_path / "a.sr", {"logic-1": b"\0\0"}, whole)).trace.end == 1
    with pytest.raises(InputError, match="has more than 64 KiB of metadata"):
        read_capture(session(tmp_path / "b.sr", {"logic-1": b"\0\0"}, whole + "#"))
    monkeypatch.setattr(sigrok, "MAX_SAMPLE_BYTES", 2)
    assert read_capture(tmp_path / "a.sr").trace.end == 1


def test_a_vcd_of_sigrok_tells_its_sampling_rate(tmp_path: Path) -> None:
    text = (
        "$comment\n  Acquisition with 1/8 channels at 1.5 MHz\n$end\n$timescale 1 ns $end\n"
        "$scope module libsigrok $end\n$var wire 1 ! RB0 $end\n$upscope $end\n$enddefinitions $end\n"
        "#0 1!\n#667 0!\n#2000 1!\n#4000\n"
    )
    (tmp_path / "a.vcd").write_text(text)
    capture = read_capture(tmp_path / "a.vcd")
    assert rows_of(capture) == [(0, RB0, HIGH), (667, RB0, LOW), (2000, RB0, HIGH)]
    assert (capture.trace.end, capture.trace.clock.hz) == (4000, 4 * 10**9)
    assert capture.sample == pytest.approx(1000 / 1.5)


@pytest.mark.parametrize("rate", ["1,5 MHz", "1.5 MHz or so", "fast"])
def test_a_rate_of_a_vcd_that_is_not_understood_is_refused(tmp_path: Path, rate: str) -> None:
    text = f"$comment\n  Acquisition with 1/8 channels at {rate}\n$end\n$timescale 1 us $end\n"
    (tmp_path / "a.vcd").write_text(f"{text}$var wire 1 ! RB0 $end\n$enddefinitions $end\n#0 0!\n#5\n")
    with pytest.raises(InputError, match=f"sampling rate '{rate}' is not understood"):
        read_capture(tmp_path / "a.vcd")


def test_a_comment_about_something_else_states_no_rate(tmp_path: Path) -> None:
    text = "$comment of all channels at 12 kHz only two were used $end\n$timescale 1 us $end\n"
    (tmp_path / "a.vcd").write_text(f"{text}$var wire 1 ! RB0 $end\n$enddefinitions $end\n#0 0!\n#5\n")
    assert read_capture(tmp_path / "a.vcd").sample is None


def test_a_vcd_of_another_program_does_not(tmp_path: Path) -> None:
    text = "$timescale 10 us $end\n$var wire 1 ! RB0 $end\n$enddefinitions $end\n#0 0!\n#5 1!\n#9\n"
    (tmp_path / "a.vcd").write_text(text)
    capture = read_capture(tmp_path / "a.vcd")
    assert (capture.trace.clock.hz, capture.sample) == (400_000, None)


def test_an_unknown_ending_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'\.bin' is not the suffix of a capture"):
        read_capture(tmp_path / "a.bin")


def test_a_capture_that_is_written_is_read_as_it_was(tmp_path: Path) -> None:
    with capture_writer(tmp_path / "a.vcd", 12_500_000, {"RB0": "arm"}) as writer:
        writer.add(edge_chunk([0, 0, 7, 9], [RB0, RB1, RB0, RB1], [HIGH, LOW, LOW, HIGH]))
        writer.finish(Cycles(1000))
    capture = read_capture(tmp_path / "a.vcd")
    step = capture.sample
    assert step is not None
    assert rows_of(capture) == [(0, RB0, HIGH), (0, RB1, LOW), (7 * step, RB0, LOW), (9 * step, RB1, HIGH)]
    assert capture.trace.end == 1000 * step
    assert capture.trace.clock.cycle_us * round(step) == Clock(50_000_000).cycle_us


def test_captures_are_told_from_edges_in_cycles(tmp_path: Path) -> None:
    trace = EdgeTrace(Clock(4_000_000), (edge_chunk([5], [RB0], [HIGH]),), Cycles(10))
    write_edges(trace, *(tmp_path / f"a{suffix}" for suffix in (".csv", ".jsonl", ".vcd")))
    assert [is_capture(tmp_path / f"a{suffix}") for suffix in (".csv", ".jsonl", ".vcd")] == [False] * 3
    (tmp_path / "b.csv").write_text(SALEAE)
    with capture_writer(tmp_path / "b.vcd", 10**6) as writer:
        writer.finish(Cycles(5))
    (tmp_path / "c.vcd").write_text("$version Other $end\n$enddefinitions $end\n")
    for name in ("b.csv", "b.vcd", "c.vcd", "none.sr"):
        assert is_capture(tmp_path / name)
