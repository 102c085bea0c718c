"""A job of two chips in a window: both in one time, one of them debugged."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from servogen.edges import OTHER_PINS, PINS
from servogen.watch.session import WatchSession, find_repetition
from servogen.watch.subject import Setting, Subject, load_subject
from tests.two_chips import ARM, TWO
from tests.watch.serving import Running
from tests.watch.test_server import asked, messages, opened
from tests.watch.test_session import answer

RB0 = PINS.index("RB0")
FRAME = 20_000
THERE = 1_500_000
"""A moment in the motion."""


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    path = tmp_path_factory.mktemp("pair") / "arm.toml"
    path.write_text(TWO + ARM.format(elbow="RB0"))
    return load_subject(path, Setting())


def at(subject: Subject, cycle: int = THERE) -> WatchSession:
    session = WatchSession(subject)
    answer(session, do="seek", cycle=cycle)
    return session


def waves(session: WatchSession, begin: int, end: int) -> dict[str, Any]:
    return answer(session, do="waves", begin=begin, end=end)


def pins_of(packed: list[int]) -> set[int]:
    return {edge >> 2 for edge in packed[1::2]}


def test_the_waves_are_those_of_both_chips_and_both_are_as_scheduled(subject: Subject) -> None:
    """The elbow, on RB0 of the second chip, stands beside the shoulder, on RB0 of the first."""
    session = at(subject)
    model = session.model()
    assert [(each["name"], model["names"][each["pin"]]) for each in model["channels"]] == [
        ("shoulder", "RB0"),
        ("elbow", "2.RB0"),
    ]
    assert subject.first_difference is None and model["compared"]
    seen = waves(session, THERE - 3 * FRAME, THERE)
    assert set(seen["pulses"][2::3]) == {RB0, OTHER_PINS + RB0} == pins_of(seen["wanted"])
    assert seen["differing"] == [] and json.dumps(model)


def test_a_schedule_that_one_chip_does_not_follow_is_seen(subject: Subject) -> None:
    """The second chip's is laid a cycle beside its edges: all of them differ, none of the first one's."""
    first, second = subject.wanted
    session = at(replace(subject, wanted=(first, replace(second, origin=second.origin + 1))))
    assert pins_of(waves(session, THERE - FRAME, THERE)["differing"]) == {OTHER_PINS + RB0}


def test_the_second_chip_is_debugged_at_the_same_moment(subject: Subject) -> None:
    """Its own pins come first, its source is its own; what both pins do is the same."""
    first, second = at(subject), at(subject.showing(1))
    shown = [session.shown()["widths"] for session in (first, second)]
    assert shown[0][RB0] == shown[1][OTHER_PINS + RB0] > 0
    assert shown[1][RB0] == shown[0][OTHER_PINS + RB0] > 0
    assert [each.model()["chip"] for each in (first, second)] == [1, 2]
    sources = [each.model()["sources"][0]["text"] for each in (first, second)]
    assert "also the wire to the second chip" in sources[0] and "the wire from the first chip" in sources[1]
    before = second.now
    assert answer(second, do="step", what="instruction", count=1)["chip"] and second.now > before
    assert waves(second, THERE - FRAME, THERE)["differing"] == []
    assert subject.showing(1).showing(0).wanted == subject.wanted


def test_a_reset_of_the_first_chip_takes_the_pulses_of_the_second(subject: Subject) -> None:
    session = at(subject)
    answer(session, do="pin", pin="MCLR", level=0)
    assert session.chip is not None
    session.chip.seek(THERE + 5 * FRAME)
    chunk = session.chip.edges(THERE + FRAME, THERE + 5 * FRAME)
    assert not np.isin(chunk.pin, [RB0, OTHER_PINS + RB0]).any()
    assert answer(session, do="seek", cycle=THERE - FRAME)["widths"][OTHER_PINS + RB0] > 0


def test_a_reset_of_the_second_chip_alone_begins_both_anew_where_it_restarts_the_first(
    tmp_path: Path,
) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(TWO.replace('"RA1"', '"RA1"\nrestart = "RA4"') + ARM.format(elbow="RB0"))
    session = at(load_subject(path, Setting()).showing(1))
    assert session.model()["compared"] and session.subject.first_difference is None
    assert session.chip is not None
    for level in (0, 1):
        answer(session, do="pin", pin="MCLR", level=level)
        session.chip.seek(session.now + 100)
    session.chip.seek(THERE + 25 * FRAME)
    pulses = session.chip.edges(THERE + FRAME, THERE + 25 * FRAME)
    first, second = (
        pulses.cycle[(pulses.pin == pin) & (pulses.level == 1)] for pin in (OTHER_PINS + RB0, RB0)
    )
    assert first[0] > THERE + 13 * FRAME and (np.diff(first) == FRAME).all()
    assert np.isin(second - first[4] - second[0] + first[4], first - first[4]).all() and len(second) >= 5


def test_why_a_pin_is_as_it_is_is_asked_at_its_own_chip(subject: Subject) -> None:
    assert "choose that chip" in answer(at(subject), do="explain", pin="2.RB0")["lines"][0]
    assert "choose that chip" in answer(at(subject.showing(1)), do="explain", pin="1.RB0")["lines"][0]
    assert answer(at(subject), do="explain", pin="1.RB0")["is"] == "problem"


def test_what_both_chips_do_again_and_again_is_found(subject: Subject) -> None:
    """A far moment is then reached at once, in the phase in which a run comes there."""
    found = find_repetition(subject)
    assert found is not None
    leaping, running = WatchSession(subject, repetition=found), at(subject, 60 * THERE)
    assert leaping.chip is not None and running.chip is not None
    leaping.chip.seek(60 * THERE)
    moments = [chip.edges(60 * THERE - 2 * FRAME, 60 * THERE) for chip in (leaping.chip, running.chip)]
    assert all((one == other).all() for one, other in zip(*moments, strict=True)) and len(moments[0].cycle)


def test_a_window_turns_to_the_other_chip_and_back_at_its_moment(subject: Subject) -> None:
    running = Running(lambda progress: subject)
    try:
        with running.socket() as socket:
            opened(socket)
            asked(socket, do="seek", cycle=400_000)
            for number, signal in ((2, "elbow"), (1, "shoulder")):
                socket.send(json.dumps({"do": "chip", "number": number}))
                model = messages(socket, "model")[-1]
                assert messages(socket, "now")[-1]["cycle"] // 10 == 40_000
                assert model["chip"] == number
                assert signal in [each["name"] for each in model["channels"] if each["pin"] == RB0]
            assert "no chip 3" in asked(socket, "problem", do="chip", number=3)["text"]
    finally:
        running.stop()


@pytest.mark.parametrize("chip", [0, 1])
def test_the_bodies_follow_both_chips(subject: Subject, chip: int) -> None:
    pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")
    session = at(subject.showing(chip), 400_000)
    assert answer(session, do="bodies", on=True)["model"]
    assert session.bodies is not None
    pose = []
    for cycle in (1_000_000, 2_400_000):
        answer(session, do="seek", cycle=cycle)
        (found,) = session.bodies.follow(600)
        pose.append(np.reshape(found["points"], (-1, 3)))
    # The shoulder's link moves, and the elbow's moves otherwise.
    ends = np.array([points[-2:] for points in pose])
    assert found["behind"] == 0 and (ends[0] != ends[1]).any(axis=1).all()
