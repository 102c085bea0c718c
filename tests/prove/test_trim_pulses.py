"""Pulses for every value of the bytes that are trims, compared with a schedule at the public face."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from servogen.edges import PINS
from servogen.engines.stream.protocol import trim_cycles
from servogen.prove.tables import along
from servogen.prove.trim_pulses import NO_BYTE, NOT_BEGUN, TRIMS, PinEdges, Position, TrimPulses, WrongEdge
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.units import Clock, Cycles

RB0, RB1 = (PINS.index(pin) for pin in ("RB0", "RB1"))
PERIOD = 20_000
SCHEDULE = PulseSchedule(
    Clock(4_000_000),
    Cycles(PERIOD),
    (Channel("one", "RB0", "x"), Channel("two", "RB1", "x")),
    (Run(2, (Pulse(Cycles(0), Cycles(1000)), None)),),
    (Run(1, (Pulse(Cycles(0), Cycles(1200)), Pulse(Cycles(2500), Cycles(1500)))), Run(1, (None, None))),
)


LONGER = np.array([trim_cycles(byte) for byte in range(256)])
EVERY = np.full(256, 0)
"""The same for every value of a byte."""


def pulse(pin: int, rise: Any, width: Any) -> dict[int, PinEdges]:
    return {pin: PinEdges(rise, rise + width)}


def wrong(call: Any) -> tuple[str, dict[int, int], int]:
    with pytest.raises(WrongEdge) as edge:
        call()
    return edge.value.message, edge.value.content, edge.value.frame


def test_the_trims_are_those_of_the_protocol() -> None:
    assert TRIMS.tolist() == LONGER.tolist()
    assert TRIMS[[0, 127, 128, 254, 255]].tolist() == [0, 127, -128, -2, 0]


def test_time_passes_from_frame_to_frame_only_with_the_pulses_that_are_due() -> None:
    pulses = TrimPulses(SCHEDULE)
    assert pulses.advance(NOT_BEGUN, 10**6) == NOT_BEGUN
    first = Position(2, 100, frozenset({0}))
    assert pulses.advance(first, 2400) == Position(2, 2500, frozenset({0}))
    missing: tuple[str, dict[int, int], int] = ("the rise of RB1 is missing", {}, 2)
    assert wrong(lambda: pulses.advance(first, 2401)) == missing
    late = wrong(lambda: pulses.after_edges(first, {}, (), 2400, 1))
    assert late == missing, "the latest chip would be past it"
    second = pulse(RB1, np.array(2400), 1500)
    assert pulses.after_edges(first, second, (), 2401, 0) == Position(2, 2501, frozenset({0, 1}))
    both = Position(2, 100, frozenset({0, 1}))
    assert pulses.advance(both, PERIOD - 101).frame == 2 and not pulses.played
    assert pulses.advance(both, PERIOD - 100) == Position(3, 0) and pulses.played == {2}
    # A pulse of the next frame that has been is done there; behind the last frame the loop begins again.
    ahead = pulse(RB0, np.array(PERIOD), 1200)
    assert pulses.after_edges(Position(3), ahead, (), PERIOD + 7, 0) == Position(2, 7, frozenset({0}))
    assert pulses.played == {2, 3}
    # The lead-in's first frame is followed by its second, in which nothing is due on RB1.
    done = Position(0, 5, frozenset({0}))
    assert pulses.advance(done, PERIOD - 5) == Position(1)
    assert wrong(lambda: pulses.advance(done, PERIOD - 4)) == ("the rise of RB0 is missing", {}, 0)


def test_a_position_moves_within_its_frame() -> None:
    assert Position(1, 5, frozenset({0})).delayed(7) == Position(1, 12, frozenset({0}))


def test_the_first_rise_fixes_when_the_first_frame_begins() -> None:
    """Its rise is in cycle 0 of its frame."""
    pulses, one = TrimPulses(SCHEDULE), np.array([70])
    edges = pulse(RB0, one, 1000)
    only_fall = {RB0: PinEdges(None, one)}
    assert pulses.first_frame(NOT_BEGUN, {}) == NOT_BEGUN == pulses.first_frame(NOT_BEGUN, only_fall)
    some = pulse(RB0, np.array([-1, 70]), 1000)
    assert pulses.first_frame(NOT_BEGUN, some) == Position(0, -70), "one of the chips has no rise"
    begun = pulses.first_frame(NOT_BEGUN, edges)
    assert begun == Position(0, -70) and pulses.first_frame(Position(2, 9), edges) == Position(2, 9)
    assert pulses.after_edges(begun, edges, (), 1500, 0) == Position(0, 1430, frozenset({0}))
    assert pulses.bytes == {0: NO_BYTE} and pulses.trims == {}
    assert pulses.after_edges(NOT_BEGUN, only_fall, (), 1500, 0) == NOT_BEGUN
    # A pulse in another frame, or of another pin, than the first frame's.
    assert wrong(lambda: pulses.after_edges(begun, pulse(RB1, one, 1000), (), 1500, 0)) == (
        "a pulse on RB1 is not the schedule's", {}, 0
    )  # fmt: skip


def test_a_pulse_is_the_schedule_s_for_every_value_of_its_byte() -> None:
    """Of frame 2, which begins after 70 cycles: 1200 cycles on RB0 and the trim in byte 7."""
    pulses, there, rise = TrimPulses(SCHEDULE), Position(2, -70), EVERY + 70
    due = pulse(RB0, rise, 1200 + LONGER)
    assert pulses.after_edges(there, due, (7,), 1500, 0) == Position(2, 1430, frozenset({0}))
    assert pulses.bytes == {0: 7} == pulses.trims
    # In the frame before the one in which it is.
    ahead = pulse(RB0, EVERY + PERIOD, 1200 + LONGER)
    assert pulses.after_edges(Position(3), ahead, (7,), PERIOD + 1500, 0) == Position(2, 1500, frozenset({0}))
    due_fall = rise + 1200 + LONGER
    late, fall, none = rise.copy(), due_fall.copy(), rise.copy()
    late[5] += 1
    fall[9] += 1
    none[6] = -1
    for edges, message, content in (
        ({RB0: PinEdges(late, due_fall)}, "a pulse on RB0 is not the schedule's", {7: 5}),
        ({RB0: PinEdges(none, due_fall)}, "a pulse on RB0 is not the schedule's", {7: 6}),
        ({RB0: PinEdges(rise, None)}, "a pulse on RB0 is not the schedule's", {7: 0}),
        ({RB0: PinEdges(None, rise)}, "a pulse on RB0 is not the schedule's", {7: 0}),
        (pulse(RB0, rise + 1, 1200 + LONGER), "a pulse on RB0 is not the schedule's", {7: 0}),
        (pulse(RB1, rise, 1200 + EVERY), "a pulse on RB1 is not the schedule's", {7: 0}),
        ({RB0: PinEdges(rise, fall)}, "the fall of RB0 is not where the EEPROM wants it", {7: 9}),
    ):
        found = wrong(lambda edges=edges: pulses.after_edges(there, edges, (7,), 1500, 0))
        assert found == (message, content, 2)
    assert wrong(lambda: pulses.after_edges(there, {}, (7,), 1500, 0)) == (
        "the rise of RB0 is missing", {}, 2
    )  # fmt: skip


def test_the_first_pulse_of_a_channel_shows_which_byte_is_its_trim_and_later_ones_have_the_same() -> None:
    pulses, there = TrimPulses(SCHEDULE), Position(2)

    def both(one: Any, two: Any, addresses: tuple[int, ...] = (7,), at: Position = there) -> None:
        rise = np.zeros(np.broadcast(one, two).shape, dtype=np.int64)
        edges = pulse(RB0, rise, 1200 + one) | pulse(RB1, rise + 2500, 1500 + two)
        pulses.after_edges(at, edges, addresses, 5000, 0)

    both(LONGER, EVERY)
    assert pulses.bytes == {0: 7, 1: NO_BYTE} and pulses.trims == {0: 7}
    both(LONGER, EVERY)
    index = LONGER.copy()
    index[0x55] += 1
    fall = "the fall of RB0 is not where the EEPROM wants it"
    assert wrong(lambda: both(index, EVERY)) == (fall, {7: 0x55}, 2)
    assert wrong(lambda: both(EVERY, EVERY)) == (fall, {7: 1}, 2), "its length does not depend on it"
    assert wrong(lambda: both(EVERY, EVERY, (8,))) == (fall, {7: 1}, 2), "nor on another byte"
    assert wrong(lambda: both(LONGER, LONGER))[0] == fall.replace("RB0", "RB1"), "it had no trim before"
    # Of two bytes, the one that explains the lengths.
    pulses = TrimPulses(SCHEDULE)
    first, second = along(LONGER, 0, 2), along(LONGER, 1, 2)
    both(second, first, (2, 5))
    assert pulses.trims == {0: 5, 1: 2}
    assert wrong(lambda: both(first, first, (2, 5))) == (fall, {2: 0, 5: 1}, 2), "byte 5 lengthens nothing"
    odd = second.copy()
    odd[3, 9] += 1
    assert wrong(lambda: both(odd, first, (2, 5))) == (fall, {2: 3, 5: 9}, 2)


def test_a_pulse_that_no_byte_changes_has_no_trim_even_where_a_byte_is_read() -> None:
    pulses = TrimPulses(SCHEDULE)
    pulses.after_edges(Position(0), pulse(RB0, EVERY, 1000), (7,), 5000, 0)
    assert pulses.bytes == {0: NO_BYTE}
    call = wrong(lambda: pulses.after_edges(Position(1), pulse(RB0, EVERY, 1000 + LONGER), (7,), 5000, 0))
    assert call == ("the fall of RB0 is not where the EEPROM wants it", {7: 1}, 1)
