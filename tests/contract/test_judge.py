"""Each clause against its plain definition on levels cycle by cycle, and at its limits."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from itertools import pairwise

import pytest

from servogen.contract import ClauseVerdict, ContractVerdict, judge_contract, parse_contract
from servogen.edges import PINS, EdgeTrace, edge_chunk
from servogen.units import Clock, Cycles

CLOCK = Clock(4_000_000)
"""One cycle is a microsecond."""

Changes = Sequence[tuple[int, str, int]]


def judged(text: str, changes: Changes, end: int, from_reset: bool = True) -> ContractVerdict:
    rows = sorted((cycle, PINS.index(pin), level) for cycle, pin, level in changes)
    chunk = edge_chunk(*zip(*rows, strict=True)) if rows else edge_chunk((), (), ())
    trace = EdgeTrace(CLOCK, (chunk,), Cycles(end))
    return judge_contract(parse_contract(text, "c.toml").clauses(CLOCK), trace, from_reset=from_reset)


def only(text: str, changes: Changes, end: int, from_reset: bool = True) -> ClauseVerdict:
    (clause,) = judged(text, changes, end, from_reset).clauses
    return clause


def pulses(pin: str, *spans: tuple[int, int]) -> list[tuple[int, str, int]]:
    return [change for rise, fall in spans for change in ((rise, pin, 1), (fall, pin, 0))]


LIMITS = {
    "pulse too long": (
        '[[pulse]]\npin = "RB3"\nhigh_us = [5, 9]\n',
        lambda late: pulses("RB3", (10, 19 + late)),
        20,
    ),
    "pulse too short": (
        '[[pulse]]\npin = "RB3"\nhigh_us = [5, 9]\n',
        lambda late: pulses("RB3", (10, 15 - late)),
        14,
    ),
    "low too short": (
        '[[pulse]]\npin = "RB3"\nlow_us = [5, 9]\n',
        lambda late: pulses("RB3", (10, 15), (20 - late, 25)),
        19,
    ),
    "low too long": (
        '[[pulse]]\npin = "RB3"\nlow_us = [5, 9]\n',
        lambda late: pulses("RB3", (10, 15), (24 + late, 25 + late)),
        25,
    ),
    "low too long after a long pulse, with another pin's changes in it": (
        '[[pulse]]\npin = "RB3"\nhigh_us = [5]\nlow_us = [5, 9]\n',
        lambda late: [*pulses("RB3", (1, 30), (39 + late, 45)), (33, "RB4", 1), (36, "RB4", 0)],
        40,
    ),
    "period too long": (
        '[[pulse]]\npin = "RB3"\nperiod_us = [20, 30]\n',
        lambda late: pulses("RB3", (10, 15), (40 + late, 45)),
        41,
    ),
    "period too short": (
        '[[pulse]]\npin = "RB3"\nperiod_us = [20, 30]\n',
        lambda late: pulses("RB3", (10, 15), (30 - late, 35)),
        29,
    ),
    "duty too high": (
        '[[pulse]]\npin = "RB3"\nperiod_us = [20, 20]\nduty_percent = [10, 50]\n',
        lambda late: pulses("RB3", (10, 20 + late), (30, 40)),
        30,
    ),
    "duty of a long period": (
        '[[pulse]]\npin = "RB3"\nperiod_us = [5]\nduty_percent = [10, 50]\n',
        lambda late: pulses("RB3", (10, 30 + late), (50, 51)),
        50,
    ),
    "answer too late": (
        '[[response]]\nwhen = "RB0 rises"\nthen = "RB4 falls"\nwithin_us = [2, 7]\n',
        lambda late: [(1, "RB4", 1), (5, "RB0", 1), (12 + late, "RB4", 0)],
        13,
    ),
    "answer too early": (
        '[[response]]\nwhen = "RB0 rises"\nthen = "RB4 falls"\nwithin_us = [2, 7]\n',
        lambda late: [(1, "RB4", 1), (5, "RB0", 1), (7 - late, "RB4", 0)],
        6,
    ),
    "answer to a pattern": (
        '[[response]]\nwhen = ["RB0 rises", "RB1 rises"]\nthen = "RB4 rises"\nwithin_us = [0, 7]\n',
        lambda late: [(3, "RB0", 1), (5, "RB1", 1), (12 + late, "RB4", 1)],
        13,
    ),
    "levels together": (
        '[[never]]\ncondition = "RB1 high and RB2 low"\nlonger_us = 3\n',
        lambda late: [(2, "RB2", 1), (5, "RB1", 1), (6, "RB2", 0), (9 + late, "RB2", 1)],
        9,
    ),
    "too many in a window": (
        '[[count]]\nevent = "RB3 rises"\ntimes = [0, 2]\nwindow_us = 20\n',
        lambda late: pulses("RB3", (10, 11), (15, 16), (30 - late, 31)),
        29,
    ),
    "too few in a window": (
        '[[count]]\nevent = "RB3 rises"\ntimes = [2, 9]\nwindow_us = 20\n',
        lambda late: pulses("RB3", (10, 11), (20, 21), (30 + late, 31 + late), (40, 41)),
        31,
    ),
    "first event": (
        '[[every]]\nevent = "RB3 changes"\nfirst_us = [0, 10]\n',
        lambda late: [(10 + late, "RB3", 1)],
        11,
    ),
    "gap": (
        '[[every]]\nevent = "RB3 changes"\ngap_us = [5, 10]\n',
        lambda late: [(10, "RB3", 1), (20 + late, "RB3", 0)],
        21,
    ),
    "gap too short": (
        '[[every]]\nevent = "RB3 changes"\ngap_us = [5, 10]\n',
        lambda late: [(10, "RB3", 1), (15 - late, "RB3", 0)],
        14,
    ),
}


@pytest.mark.parametrize(("text", "changes", "cycle"), LIMITS.values(), ids=LIMITS)
def test_a_limit_is_kept_and_one_cycle_more_is_not(
    text: str, changes: Callable[[int], Changes], cycle: int
) -> None:
    kept = only(text, changes(0), max(row[0] for row in changes(0)) + 1)
    assert (kept.word, kept.first) == ("kept", None)
    broken = only(text, changes(1), 60)
    assert broken.word == "violated" and broken.first is not None
    assert broken.first.cycle == cycle, broken.first


def test_what_is_never_seen_is_not_kept_and_passes_only_as_partial() -> None:
    verdict = judged('[[pulse]]\npin = "RB3"\nhigh_us = [5, 9]\n', (), 100)
    assert verdict.clauses[0].word == "not seen" and not verdict.complete
    assert not verdict.accepted(partial=False) and verdict.accepted(partial=True)
    assert "not all of it was seen" in next(verdict.lines())


def test_a_run_and_a_recording_begin_with_levels_and_not_with_edges() -> None:
    text = '[[pulse]]\npin = "RB3"\nhigh_us = [5, 9]\n'
    changes = [(0, "RB3", 1), (2, "RB3", 0), *pulses("RB3", (10, 17))]
    for from_reset in (False, True):
        assert only(text, changes, 30, from_reset).word == "kept"
        later = [(cycle + 1, pin, level) for cycle, pin, level in changes]
        assert only(text, later, 31, from_reset).word == "violated"


@pytest.mark.parametrize(("level", "moves"), [(1, "rises"), (0, "falls")])
def test_the_level_of_an_input_at_reset_is_no_event(level: int, moves: str) -> None:
    """A button that is held down while the chip is reset has not been pressed."""
    text = f'[[response]]\nwhen = "RB0 {moves}"\nthen = "RB4 rises"\nwithin_us = [0, 20]\n'
    held = only(text, [(0, "RB0", level)], 60)
    assert (held.seen, held.breaches) == (0, 0)
    moved = only(text, [(0, "RB0", 1 - level), (1, "RB0", level)], 60)
    assert (moved.seen, moved.breaches) == (1, 1)


def test_a_level_at_reset_counts_as_a_level() -> None:
    text = '[[never]]\ncondition = "RB1 high"\nlonger_us = 3\n'
    assert only(text, [(0, "RB1", 1), (3, "RB1", 0)], 9).word == "kept"
    broken = only(text, [(0, "RB1", 1), (4, "RB1", 0)], 9)
    assert broken.first is not None and broken.first.cycle == 3


def test_an_event_may_stand_in_a_turn_twice() -> None:
    text = '[[order]]\nevents = ["RB2 rises", "RB1 rises", "RB0 rises", "RB1 rises"]\n'
    turn = pulses("RB2", (10, 11)) + pulses("RB1", (20, 21), (40, 41)) + pulses("RB0", (30, 31))
    again = [(cycle + 50, pin, level) for cycle, pin, level in turn]
    assert only(text, turn + again, 100).word == "kept"
    assert only(text, turn[2:] + again, 100, from_reset=False).word == "kept"  # from the middle of one on
    broken = only(text, turn + pulses("RB0", (60, 61)), 100)
    assert broken.first is not None and broken.first.cycle == 60
    assert "'RB0 rises' comes where 'RB2 rises' is due" in broken.first.message


def test_order_is_told_where_it_breaks() -> None:
    text = '[[order]]\nevents = ["RB1 rises", "RB2 rises", "RB3 rises"]\n'
    turn = [*pulses("RB1", (5, 6)), *pulses("RB2", (7, 8)), *pulses("RB3", (9, 10))]
    assert only(text, [*turn, (20, "RB1", 1)], 30).word == "kept"
    broken = only(text, [*turn, (20, "RB2", 1)], 30)
    assert broken.first is not None and broken.first.cycle == 20
    assert "'RB2 rises' comes where 'RB1 rises' is due" in broken.first.message


def test_changes_in_one_cycle_happen_at_once() -> None:
    """A write of a port changes several pins: between them there is no moment."""
    text = '[[never]]\ncondition = "RB1 high and RB2 high"\n'
    handed_over = [(5, "RB1", 1), (9, "RB1", 0), (9, "RB2", 1), (12, "RB2", 0)]
    assert only(text, handed_over, 20).word == "kept"
    assert only(text, [*handed_over[:1], (10, "RB1", 0), *handed_over[2:]], 20).word == "violated"


def byte_changes(pin: str, byte: int, begin: int, bit: float, stop: int = 1) -> list[tuple[int, str, int]]:
    levels = [0, *(byte >> n & 1 for n in range(8)), 1]
    rows, now = [], 1
    for number, level in enumerate(levels):
        if level != now:
            rows.append((begin + round(number * bit), pin, level))
            now = level
    return rows


@pytest.mark.parametrize("percent", [-2.5, -1.5, 0.0, 1.5, 2.5])
def test_a_serial_line_within_two_percent(percent: float) -> None:
    """Edges lie at whole bits from the start bit, whatever is sent; 1.5 % off is kept, 2.5 % is not."""
    text = '[[serial]]\npin = "RB5"\nbaud = 2400\ntolerance_percent = 2\n'
    bit = 1e6 / 2400 * (1 + percent / 100)
    changes = [(1, "RB5", 1)]
    for number, byte in enumerate(b"servogen"):
        changes += byte_changes("RB5", byte, 100 + number * 5000, bit)
    verdict = only(text, changes, 45_000)
    assert verdict.word == ("kept" if abs(percent) < 2 else "violated")
    assert verdict.breaches or verdict.seen == len(b"servogen")


def test_a_missing_stop_bit_and_a_moved_edge_break_a_serial_line() -> None:
    text = '[[serial]]\npin = "RB5"\nbaud = 10_000\n'
    sent = [(1, "RB5", 1), *byte_changes("RB5", 0x55, 100, 100)]
    assert only(text, sent, 2000).word == "kept"
    without_stop = [*sent[:-1], (1200, "RB5", 1)]
    broken = only(text, without_stop, 2000)
    assert broken.first is not None and "stop bit" in broken.first.message
    moved = [*sent[:3], (sent[3][0] + 20, *sent[3][1:]), *sent[4:]]
    broken = only(text, moved, 2000)
    assert broken.first is not None and "20 cycles late of 2 bits" in broken.first.message


def levels_of(changes: Changes, pin: str, end: int) -> list[int]:
    """The level in each cycle."""
    levels, now = [], 0
    at = {cycle: level for cycle, name, level in changes if name == pin}
    for cycle in range(end):
        now = at.get(cycle, now)
        levels.append(now)
    return levels


def rises(levels: list[int]) -> list[int]:
    return [n for n in range(1, len(levels)) if levels[n] and not levels[n - 1]]


def kept_by_definition(kind: str, b1: list[int], b2: list[int], least: int, most: int, end: int) -> bool:
    up1, up2 = rises(b1), rises(b2)
    if kind == "high":
        widths, open_width = [], 0
        for begin in up1:
            length = next((n for n in range(begin, end) if not b1[n]), end) - begin
            if begin + length < end:
                widths.append(length)
            else:
                open_width = length
        return all(least <= width <= most for width in widths) and open_width <= most
    if kind == "never":
        longest = run = 0
        for one, two in zip(b1, b2, strict=True):
            run = run + 1 if one and two else 0
            longest = max(longest, run)
        return longest <= most
    if kind == "count":
        return all(sum(begin <= rise < begin + 20 for rise in up1) <= most for begin in range(end))
    if kind == "gap":
        gaps = [after - before for before, after in pairwise(up1)]
        return all(least <= gap <= most for gap in gaps) and (not up1 or end - up1[-1] <= most)
    waiting: int | None = None
    for cycle in range(end):
        if waiting is not None and cycle - waiting > most:
            return False
        answered = cycle in up2
        if waiting is not None and answered:
            if cycle - waiting < least:
                return False
            waiting = None
        elif waiting is None and cycle in up1:
            waiting = cycle
            if answered:
                if least > 0:
                    return False
                waiting = None
    return waiting is None or end - waiting <= most


TEXTS = {
    "high": '[[pulse]]\npin = "RB1"\nhigh_us = [{least}, {most}]\n',
    "never": '[[never]]\ncondition = "RB1 high and RB2 high"\nlonger_us = {most}\n',
    "count": '[[count]]\nevent = "RB1 rises"\ntimes = [0, {most}]\nwindow_us = 20\n',
    "gap": '[[every]]\nevent = "RB1 rises"\ngap_us = [{least}, {most}]\n',
    "response": '[[response]]\nwhen = "RB1 rises"\nthen = "RB2 rises"\nwithin_us = [{least}, {most}]\n',
}


@pytest.mark.parametrize("kind", TEXTS)
def test_random_levels_are_judged_as_the_definition_says(kind: str) -> None:
    random_of = random.Random(kind)
    answers = set()
    for _ in range(300):
        end = random_of.randrange(1, 60)
        changes = []
        for pin in ("RB1", "RB2"):
            level = 0
            for cycle in sorted(random_of.sample(range(end), random_of.randrange(0, min(end, 7)))):
                level = 1 - level
                changes.append((cycle, pin, level))
        least = random_of.randrange(0, 6)
        most = least + random_of.randrange(0, 25)
        if kind == "count":
            most = random_of.randrange(0, 4)
        text = TEXTS[kind].format(least=least, most=most)
        found = only(text, changes, end)
        wanted = kept_by_definition(
            kind, levels_of(changes, "RB1", end), levels_of(changes, "RB2", end), least, most, end
        )
        assert (not found.breaches) == wanted, (text, changes, end, found.first)
        answers.add(wanted)
    assert answers == {True, False}


def test_a_cause_that_does_not_last_is_none() -> None:
    text = '[[response]]\nwhen = "RB0 rises"\nheld_us = 10\nthen = "RB4 rises"\nwithin_us = [0, 20]\n'
    assert only(text, pulses("RB0", (5, 14)), 60).word == "kept"
    assert only(text, pulses("RB0", (5, 15)), 60).word == "violated"
    assert only(text, [*pulses("RB0", (5, 50)), (25, "RB4", 1)], 60).word == "kept"
