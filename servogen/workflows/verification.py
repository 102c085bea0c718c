"""Compares the edges of an image, a recording or a capture with a schedule.

In: a `PulseSchedule` and an `Image`, a recorded trace, or a `Capture`. Out: the `Verdict` over a stated span
or, if the machine's complete state repeats, over a span after which nothing new can happen (`judge_forever`):

    machine   ├ its lead-in ┤├──── its loop ────┤├──── its loop ────┤ …
    schedule  ├ lead-in ┤├─ loop ─┤├─ loop ─┤├─ loop ─┤├─ loop ─┤ …
    checked   ├ the longer lead-in ┤├ a common multiple of both loops ┤
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import lcm
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from servogen.edges import PINS, UNDRIVEN, EdgeTrace, Expected, join
from servogen.engines.board import board_of, inputs_of, machine_of
from servogen.errors import Diagnostic, Location
from servogen.pic.device import registers
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.pic.listing import Listing
from servogen.plan_error import plan_text
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.simulator import CHIP_DEPENDENT, Machine, NoRepeat, SimulatorOptions, find_repeat
from servogen.traces.captures import Capture
from servogen.traces.vcd import read_header
from servogen.units import Clock, Cycles, counted
from servogen.verify import (
    CaptureVerdict,
    Tolerances,
    Verdict,
    channel_pins,
    find_start,
    sampling,
    verify,
    verify_capture,
    whole_motion,
)
from servogen.verify.verdict import unseen_motion_reason

if TYPE_CHECKING:
    from servogen.answers import ForeverFacts

LOOPS_CHECKED = 3
"""The number of loops that are checked: the whole motion and two repetitions."""


def checked_cycles(schedule: PulseSchedule) -> Cycles:
    """Return the cycles of the lead-in and of `LOOPS_CHECKED` loops."""
    return whole_motion(expected(schedule), LOOPS_CHECKED)


def motion_cycles(schedule: PulseSchedule) -> Cycles:
    """Return the cycles of the lead-in and of one loop."""
    return whole_motion(expected(schedule), 1)


def running(
    schedule: PulseSchedule,
    image: Image,
    span: Cycles,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
) -> EdgeTrace:
    """Return the edges of `image` on the simulator, for `span` cycles plus the time to the first pulse."""
    limit = schedule.run_cycles(span)
    return EdgeTrace(schedule.clock, machine_of(schedule, image, options).stream(limit), limit)


def hidden_by(file: Path, clock: Clock, wires: Mapping[str, str] | None = None) -> tuple[str, ...]:
    """Return what a file of edges cannot show: pins without a wire, and edges between the steps of its time.

    Only a VCD file says which pins it holds, and what its steps are. Raises InputError if it is malformed.
    """
    if file.suffix.lower() != ".vcd":
        return ()
    header = read_header(file, wires)
    absent = [name for number, name in enumerate(PINS) if number not in header.pins.values()]
    hidden = [f"the file has no wire for {', '.join(absent)}"] if absent else []
    cycles = header.step_s * clock.cycles_per_second
    if cycles > 1:
        step = float(header.step_s * 1_000_000)
        hidden.append(f"the file's times are whole steps of {step:g} µs, {float(cycles):g} cycles each")
    return tuple(hidden)


def _not_driven(
    schedule: PulseSchedule, trace: EdgeTrace, begin: Cycles, pieces: Sequence[tuple[int, int]] = ()
) -> list[str]:
    """Return the scheduled pins that a recording says are not driven from `begin` on: they count as low.

    Between the `pieces` of a capture no pin has a level; there nothing is compared.
    """
    edges = join(trace.chunks)
    compared = edges.cycle >= begin
    if pieces:
        compared &= np.any([(first <= edges.cycle) & (edges.cycle < end) for first, end in pieces], axis=0)
    lost = (edges.level == UNDRIVEN) & compared
    reasons = []
    for channel in schedule.channels:
        cycles = edges.cycle[lost & (edges.pin == PINS.index(channel.pin))]
        if len(cycles):
            seconds = float(trace.clock.seconds(int(cycles[0])))
            reasons.append(f"{channel.pin} is not driven after {seconds:g} s, which counts as low")
    return reasons


def judge_file(
    schedule: PulseSchedule,
    trace: EdgeTrace,
    tells_end: bool,
    span: Cycles | None = None,
    hidden: Sequence[str] = (),
) -> Verdict:
    """Return the verdict on a recorded trace; with a reason in `hidden` it is not exact (`hidden_by`)."""
    stored = trace.stored()
    verdict = _judge_stored(schedule, stored, tells_end, span)
    unseen = [] if verdict.start is None else _not_driven(schedule, stored, verdict.start)
    for reason in (*hidden, *unseen):
        verdict = verdict.not_all(reason)
    return verdict


def _judge_stored(
    schedule: PulseSchedule, stored: EdgeTrace, tells_end: bool, span: Cycles | None
) -> Verdict:
    """Return the verdict on a recorded trace, which is checked to its end.

    It must contain the whole motion. If its format does not store the end of the recording (not `tells_end`:
    CSV, JSONL), it must also contain every edge of its last frame; such a recording ends at the schedule's
    next edge. If the caller requests a shorter `span`, the rest is not compared, and the verdict says so.
    """
    if span is not None:
        verdict = judge_edges(schedule, stored, span)
        after = 0 if verdict.start is None else stored.end - verdict.start - span
        return verdict.not_all(_rest(schedule, after)) if after > 0 else verdict
    wanted = expected(schedule)
    first = find_start(stored, channel_pins(wanted)).cycle
    if first is None:
        return judge_edges(schedule, stored, Cycles(max(stored.end, motion_cycles(schedule))))
    known = Cycles(stored.end - first)
    if tells_end:
        return judge_edges(schedule, stored, Cycles(max(known, motion_cycles(schedule))))
    frames = -(-known // schedule.period)
    whole = Cycles(max(frames * schedule.period, motion_cycles(schedule)))
    end = Cycles(first + min(whole, _next_edge(wanted, known, whole)))
    return judge_edges(schedule, EdgeTrace(stored.clock, stored.chunks, end), whole)


def _rest(schedule: PulseSchedule, cycles: int) -> str:
    seconds = float(schedule.clock.seconds(cycles))
    return f"the recording continues for {seconds:g} s, which were not compared"


def _next_edge(wanted: Expected, time: Cycles, otherwise: Cycles) -> int:
    """Return the time of the schedule's first edge from `time` on; `otherwise` if there is none."""
    for chunk in wanted.chunks:
        row = int(np.searchsorted(chunk.cycle, time))
        if row < len(chunk.cycle):
            return int(chunk.cycle[row])
    return otherwise


