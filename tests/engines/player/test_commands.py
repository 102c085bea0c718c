"""Codes of a walk on command: the table hears what docs/firmware.md says, and noise makes no other way."""

from __future__ import annotations

import re
from itertools import product

import pytest

from servogen.engines.player.commands import CODES, COMMAND_SHIFT, hearing_table, uart_byte
from servogen.prove.commands import Commands
from servogen.pulse.schedule import CommandRule, Input, PulseSchedule, Run, WayRuns
from servogen.units import Clock, Cycles

WAYS = ("forward", "back", "left", "right")
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


def heard_by_the_table(levels: str, names: tuple[str, ...] = WAYS) -> list[str]:
    table = hearing_table(names)
    state, found = 0, []
    for level in levels:
        command, state = divmod(table[2 * state + int(level)], 1 << COMMAND_SHIFT)
        if command:
            found.append(("stop", *names)[command - 1])
    return found


def heard_by_the_specification(levels: str) -> list[str]:
    run = (Run(1, (None,)),)
    ways = tuple(WayRuns(name, CODES[name], run, run, run) for name in WAYS)
    rule = CommandRule(Input("RA4", 1), 3, 5, ways)
    commands = Commands(PulseSchedule(Clock(4_000_000), Cycles(20_000), (), (), run, commands=rule), rule)
    state, found = commands.at_power_up, []
    for level in levels:
        state, way = commands.heard(state, int(level))
        if way is not None:
            found.append(WAYS[way - 1] if way else "stop")
    return found


@pytest.mark.parametrize("way", WAYS)
def test_a_code_after_rest_commands_its_way(way: str) -> None:
    assert heard_by_the_table(f"111{LEVELS[way]}111") == [way]


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


@pytest.mark.parametrize("way", WAYS)
def test_one_wrong_missing_or_doubled_level_makes_no_other_command(way: str) -> None:
    levels = f"1111{LEVELS[way]}1111"
    for at in range(len(levels)):
        wrong = levels[:at] + str(1 - int(levels[at])) + levels[at + 1 :]
        missing = levels[:at] + levels[at + 1 :]
        doubled = levels[: at + 1] + levels[at:]
        for changed in (wrong, missing, doubled):
            assert set(heard_by_the_table(changed)) <= {way}, (changed, at)


def test_a_way_that_the_job_does_not_have_is_not_heard() -> None:
    assert heard_by_the_table(f"111{LEVELS['left']}111", ("forward", "back")) == []
    assert heard_by_the_table(f"111{LEVELS['back']}111", ("forward", "back")) == ["back"]


def test_a_low_line_stops_again_and_again() -> None:
    assert heard_by_the_table("11100000000") == ["stop"] * 4


def test_a_uart_sends_the_code() -> None:
    """8N1: a low start bit, the byte's bits from the lowest on, a high stop bit."""
    for way in (*WAYS, None):
        byte = uart_byte(way)
        sent = "0" + f"{byte:08b}"[::-1] + "1"
        assert set(heard_by_the_table(f"111{sent}11")) == {way or "stop"}
    assert [f"{uart_byte(way):02X}" for way in (*WAYS, None)] == ["EA", "EC", "E3", "FB", "00"]
