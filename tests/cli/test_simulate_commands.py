"""What `simulate` prints and writes of a small program, reckoned by hand."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.cli.stand_ins import stand_in

SOURCE = """
        list p=16f84a, r=dec
        __config 0x3FF1
        clrf    6
        bsf     3, 5
        bcf     6, 0
        bcf     3, 5
        movlw   5
        call    pulse
        nop
stand   goto    stand
pulse   bsf     6, 0
        bcf     6, 0
        btfsc   6, 1
        movlw   9
        return
        end
"""
"""RB0 rises in cycle 7 and falls in cycle 8; from cycle 14 on it stands."""


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    file = Path("a.asm")
    file.write_text(SOURCE)
    return file


def test_simulate_prints_the_end_and_writes_only_what_is_asked_for(run: Run, program: Path) -> None:
    ran = run("simulate", program)
    assert (ran.code, ran.err, list(Path().iterdir())) == (0, "", [program])
    end, registers, _, stack = ran.out.splitlines()
    assert (end, registers) == ("1000000 cycles, 1 s, 2 edges", "PC 0x007  W 0x05  STATUS 0x1C")
    assert stack == "resets: 1 power_on; deepest stack 1 of 8, 0 wraps"
    ran = run("simulate", program, "--trace", "t", "--clock-hz", 8_000_000, "--cycles", 5)
    assert ran.out.startswith("5 cycles, 2.5e-06 s, 0 edges")
    assert len(Path("t").read_text().splitlines()) == 5


def test_the_profile_of_simulate_is_of_the_same_run(run: Run, program: Path) -> None:
    program.write_text(SOURCE.replace("nop", "movf 0x20, f"))
    out = run("simulate", program, "--cycles", 200, "--profile").out.splitlines()
    rows = [line.split() for line in out if "reset " in line or "pulse " in line or "a.asm" in line]
    assert rows[:2] == [["reset", "194", "97.00"], ["pulse", "6", "3.00"]]
    assert rows[2:4] == [["a.asm:11", "186", "93.00", "93"], ["a.asm:9", "2", "1.00", "1"]]
    assert out[-3:] == [
        "92.3 % of the program's words were executed",  # 12 of 13
        "deepest stack 1 of 8, 1 byte of RAM written",
        "read before they were written: 0x20",
    ]
    found = json.loads(run("simulate", program, "--cycles", 200, "--profile", "--json").out)
    assert (found["edges"], found["profile"]["cycles"], found["cycles"]) == (2, 200, 200)
    assert "profile" not in json.loads(run("simulate", program, "--json").out)


def test_what_the_chip_warns_of_is_said(run: Run, program: Path) -> None:
    program.write_text(SOURCE.replace("nop", "dw 1"))
    shown = run("simulate", program, "--json")
    assert [each["code"] for each in json.loads(shown.out)["diagnostics"]] == ["undefined-word"]
    assert shown.err.splitlines()[0] == "1 warning:"
    assert "undefined-word" in run("simulate", program).err


def test_simulate_tells_how_far_it_is_at_each_edge(
    run: Run, program: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[int] = []

    @contextmanager
    def progress(label: str, total: int) -> Iterator[Callable[[int], None]]:
        yield told.append

    stand_in(monkeypatch, "servogen.cli.show", "progress", progress)
    assert run("simulate", program).code == 0
    assert told == [8]
