"""`servogen gait`: plans a walk without a job."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import cos, degrees, radians, sin
from typing import Annotated

import typer

from servogen.cli.options import CLOCK_HZ, Animate, Csv, Json, PeriodUs, Plot, table_option, usual
from servogen.cli.show import as_json, next_step, print_lines, status, table, warn_of_all
from servogen.errors import Diagnostic, InputError, Location
from servogen.job.schema import MAX_MM, RoutineTable, SegmentTable, WalkTable
from servogen.job.starter import KINDS
from servogen.kinematics.catalogue import robot
from servogen.kinematics.protocol import Posture, WalkingRobot
from servogen.motion.gait.phases import Gait, custom
from servogen.motion.gait.phases import gait as named
from servogen.motion.gait.steps import SAME_M, Segment
from servogen.motion.gait.walk import Walk, walk
from servogen.motion.limits import JointLimits
from servogen.motion.loads import check_loads, walk_loads
from servogen.outputs import write_text
from servogen.report.film import film, walk_scene
from servogen.report.gait_facts import GaitFacts, diagram, walk_facts, walk_to_json
from servogen.report.gait_plot import gait_plot
from servogen.report.motion_table import walk_lines
from servogen.robot.servo_models import servo_model
from servogen.units import Clock, Cycles


@dataclass(frozen=True, slots=True)
class GaitOptions:
    """The gait, and how the body moves; ranges and defaults are those of a job's [walk]."""

    name: Annotated[
        str, typer.Option("--gait", help="The gait: tripod, ripple, wave; crawl, trot; tetrapod.")
    ] = usual(WalkTable, "gait")
    duty: Annotated[
        float | None,
        table_option(
            WalkTable, "duty", "A custom gait: the fraction of a cycle for which a foot is on the ground."
        ),
    ] = usual(WalkTable, "duty")
    lifts: Annotated[
        str | None, "A custom gait: the phase at which each leg lifts, L1=0,L2=0.5,… or 0,0.5,… in order."
    ] = None
    stride_mm: Annotated[
        float, table_option(SegmentTable, "forward_mm", "How far the body moves in a cycle.", "--stride-mm")
    ] = 40.0
    direction_deg: Annotated[
        float,
        table_option(RoutineTable, "direction_deg", "Direction of the stride: 0 is forward, 90 is left."),
    ] = 0.0
    turn_deg: Annotated[
        float, table_option(SegmentTable, "turn_deg", "How far the body turns in a cycle, counter-clockwise.")
    ] = usual(SegmentTable, "turn_deg")
    cycles: Annotated[
        float | None,
        table_option(
            SegmentTable, "cycles", "Start, walk this many cycles and stop (default: walk endlessly)."
        ),
    ] = usual(SegmentTable, "cycles")
    cycle_s: Annotated[
        float | None,
        table_option(
            WalkTable,
            "cycle_s",
            "Duration of a cycle, rounded up until the legs lift at whole frames (default: as fast as "
            "possible).",
        ),
    ] = usual(WalkTable, "cycle_s")
    leg: Annotated[str | None, "Plan only this leg."] = None

    @property
    def segment(self) -> Segment:
        """Return the body's motion, in metres and radians."""
        stride, direction = self.stride_mm / 1000, radians(self.direction_deg)
        return Segment(stride * cos(direction), stride * sin(direction), radians(self.turn_deg), self.cycles)


