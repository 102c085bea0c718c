"""Bodies and contacts of a watched job: the physics follows the chip, wherever it goes."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from servogen.errors import InputError
from servogen.job.schema import SensorTable
from servogen.simulator import Levels, Stimuli
from servogen.twin import TwinSettings, simulate
from servogen.twin import live as module
from servogen.twin.live import LiveTwin
from servogen.twin.run import SAMPLE_S
from servogen.watch.live_bodies import LiveBodies
from servogen.watch.session import WatchSession
from servogen.watch.subject import Setting, Subject, load_subject
from tests.watch.test_session import answer, captured

ROOT = Path(__file__).parent.parent.parent
S = 1_000_000
"""Cycles a second, at 4 MHz."""


@pytest.fixture(scope="module")
def on_command() -> Subject:
    return load_subject(ROOT / "jobs" / "hexapod-command.toml", Setting())


@pytest.fixture(scope="module")
def walk() -> Subject:
    return load_subject(ROOT / "jobs" / "hexapod-tripod.toml", Setting())


def shown(session: WatchSession, cycle: int) -> dict[str, Any]:
    """The bodies of a moment, when they have got there."""
    answer(session, do="seek", cycle=cycle)
    assert session.bodies is not None
    return list(session.bodies.follow(600))[-1]


def with_bodies(subject: Subject) -> tuple[WatchSession, dict[str, Any]]:
    session = WatchSession(subject)
    (answer,) = session.handle({"do": "bodies", "on": True})
    return session, answer["model"]


def twin_of(session: WatchSession) -> LiveTwin:
    job, chip = session.subject.job, session.chip
    assert job is not None and chip is not None
    return LiveTwin(job, session.subject.clock, chip.edges)


def numbers(twin: LiveTwin) -> bytes:
    moment = twin.moment()
    parts = (moment.pose, moment.feet, moment.force, *(np.array(line.frames) for line in moment.lines))
    return b"".join(np.ascontiguousarray(part).tobytes() for part in parts)


def test_a_standing_robot_stands_on_six_feet_that_carry_its_weight(on_command: Subject) -> None:
    session, model = with_bodies(on_command)
    found = shown(session, 2_500_000)
    assert found["seconds"] == 2.5 and found["behind"] == 0
    assert model["legs"] == ["L1", "L2", "L3", "R1", "R2", "R3"] and model["floating"]
    assert min(found["force"]) > model["touch"]
    assert sum(found["force"]) == pytest.approx(0.64 * 9.81, rel=0.03)  # 0.64 kg
    assert found["pose"][2] / 10 == pytest.approx(130, abs=2)
    counts = [line["count"] for line in model["lines"]]
    assert counts == [7, 4, 4, 4, 4, 4, 4]
    points = np.array(found["points"]).reshape(sum(counts), 3)
    feet = points[model["feet"]]
    assert feet[:, 2] / 10 == pytest.approx(0, abs=0.5), "of each leg the lowest point is its foot"
    assert feet[:, :2].mean(axis=0) / 10 == pytest.approx(np.array(found["pose"][:2]) / 10, abs=3)
    assert (points[len(feet) + 1 :, 2].reshape(6, 4).argmin(axis=1) == 3).all()


def test_the_bodies_are_those_of_a_twin_that_hears_what_was_done_by_hand(on_command: Subject) -> None:
    """Another future, begun at 2.5 s after 4 s had been seen: a turn to the left on the spot.

    The expected bodies are those of `servogen twin`: one run from power-up, with a chip of its own.
    """
    session, _ = with_bodies(on_command)
    before = shown(session, 4 * S)
    shown(session, 2_500_000)
    list(session.handle({"do": "walk", "way": "left"}))
    assert session.chip is not None
    after = shown(session, 4 * S)
    assert after["pose"][3] > before["pose"][3] + 0.1
    job, image, schedule = on_command.job, on_command.image, on_command.schedule
    assert job is not None and image is not None and schedule is not None
    by_hand = [
        Levels(pin, [(each.cycle, each.level) for each in session.chip.inputs if each.pin == pin])
        for pin in {each.pin for each in session.chip.inputs}
    ]
    assert on_command.stimuli is not None
    stimuli = Stimuli([*on_command.stimuli.sources, *by_hand])
    record = simulate(job, schedule, image, 0, TwinSettings(seconds=4.1), stimuli)
    for moment in (1.0, 2.6, 3.3, 4.0):
        at = round(moment / SAMPLE_S)
        x, y, z, yaw = record.pose[at]
        there = shown(session, round(moment * S))["pose"]
        assert there[:3] == [round(1e4 * x), round(1e4 * y), round(1e4 * z)]
        assert there[3] == pytest.approx(yaw, abs=1e-4)


@pytest.mark.campaign
def test_a_moment_has_the_same_bodies_whichever_way_it_is_reached(
    walk: Subject, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some of the snapshots are in the middle of pulses, or before some servos have had one."""
    monkeypatch.setattr(module, "SPACING", 7)
    dice = random.Random(1)
    cycles = sorted(dice.randrange(end) for end in (4 * S, 20_000, 60_000) for _ in range(10))
    session = WatchSession(walk)
    assert session.chip is not None
    session.chip.seek(4 * S)
    straight, back_and_forth = twin_of(session), twin_of(session)
    expected = {}
    for cycle in cycles:
        assert straight.history.follow(cycle) and straight.history.step == cycle // 1000
        expected[cycle] = numbers(straight)
    assert len(set(expected.values())) > 20
    dice.shuffle(cycles)
    for cycle in cycles:
        back_and_forth.history.follow(cycle)
        assert numbers(back_and_forth) == expected[cycle], cycle


