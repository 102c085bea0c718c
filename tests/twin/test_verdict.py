"""The verdict on a record, its causes and its tables, with records written by hand: no physics runs."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from servogen.edges import PINS, edge_chunk
from servogen.errors import Diagnostic, InputError
from servogen.job.schema import ExpectTable
from servogen.kinematics.catalogue import robot
from servogen.kinematics.protocol import DrivingRobot
from servogen.report.drawing import PALETTE
from servogen.simulator import Levels, Stimuli
from servogen.simulator.layout import PACK_CYCLE, PACK_PIN
from servogen.twin import pictures
from servogen.twin.causes import Event, EventKind, brown_out, fall_time, run_events
from servogen.twin.ground import Ground
from servogen.twin.pictures import (
    check_rows,
    comparison_rows,
    csv_text,
    lines_through,
    page_facts,
    servo_rows,
    twin_plot,
    twin_scene,
)
from servogen.twin.planned import PlannedRoute
from servogen.twin.pulses import PulseReceiver
from servogen.twin.run import Record, TwinSettings
from servogen.twin.sensors import Feed
from servogen.twin.supply import Supply
from servogen.twin.verdict import ExpectationCheck, TwinVerdict, verdict_of
from servogen.units import Clock

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SAMPLES, STEP_S = 100, 0.005
FIRST = 20  # the motion begins at 0.1 s
SERVOS = ("hip", "knee")


def rig(supply: Supply = Supply(5.0), **changes: object) -> SimpleNamespace:  # noqa: B008 - frozen
    """Two servos of 2 and 4 ohms, whose speeds without load are 10 and 20 radians per second."""
    drives = [
        SimpleNamespace(
            no_load_speed=10.0 * number,
            resistance=2.0 * number,
            speed_constant=0.25,
            idle_a=0.01,
            continuous=False,
            stall_torque=0.3 * number,
        )
        for number in (1, 2)
    ]
    given = {
        "robot": SimpleNamespace(limbs=[SimpleNamespace(name=leg, mount=object()) for leg in ("L1", "R1")]),
        "servos": [SimpleNamespace(name=name) for name in SERVOS],
        "columns": (0, 1),
        "drives": drives,
        "wirings": [SimpleNamespace(broken=False) for _ in SERVOS],
        "supply": supply,
        "assumptions": ("the servos are new",),
    }
    return SimpleNamespace(**{**given, **changes})


def record(samples: int = SAMPLES, **changes: Any) -> Record:
    """A robot that stands still, 100 mm high, on two feet."""
    pose = np.zeros((samples, 4))
    pose[:, 2] = 0.1
    none = np.zeros((samples, 2))
    given: dict[str, Any] = {
        "rig": rig(),
        "bodies": SimpleNamespace(assumptions=("0.64 kg",)),
        "time": STEP_S * np.arange(samples),
        "pose": pose,
        "tilt": np.zeros(samples),
        "angle": none.copy(),
        "target": none.copy(),
        "pulsed": np.ones((samples, 2), bool),
        "duty": none.copy(),
        "torque": none.copy(),
        "speed": none.copy(),
        "voltage": np.full(samples, 5.0),
        "current": np.zeros(samples),
        "feet": np.zeros((samples, 2, 3)),
        "force": np.ones((samples, 2)),
        "tool": np.zeros((samples, 0)),
        "places": {},
        "motion": (0.1, 0.4),
        "floating": True,
    }
    return Record(**{**given, **changes})


def job(expect: ExpectTable | None = None, **changes: object) -> Any:
    angles = np.zeros((5, 2))
    given = {
        "expect": expect or ExpectTable(),
        "trajectory": SimpleNamespace(angles=angles),
        "warnings": (),
    }
    return SimpleNamespace(**{**given, **changes})


STILL = PlannedRoute(0.02)


def changed(values: np.ndarray, rows: object, columns: object, to: object) -> np.ndarray:
    """Return a copy with other values there."""
    copy = values.copy()
    copy[rows, columns] = to
    return copy


def verdict(made: Record, expect: ExpectTable | None = None, planned: PlannedRoute = STILL) -> TwinVerdict:
    return verdict_of(made, job(expect), planned)


def unmeasured(found: TwinVerdict) -> list[str]:
    """Return the expectations that fail because the run does not show them."""
    return [check.name for check in found.checks if check.measured is None and not check.passed]


# What is measured


def test_the_way_is_seen_from_the_pose_in_which_the_motion_begins() -> None:
    pose = record().pose
    pose[:FIRST] = (7.0, 7.0, 0.1, 3.0)
    pose[FIRST:] = (1.0, 2.0, 0.1, math.pi / 2)
    pose[-1] = (0.9, 2.3, 0.1, math.pi / 2 + 0.2)
    assert verdict(record(pose=pose)).done == pytest.approx((0.3, 0.1, 0.2))
    late = verdict(record(pose=pose, motion=(9.0, 9.5)))
    assert late.done == (0, 0, 0)  # a motion after the end begins with the last sample


def test_a_motion_begins_with_the_sample_at_its_time_and_at_the_latest_with_the_last() -> None:
    for begins, first in ((0.1, 20), (0.1 + 5e-10, 20), (0.1001, 21), (0.0, 0), (9.0, SAMPLES - 1)):
        assert record(motion=(begins, 10.0)).first == first


def test_the_drag_is_the_longest_way_of_a_foot_in_one_stance() -> None:
    made = record()
    feet, force = made.feet.copy(), made.force.copy()
    feet[5:15, 0, 0] = 0.5  # before the motion
    feet[30:, 0, 1] = 0.004  # a stance of L1 with 4 mm, then 3 mm, and a step of 50 mm between them
    feet[40:, 0, 0] = 0.050
    force[40, 0] = 0.1  # stands with more than 0.1 N
    feet[50:, 0, 0] = 0.053
    feet[60:, 1, 2] = 0.030  # lifted while it stands: no way on the ground
    feet[71:, 1, 0], feet[72:, 1, 0] = 0.001, 0.006
    found = verdict(replace(made, feet=feet, force=force), ExpectTable(drag_mm=5.5))
    assert (found.drag, found.drag_leg) == (pytest.approx(0.006), "R1")
    check = next(each for each in found.checks if each.name == "drag of R1")
    assert (check.measured, check.unit, check.passed) == (pytest.approx(6), "mm", False)
    assert check.seconds == pytest.approx(72 * STEP_S)
    only = verdict(replace(made, feet=feet[:, :1], force=force[:, :1]))
    assert (only.drag, only.drag_leg) == (pytest.approx(0.004), "L1")
    none = verdict(made, ExpectTable(drag_mm=5.5))
    assert (none.drag, none.drag_leg) == (0, "")
    assert [check.name for check in none.checks if "drag" in check.name] == ["drag"]
    arm = verdict(record(feet=np.zeros((SAMPLES, 0, 3))), ExpectTable(drag_mm=5.5))
    assert unmeasured(arm) == ["drag"]


def test_a_tool_is_compared_with_its_frame_and_at_rest_after_three_tenths_of_a_second() -> None:
    """Frames of 20 ms: it rests from the fifteenth on that is where the one before it was."""
    tool = np.zeros((60, 3))
    tool[:, 0] = np.concatenate([np.linspace(0, 0.3, 20), np.full(18, 0.3), np.linspace(0.31, 0.4, 22)])
    planned = PlannedRoute(0.02, tool=tool)
    samples = 300
    time = 0.001 + STEP_S * np.arange(samples)
    away = 0.001 + 0.00001 * ((37 * np.arange(samples)) % 101)
    frame = [min(max(int((at - 0.1) / 0.02), 0), 59) for at in time]
    shown = tool[frame] + np.stack([0 * away, away, 0 * away], axis=1)
    made = record(
        samples, tool=shown, motion=(0.1, 1.3), floating=False, feet=np.zeros((samples, 0, 3)), time=time
    )
    resting = [
        number
        for number in range(FIRST, samples)
        if frame[number] >= 15
        and all(
            np.linalg.norm(tool[each] - tool[each - 1]) < 1e-6
            for each in range(frame[number] - 14, frame[number] + 1)
        )
    ]
    assert resting
    assert {frame[number] for number in resting} == {34, 35, 36, 37}
    found = verdict(made, ExpectTable(end_within_mm=1.0), planned)
    worst = max(resting, key=lambda number: away[number])
    assert found.tool_error == pytest.approx(max(away[FIRST:]))
    assert found.tool_rest_error == pytest.approx(away[worst])
    check = next(each for each in found.checks if each.name == "tool at rest")
    assert check.measured == pytest.approx(1000 * away[worst])
    assert check.seconds == pytest.approx(time[worst])
    moving = verdict(made, ExpectTable(end_within_mm=1.0), replace(planned, tool=tool[:34]))
    assert moving.tool_rest_error is None
    assert unmeasured(moving) == ["tool at rest"]
    assert verdict(made, None, STILL).tool_error is None


@pytest.mark.parametrize(("shift", "at_edge"), [(0.0, True), (1e-6, True), (-1e-6, False)])
@pytest.mark.parametrize("begins", [0.1, 0.1234, 17.3])
def test_a_sample_at_the_edge_of_two_frames_is_compared_with_the_one_that_begins_there(
    shift: float, at_edge: bool, begins: float
) -> None:
    """The servos get the pulses of the frame just then, before the sample is taken."""
    frames = 400
    tool = np.zeros((frames, 3))
    tool[:, 0] = np.arange(frames)
    time = begins + 0.02 * np.arange(frames) + shift
    shown = tool if at_edge else np.maximum(tool - [1, 0, 0], 0)
    planned = PlannedRoute(0.02, tool=tool)
    made = record(frames, tool=shown, motion=(begins, begins + 8), floating=False, time=time)
    assert verdict(made, None, planned).tool_error == 0


LIMITS = {
    "robot_within_mm": ("robot", "mm off"),
    "turn_within_deg": ("turn", "° off"),
    "torque_nm": ("torque of knee", "N·m"),
    "current_a": ("current", "A"),
    "within_s": ("time", "s"),
}
MEASURED = {
    "robot_within_mm": 50.0,  # 30 and 40 mm
    "turn_within_deg": 90.0,
    "torque_nm": 0.75,
    "current_a": 1.5,
    "within_s": 0.5,
}


def away() -> Record:
    made = record(motion=(0.1, 0.5))
    pose = changed(made.pose, -1, [0, 1, 3], (0.03, -0.04, math.pi / 2))
    torque = changed(changed(made.torque, 33, 1, -0.75), 44, 0, 0.5)
    current = made.current.copy()
    current[55] = 1.5
    return replace(made, pose=pose, torque=torque, current=current)


@pytest.mark.parametrize("key", LIMITS)
def test_what_is_measured_may_be_as_much_as_is_allowed(key: str) -> None:
    planned = replace(STILL, way=(0.0, 0.0, 0.0))
    name, unit = LIMITS[key]
    at = {"torque_nm": 33 * STEP_S, "current_a": 55 * STEP_S, "within_s": 0.5}.get(key)
    for allowed, passed in ((MEASURED[key] * (1 + 1e-9), True), (MEASURED[key] * (1 - 1e-9), False)):
        found = verdict(away(), ExpectTable(**{key: allowed}), planned)
        falls, check = found.checks
        assert falls.passed
        assert (check.name, check.unit, check.allowed, check.passed) == (name, unit, allowed, passed)
        assert check.measured == pytest.approx(MEASURED[key])
        assert check.seconds == (None if passed else pytest.approx(at) if at else None)
        assert found.passed == passed
    exact = verdict(away(), ExpectTable(torque_nm=0.75, current_a=1.5, within_s=0.5), planned)
    assert exact.passed


def test_an_expectation_that_the_run_does_not_show_fails() -> None:
    limits = {"robot_within_mm": 100.0, "turn_within_deg": 100.0, "within_s": 9.0}
    expect, planned = ExpectTable(**limits, end_within_mm=1.0), replace(STILL, way=(0.0, 0.0, 0.0))
    assert unmeasured(verdict(away(), expect, planned)) == ["tool at rest"]
    assert unmeasured(verdict(away(), expect, STILL)) == ["robot", "turn", "tool at rest"]  # no way is asked
    ended = verdict(replace(away(), motion=(0.1, 0.52)), expect, planned)  # before the motion did
    assert unmeasured(ended) == ["robot", "turn", "tool at rest", "time"]
    assert not ended.passed
    assert ended.reasons()[0] == "robot: not measured, allowed 100 mm off"
    assert ("time", "-", "9", "s", "FAILS") in check_rows(ended)


def test_a_fall_and_missing_pulses_fail_without_being_asked_for() -> None:
    made = record()
    tilt = made.tilt.copy()
    tilt[70] = 0.53  # 30 degrees are 0.5236
    fallen = verdict(replace(made, tilt=tilt))
    assert [(check.name, check.measured, check.unit, check.passed) for check in fallen.checks] == [
        ("falls", 1.0, "times", False)
    ]
    assert fallen.checks[0].seconds == pytest.approx(70 * STEP_S)
    assert fallen.reasons()[0] == "falls: 1 times at 0.35 s, allowed 0 times"
    assert verdict(replace(made, tilt=tilt), ExpectTable(no_fall=False)).passed
    assert verdict(replace(made, tilt=tilt, floating=False)).passed
    silent = verdict(record(pulsed=np.zeros((SAMPLES, 2), bool)))
    assert silent.checks[0] == ExpectationCheck("servos without pulses", 2, 0.0, "servos", False, 0.0)
    one = changed(np.zeros((SAMPLES, 2), bool), 99, 1, True)
    assert [check.name for check in verdict(record(pulsed=one)).checks] == ["falls"]


def test_the_words_reasons_and_json_of_a_verdict() -> None:
    made = away()
    planned = replace(STILL, way=(0.0, 0.0, 0.0), rigid=np.array([[0.0] * 3, [9.0] * 3, [0.5, 0.25, 0.125]]))
    passed = verdict(made, None, planned)
    assert (passed.word, passed.cause, passed.reasons()) == ("as expected", None, [])
    failed = verdict(made, ExpectTable(torque_nm=0.5), planned)
    assert failed.word == "NOT as expected"
    assert failed.reasons() == ["torque of knee: 0.75 N·m at 0.17 s, allowed 0.5 N·m"]
    warned = replace(failed, warnings=(Diagnostic("warning", "high-torque", "the knee is weak"),))
    assert warned.reasons()[1:] == ["the plan warned: the knee is weak"]
    assert replace(passed, warnings=warned.warnings).reasons() == []
    caused = replace(
        warned, events=(Event(1.0, EventKind.STOP, "it stops"), Event(2.0, EventKind.FALL, "falls"))
    )
    assert caused.reasons()[1:] == ["first cause: it stops"]
    low = replace(passed, not_guaranteed_from=0.25, events=caused.events)
    assert (low.word, low.passed, low.reasons()) == ("not guaranteed", False, ["first cause: it stops"])
    found = failed.to_json()
    assert found == {
        "verdict": "NOT as expected",
        "passed": False,
        "missed": "the robot misses its plan by 50.0 mm and 90.0°",
        "asked": {"forward_m": 0.0, "left_m": 0.0, "turn_deg": 0.0},
        "rigid_legs": {"forward_m": 0.5, "left_m": 0.25, "turn_deg": math.degrees(0.125)},
        "simulated": pytest.approx({"forward_m": 0.03, "left_m": -0.04, "turn_deg": 90}),
        "drag_m": 0.0,
        "drag_leg": None,
        "tool_error_m": None,
        "tool_rest_error_m": None,
        "minimum_height_m": 0.1,
        "torque_nm": {"hip": 0.5, "knee": 0.75},
        "current_a": 1.5,
        "voltage_v": 5.0,
        "charge_as": pytest.approx(1.5 / 100 * 0.495),
        "seconds": pytest.approx(0.495),
        "motion_s": [0.1, 0.5],
        "not_guaranteed_from_s": None,
        "checks": [check.to_json() for check in failed.checks],
        "events": [],
        "assumptions": ["0.64 kg", "the servos are new"],
    }
    assert failed.checks[1].to_json() == {
        "name": "torque of knee",
        "measured_nm": 0.75,
        "allowed_nm": 0.5,
        "passed": False,
        "seconds": pytest.approx(0.165),
    }
    fixed = replace(verdict(replace(made, floating=False)), planned=STILL).to_json()
    assert (fixed["asked"], fixed["rigid_legs"], fixed["minimum_height_m"]) == (None, None, None)
    assert caused.events[0].to_json() == {"seconds": 1.0, "kind": "stop", "text": "it stops"}


# Causes


def events(made: Record, planned: PlannedRoute = STILL, **changes: object) -> list[tuple[float, str]]:
    return [(round(event.seconds, 9), event.text) for event in run_events(made, job(**changes), planned)]


@pytest.mark.parametrize(
    ("idle", "text"),
    [
        (range(10), []),  # up to 0.045 s nothing can have come
        (range(11), [(0.0, "knee receives no pulses at all")]),
        (range(19, 30), [(0.0, "knee receives no pulses at all")]),
        (range(20, 30), [(0.1, "knee receives no pulses from 0.10 s")]),
        (range(98, 99), [(0.49, "knee receives no pulses from 0.49 s")]),
    ],
)
def test_a_servo_without_pulses_is_named_with_the_time(idle: range, text: list[tuple[float, str]]) -> None:
    made = record(pulsed=changed(record().pulsed, list(idle), 1, False))
    assert events(made) == text
    # A servo that the plan leaves without pulses somewhere may be without them.
    angles = np.zeros((5, 2))
    angles[3, 1] = np.nan
    assert events(made, trajectory=SimpleNamespace(angles=angles)) == []


def test_a_broken_gear_is_there_from_the_beginning() -> None:
    broken = rig(wirings=[SimpleNamespace(broken=False), SimpleNamespace(broken=True)])
    assert events(record(rig=broken)) == [(0.0, "knee turns nothing: its gear is broken")]


@pytest.mark.parametrize(
    ("volts", "feeds", "minimum", "low"),
    [(4.0, True, 4.0, None), (3.99, True, 4.0, 0.3), (3.99, False, 4.0, None), (4.4, True, 4.5, 0.3)],
)
def test_the_chip_is_out_of_its_range_below_its_least_voltage(
    volts: float, feeds: bool, minimum: float, low: float | None
) -> None:
    voltage = np.full(SAMPLES, 5.0)
    voltage[60:70] = volts
    made = record(rig=rig(Supply(5.0, feeds_chip=feeds, chip_minimum_v=minimum)), voltage=voltage)
    assert brown_out(made) == (None if low is None else pytest.approx(low))
    text = f"the chip's voltage is below {minimum:g} V at 0.30 s: what follows is not guaranteed"
    assert events(made) == ([] if low is None else [(0.3, text)])


def test_a_supply_at_its_limit_is_described_where_most_servos_stall() -> None:
    """At 0.999 of its limit it counts as reached. Two servos at rest would draw 5/2 + 5/4 + 0.02 A."""
    made = record(rig=rig(Supply(5.0, limit_a=2.0, feeds_chip=False)))
    current, voltage = made.current.copy(), made.voltage.copy()
    current[40:62] = 1.998
    voltage[56] = 3.25
    duty = changed(changed(made.duty, slice(40, 62), 0, 1.0), slice(50, 62), 1, -0.999)
    found = events(replace(made, current=current, voltage=voltage, duty=duty))
    # Both stall in samples 50 to 61, of which 56 is in the middle.
    assert found[0] == (
        0.2,
        "the supply is at its limit of 2 A from 0.20 s: with 2 stalled servos its voltage is 3.25 V "
        f"at 0.28 s, where {2.5 + 0.998001 * 1.25 + 0.02:.1f} A are demanded",
    )
    below = np.where(current > 0, 1.9979, 0.0)
    assert not [text for _, text in events(replace(made, current=below, duty=duty)) if "limit" in text]
    # A motor that turns with 4 rad/s induces 1 V: (5 - 1)/2 A of the first alone.
    turning = changed(made.speed, slice(40, 60), 0, 4.0)
    only = changed(made.duty, slice(40, 60), 0, 1.0)
    text = events(replace(made, current=current, duty=only, speed=turning))[0][1]
    assert "with 0 stalled servos" in text
    assert text.endswith("where 2.0 A are demanded")
    assert events(replace(made, current=current, rig=rig(Supply(5.0, feeds_chip=False)))) == []


@pytest.mark.parametrize(
    ("samples", "duty", "speed", "stuck"),
    [
        (12, 1.0, 0.0, True),  # 60 ms
        (11, 1.0, 0.0, False),
        (12, -0.999, 1.99, True),  # a tenth of the knee's 20 rad/s is 2
        (12, 0.998, 0.0, False),
        (12, 1.0, 2.0, False),
        (12, 1.0, -2.0, False),
        (12, 1.0, -1.99, True),
    ],
)
def test_a_servo_saturates_that_hardly_moves_for_60_ms(
    samples: int, duty: float, speed: float, stuck: bool
) -> None:
    made = record()
    rows = slice(40, 40 + samples)
    made = replace(
        made,
        duty=changed(made.duty, rows, 1, duty),
        speed=changed(made.speed, rows, 1, speed),
        torque=changed(changed(made.torque, 45, 1, -0.25), 60, 1, 0.9),
        target=changed(made.target, 51, 1, math.radians(20)),
        angle=changed(made.angle, 51, 1, math.radians(30)),
    )
    text = "knee saturates at 0.25 N·m from 0.20 s, 10.0° from its target"
    assert events(made) == ([(0.2, text)] if stuck else [])
    if stuck:
        continuous = [made.rig.drives[0], SimpleNamespace(**{**vars(made.rig.drives[1]), "continuous": True})]
        assert events(replace(made, rig=rig(drives=continuous))) == []  # type: ignore[arg-type]
        earlier = changed(made.duty, slice(20, 31), 1, 1.0)  # 11 samples: not the first run of 12
        assert events(replace(made, duty=earlier)) == [(0.2, text)]


def test_a_body_sinks_below_85_percent_of_its_planned_height() -> None:
    made = record(settings=TwinSettings(ground=Ground(rough=0.02)))  # on ground of 10 mm on average
    planned = replace(STILL, height=0.1)
    for height, found in (
        (0.0951, []),
        (0.0949, [(0.25, "the body sinks from 0.25 s: to 85 mm instead of 100 mm")]),
    ):
        pose = changed(made.pose, slice(None), 2, 0.11)
        pose[50:, 2] = height
        assert events(replace(made, pose=pose), planned) == found
        assert events(replace(made, pose=pose)) == []


def test_a_robot_lies_when_its_body_is_at_half_its_height_and_two_millimetres() -> None:
    """Its body is 30 mm high, and 15 + 2 mm above the ground it lies."""
    made = record(settings=TwinSettings(ground=Ground(rough=0.02)))
    for height, fallen in ((0.02701, None), (0.02699, 0.25)):
        pose = made.pose.copy()
        pose[50:, 2] = height
        down = replace(made, pose=pose)
        assert fall_time(down) == fallen
        assert fall_time(replace(down, floating=False)) is None
        assert fall_time(replace(down, feet=np.zeros((SAMPLES, 0, 3)))) is None
    for degrees, fallen in ((29.99, None), (30.01, 0.25)):
        tilt = made.tilt.copy()
        tilt[50] = math.radians(degrees)
        assert fall_time(replace(made, tilt=tilt)) == fallen
    fell = events(replace(made, tilt=tilt), replace(STILL, height=0.01))
    assert fell == [(0.25, "the robot falls at 0.25 s")]


def test_of_two_events_within_60_ms_the_kind_decides_which_is_the_cause() -> None:
    """0.31 and 0.32 s both round to five times 60 ms; 0.34 s does not."""
    made = record()
    tilt, pulsed = made.tilt.copy(), made.pulsed.copy()
    tilt[62], pulsed[64:, 0], pulsed[68:, 1] = 1.0, False, False
    found = run_events(replace(made, tilt=tilt, pulsed=pulsed), job(), replace(STILL, height=0.1))
    assert [event.kind for event in found] == [EventKind.NO_PULSES, EventKind.FALL, EventKind.NO_PULSES]


# Tables


def test_the_table_compares_what_was_asked_planned_and_simulated() -> None:
    pose = record().pose
    pose[:FIRST, 2] = 0.05
    pose[50, 2] = 0.0912
    pose[-1] = (0.03, -0.04, 0.1, math.radians(5))
    current = np.zeros(SAMPLES)
    current[:50] = 0.5
    current[60] = 1.25
    voltage = np.full(SAMPLES, 5.0)
    voltage[7] = 4.5
    made = record(
        pose=pose, current=current, voltage=voltage, rig=rig(Supply(5.0, limit_a=3.5, feeds_chip=False))
    )
    planned = PlannedRoute(
        0.02,
        way=(0.1, 0.2, math.radians(30)),
        rigid=np.array([[0.0, 0.0, 0.0], [0.09, 0.19, math.radians(29)]]),
        height=0.0954,
    )
    rows = list(comparison_rows(verdict(made, None, planned)))
    assert rows == [
        ("forward", "100.0 mm", "90.0 mm", "30.0 mm"),
        ("left", "200.0 mm", "190.0 mm", "-40.0 mm"),
        ("turn", "30.0 °", "29.0 °", "5.0 °"),
        ("least body height", "95.4 mm", "", "91.2 mm"),
        ("longest drag in a stance", "", "", "0.0 mm"),
        ("current, peak and mean", "limit 3.5 A", "", "1.25 A, 0.26 A"),
        ("voltage, least", "5 V", "", "4.50 V"),
    ]
    bare = list(comparison_rows(verdict(record())))
    assert bare[0] == ("forward", "", "", "0.0 mm")
    assert bare[3] == ("least body height", "", "", "100.0 mm")
    assert bare[5][1] == ""
    arm = replace(verdict(record(floating=False, feet=np.zeros((SAMPLES, 0, 3)))), tool_error=0.0125)
    assert [row[0] for row in comparison_rows(arm)] == [
        "tool, farthest from its path",
        "current, peak and mean",
        "voltage, least",
    ]
    rest = list(comparison_rows(replace(arm, tool_rest_error=0.0012)))
    assert rest[:2] == [
        ("tool, farthest from its path", "", "", "12.50 mm"),
        ("tool, farthest at rest", "", "", "1.20 mm"),
    ]
    dragged = replace(verdict(record()), drag=0.0061, drag_leg="R1")
    assert list(comparison_rows(dragged))[4][3] == "6.1 mm (R1)"


def test_the_table_of_servos_has_torque_and_lag_of_the_motion() -> None:
    made = record()
    torque = made.torque.copy()
    torque[:FIRST] = 9.0
    torque[FIRST : FIRST + 20, 0] = -0.2  # a quarter of the 80 samples: rms 0.1
    target, angle = changed(made.target, 50, 0, math.radians(7)), made.angle.copy()
    target[:FIRST] = 5.0
    angle[60, 0] = math.radians(12)
    target[30, 0] = np.nan
    target[:, 1] = np.nan
    rows = list(servo_rows(verdict(replace(made, torque=torque, target=target, angle=angle))))
    assert rows == [("hip", "0.200", "0.300", "0.100", "12.0"), ("knee", "0.000", "0.600", "0.000", "")]
    wheels = [SimpleNamespace(**{**vars(drive), "continuous": True}) for drive in made.rig.drives]
    turning = replace(made, rig=rig(drives=wheels))  # type: ignore[arg-type]
    assert [row[4] for row in servo_rows(verdict(turning))] == ["", ""]


def test_without_expectations_nothing_is_judged_but_a_walk_by_a_tenth_of_its_way_and_5_degrees() -> None:
    """`away` ends 30 mm and -40 mm beside its start, turned by 90°: 50 mm."""

    def found(length: float | None, yaw: float, way: bool = True) -> TwinVerdict:
        planned = replace(STILL, way=(0.0, 0.0, math.pi / 2 + yaw) if way else None, length=length)
        return verdict_of(away(), SimpleNamespace(**{**vars(job()), "expect": None}), planned)

    near = found(0.501, math.radians(4.9))
    assert (near.word, near.passed, page_facts(near).badge) == ("not judged", True, "open")
    assert near.missed == "the robot misses its plan by 50.0 mm (10.0 % of its way) and 4.9°"
    assert near.to_json()["missed"] == near.missed
    for failed, name in ((found(0.499, 0.0), "robot"), (found(0.501, math.radians(5.1)), "turn")):
        assert (failed.word, failed.passed, page_facts(failed).badge) == ("not judged", False, "bad")
        assert [check.name for check in failed.checks if not check.passed] == [name]
    on_the_spot, base, endless = found(0.0, 0.0), found(None, 0.0), found(None, 0.0, way=False)
    assert on_the_spot.passed and on_the_spot.missed == "the robot misses its plan by 50.0 mm and 0.0°"
    assert base.passed and base.missed == on_the_spot.missed
    assert endless.passed and endless.missed == ""
    walked = replace(STILL, rigid=np.array([[0.0, 0.0, 0.0], [0.09, 0.04, math.pi / 2]]))
    said = verdict_of(away(), SimpleNamespace(**vars(job())), walked).missed
    assert (
        said == "the robot ends 100.0 mm beside what rigid legs would do, whose way is 98.5 mm, and 0.0° off"
    )


def test_the_table_of_expectations_and_the_badge_of_the_page() -> None:
    failed = verdict(away(), ExpectTable(torque_nm=0.5, current_a=2.0))
    assert list(check_rows(failed)) == [
        ("falls", "0", "0", "times", ""),
        ("torque of knee", "0.75", "0.5", "N·m", "FAILS"),
        ("current", "1.5", "2", "A", ""),
    ]
    facts = page_facts(replace(failed, events=(Event(1.234, EventKind.STOP, "it stops"),)))
    assert (facts.badge, facts.word) == ("bad", "NOT as expected")
    assert facts.events == ("1.23 s: it stops",)
    assert facts.ground == "friction 0.8"
    assert facts.assumptions == ("0.64 kg", "the servos are new")
    assert [name for name, _ in facts.charts] == [
        "torque of the servos",
        "current of the supply",
        "voltage of the supply",
        "height of the feet",
    ]
    passed = verdict(away())
    assert page_facts(passed).badge == "good"
    assert page_facts(replace(passed, not_guaranteed_from=0.1)).badge == "open"


def test_the_page_draws_the_path_of_the_body_or_of_the_tool() -> None:
    body = verdict(record(), None, replace(STILL, rigid=np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])))
    assert page_facts(body).charts[0][0] == "path of the body; dots: simulated"
    arm = record(floating=False, tool=np.zeros((SAMPLES, 3)), feet=np.zeros((SAMPLES, 0, 3)))
    tool = verdict(arm, None, replace(STILL, tool=np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])))
    charts = [name for name, _ in page_facts(tool).charts]
    assert charts[0] == "path of the tool; dots: simulated"
    assert "height of the feet" not in charts
    assert len(page_facts(replace(tool, planned=STILL)).charts) == len(charts) - 1


def test_the_csv_has_a_row_per_sample_in_the_units_of_its_names() -> None:
    made = record(2)
    pose = np.array([[0.0, 0.0, 0.1, 0.0], [0.01, -0.02, 0.09, math.pi]])
    made = replace(
        made,
        pose=pose,
        tilt=np.array([0.0, math.pi / 6]),
        voltage=np.array([5.0, 4.5]),
        current=np.array([0.0, 1.25]),
        angle=np.array([[0.0, 0.0], [math.pi / 2, math.pi / 4]]),
        target=np.array([[np.nan, 0.0], [math.pi, math.pi / 3]]),
        torque=np.array([[0.0, 0.0], [0.25, -0.5]]),
        feet=np.array([[[0.0, 0.0, 0.0]] * 2, [[0.0, 0.0, 0.002], [0.0, 0.0, 0.003]]]),
        force=np.array([[0.0, 0.0], [1.5, 2.5]]),
    )
    assert csv_text(verdict(made)) == (
        "time_s,x_mm,y_mm,z_mm,yaw_deg,tilt_deg,voltage_v,current_a,hip_deg,hip_target_deg,hip_nm,"
        "knee_deg,knee_target_deg,knee_nm,L1_foot_mm,L1_force_n,R1_foot_mm,R1_force_n\n"
        "0,0,0,100,0,0,5,0,0,,0,0,0,0,0,0,0,0\n"
        "0.005,10,-20,90,180,30,4.5,1.25,90,180,0.25,45,60,-0.5,2,1.5,3,2.5\n"
    )


@pytest.mark.parametrize(("samples", "step"), [(100, 1), (120, 1), (121, 2), (240, 2), (241, 3)])
def test_a_film_has_at_most_120_pictures(samples: int, step: int) -> None:
    leg = {
        f"{name}_{part}": np.ones((samples, 3)) for name in ("L1", "R1") for part in ("coxa", "thigh", "foot")
    }
    scene = twin_scene(verdict(record(samples, places=leg)), "walk")
    assert scene.title == "walk: as expected"
    assert scene.picture_s == pytest.approx(step * STEP_S)
    assert {len(part.frames) for part in scene.parts} == {math.ceil(samples / step)}


def test_lines_go_round_the_body_and_along_each_leg() -> None:
    mounts = {"L1": (1.0, 1.0), "R1": (1.0, -1.0), "L2": (-1.0, 1.0), "R2": (-1.0, -1.0)}
    robot = cast(Any, SimpleNamespace(limbs=[SimpleNamespace(name=name, mount=object()) for name in mounts]))
    parts = ("coxa", "thigh", "foot")
    places = {
        f"{name}_{part}": np.array([[x, y, -0.1 * row]])
        for name, (x, y) in mounts.items()
        for row, part in enumerate(parts)
    }
    feet = np.array([[[x, y, -9.0] for x, y in mounts.values()]])
    outline, *legs = lines_through(robot, places, feet, np.zeros((1, 0)), np.zeros((1, 3)))
    corners = [tuple(corner) for corner in np.asarray(outline.frames[0]).tolist()]
    assert corners == [(*mounts[name], 0.0) for name in ("R2", "R1", "L1", "L2", "R2")]
    assert not outline.marks
    assert len(legs) == 4
    assert np.asarray(legs[1].frames[0]).tolist() == [[1, -1, 0], [1, -1, -0.1], [1, -1, -0.2], [1, -1, -9]]
    assert [leg.colour for leg in legs] == ["C0", "C1", "C2", "C3"]
    assert all(leg.marks for leg in legs)


def test_an_arm_is_one_line_from_its_base_to_its_tool() -> None:
    arm = cast(Any, SimpleNamespace(limbs=[SimpleNamespace(name="arm", mount=None)]))
    places = {"one": np.array([[1.0, 0.0, 0.0]]), "two": np.array([[2.0, 0.0, 0.0]])}
    (line,) = lines_through(arm, places, np.zeros((1, 0, 3)), np.array([[3.0, 0.0, 0.0]]), np.zeros((1, 3)))
    assert np.asarray(line.frames[0])[:, 0].tolist() == [0, 1, 2, 3]


def test_a_base_on_wheels_is_its_outline_at_its_pose() -> None:
    """At (1, 2) m, turned by 90°: what was ahead is to the left."""
    base = robot("omni")
    assert isinstance(base, DrivingRobot)
    parts = lines_through(
        base, {}, np.zeros((1, 0, 3)), np.zeros((1, 0)), np.array([[1.0, 2.0, math.pi / 2]])
    )
    for part, shape in zip(parts, base.outline(), strict=True):
        assert (part.colour, part.marks) == ("tab:blue", False)
        ((x, y, z),) = (np.asarray(frame).T for frame in part.frames)
        assert np.stack([x, y, z]) == pytest.approx(
            np.stack([1 - shape.imag, 2 + shape.real, np.zeros(len(shape))])
        )


def drawn(made: TwinVerdict, monkeypatch: pytest.MonkeyPatch) -> dict[str, Axes]:
    """Return the charts of a picture by the labels of their vertical axes."""
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    figures: list[Figure] = []
    monkeypatch.setattr(pictures, "save", lambda figure, path: figures.append(figure))
    twin_plot(made, "arm", Path("arm.svg"))
    return {axes.get_ylabel(): axes for axes in figures[0].axes}


def curves(axes: Axes) -> dict[str, Any]:
    """Return the lines of a chart by their names, but not those across it."""
    return {str(line.get_label()): line for line in axes.get_lines() if line.get_linestyle() != ":"}


ARM_TOOL = np.random.default_rng(3).uniform(-0.3, 0.3, (SAMPLES, 3))


def arm_verdict(planned: np.ndarray | None, continuous: tuple[bool, bool] = (False, False)) -> TwinVerdict:
    chain = SimpleNamespace(limbs=[SimpleNamespace(name="arm", mount=None)])
    drives = [
        SimpleNamespace(**(vars(each) | {"continuous": on}))
        for each, on in zip(rig().drives, continuous, strict=True)
    ]
    made = record(
        rig=rig(robot=chain, drives=drives),
        angle=np.tile([0.1, 0.2], (SAMPLES, 1)),
        target=np.tile([0.3, -0.2], (SAMPLES, 1)),
        feet=np.zeros((SAMPLES, 0, 3)),
        force=np.zeros((SAMPLES, 0)),
        tool=ARM_TOOL,
        floating=False,
    )
    found = verdict(made, planned=PlannedRoute(0.02, tool=planned))
    events = tuple(Event(seconds, EventKind.SATURATED, "it is weak") for seconds in (0.25, 0.35))
    return replace(found, events=events)


def check_lags(charts: dict[str, Axes], shown: tuple[int, ...]) -> None:
    lags = curves(charts["target - angle, °"])
    assert list(lags) == [SERVOS[index] for index in shown]
    for index in shown:
        line = lags[SERVOS[index]]
        assert line.get_color() == PALETTE[index]
        assert line.get_ydata() == pytest.approx(np.full(SAMPLES, math.degrees((0.2, -0.4)[index])))


def test_the_picture_of_an_arm_has_its_tool_from_above_and_over_time_and_its_lags(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    planned = np.random.default_rng(4).uniform(-0.3, 0.3, (30, 3))
    charts = drawn(arm_verdict(planned), monkeypatch)
    path = curves(charts["y, mm"])
    assert np.stack(path["planned"].get_data()) == pytest.approx(1000 * planned.T[:2])
    assert np.stack(path["simulated"].get_data()) == pytest.approx(1000 * ARM_TOOL[FIRST:].T[:2])
    for label, column in (("tool, y, mm", 1), ("tool, z, mm", 2)):
        (line,) = curves(charts[label]).values()
        assert np.stack(line.get_data()) == pytest.approx(
            np.stack([STEP_S * np.arange(SAMPLES), 1000 * ARM_TOOL[:, column]])
        )
    check_lags(charts, (0, 1))


@pytest.mark.filterwarnings("error:No artists with labels")
def test_the_first_event_is_a_line_across_each_chart_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wheel has no angle to lag behind, and a tool without a plan no path to be compared with."""
    charts = drawn(arm_verdict(None, (True, False)), monkeypatch)
    check_lags(charts, (1,))
    assert not charts.pop("y, mm").get_lines()
    assert len(charts) == 6
    for axes in charts.values():
        (event,) = [line for line in axes.get_lines() if line.get_linestyle() == ":"]
        assert list(event.get_xdata()) == [0.25, 0.25]
        assert max(line.get_linewidth() for line in axes.get_lines()) <= 1


