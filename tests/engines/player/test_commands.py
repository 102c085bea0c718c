"""Codes of a walk on command: the table hears what docs/firmware.md says; noise makes no other direction."""

from __future__ import annotations

import pickle
import re
from itertools import product

import pytest

from servogen.engines.inputs.commands import CODES, COMMAND_SHIFT, CommandLine, hearing_table, uart_byte
from servogen.prove.commands import SerialCodes
from servogen.pulse.schedule import CodeLine, Input

DIRECTIONS = ("forward", "back", "left", "right")
LEVELS = {"forward": "001010", "back": "000110", "left": "011000", "right": "011011"}
"""The start and five levels: typed from the diagram of docs/firmware.md."""


def spoken(levels: str) -> list[str]:
    """Return the commands in a history of levels that begins with one low level, by searching all of it.

    A stop is five low levels; a code follows three high ones, and nothing that began before it is a code.
    """
    history = "0" + levels
    found = []
    at = 0
    while at < len(history):
        code = next(
            (
                name
                for name, each in LEVELS.items()
                if history[:at].endswith("111") and history.startswith(each, at)
            ),
            None,
        )
        if code is not None:
            found.append((at + 5, code))
            at += 6
            continue
        at += 1
    found += [(match.start() + 4, "stop") for match in re.finditer("(?=00000)", history)]
    return [name for _, name in sorted(found)]


def heard_by_the_table(levels: str, names: tuple[str, ...] = DIRECTIONS) -> list[str]:
    table = hearing_table(names)
    state, found = 0, []
    for level in levels:
        command, state = divmod(table[2 * state + int(level)], 1 << COMMAND_SHIFT)
        if command:
            found.append(("stop", *names)[command - 1])
    return found


def heard_by_the_specification(levels: str) -> list[str]:
    line = SerialCodes(CodeLine(Input("RA4", 1), 3, 5), tuple(CODES[name] for name in DIRECTIONS))
    state, found = line.at_power_up, []
    for level in levels:
        state, direction = line.heard(state, int(level))
        if direction is not None:
            found.append(DIRECTIONS[direction - 1] if direction else "stop")
    return found


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_code_after_rest_commands_its_direction(direction: str) -> None:
    assert heard_by_the_table(f"111{LEVELS[direction]}111") == [direction]


def test_the_table_hears_in_every_sequence_of_levels_what_the_rules_say() -> None:
    for levels in map("".join, product("01", repeat=13)):
        assert heard_by_the_table(levels) == spoken(levels), levels


def test_the_specification_hears_the_same() -> None:
    for levels in map("".join, product("01", repeat=11)):
        assert heard_by_the_specification(levels) == spoken(levels), levels


def test_two_codes_need_three_high_levels_between_them() -> None:
    left = LEVELS["left"]
    assert heard_by_the_table(f"111{LEVELS['back']}11{left}111") == ["back"]
    assert heard_by_the_table(f"111{LEVELS['back']}111{left}111") == ["back", "left"]


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_one_wrong_missing_or_doubled_level_makes_no_other_command(direction: str) -> None:
    levels = f"1111{LEVELS[direction]}1111"
    for at in range(len(levels)):
        wrong = levels[:at] + str(1 - int(levels[at])) + levels[at + 1 :]
        missing = levels[:at] + levels[at + 1 :]
        doubled = levels[: at + 1] + levels[at:]
        for changed in (wrong, missing, doubled):
            assert set(heard_by_the_table(changed)) <= {direction}, (changed, at)


def test_a_direction_that_the_job_does_not_have_is_not_heard() -> None:
    assert heard_by_the_table(f"111{LEVELS['left']}111", ("forward", "back")) == []
    assert heard_by_the_table(f"111{LEVELS['back']}111", ("forward", "back")) == ["back"]


def test_a_low_line_stops_again_and_again() -> None:
    assert heard_by_the_table("11100000000") == ["stop"] * 4


def test_a_uart_sends_the_code() -> None:
    """8N1: a low start bit, the byte's bits from the lowest on, a high stop bit."""
    for direction in (*DIRECTIONS, None):
        byte = uart_byte(direction)
        sent = "0" + f"{byte:08b}"[::-1] + "1"
        assert set(heard_by_the_table(f"111{sent}11")) == {direction or "stop"}
    assert [f"{uart_byte(direction):02X}" for direction in (*DIRECTIONS, None)] == [
        "EA",
        "EC",
        "E3",
        "FB",
        "00",
    ]


def test_a_line_passes_between_processes_as_a_build_of_demo_does() -> None:
    assert pickle.loads(pickle.dumps(CommandLine("RB0"))) == CommandLine("RB0")
