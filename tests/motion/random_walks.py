"""Random robots of each kind of leg: how far rigid legs take the body on a walk, beside what was asked.

`python -m tests.motion.random_walks --robots 200` draws robots on four, six and eight legs: links of 30 to
120 mm, bodies of 80 to 300 mm, corner legs at up to 45°, straight, oblique, curved and turning walks of three
cycles in the gaits of their number of legs. It prints those that miss their way by 2 % or their heading by
1.5°, with the correction that their legs would need, and how often each refusal occurred.

The check shares no code with the planner's own: from frame to frame the feet that stand are turned and moved
on to where they were by the best rigid motion, all with equal weight (Kabsch).
"""

from __future__ import annotations

import argparse
import cmath
import math
import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from servogen.errors import ServogenError
from servogen.kinematics.catalogue import robot
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.leg_kinds import LEG_KINDS
from servogen.kinematics.protocol import Posture
from servogen.motion.gait.phases import gait
from servogen.motion.gait.steps import Segment
from servogen.motion.gait.walk import Walk, walk
from servogen.robot.model import Mount
from servogen.units import Clock, Cycles

EXAMPLE = {
    "pantograph": "hexapod",
    "hip-lift": "hexapod-hip-lift",
    "coxa-femur-tibia": "hexapod-coxa-femur-tibia",
}
GAITS = {2: ("crawl",), 3: ("tripod", "ripple", "wave"), 4: ("tetrapod", "wave")}
WAYS = ("straight", "oblique", "curve", "turn")
CYCLES = 3
WAY, HEADING = 0.02, math.radians(1.5)


@dataclass(frozen=True)
class Drawn:
    """A robot and its walk."""

    robot: Hexapod
    rhythm: str
    way: str
    segment: Segment
    posture: Posture

    def planned(self) -> Walk:
        """Return the planned walk. Raises ServogenError where it is refused."""
        return walk(
            self.robot,
            gait(self.rhythm, self.robot),
            [self.segment],
            self.posture,
            Cycles(20_000),
            Clock(4_000_000),
            frames_per_cycle=48,
        )


def drawn(kind: str, chance: random.Random) -> Drawn:
    """Return a random robot with legs of a kind, and its walk."""
    example = robot(EXAMPLE[kind])
    assert isinstance(example, Hexapod)
    lengths = {name: chance.uniform(0.03, 0.12) for name in example.leg.length}
    rows = chance.choice((2, 3, 3, 3, 4))
    length, width, corner = chance.uniform(0.08, 0.3), chance.uniform(0.08, 0.3), chance.uniform(0.0, 45.0)
    mounts = []
    for side in (1, -1):
        for row in range(rows):
            place = 1 - 2 * row / (rows - 1)
            mounts.append(
                Mount(
                    f"{'L' if side > 0 else 'R'}{row + 1}",
                    place * length / 2,
                    side * width / 2,
                    0.0,
                    math.radians(-place * corner * side),
                    side < 0,
                )
            )
    if kind == "pantograph":
        height = lengths["df"] + lengths["bc"] * chance.uniform(0.7, 0.95)
        reach = lengths["ab"] + lengths["cd"]
    else:
        height = lengths["tibia"] * chance.uniform(0.8, 1.0)
        reach = lengths["coxa"] + lengths["femur"]
    stride, turn = reach * chance.uniform(0.2, 0.5), math.radians(chance.uniform(6, 16))
    way = chance.choice(WAYS)
    if way == "turn":
        segment = Segment(turn=chance.choice((-1, 1)) * turn)
    else:
        direction = cmath.exp(1j * math.radians(chance.uniform(-60, 60) if way == "oblique" else 0.0))
        step = stride * direction
        segment = Segment(step.real, step.imag, chance.choice((-1, 1)) * turn if way == "curve" else 0.0)
    leg = example.leg.with_lengths(**lengths)
    lift = 0.2 * min(lengths.values())
    return Drawn(
        replace(example, leg=leg, mounts=tuple(mounts)),
        chance.choice(GAITS[rows]),
        way,
        replace(segment, cycles=float(CYCLES)),
        Posture(body_height=height, lift=lift),
    )


def rigid_way(feet: np.ndarray, ground: np.ndarray) -> tuple[complex, float]:
    """Return how far rigid legs take the body, x + iy, and its heading, from feet (frames, legs, 3)."""
    place, heading = 0j, 0.0
    points = feet[:, :, 0] + 1j * feet[:, :, 1]
    for before, after, down in zip(points, points[1:], ground[1:] & ground[:-1], strict=False):
        if down.sum() < 2:
            continue
        old, new = before[down], after[down]
        turn = cmath.phase(((old - old.mean()) * (new - new.mean()).conj()).sum())
        # The feet stay: the body moves so that the new places, turned by its turn, are the old ones.
        place += (old.mean() - new.mean() * cmath.exp(1j * turn)) * cmath.exp(1j * heading)
        heading += turn
    return place, heading


@dataclass(frozen=True)
class Missed:
    """How far a walk is from what was asked: of its length, and of its heading (radians)."""

    way: float
    heading: float
    correction: float

    @property
    def good(self) -> bool:
        """Return whether it is as near as the rule promises."""
        return self.way <= WAY and self.heading <= HEADING


def missed(one: Drawn, made: Walk) -> Missed:
    """Return how far rigid legs leave a walk from what was asked."""
    place, heading = rigid_way(made.feet, made.ground)
    position, turn = one.segment.travelled(np.array(float(CYCLES)))
    length = abs(complex(one.segment.forward, one.segment.left)) * CYCLES
    # A turn on the spot has no length: what the feet go counts instead.
    far = max(abs(complex(mount.x, mount.y)) for mount in one.robot.mounts)
    length = max(length, abs(float(turn)) * far)
    return Missed(
        abs(place - complex(position)) / length, abs(heading - float(turn)), made.largest_correction_m
    )


def campaign(kind: str, robots: int, seed: int = 1) -> Iterator[tuple[Drawn, Missed | ServogenError]]:
    """Yield robots with how far each misses its way, or why it is refused."""
    chance = random.Random(f"{kind}{seed}")
    for _ in range(robots):
        one = drawn(kind, chance)
        try:
            yield one, missed(one, one.planned())
        except ServogenError as error:
            yield one, error


def main() -> None:
    """Print the figures of a campaign."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--robots", type=int, default=200)
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    for kind in LEG_KINDS:
        found = list(campaign(kind, given.robots, given.seed))
        refused = Counter(each.first.code for _, each in found if isinstance(each, ServogenError))
        walks = [(one, each) for one, each in found if isinstance(each, Missed)]
        bad = [(one, each) for one, each in walks if not each.good]
        good = len(walks) - len(bad)
        print(f"{kind}: {len(walks)} walk, {good} within 2 % and 1.5°; refused: {dict(refused)}")
        for one, each in bad:
            print(
                f"  {one.way} {one.rhythm} on {len(one.robot.mounts)} legs: {100 * each.way:.1f} %, "
                f"{math.degrees(each.heading):.2f}°, correction {1000 * each.correction:.1f} mm"
            )


if __name__ == "__main__":
    main()
