"""A motion's script is the motion, step by step; the chip's arithmetic is the law, within its last places."""

from dataclasses import replace

import numpy as np
import pytest

from servogen.engines.firmware import ResourceError
from servogen.engines.player.arithmetic import blended, weights
from servogen.engines.player.encoding import Rows
from servogen.engines.player.laws import lift_table, spot_table, swing_table, table_of
from servogen.engines.player.poses import played as poses_played
from servogen.engines.player.poses import poses_encoded
from servogen.engines.player.script import AGAIN, AT, SPOT, Script, ScriptStep, script, timing
from servogen.motion.gait.footwork import bump, swing_share
from servogen.motion.laws import law

SLOW, FAST = timing(50), timing(12)


def played(made: Script, columns: int, steps: int) -> list[tuple[int, int, bool]]:
    """Return (row, how, on the spot) of the first steps, read from the bytes as docs/firmware.md says."""
    found: list[tuple[int, int, bool]] = []
    place, row, left, spot = 0, -1, 0, False
    while len(found) < steps:
        place = made.loop if place == len(made.data) else place
        how = made.data[place]
        place += 1
        if how == AGAIN:
            back, times = made.data[place : place + 2]
            left = (left or times) - 1
            place += 2 - (back if left else 0)
            continue
        if how in (AT, SPOT):
            spot = how == SPOT
            row, how = made.data[place] // columns, made.data[place + 1]
            place += 2
        elif not spot:
            row += 1
        found.append((row, how, spot))
    return found


def test_the_script_plays_every_step_in_order_and_its_loop_for_ever() -> None:
    lead = [
        ScriptStep(0, SLOW),
        ScriptStep(0, SLOW),
        ScriptStep(1, FAST),
        *[ScriptStep(row, FAST, row) for row in (2, 3, 4)] * 5,
    ]
    loop = [ScriptStep(1, FAST), *[ScriptStep(row, FAST, 7) for row in (2, 3)] * 4, ScriptStep(5, SLOW)]
    made = script(lead, loop, 6, legs=True)
    steps = [*lead, *loop, *loop, *loop]
    timings = list(made.timings)
    assert played(made, 6, len(steps)) == [
        (step.row, step.lifted << 2 | timings.index(step.timing), step.spot) for step in steps
    ]
    assert len(made.data) < 2 * len([*lead, *loop])


def test_random_scripts_with_repetitions_play_their_steps() -> None:
    """Bodies of one to six steps, made up to seven times, of rows that follow each other or do not."""
    random = np.random.default_rng(5)

    def some() -> list[ScriptStep]:
        steps: list[ScriptStep] = []
        for _ in range(random.integers(1, 4)):
            first = int(random.integers(0, 5))
            body = [
                ScriptStep(
                    first + index if random.random() < 0.7 else int(random.integers(0, 9)),
                    (SLOW, FAST)[random.integers(0, 2)],
                )
                for index in range(random.integers(1, 7))
            ]
            steps += body * int(random.integers(1, 8))
        return steps

    for _ in range(60):
        lead, loop = some(), some()
        made = script(lead, loop, 2, legs=False)
        timings = list(made.timings)
        steps = [*lead, *loop, *loop, *loop]
        assert [(row, how) for row, how, _ in played(made, 2, len(steps))] == [
            (step.row, timings.index(step.timing)) for step in steps
        ]
        assert len(made.data) <= 3 * len([*lead, *loop])


def test_every_byte_belongs_to_the_first_step_that_needs_it() -> None:
    """The bytes of a repetition belong to the last step of its first round."""
    lead = [ScriptStep(0, SLOW), ScriptStep(0, SLOW), *[ScriptStep(row, FAST) for row in (2, 3, 4)] * 5]
    loop = [*[ScriptStep(row, FAST) for row in (2, 3)] * 4, ScriptStep(7, SLOW), ScriptStep(1, SLOW)]
    made = script(lead, loop, 6, legs=True)
    first: dict[int, int] = {}
    place = left = 0
    for number in range(len([*lead, *loop])):
        begin = place
        place += 3 if made.data[place] == AT else 1
        ends = place
        if place < len(made.data) and made.data[place] == AGAIN:
            back, times = made.data[place + 1 : place + 3]
            ends = place + 3
            left = (left or times) - 1
            place = ends - back if left else ends
        for each in range(begin, ends):
            first.setdefault(each, number)
    assert place == len(made.data)
    assert made.owners == tuple(first[each] for each in range(len(made.data)))


@pytest.mark.parametrize("cycles", [1, 2, 9])
def test_steps_on_the_spot_name_their_row_once_and_what_follows_names_its_own(cycles: int) -> None:
    spot = [ScriptStep(7, FAST, lifted, True) for lifted in (21, 0, 42, 0)]
    cycle = [ScriptStep(row, FAST, lifted) for row, lifted in ((4, 21), (5, 0), (6, 42), (7, 0))]
    back = [replace(step, row=0) for step in spot]
    lead = [ScriptStep(0, SLOW), ScriptStep(0, SLOW)]
    loop = [*spot, *cycle * cycles, *back, ScriptStep(0, SLOW)]
    made = script(lead, loop, 6, legs=True)
    timings = list(made.timings)
    steps = [*lead, *loop, *loop]
    assert played(made, 6, len(steps)) == [
        (step.row, step.lifted << 2 | timings.index(step.timing), step.spot) for step in steps
    ]
    assert made.data.count(SPOT) == 2


