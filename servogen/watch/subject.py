"""What is watched: a job, a program, or a recording, loaded from its file.

In: a path and what the command line says about it. Out: `Subject`. Loading a job compiles its firmware, which
takes seconds; `check` is quick, and raises what can be known at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil
from pathlib import Path

from servogen.edges import OTHER_PINS, EdgeTrace, join
from servogen.engines.board import board_of, equal_rates, inputs_of, machine_of, paired_machine
from servogen.engines.firmware import Firmware
from servogen.errors import Diagnostic, InputError, Location
from servogen.inputs import open_input
from servogen.job import PlannedJob, load, plan_job
from servogen.pic.image import Image
from servogen.pic.listing import Listing
from servogen.programs import (
    ASSEMBLY_SUFFIXES,
    C_SUFFIX,
    HEX_SUFFIXES,
    JOB_SUFFIX,
    PAIR_FOLDERS,
    PROGRAM_SUFFIXES,
    clock_of,
    program_file,
    read_program,
)
from servogen.pulse import PulseSchedule
from servogen.simulator import PairedMachine, SimulatorOptions, Stimuli, load_stimuli
from servogen.traces.captures import SUFFIXES as CAPTURE_SUFFIXES
from servogen.traces.captures import Capture, is_capture, read_capture
from servogen.traces.formats import read_edges
from servogen.units import Clock, Cycles
from servogen.verify.capture.check import split
from servogen.watch.differences import (
    ScheduledEdges,
    differences,
    differing,
    first_rise,
    place_schedule,
    spans,
)
from servogen.workflows.certificates import beside, find_verdict
from servogen.workflows.engines import planned
from servogen.workflows.pair import planned_pair
from servogen.workflows.verification import judge_capture

LOOPS = 2
"""The number of loops in which the first difference is searched."""
NEAR_FRAMES = Fraction(3, 2)
"""The distance of two differences that are one span."""
MAX_SEARCH_S = 600
"""The maximum simulated time in which the first difference is searched."""


@dataclass(frozen=True, slots=True)
class Setting:
    """What the command line says besides the file."""

    options: SimulatorOptions = SimulatorOptions()  # noqa: RUF009 - frozen
    clock_hz: int | None = None
    stimulus: Path | None = None
    schedule: PulseSchedule | None = None
    job: Path | None = None
    """A job whose schedule is compared instead; it also states what the servos on the pins move."""
    at_cycle: int = 0
    device: str | None = None
    """The chip that the command line names, for a program that does not come with its own."""
    wires: Mapping[str, str] | None = None
    """The pins of a recording's channels that are not named after them."""