# What goes in


def test_pulses_take_effect_at_the_first_step_at_or_after_their_fall() -> None:
    """At 3.2768 MHz a millisecond is 819.2 cycles, and a cycle 1.220703125 µs."""
    receiver = PulseReceiver((PINS.index("RB0"), PINS.index("RA1")), Clock(3_276_800), Fraction(1, 1000))
    for step in range(12):
        first = math.ceil(step * 819.2)
        assert receiver.first_cycle(step) == first
        assert receiver.step_at(first) == step
        assert step == 0 or receiver.step_at(first - 1) == step - 1
    edges = [
        (1, 5, 1),
        (3, 4, 1),
        (819, 5, 0),
        (819, 1, 1),
        (820, 5, 1),
        (830, 5, 1),
        (1639, 5, 0),
        (1640, 1, 0),
    ]
    found = receiver.pulses(edge_chunk(*zip(*edges, strict=True)))
    assert [(pulse.step, pulse.servo) for pulse in found] == [(1, 0), (3, 0), (3, 1)]
    us = 1.220703125
    assert [pulse.width_us for pulse in found] == pytest.approx([818 * us, 819 * us, 821 * us])
    receiver.pulses(edge_chunk([2000], [1], [1]))
    high = receiver.snapshot()
    (pulse,) = receiver.pulses(edge_chunk([2100], [1], [0]))
    receiver.restore(high)
    (longer,) = receiver.pulses(edge_chunk([2200], [1], [0]))
    assert (pulse.width_us, longer.width_us) == pytest.approx((100 * us, 200 * us))
    undriven = receiver.pulses(edge_chunk([3000, 3008], [5, 5], [1, 2]))
    assert len(undriven) == 1


