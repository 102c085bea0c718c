"""Which changes an adviser tries, in which order, and what it says about them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from servogen.compiler import WORDS_NEEDED
from servogen.engines.player.shares import Share, Shares
from servogen.errors import InputError
from servogen.job import PlannedJob, loads, plan_job
from servogen.robot.servo import Servo, servo
from servogen.robot.servo_models import servo_model
from servogen.units import Clock
from servogen.workflows import advice
from servogen.workflows.advice import Advice, ResourceUse, TriedChange, advised
from tests.engines.player.player_jobs import job_text, poses
from tests.workflows.test_advice import TRIPOD

MOTION = job_text(1, poses([[30], [60], [90], [120], [60]], 1))


@pytest.fixture(scope="module")
def tripod() -> PlannedJob:
    return plan_job(loads(TRIPOD, "job.toml"))


@pytest.fixture(scope="module")
def motion() -> PlannedJob:
    return plan_job(loads(MOTION, "job.toml"))


def tried(job: PlannedJob, code: str, monkeypatch: pytest.MonkeyPatch, fits: str = "") -> list[str]:
    """Return what is tried if only the change `fits` does."""
    told: list[str] = []
    use = ResourceUse(900, 300, 1.5)
    monkeypatch.setattr(advice, "_shares", lambda job: None)
    monkeypatch.setattr(advice, "_fit", lambda job, change: use if change.text == fits else None)
    advised(job, InputError(code, "too much"), told.append, lambda: 0.0)
    assert all(each.startswith("trying ") for each in told)
    return [each.removeprefix("trying ") for each in told]


LONGER = [f"period_us = {value}" for value in (20_480, 21_000, 22_000, 23_000, 25_000, 30_000)]
LARGER = [f"max_error_us = {value}" for value in (13, 15, 20, 30, 40)]  # of 10 µs, rounded up
FEWER = ["only the first 3 poses", "only the first 2 poses"]


@pytest.mark.parametrize(
    ("code", "changes"),
    [
        ("does-not-fit", [*FEWER, *LARGER]),
        ("beyond-max-error", [*FEWER, *LARGER]),
        ("widths-too-far-apart", [*FEWER, *LARGER]),
        ("frame-too-short", [*LONGER, *FEWER, *LARGER]),
        ("servo-limit", []),
    ],
)
def test_changes_of_poses_are_tried_smallest_first(
    motion: PlannedJob, code: str, changes: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert tried(motion, code, monkeypatch) == changes


def test_of_each_kind_the_smallest_change_that_fits_is_proposed(
    motion: PlannedJob, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = tried(motion, "frame-too-short", monkeypatch, "period_us = 22000")
    assert found == [*LONGER[:3], *FEWER, *LARGER]
    slow = plan_job(loads(MOTION.replace("[frame]\n", "[frame]\nperiod_us = 23_000\n"), "job.toml"))
    assert tried(slow, "frame-too-short", monkeypatch)[:2] == LONGER[4:]
    pair = plan_job(loads(job_text(1, poses([[30], [60]], 1)), "job.toml"))
    assert tried(pair, "does-not-fit", monkeypatch) == ["only the first 1 pose", *LARGER]
    eight = plan_job(loads(job_text(1, poses([[30], [60]] * 4, 1)), "job.toml"))
    three_quarters = ["only the first 6 poses", "only the first 4 poses"]
    assert tried(eight, "does-not-fit", monkeypatch) == [*three_quarters, *LARGER]


def test_changes_of_a_walk_are_slower_cycles_lower_lifts_and_the_tripod(
    tripod: PlannedJob, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cycles are whole frames of 20 ms."""
    walk = tripod.section
    cycle_s, lift = walk.cycle_s, walk.lift_mm  # type: ignore[union-attr]
    slower = [f"cycle_s = {round(round(cycle_s * factor / 0.02) * 0.02, 4):g}" for factor in (1.25, 1.5, 2)]
    lower = [f"lift_mm = {round(lift * share, 1):g}" for share in (0.75, 0.5)]
    assert tried(tripod, "does-not-fit", monkeypatch) == slower
    assert tried(tripod, "beyond-max-error", monkeypatch) == [*slower, *lower, *LARGER]
    assert tried(tripod, "frame-too-short", monkeypatch) == [*LONGER, *slower, *lower]
    more = TRIPOD.replace('gait = "tripod"', 'gait = "wave"').replace(
        "cycles = 4 }]", "cycles = 1 }, { turn_deg = 10, cycles = 1 }, { forward_mm = 9, cycles = 1 }]"
    )
    waving = plan_job(loads(more, "job.toml"))
    assert tried(waving, "does-not-fit", monkeypatch) == [
        *slower,
        'gait = "tripod"',
        "only the first 2 segments of the route",
        "only the first 1 segment of the route",
        "segment 1 alone",
        "segment 2 alone",
        "segment 3 alone",
    ]


