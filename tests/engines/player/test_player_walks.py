"""Walks and poses on small motions by hand: events, timings, steps, pieces, slots of the C and its tables."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.engines.firmware import ResourceError
from servogen.engines.inputs.buttons import ButtonPin
from servogen.engines.inputs.commands import CommandButton, CommandButtons, CommandLine
from servogen.engines.player import poses
from servogen.engines.player.arithmetic import ENTRIES
from servogen.engines.player.commanded import _Cuts, _read
from servogen.engines.player.encoding import Legs
from servogen.engines.player.layout import Slot, SlotLayout
from servogen.engines.player.legs import (
    Swing,
    WalkEvents,
    _Spot,
    _spots,
    _swing_law,
    _timing,
    keyed_walk,
    legs_encoded,
    played_steps,
    walk_events,
)
from servogen.engines.player.rendering import Slots, _button, _chain, _tables, kernel
from servogen.engines.player.script import (
    SILENT,
    STAY,
    STRAIGHT,
    DirectionPlaces,
    ScriptStep,
    StepTiming,
    timing,
)
from servogen.motion.gait.footwork import bump, swing_share
from servogen.units import Cycles


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


def test_a_swing_lifts_in_the_frame_before_it_is_in_the_air_and_lands_in_the_one_after() -> None:
    walk = walk_events(walk_rows((0, 4, 6), (1, 9, 12), frames=16, legs=2), (), PAIRS, (15,))
    assert walk is not None
    assert walk.swings == (Swing(0, 3, 7), Swing(1, 8, 13))
    # In half frames: the middle of the second one is between two frames.
    assert [swing.middle for swing in walk.swings] == [10, 21]
    assert walk.events == (0, 6, 10, 14, 16, 21, 26, 30)
    assert [walk.lifted(event) for event in walk.events] == [0, 0, 1, 0, 0, 2, 0, 0]
    assert (walk.turns, walk.lifts, walk.soft) == ((0, 2), (1, 3), 0)
    assert walk.pose(10).tolist() == [1500, 1600, 1500, 1500] and walk.pose(21)[3] == 1600
    assert walk.pose(7).tolist() == [1500, 1550, 1500, 1500], "between two frames their mean"


def test_legs_lift_and_land_together_or_the_motion_is_no_such_walk() -> None:
    def events(*lifted: tuple[int, int, int], frames: int = 16) -> Any:
        return walk_events(walk_rows(*lifted, frames=frames, legs=2), (), PAIRS, (frames - 1,))

    assert events((0, 4, 6), (1, 4, 6)) is not None
    assert events((0, 4, 6), (1, 8, 10)) is not None, "one lands where the other lifts"
    assert events((0, 4, 6), (1, 7, 9)) is None and events((0, 4, 6), (1, 5, 7)) is None
    assert events((0, 4, 6)) is None, "a leg that never lifts"


def test_ends_and_the_soft_start_are_events_and_long_steps_are_divided() -> None:
    table = walk_rows((0, 604, 606), (1, 604, 606), frames=616, legs=2)
    walk = walk_events(table, (3,), PAIRS, (605, 615))
    assert walk is not None
    # An end within a swing is none; from frame 3 to 603 in steps of 256 frames.
    assert walk.events == (0, 6, 6 + 512, 6 + 1024, 1206, 1210, 1214, 1230)
    exactly = walk_events(walk_rows((0, 257, 259), (1, 257, 259), frames=300, legs=2), (), PAIRS, (299,))
    assert exactly is not None and exactly.events == (0, 512, 516, 520, 598)


def test_steps_on_the_spot_are_swings_while_no_leg_on_the_ground_turns() -> None:
    swings = [Swing(0, 2, 6), Swing(1, 8, 12), Swing(0, 16, 20), Swing(1, 22, 26)]
    table = np.full((30, 4), 1500.0)
    # Leg 0 turns while it is in the air; the body moves from frame 14 on.
    table[3:, 0] = 1600
    table[15:, 2] += np.arange(15)

    def spots(changed: Any) -> list[tuple[int, int]]:
        return [(spot.begin, spot.end) for spot in _spots(changed, (0, 2), swings)]

    # Both legs in one group, in half frames; then leg 1 turns while it is in the air.
    assert spots(table) == [(4, 24), (44, 52)]
    assert spots(np.full((30, 4), 1500.0)) == [(4, 24), (32, 52)], "each leg once in a group"
    walking = np.full((30, 4), 1500.0) + np.arange(30)[:, None]
    assert spots(walking) == []
    slow = np.full((30, 4), 1500.0) + 1e-7 * np.arange(30)[:, None]
    assert spots(slow) == [(4, 24), (32, 52)], "less than a millionth of a cycle is rest"
    walk = WalkEvents(table, 0, (0, 2), (1, 3), tuple(swings), (), tuple(_spots(table, (0, 2), swings)))
    for begin, end, inside in ((4, 8, True), (4, 24, True), (3, 8, False), (8, 25, False)):
        assert (walk.spot(begin, end) is not None) == inside


@pytest.mark.parametrize(
    ("one", "other", "wanted"),
    [
        # Whole frames: as many as the step has, from its beginning.
        (0, 8, StepTiming(4, 16_384, 0)),
        (8, 14, StepTiming(3, 21_845, 0)),
        # From frame 4 to the middle between 6 and 7: the frames 4, 5 and 6, of two and a half.
        (8, 13, StepTiming(3, 26_214, 0)),
        # From there to frame 9: the frames 7 and 8; the first is half a frame after the beginning.
        (13, 18, StepTiming(2, 26_214, 51)),
        (13, 15, StepTiming(1, 0, 128)),
    ],
)
def test_a_timing_between_half_frames_begins_within_its_first_frame(
    one: int, other: int, wanted: StepTiming
) -> None:
    assert _timing(one, other) == wanted


def test_what_is_not_a_walk_is_not_encoded_as_one() -> None:
    table = walk_rows((0, 4, 6), (1, 8, 10), frames=16, legs=2)
    assert legs_encoded(table, 0, (), PAIRS, 0.3) is not None
    assert legs_encoded(table, 0, (), PAIRS[:1], 0.3) is None, "a channel that is no leg's"
    long = walk_rows((0, 270, 272), (1, 280, 282), frames=300, legs=2)
    # Parts of a soft start have at most 256 frames.
    assert legs_encoded(long, 290, (1, 257), PAIRS, 0.3, limited=False) is not None
    assert legs_encoded(long, 290, (1, 258), PAIRS, 0.3, limited=False) is None
    silent = table.copy()
    silent[3] = np.nan
    assert legs_encoded(silent, 8, (), PAIRS, 0.3) is None and legs_encoded(silent, 0, (), PAIRS, 0.3) is None
    seven = np.full((16, 14), 1500.0)
    assert legs_encoded(seven, 0, (), [(2 * n, 2 * n + 1) for n in range(7)], 0.3) is None
    # A walk after which the pulses end: its last pose is kept, without pulses.
    released = np.vstack((walk_rows((0, 4, 6), (1, 8, 10), frames=16, legs=2), np.full((2, 4), np.nan)))
    made = legs_encoded(released, 16, (), PAIRS, 0.3)
    assert made is not None
    assert made.silent.tolist() == [frame >= made.lead for frame in range(len(made.frames))]
    assert made.lead == 16 and not legs_encoded(table, 0, (), PAIRS, 0.3).silent.any()  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("rate", "beyond"), [(0.0, 0.0), (0.5, 0.0), (1.0, 0.1), (0.0, 0.05), (-0.2, 0.1), (0.3, -0.1)]
)
def test_the_law_of_the_swings_is_the_one_that_they_follow(rate: float, beyond: float) -> None:
    """The body starts in the middle of the first; the second has an odd number of frames; the third is on
    the spot, which has a law of its own.

    A law slower than at rest, or short of the foothold, is taken for one that is not.
    """
    table = np.full((60, 4), 1500.0)
    swings = (Swing(0, 2, 12), Swing(1, 15, 24), Swing(0, 30, 41))
    for swing, halves in zip(swings[:2], ((0.0, 100.0), (-80.0, -80.0)), strict=True):
        u = np.arange(swing.land - swing.lift + 1) / (swing.land - swing.lift)
        path = np.where(u < 0.5, *halves)
        table[swing.lift : swing.land + 1, 2 * swing.leg] += path * (2 * swing_share(u, rate, beyond) - 1)
    table[30:41, 0] += np.linspace(0, 77, 11) ** 2
    walk = WalkEvents(table, 0, (0, 2), (1, 3), swings, (), (_Spot(60, 82),))
    assert _swing_law(walk) == pytest.approx((max(rate, 0), max(beyond, 0)), abs=1e-9)


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
    made = legs_encoded(table, begin, (), PAIRS, 0.3)
    assert made is not None and not made.silent.any()
    wanted = steady(len(made.frames))
    assert np.abs(made.widths - wanted).max() <= 1.5
    assert len(made.frames) - made.lead == 24


@pytest.mark.parametrize(("neutral", "rises"), [(1499.7, True), (1500.3, True), (1499.8, False)])
def test_lifts_whose_neutral_pose_is_their_stance_need_no_row_of_their_own(
    neutral: float, rises: bool
) -> None:
    """A quarter of a step apart they are the same; the steps are single cycles here."""
    table = walk_rows((0, 4, 6), (1, 8, 10), frames=16, legs=2)
    table[0, 3] = neutral
    table[5, 0] += 200.0  # the turns need the range of a byte
    walk = walk_events(table, (1,), PAIRS, (15,))
    assert walk is not None
    keyed = keyed_walk(walk, 30, 0.3)
    assert keyed.fixed == (3 if rises else 2)
    assert keyed.legs.neutral == (4 if rises else None)
    stand, lifted = keyed.rows[:2]
    assert all(low < high for low, high in zip(stand, lifted, strict=True))
    if rises:
        assert keyed.rows[2] == (stand[0], stand[1] + round(neutral - 1500))


LEGS = Legs(turns=(0, 2), lifts=(1, 3), stand=0, lifted=2)
ROWS = bytes((10, 20, 200, 210, 100, 110, 140, 150, 60, 70))
"""The lifts' stance and top, then three rows of turns."""
SWING = [128 - 8 * n for n in range(17)]
LIFT = [15 * n for n in range(17)]
SPOT = [8 * n for n in range(17)]
LAWS = bytes((*SWING, *LIFT, *SPOT))


