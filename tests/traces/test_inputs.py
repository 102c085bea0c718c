"""CSV and VCD hold what is applied to the inputs beside the edges; reading them gives the edges alone."""

from pathlib import Path

import numpy as np
import pytest
from vcd.reader import TokenKind, tokenize

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeTrace, edge_chunk, join
from servogen.errors import InputError
from servogen.traces import Inputs, edge_writer, read_edges, write_edges
from servogen.traces.inputs import INPUT_PINS, InputRows
from servogen.units import Clock, Cycles

MHZ4 = Clock(4_000_000)
RB0, RA4, RB7, MCLR = PINS.index("RB0"), PINS.index("RA4"), PINS.index("RB7"), 13

EDGES = EdgeTrace(MHZ4, (edge_chunk([100, 200, 300], [RB0] * 3, [1, 0, 1]),), Cycles(1000))
INPUTS = Inputs(
    (RA4, RB7, MCLR),
    (
        edge_chunk([0, 0, 150, 200], [RA4, RB7, RA4, RB7], [HIGH, LOW, LOW, LOW]),
        edge_chunk([200, 250, 260, 900], [RA4, RB7, MCLR, RA4], [HIGH, UNDRIVEN, LOW, LOW]),
    ),
)


def test_a_csv_has_a_row_for_each_change_in_order(tmp_path: Path) -> None:
    """A level that is there at power-up is no change, nor is a level that is applied again."""
    write_edges(EDGES, tmp_path / "x.csv", inputs=INPUTS)
    assert (tmp_path / "x.csv").read_text().splitlines() == [
        "cycle,pin,level", "100,RB0,1", "150,RA4,L", "200,RA4,H", "200,RB0,0", "250,RB7,Z", "260,MCLR,L",
        "300,RB0,1", "900,RA4,L",
    ]  # fmt: skip


def test_a_vcd_has_a_wire_for_each_input(tmp_path: Path) -> None:
    write_edges(EDGES, tmp_path / "x.vcd", servos={"RB0": "arm"}, inputs=INPUTS)
    names: dict[str, str] = {}
    seen, now = [], 0
    with (tmp_path / "x.vcd").open("rb") as file:
        for token in tokenize(file):
            if token.kind is TokenKind.VAR:
                names[token.var.id_code] = token.var.reference
            elif token.kind is TokenKind.CHANGE_TIME:
                now = token.time_change
            elif token.kind is TokenKind.CHANGE_SCALAR:
                seen.append((now, names[token.scalar_change.id_code], token.scalar_change.value))
    assert {name for name in names.values() if name.startswith("in")} == {"inRA4", "inRB7", "inMCLR"}
    assert {(0, "inRA4", "1"), (0, "inRB7", "0"), (0, "inMCLR", "z")} <= set(seen)
    assert [change for change in seen if change[0]] == [
        (100, "RB0_arm", "1"), (150, "inRA4", "0"), (200, "inRA4", "1"), (200, "RB0_arm", "0"),
        (250, "inRB7", "z"), (260, "inMCLR", "0"), (300, "RB0_arm", "1"), (900, "inRA4", "0"),
    ]  # fmt: skip
    assert now == 1000


@pytest.mark.parametrize("suffix", [".csv", ".vcd"])
def test_reading_gives_the_edges_of_the_chip_alone(tmp_path: Path, suffix: str) -> None:
    with_inputs, without = tmp_path / f"with{suffix}", tmp_path / f"without{suffix}"
    write_edges(EDGES, with_inputs, inputs=INPUTS)
    write_edges(EDGES, without)
    found, wanted = (join(read_edges(path, MHZ4).driven()) for path in (with_inputs, without))
    assert [column.tolist() for column in found] == [column.tolist() for column in wanted]
    assert len(found.cycle) == 3


@pytest.mark.parametrize("suffix", [".csv", ".vcd", ".jsonl"])
def test_without_inputs_a_file_is_as_it_was(tmp_path: Path, suffix: str) -> None:
    write_edges(EDGES, tmp_path / f"a{suffix}")
    write_edges(EDGES, tmp_path / f"b{suffix}", inputs=Inputs((), ()))
    text = (tmp_path / f"a{suffix}").read_bytes()
    assert text == (tmp_path / f"b{suffix}").read_bytes()
    assert b"inR" not in text


@pytest.mark.parametrize("suffix", [".csv", ".vcd"])
def test_how_the_edges_are_cut_into_chunks_does_not_matter(tmp_path: Path, suffix: str) -> None:
    write_edges(EDGES, tmp_path / f"whole{suffix}", inputs=INPUTS)
    (chunk,) = EDGES.chunks
    for name, cuts in (("one", [1, 2]), ("none", [])):
        with edge_writer(tmp_path / f"{name}{suffix}", MHZ4, inputs=INPUTS) as writer:
            for part in zip(*(np.split(column, cuts) for column in chunk), strict=True):
                writer.add(edge_chunk(*part))
                writer.add(edge_chunk((), (), ()))
            writer.finish(Cycles(1000))
        assert (tmp_path / f"{name}{suffix}").read_bytes() == (tmp_path / f"whole{suffix}").read_bytes()


def test_inputs_of_a_chip_that_does_nothing_are_there(tmp_path: Path) -> None:
    write_edges(EdgeTrace(MHZ4, (), Cycles(200)), tmp_path / "x.csv", tmp_path / "x.vcd", inputs=INPUTS)
    assert (tmp_path / "x.csv").read_text().splitlines()[1:] == ["150,RA4,L"]
    assert "#150" in (tmp_path / "x.vcd").read_text()
    assert "#200" in (tmp_path / "x.vcd").read_text()


def test_an_endless_source_is_read_no_further_than_the_edges() -> None:
    taken = 0

    def endless():  # type: ignore[no-untyped-def]
        nonlocal taken
        while True:
            taken += 1
            yield edge_chunk([10 * taken], [RA4], [taken % 2])

    rows = InputRows(Inputs((RA4,), endless()))
    assert len(rows.until(100)[0]) == 9
    assert taken < 15


@pytest.mark.parametrize("row", ["150,RA4,X", "150,RA5,L", "x,RA4,L", "150,MCLR,1", "150,MCL,H"])
def test_a_row_that_is_no_input_either_is_refused(tmp_path: Path, row: str) -> None:
    path = tmp_path / "x.csv"
    path.write_text(f"cycle,pin,level\n100,RB0,1\n120,RA4,L\n{row}\n200,RB0,0\n")
    with pytest.raises(InputError, match=r"x\.csv:4"):
        list(read_edges(path, MHZ4).chunks)


def test_the_pins_have_the_numbers_of_the_simulator() -> None:
    from servogen.simulator.sources import STIMULUS_PINS

    assert INPUT_PINS == STIMULUS_PINS
