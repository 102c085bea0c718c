"""What went wrong, in order of time: the first is the cause, the others follow from it.

In: a `Record` and the planned motion. Out: `Event`s.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from servogen.job import PlannedJob
from servogen.twin.bodies import BODY_HEIGHT_M
from servogen.twin.planned import PlannedRoute
from servogen.twin.run import SAMPLE_S, Record
from servogen.units import counted

if TYPE_CHECKING:
    from servogen.answers import TwinEvent

SATURATED_S = 0.06
"""The time with full voltage and no motion after which a servo has reached its limit: three pulses."""

SLOW = 0.1
"""The share of the no-load speed below which a servo hardly moves."""

FULL = 0.999
TILT = math.radians(30)
SUNK = 0.15
"""The share of the planned height by which a body may be lower before it counts as sunk."""

OFF_S = 0.05
"""The time for which a servo may lack planned pulses, in addition to its own `lost_ms`."""


class EventKind(IntEnum):
    """What an event is about; of two at one moment the lower kind is the cause."""

    BROKEN = 0
    NO_PULSES = 1
    SUPPLY = 2
    STOP = 3
    SATURATED = 4
    SUNK = 5
    FALL = 6


@dataclass(frozen=True, slots=True)
class Event:
    """What happened at a time in seconds since power-up; `kind` orders events of one moment."""

    seconds: float
    kind: EventKind
    text: str

    def to_json(self) -> TwinEvent:
        """Return plain values for a JSON file."""
        return {"seconds": self.seconds, "kind": self.kind.name.lower(), "text": self.text}


def run_events(record: Record, job: PlannedJob, planned: PlannedRoute) -> tuple[Event, ...]:
    """Return the events of a run in order of time."""
    events = [
        *_broken_gears(record),
        *_servos_without_pulses(record, job),
        *_supply(record),
        *_stalls(record),
        *_body(record, planned),
    ]
    return tuple(sorted(events, key=lambda event: (round(event.seconds / SATURATED_S), event.kind)))


def brown_out(record: Record) -> float | None:
    """Return when the chip's voltage left its range; None: never, or the chip has a supply of its own."""
    supply = record.rig.supply
    low = np.flatnonzero(record.voltage < supply.chip_minimum_v)
    return float(record.time[low[0]]) if supply.feeds_chip and len(low) else None


def _broken_gears(record: Record) -> Iterator[Event]:
    for servo, wiring in zip(record.rig.servos, record.rig.wirings, strict=True):
        if wiring.broken:
            yield Event(0.0, EventKind.BROKEN, f"{servo.name} turns nothing: its gear is broken")


def _servos_without_pulses(record: Record, job: PlannedJob) -> Iterator[Event]:
    """Yield the servos that are not driven although the plan has pulses for them throughout."""
    planned = ~np.isnan(job.trajectory.angles)
    since = max(OFF_S, record.held_from)
    for index, (servo, column) in enumerate(zip(record.rig.servos, record.rig.columns, strict=True)):
        if not planned[:, column].all():
            continue
        idle = record.time[~record.pulsed[:, index] & (record.time >= since)]
        if len(idle):
            first = float(idle[0])
            when = "at all" if first < since + OFF_S else f"from {first:.2f} s"
            seconds = 0.0 if first < since + OFF_S else first
            yield Event(seconds, EventKind.NO_PULSES, f"{servo.name} receives no pulses {when}")


