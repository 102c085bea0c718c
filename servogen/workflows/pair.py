"""A job of two chips -> two builds, run in one time with the wire between them, and the verdict on both.

In: a planned job with two chips. Out: `PairBuild`, and a folder with `chip1/`, `chip2/` and one report. Both
count from the same power-up.

    chip 1 ──▶ edges ──▶ its schedule
                 └ the wire's pin ──▶ chip 2 ──▶ edges ──▶ its schedule, and how far from the first one's
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from servogen.edges import HIGH, OTHER_PINS, PINS, EdgeTrace, join, part
from servogen.engines.board import paired_machine
from servogen.engines.firmware import Firmware, ResourceError
from servogen.errors import InputError
from servogen.job import PlannedJob
from servogen.outputs import write_text
from servogen.pic.image import Image
from servogen.plan_error import plan_text
from servogen.programs import PAIR_FOLDERS, is_built_pair, read_pair
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import WireRule
from servogen.report.pair import PairFacts, crystals_text, pair_page, restart_text
from servogen.units import Cycles
from servogen.verify import Verdict, verdict_lines
from servogen.workflows.advice import with_advice
from servogen.workflows.engines import PlayedJob, chip_jobs, planned
from servogen.workflows.job_build import Build, build_alone, write
from servogen.workflows.own_crystals import Jitter, jitter, limit_runs
from servogen.workflows.pair_proof import PairProof, prove_pair
from servogen.workflows.verification import checked_cycles, judge_edges

if TYPE_CHECKING:
    from servogen.answers import PairBuildFacts, PairVerdictAnswer

ONE_RUN = "This is one run of each pair."
SEVERAL_RUNS = "These are {} runs of each pair: the crystals equal, and at opposite limits, both ways."


@dataclass(frozen=True, slots=True)
class PairVerdict:
    """The verdicts on two chips that run in one time, and how far the second one's first edge is from where
    the wire puts it: None if one of them never begins. With a crystal each these are of the first run that is
    not exact, else of the last one; `jitter` is of all.
    """

    chips: tuple[Verdict, Verdict]
    apart: int | None
    jitter: Jitter | None = None

    @property
    def exact(self) -> bool:
        return self.apart == 0 and all(verdict.passed for verdict in self.chips)

    def summary(self) -> str:
        """Return the verdict on both in a line."""
        apart = (
            "chip2 and chip1 do not both begin"
            if self.apart is None
            else f"chip2 is {self.apart:+d} cycles from the wire's frame"
            if self.apart
            else "chip2 keeps the wire's frame: 0 cycles apart"
            if self.jitter is None
            else self.jitter.text()
        )
        runs = "one run" if self.jitter is None else f"{self.jitter.runs} runs, each in its own cycles"
        return f"both chips: {'exact' if self.exact else 'NOT exact'} in {runs}; {apart}"

    def lines(self) -> list[str]:
        """Return the verdict as text, that on both first."""
        parts = [
            f"{name}: {line}"
            for name, verdict in zip(PAIR_FOLDERS, self.chips, strict=True)
            for line in verdict_lines(verdict)
        ]
        return [self.summary(), *parts]

    def to_json(self) -> PairVerdictAnswer:
        return {
            "exact": self.exact,
            "apart_cycles": self.apart,
            "jitter": None if self.jitter is None else self.jitter.to_json(),
            "chips": [verdict.to_json() for verdict in self.chips],
        }


@dataclass(frozen=True, slots=True)
class PairBuild:
    """The builds of both chips; of each dialect that both have, the verdict on its two programs."""

    job: PlannedJob
    chips: tuple[Build, Build]
    verdicts: Mapping[str, PairVerdict]

    @property
    def exact(self) -> bool:
        return all(verdict.exact for verdict in self.verdicts.values())

    def lines(self, folder: Path) -> list[str]:
        """Return what a terminal shows: the verdicts, the words, and where the rest is."""
        verdicts = [f"{dialect}: {verdict.summary()}" for dialect, verdict in self.verdicts.items()]
        return [
            *verdicts,
            *self.programs(),
            f"wiring and every servo: {folder / 'report.html'}, report.txt",
            self.ran(folder),
        ]

    @property
    def runs(self) -> int:
        """Return how many runs of each pair the verdicts are about."""
        return next((verdict.jitter.runs for verdict in self.verdicts.values() if verdict.jitter), 1)

    def ran(self, folder: Path | str) -> str:
        """Return how many runs the verdicts are about, and which command covers all others."""
        said = ONE_RUN if self.runs == 1 else SEVERAL_RUNS.format(self.runs)
        return f"{said} What holds for every power-up and wire: servogen prove {folder}."

    def programs(self) -> list[str]:
        """Return the size of each chip's programs, and how far its schedule is from the plan."""
        rows = []
        for name, build in zip(PAIR_FOLDERS, self.chips, strict=True):
            words = ", ".join(f"{each.firmware.dialect} {each.image.words}" for each in build.programs)
            rows.append(f"{name}: words: {words}; {plan_text(build.plan.schedule.plan_error)}")
        return rows

    def proofs(self) -> dict[str, PairProof]:
        """Return what is proven of both programs of each dialect. Raises ToolError."""
        first, second = self.chips
        schedules = first.plan.schedule, second.plan.schedule
        leads, follows = _images(first), _images(second)
        return {
            dialect: prove_pair(schedules, (leads[dialect], follows[dialect])) for dialect in self.verdicts
        }

    def to_json(self) -> PairBuildFacts:
        return {
            "job": self.job.name,
            "exact": self.exact,
            "chips": [chip.to_json() for chip in self.chips],
            "pairs": {dialect: verdict.to_json() for dialect, verdict in self.verdicts.items()},
        }


