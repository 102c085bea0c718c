"""The player of a job: its motion as the player plays it; `firmware` has the C."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

from servogen.engines.firmware import DIALECTS, Firmware, ResourceError
from servogen.engines.inputs import given
from servogen.engines.inputs.buttons import ControlButtons, motion_with_wait, with_wait
from servogen.engines.inputs.commands import commander
from servogen.engines.inputs.wire import RESTART_CYCLES, FrameWire, quiet_cycles
from servogen.engines.player import Playing, playing
from servogen.engines.player.commanded import commanded
from servogen.engines.player.legs import LONGEST
from servogen.engines.player.playing import BUTTONS_BYTES, COMMANDS_BYTES, DATA_BYTES, NEAR, leg_channels
from servogen.engines.player.soft_start import with_soft_start
from servogen.engines.protocol import Engine, EngineJob, EnginePlan
from servogen.engines.stored_script import eeprom_room
from servogen.errors import Diagnostic, InputError
from servogen.motion import JointTrajectory
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import WireRule
from servogen.units import Cycles

HALVES_BYTES = 200
"""By how much poses in two tables may be larger, at most: their C is shorter than that of a walk by legs."""
EEPROM_C = 16
"""The words of the C, at most, that reads a script from the EEPROM and the table before it."""


def play(
    job: EngineJob,
    max_error_us: float | None = None,
    more_bytes: int = 0,
    *,
    bends: bool = True,
    halves: bool = False,
    balanced: bool = False,
) -> tuple[JointTrajectory, Playing, PulseSchedule]:
    """Return the motion with its lead-in, as the player plays it, and all frames that it can play.

    The player encodes it for errors of up to `max_error_us`, by default the job's. Its tables may be larger
    by `more_bytes` than those that fit flash beside the program; without `bends` no calibration has a knee;
    poses may lie in two tables of `halves` of rows, and those be `balanced`.
    Raises InputError or ResourceError.
    """
    buttons = given(job.inputs, ControlButtons) or ControlButtons()
    line, wire = commander(job.inputs), given(job.inputs, FrameWire)
    begun, ends = with_soft_start(job.trajectory, job.servos, job.clock, job.firmware.soft_start_s)
    followed = wire if wire is not None and wire.follows else None
    if followed:
        joining = followed.joining_frames
        begun = begun.without(joining)
        ends = tuple(end - joining for end in ends if end > joining)
    if line is not None:
        _check_soft_start(job, ends)
        maximum = DATA_BYTES - COMMANDS_BYTES + more_bytes
        played, tour = commanded(
            begun, job.directions, line, job.servos, job.bindings, job.frame, ends, maximum
        )
        return begun, played, tour
    played = playing(
        begun,
        job.servos,
        job.frame,
        bindings=job.bindings,
        soft=ends,
        max_error_us=job.firmware.max_error_us if max_error_us is None else max_error_us,
        max_bytes=DATA_BYTES - (BUTTONS_BYTES if buttons.any else 0) + more_bytes,
        bends=bends,
        halves=halves,
        balanced=balanced,
        wire=followed,
    )
    waiting = with_wait(played.plan.schedule, buttons.waiting)
    schedule = replace(
        waiting,
        inputs=buttons.inputs,
        buttons=buttons.rule,
        wire=_rule(followed, played) if followed else None,
    )
    plan = replace(played.plan, schedule=schedule)
    return motion_with_wait(played.trajectory, buttons.waiting), replace(played, plan=plan), schedule


def _rule(wire: FrameWire, played: Playing) -> WireRule:
    quiet = quiet_cycles(Cycles(played.layout.period + played.layout.early))
    rule = WireRule(wire.pin, wire.other, wire.joining_frames, played.layout.after_rise, quiet)
    rule = replace(rule, crystal_ppm=wire.crystal_ppm)
    return replace(rule, restart=wire.restart, pulled=RESTART_CYCLES) if wire.restart else rule


def _check_soft_start(job: EngineJob, ends: Sequence[int]) -> None:
    """Raise InputError if a part of the soft start lasts longer than a step of a walk."""
    if ends and ends[0] > LONGEST:
        period_s = job.clock.seconds(job.trajectory.period)
        raise InputError(
            "out-of-range",
            f"a soft start of {float(job.firmware.soft_start_s):g} s is {ends[0]} frames",
            job.firmware.soft_start_place,
            f"before a walk on command it has at most {LONGEST} frames, {float(LONGEST * period_s):.4g} s",
        )


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A motion as the player plays it, and all frames that it can play; `make` compiles each dialect once."""

    motion: JointTrajectory
    played: Playing
    whole: PulseSchedule
    make: Callable[[str], Firmware]

    @property
    def error_us(self) -> float:
        return self.played.plan.schedule.plan_error_us

    @property
    def rounding_us(self) -> float:
        """Return the error that the rounding of bytes and the sharing of rows alone may cause."""
        encoded, clock = self.played.encoded, self.played.plan.schedule.clock
        return (0.5 + NEAR[0]) * float((1 << int(encoded.scale.shifts.max())) * clock.cycle_us)

    def fits(self, *dialects: str) -> bool:
        try:
            for dialect in dialects:
                self.make(dialect)
        except ResourceError:
            return False
        return True


