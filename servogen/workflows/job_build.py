"""From a job to HEX files that are exact: plan, tune for every dialect, simulate, verify, write the files.

In: a planned job. Out: `Build`, the results of every step, and a folder of files that do not depend on the
date, the host or the path.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from servogen.edges import EdgeTrace
from servogen.engines.board import inputs_of, machine_of
from servogen.engines.firmware import DIALECTS, Firmware, ResourceError
from servogen.engines.tape.content import tape_hex
from servogen.errors import Diagnostic, InputError, Location
from servogen.job import PlannedJob
from servogen.notebooks import table_html
from servogen.outputs import replaced_files, write_text
from servogen.pic.device import PROGRAM_WORDS, RAM_BYTES, RAM_FIRST
from servogen.pic.image import Image, to_hex
from servogen.pic.listing import listing_text
from servogen.pulse import PulseSchedule
from servogen.pulse.plan import PulsePlan
from servogen.pulse.schedule import TAPE_FILE
from servogen.report.text import BuildFacts, Overrun, ProgramFacts, report_text
from servogen.simulator import Machine
from servogen.simulator.stimulus import file_inputs
from servogen.traces import write_edges
from servogen.units import Cycles
from servogen.verify import Verdict
from servogen.workflows.advice import with_advice
from servogen.workflows.engines import planned
from servogen.workflows.verification import LOOPS_CHECKED, checked_cycles, judge_run

if TYPE_CHECKING:
    from servogen.answers import BuildFactsAnswer, ProgramAnswer

TAPE_HEX = "tape.hex"
"""The content of a tape in the form that programmers read."""

EXPECTED_WARNING = "delay-rounded"
"""A warning that is omitted: the C states cycles as times, which the compiler is meant to round back; every
edge shows that it does.
"""

Progress = Callable[[str], None]
"""Called with the name of each step."""


@dataclass(frozen=True, slots=True)
class BuiltProgram:
    """One dialect's firmware and the verdict on its edges."""

    firmware: Firmware
    verdict: Verdict
    overrun: Cycles | None = None
    """The end, from reset, of the first frame in which the C was late; None if it never was, or is not
    recorded.
    """
    edges: EdgeTrace | None = field(default=None, compare=False)
    """All edges of the run from reset; only the program in the job's own dialect keeps them."""

    def __repr__(self) -> str:
        words, verdict = self.image.words, "exact" if self.exact else "NOT exact"
        return f"<Program in {self.firmware.dialect}: {words} words, {verdict}>"

    @property
    def exact(self) -> bool:
        return self.verdict.passed and self.overrun is None

    @property
    def image(self) -> Image:
        return self.firmware.compilation.image

    def to_json(self) -> ProgramAnswer:
        compilation = self.firmware.compilation
        return {
            "dialect": self.firmware.dialect,
            "words": compilation.words,
            "words_left": PROGRAM_WORDS - compilation.words,
            "ram_bytes": compilation.ram_bytes,
            "ram_left": RAM_BYTES - compilation.ram_bytes,
            "script": self.firmware.script.to_json() if self.firmware.script else None,
            "c_between_pulses": [room.to_json() for room in self.firmware.timing_budgets],
            "overrun_cycle": self.overrun,
            "exact": self.exact,
            "verdict": self.verdict.to_json(),
        }


@dataclass(frozen=True, slots=True)
class Build:
    """The result of a job; `job` has the engine's lead-in, `programs` begins with the job's own dialect."""

    job: PlannedJob
    engine: str
    plan: PulsePlan
    programs: tuple[BuiltProgram, ...]
    left_out: tuple[Diagnostic, ...] = ()
    """The dialects whose program does not fit the chip, although that of the job's own dialect does."""

    def __repr__(self) -> str:
        dialects = ", ".join(program.firmware.dialect for program in self.programs)
        verdict = "exact" if self.exact else "NOT exact"
        return f"<Build {self.job.name}: {self.engine} in {dialects}; {verdict}, {self.frames} frames>"

    def _repr_html_(self) -> str:
        rows = [
            (
                program.firmware.dialect,
                program.image.words,
                program.firmware.compilation.ram_bytes,
                "exact" if program.exact else "NOT exact",
                "; ".join(program.verdict.reasons),
            )
            for program in self.programs
        ]
        title = f"{self.job.name}: {self.engine} engine, {self.frames} frames compared"
        return table_html(title, ("dialect", "words", "RAM bytes", "pulses", "why not"), rows)

    @property
    def exact(self) -> bool:
        return all(program.exact for program in self.programs)

    @property
    def frames(self) -> int:
        """Return the number of checked frames."""
        schedule = self.plan.schedule
        return schedule.lead_in_frames + LOOPS_CHECKED * schedule.loop_frames

    def to_json(self) -> BuildFactsAnswer:
        """Return the result without the warnings."""
        error = self.plan.schedule.plan_error
        return {
            "job": self.job.name,
            "exact": self.exact,
            "frames": self.frames,
            "plan_error": error.to_json() if error else None,
            "widths": [row.to_json() for row in self.plan.widths],
            "programs": [program.to_json() for program in self.programs],
        }

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        compiler = [
            diagnostic
            for program in self.programs
            for diagnostic in program.firmware.compilation.diagnostics
            if diagnostic.code != EXPECTED_WARNING
        ]
        engine = [
            replace(warning, location=Location(program.firmware.file))
            for program in self.programs
            for warning in program.firmware.warnings
        ]
        return (*self.job.warnings, *self.plan.warnings, *engine, *compiler, *self.left_out)