def test_sensors_and_scripted_inputs_come_in_order_and_never_ahead_of_what_is_known() -> None:
    clock = Clock(4_000_000)
    scripted = Stimuli((Levels(0, ((5, 1), (10, 0), (15, 1))),))
    feed = Feed(scripted, clock)
    changes = feed.changes(clock)

    def piece() -> tuple[int, list[tuple[int, int, int]]]:
        known, packed = next(changes)
        pins = (1 << PACK_CYCLE - PACK_PIN) - 1
        levels = (1 << PACK_PIN) - 1
        return known, [
            (each >> PACK_CYCLE, each >> PACK_PIN & pins, each & levels) for each in packed.tolist()
        ]

    assert piece() == (0, [])
    feed.push(7, 3, 1)
    feed.push(8, 3, 1)  # no change
    feed.push(9, 3, 0)
    feed.know(10)
    assert piece() == (10, [(5, 0, 1), (7, 3, 1), (9, 3, 0)])
    feed.know(16)
    assert piece() == (16, [(10, 0, 0), (15, 0, 1)])
    assert piece() == (16, [])
    assert [(change.cycle, change.level) for change in feed.seen] == [(7, 1), (9, 0)]
    assert next(Feed(None, clock).changes(clock))[0] == 0


def test_a_supply_gives_the_circuits_voltage_and_no_more_than_its_limit() -> None:
    """5 V behind 1 ohm, idle 0.5 A, a motor of A = 0.5 and B = 1: Vs = (5 - (0.5 - 1)) / 1.5."""
    volts, amperes = Supply(5.0, 1.0).under(0.5, 0.5, 1.0)
    assert volts == pytest.approx(5.5 / 1.5)
    assert amperes == pytest.approx(5 - volts)
    assert Supply(5.0, 1.0, limit_a=amperes).under(0.5, 0.5, 1.0)[0] == pytest.approx(volts)
    limited = Supply(5.0, 1.0, limit_a=1.0).under(0.5, 0.5, 1.0)
    assert limited == (pytest.approx((1.0 - 0.5 + 1.0) / 0.5), 1.0)
    assert Supply(5.0, 0.0, limit_a=0.1).under(0.5, 2.0, 0.0) == (0.0, 0.1)
    assert Supply(5.0, 0.0, limit_a=0.1).under(0.5, 0.0, 0.0) == (5.0, 0.5)
    assert Supply(5.0, 1.0).under(0.0, 0.1, 2.0) == (5.0, 0.0)  # turned back, it gives nothing back


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"friction": 5.01}, "friction = 5.01 is not between 0 and 5"),
        ({"friction": -0.01}, "friction = -0.01 is not between 0 and 5"),
        ({"slope": math.radians(46)}, "slope = 46 is not between -45 and 45"),
        ({"slope": math.radians(-46)}, "slope = -46 is not between -45 and 45"),
        ({"step": 0.201}, "step = 201 is not between 0 and 200"),
        ({"step": -0.001}, "step = -1 is not between 0 and 200"),
        ({"rough": 0.201}, "rough = 201 is not between 0 and 200"),
    ],
)
def test_a_ground_that_cannot_be_is_refused(given: dict[str, float], text: str) -> None:
    with pytest.raises(InputError, match=text):
        Ground(**given)  # type: ignore[arg-type]