@dataclass(frozen=True, slots=True)
class PostureOptions:
    """The body and its legs."""

    lift_mm: Annotated[float, table_option(WalkTable, "lift_mm", "How high the feet are lifted.")] = usual(
        WalkTable, "lift_mm"
    )
    clearance_mm: Annotated[
        float | None,
        typer.Option(min=0, max=MAX_MM, help="Refuse a walk with less ground clearance than this."),
    ] = None
    body_height_mm: Annotated[
        float | None,
        table_option(WalkTable, "body_height_mm", "Height of the body (default: as high as the legs reach)."),
    ] = usual(WalkTable, "body_height_mm")
    stance_width_mm: Annotated[
        float | None,
        table_option(
            WalkTable,
            "stance_width_mm",
            "Distance from left to right feet (default: that with the least correction).",
        ),
    ] = usual(WalkTable, "stance_width_mm")
    body_shift_mm: Annotated[
        tuple[float, float], "How far forward and to the left the body stands over its feet."
    ] = (0.0, 0.0)
    body_yaw_deg: Annotated[
        float, table_option(WalkTable, "body_yaw_deg", "How far it is turned over its feet.")
    ] = 0.0
    body_tilt_deg: Annotated[
        tuple[float, float], "Its roll and pitch: positive lowers the right side, the front."
    ] = (0.0, 0.0)
    margin_mm: Annotated[
        float | None,
        table_option(WalkTable, "margin_mm", "How far inside the other feet it leans before a foot lifts."),
    ] = usual(WalkTable, "margin_mm")
    beta_sign: Annotated[int, "1: lifted feet move backwards; -1: forwards."] = 1
    spring_mm: Annotated[
        float | None,
        table_option(WalkTable, "spring_mm", "Refuse a walk that deflects a leg's spring by more than this."),
    ] = usual(WalkTable, "spring_mm")
    gap_mm: Annotated[
        float, table_option(WalkTable, "gap_mm", "Refuse legs whose middle lines come nearer than this.")
    ] = usual(WalkTable, "gap_mm")
    compensate: Annotated[
        bool,
        typer.Option(
            "--compensate/--no-compensate",
            help="Compensate in swings for the motion that servos lose when a joint reverses.",
        ),
    ] = usual(WalkTable, "compensate")
    allow_falling: Annotated[bool, "Plan a walk even if its stability margin is negative."] = usual(
        WalkTable, "allow_falling"
    )

    @property
    def posture(self) -> Posture:
        """Return the posture, in metres. Raises InputError."""
        if self.beta_sign not in (1, -1):
            raise InputError(
                "bad-option", f"the sign of β is 1 or -1, not {self.beta_sign}", Location(key="--beta-sign")
            )
        height, width = _metres(self.body_height_mm), _metres(self.stance_width_mm)
        return Posture(
            height,
            width,
            self.lift_mm / 1000,
            self.beta_sign,
            margin=_metres(self.margin_mm),
            shift=complex(*self.body_shift_mm) / 1000,
            yaw=radians(self.body_yaw_deg),
            roll=radians(self.body_tilt_deg[0]),
            pitch=radians(self.body_tilt_deg[1]),
        )

    def check_clearance(self, clearance: float) -> None:
        """Raise InputError if the free height under the robot, in metres, is less than required."""
        if self.clearance_mm is not None and 1000 * clearance < self.clearance_mm:
            raise InputError(
                "out-of-reach",
                f"the ground clearance is {1000 * clearance:z.1f} mm, less than the {self.clearance_mm:g} mm "
                "required",
                Location(key="--clearance-mm"),
                "raise the body, or use legs with a longer foot part",
            )


@dataclass(frozen=True, slots=True)
class JointOptions:
    """The servos, and their frames."""

    servo: Annotated[str, "The servo model of the joints, whose speed is the limit."] = "mpx-tiny-s"
    period_us: PeriodUs = 20_000


@dataclass(frozen=True, slots=True)
class GaitFiles:
    """The files to write."""

    picture: Plot = None
    csv: Csv = None
    animate: Animate = None


