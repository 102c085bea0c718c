"""Advice for a job whose motion does not fit: what each part takes, and changes that make it fit.

In: a planned job and the error that refused it. Out: the same error; its hint and its details state what each
part of the motion takes of the tables, and of the frame if the pulses do not fit it; the changes with which
the job can be built, each of them planned and compiled for the job's dialect; and the size of each segment of
a walk by itself.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from servogen.compiler import WORDS_NEEDED
from servogen.edges import PINS
from servogen.engines.firmware import ResourceError
from servogen.engines.player.layout import Demand
from servogen.engines.player.playing import leg_channels
from servogen.engines.player.shares import Shares, shares
from servogen.engines.registry import suitable
from servogen.errors import InputError, ServogenError
from servogen.job import PlannedJob, plan_job
from servogen.job.reader import AUTO, changed
from servogen.job.schema import MotionTable, WalkTable
from servogen.pic.device import OPEN_DRAIN_PIN, PROGRAM_WORDS
from servogen.robot.servo import Servo
from servogen.toml.locations import Key
from servogen.units import counted
from servogen.workflows.engines import PlayedJob, chip_jobs, planned

if TYPE_CHECKING:
    from servogen.answers import AdviceAnswer, ShortestFrame, UseAnswer

CODES = ("frame-too-short", "does-not-fit", "beyond-max-error", "widths-too-far-apart")
"""The codes of errors for which changes are tried."""

PERIODS_US = (20_480, 21_000, 22_000, 23_000, 25_000, 30_000)
"""Longer periods that most servos accept, the shortest first."""

MAX_POSES = 500
"""The maximum number of poses for which changes are tried: half as many still take four of 1024 words
each.
"""

MAX_S = 300.0
"""The time after which no further change is tried."""

MAX_PARTS = 6
"""The number of parts that are shown one by one, the largest ones."""

SLOWER = (1.25, 1.5, 2.0)
LOWER = (0.75, 0.5)
SHORTER = (0.75, 0.5, 0.35, 0.25)
"""Factors of a cycle's time, of the lift and of the steps that are tried, the smallest change first."""

CAP_US = 10
"""The step, in µs, in which shorter pulses are tried."""

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class JobChange:
    """Other values for keys of the job, and the notation of the change."""

    edits: Mapping[Key, object]
    text: str


@dataclass(frozen=True, slots=True)
class ResourceUse:
    """The resources of a job that can be built; of two chips the words of the larger program."""

    words: int
    data: int
    error_us: float
    chips: int = 1

    def text(self) -> str:
        each = "" if self.chips == 1 else " or fewer each"
        return f"{self.data} bytes of motion, {self.words} words{each}, {self.error_us:g} µs"

    def to_json(self) -> UseAnswer:
        """Return the resources as a value that JSON can hold."""
        return {"motion_bytes": self.data, "words": self.words, "error_us": self.error_us}


@dataclass(frozen=True, slots=True)
class TriedChange:
    """A change and the resources of the job with it; without them it does not fit."""

    text: str
    fit: ResourceUse | None


