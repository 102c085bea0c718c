"""Which changes an adviser tries, in which order, and what it says about them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.compiler import WORDS_NEEDED
from servogen.engines.player.shares import Share, Shares
from servogen.errors import InputError
from servogen.job import PlannedJob, loads, plan_job
from servogen.workflows import advice
from servogen.workflows.advice import Advice, ResourceUse, TriedChange, with_advice
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
    monkeypatch.setattr(advice, "table_shares", lambda job: None)
    monkeypatch.setattr(advice, "tried_fit", lambda job, change: use if change.text == fits else None)
    with_advice(job, InputError(code, "too much"), told.append, lambda: 0.0)
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
    monkeypatch.setattr(advice, "table_shares", lambda job: None)
    monkeypatch.setattr(advice, "tried_fit", lambda job, change: None)
    told: list[str] = []
    clock = iter([100.0, 400.0, *[400.1] * 9])
    found = with_advice(motion, InputError("does-not-fit", "too much"), told.append, lambda: next(clock))
    assert told == ["trying only the first 3 poses"]
    assert found.hint == "after 300 s no further changes were tried"
    nothing = InputError("does-not-fit", "too much")
    assert with_advice(motion, nothing, now=lambda: 0.0) is nothing, "without advice it is the same error"


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
    monkeypatch.setattr(advice, "frame_demand", lambda job, shares: demand)
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