@dataclass(frozen=True, slots=True)
class PlayedPair:
    """Both chips of a job as their engine plays them, and `job`, the whole robot with both motions: a servo
    has no angle in the frames in which its chip has no pulses yet.
    """

    job: PlannedJob
    chips: tuple[PlayedJob, PlayedJob]

    @property
    def schedules(self) -> tuple[PulseSchedule, PulseSchedule]:
        first, second = self.chips
        return first.plan.schedule, second.plan.schedule

    def firmware(self) -> tuple[Firmware, Firmware]:
        """Return both programs in the dialect that the job asks for. Raises ResourceError."""
        first, second = (chip.make(self.job.firmware.dialect) for chip in self.chips)
        return first, second

    def images(self) -> tuple[Image, Image]:
        """Return the machine code of both. Raises ResourceError."""
        first, second = self.firmware()
        return first.compilation.image, second.compilation.image


def planned_pair(job: PlannedJob) -> PlayedPair:
    """Return both chips of a job as their engine plays them. Raises InputError or ResourceError."""
    first, second = (planned(each) for each in chip_jobs(job))
    _same_frame(job, first.plan.schedule, second.plan.schedule)
    longest = len(first.job.trajectory.angles)
    angles = np.full((longest, len(job.servos)), np.nan)
    names = list(job.trajectory.joints)
    for played in (first, second):
        motion = played.job.trajectory
        columns = [names.index(name) for name in motion.joints]
        angles[longest - len(motion.angles) :, columns] = motion.angles
    whole = replace(first.job.trajectory, joints=job.trajectory.joints, angles=angles)
    return PlayedPair(replace(job, trajectory=whole), (first, second))


def _same_frame(job: PlannedJob, first: PulseSchedule, second: PulseSchedule) -> None:
    """Raise InputError unless the frames of both chips have the same length."""
    if first.period != second.period:
        raise InputError(
            "chip-pair",
            f"the chips' frames differ: {first.period} and {second.period} cycles",
            job.document.place("frame", "period_us"),
            f"write a period of {max(first.period, second.period)} cycles, or deal the servos otherwise",
        )


def build_pair(job: PlannedJob, progress: Callable[[str], None] = lambda step: None) -> PairBuild:
    """Build both chips and judge them together.

    Raises InputError or ResourceError, with a hint that lists what would fit.
    """
    try:
        first, second = (build_alone(each, progress) for each in chip_jobs(job))
    except (InputError, ResourceError) as error:
        raise with_advice(job, error, progress) from None
    schedules = first.plan.schedule, second.plan.schedule
    _same_frame(job, *schedules)
    leads, follows = _images(first), _images(second)
    verdicts = {
        dialect: judge_pair(schedules, (leads[dialect], follows[dialect]))
        for dialect in leads
        if dialect in follows
    }
    return PairBuild(job, (first, second), verdicts)


def _images(build: Build) -> dict[str, Image]:
    """Return the programs of a build by dialect."""
    return {program.firmware.dialect: program.image for program in build.programs}


def judge_pair(schedules: tuple[PulseSchedule, PulseSchedule], images: tuple[Image, Image]) -> PairVerdict:
    """Run both chips in one time and return the verdict."""
    first, rule = schedules[0], schedules[1].wire
    limit = first.run_cycles(Cycles(max(checked_cycles(each) for each in schedules)))
    if rule is not None and rule.crystal_ppm:
        return _judge_own_crystals(schedules, images, rule, limit)
    edges = join(paired_machine(schedules, images).stream(limit))
    others = edges.pin >= OTHER_PINS
    mine, theirs = part(edges, ~others), part(edges, others)
    theirs = theirs._replace(pin=theirs.pin - np.uint8(OTHER_PINS))
    leads, follows = (EdgeTrace(first.clock, [each], limit) for each in (mine, theirs))
    return judge_traces(schedules, (leads, follows))