def law(table: list[int], time: int) -> int:
    """The table between its entries, rounded down."""
    place, rest = divmod(time, 16)
    return (table[place] * 16 + (table[place + 1] - table[place]) * rest) // 16


def stepped(*steps: ScriptStep, legs: Legs = LEGS, soft: bool = True) -> list[list[int]]:
    values: list[list[int]] = played_steps(list(steps), ROWS, LAWS, legs, soft).tolist()
    return values


def test_a_leg_on_the_ground_turns_evenly_and_one_in_the_air_by_the_swing() -> None:
    quick = timing(4)
    found = stepped(ScriptStep(2, quick), ScriptStep(3, quick, lifted=1), ScriptStep(4, quick), soft=False)
    times = [0, 64, 128, 192]
    for n, time in enumerate(times):
        # Leg 0 rises to the pose of row 3, from it back by twice the law; leg 1 turns evenly.
        up = law(SWING, time)
        assert found[n][0] == 256 * 140 + 2 * (100 - 140) * up
        assert found[n][2] == 256 * 110 + (150 - 110) * time
        assert found[n][1] == 256 * 10 + (200 - 10) * law(LIFT, time) and found[n][3] == 256 * 20
        # It lands in row 4: the same backward in time.
        down = law(SWING, 255 - time)
        assert found[4 + n][0] == 256 * 140 + 2 * (60 - 140) * down
        assert found[4 + n][2] == 256 * 150 + (70 - 150) * time
        assert found[4 + n][1] == 256 * 10 + (200 - 10) * law(LIFT, 255 - time)


