"""The specification of the pins: the schedule with its buttons or its commands, as a function of time.

In: a `PulseSchedule`. Out: `Specification`, which follows runs of a program: it takes a state of its own, the
edges and the levels that the program read, and returns the state later, or a `Violation`.

    before the first pulse ──first rise──▶ in a frame ──period──▶ in the next frame …
                                                      ╰──the loop has no pulses──▶ nothing more is expected
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

from servogen.edges import PINS
from servogen.prove.commands import WalkCommands
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import ButtonRule, CommandRule, Run
from servogen.units import counted

BEFORE, IN_FRAME, OVER = range(3)
"""The phases of a specification's state."""

Edge = tuple[int, int, int]
"""(cycle, pin, level)."""


HIGH, QUIET, READY, JOINING, PLAYING = range(5)
"""The latest level was high, or the pulses were released: from that read on; low since the first low read;
low for long enough: from the latest read on; after the rise: from its read on; in a frame.
"""
NONE = (1, 0)
"""No number of cycles: what was read is not that of a wire that rises once a frame."""


class WireView(NamedTuple):
    """What the program has read of the wire."""

    kind: int = HIGH
    least: int = NONE[0]
    most: int = NONE[1]
    """While joining: by how many cycles, at least and at most, the rise was seen late."""
    last: int = 0
    """While joining, or quiet: the time of the latest read; before the first read: since when `restart` is
    pulled.
    """
    seen: int = 0
    """The reads in cycles on end up to the latest one, those of a look at most; before the first read: the
    edges of `restart`.
    """
    good: int = 1
    """Whether all of these were as `prove.wire.LOOK` says."""


class SpecState(NamedTuple):
    """Where in the specification a run is, at an instruction boundary."""

    phase: int
    time: int
    """Cycles since the beginning of the frame; before the first pulse 0."""
    frame: int
    """The schedule's frame, counted through lead-in and loop."""
    running: int = 1
    on: int = 1
    start_seen: int = 0
    stop_seen: int = 0
    start_sample: int = -1
    stop_sample: int = -1
    """The level that was read in this frame; -1: not yet."""
    heard: int = 0
    wanted: int = 0
    """Of what commands a walk: see `prove.commands`."""
    line_read: int = 0
    """Whether the line was read in this frame, 1: what is heard takes it in at once; or what was read of the
    buttons.
    """
    wire: WireView = WireView()
    """What was read of the wire of another chip, if one is followed: see `prove.wire`."""

    @property
    def is_sampled(self) -> bool:
        """Return whether a button's level is kept until the frame ends."""
        return max(self.start_sample, self.stop_sample) >= 0 or self.line_read > 1


@dataclass(slots=True)
class Violation(Exception):
    """The pins, or the program, did what the specification does not allow."""

    message: str
    cycle: int
    """Since the beginning of the run."""
    certain: bool = True
    """Whether it is wrong by itself; else the specification does not say."""


