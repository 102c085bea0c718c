"""A motion on a tape: its slots, its schedule, and the bytes that hold it.

In: a job with a serial EEPROM. Out: `Taped`, each of whose widths is rounded to the nearest cycle. With
commands the frames of all directions follow those of the stance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from servogen.engines.inputs import given
from servogen.engines.inputs.buttons import ControlButtons, motion_with_wait, with_wait
from servogen.engines.inputs.commands import Commander, commander
from servogen.engines.inputs.tape import SDA, Tape
from servogen.engines.player.layout import SlotLayout, Used, layout
from servogen.engines.player.playing import ideal_widths, plan_error_of, rows_of, warnings_of
from servogen.engines.player.soft_start import with_soft_start
from servogen.engines.protocol import EngineJob
from servogen.engines.tape.bus import Waits
from servogen.engines.tape.content import Content, content
from servogen.errors import Diagnostic, InputError
from servogen.motion import JointTrajectory
from servogen.motion.gait.commands import CommandedDirection
from servogen.pulse.plan import PulsePlan, joined_runs, schedule_of
from servogen.pulse.quantise import NO_PULSE, PARTS
from servogen.pulse.schedule import CommandRule, DirectionRuns, PulseSchedule, TapeRule
from servogen.simulator.eeprom24 import PARTS as EEPROMS
from servogen.units import Cycles


@dataclass(frozen=True, slots=True)
class Taped:
    """A motion as the tape engine plays it; `trajectory` has the lead-in, `tour` all frames of the tape."""

    trajectory: JointTrajectory
    plan: PulsePlan
    layout: SlotLayout
    content: Content
    tape: Tape
    tour: tuple[JointTrajectory, PulseSchedule] | None
    """Where `plan` has only some of them."""
    read: Commander | None
    buttons: ControlButtons

    @property
    def order(self) -> tuple[int, ...]:
        """Return the channels in the order of the C: slot by slot."""
        return self.layout.order


def taped(job: EngineJob) -> Taped:
    """Return the job's motion with its lead-in as a tape, each width rounded to the nearest cycle.

    Raises InputError, also for a motion that the EEPROM does not hold.
    """
    tape = given(job.inputs, Tape)
    if tape is None:
        raise InputError("missing-key", f"{job.name} has no tape", hint="add a table [tape]")
    begun, _ = with_soft_start(job.trajectory, job.servos, job.clock, job.firmware.soft_start_s)
    clock, servos = job.clock, job.servos
    read, buttons = commander(job.inputs), given(job.inputs, ControlButtons) or ControlButtons()
    directions = [each for each in job.directions if read is not None and read.has(each.name)]
    motion = replace(begun, angles=np.vstack((begun.angles, *(each.angles[:-1] for each in directions))))
    ideal = ideal_widths(motion, servos, clock)
    if np.isnan(ideal).all():
        raise InputError("no-pulses", "the motion has no pulse")
    silent = np.isnan(ideal)
    # As in pulse.quantise: smaller differences than a part of a µs are floating-point noise.
    parts = np.round(np.where(silent, 0, ideal) * float(clock.cycle_us) * PARTS) / PARTS
    widths = np.floor(parts / float(clock.cycle_us) + 0.5).astype(np.int64)
    pulsed = widths[~silent.any(axis=1)]
    used = [Used(Cycles(int(channel.min())), Cycles(int(channel.max()))) for channel in pulsed.T]
    waits = Waits.at(clock).reserve(len(servos), steered=read is not None or buttons.any)
    slots = layout(servos, used, job.frame, clock, motion_c=waits)
    rises = [slots.rise(channel) for channel in range(len(servos))]
    error = plan_error_of(motion, servos, widths, ideal, clock)
    pulses = np.where(silent, NO_PULSE, widths)
    whole = schedule_of(motion, servos, slots.period, pulses, rises, error)
    schedule = whole
    if read is not None:
        schedule = replace(
            schedule_of(begun, servos, slots.period, pulses[: len(begun.angles)], rises, error),
            commands=CommandRule(read.rule, tuple(_runs(begun, directions, read, pulses, rises))),
        )
    made = content(schedule, slots.order)
    _check_size(job, whole, made, tape)
    schedule = replace(
        with_wait(schedule, buttons.waiting),
        tape=TapeRule(tape.scl, SDA, tape.eeprom, made.data),
        inputs=(read or buttons).inputs,
        buttons=buttons.rule,
    )
    rows = tuple(rows_of(servos, widths, ideal, clock))
    return Taped(
        motion_with_wait(begun, buttons.waiting),
        PulsePlan(schedule, rows, warnings_of(motion, servos, job.frame, slots)),
        slots,
        made,
        tape,
        (motion, whole) if read is not None else None,
        read,
        buttons,
    )


def _runs(
    begun: JointTrajectory,
    directions: Sequence[CommandedDirection],
    read: Commander,
    pulses: npt.NDArray[np.int64],
    rises: Sequence[Cycles],
) -> Iterator[DirectionRuns]:
    """Yield the frames of each direction, of which `pulses` has those of all after those of `begun`."""
    place = len(begun.angles)
    for direction in directions:
        last = place + len(direction.angles) - 1
        marks = (place, place + direction.first, place + direction.end, last)
        parts = (joined_runs(pulses[first:end], rises) for first, end in pairwise(marks))
        yield DirectionRuns(direction.name, read.selector(direction.name), *parts)
        place = last


def _check_size(job: EngineJob, schedule: PulseSchedule, made: Content, tape: Tape) -> None:
    """Raise InputError for a tape that is longer than its EEPROM."""
    size = EEPROMS[tape.eeprom].size
    if len(made.data) <= size:
        return
    fits = [part for part, memory in EEPROMS.items() if memory.size >= len(made.data)]
    larger = f'eeprom = "{fits[0]}" holds it, or' if fits else "no EEPROM with two address bytes holds it:"
    seconds = _seconds(schedule)
    raise InputError(
        "does-not-fit",
        f"{job.name}: {seconds:.1f} s of motion are {len(made.data)} bytes, and a {tape.eeprom} holds "
        f"{size}, {seconds * size / len(made.data):.1f} s of such motion",
        tape.place,
        f"{larger} shorten the motion",
    )


def _seconds(schedule: PulseSchedule) -> float:
    frames = schedule.lead_in_frames + schedule.loop_frames
    return float(frames * schedule.clock.seconds(schedule.period))


def length_note(made: Taped) -> Diagnostic:
    """Return how much of the EEPROM the motion takes."""
    schedule, size = made.tour[1] if made.tour else made.plan.schedule, EEPROMS[made.tape.eeprom].size
    seconds, taken = _seconds(schedule), len(made.content.data)
    rate = seconds / taken
    text = (
        f"{seconds:.1f} s of motion take {taken} bytes of the {made.tape.eeprom}'s {size}: "
        f"{1024 * rate:.2f} s per kilobyte; {size * rate:.0f} s of such motion fit"
    )
    return Diagnostic("note", "tape-length", text, made.tape.place)
