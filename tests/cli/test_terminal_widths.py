"""Tables on a terminal of 80, 100 and 120 columns: no word is cut, and what is omitted is said."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import sys
import termios
from collections.abc import Callable
from pathlib import Path

import pytest

from servogen.cli import main
from servogen.cli.show import print_lines, table
from tests.campaigns import sampled

ROOT = Path(__file__).parents[2]
Screen = Callable[..., list[str]]
WIDTHS = (80, 100, 120)


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> Screen:
    """`screen(80, print, "x")`: the lines that a function writes to a terminal of 80 columns."""

    def lines(width: int, work: Callable[..., object], *given: object) -> list[str]:
        master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 50, width, 0, 0))
        monkeypatch.setenv("COLUMNS", str(width))
        with os.fdopen(slave, "w") as terminal, monkeypatch.context() as patched:
            patched.setattr(sys, "stdout", terminal)
            work(*given)
            terminal.flush()
            text = _drained(master)
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text).replace("\r", "").splitlines()

    return lines


def _drained(master: int) -> str:
    """Return what has been written; it fits the terminal's buffer."""
    os.set_blocking(master, False)
    parts = []
    while True:
        try:
            parts.append(os.read(master, 65536))
        except BlockingIOError:
            break
    os.close(master)
    return b"".join(parts).decode()


def command(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> None:
    monkeypatch.setattr(sys, "argv", ["servogen", *map(str, arguments)])
    with pytest.raises(SystemExit):
        main()


COMMANDS = [
    ("check", ROOT / "jobs/lab8-exercise.toml"),
    ("check", ROOT / "jobs/scara-pick.toml"),
    ("plan", ROOT / "jobs/lab9-exercise.toml"),
    ("plan", ROOT / "jobs/omni-square.toml"),
    ("robots",),
    ("robots", "scara"),
    ("robots", "hexapod"),
    ("servos",),
    ("servos", "hitec-hs-311"),
    ("gait", "hexapod"),
    ("statics", "scara", "10", "20", "30", "40", "--force", "0", "0", "-5"),
    ("euler", "10", "20", "30"),
    ("doctor",),
]


@pytest.mark.parametrize("width", sampled(WIDTHS))
@pytest.mark.parametrize("arguments", COMMANDS, ids=lambda given: f"{given[0]}-{Path(given[-1]).stem}")
def test_no_table_is_wider_than_the_terminal(
    screen: Screen, monkeypatch: pytest.MonkeyPatch, width: int, arguments: tuple[object, ...]
) -> None:
    lines = screen(width, command, monkeypatch, *arguments)
    rule = [index for index, line in enumerate(lines) if set(line.strip()) == {"─"}]
    for first in rule:
        end = next((at for at in range(first, len(lines)) if not lines[at].strip()), len(lines))
        for line in lines[first - 1 : end]:
            assert len(line.rstrip()) <= width, line


COLUMNS = ("job", "words", "frames", "the worst edge's error", "verdict")
ROWS = [("hexapod-command", 912, 103, "2.126 µs, 0.765°, 0.964 mm at the foot R3", "proven, checked")]


@pytest.mark.parametrize("width", [30, 40, 60, *WIDTHS, 200])
def test_words_are_whole_and_columns_that_do_not_fit_are_named(screen: Screen, width: int) -> None:
    lines = screen(width, table, "Programs", COLUMNS, ROWS, ("words", "frames"))
    text = " ".join(line.strip() for line in lines)
    omitted = re.findall(r"not shown in \d+ columns: (.*); a wider", text)
    gone = omitted[0].split(", ") if omitted else []
    for index, (column, cell) in enumerate(zip(COLUMNS, ROWS[0], strict=True)):
        shown = all(re.search(rf"(?<!\S){re.escape(word)}(?!\S)", text) for word in str(cell).split())
        assert shown != (column in gone), (column, index)
    assert "job" not in gone
    assert bool(gone) == (width < 97), "the least columns go before a cell is wrapped"


@pytest.mark.parametrize("words", ["verify", "prove"])
def test_a_contracts_verdict_fits_the_terminal_and_loses_no_word(
    screen: Screen, monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    """Longer lines go on further inside, between words; a command to copy stays on one line."""
    text = [
        "not decided: " + "a cause of several events at inputs " * 4,
        "  kept      pulse of RB0: high 1161 to 1676 µs, period 19 900 to 20 100 µs (999 pulses, 3 causes)",
        "  servogen verify a-program.hex --contract a-contract.toml --start ram=0 --seconds 123456 --json",
    ]
    for width in WIDTHS:
        shown = screen(width, print_lines, text)
        assert " ".join(" ".join(shown).split()) == " ".join(" ".join(text).split())
        assert shown[-1] == text[-1]
        assert all(len(line) <= width for line in shown[:-1])
    contract, program = ROOT / "docs/examples/servo-contract.toml", ROOT / "firmware/lab8-exercise/main.hex"
    lines = screen(80, command, monkeypatch, words, program, "--contract", contract)
    assert lines and all(len(line) <= 80 or line.startswith("  servogen ") for line in lines)


def test_columns_go_in_the_order_that_is_given_then_from_the_right(screen: Screen) -> None:
    rows = [("aaaa", "bbbb", "cccc", "dddd")]
    shown = [screen(width, table, "T", tuple("abcd"), rows, ("b",)) for width in (24, 17, 9)]
    named = [" ".join(line.strip() for line in lines) for lines in shown]
    assert [re.findall("columns: (.*);", text) for text in named] == [["b"], ["b, d"], ["b, c, d"]]


def test_the_plan_of_twelve_servos_has_a_line_for_each_in_80_columns(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What no servo has, a step, is no column; and no line of the whole plan is longer than the terminal."""
    lines = screen(80, command, monkeypatch, "plan", ROOT / "jobs/hexapod-tripod.toml")
    servos = lines[: next(index for index, line in enumerate(lines) if line.startswith("Horns"))]
    assert [line.split()[0] for line in servos if "to" in line.split()] == [
        f"{side}{leg}-{joint}" for side in "LR" for leg in (1, 2, 3) for joint in ("turn", "lift")
    ]
    assert not any("step" in line for line in servos)
    assert max(len(line.rstrip()) for line in lines if not line.startswith(str(ROOT))) <= 80