@dataclass(frozen=True, slots=True, eq=False)
class ChipPair:
    """Two chips in one time, of which number `shown`, 0 or 1, is debugged; the first one's first."""

    schedules: tuple[PulseSchedule, PulseSchedule]
    firmware: tuple[Firmware, Firmware]
    options: SimulatorOptions
    """What the chips are besides their schedules."""
    shown: int = 0

    def beyond(self, number: int) -> int:
        """Return what is added to the numbers of a chip's pins."""
        return 0 if number == self.shown else OTHER_PINS

    def powered(self) -> PairedMachine:
        """Return both chips at power-up."""
        first, second = (firmware.compilation.image for firmware in self.firmware)
        return paired_machine(self.schedules, (first, second), self.shown, self.options)


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """Either a program (`image`) or a recording (`trace`); `schedule` is what its edges are compared with.

    A window that is opened shows cycle `begin`.
    """

    path: Path
    clock: Clock
    options: SimulatorOptions = SimulatorOptions()  # noqa: RUF009 - frozen
    image: Image | None = None
    listing: Listing | None = None
    stimuli: Stimuli | None = None
    trace: EdgeTrace | None = None
    schedule: PulseSchedule | None = None
    job: PlannedJob | None = None
    """The job that is watched or compared with, as its engine plays it."""
    stated: PlannedJob | None = None
    """The watched job as its text states it, without the frames that the engine puts before it."""
    pair: ChipPair | None = None
    """Both chips of a job of two: image, listing and schedule are those of the one that is shown."""
    wanted: tuple[ScheduledEdges, ...] = ()
    """The schedule's position in the trace: one, or one for each of several captures in one file, or of two
    chips.
    """
    first_difference: Cycles | None = None
    differences: tuple[tuple[int, int], ...] = ()
    """The spans of cycles in which edges differ, as far as the trace was compared."""
    verdict: str = ""
    """How a capture compares with the schedule, as `verify` judges it."""
    begin: Cycles = Cycles(0)  # noqa: RUF009 - an integer
    title: str = ""
    """The name that is shown instead of the file's."""
    robot: Mapping[str, object] | None = None
    """What the pulses move; None: what the job or the schedule states."""
    remarks: tuple[Diagnostic, ...] = ()
    """The warnings of the compiler, or about a HEX file and the files beside it."""
    graded: Mapping[str, object] | None = None
    """How the program of a class was graded: the task, the reasons, the page of its film."""

    @property
    def name(self) -> str:
        return self.title or self.path.name

    @property
    def shown(self) -> int:
        """Return the number of the chip that is shown, from 0 on."""
        return self.pair.shown if self.pair is not None else 0

    @property
    def placed(self) -> ScheduledEdges | None:
        """Return where the schedule lies in the trace, of two chips the first one's.

        None: nowhere, or once in each of several captures.
        """
        return self.wanted[0] if len(self.wanted) == 1 or self.pair is not None else None

    def powered(self) -> PairedMachine | None:
        """Return both chips of a pair at power-up; None for one chip."""
        return None if self.pair is None else self.pair.powered()

    def showing(self, number: int) -> Subject:
        """Return the same with another chip of a pair shown."""
        if self.pair is None or number == self.pair.shown:
            return self
        pair = replace(self.pair, shown=number)
        compiled = pair.firmware[number]
        return replace(
            self,
            pair=pair,
            options=board_of(pair.schedules[number], pair.options),
            image=compiled.compilation.image,
            listing=compiled.compilation.listing,
            schedule=pair.schedules[number],
            remarks=compiled.warnings,
            wanted=tuple(
                replace(wanted, beyond=pair.beyond(chip)) for chip, wanted in enumerate(self.wanted)
            ),
        )


def check(path: Path) -> None:
    """Raise InputError for a file that cannot be watched, as far as that can be known at once."""
    path = program_file(path)
    suffix = path.suffix.lower()
    known = (JOB_SUFFIX, *PROGRAM_SUFFIXES, *CAPTURE_SUFFIXES)
    if suffix not in known:
        raise InputError(
            "unknown-suffix",
            f"'{path.suffix}' is not the suffix of a job, a program or a capture",
            Location(str(path)),
            f"one of: {', '.join(dict.fromkeys(known))}",
        )
    open_input(path).close()
    if suffix == JOB_SUFFIX:
        load(path)


def load_subject(path: Path, setting: Setting, progress: Callable[[str], None] = lambda _: None) -> Subject:
    """Return the subject in a file, to be shown from the moment of the setting. Raises InputError."""
    return replace(_read_subject(path, setting, progress), begin=Cycles(setting.at_cycle))


