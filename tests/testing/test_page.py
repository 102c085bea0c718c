"""docs/testing-firmware.md: its ten examples run, on the bench too, and each fails on a broken program."""

from __future__ import annotations

import re

import pytest

# Here, so that the runs inside this process find them and do not load them each anew.
import servogen.compiler
import servogen.testing.chip
import servogen.testing.seen_chip  # noqa: F401
from tests.testing.page import PAGE, PROGRAMS, TESTS, write

pytest_plugins = ["pytester"]

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
    "pwm": ("DUTY 25", "DUTY 26"),
}
"""In each program: one bit, one cycle, one constant or one statement."""


def run(project: pytest.Pytester, *options: str) -> pytest.RunResult:
    return project.runpytest_inprocess(
        "-p", "no:xdist", "-p", "no:hypothesispytest", "--strict-markers", "-rfs", *options
    )


def number_of_tests(text: str) -> int:
    values = [str(found).count(",") for found in re.findall(r"parametrize\(\"\w+\", \[(.*?)\]", text)]
    return len(re.findall("^def test_", text, re.M)) + sum(values)


def pattern(line: str) -> str:
    """Return what stands for a line of waves or times: cycles differ with the compiler."""
    return re.sub(r"[▁▔▒]+", "*", re.sub(r" *\d+(\.\d+)? [mµ]s", "*", line))


def test_there_are_ten_examples() -> None:
    assert len(NAMES) == 10 and set(NAMES) == set(BROKEN)
    assert set(TESTS) == {f"test_{name}.py" for name in NAMES}


@pytest.mark.campaign
def test_all_examples_pass_on_the_simulated_chip(pytester: pytest.Pytester) -> None:
    """And the test at the top of the page, of a program that blinks RB0."""
    first = re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)[0]
    blink = PROGRAMS["pwm.c"].replace("RB3", "RB0")
    write(pytester.path, PROGRAMS | {"blink.c": blink}, TESTS | {"test_blink.py": first})
    run(pytester).assert_outcomes(passed=1 + sum(number_of_tests(text) for text in TESTS.values()))


def test_each_example_fails_on_a_broken_program(pytester: pytest.Pytester) -> None:
    """The waves and the message of an edge that does not come are those that the page shows."""
    for name, (right, _) in BROKEN.items():
        assert PROGRAMS[f"{name}.c"].count(right) == 1, name
    broken = {f"{name}.c": PROGRAMS[f"{name}.c"].replace(*change) for name, change in BROKEN.items()}
    asked = (
        "chip = servogen_machine('debounce.c', inputs={'RB0': 1}); chip.run_until('RB0 rise', within_ms=50)"
    )
    missed = {"test_missed.py": f"def test_missed(servogen_machine):\n    {asked}\n"}
    write(pytester.path, broken, TESTS | missed)
    result = run(pytester)
    failed = {
        line.split("::")[0].removeprefix("FAILED ") for line in result.outlines if line.startswith("FAILED")
    }
    assert failed == set(TESTS | missed)
    shown = re.search(r"^    -+ servogen waves: debounce.c -+\n(?:    .*\n|\n)+", PAGE, re.M)
    assert shown is not None
    lines = [pattern(line[4:]) for line in shown[0].rstrip().splitlines() if " = 0 " not in line]
    result.stdout.fnmatch_lines(list(dict.fromkeys(lines)))
    shown = re.search(r"^    AssertionError: RB0 rise: not within(?:.*\n    )+.*\n", PAGE, re.M)
    assert shown is not None
    result.stdout.fnmatch_lines([f"E   *{line.strip()}" for line in shown[0].splitlines()])
