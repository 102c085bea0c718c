"""The player's parts: what a motion is cut into is the motion, whole."""

import numpy as np
import pytest

from servogen.motion.trajectory import MAX_FRAMES, Floats
from servogen.pulse.player.parts import MOST, stretches


def played(rows: Floats, following: Floats) -> Floats:
    """Return the rows that the parts play, one after another."""
    parts = stretches(rows, following)
    assert all(part.repeats <= MOST for part in parts)
    return np.concatenate(
        [np.tile(rows[part.first : part.first + part.frames], (part.repeats, 1)) for part in parts]
    )


@pytest.mark.parametrize("frames", [1, 249, 250, 251, 62_499, 62_500, 62_501, 62_750, 125_001, MAX_FRAMES])
@pytest.mark.parametrize("width", [1500.0, np.nan])
def test_a_pose_or_a_pause_of_any_length_is_played_as_long_as_it_is(frames: int, width: float) -> None:
    rows = np.full((frames, 2), width)
    assert np.array_equal(played(rows, np.full(2, 1600.0)), rows, equal_nan=True)
