"""The twin of a robot whose servos are on two chips: one physics, and both chips in one time;
and of one whose motion is on a tape.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from servogen.job import loads, plan_job
from servogen.twin import TwinSettings, TwinVerdict, planned_of, simulate, verdict_of
from servogen.twin.causes import EventKind
from servogen.workflows.pair import planned_pair
from servogen.workflows.twinning import twin_of
from tests.two_chips import ARM, ONE, TWO


@cache
def moved(chips: str, elbow: str, more: str = "") -> TwinVerdict:
    return twin_of(plan_job(loads(chips + ARM.format(elbow=elbow) + more, "arm.toml")))


@pytest.mark.parametrize("given", [(TWO, "RB0"), (ONE, "RB1", "\n[tape]\n")])
def test_an_arm_on_two_chips_or_from_a_tape_moves_as_on_one(given: tuple[str, ...]) -> None:
    """The elbow's pin has the same name as the shoulder's, on the other chip."""
    one, other = moved(ONE, "RB1"), moved(*given)
    assert other.events == () and other.record.pulsed[other.record.first :].all()
    there, here = (verdict.record.angle[verdict.record.first :] for verdict in (one, other))
    assert np.abs(there[-1] - here[-1]).max() < 0.005
    assert np.abs(np.ptp(there, axis=0) - np.ptp(here, axis=0)).max() < 0.01


def test_that_the_crystals_of_both_chips_run_at_equal_rates_is_assumed_and_said() -> None:
    said = "both crystals at equal rates: servogen verify runs them at ±100 ppm"
    assert said in moved(TWO + "crystal_ppm = 100\n", "RB0").record.rig.assumptions
    assert "rates" not in " ".join(moved(TWO, "RB0").record.rig.assumptions)


def test_a_broken_wire_leaves_the_second_chips_servos_without_pulses() -> None:
    """It begins at a pin of the first chip that nothing drives."""
    job = plan_job(loads(TWO + ARM.format(elbow="RB0"), "arm.toml"))
    pair = planned_pair(job)
    first, second = pair.schedules
    images = [firmware.compilation.image for firmware in pair.firmware()]
    assert second.wire is not None
    broken = replace(second, wire=replace(second.wire, source="RB7"))
    settings = TwinSettings(seconds=2.0)
    record = simulate(pair.job, first, images[0], 50, settings, second=(broken, images[1]))
    events = verdict_of(record, job, planned_of(pair.job, 50, 1)).events
    assert [(event.kind, event.text) for event in events] == [
        (EventKind.NO_PULSES, "elbow receives no pulses at all")
    ]