def test_steps_on_the_spot_turn_only_the_leg_in_the_air() -> None:
    quick = timing(4)
    spot = [ScriptStep(3, quick, lifted, True) for lifted in (1, 0, 2, 0)]
    found = stepped(ScriptStep(2, quick), *spot, soft=False)
    times = [0, 64, 128, 192]
    for n, time in enumerate(times):
        up, down = law(SPOT, time), law(SPOT, 255 - time)
        # Leg 0 goes up from row 2, and down to row 3; it stands there while leg 1 does the same.
        assert found[n][0] == 256 * 100 + 40 * up and found[4 + n][0] == 256 * 140 - 40 * down
        assert found[8 + n][0] == found[12 + n][0] == 256 * 140
        assert found[n][2] == found[4 + n][2] == 256 * 110
        assert found[8 + n][2] == 256 * 110 + 40 * up and found[12 + n][2] == 256 * 150 - 40 * down
        assert found[n][3] == 256 * 20 and found[n][1] == 256 * 10 + 190 * law(LIFT, time)


def test_the_soft_start_brings_the_lifts_to_their_stance() -> None:
    quick = timing(4)
    legs = replace(LEGS, neutral=8)
    steps = [ScriptStep(2, quick), *[ScriptStep(2, quick)] * 3]
    found = stepped(*steps, legs=legs)
    # The neutral pose, evenly to the stance, and then the stance.
    assert [row[1] for row in found[:4]] == [256 * 60] * 4
    assert [row[1] for row in found[4:8]] == [256 * 60 - 50 * time for time in (0, 64, 128, 192)]
    assert [row[1] for row in found[8:]] == [256 * 10] * 4
    assert {row[1] for row in stepped(*steps, legs=legs, soft=False)} == {256 * 10}
    assert {row[1] for row in stepped(*steps)} == {256 * 10}


