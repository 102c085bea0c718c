"""The kind `arm`: serial arms, and single legs, by their Denavit–Hartenberg rows.

In: an `Arm`. Out: its facts as values that JSON can hold. Its file is read by `robot.arm_file`.
"""

from __future__ import annotations

from math import degrees

from servogen.kinematics.mobility import of_arm
from servogen.kinematics.orientation import orientation_names
from servogen.kinematics.protocol import Answer, RobotKind
from servogen.robot.arm_file import ArmTable, arm_of
from servogen.robot.model import Arm, FixedFrame, Length


def arm_details(arm: Arm) -> Answer:
    """Return the joints with their limits, the rows and the lengths of an arm or leg."""
    return {
        "convention": arm.convention,
        "closed_form": arm.closed_form,
        "target": ["x", "y", "z", *orientation_names(arm)],
        "lengths_m": arm.length,
        "joints": [
            {
                "name": joint.name,
                "kind": joint.kind,
                f"lower_{unit}": joint.lower * scale,
                f"upper_{unit}": joint.upper * scale,
                f"home_{unit}": joint.home * scale,
                f"speed_{unit}_s": None if joint.speed is None else joint.speed * scale,
            }
            for joint in arm.joints
            for unit, scale in (("deg", degrees(1)) if joint.kind == "turning" else ("m", 1.0),)
        ],
        "rows": [
            {
                "joint": None if row.joint is None else arm.joints[row.joint].name,
                "ratio": row.ratio,
                "theta_deg": degrees(row.theta),
                "d": length_text(row.d),
                "a": length_text(row.a),
                "alpha_deg": degrees(row.alpha),
            }
            for row in arm.rows
        ],
        "base": _frame(arm.base),
        "tool": _frame(arm.tool),
    }


def _frame(frame: FixedFrame) -> Answer:
    return {
        "position_m": [frame.x, frame.y, frame.z],
        "rz_ry_rx_deg": [degrees(angle) for angle in (frame.rz, frame.ry, frame.rx)],
    }


def length_text(length: Length) -> str:
    """Return a length as written in a robot's file: 'l2 + l3', '-l2', '40 mm'."""
    parts = [("- " if factor < 0 else "+ ") + name for name, factor in length.terms]
    if length.constant or not parts:
        parts.append(f"{'- ' if length.constant < 0 else '+ '}{1000 * abs(length.constant):g} mm")
    text = " ".join(parts).removeprefix("+ ")
    return "-" + text[2:] if text.startswith("- ") else text


ARM = RobotKind(name=Arm.kind, table=ArmTable, read=arm_of, details=arm_details, mobility=of_arm)
