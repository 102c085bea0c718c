"""`report.txt`: job, wiring, every pulse width with its error, what that is in mm, programs, verdicts.

In: the values of a build. Out: text, the same for the same build.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from servogen.engines.firmware import TimingBudget
from servogen.engines.stored_script import Stored
from servogen.errors import Diagnostic
from servogen.job import PlannedJob
from servogen.pic.device import PROGRAM_WORDS, RAM_BYTES, oscillator_for
from servogen.pulse import Quantised
from servogen.pulse.plan import PulsePlan
from servogen.report.tracks import ERROR_COLUMNS, end_errors, end_tracks, error_rows, largest_error
from servogen.report.wiring import open_drain, remarks, wires
from servogen.units import Clock, Cycles, counted
from servogen.verify import Verdict, verdict_lines

COMMANDS = (
    ("C2C", "its own editor opens main.c2c.c, which states the configuration word"),
    ("XC8", "xc8-cc -mcpu={chip} -std=c99 -O1 -o main.hex main.xc8.c"),
    ("SDCC", "sdcc -mpic14 -p{chip} --use-non-free --stack-size 5 main.sdcc.c"),
)
"""MPLAB XC8 C Compiler User's Guide, chapter on the command-line driver; SDCC Compiler User Guide, section
"The PIC14 port"; the chip without its "PIC"."""


@dataclass(frozen=True, slots=True)
class Overrun:
    """The overrun bit after the run: `at` is the end, from reset, of the first frame that set it, if any."""

    at: Cycles | None

    def text(self, clock: Clock) -> str:
        return (
            "never"
            if self.at is None
            else f"by cycle {self.at} after reset ({_number(clock.us(self.at))} µs)"
        )


@dataclass(frozen=True, slots=True)
class ProgramFacts:
    """One dialect's program: its files, its size, and the verdict on its HEX."""

    dialect: str
    c_file: str
    hex_file: str
    words: int
    ram_bytes: int
    verdict: Verdict
    timing_budgets: tuple[TimingBudget, ...] = ()
    overrun: Overrun | None = None
    """The overrun bit after the run; None if the engine has none."""
    script: Stored | None = None
    """The memories that hold the player's script; None for other engines."""

    @property
    def exact(self) -> bool:
        return self.verdict.passed and (self.overrun is None or self.overrun.at is None)


@dataclass(frozen=True, slots=True)
class BuildFacts:
    """Everything in a report."""

    job: PlannedJob
    engine: str
    plan: PulsePlan
    programs: tuple[ProgramFacts, ...]
    warnings: tuple[Diagnostic, ...]


def report_text(facts: BuildFacts) -> str:
    """Return the report as lines of plain text."""
    return "\n".join(line.rstrip() for line in _lines(facts)) + "\n"


def _lines(facts: BuildFacts) -> Iterator[str]:
    yield facts.job.name
    yield "=" * len(facts.job.name)
    for title, section in (
        ("Chip", _chip(facts)),
        ("Wiring", _wiring(facts)),
        ("Pulses", _pulses(facts)),
        ("Motion", _motion(facts)),
        ("Paths", _paths(facts)),
        ("Programs", _programs(facts)),
        ("Verdict", _verdict(facts)),
        ("Warnings", _warnings(facts)),
    ):
        lines = list(section)
        if not lines:
            continue
        yield ""
        yield title
        yield "-" * len(title)
        yield from lines


def _chip(facts: BuildFacts) -> Iterator[str]:
    clock = facts.job.clock
    yield f"{facts.job.device.name}, {clock.hz} Hz crystal ({oscillator_for(clock.hz)})"
    yield f"One instruction cycle is {_number(clock.cycle_us)} µs."


def _wiring(facts: BuildFacts) -> Iterator[str]:
    rows = [
        (str(wire.number), wire.pin, wire.use, wire.servo.model.title if wire.servo else "")
        for wire in wires(facts.job)
    ]
    yield from _table(("pin", "name", "goes to", "servo"), rows)
    yield from open_drain(facts.job)
    yield ""
    yield from remarks(facts.job)


def rounded_width(row: Quantised) -> tuple[str, ...]:
    """Return the cells of a rounded width: angle, width asked for, cycles, width achieved, error, frames."""
    return (
        f"{math.degrees(row.angle):z.2f}",
        f"{float(row.requested_us):z.3f}",
        str(row.cycles),
        f"{float(row.achieved_us):z.3f}",
        f"{float(row.error_us):+z.3f}",
        str(row.frames),
    )


def _pulses(facts: BuildFacts) -> Iterator[str]:
    schedule = facts.plan.schedule
    examples = any(row.which for row in facts.plan.widths)
    rows = [
        (
            row.channel,
            *([row.which] if examples else []),
            *rounded_width(row),
        )
        for row in facts.plan.widths
    ]
    numbers = ("angle_deg", "requested_us", "cycles", "achieved_us", "error_us", "frames")
    yield from _table(("servo", *(["pulse"] if examples else []), *numbers), rows)
    yield ""
    yield f"Period {schedule.period} cycles, {_number(schedule.clock.us(schedule.period))} µs."