@dataclass(slots=True)
class Advice:
    """What an adviser found; `omitted` changes were not tried because time was up."""

    job: PlannedJob
    error: ServogenError
    shares: Shares | None = None
    proposals: list[TriedChange] = field(default_factory=list)
    segments: list[TriedChange] = field(default_factory=list)
    omitted: bool = False

    @property
    def frame_is_short(self) -> bool:
        return self.error.code == "frame-too-short"

    @property
    def words(self) -> int | None:
        """Return the words of flash that the program needs; None if it was not compiled or fits."""
        needed = self.error.details.get(WORDS_NEEDED)
        return needed if isinstance(needed, int) else None

    def text(self) -> str:
        """Return the advice as lines; empty if there is none."""
        lines = []
        if self.shares is not None:
            lines += [f"by part: {_parts_text(self.shares)}"]
            if self.words is not None:
                others = self.words - self.shares.bytes
                whole = f"{self.words} of {PROGRAM_WORDS}"
                lines += [f"of the words: the motion {self.shares.bytes}, all else {others}: {whole}"]
            if self.frame_is_short:
                lines += [f"of the frame: {self._frame_text(self.shares)}"]
        texts = [f"{trial.text} ({self._fit_text(trial.fit)})" for trial in self.proposals if trial.fit]
        if texts:
            lines.append(f"what fits: {'; or '.join(texts)}")
        if self.segments:
            alone = (
                f"{trial.text} alone {'does not fit' if trial.fit is None else f'takes {trial.fit.text()}'}"
                for trial in self.segments
            )
            lines.append(f"by segment: {'; '.join(alone)}")
        if self.omitted:
            lines.append(f"after {MAX_S:g} s no further changes were tried")
        return "\n  ".join(lines)

    def _fit_text(self, fit: ResourceUse) -> str:
        less = self.shares.bytes - fit.data if self.shares is not None else 0
        return f"{counted(less, 'byte')} less: {fit.text()}" if less > 0 else fit.text()

    def _frame_text(self, shares: Shares) -> str:
        demand, us = frame_demand(self.job, shares), self.job.clock.us
        slots = (f"{_names(self.job, slot)} {float(us(cycles)):g}" for slot, cycles in demand.slots)
        whole = f"{float(us(demand.minimum)):g} of {float(self.job.frame.period.achieved_us):g} µs"
        return f"{', '.join(slots)}, the C for the next frame {float(us(demand.frame_c)):g}: {whole}"

    def to_json(self) -> AdviceAnswer:
        """Return the advice as a value that JSON can hold."""
        job = self.job
        frame: ShortestFrame | None = None
        if self.shares is not None and self.frame_is_short:
            demand = frame_demand(job, self.shares)
            frame = {
                "slots": [
                    {"servos": [job.servos[channel].name for channel in slot], "us": _us(job, cycles)}
                    for slot, cycles in demand.slots
                ],
                "c_us": _us(job, demand.frame_c),
                "minimum_us": _us(job, demand.minimum),
                "period_us": float(job.frame.period.achieved_us),
            }
        return {
            "parts": [part.to_json() for part in self.shares.parts] if self.shares else [],
            "motion_bytes": self.shares.bytes if self.shares else None,
            "words": self.words,
            "frame": frame,
            "proposals": [
                {"change": trial.text, **trial.fit.to_json()} for trial in self.proposals if trial.fit
            ],
            "segments": [
                {"segment": trial.text, "fits": trial.fit.to_json() if trial.fit else None}
                for trial in self.segments
            ],
            "stopped_early": self.omitted,
        }


def frame_demand(job: PlannedJob, shares: Shares) -> Demand:
    """Return what the shortest frame of the job's pulses consists of."""
    return shares.frame(job.servos, job.frame, job.clock)


def _us(job: PlannedJob, cycles: int) -> float:
    return float(job.clock.cycle_us * cycles)


def _names(job: PlannedJob, slot: tuple[int, ...]) -> str:
    return " and ".join(job.servos[channel].name for channel in slot)


def _parts_text(shares: Shares) -> str:
    """Return the largest parts, and the sum of the others."""
    order = sorted(shares.parts, key=lambda part: -part.bytes)
    shown = [part for part in shares.parts if part in order[:MAX_PARTS]]
    texts = [
        f"{part.name}: {part.bytes} of {shares.bytes} bytes"
        + (f", {part.error_us:g} µs" if part.error_us is not None else "")
        for part in shown
    ]
    others = order[MAX_PARTS:]
    if others:
        texts.append(f"{counted(len(others), 'other')}: {sum(part.bytes for part in others)}")
    return "; ".join(texts)


def with_advice(
    job: PlannedJob,
    error: ServogenError,
    progress: Progress = lambda step: None,
    now: Callable[[], float] = time.monotonic,
) -> ServogenError:
    """Return the error with advice in its hint and its details, if there is any.

    `progress` is called with each change before it is tried; `now` returns the time in seconds.
    """
    section = job.section
    if error.code not in CODES or (isinstance(section, MotionTable) and len(section.poses) > MAX_POSES):
        return error
    end = now() + MAX_S
    advice = Advice(job, error, table_shares(job))
    for group in change_groups(job, error, advice.shares):
        for change in group:
            if now() > end:
                advice.omitted = True
                break
            progress(f"trying {change.text}")
            fit = tried_fit(job, change)
            if fit is not None:
                advice.proposals.append(TriedChange(change.text, fit))
                break
    for change in _segments(job):
        if now() > end:
            advice.omitted = True
            break
        progress(f"trying {change.text} alone")
        advice.segments.append(TriedChange(change.text, tried_fit(job, change)))
    text = advice.text()
    if not text:
        return error
    with_advice = copy(error)
    with_advice.diagnostics = (replace(error.first, hint=text),)
    with_advice.details = {**error.details, "advice": advice.to_json()}
    return with_advice