def _read_subject(path: Path, setting: Setting, progress: Callable[[str], None]) -> Subject:
    given, path = path, program_file(path)
    suffix = path.suffix.lower()
    if suffix == JOB_SUFFIX:
        return job_subject(path, plan_job(load(path)), setting, progress)
    setting, job = _against(setting, progress)
    if suffix in (C_SUFFIX, *ASSEMBLY_SUFFIXES, *HEX_SUFFIXES):
        progress("compiling" if suffix not in HEX_SUFFIXES else "reading")
        program = read_program(given, setting.device)  # of a folder, also its clock and chip
        clock = clock_of(program, setting.clock_hz)
        chip = setting.device or program.device or setting.options.device
        options, schedule = replace(setting.options, device=chip), setting.schedule
        stimuli = load_stimuli(setting.stimulus, clock) if setting.stimulus else None
        if schedule is not None:
            options, clock = board_of(schedule, options), schedule.clock
            stimuli = stimuli or inputs_of(schedule)
        subject = Subject(
            path,
            clock,
            options,
            program.image,
            program.listing,
            stimuli,
            schedule=schedule,
            job=job,
            remarks=(*program.remarks, *program.warnings),
        )
        return _beside_schedule(subject, progress)
    progress("reading")
    return replace(_recording(path, setting, progress), job=job)


def _against(setting: Setting, progress: Callable[[str], None]) -> tuple[Setting, PlannedJob | None]:
    """Return the setting with the schedule of its job, and that job as its engine plays it."""
    if setting.job is None:
        return setting, None
    progress(f"planning {setting.job.name}")
    plan = planned(plan_job(load(setting.job)))
    return replace(setting, schedule=plan.plan.schedule), plan.job


def job_subject(
    path: Path, job: PlannedJob, setting: Setting, progress: Callable[[str], None] = lambda _: None
) -> Subject:
    """Return the subject that a planned job becomes: its firmware, compared with its schedule."""
    progress("planning")
    if job.chips:
        return _pair_subject(path, job, setting, progress)
    engine_plan = planned(job)
    progress(f"compiling {job.firmware.dialect}")
    firmware = engine_plan.make(job.firmware.dialect)
    schedule = engine_plan.plan.schedule
    stimuli = load_stimuli(setting.stimulus, schedule.clock) if setting.stimulus else inputs_of(schedule)
    subject = Subject(
        path,
        schedule.clock,
        board_of(schedule, setting.options),
        firmware.compilation.image,
        firmware.compilation.listing,
        stimuli,
        schedule=schedule,
        job=engine_plan.job,
        stated=job,
        remarks=firmware.warnings,
    )
    return _beside_schedule(subject, progress)


def _pair_subject(path: Path, job: PlannedJob, setting: Setting, progress: Callable[[str], None]) -> Subject:
    """Return both chips of a job in one time. Raises InputError."""
    if setting.stimulus is not None:
        message = "two chips read nothing that --stimulus could change"
        raise InputError("chip-pair", message, job.document.place("chip"), "omit --stimulus")
    played = planned_pair(job)
    progress(f"compiling {job.firmware.dialect}")
    pair = ChipPair(played.schedules, played.firmware(), setting.options)
    schedule, firmware = pair.schedules[0], pair.firmware[0]
    subject = Subject(
        path,
        schedule.clock,
        board_of(schedule, setting.options),
        firmware.compilation.image,
        firmware.compilation.listing,
        schedule=schedule,
        job=played.job,
        stated=job,
        remarks=firmware.warnings,
        pair=pair,
    )
    return _beside_schedule(subject, progress)


def proven_sentence(subject: Subject) -> str:
    """Return what is proven of a program that is compared with its schedule, as `servogen build` says it; of
    two chips, what is proven of the one that is shown.
    """
    if subject.image is None or subject.schedule is None or subject.first_difference is not None:
        return ""
    built = subject.path
    if subject.job is not None and built.suffix.lower() == JOB_SUFFIX:
        folder = PAIR_FOLDERS[subject.shown] if subject.pair is not None else ""
        built = Path("build") / subject.job.name / folder / "main.hex"
    sentence = find_verdict([beside(built)], subject.image, subject.schedule).sentence
    if subject.pair is None or not sentence:
        return sentence
    return "; ".join([f"chip {1 + subject.shown}: {sentence}", *equal_rates(subject.pair.schedules[1])])