def judge_edges(schedule: PulseSchedule, trace: EdgeTrace, span: Cycles | None = None) -> Verdict:
    """Return the verdict on `trace` over `span` cycles from its first pulse (default: `checked_cycles`).

    Less than the whole motion is never exact, even if no more was requested.
    """
    verdict = verify(expected(schedule), trace, checked_cycles(schedule) if span is None else span)
    if verdict.agrees and verdict.span.compared < motion_cycles(schedule):
        whole = schedule.lead_in_frames + schedule.loop_frames
        return verdict.not_all(unseen_motion_reason(verdict.span.frames, whole))
    return verdict


@dataclass(frozen=True, slots=True)
class JudgedRun:
    """A run of an image: the verdict, the machine where it stopped, and the edges, if they were stored."""

    verdict: Verdict
    machine: Machine
    edges: EdgeTrace


def judge_run(
    schedule: PulseSchedule,
    image: Image,
    span: Cycles | None = None,
    listing: Listing | None = None,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
    *,
    stored: bool = False,
) -> JudgedRun:
    """Run `image` and judge its edges over `span` cycles (default: `checked_cycles`).

    Edges that equal the schedule's but depend on values that no chip guarantees are not exact. Without
    `stored` the edges are consumed, and the machine runs no further than the verdict needs.
    """
    span = checked_cycles(schedule) if span is None else span
    machine = machine_of(schedule, image, options, tracked=True)
    limit = schedule.run_cycles(span)
    edges = EdgeTrace(schedule.clock, machine.stream(limit), limit)
    if stored:
        edges = edges.stored()
    verdict = judge_edges(schedule, edges, span)
    warnings = chip_warnings(machine, compared_end(verdict), listing)
    return JudgedRun(verdict.with_warnings(warnings, CHIP_DEPENDENT), machine, edges)


def judge_image(
    schedule: PulseSchedule,
    image: Image,
    span: Cycles | None = None,
    listing: Listing | None = None,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
) -> Verdict:
    """Return the verdict on a run of `image` (see `judge_run`)."""
    return judge_run(schedule, image, span, listing, options).verdict


def not_judged(schedule: PulseSchedule, image: Image | None = None) -> tuple[str, ...]:
    """Return, as sentences, what a schedule states or a program does that no verdict on one run or one
    recording covers.

    `image` is the program that ran; None for a recording.
    """
    ran = image is not None
    held = " and ".join(f"{source.pin} was held at {source.level}" for source in schedule.inputs)
    how = held if ran and held else "edges do not show what came in"
    every = "; `servogen prove` covers every level" if ran else ""
    texts = []
    if schedule.buttons is not None:
        texts.append(f"buttons were not judged: {how}{every}")
    if schedule.commands is not None:
        texts.append(f"commands were not judged: {how}{every}")
    if schedule.inputs and schedule.buttons is None and schedule.commands is None:
        every = "; `servogen prove --any-line` covers every waveform" if ran else ""
        texts.append(f"the line was not judged: {how}{every}")
    if image is not None and _reads_eeprom(image):
        texts.append(
            "trims were not judged: the EEPROM held what the file says; `servogen prove --any-eeprom` covers "
            "every content"
        )
    return tuple(texts)