def _judge_own_crystals(
    schedules: tuple[PulseSchedule, PulseSchedule], images: tuple[Image, Image], rule: WireRule, limit: Cycles
) -> PairVerdict:
    """Run two chips with a crystal each, at several frequencies, and return the verdict on all runs."""
    verdict, runs, late = None, 0, list[float]()
    for run in limit_runs(schedules, images, rule, limit):
        runs, late = runs + 1, [*late, *run.late]
        if verdict is None or verdict.exact:
            verdict = judge_traces(schedules, run.traces)
    assert verdict is not None
    cycle_us = schedules[0].clock.cycle_us
    early_cycles, late_cycles = jitter(rule, schedules[1].period)
    seen_us = min(late) * float(cycle_us), max(late) * float(cycle_us)
    allowed_us = early_cycles * cycle_us, late_cycles * cycle_us
    return replace(verdict, jitter=Jitter(rule.crystal_ppm, runs, seen_us, allowed_us))


def judge_traces(
    schedules: tuple[PulseSchedule, PulseSchedule], traces: tuple[EdgeTrace, EdgeTrace]
) -> PairVerdict:
    """Return the verdict on the edges of both chips in one time."""
    period, rule = schedules[1].period, schedules[1].wire
    assert rule is not None
    leads, follows = (
        judge_edges(schedule, trace, checked_cycles(schedule))
        for schedule, trace in zip(schedules, traces, strict=True)
    )
    source, edges = PINS.index(rule.source), join(traces[0].chunks)
    rises = edges.cycle[(edges.pin == source) & (edges.level == HIGH)]
    apart = None
    if len(rises) and follows.start is not None:
        apart = follows.start - int(rises[0]) - rule.frames * period - rule.cycles
    return PairVerdict((leads, follows), apart)


def read_job_pair(
    job: PlannedJob, folder: Path
) -> tuple[tuple[PulseSchedule, PulseSchedule], tuple[Image, Image]]:
    """Return the schedules and images in a folder that was built from `job`. Raises InputError."""
    if not is_built_pair(folder):
        raise InputError(
            "chip-pair",
            f"{folder} does not have the programs of two chips",
            job.document.place("chip"),
            "--hex takes the folder that `servogen build` writes for the job",
        )
    return read_pair(folder)


def judge_folder(folder: Path) -> PairVerdict:
    """Return the verdict on the HEX files of a built pair. Raises InputError."""
    return judge_pair(*read_pair(folder))


def write_pair(result: PairBuild, folder: Path) -> None:
    """Write both builds and the report of the pair."""
    for name, build in zip(PAIR_FOLDERS, result.chips, strict=True):
        write(build, folder / name)
    write_text(folder / "report.txt", pair_report(result))
    write_text(folder / "report.html", pair_html(result))


def pair_html(result: PairBuild) -> str:
    """Return the page about a pair: the wiring of both chips, and the verdicts."""
    first, second = result.chips
    leads, follows = _images(first), _images(second)
    return pair_page(
        PairFacts(
            result.job.name,
            (first.job, second.job),
            result.exact,
            "one run" if result.runs == 1 else f"{result.runs} runs",
            [f"{dialect}: {verdict.summary()}" for dialect, verdict in result.verdicts.items()],
            [
                (
                    *(dialect, str(leads[dialect].words), str(follows[dialect].words)),
                    "exact" if verdict.exact else "NOT exact",
                )
                for dialect, verdict in result.verdicts.items()
            ],
            result.ran("on this folder"),
        )
    )


def pair_report(result: PairBuild) -> str:
    """Return the text of the pair's report: the wiring of both chips, their programs, and the verdicts."""
    name, (first, second) = result.job.name, result.job.chips
    lines = [name, "=" * len(name), ""]
    lines += [
        f"{crystals_text(first.wire)} One supply, one ground.",
        f"The wire: {first.wire.pin} of chip1, also a servo's signal, to {second.wire.pin} of chip2, with a "
        "pull-down of 10 kOhm.",
        "chip2 has no pulses in the first frames of chip1 and begins with the next. In a frame in which the",
        f"wire does not rise in its {'time' if first.wire.crystal_ppm else 'cycle'} it releases its pulses; "
        "it begins again when chip1 does.",
        *restart_text(first.wire),
    ]
    for folder, build, programs in zip(PAIR_FOLDERS, result.chips, result.programs(), strict=True):
        pins = ", ".join(f"{servo.pin} {servo.name}" for servo in build.job.servos)
        lines += ["", f"{folder}: {pins}", f"{programs}; all of it in {folder}/report.txt"]
    for dialect, verdict in result.verdicts.items():
        lines += ["", f"{dialect}:", *(f"  {line}" for line in verdict.lines())]
    lines += ["", result.ran("on this folder")]
    return "\n".join(line.rstrip() for line in lines) + "\n"
