"""Examples of docs/testing-firmware.md on a bench: programs on the virtual chip, acted upon by an emulated
Firmata board and seen by a SUMP analyser, both on pseudo-terminals. `python -m tests.testing.page` runs all.
"""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import pytest

# Here, so that the runs inside this process find them and do not load them each anew.
import servogen.compiler
import servogen.testing.chip
import servogen.testing.seen_chip  # noqa: F401
from servogen.bench.inputs.wiring import input_wiring
from servogen.bench.virtual.analyser import VirtualAnalyser
from servogen.bench.virtual.board import BoardOptions, VirtualBoard
from servogen.bench.virtual.chip import VirtualChip
from servogen.programs import clock_of, read_program
from tests.bench.conftest import Serve, serve  # noqa: F401 - a fixture
from tests.testing.page import INPUTS, PROGRAMS, TESTS, write
from tests.testing.test_page import BROKEN, number_of_tests, run

pytest_plugins = ["pytester"]


def bench_of(
    serve: Serve,  # noqa: F811
    program: Path,
    board: BoardOptions = BoardOptions(),  # noqa: B008 - frozen
) -> tuple[str, ...]:
    """A chip with a program, whose crystal is 180 ppm fast, and the options that use its bench."""
    made = read_program(program)
    chip = VirtualChip(made.image, clock_of(made), ppm=Fraction(180))
    wiring = input_wiring(INPUTS)
    paths = serve({"analyser": VirtualAnalyser(chip), "inputs": VirtualBoard(chip, wiring, board)}).paths
    return (
        "--servogen-target=bench",
        f"--servogen-port={paths['analyser']}",
        f"--servogen-inputs={paths['inputs']}",
        *(f"--servogen-input={text}" for text in INPUTS),
    )


@pytest.mark.parametrize("name", ["debounce", "seven_segments"])
def test_an_example_runs_on_the_bench(name: str, pytester: pytest.Pytester, serve: Serve) -> None:  # noqa: F811
    write(pytester.path, PROGRAMS, {f"test_{name}.py": TESTS[f"test_{name}.py"]})
    result = run(pytester, *bench_of(serve, pytester.path / f"{name}.c"))
    result.assert_outcomes(passed=number_of_tests(TESTS[f"test_{name}.py"]))


@pytest.mark.parametrize(("name", "inside"), [("debounce", 0), ("sleep", 1)])
def test_a_broken_program_fails_on_the_bench(
    name: str,
    inside: int,
    pytester: pytest.Pytester,
    serve: Serve,  # noqa: F811
) -> None:
    """Tests that look inside of the chip are skipped there."""
    broken = PROGRAMS[f"{name}.c"].replace(*BROKEN[name])
    write(pytester.path, {f"{name}.c": broken}, {f"test_{name}.py": TESTS[f"test_{name}.py"]})
    result = run(pytester, *bench_of(serve, pytester.path / f"{name}.c"))
    result.assert_outcomes(failed=1, skipped=inside)


@pytest.mark.campaign
def test_a_run_on_the_bench_is_replayed(pytester: pytest.Pytester, serve: Serve) -> None:  # noqa: F811
    """Each run of the test is a recording; a chip is needed no more."""
    write(pytester.path, PROGRAMS, {"test_debounce.py": TESTS["test_debounce.py"]})
    options = bench_of(serve, pytester.path / "debounce.c")
    run(pytester, *options, "--servogen-record=seen").assert_outcomes(passed=1)
    assert len(list((pytester.path / "seen").iterdir())) == 3
    run(pytester, "--servogen-replay=seen").assert_outcomes(passed=1)
    (pytester.path / "seen" / "test_debounce-test_one_press_toggles_the_lamp_once-3.vcd").unlink()
    result = run(pytester, "--servogen-replay=seen")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*there are 2 recordings, and the test has more runs*"])


def test_an_input_that_comes_late_is_an_error_not_a_verdict(
    pytester: pytest.Pytester,
    serve: Serve,  # noqa: F811
) -> None:
    write(pytester.path, PROGRAMS, {"test_debounce.py": TESTS["test_debounce.py"]})
    options = bench_of(serve, pytester.path / "debounce.c", BoardOptions(late_ms=5))
    result = run(pytester, *options)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*RB0 did not become 0 at * ms of the run, nor within 3 ms of it*"])


def test_the_stimulus_of_a_capture_is_played(pytester: pytest.Pytester, serve: Serve) -> None:  # noqa: F811
    text = re.sub(r"def .*", "", TESTS["test_sleep.py"].partition("@pytest")[2], flags=re.S)
    test = (
        f"import pytest\n\n@pytest{text}".replace('"sleep.c",', '"sleep.c", seconds=0.2,')
        + "def test_press(servogen_capture):\n"
        + '    assert servogen_capture.rising_us("RB1") == pytest.approx([20_000], abs=3000)\n'
    )
    write(pytester.path, PROGRAMS, {"test_press.py": test})
    run(pytester, *bench_of(serve, pytester.path / "sleep.c")).assert_outcomes(passed=1)