def gait(
    walking: GaitOptions,
    legs: PostureOptions,
    joints: JointOptions,
    files: GaitFiles,
    robot: Annotated[
        str, typer.Argument(help="A walking robot: a catalogue name or a TOML file.")
    ] = "hexapod",
    json: Json = False,
) -> None:
    """Plan a walk and show its gait, stability, spring deflections and joint ranges."""
    model = servo_model(joints.servo)
    rhythm, walker = _gait(_robot(robot), walking)
    period, clock = Cycles(joints.period_us), Clock(CLOCK_HZ)
    seconds = None if walking.cycle_s is None else Fraction(walking.cycle_s).limit_denominator(10**6)
    planned_walk = walk(
        walker,
        rhythm,
        [walking.segment],
        legs.posture,
        period,
        clock,
        frames_per_cycle=None if seconds is None else -(-seconds // clock.seconds(period)),
        limits=JointLimits(model.speed or float("inf")),
        spring_m=_metres(legs.spring_mm),
        allow_falling=legs.allow_falling,
        gap=legs.gap_mm / 1000,
        lost=model.lost_motion(model.calibration) if legs.compensate else 0.0,
    )
    facts, loads = walk_facts(walker, planned_walk), walk_loads(walker, planned_walk)
    legs.check_clearance(facts.clearance)
    _write_walk(walker, rhythm, planned_walk, facts, files)
    upright = planned_walk.full_height()
    warnings = [
        *check_loads(loads, walker.lifting_joint, model),
        *([Diagnostic("warning", "full-height", upright)] if upright else []),
    ]
    if json:
        as_json(walk_to_json(walker, rhythm, planned_walk, facts, loads), warnings)
    else:
        show_walk(walker, rhythm, planned_walk, facts)
        if files.csv or files.picture or files.animate:
            print(next_step("new", "--robot", robot) if robot in KINDS else next_step("robots", robot))
        warn_of_all(warnings)


def _metres(millimetres: float | None) -> float | None:
    return None if millimetres is None else millimetres / 1000


def _robot(name: str) -> WalkingRobot:
    walker = robot(name)
    if not isinstance(walker, WalkingRobot):
        raise InputError(
            "wrong-robot-kind",
            f"{walker.name} does not walk",
            hint='hexapod does, and a file with kind = "hexapod"',
        )
    return walker


def _gait(robot: WalkingRobot, walking: GaitOptions) -> tuple[Gait, WalkingRobot]:
    """Return the gait, and the robot with the legs that walk."""
    duty, lifts = walking.duty, walking.lifts
    if (duty is None) != (lifts is None):
        raise InputError(
            "missing-option",
            "a custom gait needs a duty factor and the phase of each leg",
            Location(key="--lifts" if lifts is None else "--duty"),
            "give both: --duty 0.5 --lifts L1=0,L2=0.5,…",
        )
    if duty is None or lifts is None:
        rhythm = named(walking.name, robot)
    else:
        rhythm = custom("own", duty, _phases(lifts), robot)
    if walking.leg is None:
        return rhythm, robot
    lifted = tuple(lift for lift in rhythm.lifts if lift[0] == walking.leg)
    return Gait(rhythm.name, rhythm.duty, lifted), robot.with_leg(walking.leg)


def _phases(text: str) -> dict[str, float] | list[float]:
    """Return phases by leg (`L1=0,L2=0.5`) or in the order of the legs (`0,0.5`). Raises InputError."""
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
    robot: WalkingRobot, rhythm: Gait, planned_walk: Walk, facts: GaitFacts, files: GaitFiles
) -> None:
    if files.csv:
        write_text(files.csv, "".join(f"{line}\n" for line in walk_lines(planned_walk)))
    if files.picture:
        gait_plot(robot, rhythm, planned_walk, facts, files.picture)
    if files.animate:
        with status(f"filming {files.animate}"):
            film(walk_scene(robot, planned_walk), files.animate)


def show_walk(robot: WalkingRobot, rhythm: Gait, planned_walk: Walk, facts: GaitFacts) -> None:
    """Print the gait's table, the joints', stability and springs."""
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
    print_lines(_walk_lines(planned_walk, facts))


def _walk_lines(planned_walk: Walk, facts: GaitFacts) -> Iterator[str]:
    """Yield what stands below the tables."""
    frames = len(planned_walk.trajectory.angles)
    loop = frames - planned_walk.trajectory.loop_start
    stretched = planned_walk.stretched_text()
    yield f"a cycle: {planned_walk.frames_per_cycle} frames, {facts.cycle_s:g} s{stretched}"
    yield from (change.text() for change in planned_walk.changes)
    again = f"the last {loop} of them repeat" if loop < frames else "start and stop included, and again"
    yield f"the walk: {frames} frames, {again}"
    if facts.margin is not None:
        feet, frame = ", ".join(facts.margin_feet), facts.margin_frame
        minimum = f"at least {1000 * facts.margin:z.2f} mm (frame {frame}, on {feet})"
        yield f"stability margin: {minimum if feet else f'none, no foot is on the ground in frame {frame}'}"
    if facts.correction > SAME_M:
        where = f"{facts.correction_leg}, frame {facts.correction_frame}"
        yield f"springs, or feet, yield by up to {1000 * facts.correction:z.2f} mm ({where})"
    yield from (text for _, text in planned_walk.centre_texts())
    yield from (held.text() for held in planned_walk.held_back)
    yield planned_walk.slip.text()
    lost_motion = planned_walk.lost_motion_text()
    if lost_motion is not None:
        yield lost_motion
    yield (
        f"feet rise {1000 * facts.lift:z.1f} mm, body {1000 * facts.body_height:z.1f} mm above the ground, "
        f"{1000 * facts.clearance:z.1f} mm free under it and its legs"
    )