# directions


def test_a_chain_is_read_backward_with_the_timings_of_the_later_poses() -> None:
    a, b, c = (timing(frames) for frames in (2, 3, 4))
    steps = [
        ScriptStep(5, a), ScriptStep(6, a, 1), ScriptStep(7, b, 2), ScriptStep(8, c, 3, True),
        ScriptStep(8, c, 4, True),
    ]  # fmt: skip
    forward = _read(steps, 0, 2)
    assert [(step.row, step.timing, step.lifted) for step in forward] == [(5, a, 0), (6, a, 1), (7, b, 2)]
    backward = _read(steps, 2, 0)
    assert [(step.row, step.timing, step.lifted) for step in backward] == [(7, b, 2), (6, b, 1), (5, a, 0)]
    # On the spot, the row is that of the part's end.
    spot = _read(steps, 2, 4)
    assert [(step.row, step.spot) for step in spot] == [(7, False), (8, True), (8, True)]
    back = _read(steps, 4, 2)
    assert [(step.row, step.spot, step.lifted) for step in back] == [
        (8, False, 4),
        (7, True, 3),
        (7, True, 2),
    ]
    cuts = _Cuts(1, 4, 9, 12)
    assert cuts.forward == (1, 4, 9, 12) and cuts.backward == (12, 9, 4, 1)


def test_what_commands_a_walk_as_values_of_the_c() -> None:
    names = ("back", "forward", "right", "left")
    places = DirectionPlaces(CommandLine("RA4"), names, tuple(range(20)), 6, 3)
    plain = _chain(places)
    assert (plain["chain"], plain["last_direction"], plain["before_forward"]) == (True, 8, 6)
    assert (plain["commands"], plain["states"]) == ("0xE0", "0x1F")
    assert (plain["entry"], plain["stance"], plain["before"], plain["spot_timing"]) == (2, 6, 254, 3)
    line: Any = plain["line"]
    assert (line.port, line.mask) == ("A", "0x10") and plain["direction_buttons"] == []
    assert plain["step_button"] is None
    buttons = CommandButtons({"right": ButtonPin("RB7", 1), "back": ButtonPin("RA0", 0)})
    some: Any = _chain(replace(places, read=buttons))
    assert some["line"] is None
    # Twice a direction's number, in the order of the directions.
    assert [(one.number, one.port, one.mask, one.pressed) for one in some["direction_buttons"]] == [
        (2, "A", "0x01", "== 0"), (6, "B", "0x80", "!= 0")
    ]  # fmt: skip
    one: Any = _chain(replace(places, read=CommandButton(ButtonPin("RA3", 1))))["step_button"]
    assert (one.port, one.mask, one.released) == ("A", "0x08", "== 0")
    assert _chain(None) == {"chain": False}
    released: Any = _button(ButtonPin("RB2", 0))
    assert (released.port, released.mask, released.released) == ("B", "0x04", "!= 0") and _button(
        None
    ) is None


# slots in the C


def played(slots: tuple[Slot, ...], pins: tuple[str, ...], order: tuple[int, ...]) -> Any:
    channels = [SimpleNamespace(pin=pin) for pin in pins]
    schedule = SimpleNamespace(channels=channels)
    return SimpleNamespace(
        layout=SlotLayout(slots, Cycles(32)), plan=SimpleNamespace(schedule=schedule), order=order
    )


