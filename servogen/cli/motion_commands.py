"""Commands of motion: run-program."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json
from servogen.cli.show import as_json, table, warn_of_all

if TYPE_CHECKING:
    from servogen.movemaster import Run
    from servogen.movemaster.memory import Pose
    from servogen.robot.model import Arm

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
    repeat: Annotated[bool, typer.Option("--repeat", help="Run the program for ever.")] = False,
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
        write_text(output, _csv(done, chosen))
    if json:
        as_json(_as_dict(done, robot))
        return
    _show(done)
    frames, loop = len(done.trajectory.angles), len(done.trajectory.angles) - done.trajectory.loop_start
    print(f"{file}: {frames} frames, {_seconds(done, frames):g} s; the last {loop} of them for ever")
    warn_of_all(done.warnings)


def _show(done: Run) -> None:
    table(
        "Motion",
        ("line", "command", "from s", "for s", "x mm", "y mm", "z mm", "pitch °", "roll °", "hand"),
        [
            (
                step.statement.number or "",
                step.statement.text,
                f"{_seconds(done, step.frame):z.2f}",
                f"{_seconds(done, step.frames):z.2f}",
                *(f"{value:z.1f}" for value in step.pose.values),
                "closed" if step.hand == "C" else "open",
            )
            for step in done.steps
        ],
    )
    if done.outputs:
        rows = [(f"{_seconds(done, each.frame):z.2f}", f"&{each.value:02X}") for each in done.outputs]
        table("Output port", ("at s", "value"), rows)


def _seconds(done: Run, frames: int) -> float:
    return float(done.trajectory.clock.seconds(frames * done.trajectory.period))


def _csv(done: Run, arm: Arm) -> str:
    """A row a frame: time, then each joint in degrees or millimetres."""
    from math import degrees

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time_s", *(f"{joint.name}_{'deg' if joint.turning else 'mm'}" for joint in arm.joints)])
    for frame, row in enumerate(done.trajectory.angles.tolist()):
        shown = (
            degrees(value) if joint.turning else 1000 * value
            for joint, value in zip(arm.joints, row, strict=True)
        )
        writer.writerow([f"{_seconds(done, frame):.6g}", *(f"{value:z.6f}" for value in shown)])
    return text.getvalue()


def _as_dict(done: Run, robot: str) -> dict[str, object]:
    """Metres, radians and seconds."""
    return {
        "robot": robot,
        "joints": list(done.trajectory.joints),
        "period_s": _seconds(done, 1),
        "frames": len(done.trajectory.angles),
        "loop_start": done.trajectory.loop_start,
        "steps": [
            {
                "line": step.statement.number,
                "command": step.statement.text,
                "start_s": _seconds(done, step.frame),
                "duration_s": _seconds(done, step.frames),
                **_pose(step.pose),
                "hand": "closed" if step.hand == "C" else "open",
            }
            for step in done.steps
        ],
        "outputs": [
            {"time_s": _seconds(done, each.frame), "value": each.value, "strobe": each.strobe}
            for each in done.outputs
        ],
        "positions": {str(number): _pose(each.pose) for number, each in done.positions.items()},
        "counters": {str(number): value for number, value in done.counters.items()},
        "final_joints": done.trajectory.angles[-1].tolist(),
        "warnings": [{"code": warning.code, "text": str(warning)} for warning in done.warnings],
    }


def _pose(pose: Pose) -> dict[str, object]:
    from math import radians

    x, y, z, p, r = pose.values
    return {"position_m": [x / 1000, y / 1000, z / 1000], "pitch": radians(p), "roll": radians(r)}
