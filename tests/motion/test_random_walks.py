"""One foothold rule for straight, oblique, curved and turning walks of any mount, on each kind of leg.

`python -m tests.motion.random_walks` draws 200 robots of each; a few of them are drawn here.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from servogen.errors import ServogenError
from servogen.kinematics.leg_kinds import LEG_KINDS
from servogen.motion.gait.steps import Segment
from tests.motion.random_walks import Drawn, Missed, campaign, missed, rigid_way


@cache
def robots(kind: str) -> list[tuple[Drawn, Missed | ServogenError]]:
    """A few walks and what became of them, drawn once."""
    return list(campaign(kind, 8, seed=2))


@pytest.mark.parametrize("kind", LEG_KINDS)
def test_rigid_legs_take_random_robots_where_they_were_asked_to_go(kind: str) -> None:
    walks = [(one, each) for one, each in robots(kind) if isinstance(each, Missed)]
    assert len(walks) >= 2
    assert all(each.good for _, each in walks), [(one.way, one.rhythm, each) for one, each in walks]


def test_the_refusals_of_random_robots_say_what_would_mend_them() -> None:
    refused = [each for _, each in robots("hip-lift") if isinstance(each, ServogenError)]
    assert refused and all(error.hint for error in refused)


@pytest.mark.parametrize("turn", [0.0, 0.05, -0.1])
def test_the_check_finds_the_way_of_feet_that_stand_and_of_feet_that_are_dragged(turn: float) -> None:
    """A body that goes along a known arc over feet that stay; then the feet are dragged back by a tenth."""
    segment = Segment(0.02, 0.005, turn)
    stands = np.array([0.1 + 0.1j, -0.1 + 0.1j, 0.1 - 0.1j, -0.1 - 0.1j])
    progress = np.linspace(0, 1, 11)
    position, heading = segment.travelled(progress)
    seen = (stands - position[:, None]) * np.exp(-1j * heading)[:, None]
    feet = np.stack([seen.real, seen.imag, 0 * seen.real], axis=2)
    ground = np.ones(feet.shape[:2], dtype=bool)
    place, turned = rigid_way(feet, ground)
    assert place == pytest.approx(complex(position[-1]), abs=1e-9)
    assert turned == pytest.approx(turn)
    slower = feet[0] + 0.9 * (feet - feet[0])
    assert abs(rigid_way(slower, ground)[0]) < 0.95 * abs(place)


def test_a_walk_that_misses_is_seen() -> None:
    one, _ = next(pair for pair in robots("hip-lift") if isinstance(pair[1], Missed))
    made = one.planned()
    elsewhere = cmath.exp(1j * math.radians(2)) * complex(one.segment.forward, one.segment.left)
    asked = replace(one.segment, forward=elsewhere.real, left=elsewhere.imag, turn=one.segment.turn + 0.02)
    assert not missed(replace(one, segment=asked), made).good