def _motion(facts: BuildFacts) -> Iterator[str]:
    schedule = facts.plan.schedule
    if schedule.inputs:
        levels = ", ".join(f"{source.pin} {'high' if source.level else 'low'}" for source in schedule.inputs)
        yield f"with {levels} from power-up on:"
    for name, frames in (("lead-in", schedule.lead_in_frames), ("loop", schedule.loop_frames)):
        if frames:
            seconds = _number(schedule.clock.seconds(frames * schedule.period))
            yield f"{name}: {counted(frames, 'frame')}, {seconds} s"
    yield from (note.message for note in facts.job.notes)


def _paths(facts: BuildFacts) -> Iterator[str]:
    """Yield the error of the schedule at the foot, tool or base; nothing if the servos move none."""
    schedule = facts.plan.schedule
    errors = end_errors(end_tracks(facts.job, schedule))
    if errors:
        frame_s = float(schedule.clock.seconds(schedule.period))
        worst = largest_error(errors)
        away = f"{1000 * worst.worst_m:z.3f} mm"
        yield f"The program's pulses put {worst.name} up to {away} from where it was planned."
        yield from _table(ERROR_COLUMNS, list(error_rows(errors, frame_s)))


def _programs(facts: BuildFacts) -> Iterator[str]:
    yield f"Engine: {facts.engine}"
    yield from _table(
        ("dialect", "C", "HEX", "words", "left", "RAM bytes"),
        [
            (
                program.dialect,
                program.c_file,
                program.hex_file,
                str(program.words),
                str(PROGRAM_WORDS - program.words),
                f"{program.ram_bytes} of {RAM_BYTES}",
            )
            for program in facts.programs
        ],
    )
    yield ""
    yield from timing_budgets_text(facts.programs, facts.job.clock)
    yield "With another compiler, whose own cycles `servogen tune` and `servogen verify` tell:"
    chip = facts.job.device.name.removeprefix("PIC").lower()
    yield from _table(("compiler", "command"), [(name, text.format(chip=chip)) for name, text in COMMANDS])


def timing_budgets_text(programs: Sequence[ProgramFacts], clock: Clock) -> Iterator[str]:
    """Yield the longest time of the C between the pulses, over all paths, and what is left of its budget."""
    rows = [
        (
            program.dialect,
            room.between,
            "not known" if room.worst is None else str(room.worst),
            str(room.room),
            "?" if room.left is None else f"{room.left} ({_number(clock.us(room.left))} µs)",
        )
        for program in programs
        for room in program.timing_budgets
    ]
    if rows:
        yield "The C between the pulses, in cycles:"
        yield from _table(("dialect", "between", "most", "room", "left"), rows)
        yield from any_compiler(programs)
    yield from (
        f"{program.dialect}: overrun: {program.overrun.text(clock)}{_if_not_for_every_path(program)}"
        for program in programs
        if program.overrun
    )
    yield from (
        f"{program.dialect}: script: {program.script.text}; the trims are before it"
        for program in programs
        if program.script and program.script.eeprom
    )


def _if_not_for_every_path(program: ProgramFacts) -> str:
    """Return a remark if the bound over all paths exceeds the budget; empty otherwise."""
    bounded = all(room.left is not None and room.left >= 0 for room in program.timing_budgets)
    return "" if bounded else " in this run; the bound over all paths exceeds the room"


def any_compiler(programs: Sequence[ProgramFacts]) -> Iterator[str]:
    """Yield what holds for every compiler that keeps the kernel's assembly."""
    seen = {
        room.between: room for program in programs for room in program.timing_budgets if room.seen is not None
    }
    if seen:
        most = " and ".join(f"{room.room} between {between}" for between, room in seen.items())
        late = " and ".join(f"{room.seen} between {between}" for between, room in seen.items())
        yield f"Any compiler that keeps the kernel's assembly: the same edges with at most {most};"
        yield f"the same edges, or overrun is set, with at most {late}."


def _verdict(facts: BuildFacts) -> Iterator[str]:
    for program in facts.programs:
        yield f"{program.hex_file}:"
        yield from (f"  {line}" for line in verdict_lines(program.verdict))
    yield "This is one run of each. For every power-up, input and chip:"
    yield "servogen prove main.hex --against schedule.json"


def _warnings(facts: BuildFacts) -> Iterator[str]:
    yield from (sentence(warning) for warning in facts.warnings)
    if not facts.warnings:
        yield "none"


def sentence(warning: Diagnostic) -> str:
    """Return a warning without the folder of its file: the report does not depend on where it was made."""
    location = warning.location
    where = replace(location, file=Path(location.file or "").name) if location else ""
    return ": ".join(part for part in (str(where), warning.message) if part)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a table whose columns are as wide as their widest cell."""
    widths = [max(len(row[index]) for row in (columns, *rows)) for index in range(len(columns))]
    for row in (columns, *rows):
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))


def _number(value: Fraction) -> str:
    return f"{float(value):z.6f}".rstrip("0").rstrip(".")