class Specification:
    """A schedule with its buttons, or with the line or the buttons that command it."""

    def __init__(
        self, schedule: PulseSchedule, rule: ButtonRule | None, commands: CommandRule | None = None
    ) -> None:
        self.period = int(schedule.period)
        self.rule = rule
        self._commands = None if commands is None else WalkCommands(schedule, commands)
        self._frames: list[tuple[Edge, ...]] = []
        directions = () if commands is None else commands.directions
        parts = (
            part for direction in directions for part in (direction.start, direction.cycle, direction.stop)
        )
        for run in (*schedule.lead_in, *schedule.loop, *(run for part in parts for run in part)):
            self._frames += [_edges(schedule, run)] * run.frames
        self._loop = schedule.lead_in_frames
        pulsed = [frame for frame in self._frames if frame]
        self._first = pulsed[0][0][0] if pulsed else 0
        self._first_frame = next((n for n, frame in enumerate(self._frames) if frame), 0)
        self._silent_loop = not any(self._frames[self._loop :]) and rule is None and commands is None
        self._waiting = rule.waiting if rule else 0
        self._due = cache(self._due_edges)
        self._pins: dict[int, str] = {}
        if rule and rule.start:
            self._pins[PINS.index(rule.start.pin)] = "start_sample"
        if rule and rule.stop:
            self._pins[PINS.index(rule.stop.pin)] = "stop_sample"
        if self._commands is not None:
            self._pins |= dict.fromkeys(self._commands.reader.pins, "line_read")

    @property
    def frames(self) -> int:
        """Return the number of frames of the lead-in, the loop and the directions of a walk on command."""
        return len(self._frames)

    @property
    def longest_silence(self) -> int:
        """Return the maximum number of cycles between two edges, as far as the loop has any."""
        longest = silent = 0
        for frame in (*self._frames, *self._frames[self._loop :]):
            silent = 0 if frame else silent + 1
            longest = max(longest, silent)
        return (longest + 1) * self.period

    @property
    def restart(self) -> int | None:
        """Return the pin that is wired to another chip's MCLR, whose edges are those of pulling it low."""
        return None

    @property
    def sampled(self) -> frozenset[int]:
        """Return the pins of the buttons, or of the line."""
        return frozenset(self._pins)

    def start(self) -> SpecState:
        """Return the state at reset; without any pulse in the schedule nothing is ever due."""
        if not any(self._frames):
            return SpecState(OVER, 0, self._loop)
        running = 0 if self.rule and self.rule.start else 1
        heard = self._commands.reader.at_power_up if self._commands else 0
        return SpecState(BEFORE, 0, self._waiting, running, heard=heard)

    def likely(self, state: SpecState) -> dict[int, int]:
        """Return the levels that the next instruction may well read, by pin, beside those of the schedule."""
        return {}

    def is_shown(self, violation: Violation, levels: Mapping[str, Sequence[tuple[int, int]]]) -> bool:
        """Return whether a run at these levels, (cycle, level) by pin, is wrong whatever is read."""
        return violation.certain

    def at_rest(self, state: SpecState) -> SpecState:
        """Return that nothing more is expected, if no edge is due from now on; else the state as it is."""
        if state.phase != IN_FRAME or self.rule is not None or not self._silent_loop:
            return state
        later = self._frames[state.frame + 1 : self._loop] if state.frame < self._loop else []
        if any(later) or self._due(state.frame, state.time, self.period):
            return state
        return SpecState(OVER, 0, self._loop)

    def ordered(self, state: SpecState) -> tuple[object, tuple[int, ...]]:
        """Return what is the same in a worse state, and what is greater there: nothing is."""
        return state, ()

    def sample(self, state: SpecState, pin: int, level: int) -> SpecState:
        """Return the state after the program has read a pin. Raises Violation."""
        field = self._pins.get(pin)
        if field is None or state.phase != IN_FRAME:
            return state
        if self._commands is not None:
            now = self._commands.reader.sampled(state.heard, state.wanted, state.line_read, pin, level)
            if now is None:
                raise Violation(f"{PINS[pin]} is read twice in a frame", 0, certain=False)
            return state._replace(heard=now[0], wanted=now[1], line_read=now[2])
        known = getattr(state, field)
        if known not in (-1, level):
            raise Violation(f"{PINS[pin]} is read twice in a frame, at different levels", 0, certain=False)
        sampled: dict[str, Any] = {field: level}
        return state._replace(**sampled)

    def advance(self, state: SpecState, edges: Sequence[Edge], cycles: int) -> SpecState:
        """Return the state after a run of `cycles` that made `edges`. Raises Violation."""
        begun = 0
        # The first rise fixes when the first frame with pulses began: when a program starts is left open.
        if state.phase == BEFORE:
            rise = next((edge for edge in edges if edge[2]), None)
            if rise is None:
                return state
            begun = rise[0]
            state = state._replace(phase=IN_FRAME, time=self._first, frame=self._beginning(state))
            edges = edges[edges.index(rise) :]
        place = 0
        while state.phase == IN_FRAME:
            left = cycles - begun
            span = min(left, self.period - state.time)
            # The two lists are compared from their beginnings: with as many edges as are due, all equal, one
            # more within the span is the only fault that is left.
            due = self._due(state.frame if state.on else -1, state.time, state.time + span)
            seen = edges[place : place + len(due)]
            if not self._same(seen, due, begun) or self._more(edges, place + len(due), begun + span):
                raise self._wrong(edges[place:], due, begun, begun + span)
            place += len(due)
            if left < self.period - state.time:
                return state._replace(time=state.time + span)
            begun += span
            state = self._next(state, begun)
        if place < len(edges):
            raise Violation(f"{_edge_text(edges[place])}, after the last pulse", edges[place][0])
        return state

    def _beginning(self, state: SpecState) -> int:
        return max(state.frame, self._first_frame)

    def _due_edges(self, frame: int, start: int, end: int) -> tuple[Edge, ...]:
        """Return what is due in cycles `start` to `end` - 1 of a frame, from `start` on; frame -1 has
        none.
        """
        if frame < 0:
            return ()
        edges = self._frames[frame]
        first, last = (bisect_left(edges, (cycle, -1, -1)) for cycle in (start, end))
        return tuple((cycle - start, pin, level) for cycle, pin, level in edges[first:last])

    @staticmethod
    def _same(seen: Sequence[Edge], due: tuple[Edge, ...], begun: int) -> bool:
        if not begun:  # most runs lie within one frame: there is no offset to subtract
            return tuple(seen) == due
        return len(seen) == len(due) and all(
            (cycle - begun, pin, level) == wanted
            for (cycle, pin, level), wanted in zip(seen, due, strict=True)
        )

    @staticmethod
    def _more(edges: Sequence[Edge], place: int, end: int) -> bool:
        return place < len(edges) and edges[place][0] < end

    def _next(self, state: SpecState, cycle: int) -> SpecState:
        """Return the state at the beginning of the next frame, at `cycle` of the run."""
        if self.rule is not None:
            return self._pressed(state, self.rule, cycle)
        if self._commands is not None:
            return self._commanded(state, self._commands, cycle)
        frame = self._following(state.frame)
        if frame >= self._loop and self._silent_loop:
            return SpecState(OVER, 0, self._loop)
        return state._replace(time=0, frame=frame)

    def _following(self, frame: int) -> int:
        return frame + 1 if frame + 1 < len(self._frames) else self._loop

    @staticmethod
    def _commanded(state: SpecState, commands: WalkCommands, cycle: int) -> SpecState:
        unread = commands.reader.unread(state.line_read)
        if unread is not None:
            raise Violation(f"{PINS[unread]} is not read in a frame", cycle, certain=False)
        heard, wanted = commands.reader.ended(state.heard, state.wanted, state.line_read)
        return SpecState(IN_FRAME, 0, commands.following(state.frame, wanted), heard=heard, wanted=wanted)

    def _pressed(self, state: SpecState, rule: ButtonRule, cycle: int) -> SpecState:
        frame, running, on = state.frame, state.running, state.on
        start_seen, stop_seen = state.start_seen, state.stop_seen
        enough = rule.pressed_frames
        for button, sample in ((rule.start, state.start_sample), (rule.stop, state.stop_sample)):
            if button is not None and sample < 0:
                raise Violation(f"{button.pin} is not read in a frame", cycle, certain=False)
        if rule.start is not None:
            if state.start_sample != rule.start.level:
                start_seen = 0
            elif start_seen < enough:
                start_seen += 1
                if start_seen == enough:
                    running = on = 1
        if rule.stop is not None:
            stop_seen = min(enough, stop_seen + 1) if state.stop_sample == rule.stop.level else 0
            if stop_seen == enough:
                running = 0
                if rule.off:
                    on = 0
                    frame = self._waiting if rule.start else frame
        if running:
            frame = self._following(frame)
        # Switched off, and no button switches it on again.
        if not on and not rule.start:
            return SpecState(OVER, 0, self._loop)
        return SpecState(IN_FRAME, 0, frame, running, on, start_seen, stop_seen)

    def _wrong(self, edges: Sequence[Edge], due: tuple[Edge, ...], begun: int, end: int) -> Violation:
        """Return what is wrong first."""
        wanted = [(cycle + begun, pin, level) for cycle, pin, level in due]
        seen = [edge for edge in edges if edge[0] < end]
        for number, edge in enumerate(wanted):
            if number >= len(seen):
                return Violation(f"{_edge_text(edge)} is missing", edge[0])
            if seen[number] == edge:
                continue
            if seen[number][1:] == edge[1:]:
                late = seen[number][0] - edge[0]
                distance = f"{counted(abs(late), 'cycle')} {'late' if late > 0 else 'early'}"
                return Violation(f"{_edge_text(edge)} comes {distance}", edge[0])
            if seen[number] < edge:
                return Violation(f"{_edge_text(seen[number])} is not the schedule's", seen[number][0])
            return Violation(f"{_edge_text(edge)} is missing", edge[0])
        extra = seen[len(wanted)]
        return Violation(f"{_edge_text(extra)} is not the schedule's", extra[0])


def _edges(schedule: PulseSchedule, run: Run) -> tuple[Edge, ...]:
    return tuple(
        sorted(
            (cycle, PINS.index(channel.pin), level)
            for channel, pulse in zip(schedule.channels, run.pulses, strict=True)
            if pulse
            for cycle, level in ((int(pulse.rise), 1), (int(pulse.rise + pulse.width), 0))
        )
    )


def _edge_text(edge: Edge) -> str:
    return f"the {'rise' if edge[2] else 'fall'} of {PINS[edge[1]]}"
