"""A world that follows a chip, with a world that only counts its steps: no physics runs."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Any, cast

import pytest

from servogen.edges import PINS, EdgeChunk, edge_chunk
from servogen.errors import InputError
from servogen.twin import live
from servogen.twin.live import FollowedWorld
from servogen.twin.pulses import PulseReceiver, ReceivedPulse
from servogen.units import Clock

MHZ4 = Clock(4_000_000)  # a step of a millisecond has 1000 cycles
Row = tuple[int, int, int]


class World:
    """Steps, and the pulses that took effect in each."""

    def __init__(self) -> None:
        self.step = 0
        self.heard: tuple[tuple[int, ReceivedPulse], ...] = ()
        self.diverged = False
        self.restored: list[int] = []
        self.advanced = 0

    @property
    def seconds(self) -> float:
        return self.step / 1000

    def pulse(self, pulse: ReceivedPulse) -> None:
        self.heard = (*self.heard, (self.step, pulse))

    def advance(self) -> None:
        self.step += 1
        self.advanced += 1

    def snapshot(self) -> Any:
        return self.step, self.heard

    def restore(self, snapshot: Any) -> None:
        self.step, self.heard = snapshot
        self.restored.append(self.step)


def twin(rows: list[Row]) -> tuple[FollowedWorld, World, list[tuple[int, int]]]:
    """A world with one servo on RB0, and the spans of cycles that it asked for."""
    world, asked = World(), list[tuple[int, int]]()

    def edges(begin: int, end: int) -> EdgeChunk:
        asked.append((begin, end))
        inside = [row for row in rows if begin <= row[0] < end]
        return edge_chunk(*zip(*inside, strict=True)) if inside else edge_chunk((), (), ())

    receiver = PulseReceiver([PINS.index("RB0")], MHZ4, Fraction(1, 1000))
    return FollowedWorld(cast(Any, world), receiver, edges), world, asked


PULSES = [row for begin in range(500, 900_000, 20_000) for row in ((begin, 5, 1), (begin + 1500, 5, 0))]


def straight(step: int) -> tuple[tuple[int, ReceivedPulse], ...]:
    """Return what a twin hears that goes to a step without a detour: at the first step after each fall."""
    found = []
    for cycle, _, level in PULSES:
        if level == 0 and -(-cycle // 1000) < step:
            found.append((-(-cycle // 1000), ReceivedPulse(-(-cycle // 1000), 0, 1500.0)))
    return tuple(found)


def test_a_moment_is_the_same_whichever_way_it_is_reached() -> None:
    made, world, _ = twin(PULSES)
    for cycle in (250_000, 649_999, 650_000, 1000, 333_333, 300_000, 99_999, 0, 700_001):
        assert made.follow(cycle)
        assert made.step == cycle // 1000
        assert made.cycle == 1000 * (cycle // 1000)
        assert world.heard == straight(made.step)
    assert made.kept == list(range(0, 701, 100))
    assert made.snapshots == 8


def test_it_goes_on_from_the_latest_snapshot_before_the_moment() -> None:
    made, world, asked = twin(PULSES)
    made.follow(450_000)
    assert world.restored == []
    assert asked[0] == (0, 20_000), "twenty steps at a time"
    assert asked[-1] == (440_000, 450_000)
    assert all(before[1] == after[0] for before, after in pairwise(asked))
    for cycle, restored in ((430_000, 400), (400_000, 400), (399_999, 300), (150_000, 100)):
        world.restored.clear()
        made.follow(cycle)
        assert world.restored == [restored], cycle
    world.restored.clear()
    made.follow(199_000)  # ahead of it there is no snapshot: it goes on
    assert world.restored == []
    made.follow(250_000)  # the one at 200 is ahead
    assert world.restored == [200]


def test_without_time_it_calculates_one_stretch_and_says_that_it_is_not_there() -> None:
    made, _, _ = twin(PULSES)
    assert not made.follow(100_000, seconds=0.0)
    assert made.step == 20
    made.follow(90_000)
    assert made.follow(95_000, seconds=0.0)
    assert not made.follow(130_000, seconds=0.0)
    assert made.step == 100, "a stretch ends where a snapshot is taken"
    assert made.follow(100_999, seconds=0.0), "it is there already"


def test_what_followed_from_a_changed_past_is_dropped() -> None:
    made, world, _ = twin(PULSES)
    made.follow(550_000)
    made.forget(300_000)  # the edges of the cycle itself act later than the snapshot at its step
    assert made.kept == [0, 100, 200, 300]
    assert made.step == 300
    made.follow(320_000)
    made.forget(320_000)
    assert made.step == 320
    made.forget(319_999)
    assert made.step == 300
    made.forget(299_999)
    assert (made.step, made.kept) == (200, [0, 100, 200])
    assert world.heard == straight(200)


def test_pulses_that_wait_for_their_step_are_part_of_a_snapshot() -> None:
    """A pulse that falls at cycle 99 500 takes effect in step 100, at which the snapshot is taken."""
    rows = [(98_000, 5, 1), (99_500, 5, 0), (99_900, 5, 1), (101_000, 5, 0)]
    made, world, _ = twin(rows)
    made.follow(103_000)
    first = world.heard
    assert [(step, round(pulse.width_us)) for step, pulse in first] == [(100, 1500), (101, 1100)]
    made.follow(100_000)
    assert world.heard == ()
    made.follow(103_000)
    assert world.heard == first


def test_old_snapshots_are_thinned_out_to_three_quarters(monkeypatch: pytest.MonkeyPatch) -> None:
    """Recent ones, up to 500 steps away, stay; of the others those at multiples of 200, then of 400 …"""
    monkeypatch.setattr(live, "MAX_SNAPSHOTS", 20)
    monkeypatch.setattr(live, "RECENT", 500)
    made, world, _ = twin([])
    made.follow(1_900_000)
    assert made.kept == list(range(0, 2000, 100)), "twenty of them fit"
    made.follow(2_000_000)
    old = list(range(0, 1500, 200))
    assert made.kept == [*old, *range(1500, 2001, 100)]
    assert len(made.kept) <= 15
    made.follow(1_350_000)
    assert world.restored == [1200]
    assert made.step == 1350
    assert 1300 in made.kept, "what is calculated again is kept again"


def test_physics_that_diverges_is_an_error() -> None:
    made, world, _ = twin([])
    world.diverged = True
    with pytest.raises(InputError, match=r"the physics diverged before 0\.02 s") as error:
        made.follow(50_000)
    assert error.value.code == "unstable"
