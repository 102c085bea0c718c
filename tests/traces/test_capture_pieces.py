"""A capture that is several keeps, in its file, where each begins and ends."""

from fractions import Fraction
from pathlib import Path

import pytest

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, edge_chunk
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
