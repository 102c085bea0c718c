"""The facts of a plan: times, ranges and errors, against the job's own numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.job import load, loads, plan_job
from servogen.job.starter import template
from servogen.pulse.plan import plan
from servogen.report.plan_facts import PlanFacts, plan_facts, rigid_legs_end
from servogen.workflows.engines import nearest_pulses, planned

JOBS = Path(__file__).parents[2] / "jobs"
CHIP = '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'


def facts_of_job(name: str) -> PlanFacts:
    return plan_facts(*nearest_pulses(plan_job(load(JOBS / f"{name}.toml"))))


def test_the_facts_of_the_exercise_are_those_of_its_poses() -> None:
    """30°, 90° and 120° for 2, 5 and 3 s; a tool has none."""
    facts = facts_of_job("lab8-exercise")
    shown = facts.to_json()
    assert (shown["lead_in_frames"], shown["loop_frames"], shown["loop_s"]) == (0, 500, 10.0)
    (servo,) = facts.servos
    found = servo.to_json()
    assert found["minimum_deg"] == pytest.approx(30)
    assert found["maximum_deg"] == pytest.approx(120)
    assert found["largest_step_deg"] == pytest.approx(90), "from 120° to 30°"
    assert (shown["ends"], facts.worst) == ([], None)


def test_an_ends_extent_holds_every_point_and_its_error_is_at_its_frame() -> None:
    facts = facts_of_job("scara-pick")
    (end,), (track,) = facts.ends, facts.tracks
    least, greatest = facts.extent(end)
    points = track.planned[~np.isnan(track.planned).any(axis=1)]
    assert ((points >= least) & (points <= greatest)).all()
    assert all(any(point[axis] == least[axis] for point in points) for axis in range(3))
    (shown,) = facts.to_json()["ends"]  # type: ignore[misc, attr-defined]
    assert shown["error"]["time_s"] == pytest.approx(0.02 * end.frame)
    assert shown["error"]["worst_m"] == end.worst_m == pytest.approx(float(np.nanmax(track.error)))
    assert facts.worst is end


def test_pulses_that_fit_no_frame_are_those_of_the_engine() -> None:
    """Twelve servos of up to 2 ms, one after the other, are longer than 20 ms."""
    pins = [f"RB{number}" for number in range(8)] + [f"RA{number}" for number in range(4)]
    servos = "".join(
        f'[[servo]]\nname = "s{n}"\npin = "{pin}"\nmodel = "futaba-s3001"\n' for n, pin in enumerate(pins)
    )
    angles = ", ".join(f"s{number}_deg = 90" for number in range(12))
    text = f"{CHIP}{servos}[motion]\nposes = [ {{ {angles}, hold_s = 1 }}, {{ s0_deg = 120, hold_s = 1 }} ]\n"
    twelve = plan_job(loads(text, "twelve.toml"))
    with pytest.raises(InputError, match="do not fit a frame"):
        plan(twelve.trajectory, twelve.servos, twelve.frame)
    assert nearest_pulses(twelve)[1].schedule == planned(twelve).plan.schedule
    one = plan_job(load(JOBS / "lab8-exercise.toml"))
    assert nearest_pulses(one)[1].schedule == plan(one.trajectory, one.servos, one.frame).schedule


def test_a_walk_says_where_rigid_legs_take_the_body() -> None:
    """At the legs' full height the feet are dragged before they lift: not all of the 160 mm are walked."""
    text = (JOBS / "hexapod-tripod.toml").read_text()
    assert text.count("body_height_mm = 130") == 1
    for height, least, most in ((130, 0.158, 0.1605), (140, 0.140, 0.155)):
        higher = text.replace("body_height_mm = 130", f"body_height_mm = {height}")
        x, y, yaw = rigid_legs_end(plan_job(loads(higher, "tripod.toml"))) or (0.0, 0.0, 0.0)
        assert least < x < most and abs(y) < 0.001 and abs(yaw) < 0.01
    assert rigid_legs_end(plan_job(load(JOBS / "scara-pick.toml"))) is None


def test_an_endless_walk_goes_its_stride_in_each_loop_without_its_first_steps_and_lean() -> None:
    text = template("quadruped-coxa-femur-tibia")
    stride = re.search(r"forward_mm = (\d+)", text)
    x, y, yaw = rigid_legs_end(plan_job(loads(text, "crawl.toml"))) or (0.0, 0.0, 0.0)
    assert stride and 1000 * x == pytest.approx(int(stride[1]), rel=0.02)
    assert abs(y) < 1e-4 and abs(yaw) < 1e-3
