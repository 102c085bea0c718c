"""Facts about a walk: its stability margin and where it is smallest, spring deflections, joint ranges.

In: a robot, its gait and its `Walk`. Out: `GaitFacts`, and the gait as a diagram of text.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from servogen.kinematics.protocol import WalkingRobot
from servogen.motion.gait.phases import Gait
from servogen.motion.gait.walk import Walk
from servogen.motion.loads import Loads
from servogen.report.sticks import leg_sticks

if TYPE_CHECKING:
    from servogen.answers import GaitAnswer, JointRange

COLUMNS = 12
"""About how many columns a diagram has; if possible, every lift and landing falls on one."""

SAME_DIGITS = 9
"""Decimals of metres; values within a nanometre are equal, so that all machines name the same frame."""


@dataclass(frozen=True, slots=True)
class JointFacts:
    """The range of a joint of the walk and its limits, radians; its top speed, radians a second."""

    name: str
    minimum: float
    maximum: float
    limits: tuple[float, float]
    speed: float

    def to_json(self) -> JointRange:
        return {
            "name": self.name,
            "minimum_deg": math.degrees(self.minimum),
            "maximum_deg": math.degrees(self.maximum),
            "lower_limit_deg": math.degrees(self.limits[0]),
            "upper_limit_deg": math.degrees(self.limits[1]),
            "peak_speed_deg_s": math.degrees(self.speed),
        }


@dataclass(frozen=True, slots=True)
class GaitFacts:
    """Metres and seconds. `margin` is None for a robot of one or two legs, which stands on something else.

    `margin_frame` and `margin_feet`: where the margin is least; `correction_leg`, `correction_frame`: where a
    spring gives most; `clearance`: the least height above the ground of everything but the feet.
    """

    cycle_s: float
    margin: float | None
    margin_frame: int
    margin_feet: tuple[str, ...]
    correction: float
    correction_leg: str
    correction_frame: int
    lift: float
    clearance: float
    body_height: float
    joints: tuple[JointFacts, ...]


def walk_facts(robot: WalkingRobot, planned: Walk) -> GaitFacts:
    """Return the facts of a whole walk, including its start and stop."""
    frame_s = float(planned.trajectory.clock.seconds(planned.trajectory.period))
    worst = int(np.argmin(np.round(planned.margins, SAME_DIGITS)))
    springs = np.linalg.norm(planned.corrections, axis=2)
    sample, leg = np.unravel_index(int(np.argmax(np.round(springs, SAME_DIGITS))), springs.shape)
    ground = float(planned.feet[:, :, 2].min())
    higher = min(float(part[:, :-1, 2].min()) for part in leg_sticks(robot, planned))
    return GaitFacts(
        cycle_s=frame_s * planned.frames_per_cycle,
        margin=None if planned.minimum_margin_m == math.inf else planned.minimum_margin_m,
        margin_frame=worst,
        margin_feet=tuple(
            name for name, down in zip(planned.legs, planned.ground[worst], strict=True) if down
        ),
        correction=planned.largest_correction_m,
        correction_leg=planned.legs[int(leg)],
        correction_frame=int(sample),
        lift=planned.lift_m,
        clearance=higher - ground,
        body_height=-ground,
        joints=_joints(robot, planned, frame_s),
    )


def _joints(robot: WalkingRobot, planned: Walk, frame_s: float) -> tuple[JointFacts, ...]:
    angles, loop = planned.trajectory.angles, planned.trajectory.loop_start
    speeds = np.abs(np.diff(angles, axis=0, append=angles[loop : loop + 1])).max(axis=0) / frame_s
    own = [joint for leg in robot.limbs for joint in leg.joints.values()]
    return tuple(
        JointFacts(
            name=name,
            minimum=float(column.min()),
            maximum=float(column.max()),
            limits=(joint.lower, joint.upper),
            speed=float(speed),
        )
        for name, column, joint, speed in zip(planned.trajectory.joints, angles.T, own, speeds, strict=True)
    )


def diagram(gait: Gait) -> dict[str, str]:
    """Return for each leg a line over one cycle: ▔ in the air, ▁ on the ground."""
    columns = gait.grain * max(1, COLUMNS // gait.grain) if gait.grain <= 2 * COLUMNS else COLUMNS
    return {
        leg: "".join(
            "▔" if (column / columns - float(lift) + 1e-9) % 1 < float(gait.swing) - 1e-9 else "▁"
            for column in range(columns)
        )
        for leg, lift in gait.lifts
    }


def walk_to_json(
    robot: WalkingRobot, rhythm: Gait, planned: Walk, facts: GaitFacts, loads: Loads | None
) -> GaitAnswer:
    """Return the walk; the units are in the names."""
    worst, slip = loads.worst if loads else None, planned.slip
    return {
        "robot": robot.name,
        "gait": rhythm.name,
        "duty": float(rhythm.duty),
        "lifts": {leg: float(lift) for leg, lift in rhythm.lifts},
        "frames": len(planned.trajectory.angles),
        "loop_start": planned.trajectory.loop_start,
        "frames_per_cycle": planned.frames_per_cycle,
        "cycle_s": facts.cycle_s,
        "phase_changes": [
            {
                "what": change.what,
                "asked": float(change.asked),
                "used": float(change.used),
                "frames": float(change.frames),
            }
            for change in planned.changes
        ],
        "stability": None
        if facts.margin is None
        else {
            "minimum_m": facts.margin if facts.margin_feet else None,
            "frame": facts.margin_frame,
            "feet": list(facts.margin_feet),
        },
        "spring": {
            "largest_m": facts.correction,
            "leg": facts.correction_leg,
            "frame": facts.correction_frame,
        },
        "slip": {"largest_m": slip.metres, "leg": slip.leg, "frame": slip.frame},
        "lost_motion": {"angle_deg": math.degrees(planned.lost), "swing_beyond": planned.beyond},
        "centres_of_rotation_m": [
            None if centre is None else [centre.real, centre.imag] for centre in planned.centres
        ],
        "held_back": [{"leg": held.leg, "angle_deg": math.degrees(held.angle)} for held in planned.held_back],
        "first_millimetre_m": planned.liftoff_slide_m,
        "torque": None
        if loads is None or worst is None
        else {
            "largest_nm": float(loads.torques[worst[1], worst[0]]),
            "leg": loads.legs[worst[0]],
            "frame": worst[1],
            "foot_n": float(loads.forces[worst[1], worst[0]]),
        },
        "lift_m": facts.lift,
        "clearance_m": facts.clearance,
        "body_height_m": facts.body_height,
        "joints": [joint.to_json() for joint in facts.joints],
    }