def test_grounds_at_their_limits_are_described() -> None:
    assert Ground(5.0, math.radians(45), step=0.2).text() == "friction 5, slope 45°, a step of 200 mm"
    rough = Ground(0.0, rough=0.2, seed=7)
    assert rough.text() == "friction 0, rough by 200 mm, seed 7"
    assert rough.level == 0.1
    heights = rough.heights()
    assert heights.shape == (121, 121)  # 2.4 m, a height every 20 mm
    assert 0 <= heights.min() < 0.001
    assert 0.199 < heights.max() <= 0.2
    assert (heights == Ground(rough=0.2, seed=7).heights()).all()
    assert (heights != Ground(rough=0.2).heights()).any()
    assert Ground().heights().max() == 0


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"seconds": 0.019}, "seconds = 0.019 is less than 0.02"),
        ({"loops": 0}, "loops = 0 is not between 1 and 1000"),
        ({"loops": 1001}, "loops = 1001 is not between 1 and 1000"),
        ({"chunk_ms": 0}, "chunk_ms = 0 is not between 1 and 1000"),
        ({"chunk_ms": 1001}, "chunk_ms = 1001 is not between 1 and 1000"),
        ({"steps_per_ms": 0}, "steps_per_ms = 0 is not between 1 and 20"),
        ({"steps_per_ms": 21}, "steps_per_ms = 21 is not between 1 and 20"),
    ],
)
def test_settings_of_a_run_are_bounded(given: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        TwinSettings(**given)
    TwinSettings(seconds=0.02, loops=1000, chunk_ms=1000, steps_per_ms=20)
    assert TwinSettings(loops=1, chunk_ms=1, steps_per_ms=1).step_s * 1000 == 1
    assert TwinSettings(steps_per_ms=4).step_s * 4000 == 1