def _candidate(job: EngineJob, max_error_us: float, **choices: Any) -> _Candidate:
    motion, played, whole = play(job, max_error_us, **choices)

    @cache
    def make(dialect: str) -> Firmware:
        from servogen.engines.player.firmware import compiled  # the compiler: only to make the firmware

        return compiled(job, played, dialect)

    return _Candidate(motion, played, whole, make)


def _within(job: EngineJob, limit: float) -> _Candidate:
    """Return the motion of the first way to hold it that is within `limit` of its plan, or of the first way
    at all. Raises InputError, or ResourceError if no way holds it.
    """
    # A script in the EEPROM leaves the tables more room in flash, at the cost of the C that reads it.
    ways: list[Callable[[EngineJob, float], _Candidate]]
    ways = [_candidate, partial(_candidate, more_bytes=eeprom_room(len(job.servos)) - EEPROM_C)]
    if commander(job.inputs) is None:
        ways.append(_in_halves)
        if not leg_channels(job.servos, job.bindings):  # legs of two servos are rarely held better by poses
            ways.append(partial(_candidate, balanced=True))
    first: _Candidate | None = None
    held: _Candidate | None = None
    refused: ResourceError | None = None
    for way in ways:
        try:
            candidate = way(job, limit)
        except ResourceError as error:
            refused = error
            continue
        # Two tables may be more than flash holds, in some dialects only.
        if candidate.error_us <= limit and (way in ways[:2] or candidate.fits(*DIALECTS)):
            return candidate
        if held is None and candidate.error_us <= limit and candidate.fits(job.firmware.dialect):
            held = candidate
        first = first or candidate
    best = held or first
    if best is None:
        assert refused is not None
        raise refused
    return best


def _in_halves(job: EngineJob, limit: float) -> _Candidate:
    """Return the motion with poses in two tables, as close to its plan as flash allows. Raises InputError,
    ResourceError.
    """
    more_bytes, best = HALVES_BYTES, None
    while True:
        candidate = _candidate(job, limit, more_bytes=more_bytes, halves=True)
        size = candidate.played.encoded.size - DATA_BYTES
        if candidate.error_us <= limit and candidate.fits(job.firmware.dialect):
            return candidate
        if best is None or candidate.error_us <= limit:
            best = candidate
        if size > more_bytes:  # there is no smaller one
            return best
        more_bytes = size - 1


def _closest(job: EngineJob, usual: _Candidate) -> _Candidate:
    """Return the motion as close to its plan as flash allows, unless rounding alone decides its error."""
    best, limit = usual, job.firmware.max_error_us
    while best.rounding_us < best.error_us <= limit:
        legs = best.played.encoded.legs is not None
        limit = best.rounding_us if legs else limit / 2
        try:
            closer = _candidate(job, limit)
        except (InputError, ResourceError):
            break
        size = closer.played.encoded.size
        if closer.error_us >= best.error_us or size > DATA_BYTES or not closer.fits(job.firmware.dialect):
            break
        best = closer
        if legs:
            break
    return best


def _closest_note(usual: _Candidate, closest: _Candidate) -> Diagnostic:
    """Return the note about a motion that is closer to its plan than its job asks for."""
    figures = [
        f"{candidate.error_us:g} µs, {candidate.played.encoded.size} bytes of motion"
        for candidate in (closest, usual)
    ]
    return Diagnostic(
        "note",
        "closest",
        f"max_error_us is not stated: the motion is as close to its plan as flash allows, {figures[0]}; "
        f"with max_error_us = 10: {figures[1]}",
    )


class PlayerEngine:
    """Plays poses from flash, moving between them by laws computed on the chip."""

    title = "the player"

    def plan(self, job: EngineJob) -> EnginePlan:
        """Plan the job's frames; a dialect's C is compiled when its firmware is requested."""
        limit, dialect = job.firmware.max_error_us, job.firmware.dialect
        candidate = _within(job, limit)
        if candidate.played.encoded.scale.bent and not candidate.fits(dialect):
            # No room for the knees: the caller says how far the pulses are off.
            candidate = _candidate(job, limit, bends=False)
        notes: tuple[Diagnostic, ...] = ()
        if job.firmware.precise and commander(job.inputs) is None:
            usual, candidate = candidate, _closest(job, candidate)
            notes = (_closest_note(usual, candidate),) if candidate is not usual else ()
        played = candidate.played
        tour = None if played.chain is None else (played.trajectory, candidate.whole)
        return EnginePlan(candidate.motion, played.plan, candidate.make, played.encoded.size, tour, notes)


ENGINE: Engine = PlayerEngine()