def table_shares(job: PlannedJob) -> Shares | None:
    """Return what the parts of the motion take in the player; None if it cannot be encoded at all, and for a
    job of another engine.
    """
    if "player" not in suitable({each.kind for each in job.inputs}) or job.firmware.engine not in (
        AUTO,
        "player",
    ):
        return None
    try:
        return shares(job)
    except (InputError, ResourceError):
        return None


def change_groups(job: PlannedJob, error: ServogenError, shares: Shares | None) -> Iterator[list[JobChange]]:
    """Yield groups of changes of the same kind, the smallest change first."""
    section = job.section
    period_us = float(job.frame.period.requested_us)
    longer = [value for value in PERIODS_US if value > period_us]
    if error.code == "frame-too-short":
        yield [JobChange({("frame", "period_us"): value}, f"period_us = {value}") for value in longer]
        if shares is not None:
            yield list(_limits_as_used(job, shares))
            if isinstance(section, MotionTable):
                yield list(_shorter_pulses(job, shares))
    if isinstance(section, WalkTable):
        yield from _walk_changes(job, section, error.code)
    if isinstance(section, MotionTable) and len(section.poses) > 1:
        poses = job.document.data["motion"]["poses"]
        counts = sorted({len(poses) * 3 // 4, len(poses) // 2} - {0}, reverse=True)
        yield [
            JobChange({("motion", "poses"): poses[:count]}, f"only the first {counted(count, 'pose')}")
            for count in counts
        ]
    by_legs = bool(leg_channels(job.servos, job.bindings))
    if isinstance(section, WalkTable) and not by_legs:
        yield list(_shorter_steps(job))
        yield list(_two_chips(job))
    limit = job.firmware.max_error_us
    if error.code == "beyond-max-error" or not (isinstance(section, WalkTable) and by_legs):
        larger = sorted({math.ceil(limit * factor) for factor in (1.25, 1.5, 2, 3, 4)})
        yield [
            JobChange({("firmware", "max_error_us"): value}, f"max_error_us = {value}") for value in larger
        ]


def _walk_changes(job: PlannedJob, walk: WalkTable, code: str) -> Iterator[list[JobChange]]:
    period_s = float(job.clock.seconds(job.trajectory.period))
    if walk.cycle_s is not None:
        slower = [round(math.ceil(walk.cycle_s * factor / period_s) * period_s, 4) for factor in SLOWER]
        yield [JobChange({("walk", "cycle_s"): value}, f"cycle_s = {value:g}") for value in slower]
    if code != "does-not-fit":  # a lift takes the same bytes whatever its height
        lower = [round(walk.lift_mm * share, 1) for share in LOWER]
        yield [JobChange({("walk", "lift_mm"): value}, f"lift_mm = {value:g}") for value in lower]
    if walk.gait != "tripod" and walk.duty is None:
        yield [JobChange({("walk", "gait"): "tripod"}, 'gait = "tripod"')]
    if len(walk.route) > 1:
        route = tuple(job.document.data["walk"]["route"])
        yield [
            JobChange(
                {("walk", "route"): route[:count]},
                f"only the first {counted(count, 'segment')} of the route",
            )
            for count in range(len(route) - 1, 0, -1)
        ]
    if walk.commands is not None and walk.commands.forward_mm and walk.commands.turn_deg:
        asked = job.document.data["walk"]["commands"]
        yield [
            JobChange(
                {("walk", "commands"): {key: value for key, value in asked.items() if key != without}},
                f"commands without {without}",
            )
            for without in ("turn_deg", "forward_mm")
        ]


def _shorter_steps(job: PlannedJob) -> Iterator[JobChange]:
    """Yield routes of shorter steps."""
    route = job.document.data["walk"]["route"]
    for share in SHORTER:
        edits: dict[Key, object] = {}
        for number, segment in enumerate(route):
            for key in ("forward_mm", "left_mm", "turn_deg"):
                if segment.get(key):
                    edits["walk", "route", number, key] = round(share * segment[key], 1)
        values = (f"{key[-1]} = {value:g}{_of_segment(key[2], route)}" for key, value in edits.items())
        yield JobChange(edits, ", ".join(values))


def _of_segment(number: object, route: Sequence[object]) -> str:
    return f" in segment {int(str(number)) + 1}" if len(route) > 1 else ""


def _two_chips(job: PlannedJob) -> Iterator[JobChange]:
    """Yield two chips, the first one with the first half of the servos, for the motion and for less of it."""
    half = len(job.servos) // 2
    if job.chips or job.inputs or not half:
        return
    parts = job.servos[:half], job.servos[half:]
    wires = [each.pin for each in parts[0] if each.pin != OPEN_DRAIN_PIN]
    free = [pin for pin in PINS if pin not in {each.pin for each in parts[1]}]
    if not wires or not free or job.firmware.engine not in (AUTO, "player"):
        return
    chip = job.document.data["chip"]
    pair = [
        {**chip, "wire": wire, "servos": tuple(each.name for each in part)}
        for wire, part in zip((wires[0], free[0]), parts, strict=True)
    ]
    edits: dict[Key, object] = {("chip",): tuple(pair), ("firmware", "engine"): "player"}
    text = f"two chips ([[chip]] twice), {parts[1][0].name} and those after it on the second"
    yield JobChange(edits, text)
    route = tuple(job.document.data["walk"]["route"])
    for count in range(len(route) - 1, 0, -1):
        first = f"only the first {counted(count, 'segment')} of the route"
        yield JobChange({**edits, ("walk", "route"): route[:count]}, f"{text}, and {first}")


def _limits_as_used(job: PlannedJob, shares: Shares) -> Iterator[JobChange]:
    """Yield limits at the angles of the longest pulses, for as many servos as the frame needs, those with the
    longest pulses first: a slot keeps no margin beyond a limit.
    """
    order = sorted(
        range(len(job.servos)), key=lambda index: (-shares.pulses[index].longest, job.servos[index].name)
    )
    servos = list(job.servos)
    edits: dict[Key, object] = {}
    names = []
    for index in order:
        servo = servos[index]
        limit = _limit(servo, _angle_of_longest(job, index), outward=True)
        if limit is None:
            continue
        key, degrees = limit
        servos[index] = _with_limit(servo, key, degrees)
        edits["servo", index, key] = degrees
        names.append(f"{servo.name} {key} = {degrees:g}")
        if shares.frame(servos, job.frame, job.clock).minimum <= job.frame.period.cycles:
            yield JobChange(edits, ", ".join(names))
            return


def _shorter_pulses(job: PlannedJob, shares: Shares) -> Iterator[JobChange]:
    """Yield limits, and poses within them, for which the longest pulses fit the frame."""
    longest = [float(job.clock.us(used.longest)) for used in shares.pulses]
    poses = job.document.data["motion"]["poses"]
    if any(key in pose for pose in poses for key in ("tip_mm", "foot_mm")):
        return
    for cap in range(int(max(longest)) // CAP_US * CAP_US, int(min(longest)) // 2, -CAP_US):
        short = [
            replace(used, longest=min(used.longest, job.clock.round_us(cap).cycles)) for used in shares.pulses
        ]
        servos = [
            _shorter_servo(servo, cap) if width > cap else servo
            for servo, width in zip(job.servos, longest, strict=True)
        ]
        shorter = replace(shares, pulses=tuple(short)).frame(servos, job.frame, job.clock)
        if shorter.minimum <= job.frame.period.cycles:
            yield from _cap_change(job, [index for index, width in enumerate(longest) if width > cap], cap)
            return


def _cap_change(job: PlannedJob, servos: list[int], cap_us: int) -> Iterator[JobChange]:
    """Yield the change that limits these servos to pulses of `cap_us`, and their poses with them."""
    poses = job.document.data["motion"]["poses"]
    edits: dict[Key, object] = {}
    names: dict[tuple[str, float], list[str]] = {}
    for index in servos:
        servo = job.servos[index]
        limit = _limit(servo, servo.angle(cap_us), outward=False)
        if limit is None:
            return
        key, degrees = limit
        edits["servo", index, key] = degrees
        names.setdefault(limit, []).append(servo.name)
        keep = max if key == "min_deg" else min
        for number, pose in enumerate(poses):
            angle = pose.get(f"{servo.name}_deg")
            if angle is not None and keep(angle, degrees) != angle:
                edits["motion", "poses", number, f"{servo.name}_deg"] = degrees
    limits = ", ".join(
        f"{key} = {degrees:g} of {', '.join(owners)}" for (key, degrees), owners in names.items()
    )
    yield JobChange(edits, f"{limits}, and no pose beyond")


def _shorter_servo(servo: Servo, width_us: float) -> Servo:
    """Return the servo with pulses of at most `width_us`."""
    limit = _limit(servo, servo.angle(width_us), outward=False)
    return servo if limit is None else _with_limit(servo, *limit)


def _with_limit(servo: Servo, key: str, degrees: float) -> Servo:
    """Return the servo with `degrees` for one of its limits, min_deg or max_deg."""
    low, high = servo.limits
    angle = math.radians(degrees)
    return replace(servo, limits=(angle, high) if key == "min_deg" else (low, angle))


def _angle_of_longest(job: PlannedJob, index: int) -> float:
    """Return the angle at which a servo's pulse is longest, in radians."""
    planned_angles = (job.trajectory.angles, *(direction.angles for direction in job.directions))
    angles = np.concatenate([angles_of_plan[:, index] for angles_of_plan in planned_angles])
    end = np.nanmax if _longer_upwards(job.servos[index]) else np.nanmin
    return float(end(angles))


def _longer_upwards(servo: Servo) -> bool:
    """Return whether a larger angle needs a longer pulse."""
    return servo.width_us(servo.limits[1]) > servo.width_us(servo.limits[0])


def _limit(servo: Servo, angle: float, *, outward: bool) -> tuple[str, float] | None:
    """Return the limit of the longest pulses, key and tenths of a degree, next to an angle in radians.

    It allows the angle if `outward`. The result is None for wheels, and if the servo's own limits are
    narrower.
    """
    if servo.model.continuous:
        return None
    upwards = _longer_upwards(servo)
    tenths = round(10 * math.degrees(angle), 6)
    degrees = (math.ceil(tenths) if upwards == outward else math.floor(tenths)) / 10
    inside = math.degrees(servo.limits[0]) < degrees < math.degrees(servo.limits[1])
    return ("max_deg" if upwards else "min_deg", degrees) if inside else None


def tried_fit(job: PlannedJob, change: JobChange) -> ResourceUse | None:
    """Return the resources of the changed job; None if it cannot be built."""
    try:
        other = plan_job(changed(job, change.edits))
        parts = [planned(each) for each in (chip_jobs(other) if other.chips else (other,))]
        taken = [each for part in parts if (each := _resource_use(part)) is not None]
    except ServogenError:
        return None
    if len(taken) < len(parts) or len({part.plan.schedule.period for part in parts}) > 1:
        return None
    words, data, errors = zip(*((each.words, each.data, each.error_us) for each in taken), strict=True)
    return ResourceUse(max(words), sum(data), max(errors), len(parts))


def _resource_use(played: PlayedJob) -> ResourceUse | None:
    firmware = played.make(played.job.firmware.dialect)
    if any(room.left is None or room.left < 0 for room in firmware.timing_budgets):
        return None
    return ResourceUse(firmware.compilation.words, played.data_bytes, played.plan.schedule.plan_error_us)


def _segments(job: PlannedJob) -> Iterator[JobChange]:
    """Yield each segment of a walk's route by itself."""
    if not isinstance(job.section, WalkTable) or len(job.section.route) < 2:
        return
    for number, segment in enumerate(job.document.data["walk"]["route"], 1):
        yield JobChange({("walk", "route"): (segment,)}, f"segment {number}")