def test_slots_are_masks_ticks_and_places() -> None:
    slots = (Slot("B", (2, 0), 40), Slot("B", (1,), 41), Slot("A", (3,), 42), Slot("B", (), 43))
    made = Slots.of(played(slots, ("RB1", "RB5", "RB0", "RA3"), (2, 0, 1, 3)))
    assert [(slot.a, slot.b, slot.ticks, slot.channel, slot.other) for slot in made.all] == [
        (1, 2, 40, 0, 1), (0x20, 0, 41, 2, 2), (8, 0, 42, 3, 3), (0, 0, 43, 0, 0)
    ]  # fmt: skip
    # PORTB is 6, PORTA 5; three slots have pulses, the first two on port B.
    assert (made.ports, made.first) == (("0x06", "0x05"), 2)
    assert made.singles and not made.b_follows and made.other_follows
    pairs = (Slot("B", (0, 1), 40), Slot("B", (2, 3), 41))
    even = Slots.of(played(pairs, ("RB0", "RB1", "RB4", "RB5"), (0, 1, 2, 3)))
    assert even.b_follows and not even.singles and even.other_follows and even.first == 2
    mixed = Slots.of(played(pairs, ("RB0", "RB1", "RB4", "RB5"), (0, 2, 1, 3)))
    assert not mixed.other_follows
    apart = Slots.of(played(pairs, ("RB0", "RB1", "RB4", "RB6"), (0, 1, 2, 3)))
    assert not apart.b_follows


def test_the_table_of_poses_has_the_columns_of_the_slots() -> None:
    encoded = SimpleNamespace(legs=None, rows=bytes(range(6)), stride=3)
    some: Any = SimpleNamespace(encoded=encoded, order=(2, 0, 1))
    assert _tables(some) == {"ROW": [2, 0, 1, 5, 3, 4]}
    encoded.legs = LEGS
    assert _tables(some) == {"ROW": list(range(6))}


@pytest.mark.parametrize(("tick", "stagger"), [(32, 0), (64, 32)])
def test_the_kernel_waits_for_three_ticks(tick: int, stagger: int) -> None:
    text = kernel(Cycles(tick), Cycles(stagger))
    assert text == kernel(Cycles(tick), Cycles(stagger)) and text != kernel(Cycles(tick), Cycles(stagger + 1))
    assert text != kernel(Cycles(128), Cycles(stagger))


# poses


def pieces(*frames: float, far: float = 0.5, laws: tuple[str, ...] = (), marks: tuple[int, ...] = ()) -> Any:
    table = rows(*[[value] for value in (*frames, frames[0])])
    found = [piece for part in poses._parts(table, marks, 0, far) for piece in part.pieces(laws)]
    return [(piece.first, piece.end, piece.law, piece.pose) for piece in found]


def test_pieces_are_stays_and_straight_steps() -> None:
    assert pieces(5, 5, 5, 5) == [(0, 4, "stay", 0)]
    # A ramp back to its beginning after a jump: the frame after the last one is the first.
    assert pieces(0, 1, 2, 3, 4, 3, 2, 1) == [(0, 4, "straight", 4), (4, 8, "straight", 8)]
    assert pieces(0, 0.4, 0, 0.4) == [(0, 4, "stay", 0)], "within the limit"
    # A step begins at each mark.
    assert pieces(5, 5, 5, 5, marks=(2,)) == [(0, 2, "stay", 0), (2, 4, "stay", 2)]
    nan = float("nan")
    assert pieces(5, 5, nan, nan, 7, 7)[1] == (2, 4, "silent", 4), "to the pose after it"
    assert pieces(5, 5.4, 5.8, nan, nan, 5)[0] == (0, 3, "straight", 2), "the last one that has pulses"


def test_long_silence_is_divided_into_steps_of_256_frames() -> None:
    nan = float("nan")
    found = pieces(5, *[nan] * 600, 5)
    silent = [piece for piece in found if piece[2] == "silent"]
    assert silent == [(1, 257, "silent", 601), (257, 513, "silent", 601), (513, 601, "silent", 601)]
    stays = pieces(*[5] * 260)
    assert max(end - first for first, end, *_ in stays) <= 256 and stays[-1][1] == 260


