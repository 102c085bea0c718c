"""A capture that is several keeps, in its file, where each begins and ends."""

from fractions import Fraction
from pathlib import Path

import pytest

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, edge_chunk, join
from servogen.errors import InputError
from servogen.traces.captures import capture_writer, read_capture
from servogen.units import Cycles

RB0 = PINS.index("RB0")


@pytest.mark.parametrize("rate", [1_000_000, 12_500_000, 3_125_000])
def test_pieces_come_back_in_the_steps_of_the_file(tmp_path: Path, rate: int) -> None:
    with capture_writer(
        tmp_path / "a.vcd", rate, missing="it broke", pieces=((0, 500), (600, 900))
    ) as writer:
        writer.add(edge_chunk([0, 20, 500, 600, 700], [RB0] * 5, [LOW, HIGH, UNDRIVEN, LOW, HIGH]))
        writer.finish(Cycles(900))
    capture = read_capture(tmp_path / "a.vcd")
    steps = capture.trace.clock.cycles_per_second / Fraction(rate)
    assert capture.pieces == tuple((int(a * steps), int(b * steps)) for a, b in ((0, 500), (600, 900)))
    assert capture.trace.end == 900 * steps
    assert capture.missing == "it broke"


def test_a_capture_of_one_piece_has_none(tmp_path: Path) -> None:
    with capture_writer(tmp_path / "a.vcd", 10**6) as writer:
        writer.add(edge_chunk([0, 20], [RB0] * 2, [LOW, HIGH]))
        writer.finish(Cycles(50))
    assert read_capture(tmp_path / "a.vcd").pieces == ()


STITCHED = "several captures, the time between them not known, of samples: "


def stitched(tmp_path: Path, pieces: str, body: str) -> Path:
    """Return a file of samples at 1 MHz that says which of them belong to its captures."""
    path = tmp_path / "a.vcd"
    head = f"$comment captured on all channels at 1000000 Hz; {STITCHED}{pieces} $end\n$timescale 1 us $end\n"
    path.write_text(f"{head}$var wire 1 ! RB0 $end\n$enddefinitions $end\n#0\n0!\n{body}#900\n")
    return path


@pytest.mark.parametrize(
    "pieces", ["0-500 400-900", "0-500 600-901", "500-0 600-900", "0-500 500-500 500-900", "600-900 0-500"]
)
def test_pieces_are_one_after_the_other_within_the_file(tmp_path: Path, pieces: str) -> None:
    """Frames would be counted twice, or seen where nothing is."""
    with pytest.raises(InputError, match=r"a\.vcd: error: capture [123] in it, from .* is not between"):
        read_capture(stitched(tmp_path, pieces, "#500\nz!\n#600\n0!\n"))


@pytest.mark.parametrize(
    ("body", "step"),
    [
        ("#500\nz!\n#550\n1!\n#560\nz!\n#600\n0!\n", 550),
        ("#499\n1!\n#500\n0!\n#600\n1!\n", 500),
        ("#500\nz!\n#599\n0!\n", 599),
    ],
)
def test_between_two_pieces_there_are_no_levels(tmp_path: Path, body: str, step: int) -> None:
    """Otherwise a pulse that is wrong could be left out by what the comment says."""
    capture = read_capture(stitched(tmp_path, "0-500 600-900", body))
    with pytest.raises(InputError, match=rf"a\.vcd: error: RB0 has a level at step {step}, outside"):
        join(capture.trace.chunks)


def test_pieces_may_follow_each_other_without_a_gap(tmp_path: Path) -> None:
    capture = read_capture(stitched(tmp_path, "0-500 500-900", "#499\n1!\n#500\n0!\n"))
    assert capture.pieces == ((0, 500), (500, 900))
    assert join(capture.trace.chunks).cycle.tolist() == [0, 499, 500]


@pytest.mark.parametrize(
    "pieces", ["", "all", "0-", f"0-{'9' * 5000}", "0:500", "0-500 600-9x", "0-500, 600-900", "0-500 600"]
)
def test_pieces_without_their_limits_are_an_error(tmp_path: Path, pieces: str) -> None:
    with pytest.raises(InputError, match=r"a\.vcd: error: does not say which captures are in it"):
        read_capture(stitched(tmp_path, pieces, ""))
