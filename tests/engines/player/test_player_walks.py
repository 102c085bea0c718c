"""Walks and poses on small motions by hand: events, timings, steps, pieces, slots of the C and its tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from servogen.engines.firmware import ResourceError
from servogen.engines.player import poses
from servogen.engines.player.arithmetic import ENTRIES
from servogen.engines.player.encoding import Encoded
from servogen.engines.player.legs import legs_encoder
from servogen.motion.gait.footwork import bump, swing_share
from servogen.motion.trajectory import Floats


def rows(*frames: Any) -> Any:
    return np.array(frames, dtype=float)


# the events of a walk


def walk_rows(*lifted: tuple[int, int, int], frames: int, legs: int) -> Any:
    """Rows of turns and lifts: each (leg, first, last) is in the air in frames `first` to `last`."""
    table = np.full((frames, 2 * legs), 1500.0)
    for leg, first, last in lifted:
        for frame in range(first, last + 1):
            table[frame, 2 * leg + 1] = 1600.0
    return table


PAIRS = [(0, 1), (2, 3)]


def encoded(
    rows: Floats,
    loop_start: int,
    soft: Sequence[int] = (),
    pairs: Sequence[tuple[int, int]] = PAIRS,
    *,
    limited: bool = True,
) -> Encoded | None:
    encoder = legs_encoder(rows, loop_start, soft, pairs, limited=limited)
    return encoder(0.3) if encoder else None


def test_what_is_not_a_walk_is_not_encoded_as_one() -> None:
    table = walk_rows((0, 4, 6), (1, 8, 10), frames=16, legs=2)
    assert encoded(table, 0) is not None
    assert encoded(table, 0, (), PAIRS[:1]) is None, "a channel that is no leg's"
    long = walk_rows((0, 270, 272), (1, 280, 282), frames=300, legs=2)
    # Parts of a soft start have at most 256 frames.
    assert encoded(long, 290, (1, 257), limited=False) is not None
    assert encoded(long, 290, (1, 258), limited=False) is None
    silent = table.copy()
    silent[3] = np.nan
    assert encoded(silent, 8) is None and encoded(silent, 0) is None
    seven = np.full((16, 14), 1500.0)
    assert encoded(seven, 0, (), [(2 * n, 2 * n + 1) for n in range(7)]) is None
    # A walk after which the pulses end: its last pose is kept, without pulses.
    released = np.vstack((walk_rows((0, 4, 6), (1, 8, 10), frames=16, legs=2), np.full((2, 4), np.nan)))
    made = encoded(released, 16)
    assert made is not None
    assert made.silent.tolist() == [frame >= made.lead for frame in range(len(made.frames))]
    assert made.lead == 16 and not encoded(table, 0).silent.any()  # type: ignore[union-attr]


def steady(frames: int) -> Any:
    """Two legs in a cycle of 24 frames: a swing of 8 by the law, evenly back; a lift by its bump."""
    table = np.empty((frames, 4))
    for leg, lift in enumerate((2, 14)):
        local = (np.arange(frames) - lift) % 24 / 8
        swing = -50 + 100 * swing_share(local, 0.5)
        table[:, 2 * leg] = 1500 + np.where(local < 1, swing, 50 - 50 * (local - 1))
        table[:, 2 * leg + 1] = 1400 + np.where(local < 1, 100 * bump(local), 0)
    return table


@pytest.mark.parametrize("begin", [0, 24, 30])
def test_a_walk_by_the_laws_is_encoded_to_within_a_cycle_and_a_half(begin: int) -> None:
    """Half a cycle is rounding at each end, the rest that of the law's table and of the blending."""
    table = steady(begin + 24)
    made = encoded(table, begin)
    assert made is not None and not made.silent.any()
    wanted = steady(len(made.frames))
    assert np.abs(made.widths - wanted).max() <= 1.5
    assert len(made.frames) - made.lead == 24


# poses


@pytest.mark.parametrize(
    ("values", "bounds"),
    [
        ((5, 5, 5, 5), (0, 0)),
        ((0, 100, 0, 100, 0), (2, 2)),  # 100 and 0 in turn, up and down
        ((0, 100, 0, 120, 0, 140, 0), (4, 4)),
        ((0, 100, 0, 103, 0, 104, 0), (2, 2)),  # 100 to 104 share a row
        ((0, 100, 0, 104.5, 0), (3, 2)),
        ((0, 2, 0, 2, 0), (0, 0)),  # a law within 1 of both: no turn
        ((0, 2.1, 0, 2.1, 0), (1, 1)),
        ((0, 3, 1), (0, 0)),
        ((0, 2, -1), (0, 0)),
        ((0, 3, 0.9), (1, 0)),
        ((0, 2.1, -1), (1, 0)),
        ((0, 10, 20, 30, 40), (0, 0)),  # one straight step
        ((0, 10, 10, 20, 20, 30, 30, 40), (3, 2)),  # a rest between two jumps
        ((0, 4, 4, 8, 8, 12, 12, 16), (0, 0)),  # not farther than laws may be apart
        ((0, 10, 10, 11, 11, 21, 21), (0, 0)),
    ],
)
def test_the_fewest_poses_and_moves_are_those_of_turns_and_of_rests_between_jumps(
    values: tuple[float, ...], bounds: tuple[int, int]
) -> None:
    assert poses.fewest(rows(*[[value] for value in values]), 1.0, 1.0) == bounds
    halves = rows(*[[value / 2] for value in values])
    assert poses.fewest(halves, 0.5, 0.5) == bounds
    two = rows(*[[3.0, -value] for value in values])
    assert poses.fewest(two, 1.0, 1.0) == bounds, "in any channel"


def test_poses_and_moves_beyond_the_tables_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    table = np.zeros((4, 2))
    cases = ((128, 255), False), ((129, 10), True), ((10, 256), True)
    for near, (bounds, refused) in enumerate(cases):  # another motion each time: an answer is remembered
        monkeypatch.setattr(poses, "fewest", lambda *_: bounds)  # noqa: B023
        if not refused:
            assert poses.poses_encoded(table, (), 0, 1.0, near) is not None
            continue
        with pytest.raises(ResourceError) as error:
            poses.poses_encoded(table, (), 0, 1.0, near)
        assert error.value.message == (
            f"the motion needs {bounds[0]} or more poses and {bounds[1]} or more moves between them: "
            "the player's tables hold 128 and 255"
        )
    assert ENTRIES == 17
