"""Runs an image and holds its edges against a schedule.

In: a `PulseSchedule` and an `Image`, or a trace from elsewhere. Out: the `Verdict`, over a stated span.
"""

from __future__ import annotations

from servogen.edges import EdgeTrace
from servogen.pic.device import OPEN_DRAIN_PIN
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.simulator import Levels, Machine, Options, Stimuli
from servogen.simulator.sources import pin_number
from servogen.units import Cycles
from servogen.verify import Verdict, verify, whole_motion

LOOPS_CHECKED = 3
"""The whole motion and two repeats of it."""

START_FRAMES = 50
"""How long an image may take from reset to its first pulse before it counts as silent."""


def checked_cycles(schedule: PulseSchedule) -> Cycles:
    """The lead-in and `LOOPS_CHECKED` loops."""
    return whole_motion(expected(schedule), LOOPS_CHECKED)


def motion_cycles(schedule: PulseSchedule) -> Cycles:
    """The lead-in and one loop."""
    return whole_motion(expected(schedule), 1)


def running(schedule: PulseSchedule, image: Image, span: Cycles) -> EdgeTrace:
    """The edges of `image` while it runs on the simulator: `span` cycles, and the time to the first pulse."""
    limit = Cycles(span + START_FRAMES * schedule.period)
    return EdgeTrace(schedule.clock, machine_of(schedule, image).stream(limit), limit)


def machine_of(schedule: PulseSchedule, image: Image) -> Machine:
    """The chip with `image` on the board of `schedule`, its inputs held as that says."""
    return Machine(image, schedule.clock, board_of(schedule), inputs_of(schedule))


def inputs_of(schedule: PulseSchedule) -> Stimuli | None:
    """The levels at which a schedule's inputs are held from power-up on."""
    held = [Levels(pin_number(each.pin), ((0, each.level),)) for each in schedule.inputs]
    return Stimuli(held) if held else None


def board_of(schedule: PulseSchedule) -> Options:
    """The board that a schedule needs: a servo on RA4, an open drain, has its pull-up resistor."""
    return Options(ra4_pull_up=any(channel.pin == OPEN_DRAIN_PIN for channel in schedule.channels))


def held(schedule: PulseSchedule, trace: EdgeTrace, ends: bool) -> tuple[EdgeTrace, Cycles]:
    """A recorded trace, and the span that it can be held to: whole frames, at most `checked_cycles`.

    The span is never less than the whole motion, so that a torn file is not proven. Where a file says no end
    (not `ends`: CSV, JSONL) what follows its last edge counts as silence.
    """
    stored = trace.stored()
    cycles = [chunk.cycle for chunk in stored.driven() if len(chunk.cycle)]
    if not cycles:
        return stored, checked_cycles(schedule)
    first = int(cycles[0][0])
    frames = -(-(stored.end - first) // schedule.period)
    whole = Cycles(frames * schedule.period)
    span = max(min(whole, checked_cycles(schedule)), motion_cycles(schedule))
    if ends:
        return stored, Cycles(min(span, max(stored.end - first, motion_cycles(schedule))))
    return EdgeTrace(stored.clock, stored.chunks, Cycles(max(stored.end, first + span))), span


def prove(schedule: PulseSchedule, trace: EdgeTrace, span: Cycles | None = None) -> Verdict:
    """The verdict on `trace` over `span` cycles from its first pulse (default: `checked_cycles`)."""
    return verify(expected(schedule), trace, checked_cycles(schedule) if span is None else span)
