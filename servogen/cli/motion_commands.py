"""Commands that plan motions without a job: gait, run-program."""

from __future__ import annotations

from math import cos, degrees, radians, sin
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Animate, Csv, Json, Plot
from servogen.cli.show import as_json, status, table, warn_of_all
from servogen.errors import Diagnostic

if TYPE_CHECKING:
    from servogen.kinematics.protocol import WalkingRobot
    from servogen.motion.gait.phases import Gait
    from servogen.motion.gait.walk import Walk
    from servogen.movemaster import ProgramRun
    from servogen.report.gait_facts import GaitFacts


def register(app: typer.Typer) -> None:
    """Add the commands of this module to the application."""
    app.command()(gait)
    app.command("run-program")(run_program)


CLOCK_HZ = 4_000_000
"""Its instruction cycle is 1 µs, so that a period in µs is also a period in cycles."""

MAX_MM = 100_000
"""The largest length that is not taken for a typing error."""


def gait(
    robot: Annotated[
        str, typer.Argument(help="A walking robot: a catalogue name or a TOML file.")
    ] = "hexapod",
    name: Annotated[
        str, typer.Option("--gait", help="The gait: tripod, ripple, wave; crawl, trot; tetrapod.")
    ] = "tripod",
    duty: Annotated[
        float | None,
        typer.Option(
            "--duty", help="A custom gait: the fraction of a cycle for which a foot is on the ground."
        ),
    ] = None,
    lifts: Annotated[
        str | None,
        typer.Option(
            "--lifts",
            help="A custom gait: the phase at which each leg lifts, L1=0,L2=0.5,… or 0,0.5,… in order.",
        ),
    ] = None,
    stride_mm: Annotated[
        float,
        typer.Option("--stride-mm", min=-MAX_MM, max=MAX_MM, help="How far the body moves in a cycle."),
    ] = 40.0,
    direction_deg: Annotated[
        float,
        typer.Option(
            "--direction-deg", min=-360, max=360, help="Direction of the stride: 0 is forward, 90 is left."
        ),
    ] = 0.0,
    turn_deg: Annotated[
        float,
        typer.Option(
            "--turn-deg", min=-360, max=360, help="How far the body turns in a cycle, counter-clockwise."
        ),
    ] = 0.0,
    lift_mm: Annotated[
        float, typer.Option("--lift-mm", min=0, max=MAX_MM, help="How high the feet are lifted.")
    ] = 20.0,
    clearance_mm: Annotated[
        float | None,
        typer.Option(
            "--clearance-mm", min=0, max=MAX_MM, help="Refuse a walk with less ground clearance than this."
        ),
    ] = None,
    body_height_mm: Annotated[
        float | None,
        typer.Option(
            "--body-height-mm",
            min=0,
            max=MAX_MM,
            help="Height of the body (default: as high as the legs reach).",
        ),
    ] = None,
    stance_width_mm: Annotated[
        float | None,
        typer.Option(
            "--stance-width-mm",
            min=0,
            max=MAX_MM,
            help="Distance from left to right feet (default: that with the least correction).",
        ),
    ] = None,
    body_shift_mm: Annotated[
        tuple[float, float],
        typer.Option(
            "--body-shift-mm", help="How far forward and to the left the body stands over its feet."
        ),
    ] = (0.0, 0.0),
    body_yaw_deg: Annotated[
        float, typer.Option("--body-yaw-deg", min=-180, max=180, help="How far it is turned over its feet.")
    ] = 0.0,
    body_tilt_deg: Annotated[
        tuple[float, float],
        typer.Option(
            "--body-tilt-deg", help="Its roll and pitch: positive lowers the right side, the front."
        ),
    ] = (0.0, 0.0),
    margin_mm: Annotated[
        float | None,
        typer.Option(
            "--margin-mm", min=0, help="How far inside the other feet it leans before a foot lifts."
        ),
    ] = None,
    beta_sign: Annotated[
        int, typer.Option("--beta-sign", help="1: lifted feet move backwards; -1: forwards.")
    ] = 1,
    cycles: Annotated[
        float | None,
        typer.Option(
            "--cycles", min=0, help="Start, walk this many cycles and stop (default: walk endlessly)."
        ),
    ] = None,
    cycle_s: Annotated[
        float | None,
        typer.Option(
            "--cycle-s",
            min=0,
            help="Duration of a cycle, rounded up until the legs lift at whole frames (default: as "
            "fast as possible).",
        ),
    ] = None,
    servo: Annotated[
        str, typer.Option("--servo", help="The servo model of the joints, whose speed is the limit.")
    ] = "mpx-tiny-s",
    period_us: Annotated[
        int, typer.Option("--period-us", min=1000, max=1_000_000, help="Frame period in µs.")
    ] = 20_000,
    leg: Annotated[str | None, typer.Option("--leg", help="Plan only this leg.")] = None,
    spring_mm: Annotated[
        float | None,
        typer.Option(
            "--spring-mm", min=0, help="Refuse a walk that deflects a leg's spring by more than this."
        ),
    ] = None,
    gap_mm: Annotated[
        float,
        typer.Option(
            "--gap-mm", min=0, max=MAX_MM, help="Refuse legs whose middle lines come nearer than this."
        ),
    ] = 12.0,
    compensate: Annotated[
        bool,
        typer.Option(
            "--compensate/--no-compensate",
            help="Compensate in swings for the motion that servos lose when a joint reverses.",
        ),
    ] = True,
    allow_falling: Annotated[
        bool,
        typer.Option("--allow-falling", help="Plan a walk even if its stability margin is negative."),
    ] = False,
    picture: Plot = None,
    csv: Csv = None,
    animate: Animate = None,
    json: Json = False,
) -> None:
    """Plan a walk and show its gait, stability, spring deflections and joint ranges."""
    from fractions import Fraction

    from servogen.errors import InputError, Location
    from servogen.kinematics.protocol import Posture
    from servogen.motion.gait.steps import Segment
    from servogen.motion.gait.walk import walk
    from servogen.motion.limits import JointLimits
    from servogen.motion.loads import check_loads, loads_of
    from servogen.report.gait_facts import facts_of, walk_to_json
    from servogen.robot.servo_models import servo_model
    from servogen.units import Clock, Cycles

    chosen, model = _robot(robot), servo_model(servo)
    rhythm, walker = _gait(chosen, name, duty, lifts, leg)
    if beta_sign not in (1, -1):
        raise InputError(
            "bad-option", f"the sign of β is 1 or -1, not {beta_sign}", Location(key="--beta-sign")
        )
    direction = radians(direction_deg)
    segment = Segment(
        stride_mm / 1000 * cos(direction), stride_mm / 1000 * sin(direction), radians(turn_deg), cycles
    )
    period, clock = Cycles(period_us), Clock(CLOCK_HZ)
    frames = (
        None if cycle_s is None else -(-Fraction(cycle_s).limit_denominator(10**6) // clock.seconds(period))
    )
    planned_walk = walk(
        walker,
        rhythm,
        [segment],
        Posture(
            _metres(body_height_mm),
            _metres(stance_width_mm),
            lift_mm / 1000,
            beta_sign,
            margin=_metres(margin_mm),
            shift=complex(*body_shift_mm) / 1000,
            yaw=radians(body_yaw_deg),
            roll=radians(body_tilt_deg[0]),
            pitch=radians(body_tilt_deg[1]),
        ),
        period,
        clock,
        frames_per_cycle=frames,
        limits=JointLimits(model.speed or float("inf")),
        spring_m=_metres(spring_mm),
        allow_falling=allow_falling,
        gap=gap_mm / 1000,
        lost=model.lost_motion(model.calibration) if compensate else 0.0,
    )
    facts, loads = facts_of(walker, planned_walk), loads_of(walker, planned_walk)
    if clearance_mm is not None and 1000 * facts.clearance < clearance_mm:
        raise InputError(
            "out-of-reach",
            f"the ground clearance is {1000 * facts.clearance:z.1f} mm, less than the {clearance_mm:g} mm "
            "required",
            Location(key="--clearance-mm"),
            "raise the body, or use legs with a longer foot part",
        )
    _write_walk(walker, rhythm, planned_walk, facts, picture, csv, animate)
    upright = planned_walk.full_height()
    warnings = [
        *check_loads(loads, walker.lifting_joint, model),
        *([Diagnostic("warning", "full-height", upright)] if upright else []),
    ]
    if json:
        as_json(walk_to_json(walker, rhythm, planned_walk, facts, loads), warnings)
    else:
        _show_walk(walker, rhythm, planned_walk, facts)
        warn_of_all(warnings)


def _metres(millimetres: float | None) -> float | None:
    return None if millimetres is None else millimetres / 1000


def _robot(name: str) -> WalkingRobot:
    from servogen.errors import InputError
    from servogen.kinematics.catalogue import robot
    from servogen.kinematics.protocol import WalkingRobot

    walker = robot(name)
    if not isinstance(walker, WalkingRobot):
        raise InputError(
            "wrong-robot-kind",
            f"{walker.name} does not walk",
            hint='hexapod does, and a file with kind = "hexapod"',
        )
    return walker


def _gait(
    robot: WalkingRobot, name: str, duty: float | None, lifts: str | None, leg: str | None
) -> tuple[Gait, WalkingRobot]:
    """Return the gait, and the robot with the legs that walk."""
    from servogen.errors import InputError, Location
    from servogen.motion.gait.phases import Gait, custom
    from servogen.motion.gait.phases import gait as named

    if (duty is None) != (lifts is None):
        raise InputError(
            "missing-option",
            "a custom gait needs a duty factor and the phase of each leg",
            Location(key="--lifts" if lifts is None else "--duty"),
            "give both: --duty 0.5 --lifts L1=0,L2=0.5,…",
        )
    rhythm = (
        named(name, robot) if duty is None or lifts is None else custom("own", duty, _phases(lifts), robot)
    )
    if leg is None:
        return rhythm, robot
    walker = robot.with_leg(leg)
    return Gait(rhythm.name, rhythm.duty, tuple(lift for lift in rhythm.lifts if lift[0] == leg)), walker


def _phases(text: str) -> dict[str, float] | list[float]:
    """Return phases by leg (`L1=0,L2=0.5`) or in the order of the legs (`0,0.5`). Raises InputError."""
    from servogen.errors import InputError, Location

    parts = [part.strip() for part in text.split(",")]
    try:
        if "=" not in text:
            return [float(part) for part in parts]
        pairs = [part.split("=") for part in parts]
        return {leg.strip(): float(phase) for leg, phase in pairs}
    except ValueError:
        raise InputError(
            "bad-option",
            f"'{text}' is not a table of phases",
            Location(key="--lifts"),
            "write L1=0,L2=0.5,… or 0,0.5,…",
        ) from None


def _write_walk(
    robot: WalkingRobot,
    rhythm: Gait,
    planned_walk: Walk,
    facts: GaitFacts,
    picture: Path | None,
    csv: Path | None,
    animate: Path | None,
) -> None:
    from servogen.outputs import write_text

    if csv:
        from servogen.report.motion_table import walk_lines

        write_text(csv, "".join(f"{line}\n" for line in walk_lines(planned_walk)))
    if picture:
        from servogen.report.gait_plot import gait_plot

        gait_plot(robot, rhythm, planned_walk, facts, picture)
    if animate:
        from servogen.report.film import film, walk_scene

        with status(f"filming {animate}"):
            film(walk_scene(robot, planned_walk), animate)


def _show_walk(robot: WalkingRobot, rhythm: Gait, planned_walk: Walk, facts: GaitFacts) -> None:
    """Print the gait's table, the joints', stability and springs."""
    from servogen.report.gait_facts import diagram

    lines = diagram(rhythm)
    table(
        f"Gait '{rhythm.name}', duty {rhythm.duty}",
        ("leg", "lifts at", "lands at", "one cycle, ▔ in the air"),
        [(leg, str(lift), str((lift + rhythm.swing) % 1), lines[leg]) for leg, lift in rhythm.lifts],
    )
    table(
        "Joints",
        ("joint", "from °", "to °", "limits °", "peak °/s"),
        [
            (
                joint.name,
                f"{degrees(joint.minimum):z.2f}",
                f"{degrees(joint.maximum):z.2f}",
                f"{degrees(joint.limits[0]):zg} to {degrees(joint.limits[1]):zg}",
                f"{degrees(joint.speed):z.1f}",
            )
            for joint in facts.joints
        ],
    )
    frames, loop = (
        len(planned_walk.trajectory.angles),
        len(planned_walk.trajectory.angles) - planned_walk.trajectory.loop_start,
    )
    stretched = planned_walk.stretched_text()
    print(f"a cycle: {planned_walk.frames_per_cycle} frames, {facts.cycle_s:g} s{stretched}")
    for change in planned_walk.changes:
        print(change.text())
    again = f"the last {loop} of them repeat" if loop < frames else "start and stop included, and again"
    print(f"the walk: {frames} frames, {again}")
    if facts.margin is not None:
        feet, frame = ", ".join(facts.margin_feet), facts.margin_frame
        minimum = f"at least {1000 * facts.margin:z.2f} mm (frame {frame}, on {feet})"
        print(f"stability margin: {minimum if feet else f'none, no foot is on the ground in frame {frame}'}")
    if facts.correction > 0:
        where = f"{facts.correction_leg}, frame {facts.correction_frame}"
        print(f"springs: they give up to {1000 * facts.correction:z.2f} mm ({where})")
    for _, text in planned_walk.centre_texts():
        print(text)
    for held in planned_walk.held_back:
        print(held.text())
    print(planned_walk.slip.text())
    lost_motion = planned_walk.lost_motion_text()
    if lost_motion is not None:
        print(lost_motion)
    print(
        f"feet rise {1000 * facts.lift:z.1f} mm, body {1000 * facts.body_height:z.1f} mm above the ground, "
        f"{1000 * facts.clearance:z.1f} mm free under it and its legs"
    )


def run_program(
    file: Annotated[Path, typer.Argument(help="An arm program (.rvm).", show_default=False)],
    robot: Annotated[
        str, typer.Option("--robot", help="The robot: a catalogue name or a TOML file.")
    ] = "rv-m1",
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            help="The value of the input port from a time in seconds on, such as 1.5=&1F (repeatable).",
        ),
    ] = None,
    period_us: Annotated[int, typer.Option("--period-us", min=1000, help="Frame period in µs.")] = 20_000,
    repeat: Annotated[bool, typer.Option("--repeat", help="Repeat the program endlessly.")] = False,
    max_commands: Annotated[
        int,
        typer.Option(
            "--max-commands", min=1, help="Stop a program that does not end after this many commands."
        ),
    ] = 100_000,
    max_s: Annotated[
        float, typer.Option("--max-s", min=1, help="Stop it after this many seconds of motion.")
    ] = 3600,
    output: Annotated[
        Path | None, typer.Option("--csv", help="Write the joint positions of each frame (degrees, mm).")
    ] = None,
    json: Json = False,
) -> None:
    """Run an arm program: show its moves with their times, and what it writes to its output port."""
    from fractions import Fraction

    from servogen.kinematics.catalogue import arm
    from servogen.movemaster import Budget, input_of, manipulator, read, run
    from servogen.outputs import write_text
    from servogen.report.motion_table import joint_lines
    from servogen.units import Clock, Cycles

    source, chosen = read(file), arm(robot)
    program_run = run(
        source,
        manipulator(chosen),
        Cycles(period_us),
        Clock(CLOCK_HZ),
        inputs=tuple(input_of(text) for text in inputs or ()),
        repeat=repeat,
        budget=Budget(max_commands, Fraction(max_s)),
    )
    if output:
        write_text(output, "".join(f"{line}\n" for line in joint_lines(program_run.trajectory, chosen)))
    if json:
        as_json({"robot": robot, **program_run.to_json()}, program_run.warnings)
        return
    _show_run(program_run)
    frames, loop = (
        len(program_run.trajectory.angles),
        len(program_run.trajectory.angles) - program_run.trajectory.loop_start,
    )
    print(f"{file}: {frames} frames, {program_run.seconds(frames):g} s; the last {loop} of them repeat")
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