def cheapest(table: Any, far: float) -> int:
    """Return the bytes of the cheapest stays and straight steps, by trying every sequence of them."""
    last, columns = len(table) - 1, table.shape[1]

    def near(one: Any, other: Any) -> bool:
        return bool(np.abs(one - other).max() <= far)

    def rest(first: int, reached: bool) -> float:
        if first == last:
            return 0 if reached else np.inf
        found = [np.inf]
        for end in range(first + 1, last + 1):
            if all(near(table[frame], table[first]) for frame in range(first, end)):
                price = 2 + (0 if reached else columns)
                found.append(price + rest(end, near(table[end], table[first])))
            line = np.linspace(table[first], table[end], end - first + 1)
            if reached and near(table[first : end + 1], line):
                found.append(2 + columns + rest(end, True))
        return min(found)

    return int(rest(0, True))


def test_the_pieces_are_the_cheapest_that_keep_the_limit() -> None:
    """A piece takes two bytes, and a row of all channels unless it stays in the pose that is reached."""
    random = np.random.default_rng(11)
    for number in range(120):
        columns = 1 + number % 2
        table = random.choice([0.0, 0.5, 1.0, 2.0, 3.0], (random.integers(2, 7), columns))
        price, reached = 0, True
        (part,) = poses._parts(table, (), 0, 0.5)
        for piece in part.pieces(()):
            frames = table[piece.first : piece.end + 1]
            if piece.law == "stay":
                assert piece.pose == piece.first
                assert np.abs(frames[:-1] - frames[0]).max() <= 0.5
                price += 2 if reached else 2 + columns
                reached = bool(np.abs(frames[-1] - frames[0]).max() <= 0.5)
            else:
                assert reached and piece.pose == piece.end
                line = np.linspace(frames[0], frames[-1], len(frames))
                assert np.abs(frames - line).max() <= 0.5
                price += 2 + columns
        assert reached and price == cheapest(table, 0.5), table.tolist()


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


def test_poses_are_counted_up_to_a_full_table() -> None:
    assert poses._far_apart(np.arange(5.0)[:, None], 0.9) == 5
    assert poses._far_apart(np.arange(5.0)[:, None], 1.0) == 3
    assert poses._far_apart(rows([0, 0], [0, 2], [2, 0], [0, 1]), 1.5) == 3
    assert poses._far_apart(np.arange(300.0)[:, None], 0.5) == 257


def test_a_law_is_taken_where_it_fits_better_than_straight_steps() -> None:
    u = np.arange(41) / 40
    path = [*(1000 + 400 * u**2).tolist(), *[1400.0] * 10]
    straight = pieces(*path, far=1.0)
    curved = pieces(*path, far=1.0, laws=("accelerate",))
    assert len(curved) < len(straight)
    assert curved[0][2] == "accelerate" and all(law in ("straight", "stay") for *_, law, _ in straight)


def test_a_played_step_is_the_law_between_two_rows() -> None:
    table = [(10, 20), (50, 220)]
    laws = bytes(range(0, 17 * 8, 8))
    steps = [
        ScriptStep(0, timing(1)),
        ScriptStep(1, timing(4, STRAIGHT)),
        ScriptStep(0, timing(2, STAY)),
        ScriptStep(1, timing(2, 0)),
        ScriptStep(0, timing(2, SILENT)),
    ]
    values, silent = poses._played(steps, table, laws)
    times = [0, 64, 128, 192]
    assert values[:4].tolist() == [[2560 + 40 * time, 5120 + 200 * time] for time in times]
    assert values[4:6].tolist() == [[2560, 5120]] * 2, "a stay is in its pose from the first frame on"
    assert values[6:8].tolist() == [[2560, 5120], [2560 + 40 * 64, 5120 + 200 * 64]]
    assert values[8:].tolist() == [[2560, 5120]] * 2
    assert silent.tolist() == [False] * 8 + [True] * 2


def test_nodes_are_all_frames_or_where_the_motion_changes() -> None:
    short = np.zeros((601, 1))
    assert poses._nodes(short, 0.5).tolist() == list(range(601))
    long = np.zeros((2401, 1))
    long[1200:] = 100.0
    nodes = poses._nodes(long, 0.5).tolist()
    # Every fourth frame, and all frames about the jump.
    assert nodes[:3] == [0, 4, 8] and nodes[-1] == 2400
    assert set(range(1197, 1203)) <= set(nodes) and len(nodes) < 620
    # A parabola c t² is 4 c away from its chord over four frames.
    for curve, every in ((0.12, 4), (0.13, 1)):
        found = poses._nodes(curve * np.arange(2401.0)[:, None] ** 2, 0.5).tolist()
        assert found == list(range(0, 2401, every))


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
