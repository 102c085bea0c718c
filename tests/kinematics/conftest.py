"""What the tests of this folder share: the catalogue's arms and random configurations within their limits."""

from collections.abc import Callable

import numpy as np
import pytest

from servogen.kinematics import transforms as t
from servogen.kinematics.catalogue import arm, names, robot
from servogen.robot.model import Arm
from tests.campaigns import sampled

ARMS = tuple(name for name in names() if isinstance(robot(name), Arm))
Configurations = Callable[..., np.ndarray]


@pytest.fixture(params=ARMS)
def any_arm(request: pytest.FixtureRequest) -> Arm:
    """Each arm of the catalogue in turn."""
    return arm(request.param)


@pytest.fixture(params=sampled(ARMS, 2))
def sampled_arm(request: pytest.FixtureRequest) -> Arm:
    """Some arms of the catalogue, and each of them in a campaign."""
    return arm(request.param)


@pytest.fixture(params=[name for name in ARMS if arm(name).closed_form])
def closed_arm(request: pytest.FixtureRequest) -> Arm:
    """Each arm of the catalogue whose inverse kinematics is in closed form, which finds all solutions."""
    return arm(request.param)


@pytest.fixture
def configurations() -> Configurations:
    """Random joint positions (count, n) within the limits."""

    def some(found: Arm, count: int, seed: int = 7) -> np.ndarray:
        lower = [joint.lower for joint in found.joints]
        upper = [joint.upper for joint in found.joints]
        return np.random.default_rng(seed).uniform(lower, upper, (count, len(lower)))

    return some


@pytest.fixture
def product_of_rows() -> Callable[[Arm, np.ndarray], np.ndarray]:
    """Forward kinematics as the textbook says it: the 4 × 4 matrices, one after the other."""

    def product(found: Arm, q: np.ndarray) -> np.ndarray:
        pose = t.frame_matrix(found.base)
        for row in found.rows:
            moved = 0.0 if row.joint is None else row.ratio * q[..., row.joint]
            turning = row.joint is not None and found.joints[row.joint].turning
            theta = row.theta + (moved if turning else 0.0)
            d = row.d.value(found.length) + (0.0 if turning else moved)
            screw = t.rotation("z", theta) @ t.translation(0, 0, d)
            across = t.translation(row.a.value(found.length), 0, 0) @ t.rotation("x", row.alpha)
            pose = pose @ (screw @ across if found.convention == "standard" else across @ screw)
        return pose @ t.frame_matrix(found.tool)

    return product
