"""Motions far beyond the chip are refused before the search for an encoding, and only those."""

import random

import numpy as np
import pytest

from servogen.engines.firmware import ResourceError
from servogen.engines.player import poses
from servogen.engines.player.encoding import scale_of
from servogen.motion.trajectory import Floats
from tests.campaigns import sampled


def held(widths: list[float], frames: int) -> Floats:
    """Return one servo's widths, each held for a number of frames."""
    return np.repeat(np.array(widths), frames)[:, None]


def test_each_turn_and_each_rest_between_jumps_needs_a_pose() -> None:
    """Counted by hand; the first and the last frame may be a part of anything."""
    assert poses.fewest(held([1000, 2000, 1000, 2000, 1000], 1), 2, 0) == (2, 2)
    assert poses.fewest(held([1000, 1300, 1600, 1900, 2200], 2), 2, 0) == (3, 2)
    assert poses.fewest(held([1000, 1300, 1600, 1900, 2200], 1), 2, 0) == (0, 0)  # one ramp
    assert poses.fewest(held([1000, 1300, 1301, 1900, 2200], 2), 2, 0) == (1, 0)  # 1 cycle is not a jump
    assert poses.fewest(held([1000, 2000, 1000, 2010, 1000], 1), 2, 3) == (2, 2)  # 10 cycles are one pose


@pytest.mark.parametrize("seed", sampled(range(12), 4))
def test_no_encoding_has_fewer_poses_and_moves_than_the_bounds(seed: int) -> None:
    """A walk over few poses with rests, jumps and ramps: what the search finds is the second opinion."""
    drawn = random.Random(seed)
    columns = drawn.randint(1, 3)
    known = [[drawn.randint(1000, 2000) for _ in range(columns)] for _ in range(drawn.randint(2, 12))]
    parts = [np.array([known[0]], dtype=float)]
    for _ in range(30):
        goal, frames = np.array(drawn.choice(known), dtype=float), drawn.randint(1, 6)
        if drawn.random() < 0.3:
            parts.append(parts[-1][-1] + np.linspace(0, 1, 9)[1:, None] * (goal - parts[-1][-1]))
        parts.append(np.repeat(goal[None], frames, axis=0))
    rows = np.vstack(parts)
    far, near = drawn.choice([(1.5, 0.3), (8.0, 2.2)])
    whole = np.vstack((rows, rows[0]))
    least = poses.fewest(whole, far, near * float((1 << scale_of(rows).shifts).max()))
    made = poses.poses_encoded(rows, (0,), 0, far, near)
    assert 0 < least[0] <= len(made.rows) // columns
    assert 0 < least[1] <= len(made.script.data)


def test_two_thousand_poses_are_refused_without_a_search(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = random.Random(1)
    rows = np.repeat([[drawn.randint(1000, 2000) for _ in range(3)] for _ in range(2000)], 25, axis=0)
    monkeypatch.setattr(poses, "motion_parts", lambda *_: pytest.fail("searched"))
    with pytest.raises(ResourceError, match="needs 257 or more poses and 257 or more moves") as error:
        poses.poses_encoded(rows.astype(float), (0,), 0, 8.0, 2.2)
    assert error.value.code == "does-not-fit"
