"""Pulses whose lengths depend on bytes of the EEPROM, compared with a schedule and the trims in these bytes.

In: a schedule, and edges: for each value of a byte, or each pair of values of two, the cycle of an edge since
a `Position` in the schedule. Out: the position after them, and which byte is the trim of which channel; or
`WrongEdge`, with the bytes for which an edge is not where the schedule and the trims want it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from servogen.edges import PINS
from servogen.engines.stream.protocol import trim_cycles
from servogen.prove.tables import VALUES, Ints, along
from servogen.pulse import PulseSchedule

TRIMS = np.array([trim_cycles(byte) for byte in range(VALUES)], dtype=np.int64)
NO_BYTE = -1
"""Of a channel whose pulses no trim changes."""


class PinEdges(NamedTuple):
    """When a pin rises and falls, in cycles since a position, for each content of the EEPROM: -1 where it
    does not; None where it never does.
    """

    rise: Ints | None
    fall: Ints | None


Edges = Mapping[int, PinEdges]
"""Of each pin that has any."""


@dataclass
class WrongEdge(Exception):
    """An edge that is not where the schedule and the trims want it, and the bytes with which it is there."""

    message: str
    content: dict[int, int]
    frame: int


@dataclass(frozen=True, slots=True)
class Position:
    """Where chips are in the schedule, the earliest of them."""

    frame: int = -1
    """The schedule's frame; -1 before the first pulse."""
    time: int = 0
    """Cycles since its beginning."""
    done: frozenset[int] = frozenset()
    """Channels whose pulse in this frame has been."""

    def delayed(self, cycles: int) -> Position:
        """Return the position so much later in the same frame."""
        return Position(self.frame, self.time + cycles, self.done)


NOT_BEGUN = Position()


class _ComingPulse(NamedTuple):
    """A pulse that has not been."""

    ahead: int
    """1 if it is of the next frame, else 0."""
    channel: int
    rise: int
    """Since the beginning of this frame."""
    width: int


class TrimPulses:
    """The schedule's pulses, and the bytes that have been found to be trims."""

    def __init__(self, schedule: PulseSchedule) -> None:
        self.bytes: dict[int, int] = {}
        """By channel, once it had a pulse; NO_BYTE where none changes it."""
        self.played: set[int] = set()
        """Frames that have been to their end."""
        self._pins = [PINS.index(channel.pin) for channel in schedule.channels]
        self._period = int(schedule.period)
        self._frames = [
            [None if pulse is None else (int(pulse.rise), int(pulse.width)) for pulse in run.pulses]
            for run in (*schedule.lead_in, *schedule.loop)
            for _ in range(run.frames)
        ]
        self._loop = schedule.lead_in_frames

    @property
    def trims(self) -> dict[int, int]:
        """Return the byte of each channel that has one."""
        return {channel: byte for channel, byte in self.bytes.items() if byte != NO_BYTE}

    def first_frame(self, position: Position, edges: Edges) -> Position:
        """Return the position in the first frame with pulses, if these edges begin the first pulse."""
        rises = [edge.rise for edge in edges.values() if edge.rise is not None]
        if position.frame >= 0 or not rises:
            return position
        frame = next(n for n, pulses in enumerate(self._frames) if any(pulses))
        offset = min(pulse[0] for pulse in self._frames[frame] if pulse)
        return Position(frame, offset - min(int(rise[rise >= 0].min()) for rise in rises))

    def after_edges(
        self, position: Position, edges: Edges, addresses: tuple[int, ...], cycles: int, spread: int
    ) -> Position:
        """Return the position `cycles` cycles later, for the earliest chip; the latest is `spread` behind.

        `addresses`: of the bytes of the EEPROM for whose contents the edges are. Every pulse has to rise and
        fall within these cycles. Raises WrongEdge.
        """
        if position.frame < 0:
            return position
        matched = set()
        due = {(self._pins[pulse.channel], pulse.rise): pulse for pulse in self._coming_pulses(position)}
        for pin, (rise, fall) in sorted(edges.items()):
            first = -1 if rise is None else int(rise.flat[0])
            pulse = due.get((pin, position.time + first))
            if rise is None or fall is None or pulse is None or (rise != first).any():
                index = 0 if rise is None else int(np.argmax(rise != first))
                message = f"a pulse on {PINS[pin]} is not the schedule's"
                raise WrongEdge(message, _content_of(addresses, index), position.frame)
            self._compare(pulse, fall - first - pulse.width, addresses, position.frame + pulse.ahead)
            matched.add(pulse)
        return self._advance(position, cycles, spread, matched)

    def advance(self, position: Position, cycles: int) -> Position:
        """Return the position so many cycles later, in which no pulse may be due. Raises WrongEdge."""
        return self._advance(position, cycles, 0, set())

    def _advance(self, position: Position, cycles: int, spread: int, seen: Set[_ComingPulse]) -> Position:
        if position.frame < 0:
            return position
        frame, end = position.frame, position.time + cycles
        for pulse in self._coming_pulses(position):
            if pulse.rise < end + spread and pulse not in seen:
                raise WrongEdge(f"the rise of {PINS[self._pins[pulse.channel]]} is missing", {}, frame)
        done = position.done | {pulse.channel for pulse in seen if not pulse.ahead}
        following = frozenset(pulse.channel for pulse in seen if pulse.ahead)
        while end >= self._period:
            self.played.add(frame)
            frame, end = self._frame_after(frame), end - self._period
            done, following = following, frozenset()
        return Position(frame, end, done)

    def _compare(self, pulse: _ComingPulse, excess: Ints, addresses: tuple[int, ...], frame: int) -> None:
        """Compare by how much pulses are longer than planned with the trims. Raises WrongEdge."""
        known = self.bytes.get(pulse.channel)
        differs = {NO_BYTE: excess != 0}
        for axis, address in enumerate(addresses):
            differs[address] = excess != along(TRIMS, axis, len(addresses))
        message = f"the fall of {PINS[self._pins[pulse.channel]]} is not where the EEPROM wants it"
        if known is not None and known not in differs:
            # The length of this pulse does not depend on its byte, of which 1 is any trim but 0.
            raise WrongEdge(message, {known: 1}, frame)
        # The first pulse of a channel shows which byte is its trim: the one that explains most lengths. From
        # then on the channel keeps that byte.
        options = [known] if known is not None else [*differs]
        fewest, byte = min((int(np.count_nonzero(differs[option])), option) for option in options)
        if fewest:
            raise WrongEdge(message, _content_of(addresses, int(np.argmax(differs[byte]))), frame)
        self.bytes[pulse.channel] = byte

    def _coming_pulses(self, position: Position) -> Iterator[_ComingPulse]:
        """Yield the pulses of this frame that have not been, and those of the next."""
        for ahead, frame in enumerate((position.frame, self._frame_after(position.frame))):
            for channel, pulse in enumerate(self._frames[frame]):
                if pulse is not None and (ahead or channel not in position.done):
                    yield _ComingPulse(ahead, channel, pulse[0] + ahead * self._period, pulse[1])

    def _frame_after(self, frame: int) -> int:
        return frame + 1 if frame + 1 < len(self._frames) else self._loop


def _content_of(addresses: tuple[int, ...], index: int) -> dict[int, int]:
    """Return the content of each byte of the EEPROM that is at a flat index of a table."""
    values = np.unravel_index(index, (VALUES,) * len(addresses)) if addresses else ()
    return {address: int(value) for address, value in zip(addresses, values, strict=True)}
