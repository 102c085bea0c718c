"""Channels that are not named after pins: named on the command line, wherever a recording is read."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]
SCHEDULE = Path(__file__).parents[2] / "firmware" / "lab8-exercise" / "schedule.json"
RISES = [103 + 20_000 * frame for frame in range(4)]
WIDTH = 1500


def saleae(folder: Path) -> Path:
    rows = [f"{(at + more) / 1e6:.9f},{level}" for at in RISES for more, level in ((0, 1), (WIDTH, 0))]
    (path := folder / "a.csv").write_text("\n".join(["Time [s],Channel 0", "0.000000000,0", *rows, ""]))
    return path


def session(folder: Path) -> Path:
    level = bytearray(80_000)
    for at in RISES:
        level[at : at + WIDTH] = b"\1" * WIDTH
    with zipfile.ZipFile(path := folder / "a.sr", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("metadata", "[device 1]\nsamplerate=1 M\nunitsize=1\nprobe1=Channel 0\n")
        archive.writestr("logic-1-1", bytes(level))
    return path


def vcd(folder: Path) -> Path:
    head = "$timescale 1 us $end\n$var wire 1 ! D0 $end\n$enddefinitions $end\n#0\n0!\n"
    text = "".join(f"#{at}\n1!\n#{at + WIDTH}\n0!\n" for at in RISES)
    (path := folder / "a.vcd").write_text(f"{head}{text}#80000\n")
    return path


@pytest.fixture
def schedule(tmp_path: Path) -> Path:
    text = json.loads(SCHEDULE.read_text())
    for run in text["loop"]:
        run["pulses"] = [[0, WIDTH]]
    (path := tmp_path / "schedule.json").write_text(json.dumps(text))
    return path


@pytest.mark.parametrize(
    ("write", "channel"),
    [(saleae, "Channel 0"), (session, "Channel 0"), (vcd, "D0")],
    ids=["csv", "sr", "vcd"],
)
def test_a_named_wire_is_read_by_every_command_and_the_hint_names_it(
    run: Run, tmp_path: Path, schedule: Path, write: Callable[[Path], Path], channel: str
) -> None:
    file = write(tmp_path)
    told = run("verify", file, "--against", schedule)
    assert told.code == 2
    assert f"such as --wire '{channel}=RB0'" in told.err
    wire = ("--wire", f"{channel}=RB0")
    told = run("verify", file, "--against", schedule, *wire)
    assert (told.code, told.err) == (0, "")
    assert "RB0: 4 pulses" in run("measure", file, *wire).out
    assert run("plot", file, *wire, "-o", tmp_path / "a.svg").code == 0
    assert run("verify", file, "--against", schedule, "--wire", f"{channel}=RB1").code == 1


def test_wires_that_cannot_be_are_refused(run: Run, tmp_path: Path) -> None:
    file = saleae(tmp_path)
    for wire, words in (
        ("Channel 0=RB9", "does not assign a channel to a pin"),
        ("RB0", "does not assign a channel to a pin"),
        ("Channel 1=RB0", "has no 1-bit wire 'Channel 1'"),
    ):
        told = run("measure", file, "--wire", wire)
        assert told.code == 2
        assert words in told.err
    told = run("measure", file, "--wire", "Channel 0=RB0", "--wire", "Channel 0=RB1")
    assert "'Channel 0' is both RB0 and RB1" in told.err
    (edges := tmp_path / "edges.csv").write_text("cycle,pin,level\n5,RB0,1\n")
    assert "its rows name the pins themselves" in run("measure", edges, "--wire", "D0=RB0").err
    program = SCHEDULE.with_name("main.hex")
    assert "only a recording has wires" in run("measure", program, "--wire", "D0=RB0").err