def test_two_steps_on_the_spot_with_the_same_masks_are_not_played_as_one() -> None:
    """A repetition cannot begin in the midst of steps on the spot: it would begin them anew."""
    lead = [ScriptStep(0, SLOW), *[ScriptStep(1, FAST, 9, True), ScriptStep(1, FAST, 0, True)] * 4]
    made = script(lead, [ScriptStep(2, SLOW)], 6, legs=True)
    assert made.data.count(SPOT) == 1 and AGAIN not in made.data


def test_a_walk_has_four_timings_at_most() -> None:
    steps = [ScriptStep(0, timing(frames)) for frames in (2, 3, 4, 5, 6)]
    assert len(script(steps[:1], steps[:4], 6, legs=True).timings) == 4
    with pytest.raises(ResourceError, match="5 timings: the player holds 4"):
        script(steps[:1], steps, 6, legs=True)


@pytest.mark.parametrize("frames", [1, 2, 3, 7, 12, 50, 255, 256])
def test_the_time_of_a_step_is_the_frames_share_of_it(frames: int) -> None:
    times = np.array(timing(frames).times()) / 256
    assert np.abs(times - np.arange(frames) / frames).max() <= 0.5 / 256 + frames / 2 / 65536


@pytest.mark.parametrize("name", ["trapezoid", "quintic"])
def test_a_laws_table_is_the_law_within_two_256ths(name: str) -> None:
    """One is rounding; at the end there is one more, because a weight of 256 is no byte."""
    time = np.arange(256)
    made = weights(list(table_of(name)), time) / 256
    away = np.abs(made - law(name).share(time / 256)) * 256
    assert away.max() <= 2
    assert away[time < 230].max() < 1.4


@pytest.mark.parametrize("rate", [0.2, 0.5, 1.0])
def test_half_a_swing_is_the_swings_law_and_the_lift_its_bump(rate: float) -> None:
    """From the lift (time 0) to the middle: what is left of half the way, in 128ths; the lift in 255ths."""
    time = np.arange(256)
    left = weights(list(swing_table(rate)), time) / 128
    assert np.abs(left - (1 - 2 * swing_share(time / 512, rate))).max() < 1.5 / 128
    assert np.abs(weights(list(lift_table()), time) / 255 - bump(time / 512)).max() < 1.8 / 255
    assert left[0] == 1 and left.max() > 1  # a foot first goes back, with the stance


def test_half_a_swing_on_the_spot_is_the_law_of_a_body_at_rest() -> None:
    time = np.arange(256)
    gone = weights(list(spot_table()), time) / 256
    assert np.abs(gone - swing_share(time / 512, 0.0)).max() < 1.5 / 256
    assert (np.diff(gone) >= 0).all()  # no foot goes back


def test_blending_is_exact_in_256ths() -> None:
    key, other, weight = np.meshgrid([0, 1, 100, 255], [0, 7, 200, 255], np.arange(256))
    exact = 256 * key + (other - key) * weight
    assert np.array_equal(blended(key, other, weight), exact)
    assert np.array_equal(blended(key, other, weight, twice=True), exact + (other - key) * weight)


def test_near_poses_share_a_row_in_their_middle_and_others_do_not() -> None:
    rows = Rows(0.5)
    numbers = [rows.number(np.array(pose)) for pose in ([10.0, 20], [10.9, 20], [12.0, 20], [10.2, 20.1])]
    assert numbers == [0, 0, 1, 0]
    assert rows.kept == [(10, 20), (12, 20)]


def test_more_steps_between_few_poses_than_the_script_holds_are_refused() -> None:
    """Twenty poses in random order, 60 ms each: the poses fit the tables, 140 steps of two bytes do not."""
    places = np.random.default_rng(1).integers(0, 20, 140)
    rows = np.repeat(1000.0 + 37.0 * places[:, None], 3, axis=0)
    with pytest.raises(ResourceError, match=r"the motion's script has \d+ bytes: its table holds 255"):
        poses_encoded(rows, [0], 0, 5.0, 0.5)
    few = poses_encoded(rows[: 3 * 70], [0], 0, 5.0, 0.5)
    assert few.size <= 255


@pytest.mark.parametrize("near", [2.0, 6.0])
def test_a_loop_begins_in_the_same_row_each_time(near: float) -> None:
    """Poses that share rows: the loop's first step comes from the row that its last one ends in."""
    for seed in (13, 14, 19):  # of the first thirty those whose loop needs it: 13 and 14 with both
        random = np.random.default_rng(seed)
        knots = 1500 + random.uniform(-10, 10, (25, 3))
        knots[24] = knots[12]
        rows = np.array([np.interp(np.arange(120), 5 * np.arange(25), knot) for knot in knots.T]).T
        made = poses_encoded(rows, (60,), 60, 3.0, near)
        last = 1
        while sum(step.timing.frames for step in made.steps[1 : last + 1]) < made.lead:
            last += 1
        table = np.frombuffer(made.rows, dtype=np.uint8).reshape(-1, 3).tolist()
        again, _ = poses_played([made.steps[-1], *made.steps[last + 1 :]], table, made.laws)
        assert (made.scale.widths(again) == made.widths[made.lead :]).all(), seed
