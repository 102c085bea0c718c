"""Commands of motion: run-program."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json
from servogen.cli.show import as_json, table, warn_of_all

if TYPE_CHECKING:
    from servogen.movemaster import Run

CLOCK_HZ = 4_000_000
"""A cycle of it is a microsecond, so that a frame's microseconds are its cycles."""


def register(app: typer.Typer) -> None:
    app.command("run-program")(run_program)


def run_program(
    file: Annotated[Path, typer.Argument(help="A program of the arm (.rvm).", show_default=False)],
    robot: Annotated[str, typer.Option("--robot", help="A robot's short name or TOML file.")] = "rv-m1",
    inputs: Annotated[
        list[str] | None, typer.Option("--input", help="seconds=value of the input port, such as 1.5=&1F.")
    ] = None,
    period_us: Annotated[int, typer.Option("--period-us", min=1000, help="One frame.")] = 20_000,
    repeat: Annotated[bool, typer.Option("--repeat", help="Repeat the program without end.")] = False,
    max_commands: Annotated[
        int, typer.Option("--max-commands", min=1, help="Stop a program that does not end.")
    ] = 100_000,
    max_s: Annotated[float, typer.Option("--max-s", min=1, help="The same, in seconds of motion.")] = 3600,
    output: Annotated[
        Path | None, typer.Option("--csv", help="Write the joints of each frame (degrees, mm).")
    ] = None,
    json: Json = False,
) -> None:
    """Run a program of the arm command language: when it moves where, and what it writes to its port."""
    from fractions import Fraction

    from servogen.kinematics.catalogue import arm
    from servogen.movemaster import Budget, input_of, manipulator, read, run
    from servogen.outputs import write_text
    from servogen.report.motion_table import joint_lines
    from servogen.units import Clock, Cycles

    source, chosen = read(file), arm(robot)
    done = run(
        source,
        manipulator(chosen),
        Cycles(period_us),
        Clock(CLOCK_HZ),
        inputs=tuple(input_of(each) for each in inputs or ()),
        repeat=repeat,
        budget=Budget(max_commands, Fraction(max_s)),
    )
    if output:
        write_text(output, "".join(f"{line}\n" for line in joint_lines(done.trajectory, chosen)))
    if json:
        as_json({"robot": robot, **done.to_json()}, done.warnings)
        return
    _show(done)
    frames, loop = len(done.trajectory.angles), len(done.trajectory.angles) - done.trajectory.loop_start
    print(f"{file}: {frames} frames, {done.seconds(frames):g} s; the last {loop} of them repeat")
    warn_of_all(done.warnings)


def _show(done: Run) -> None:
    table(
        "Motion",
        ("line", "command", "from s", "for s", "x mm", "y mm", "z mm", "pitch °", "roll °", "hand"),
        [
            (
                step.statement.number or "",
                step.statement.text,
                f"{done.seconds(step.frame):z.2f}",
                f"{done.seconds(step.frames):z.2f}",
                *(f"{value:z.1f}" for value in step.pose.values),
                "closed" if step.hand == "C" else "open",
            )
            for step in done.steps
        ],
    )
    if done.outputs:
        rows = [(f"{done.seconds(each.frame):z.2f}", f"&{each.value:02X}") for each in done.outputs]
        table("Output port", ("at s", "value"), rows)
