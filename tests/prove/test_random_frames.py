"""What a plain chip does under random presses and noise is what the proof allows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from servogen.prove.specification import Violation
from tests.prove.random_frames import target, walk


@pytest.mark.parametrize("seed", range(4))
def test_every_frame_lies_within_a_state_of_the_proof(seed: int) -> None:
    assert list(walk(target(), seed, 150)) == []


def test_a_proof_that_lacks_states_would_be_noticed() -> None:
    aim = target()
    places = list(aim.by_place)
    fewer = replace(aim, by_place={place: aim.by_place[place] for place in places[: len(places) // 2]})
    assert list(walk(fewer, 1, 150))


def test_a_wrong_edge_would_be_noticed() -> None:
    aim = target()
    rule = aim.schedule.buttons
    assert rule is not None
    other = replace(aim, schedule=replace(aim.schedule, buttons=replace(rule, pressed_frames=2)))
    with pytest.raises(Violation):
        list(walk(other, 1, 150))