def _supply(record: Record) -> Iterator[Event]:
    supply = record.rig.supply
    if supply.limit_a is not None:
        samples = np.flatnonzero(record.current >= supply.limit_a * FULL)
        if len(samples):
            stalled = _is_stalled(record)[samples].sum(axis=1)
            most = samples[stalled == stalled.max()]
            middle = int(most[len(most) // 2])
            when, seconds = float(record.time[samples[0]]), float(record.time[middle])
            yield Event(
                when,
                EventKind.SUPPLY,
                f"the supply is at its limit of {supply.limit_a:g} A from {when:.2f} s: with "
                f"{counted(int(stalled.max()), 'stalled servo')} its voltage is "
                f"{record.voltage[middle]:.2f} V at {seconds:.2f} s, "
                f"where {_unlimited_current(record, middle):.1f} A are demanded",
            )
    when_low = brown_out(record)
    if when_low is not None:
        yield Event(
            when_low,
            EventKind.SUPPLY,
            f"the chip's voltage is below {supply.chip_minimum_v:g} V at {when_low:.2f} s: "
            "what follows is not guaranteed",
        )


def _is_stalled(record: Record) -> npt.NDArray[np.bool_]:
    """Return which servos get all the voltage there is and hardly move, in each sample."""
    top = np.array([drive.no_load_speed for drive in record.rig.drives])
    return np.asarray((np.abs(record.duty) >= FULL) & (np.abs(record.speed) < SLOW * top))


def _unlimited_current(record: Record, sample: int) -> float:
    """Return the current in amperes that the servos would draw if the supply had no limit."""
    drives = record.rig.drives
    duty, speed = record.duty[sample], record.speed[sample]
    resistance = np.array([drive.resistance for drive in drives])
    emf = np.array([drive.speed_constant for drive in drives])
    idle = sum(drive.idle_a for drive in drives)
    a, b = float((duty**2 / resistance).sum()), float((duty * speed * emf / resistance).sum())
    return replace(record.rig.supply, limit_a=None).under(idle, a, b)[1]


def _stalls(record: Record) -> Iterator[Event]:
    """Yield each servo that gets all the voltage there is and does not move, the first time."""
    stuck = _is_stalled(record)
    least = max(1, round(SATURATED_S / SAMPLE_S))
    for index, servo in enumerate(record.rig.servos):
        start = _first_run(stuck[:, index], least)
        rig = record.rig
        if start is None or rig.drives[index].continuous or rig.wirings[index].broken:
            continue
        when = float(record.time[start])
        torque = float(np.abs(record.torque[start : start + least, index]).max())
        error = math.degrees(float(np.abs(record.target - record.angle)[start + least - 1, index]))
        yield Event(
            when,
            EventKind.SATURATED,
            f"{servo.name} saturates at {torque:.2f} N·m from {when:.2f} s, {error:.1f}° from its target",
        )


def _first_run(flags: npt.NDArray[np.bool_], least: int) -> int | None:
    """Return where the first run of at least that many True begins."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    for start, end in edges.reshape(-1, 2).tolist():
        if end - start >= least:
            return int(start)
    return None


def _body(record: Record, planned: PlannedRoute) -> Iterator[Event]:
    """Yield that the body sinks below its planned height, tilts or lies on the ground."""
    if planned.height is None:
        return
    height = record.pose[:, 2] - record.settings.ground.level
    height = np.where(record.time < record.held_from, planned.height, height)
    low = np.flatnonzero(height < (1 - SUNK) * planned.height)
    if len(low):
        when = float(record.time[low[0]])
        yield Event(
            when,
            EventKind.SUNK,
            f"the body sinks from {when:.2f} s: to {1000 * height.min():.0f} mm "
            f"instead of {1000 * planned.height:.0f} mm",
        )
    fallen = fall_time(record)
    if fallen is not None:
        yield Event(fallen, EventKind.FALL, f"the robot falls at {fallen:.2f} s")


def fall_time(record: Record) -> float | None:
    """Return when the body first lies on the ground or is tilted by 30°; None: it never falls."""
    lying = np.zeros(len(record.time), bool)
    if record.floating and record.feet.shape[1]:
        lying = record.pose[:, 2] - record.settings.ground.level < BODY_HEIGHT_M / 2 + 0.002
    down = np.flatnonzero((lying | (record.tilt > TILT)) & (record.time >= record.held_from))
    return float(record.time[down[0]]) if len(down) else None