def _reads_eeprom(image: Image) -> bool:
    """Return whether a program begins to read the EEPROM: BSF EECON1, RD (DS35007 section 3.1)."""
    decoded = (decode(word) for word in image.program.values())
    reading = (registers()["EECON1"].address & 0x7F, 0)
    return any(
        each and each.instruction.mnemonic == "BSF" and (each.f, each.b) == reading for each in decoded
    )


def compared_end(verdict: Verdict) -> Cycles | None:
    """Return the cycle since reset up to which a verdict compared; None if no scheduled pin rises."""
    return None if verdict.start is None else Cycles(verdict.start + verdict.span.compared)


def warning_cycle(warning: Diagnostic) -> int:
    """Return the cycle since reset that a warning is about."""
    return (warning.location.cycle if warning.location else None) or 0


def chip_warnings(
    machine: Machine, end: Cycles | None = None, listing: Listing | None = None
) -> tuple[Diagnostic, ...]:
    """Return the warnings of `machine` before cycle `end`, with source lines if a listing has them."""
    rows = {row.address: row for row in listing.rows} if listing else {}
    warnings = []
    for warning in machine.state().warnings:
        if end is not None and warning_cycle(warning) >= end:
            continue
        where = warning.location or Location()
        row = rows.get(where.address) if where.address is not None else None
        if row is not None:
            warning = replace(warning, location=replace(where, file=row.file, line=row.line))
        warnings.append(warning)
    return tuple(warnings)


def judge_capture(
    schedule: PulseSchedule, capture: Capture, tolerances: Tolerances | None = None
) -> CaptureVerdict:
    """Return the verdict on a capture; an incomplete capture is never exact.

    Raises InputError if it was, or may have been, sampled too slowly to show anything.
    """
    trace = capture.trace.stored()
    sampled = sampling(trace, capture.sample)
    longest_us = (tolerances or Tolerances()).glitch_us
    if sampled.stated:
        sampled.check(longest_us, Location(capture.file))
    verdict = verify_capture(expected(schedule), trace, tolerances, capture.sample, capture.pieces)
    if not verdict.agrees:
        sampled.check(longest_us, Location(capture.file))
    for reason in _not_driven(schedule, trace, Cycles(0), capture.pieces):
        verdict = verdict.but(reason)
    if capture.missing is not None:
        return verdict.but(f"the capture is incomplete: {capture.missing}")
    return verdict


@dataclass(frozen=True, slots=True)
class Forever:
    """What holds for all time from one start: `verdict` covers `lead_in` and `loop` frames.

    If `reason` is not empty, nothing repeats, and `verdict` covers the searched time.
    """

    verdict: Verdict
    lead_in: int
    loop: int
    reason: str = ""

    @property
    def passed(self) -> bool:
        return self.verdict.passed and not self.reason

    def text(self) -> str:
        """Return a line that says so, or why not."""
        if self.passed:
            return (
                f"exact for all time from this start: lead-in {counted(self.lead_in, 'frame')}, "
                f"loop {counted(self.loop, 'frame')}; "
                f"0 cycles from the schedule; {plan_text(self.verdict.plan_error)}"
            )
        if self.reason:
            seconds = float(self.verdict.clock.seconds(self.verdict.span.compared))
            why = f"{self.reason}; covered {seconds:g} s"
        else:
            why = "the edges are not the schedule's"
        return f"NOT exact for all time from this start: {why}; {plan_text(self.verdict.plan_error)}"

    def to_json(self) -> ForeverFacts:
        return {
            "exact_for_all_time": self.passed,
            "reason": self.reason,
            "lead_in_frames": self.lead_in,
            "loop_frames": self.loop,
            "verdict": self.verdict.to_json(),
        }


def judge_forever(
    schedule: PulseSchedule,
    image: Image,
    limit: Cycles,
    listing: Listing | None = None,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
) -> Forever:
    """Find a repetition of the machine's state within `limit` cycles from reset; return the verdict on all
    cycles up to it.
    """
    first = next((chunk for chunk in expected(schedule).chunks if len(chunk.cycle)), None)
    if first is None:
        verdict = judge_image(schedule, image, None, listing, options)
        return Forever(verdict, 0, 0, "the schedule has no pulse, with which frames would begin")
    repeat = find_repeat(
        image,
        schedule.clock,
        pin=int(first.pin[0]),
        limit=limit,
        period=schedule.period,
        options=board_of(schedule, options),
        stimulus=inputs_of(schedule),
    )
    if isinstance(repeat, NoRepeat):
        span = Cycles(max(repeat.covered, schedule.period))
        verdict = judge_image(schedule, image, span, listing, options)
        return Forever(verdict, 0, 0, repeat.reason)
    lead_in = max(repeat.lead_in_frames, schedule.lead_in_frames)
    loop = lcm(repeat.loop_frames, schedule.loop_frames)
    span = Cycles((lead_in + loop) * schedule.period)
    return Forever(judge_image(schedule, image, span, listing, options), lead_in, loop)