def test_snapshots_are_thinned_out_and_the_past_stays_the_same(
    walk: Subject, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MAX_SNAPSHOTS", 12)
    monkeypatch.setattr(module, "RECENT", 500)
    session = WatchSession(walk)
    assert session.chip is not None
    session.chip.seek(3 * S)
    twin = LiveTwin(walk.job, walk.clock, session.chip.edges)  # type: ignore[arg-type]
    early = []
    for cycle in (1_550_000, *range(1_600_000, 3 * S + 1, 100_000)):
        twin.history.follow(cycle)
        early = [*early[:1], numbers(twin)]
        assert {
            step for step in range(0, twin.history.step + 1, 100) if step >= twin.history.step - 500
        } <= set(twin.history.kept)
    assert twin.history.snapshots <= 12  # 30 are due
    twin.history.follow(1_550_000)
    assert numbers(twin) == early[0] != early[1]
    twin.history.follow(0)
    assert twin.history.step == 0


def test_bodies_that_are_too_slow_say_how_far_behind_they_are(walk: Subject) -> None:
    session, _ = with_bodies(walk)
    answer(session, do="seek", cycle=65_432)
    assert session.bodies is not None
    found = [next(session.bodies.follow(0)) for _ in range(4)]  # 20 steps each
    assert [each["seconds"] for each in found] == [0.02, 0.04, 0.06, 0.065]
    assert [each["behind"] for each in found] == [0.045, 0.025, 0.005, 0]
    assert list(session.bodies.follow(0)) == [], "nothing has changed since"
    session.model()
    assert len(list(session.bodies.follow(0))) == 1, "a window that is loaded again has no bodies yet"


def test_the_bodies_follow_while_the_chip_runs_and_after_it_stops(walk: Subject) -> None:
    session, _ = with_bodies(walk)
    list(session.handle({"do": "run", "running": True, "speed": 10}))
    said = list(session.tick(0.05))
    assert [each["is"] for each in said] == ["now", "bodies"]
    list(session.handle({"do": "run", "running": False}))
    while found := list(session.tick(0.05)):
        assert [each["is"] for each in found] == ["bodies"]
        said += found
    assert said[-1]["behind"] == 0 and said[-1]["seconds"] == session.now // 1000 / 1000 > 0.49
    list(session.handle({"do": "bodies", "on": False}))
    answer(session, do="seek", cycle=S)
    assert list(session.tick(0.05)) == []


def test_captured_pulses_move_the_bodies_of_the_job(walk: Subject, tmp_path: Path) -> None:
    """A capture of the chip from power-up has its pulses, so that its bodies are the same."""
    session, _ = with_bodies(walk)
    expected = shown(session, 3_500_000)
    assert session.chip is not None
    cycle, pin, level = session.chip.edges(0, 3_500_000)
    edges = list(zip(cycle.tolist(), pin.tolist(), (level % 2).tolist(), strict=True))
    file = captured(tmp_path / "walk.vcd", 0.0, edges, rate=1_000_000, begin=0)
    again, _ = with_bodies(load_subject(file, Setting(job=ROOT / "jobs" / "hexapod-tripod.toml")))
    steps = again.subject.clock.cycles_per_second / S
    assert shown(again, int(3_500_000 * steps)) == expected
    assert expected["pose"][0] > 100, "it has walked a centimetre"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("firmware/lab8-exercise/main.hex", "only a job has bodies"),
        ("jobs/lab8-exercise.toml", "needs a robot"),
    ],
)
def test_what_moves_no_robot_has_no_bodies(name: str, text: str) -> None:
    session = WatchSession(load_subject(ROOT / name, Setting()))
    assert not session.model()["has_bodies"]
    (answer,) = session.handle({"do": "bodies", "on": True})
    assert answer["model"] is None and text in answer["text"]
    assert session.bodies is None


@pytest.mark.parametrize("runs", [True, False])
def test_the_page_says_that_sensors_are_open_beside_the_bodies_that_a_chip_moves(
    walk: Subject, runs: bool
) -> None:
    assert walk.job is not None
    sensor = SensorTable(pin="RA1", kind="stall", above_a=1)
    subject = replace(walk, job=replace(walk.job, sensors=(sensor,)))
    place = WatchSession(walk).chip
    assert place is not None
    bodies = LiveBodies(subject if runs else replace(subject, image=None), place)
    assert bodies.model()["sensors"] == runs


def test_pieces_of_a_capture_have_no_bodies(walk: Subject) -> None:
    pieces = replace(walk, wanted=walk.wanted * 2)
    with pytest.raises(InputError, match="between the pieces of this capture is unknown"):
        LiveBodies(pieces, WatchSession(walk).chip)  # type: ignore[arg-type]