def build(job: PlannedJob, progress: Progress = lambda step: None) -> Build:
    """Plan, compile, simulate and verify a job; return the result.

    Raises InputError or ResourceError, with a hint that lists what would fit, if the job cannot be built.
    """
    try:
        return build_alone(job, progress)
    except (InputError, ResourceError) as error:
        raise with_advice(job, error, progress) from None


def build_alone(job: PlannedJob, progress: Progress) -> Build:
    """Return the build of a job without advice where it does not fit. Raises InputError or ResourceError."""
    progress("planning")
    played = planned(job)
    schedule = played.plan.schedule
    own = job.firmware.dialect
    programs: list[BuiltProgram] = []
    left_out: list[Diagnostic] = []
    for dialect in (own, *(other for other in DIALECTS if other != own)):
        progress(f"compiling {dialect}")
        try:
            firmware = played.make(dialect)
        except ResourceError as error:
            if dialect == own:
                raise
            left_out.append(
                Diagnostic("warning", "dialect-left-out", f"no program for {dialect}: {error.message}")
            )
            continue
        progress(f"comparing {dialect}")
        programs.append(judge_firmware(schedule, firmware, stored=dialect == own))
    return Build(
        job=played.job,
        engine=played.engine,
        plan=played.plan,
        programs=tuple(programs),
        left_out=tuple(left_out),
    )


def judge_firmware(schedule: PulseSchedule, firmware: Firmware, *, stored: bool = False) -> BuiltProgram:
    """Run the firmware for `checked_cycles`, and return it with the verdict and, if `stored`, its edges."""
    image = firmware.compilation.image
    run = judge_run(schedule, image, listing=firmware.compilation.listing, stored=stored)
    late = None
    if firmware.overrun is not None and _overrun(run.machine, firmware.overrun):
        late = machine_of(schedule, image)
        while not _overrun(late, firmware.overrun):
            late.run(schedule.period)
    return BuiltProgram(firmware, run.verdict, late.cycles if late else None, run.edges if stored else None)


def _overrun(machine: Machine, address: int) -> bool:
    """Return whether the firmware reports an overrun.

    RAM may hold anything at power-up, so the bit counts only once the program has written it.
    """
    state = machine.state()
    return address in state.ram_written and bool(state.ram[address - RAM_FIRST] & 1)


FILES = frozenset(
    (
        *("schedule.json", "main.lst", "report.txt", "edges.csv", "main.vcd", "main.hex"),
        *(TAPE_FILE, TAPE_HEX),
        *(f"main.{dialect}.{suffix}" for dialect in DIALECTS for suffix in ("c", "hex")),
    )
)
"""All files that a build may write; a build removes those of a previous build that it does not write."""


def write(result: Build, folder: Path) -> None:
    """Write the files of a build, replacing those of an earlier build in one step."""
    own = result.programs[0]
    servos = {servo.pin: servo.name for servo in result.job.servos}
    texts = {"schedule.json": result.plan.schedule.json_text()}
    for program in result.programs:
        texts |= {
            program.firmware.file: program.firmware.text,
            hex_name(result, program): to_hex(program.image),
        }
    texts |= {"main.lst": listing_text(own.firmware.compilation.listing), "report.txt": report(result)}
    schedule = result.plan.schedule
    if schedule.tape is not None:
        texts[TAPE_HEX] = tape_hex(schedule.tape.content)
    with replaced_files(folder, FILES) as new:
        for name, text in texts.items():
            write_text(new / name, text)
        if schedule.tape is not None:
            (new / TAPE_FILE).write_bytes(schedule.tape.content)
        write_edges(
            checked_edges(result),
            new / "edges.csv",
            new / "main.vcd",
            servos=servos,
            inputs=file_inputs(inputs_of(schedule), schedule.clock),
        )


def checked_edges(result: Build) -> EdgeTrace:
    """Return the edges of the job's own program from reset to the end of the checked time."""
    own = result.programs[0]
    assert own.edges is not None
    return own.edges.until((own.verdict.start or 0) + checked_cycles(result.plan.schedule))


def report(result: Build) -> str:
    """Return the text of report.txt."""
    return report_text(
        BuildFacts(result.job, result.engine, result.plan, program_facts(result), result.warnings)
    )


def program_facts(result: Build) -> tuple[ProgramFacts, ...]:
    """Return the facts about each program that a report states."""
    return tuple(
        ProgramFacts(
            dialect=program.firmware.dialect,
            c_file=program.firmware.file,
            hex_file=hex_name(result, program),
            words=program.firmware.compilation.words,
            ram_bytes=program.firmware.compilation.ram_bytes,
            verdict=program.verdict,
            timing_budgets=program.firmware.timing_budgets,
            overrun=None if program.firmware.overrun is None else Overrun(program.overrun),
            script=program.firmware.script,
        )
        for program in result.programs
    )


def hex_name(result: Build, program: BuiltProgram) -> str:
    return "main.hex" if program is result.programs[0] else f"main.{program.firmware.dialect}.hex"
