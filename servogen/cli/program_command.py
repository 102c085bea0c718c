"""`servogen run-program`: runs an arm program without a job."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.options import CLOCK_HZ, Json, PeriodUs, table_option, usual
from servogen.cli.show import as_json, next_step, table, warn_of_all
from servogen.job.schema import ProgramTable
from servogen.kinematics.catalogue import arm
from servogen.kinematics.queries import positions_of
from servogen.movemaster import Budget, ProgramRun, input_of, manipulator, read, run
from servogen.outputs import write_text
from servogen.report.motion_table import joint_lines
from servogen.units import Clock, Cycles


@dataclass(frozen=True, slots=True)
class ProgramOptions:
    """What is run, and for how long; ranges and defaults are those of a job's [program]."""

    robot: Annotated[str, "The robot: a catalogue name or a TOML file."] = "rv-m1"
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            help="The value of the input port from a time in seconds on, such as 1.5=&1F (repeatable).",
        ),
    ] = None
    period_us: PeriodUs = 20_000
    repeat: Annotated[bool, "Repeat the program endlessly."] = False
    max_commands: Annotated[
        int,
        table_option(
            ProgramTable, "max_commands", "Stop a program that does not end after this many commands."
        ),
    ] = usual(ProgramTable, "max_commands")
    max_s: Annotated[
        float, table_option(ProgramTable, "max_s", "Stop it after this many seconds of motion.")
    ] = usual(ProgramTable, "max_s")


def run_program(
    file: Annotated[Path, typer.Argument(help="An arm program (.rvm).", show_default=False)],
    program: ProgramOptions,
    output: Annotated[
        Path | None, typer.Option("--csv", help="Write the joint positions of each frame (degrees, mm).")
    ] = None,
    json: Json = False,
) -> None:
    """Run an arm program: show its moves with their times, and what it writes to its output port."""
    source, chosen = read(file), arm(program.robot)
    program_run = run(
        source,
        manipulator(chosen),
        Cycles(program.period_us),
        Clock(CLOCK_HZ),
        inputs=tuple(input_of(text) for text in program.inputs or ()),
        repeat=program.repeat,
        budget=Budget(program.max_commands, Fraction(program.max_s)),
    )
    if output:
        write_text(output, "".join(f"{line}\n" for line in joint_lines(program_run.trajectory, chosen)))
    if json:
        final = positions_of(chosen, program_run.trajectory.angles[-1])
        answer = {"robot": program.robot, **program_run.to_json(), "final_joints": final}
        as_json(answer, program_run.warnings)
        return
    _show_run(program_run)
    frames, loop = (
        len(program_run.trajectory.angles),
        len(program_run.trajectory.angles) - program_run.trajectory.loop_start,
    )
    print(f"{file}: {frames} frames, {program_run.seconds(frames):g} s; the last {loop} of them repeat")
    if output:
        print(next_step("new", "--robot", "arm"))
    warn_of_all(program_run.warnings)


def _show_run(program_run: ProgramRun) -> None:
    table(
        "Motion",
        ("line", "command", "from s", "for s", "x mm", "y mm", "z mm", "pitch °", "roll °", "hand"),
        [
            (
                step.statement.number or "",
                step.statement.text,
                f"{program_run.seconds(step.frame):z.2f}",
                f"{program_run.seconds(step.frames):z.2f}",
                *(f"{value:z.1f}" for value in step.pose.values),
                "closed" if step.hand == "C" else "open",
            )
            for step in program_run.steps
        ],
    )
    if program_run.outputs:
        rows = [
            (f"{program_run.seconds(output.frame):z.2f}", f"&{output.value:02X}")
            for output in program_run.outputs
        ]
        table("Output port", ("at s", "value"), rows)
