"""Draws the pictures of docs/robots.md: `python docs/pictures/robots.py`. Needs the extra `plot`."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from servogen.kinematics import omni
from servogen.kinematics.catalogue import arm, robot
from servogen.kinematics.forward import fk_position, link_frames
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.inverse.solve import ik_all
from servogen.kinematics.leg import Leg
from servogen.kinematics.omni import OmniBase
from servogen.kinematics.transforms import to_body

HERE = Path(__file__).parent
GREY, BLUE, RED = "0.35", "tab:blue", "tab:red"


def corners(name: str, q: np.ndarray) -> np.ndarray:
    """The points of a stick figure: each row goes first along z, then along x."""
    found = arm(name)
    frames = link_frames(found, q)[:-1]
    points = [np.array([0.0, 0.0, 0.0]), frames[0, :3, 3]]
    for before, after in pairwise(frames):
        along = (after[:3, 3] - before[:3, 3]) @ before[:3, 2]
        points += [before[:3, 3] + along * before[:3, 2], after[:3, 3]]
    return np.array([*points, fk_position(found, q)])


def sticks(axes: Any, points: np.ndarray, colour: str, label: str | None = None) -> None:
    axes.plot(*points.T, "-o", color=colour, lw=2, ms=3, label=label)


def arms() -> None:
    """All inverse solutions of one target for three arms, and the six-legged robot."""
    figure = plt.figure(figsize=(10, 8), layout="constrained")
    targets = {"scara": [0.35, 0.35, 0.3], "anthropomorphic": [0.2, 0.2, 0.15], "irb6400c": [1.1, 0.6, 0.7]}
    for index, (name, target) in enumerate(targets.items(), 1):
        axes = figure.add_subplot(2, 2, index, projection="3d")
        solutions = ik_all(arm(name), target)
        for number, q in enumerate(solutions):
            sticks(axes, corners(name, q), f"C{number}", f"solution {number + 1}")
        axes.plot(*np.array([target]).T, "k*", ms=12)
        axes.set_title(f"{name}: {len(solutions)} solutions of one position")
        equal(axes)
        axes.legend(fontsize=7)
    axes = figure.add_subplot(2, 2, 4, projection="3d")
    six_legs(axes)
    equal(axes)
    figure.savefig(HERE / "robots.png", dpi=90)


def six_legs(axes: Any) -> None:
    found = robot("hexapod")
    if not isinstance(found, Hexapod):
        return
    body = np.array([[mount.x, mount.y, mount.z] for mount in found.mounts])[[0, 1, 2, 5, 4, 3, 0]]
    axes.plot(*body.T, color=GREY, lw=3)
    for mount in found.mounts:
        lifted = mount.name in ("L1", "R2", "L3")
        points = to_body(mount, corners("leg", np.radians([-15, 50] if lifted else [15, 10])))
        sticks(axes, points, RED if lifted else BLUE)
        axes.text(*(points[-1] - [0, 0, 0.02]), mount.name)
    axes.set_title("hexapod: L1, R2, L3 (red) lifted, x forward")


def equal(axes: Any) -> None:
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    half = np.ptp(limits, axis=1).max() / 2
    for centre, setter in zip(
        limits.mean(axis=1), (axes.set_xlim, axes.set_ylim, axes.set_zlim), strict=True
    ):
        setter(centre - half, centre + half)
    axes.set_box_aspect((1, 1, 1))
    axes.set(xlabel="x, m", ylabel="y, m", zlabel="z, m")
    axes.tick_params(labelsize=6)


def stance() -> None:
    """A stance from above: the wanted straight line, the foot's circle, the spring's correction."""
    leg = Leg.of(arm("leg").length)
    wanted = leg.straight(0.06, -0.13, 31)
    found = leg.stance(wanted)
    figure, (above, along) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    turn = np.linspace(np.radians(40), np.radians(140), 200)
    rho = np.hypot(*found.foot_m[0, :2])
    above.plot(
        1e3 * rho * np.cos(turn), 1e3 * rho * np.sin(turn), ":", color=GREY, label="circle of the foot"
    )
    above.plot(*(1e3 * wanted[:, :2].T), "-", color=RED, label="wanted path")
    above.plot(*(1e3 * found.foot_m[:, :2].T), ".", color=BLUE, label="foot by α and β")
    above.plot(0, 0, "k+", ms=12)
    above.annotate("axis of α", (0, 0), (3, 2))
    above.set(xlabel="X (forward), mm", ylabel="Y (outward), mm", title="stance of 60 mm, seen from above")
    above.set_aspect("equal")
    above.legend(fontsize=8, loc="center")
    size = np.linalg.norm(found.correction_m, axis=1) * np.sign(found.correction_m[:, 1])
    along.plot(1e3 * wanted[:, 0], 1e3 * size, ".-", color=RED)
    along.axhline(0, color=GREY, lw=0.5)
    along.invert_xaxis()
    along.set(
        xlabel="X of the foot, mm (the stance goes from left to right)",
        ylabel="correction outwards, mm",
        title=f"what the spring joint gives: at most {1e3 * found.largest_correction_m:.2f} mm",
    )
    figure.savefig(HERE / "stance.png", dpi=90)


def omni_motions() -> None:
    """The 27 motions of table 10.1: the way of the centre in the same time."""
    base = robot("omni")
    if not isinstance(base, OmniBase):
        return
    figure, grid = plt.subplots(3, 9, figsize=(13, 5), layout="constrained")
    letter = {1: "+", 0: "0", -1: "-"}
    for axes, row in zip(grid.flat, omni.table(), strict=True):
        vx, vy, turn = base.body_speed(4.0 * np.array(row.signs))
        times = np.linspace(0, 2, 60)
        angle = turn * times
        x = np.cumsum(vx * np.cos(angle) - vy * np.sin(angle)) * times[1]
        y = np.cumsum(vx * np.sin(angle) + vy * np.cos(angle)) * times[1]
        ring = base.wheel_distance * np.exp(1j * np.linspace(0, 2 * np.pi, 50))
        axes.plot(ring.real, ring.imag, color="0.8", lw=1)
        axes.plot(x, y, color=BLUE if row.turning == 0 else RED, lw=2)
        axes.plot(x[-1], y[-1], "o", color="k", ms=3)
        detail = {"translation": f"{row.direction_deg}°", "circle": row.size}.get(row.kind, row.kind)
        axes.set_title(f"({','.join(letter[sign] for sign in row.signs)}) {detail}", fontsize=8)
        axes.set(xlim=(-0.45, 0.45), ylim=(-0.45, 0.45), xticks=[], yticks=[])
        axes.set_aspect("equal")
    figure.savefig(HERE / "omni.png", dpi=80)


def main() -> None:
    arms()
    stance()
    omni_motions()


if __name__ == "__main__":
    main()
