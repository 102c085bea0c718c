"""What a plain chip does under random presses and noise is what the certificate allows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from servogen.checker.certificate import CELLS, NUMBERS
from tests.checker.plans import start_stop
from tests.prove.random_frames import target, walk

FRAMES = 300


@pytest.mark.parametrize("seed", range(4))
def test_every_frame_lies_within_a_state_of_the_certificate(seed: int) -> None:
    assert list(walk(target(), seed, FRAMES)) == []


def test_a_certificate_that_lacks_states_would_be_noticed() -> None:
    aim = target()
    places = list(aim.by_place)
    fewer = replace(aim, by_place={place: aim.by_place[place] for place in places[: len(places) // 2]})
    assert any("no state of the certificate" in each for each in walk(fewer, 1, FRAMES))


@pytest.mark.parametrize("column", ["ram.1a", "tmr0", "status", "option"])
def test_a_state_that_is_another_one_would_be_noticed(column: str) -> None:
    aim = target()
    slot, _ = NUMBERS.get(column) or CELLS[column]
    states = aim.claim.states.copy()
    known = ~(states[:, slot] >> 8) & 1
    states[:, slot] ^= known
    other = replace(aim, claim=replace(aim.claim, states=states))
    assert bool(list(walk(other, 1, FRAMES))) == bool(known.any())


def test_a_wrong_edge_would_be_noticed() -> None:
    aim = target()
    other = replace(aim, plan=replace(aim.plan, inputs=replace(start_stop(aim.plan), frames=2)))
    assert any("an edge that the schedule does not have" in each for each in walk(other, 1, FRAMES))
