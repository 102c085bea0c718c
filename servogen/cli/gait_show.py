"""How a walk is shown to people: its tables."""

from __future__ import annotations

from math import degrees
from typing import TYPE_CHECKING

from servogen.cli.show import table

if TYPE_CHECKING:
    from servogen.kinematics.protocol import WalkingRobot
    from servogen.motion.gait.phases import Gait
    from servogen.motion.gait.walk import Walk
    from servogen.report.gait_facts import GaitFacts


def show_walk(robot: WalkingRobot, rhythm: Gait, made: Walk, facts: GaitFacts) -> None:
    """The gait's table, the joints', stability and springs."""
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
                each.name,
                f"{degrees(each.least):z.2f}",
                f"{degrees(each.greatest):z.2f}",
                f"{degrees(each.limits[0]):zg} to {degrees(each.limits[1]):zg}",
                f"{degrees(each.speed):z.1f}",
            )
            for each in facts.joints
        ],
    )
    frames, loop = len(made.trajectory.angles), len(made.trajectory.angles) - made.trajectory.loop_start
    print(f"a cycle: {made.frames_per_cycle} frames, {facts.cycle_s:g} s")
    for change in made.changes:
        print(change.text())
    again = f"the last {loop} of them repeat" if loop < frames else "start and stop included, and again"
    print(f"the walk: {frames} frames, {again}")
    if facts.margin is not None:
        feet, frame = ", ".join(facts.margin_feet), facts.margin_frame
        least = f"at least {1000 * facts.margin:z.2f} mm (frame {frame}, on {feet})"
        print(f"stability margin: {least if feet else f'none, no foot is on the ground in frame {frame}'}")
    if facts.correction > 0:
        where = f"{facts.correction_leg}, frame {facts.correction_frame}"
        print(f"springs: they give up to {1000 * facts.correction:z.2f} mm ({where})")
    for _, text in made.centre_texts():
        print(text)
    for each in made.held_back:
        print(each.text())
    print(made.slip.text())
    print(
        f"feet rise {1000 * facts.lift:z.1f} mm, body {1000 * facts.body_height:z.1f} mm above the ground, "
        f"{1000 * facts.clearance:z.1f} mm free under it and its legs"
    )
