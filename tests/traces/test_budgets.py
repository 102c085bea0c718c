"""Edge files and captures of any size are read or refused in bounded memory, with a message."""

import tracemalloc
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from servogen.edges import join
from servogen.errors import InputError
from servogen.traces import read_edges
from servogen.traces import sigrok as sr
from servogen.traces.captures import is_capture, read_capture
from servogen.traces.lines import MAX_LINE_BYTES
from servogen.traces.vcd import MAX_HEADER_BYTES
from servogen.units import Clock

METADATA = "[device 1]\nsamplerate=1 MHz\nprobe1=RB0\nunitsize=1\n"
HEADER = b"$timescale 1 us $end\n$var wire 1 ! RB0 $end\n$enddefinitions $end\n"


@contextmanager
def memory_below(size: int) -> Iterator[None]:
    """Fails when the block holds more bytes than `size` at any moment."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < size
    finally:
        tracemalloc.stop()


def session(path: Path, packing: int = zipfile.ZIP_DEFLATED, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", packing) as archive:
        for name, data in members.items():
            archive.writestr(name.replace("_", "-"), data)
    return path


def test_metadata_that_unpack_to_a_lot_are_not_unpacked(tmp_path: Path) -> None:
    path = session(tmp_path / "a.sr", metadata=METADATA.encode() + b" " * (64 << 20), logic_1=b"\0\1")
    assert path.stat().st_size < 1 << 20
    with memory_below(8 << 20), pytest.raises(InputError, match="has more than 64 KiB of metadata"):
        read_capture(path)


def test_samples_that_unpack_to_more_than_is_read_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = session(tmp_path / "a.sr", metadata=METADATA.encode(), logic_1_1=bytes(600), logic_1_2=bytes(600))
    assert read_capture(path).trace.end == 1200
    monkeypatch.setattr(sr, "MAX_SAMPLE_BYTES", 1199)
    with pytest.raises(InputError, match=r"unpacks to 1\.17 KiB of samples, more than 1\.17 KiB"):
        read_capture(path)


def test_samples_are_unpacked_piece_by_piece(tmp_path: Path) -> None:
    path = session(tmp_path / "a.sr", metadata=METADATA.encode(), logic_1=bytes(64 << 20))
    with memory_below(60 << 20):
        assert len(join(read_capture(path).trace.chunks).cycle) == 1


def test_an_archive_of_too_many_files_is_refused(tmp_path: Path) -> None:
    names = {f"f{number}": b"" for number in range(sr.MAX_MEMBERS)}
    with pytest.raises(InputError, match="too many or too large files"):
        read_capture(session(tmp_path / "a.sr", metadata=METADATA.encode(), logic_1=b"\0", **names))


def test_a_packing_that_reserves_memory_of_its_own_is_refused(tmp_path: Path) -> None:
    path = session(tmp_path / "a.sr", zipfile.ZIP_LZMA, metadata=METADATA.encode(), logic_1=b"\0\1")
    with pytest.raises(InputError, match="packs 'logic-1' in a way that sigrok does not use"):
        read_capture(path)


@pytest.mark.parametrize("unit", ["²", "9" * 5000, "0", "-1", "1e0"])
def test_a_unit_size_of_any_text_is_refused(tmp_path: Path, unit: str) -> None:
    metadata = METADATA.replace("unitsize=1", f"unitsize={unit}").encode()
    with pytest.raises(InputError, match=r"is not allowed.*\n  1 to 8 bytes"):
        read_capture(session(tmp_path / "a.sr", metadata=metadata, logic_1=b"\0\1"))


def test_a_sampling_rate_of_5000_digits_is_not_a_rate(tmp_path: Path) -> None:
    metadata = METADATA.replace("samplerate=1 MHz", f"samplerate={'x' * 9}{'9' * 5000}.5 kkHz").encode()
    with pytest.raises(InputError, match=f"sampling rate '{'x' * 9}{'9' * 31}' is not understood"):
        read_capture(session(tmp_path / "a.sr", metadata=metadata, logic_1=b"\0\1"))


@pytest.mark.parametrize("name", ["a.csv", "a.jsonl", "a.vcd"])
def test_a_file_without_line_ends_is_not_held_in_memory(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with path.open("wb") as file:
        file.write(HEADER + b"#0\n0!\n" if name == "a.vcd" else b"cycle,pin,level\n")
        for _ in range(32):
            file.write(b" " * (1 << 20))
    with memory_below(40 << 20), pytest.raises(InputError, match=r"longer than 1 MiB|no time stamp"):
        join(read_edges(path, Clock(4_000_000)).chunks)


def test_a_vcd_file_that_ends_with_its_declarations_is_not_whole(tmp_path: Path) -> None:
    """It is short: that nothing was found in its last part is not what is wrong."""
    (tmp_path / "a.vcd").write_bytes(HEADER)
    with pytest.raises(InputError, match="not a whole VCD file: no time stamp follows the declarations"):
        join(read_edges(tmp_path / "a.vcd", Clock(4_000_000)).chunks)


def test_the_first_line_of_a_capture_is_bounded(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(b"T" * (MAX_LINE_BYTES + 2))
    for read in (is_capture, read_capture):
        with pytest.raises(InputError, match=r"a\.csv:1: error: the line is longer than 1 MiB"):
            read(tmp_path / "a.csv")


def test_declarations_without_end_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.vcd"
    path.write_bytes(
        b"$timescale 1 us $end\n" + b"$comment x $end\n" * (MAX_HEADER_BYTES // 16 + 10) + HEADER
    )
    with pytest.raises(InputError, match="no \\$enddefinitions in its first 4 MiB"):
        read_edges(path, Clock(4_000_000))


@pytest.mark.parametrize("time", ["1e999999999", "1e-999999999", "9" * 5000, "nan", "1/3", "1_0"])
@pytest.mark.parametrize("row", [0, 1])
def test_a_time_of_any_text_is_refused_at_once(tmp_path: Path, time: str, row: int) -> None:
    times = ["0.0", "0.5"]
    times[row] = time
    (tmp_path / "a.csv").write_text(f"Time [s],RB0\n{times[0]},0\n{times[1]},1\n")
    with pytest.raises(InputError, match="is not a number of seconds"):
        read_capture(tmp_path / "a.csv")


@pytest.mark.parametrize("line", ["[" * 100_000, '{"cycle":' + "9" * 5000 + ',"pin":"RB0","level":1}'])
def test_a_line_of_json_of_any_kind_is_refused(tmp_path: Path, line: str) -> None:
    (tmp_path / "a.jsonl").write_text(f"{line}\n")
    with pytest.raises(InputError, match=r"a\.jsonl:1: error: is not JSON"):
        join(read_edges(tmp_path / "a.jsonl", Clock(4_000_000)).chunks)


@pytest.mark.parametrize("declared", ["$var wire {digits} ! RB0 $end", "$var wire 1 ! RB0 [{digits}] $end"])
def test_a_declaration_with_5000_digits_is_refused(tmp_path: Path, declared: str) -> None:
    path = tmp_path / "a.vcd"
    path.write_text(
        f"$timescale 1 us $end\n{declared.format(digits='9' * 5000)}\n$enddefinitions $end\n#0\n0!\n"
    )
    with pytest.raises(InputError, match="a number in its declarations is too long"):
        read_edges(path, Clock(4_000_000))


def test_a_time_step_of_0_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.vcd"
    path.write_bytes(HEADER.replace(b"1 us", b"0 us") + b"#0\n0!\n#5\n1!\n")
    with pytest.raises(InputError, match="timescale"):
        read_edges(path, Clock(4_000_000))