def test_time_is_up_after_five_minutes_and_not_before(
    motion: PlannedJob, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(advice, "_shares", lambda job: None)
    monkeypatch.setattr(advice, "_fit", lambda job, change: None)
    told: list[str] = []
    clock = iter([100.0, 400.0, *[400.1] * 9])
    found = advised(motion, InputError("does-not-fit", "too much"), told.append, lambda: next(clock))
    assert told == ["trying only the first 3 poses"]
    assert found.hint == "after 300 s no further changes were tried"
    nothing = InputError("does-not-fit", "too much")
    assert advised(motion, nothing, now=lambda: 0.0) is nothing, "without advice it is the same error"


def parts(count: int) -> tuple[Share, ...]:
    """Parts of 10, 20, 30 … bytes, the first with an error of its own."""
    return tuple(
        Share(f"part {number}", rows=10 * number, error_us=0.5 if number == 1 else None)
        for number in range(1, count + 1)
    )


def test_the_advice_in_words_and_as_json(motion: PlannedJob) -> None:
    error = InputError("does-not-fit", "too much")
    error.details = {WORDS_NEEDED: 1100}
    found = Advice(motion, error, Shares(parts(3), (), 0, False))
    small, large = ResourceUse(900, 59, 1.5), ResourceUse(1000, 60, 2.0)
    found.proposals = [TriedChange("less", small), TriedChange("never", None), TriedChange("same", large)]
    found.segments = [TriedChange("segment 1", small), TriedChange("segment 2", None)]
    found.omitted = True
    assert found.text().split("\n  ") == [
        "by part: part 1: 10 of 60 bytes, 0.5 µs; part 2: 20 of 60 bytes; part 3: 30 of 60 bytes",
        "of the words: the motion 60, all else 1040: 1100 of 1024",
        "what fits: less (1 byte less: 59 bytes of motion, 900 words, 1.5 µs); "
        "or same (60 bytes of motion, 1000 words, 2 µs)",
        "by segment: segment 1 alone takes 59 bytes of motion, 900 words, 1.5 µs; "
        "segment 2 alone does not fit",
        "after 300 s no further changes were tried",
    ]
    shown: Any = found.to_json()
    assert (shown["motion_bytes"], shown["words"], shown["frame"]) == (60, 1100, None)
    assert shown["proposals"] == [
        {"change": "less", "motion_bytes": 59, "words": 900, "error_us": 1.5},
        {"change": "same", "motion_bytes": 60, "words": 1000, "error_us": 2.0},
    ]
    assert shown["segments"] == [
        {"segment": "segment 1", "fits": {"motion_bytes": 59, "words": 900, "error_us": 1.5}},
        {"segment": "segment 2", "fits": None},
    ]
    assert shown["stopped_early"]
    assert [part["part"] for part in shown["parts"]] == ["part 1", "part 2", "part 3"]
    bare = Advice(motion, InputError("does-not-fit", "too much"))
    assert bare.text() == ""
    assert bare.words is None
    plain: Any = bare.to_json()
    assert (plain["parts"], plain["motion_bytes"], plain["words"], plain["stopped_early"]) == (
        [],
        None,
        None,
        False,
    )
    assert "of the words" not in replace(found, error=bare.error).text()


def test_the_six_largest_parts_are_shown_one_by_one(motion: PlannedJob) -> None:
    error = InputError("does-not-fit", "too much")
    for count, rest in ((6, ""), (7, "; 1 other: 10"), (8, "; 2 others: 30")):
        text = Advice(motion, error, Shares(parts(count), (), 0, False)).text()
        shown = range(max(1, count - 5), count + 1)
        whole = sum(10 * number for number in range(1, count + 1))
        listed = "; ".join(
            f"part {number}: {10 * number} of {whole} bytes" + (", 0.5 µs" if number == 1 else "")
            for number in shown
        )
        assert text == f"by part: {listed}{rest}"


def test_a_frame_that_is_too_short_is_added_up(motion: PlannedJob, monkeypatch: pytest.MonkeyPatch) -> None:
    slots = (((0,), 2500), ((0, 0), 3000))
    demand = SimpleNamespace(slots=slots, frame_c=700, minimum=6200)
    monkeypatch.setattr(advice, "_demand", lambda job, shares: demand)
    found = Advice(motion, InputError("frame-too-short", "too long"), Shares(parts(1), (), 0, False))
    assert found.text().split("\n  ")[1] == (
        "of the frame: s0 2500, s0 and s0 3000, the C for the next frame 700: 6200 of 20000 µs"
    )
    shown: Any = found.to_json()
    assert shown["frame"] == {
        "slots": [{"servos": ["s0"], "us": 2500.0}, {"servos": ["s0", "s0"], "us": 3000.0}],
        "c_us": 700.0,
        "minimum_us": 6200.0,
        "period_us": 20_000.0,
    }


# Narrower limits. A Futaba S3001 takes 1000 µs at 0° and 500 µs more for each 90°.

FUTABA = servo_model("futaba-s3001")
LIMITS = (math.radians(10), math.radians(160))
FORWARD = servo("s0", "RB0", FUTABA, limits=LIMITS)
MIRRORED = servo("s0", "RB0", FUTABA, limits=LIMITS, reverse=True)
WHEEL = replace(FORWARD, model=replace(FUTABA, continuous=True))


@pytest.mark.parametrize(
    ("arm", "degrees", "outward", "limit"),
    [
        (FORWARD, 100.1, True, ("max_deg", 100.1)),
        (FORWARD, 100.1, False, ("max_deg", 100.1)),
        (FORWARD, 100.04, True, ("max_deg", 100.1)),
        (FORWARD, 100.06, False, ("max_deg", 100.0)),
        (MIRRORED, 100.06, True, ("min_deg", 100.0)),
        (MIRRORED, 100.04, False, ("min_deg", 100.1)),
        (FORWARD, 159.9, True, ("max_deg", 159.9)),
        (FORWARD, 159.91, True, None),
        (FORWARD, 10.0, True, None),
        (MIRRORED, 10.1, True, ("min_deg", 10.1)),
        (MIRRORED, 10.09, True, None),
        (WHEEL, 100.0, True, None),
    ],
)
def test_a_limit_is_in_tenths_of_a_degree_and_narrower_than_the_servos_own(
    arm: Servo, degrees: float, outward: bool, limit: tuple[str, float] | None
) -> None:
    """Outward the angle stays allowed, inward the pulses stay as short; a mirrored servo counts backwards."""
    assert advice._limit(arm, math.radians(degrees), outward=outward) == limit


def test_a_servo_is_limited_to_pulses_of_a_length() -> None:
    """1560 µs are 100.8°, and of a mirrored servo 180 - 100.8 = 79.2°."""
    limited = advice._limited(FORWARD, 1560)
    assert limited.limits == (LIMITS[0], pytest.approx(math.radians(100.8)))
    assert limited.widths_us[1] == pytest.approx(1560)
    mirrored = advice._limited(MIRRORED, 1560)
    assert mirrored.limits == (pytest.approx(math.radians(79.2)), LIMITS[1])
    assert mirrored.widths_us[1] == pytest.approx(1560)
    assert advice._limited(FORWARD, 1900) is FORWARD, "its own limit, 1889 µs, is narrower"


@dataclass(frozen=True)
class Used:
    longest: int


@dataclass(frozen=True)
class Needs:
    """The shares of pulses whose shortest frame is what `minimum` says of the servos and pulses."""

    pulses: tuple[Used, ...]
    minimum: Callable[[Sequence[Servo], tuple[Used, ...]], int]

    def frame(self, servos: Sequence[Servo], frame: object, clock: object) -> Any:
        return SimpleNamespace(minimum=self.minimum(servos, self.pulses))


@pytest.fixture(scope="module")
def three() -> PlannedJob:
    """Servos whose longest pulses are 1700, 1833 and 1778 µs, at 126°, 150° and 140°."""
    return plan_job(loads(job_text(3, poses([[126, 30, 140], [30, 150, 125]], 1)), "job.toml"))


LONGEST = (Used(1700), Used(1833), Used(1778))


def test_limits_as_used_are_set_for_as_many_servos_as_the_frame_needs(three: PlannedJob) -> None:
    """Those with the longest pulses first; each saves a cycle of 20002, and 20000 is enough."""

    def narrowed(servos: Sequence[Servo]) -> int:
        return sum(arm.limits != own.limits for arm, own in zip(servos, three.servos, strict=True))

    needs = Needs(LONGEST, lambda servos, pulses: 20_002 - narrowed(servos))
    (change,) = advice._limits_as_used(three, cast(Any, needs))
    assert change.text == "s1 max_deg = 150, s2 max_deg = 140"
    assert change.edits == {("servo", 1, "max_deg"): 150.0, ("servo", 2, "max_deg"): 140.0}
    equal = replace(needs, pulses=(Used(1700), Used(1700), Used(1778)))
    (change,) = advice._limits_as_used(three, cast(Any, equal))
    assert change.text == "s2 max_deg = 140, s0 max_deg = 126"
    needs = Needs(LONGEST, lambda servos, pulses: 20_004 - narrowed(servos))
    assert list(advice._limits_as_used(three, cast(Any, needs))) == []
    full = plan_job(loads(job_text(2, poses([[30, 150], [160, 30]], 1)), "job.toml"))
    needs = Needs((Used(1889), Used(1833)), lambda servos, pulses: 20_000)
    (change,) = advice._limits_as_used(full, cast(Any, needs))
    assert change.text == "s1 max_deg = 150", "s0 uses all that it may"


def test_pulses_are_shortened_in_steps_of_10_us_until_they_fit(three: PlannedJob) -> None:
    seen: list[tuple[int, ...]] = []

    def minimum(servos: Sequence[Servo], pulses: tuple[Used, ...]) -> int:
        seen.append(tuple(used.longest for used in pulses))
        assert all(arm.widths_us[1] <= 1889 for arm in servos)
        for arm, used, own in zip(servos, pulses, LONGEST, strict=True):
            if used.longest < own.longest:
                assert arm.widths_us[1] <= used.longest + 0.001
            else:
                assert arm.limits == three.servos[0].limits
        return 18_300 + max(used.longest for used in pulses)

    (change,) = advice._shorter_pulses(three, cast(Any, Needs(LONGEST, minimum)))
    assert change.text == "max_deg = 126 of s1, s2, and no pose beyond"
    assert change.edits == {
        ("servo", 1, "max_deg"): 126.0,
        ("servo", 2, "max_deg"): 126.0,
        ("motion", "poses", 0, "s2_deg"): 126.0,
        ("motion", "poses", 1, "s1_deg"): 126.0,
    }
    assert seen == [(1700, min(cap, 1833), min(cap, 1778)) for cap in range(1830, 1690, -10)]
    seen.clear()
    never = Needs(LONGEST, lambda servos, pulses: seen.append(()) or 20_001)
    assert list(advice._shorter_pulses(three, cast(Any, never))) == []
    assert len(seen) == len(range(1830, 850, -10)), "to half of the shortest, 850 µs, which is not tried"


def test_the_poses_of_a_mirrored_servo_are_kept_above_its_limit() -> None:
    """At 1700 µs it stands at 180 - 126 = 54°; a pose without the servo stays as it is."""
    data = {"motion": {"poses": [{"s0_deg": 20}, {"s0_deg": 54.0}, {"move_s": 1}, {"s0_deg": 90}]}}
    job: Any = SimpleNamespace(servos=[MIRRORED], document=SimpleNamespace(data=data))
    (change,) = advice._capped(job, [0], 1700)
    assert change.text == "min_deg = 54 of s0, and no pose beyond"
    assert change.edits == {("servo", 0, "min_deg"): 54.0, ("motion", "poses", 0, "s0_deg"): 54.0}
    job.servos = [WHEEL]
    assert list(advice._capped(job, [0], 1700)) == []
    tips: Any = SimpleNamespace(
        clock=Clock(4_000_000), document=SimpleNamespace(data={"motion": {"poses": [{"tip_mm": [1, 2]}]}})
    )
    assert list(advice._shorter_pulses(tips, cast(Any, Needs(LONGEST, lambda servos, pulses: 0)))) == []


def walk_changes(code: str = "does-not-fit", **around: Any) -> list[str]:
    """The changes of a walk in frames of 20.48 ms, unless given a wave of one segment without a cycle."""
    facts = {
        "cycle_s": None,
        "lift_mm": 15.0,
        "gait": "wave",
        "duty": 0.8,
        "route": (1,),
        "commands": None,
        **around,
    }
    asked = {"forward_mm": 30, "turn_deg": 20}
    data = {"walk": {"route": [{}] * len(facts["route"]), "commands": asked}}
    job: Any = SimpleNamespace(
        clock=Clock(4_000_000),
        trajectory=SimpleNamespace(period=20_480),
        document=SimpleNamespace(data=data),
    )
    groups = advice._walk_changes(job, cast(Any, SimpleNamespace(**facts)), code)
    return [change.text for group in groups for change in group]


def test_changes_of_a_walk_depend_on_what_it_states() -> None:
    assert walk_changes() == []
    # 0.5 s and a quarter are 30.5 frames; 31 are 0.63488 s.
    assert walk_changes(cycle_s=0.5) == ["cycle_s = 0.6349", "cycle_s = 0.7578", "cycle_s = 1.0035"]
    assert walk_changes("beyond-max-error") == ["lift_mm = 11.2", "lift_mm = 7.5"]
    assert walk_changes(duty=None) == ['gait = "tripod"']
    assert walk_changes(duty=None, gait="tripod") == []
    assert walk_changes(route=(1, 2)) == ["only the first 1 segment of the route"]
    both = SimpleNamespace(forward_mm=30, turn_deg=20)
    assert walk_changes(commands=both) == ["commands without turn_deg", "commands without forward_mm"]
    assert walk_changes(commands=SimpleNamespace(forward_mm=30, turn_deg=0)) == []
    assert walk_changes(commands=SimpleNamespace(forward_mm=0, turn_deg=20)) == []


@pytest.mark.parametrize(("left", "fits"), [(None, False), (-1, False), (0, True), (9, True)])
def test_a_change_fits_if_the_c_is_never_late(left: int | None, fits: bool) -> None:
    firmware = SimpleNamespace(
        timing_budgets=[SimpleNamespace(left=5), SimpleNamespace(left=left)],
        compilation=SimpleNamespace(words=900),
    )
    played: Any = SimpleNamespace(
        job=SimpleNamespace(firmware=SimpleNamespace(dialect="xc8")),
        make=lambda dialect: firmware if dialect == "xc8" else None,
        data_bytes=300,
        plan=SimpleNamespace(schedule=SimpleNamespace(plan_error_us=1.5)),
    )
    assert advice._taken(played) == (ResourceUse(900, 300, 1.5) if fits else None)
