"""One recording of both chips of a pair -> the verdict on each, and how far apart their frames are.

In: a capture whose channels have names such as `1.RB0` and `2.RB0`, or are wired so; the pair's schedules.
Out: `PairCaptureVerdict`. Each chip's pins are compared with its own schedule; where both agree, the lines
fitted to their edges say how far the second chip's frame is from where the wire puts it, finer than a sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from servogen.edges import CHIP_MARKS
from servogen.errors import InputError, Location
from servogen.programs import PAIR_FOLDERS
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import drift
from servogen.traces.captures import read_capture, sampled_at
from servogen.verify import CaptureVerdict, Tolerances, capture_lines
from servogen.workflows.own_crystals import jitter
from servogen.workflows.verification import judge_capture

if TYPE_CHECKING:
    from servogen.answers import PairCaptureAnswer

Schedules = tuple[PulseSchedule, PulseSchedule]


@dataclass(frozen=True, slots=True)
class PairCaptureVerdict:
    """The verdicts on both chips in one recording; `apart` in cycles is where the second one's frame is, from
    where the wire puts it: None where that is not known.
    """

    chips: tuple[CaptureVerdict, CaptureVerdict]
    apart: float | None
    allowed: float
    """The distance in cycles that a sample and the tolerance of an edge account for."""

    @property
    def agrees(self) -> bool:
        near = self.apart is None or abs(self.apart) <= self.allowed
        return near and all(verdict.agrees for verdict in self.chips)

    def accepted(self, partial: bool) -> bool:
        """Return whether both agree, each different frame of the loop seen unless `partial`."""
        return self.agrees and all(verdict.accepted(partial) for verdict in self.chips)

    def lines(self) -> list[str]:
        """Return the verdict as text, that on both first."""
        apart = (
            "how far apart the frames are is not known"
            if self.apart is None
            else f"chip2 is {self.apart:+.2f} cycles from the wire's frame (allowed: {self.allowed:.2f})"
        )
        parts = [
            f"{name}: {line}"
            for name, verdict in zip(PAIR_FOLDERS, self.chips, strict=True)
            for line in capture_lines(verdict)
        ]
        return [f"both chips: {'agree' if self.agrees else 'do NOT agree'}; {apart}", *parts]

    def to_json(self) -> PairCaptureAnswer:
        return {
            "agrees": self.agrees,
            "apart_cycles": self.apart,
            "allowed_cycles": self.allowed,
            "chips": [verdict.to_json() for verdict in self.chips],
        }


def judge_pair_capture(
    schedules: Schedules, file: Path, wires: Mapping[str, str] | None = None, rate: int | None = None
) -> PairCaptureVerdict:
    """Return the verdict on a recording of both chips; `wires` maps its channels to pins such as `2.RB0`.

    Raises InputError, also for a channel that is missing.
    """
    verdicts = []
    for mark, schedule in zip(CHIP_MARKS, schedules, strict=True):
        capture = read_capture(file, _chip_wires(file, mark, schedule, wires))
        sampled = capture if rate is None else sampled_at(capture, rate)
        verdicts.append(judge_capture(schedule, sampled, _tolerances(schedule)))
    first, second = verdicts
    cycle_us = float(schedules[0].clock.cycle_us)
    allowed = (first.sample_us + second.tolerances.edge_us) / cycle_us
    return PairCaptureVerdict((first, second), _frame_distance(schedules, first, second), allowed)


def _tolerances(schedule: PulseSchedule) -> Tolerances:
    """Return what is allowed of a chip: with a crystal of its own, also the jitter of its frames, and in its
    pulses how far both crystals are apart.
    """
    usual, rule = Tolerances(), schedule.wire
    if rule is None or not rule.crystal_ppm:
        return usual
    early, late = jitter(rule, schedule.period)
    span_us = float((late - early) * schedule.clock.cycle_us)
    runs = (*schedule.lead_in, *schedule.loop)
    longest = max(pulse.width for run in runs for pulse in run.pulses if pulse)
    return replace(
        usual,
        width_us=usual.width_us + float(longest * drift(rule.crystal_ppm) * schedule.clock.cycle_us),
        period_us=usual.period_us + span_us,
        edge_us=usual.edge_us + span_us,
    )


def _chip_wires(
    file: Path, mark: str, schedule: PulseSchedule, wires: Mapping[str, str] | None
) -> dict[str, str]:
    """Return the channels of a chip's pins: those wired to it, or those named like its servos' pins."""
    if wires is None:
        return {f"{mark}{channel.pin}": channel.pin for channel in schedule.channels}
    unmarked = next((pin for pin in wires.values() if not pin.startswith(CHIP_MARKS)), None)
    if unmarked is not None:
        message = f"--wire names {unmarked}, and there are two chips"
        hint = f"--wire CHANNEL={CHIP_MARKS[0]}{unmarked} or CHANNEL={CHIP_MARKS[1]}{unmarked}"
        raise InputError("bad-wiring", message, Location(str(file)), hint)
    return {name: pin.removeprefix(mark) for name, pin in wires.items() if pin.startswith(mark)}


def _frame_distance(schedules: Schedules, first: CaptureVerdict, second: CaptureVerdict) -> float | None:
    """Return how far the second chip's frame is from where the wire puts it, in cycles within a frame."""
    rule = schedules[1].wire
    if first.line is None or second.line is None or rule is None or not (first.agrees and second.agrees):
        return None
    begin = (*schedules[0].lead_in, *schedules[0].loop)[0].pulses
    source = next(at for at, channel in enumerate(schedules[0].channels) if channel.pin == rule.source)
    pulse, earliest = begin[source], min(each.rise for each in begin if each)
    if pulse is None:
        return None
    period = schedules[0].period
    asked = rule.frames * period + pulse.rise - earliest + rule.cycles
    late = (second.line.a - float(first.line.steps(asked))) / first.line.b
    return (late + period / 2) % period - period / 2
