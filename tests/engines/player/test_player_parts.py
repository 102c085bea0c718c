"""The player's parts: what a motion is cut into is the motion, whole."""

import numpy as np
import pytest

from servogen.engines.player.parts import ALIKE, MAX_COUNT, MAX_FRAMES_PER_PART, MAX_PARTS, stretches
from servogen.errors import InputError
from servogen.motion.trajectory import MAX_FRAMES, Floats


def played(rows: Floats, following: Floats) -> Floats:
    """Return the rows that the parts play, one after another."""
    parts = stretches(rows, following)
    assert all(part.repeats <= MAX_COUNT for part in parts)
    return np.concatenate(
        [np.tile(rows[part.first : part.first + part.frames], (part.repeats, 1)) for part in parts]
    )


@pytest.mark.parametrize("frames", [1, 249, 250, 251, 62_499, 62_500, 62_501, 62_750, 125_001, MAX_FRAMES])
@pytest.mark.parametrize("width", [1500.0, np.nan])
def test_a_pose_or_a_pause_of_any_length_is_played_as_long_as_it_is(frames: int, width: float) -> None:
    rows = np.full((frames, 2), width)
    assert np.array_equal(played(rows, np.full(2, 1600.0)), rows, equal_nan=True)


def test_a_slow_move_is_not_a_hold() -> None:
    """Each frame is within 0.01 cycles of the next: 40 cycles in 10 000 frames are still a move."""
    rows = np.linspace(1500.0, 1540.0, 10_000)[:, None]
    assert np.abs(played(rows, rows[-1]) - rows).max() < 2 * ALIKE


def test_a_motion_of_more_parts_than_words_for_them_is_refused_early() -> None:
    rows = np.random.default_rng(1).uniform(1000, 2000, (MAX_PARTS * MAX_FRAMES_PER_PART + 1, 3))
    with pytest.raises(InputError, match="more than 204 parts, which no program can hold"):
        stretches(rows, rows[0])
    assert len(stretches(rows[:-1], rows[0])) == MAX_PARTS
