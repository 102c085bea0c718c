"""The specification of a program that follows the wire of another chip, whatever that wire does.

In: a schedule with a `WireRule`. Out: `FollowedWire`, which takes the levels that the program reads and says
what the pins have to do: docs/proof.md, "Two chips". The wire may have any level in any cycle.

    silent: high ─low─▶ quiet ─for `quiet` cycles─▶ ready ─high─▶ joining ─look: low, high, high─▶ in a frame
             ▲───high────╯                                           ╰─other─▶ high ◀──────other──────╯ look

A rise is seen up to some cycles late. While what is read is that of a wire that rises once a frame, joining
keeps by how many, and the first pulse has to come in its cycle whichever it was.

With two crystals the read that sees a rise begins a frame, without pulses while joining: what follows, the
looks for the next rise among it, comes in its cycle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from servogen.edges import PINS
from servogen.prove.specification import (
    BEFORE,
    HIGH,
    IN_FRAME,
    JOINING,
    NONE,
    PLAYING,
    QUIET,
    READY,
    Edge,
    Specification,
    SpecState,
    Violation,
    WireView,
)
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import FIRST_CYCLES, POLL_CYCLES, WireRule, seldom

SILENT = 3
"""The phase of a specification's state in which the program awaits the wire, without pulses; its time counts
from where its kind below says.
"""
LOOK = (0, 1, 1)
"""The levels in three cycles on end around a rise in its cycle."""
NEAR = 8
"""The cycles before and after a rise in which a wire that rises once a frame is low and high."""


class SilenceBroken(Violation):
    """A pulse, where what was read of the wire allows none."""


def _looked(view: WireView, level: int, following: bool) -> WireView:
    """Return the view after one more read, in the cycle `following` the latest one, or in another."""
    seen, good = (view.seen, view.good) if following else (0, 1)
    return view._replace(seen=seen + 1, good=int(good and level == LOOK[seen]))


class FollowedWire(Specification):
    """A schedule whose frames follow the rises of a wire."""

    def __init__(self, schedule: PulseSchedule, rule: WireRule) -> None:
        super().__init__(schedule, None)
        self._wire = rule
        self._pins[PINS.index(rule.pin)] = "wire"
        self._early, self._seldom = rule.early(schedule.period), seldom(schedule.period)
        self._look = self.period + self._first - rule.cycles - (self._early or 1)
        """The time in a frame of the first read of the look at the next frame's rise."""

    @property
    def restart(self) -> int | None:
        return None if self._wire.restart is None else PINS.index(self._wire.restart)

    def start(self) -> SpecState:
        """Return the state at reset."""
        return super().start()._replace(wire=WireView(HIGH))

    def likely(self, state: SpecState) -> dict[int, int]:
        """Return the level that the next read has on a wire that rises as soon as the program awaits it, and
        then once a frame.
        """
        kind, _, _, _, seen, _ = state.wire
        level = int(kind == READY)
        if kind == JOINING and not self._early:
            level = int(state.time % self.period < self.period // 2)
        elif kind in (JOINING, PLAYING):
            level = int(POLL_CYCLES * seen >= self._early) if self._early else LOOK[seen % len(LOOK)]
        return {PINS.index(self._wire.pin): level}

    def is_shown(self, violation: Violation, levels: Mapping[str, Sequence[tuple[int, int]]]) -> bool:
        """Return whether a run is wrong whatever the program reads: a pulse without the wire's rise is."""
        if not isinstance(violation, SilenceBroken):
            return violation.certain
        changes = levels.get(self._wire.pin, ((0, 0),))
        rise = violation.cycle - self._wire.cycles
        offsets, good = ((-POLL_CYCLES, 0), (0, 1)) if self._early else ((-1, 0, 1), LOOK)
        around = ([level for at, level in changes if at <= rise + each][-1:] for each in offsets)
        return tuple(level[0] if level else 0 for level in around) != good

    def sample(self, state: SpecState, pin: int, level: int) -> SpecState:
        """Return the state after the program has read a pin. Raises Violation."""
        if pin not in self._pins:
            return state
        if state.phase == IN_FRAME:
            return self._awaited(state, self._look, level) if self._early else self._looked(state, level)
        if state.phase == BEFORE:
            if self._wire.restart and state.wire.seen < 2:
                raise Violation(f"{self._wire.restart} has not reset the first chip", 0, certain=False)
            state = state._replace(phase=SILENT, time=0, wire=WireView(HIGH))
        view = state.wire
        if view.kind == JOINING:
            look = self.period - self._early
            return self._awaited(state, look, level) if self._early else self._joining(state, level)
        if view.kind in (QUIET, READY) and state.time - view.last > self._seldom:
            raise Violation("the quiet wire is looked at too seldom", 0, certain=False)
        if view.kind == READY and level:
            if self._early and state.time > FIRST_CYCLES:
                raise Violation("the first rise is awaited too seldom", 0, certain=False)
            return self._silent(state, WireView(JOINING, 0, state.time - 1))
        if view.kind == QUIET and state.time >= self._wire.quiet:
            return self._silent(state, WireView(JOINING if level else READY))
        if view.kind == QUIET and not level:
            return state._replace(wire=view._replace(last=state.time))
        return self._silent(state, WireView(HIGH if level else READY if view.kind == READY else QUIET))

    @staticmethod
    def _silent(state: SpecState, view: WireView) -> SpecState:
        return state._replace(phase=SILENT, time=0, frame=0, wire=view)

    def _looked(self, state: SpecState, level: int) -> SpecState:
        if state.time != self._look + state.wire.seen:
            return state
        view = _looked(state.wire, level, following=state.wire.seen > 0)
        if view.seen == len(LOOK) and not view.good:
            return self._silent(state, WireView(HIGH))
        return state._replace(wire=view)

    def _awaited(self, state: SpecState, look: int, level: int) -> SpecState:
        """Return the state after a look for a rise: there are one more than `early`, from the time `look` on,
        the first of them low.
        """
        seen = state.wire.seen
        if state.time != look + POLL_CYCLES * seen:
            return state
        if level and seen:
            if state.phase != IN_FRAME and self._wire.frames != 1:
                raise Violation("the first frame is that of the wire's rise 1", 0, certain=False)
            frame = self._following(state.frame) if state.phase == IN_FRAME else self._first_frame
            return SpecState(IN_FRAME, self._first - self._wire.cycles, frame, wire=WireView(PLAYING))
        if level or seen == self._early:
            return self._silent(state, WireView(HIGH))
        return state._replace(wire=state.wire._replace(seen=seen + 1))

    def _joining(self, state: SpecState, level: int) -> SpecState:
        view, time = state.wire, state.time
        late = [late for late in range(view.least, view.most + 1) if self._may_be(time + late, level)]
        least, most = (late[0], late[-1]) if late else NONE
        view = _looked(view, level, following=bool(view.seen) and time == view.last + 1)
        view = view._replace(least=least, most=most, last=time)
        if view.seen < len(LOOK):
            return state._replace(wire=view)
        if late and not (view.good and least == most == self._wire.frames * self.period + 1 - time):
            raise Violation("the wire is looked at in another cycle than that of its rise", 0, certain=False)
        if not view.good:
            return self._silent(state, WireView(HIGH))
        time = self._look + len(LOOK) - 1 - self.period
        return SpecState(IN_FRAME, time, self._first_frame, wire=WireView(PLAYING))

    def _may_be(self, since: int, level: int) -> bool:
        """Return whether a wire that rises once a frame may have a level so many cycles after its first
        rise.
        """
        cycle = since % self.period
        return not (cycle < NEAR and not level) and not (cycle >= self.period - NEAR and level)

    def advance(self, state: SpecState, edges: Sequence[Edge], cycles: int) -> SpecState:
        """Return the state after a run of `cycles` that made `edges`. Raises Violation."""
        if state.phase == IN_FRAME:
            try:
                return super().advance(state, edges, cycles)
            except Violation as violation:
                # Where no frame begins after a look, none may be due: that this is one, only the reads tell.
                # With two crystals a pulse that is not due may be that of another look.
                fixed = 0 <= state.time < self._look if self._early else state.time >= 0 or bool(edges)
                violation.certain = violation.certain and fixed
                raise
        for edge in edges:
            state = self._restarted(state, edge)
        time, view = state.time + cycles, state.wire
        if view.kind == JOINING and time > self._wire.frames * self.period + self._early + 2:
            raise Violation("the first pulse is missing", cycles, certain=False)
        if view.kind != JOINING and time > self.period + (self._wire.quiet if view.kind == QUIET else 0):
            raise Violation("the wire is not looked at for a frame", cycles, certain=False)
        return state._replace(time=time)

    def _restarted(self, state: SpecState, edge: Edge) -> SpecState:
        """Return the state after an edge without pulses due: `restart` is pulled once, and for long enough,
        before the first read. Raises Violation.
        """
        cycle, pin, level = edge
        view, now = state.wire, state.time + cycle
        long_enough = level or now - view.last >= self._wire.pulled
        if state.phase == BEFORE and pin == self.restart and view.seen == 1 - level and long_enough:
            return state._replace(wire=view._replace(seen=view.seen + 1, last=now * level))
        raise SilenceBroken(f"the {'rise' if level else 'fall'} of {PINS[pin]} is not the schedule's", cycle)

    def _next(self, state: SpecState, cycle: int) -> SpecState:
        if self._early or state.wire.seen < len(LOOK):
            raise Violation("the wire's rise is not looked at", cycle, certain=False)
        return SpecState(IN_FRAME, 0, self._following(state.frame), wire=WireView(PLAYING))
