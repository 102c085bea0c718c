"""Every number that a command prints as JSON has its unit in its name, or is one of those that have none."""

import json
import re
from collections.abc import Iterator

import pytest

from servogen.toml.file import UNITS
from tests.cli.conftest import ROOT, Run

MORE_UNITS = {"n", "ppm", "cycles", "cycle", "frames", "frame", "words", "bytes", "turns_per_s"}
MORE_UNITS |= {"counts_per_s", "m_s", "us_per_deg", "percent", "nm"}
UNIT = re.compile(rf"(?:^|_)(?:{'|'.join(sorted(UNITS | MORE_UNITS, key=len, reverse=True))})$")

WITHOUT = {
    # counts
    *("edges", "pulses", "observed_pulses", "scheduled_pulses", "extra_pulses", "missing_pulses", "joints"),
    *("glitches", "loop_repeats", "deepest_stack", "stack_wraps", "executions", "elements", "rank", "value"),
    *("closed_loops", "passive_joints", "mobility", "manoeuvrability", "levels", "resets", "count", "found"),
    *("different_frames_seen", "lead_in_only_frames_seen", "loop_frames_seen", "ram_high_water", "counters"),
    # ratios and phases
    *("duty", "lifts", "swing_beyond", "coverage", "ratio", "asked", "used", "manipulability"),
    # places: frames, addresses, registers, positions in a file
    *("loop_start", "pc", "w", "status", "registers", "ram", "eeprom", "unexecuted", "line", "column"),
    # directions and matrices, whose rows are numbers; translations in the unit that was typed
    *("rotation", "matrix", "axis", "quaternion", "jacobian", "lost_directions", "configuration_vector"),
    *("change", "delta", "frame", "translation", "point", "base", "tool"),
}

PROGRAM = ROOT / "firmware" / "lab8-exercise" / "main.hex"
COMMANDS = [
    ("check", ROOT / "jobs" / "lab8-exercise.toml"),
    ("plan", ROOT / "jobs" / "scara-pick.toml"),
    ("plan", ROOT / "jobs" / "hexapod-tripod.toml"),
    ("gait", "hexapod"),
    ("robots",),
    ("robots", "scara"),
    ("robots", "hexapod"),
    ("servos",),
    ("fk", "scara", 10, 20, 30, 40),
    ("fk", "hexapod"),
    ("ik", "scara", 300, 100, 50, 0, 0, 0),
    ("jacobian", "scara", 10, 20, 30, 40, "--rates", "10 0 0 0"),
    ("statics", "scara", 10, 20, 30, 40, "--force-n", 0, 0, -5),
    ("transform", "Ry(30) Tx(50)", 1, 2, 3),
    ("orientation", "rpy", 10, 20, 30),
    ("differential", "Trans(10,5,0) Rx(90)", "--translation", 1, 0, 0),
    ("mobility", "scara"),
    ("simulate", PROGRAM, "--cycles", 30_000, "--profile"),
    ("verify", PROGRAM, "--against", PROGRAM.with_name("schedule.json"), "--seconds", 1),
    ("measure", PROGRAM, "--seconds", 3),
    ("prove", PROGRAM),
]


def has_unit(name: str) -> bool:
    return name in WITHOUT or UNIT.search(name) is not None


def unnamed(value: object, names: tuple[str, ...] = ()) -> Iterator[str]:
    """The paths of the numbers whose unit no name above them has."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from unnamed(inner, (*names, name))
    elif isinstance(value, list):
        for inner in value:
            yield from unnamed(inner, names)
    elif isinstance(value, int | float) and not isinstance(value, bool) and not any(map(has_unit, names)):
        yield ".".join(names)


@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: f"{words[0]} {words[-1]}")
def test_every_number_has_its_unit_in_its_name(run: Run, words: tuple[object, ...]) -> None:
    assert set(unnamed(json.loads(run(*words, "--json").out))) == set()


def test_a_number_without_a_unit_is_seen() -> None:
    value = {"minimum": 0.5, "speed_deg_s": 3, "feet_m": {"L1": [1.0, 2.0]}, "right": True, "name": "a"}
    assert list(unnamed(value)) == ["minimum"]