def _recording(path: Path, setting: Setting, progress: Callable[[str], None]) -> Subject:
    """Return a recording: edges in cycles of the chip, or the samples of an analyser."""
    schedule = setting.schedule
    if not is_capture(path):
        clock = schedule.clock if schedule else Clock(setting.clock_hz or 4_000_000)
        return _beside_schedule(
            Subject(
                path, clock, trace=read_edges(path, clock, wires=setting.wires).stored(), schedule=schedule
            ),
            progress,
        )
    capture = read_capture(path, setting.wires)
    subject = Subject(path, capture.trace.clock, trace=capture.trace.stored(), schedule=schedule)
    if schedule is None:
        return subject
    progress("comparing with the schedule")
    return _beside_capture(subject, schedule, capture)


def _beside_capture(subject: Subject, schedule: PulseSchedule, capture: Capture) -> Subject:
    """Return an analyser's capture with the schedule laid beside it where `verify` finds it."""
    trace, first = subject.trace, first_rise(schedule)
    assert trace is not None
    verdict = judge_capture(schedule, capture)
    step_us = float(trace.clock.cycle_us)
    sample = verdict.sample_us / step_us
    tolerance = sample + verdict.tolerances.edge_us / step_us
    wanted = []
    for begin, end in capture.pieces or ((0, int(trace.end)),):
        line = verdict.line
        if line is None and capture.pieces:
            (piece,) = split(trace, ((begin, end),))
            line = judge_capture(schedule, replace(capture, trace=piece, sample=sample, pieces=())).line
        if line is not None and first is not None:
            inside = ceil(sample + tolerance)  # an edge nearer to the ends may lie beyond them
            origin = begin + line.a - line.b * first
            wanted.append(ScheduledEdges(schedule, origin, line.b, tolerance, begin + inside, end - inside))
    said = verdict.word if verdict.passed else f"{verdict.word}: {verdict.reasons[0]}"
    judged = replace(subject, wanted=tuple(wanted), verdict=said)
    if verdict.agrees:
        return judged
    if wanted:
        made = join(trace.driven())
        end = min(int(trace.end), trace.clock.round_seconds(MAX_SEARCH_S))
        edges = sorted(edge[0] for placed in wanted for edge in differing(placed, made, 0, end))
        judged = _with_differences(judged, edges)
    if verdict.first_mismatch is None:
        return judged
    return replace(judged, first_difference=trace.clock.round_seconds(verdict.first_mismatch.time_us / 1e6))


def _beside_schedule(subject: Subject, progress: Callable[[str], None]) -> Subject:
    """Return the subject with the schedule laid beside it, from its first pulse on."""
    schedule = subject.schedule
    if schedule is None:
        return subject
    progress("comparing with the schedule")
    frames = schedule.lead_in_frames + LOOPS * schedule.loop_frames
    longest = schedule.clock.round_seconds(MAX_SEARCH_S)
    end = min(longest, schedule.run_cycles(frames * schedule.period))
    trace = subject.trace
    if trace is None:
        assert subject.image is not None
        machine = subject.powered() or machine_of(schedule, subject.image, subject.options)
        trace = EdgeTrace(schedule.clock, machine.stream(end), end).stored()
    pair = subject.pair
    chips = (
        [(schedule, 0)] if pair is None else [(each, pair.beyond(n)) for n, each in enumerate(pair.schedules)]
    )
    found = [wanted for each, beyond in chips if (wanted := place_schedule(each, trace, beyond)) is not None]
    if len(found) < len(chips):
        return subject
    last = min(end, trace.end, found[0].frame_begin(frames))
    edges = sorted(edge for wanted in found for edge in differences(wanted, trace, last))
    return _with_differences(replace(subject, wanted=tuple(found)), edges)


def _with_differences(subject: Subject, cycles: Iterable[int]) -> Subject:
    """Return the subject with the edges that differ; those of neighbouring frames are one span."""
    wanted = subject.wanted[0]
    found = spans(cycles, ceil(NEAR_FRAMES * wanted.steps * wanted.schedule.period))
    first = Cycles(found[0][0]) if found else None
    return replace(subject, first_difference=first, differences=found)
