"""docs/testing-firmware.md: its ten examples run, on the bench too, and each fails on a broken program."""

from __future__ import annotations

import re

import pytest

# Here, so that the runs inside this process find them and do not load them each anew.
import servogen.compiler
import servogen.testing.chip
import servogen.testing.seen_chip  # noqa: F401
from tests.bench.conftest import ROOT, running

PAGE = (ROOT / "docs" / "testing-firmware.md").read_text()
PROGRAMS = {
    name: f"// {name}{text}" for name, text in re.findall(r"^```c\n// ([\w.]+)(.*?)^```", PAGE, re.M | re.S)
}
TESTS: dict[str, str] = dict(re.findall(r"^```python\n# (test_[\w.]+)\n(.*?)^```", PAGE, re.M | re.S))
NAMES = [name.removesuffix(".c") for name in PROGRAMS]

BROKEN = {
    "debounce": ("open == 10", "open > 0"),
    "uart": ("byte -= 32", "byte -= 33"),
    "keypad": ("column < 3", "column < 2"),
    "seven_segments": ("0x5B", "0x5A"),
    "eeprom_counter": ("count == 0xFF", "count == 0xFE"),
    "watchdog": ("        CLRWDT();\n", ""),
    "sleep": ("__delay_ms(10)", "__delay_ms(11)"),
    "interrupt": ("250 + 3", "250 + 4"),
    "stepper": ("0x06, 0x0C", "0x0C, 0x06"),
    "pwm": ("duty = 25", "duty = 26"),
}
"""In each program: one bit, one cycle, one constant or one statement."""

ON_THE_BENCH = {"seven_segments": 1, "interrupt": 1, "stepper": 1, "pwm": 2}
"""The tests of each example that can run there."""


def run(project: pytest.Pytester, *options: str) -> pytest.RunResult:
    return project.runpytest_inprocess("-p", "no:xdist", "--strict-markers", "-rfs", *options)


def write(project: pytest.Pytester, programs: dict[str, str], tests: dict[str, str]) -> None:
    for name, text in {**programs, **tests}.items():
        (project.path / name).write_text(text)


def number_of_tests(text: str) -> int:
    values = [str(found).count(",") for found in re.findall(r"parametrize\(\"\w+\", \[(.*?)\]", text)]
    return len(re.findall("^def test_", text, re.M)) + sum(values)


def test_there_are_ten_examples() -> None:
    assert len(NAMES) == 10 and set(NAMES) == set(BROKEN)
    assert set(TESTS) == {f"test_{name}.py" for name in NAMES}


def test_all_examples_pass_on_the_simulated_chip(pytester: pytest.Pytester) -> None:
    write(pytester, PROGRAMS, TESTS)
    run(pytester).assert_outcomes(passed=sum(number_of_tests(text) for text in TESTS.values()))


def test_each_example_fails_on_a_broken_program(pytester: pytest.Pytester) -> None:
    """The first page of a failure is the one that the page shows."""
    for name, (right, _) in BROKEN.items():
        assert PROGRAMS[f"{name}.c"].count(right) == 1, name
    broken = {f"{name}.c": PROGRAMS[f"{name}.c"].replace(*change) for name, change in BROKEN.items()}
    write(pytester, broken, TESTS)
    result = run(pytester)
    failed = {
        line.split("::")[0].removeprefix("FAILED ") for line in result.outlines if line.startswith("FAILED")
    }
    assert failed == set(TESTS)
    shown = re.search(r"^    -+ servogen waves: debounce.c -+\n(?:    .*\n|\n)+", PAGE, re.M)
    assert shown is not None
    result.stdout.fnmatch_lines([line[4:].replace("[", "[[]") for line in shown[0].rstrip().splitlines()])


def test_the_message_of_a_missed_edge_is_the_pages(pytester: pytest.Pytester) -> None:
    asked = (
        "chip = servogen_machine('debounce.c', inputs={'RB0': 1}); chip.run_until('RB0 rise', within_ms=50)"
    )
    write(pytester, PROGRAMS, {"test_missed.py": f"def test_missed(servogen_machine):\n    {asked}\n"})
    result = run(pytester)
    result.assert_outcomes(failed=1)
    shown = re.search(r"^    AssertionError: RB0 rise: not within(?:.*\n    )+.*\n", PAGE, re.M)
    assert shown is not None
    result.stdout.fnmatch_lines([f"E   *{line.strip()}" for line in shown[0].splitlines()])


def test_those_that_can_run_on_the_bench(pytester: pytest.Pytester) -> None:
    """On `servogen rig`, whose crystal is 180 ppm too fast; then the same tests on what was recorded."""
    write(pytester, PROGRAMS, {f"test_{name}.py": TESTS[f"test_{name}.py"] for name in ON_THE_BENCH})
    wanted = sum(ON_THE_BENCH.values())
    tests = sum(number_of_tests(TESTS[f"test_{name}.py"]) for name in ON_THE_BENCH)
    with running("lab8-exercise", "--crystal-ppm", "180") as bench:
        target = (
            *("--servogen-target=bench", f"--servogen-port={bench.paths['analyser']}"),
            *("--servogen-programmer=picpro", f"--servogen-programmer-port={bench.paths['programmer']}"),
        )
        result = run(pytester, *target, "--servogen-device=PIC16F84", "--servogen-record=seen")
    result.assert_outcomes(passed=wanted, skipped=tests - wanted)
    result.stdout.fnmatch_lines(["*needs the simulated chip: chip.*"])
    run(pytester, "--servogen-replay=seen").assert_outcomes(passed=wanted, skipped=tests - wanted)
