"""A robot at power-up: where its first pulses will hold it, what its sensors read, what a film shows."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from servogen.edges import edge_chunk
from servogen.errors import InputError
from servogen.job import PlannedJob, loads, plan_job
from servogen.job.schema import SensorTable
from servogen.kinematics.catalogue import arm
from servogen.kinematics.forward import fk_position
from servogen.kinematics.hexapod import feet
from servogen.kinematics.transforms import rot
from servogen.twin import Ground, TwinSettings, run
from servogen.twin.live import LiveTwin
from servogen.twin.planned import planned_of
from servogen.twin.run import sensor_reader, standing
from servogen.twin.world import mujoco
from servogen.units import Clock
from tests.twin.walking import AHEAD, JOBS, text_of


@pytest.fixture(scope="module")
def walk() -> PlannedJob:
    return plan_job(loads(text_of(AHEAD), str(JOBS / "test.toml")))


def first_joints(job: PlannedJob) -> dict[str, float]:
    """Return each joint's position in the first frame, from the servos' angles of the plan."""
    names = [servo.name for servo in job.servos]
    angles = job.trajectory.angles[0]
    return {
        binding.joint: (float(angles[names.index(binding.servo)]) - binding.zero) / binding.ratio
        for binding in job.bindings
    }


def test_a_robot_stands_in_its_first_frame_with_its_lowest_foot_on_the_ground(walk: PlannedJob) -> None:
    joints = first_joints(walk)
    angles = [[joints[f"{mount.name}_{name}"] for name in ("alpha", "beta")] for mount in walk.robot.mounts]  # type: ignore[union-attr]
    lowest = feet(walk.robot, np.array(angles))[:, 2].min()  # type: ignore[arg-type]
    for ground, above in ((Ground(), 0.0), (Ground(rough=0.02), 0.02)):
        _, _, world = standing(walk, TwinSettings(ground))
        for name, position in joints.items():
            assert world.data.joint(name).qpos[0] == pytest.approx(position, abs=1e-12)
        for mount in walk.robot.mounts:  # type: ignore[union-attr]
            level, beta = (world.data.joint(f"{mount.name}_{name}").qpos[0] for name in ("level", "beta"))
            assert level == -beta
        assert world.data.qpos[:3] == pytest.approx([0, 0, above - lowest], abs=1e-9)


def test_a_route_leads_where_it_is_told() -> None:
    """120 mm ahead and 40 mm to the left; a quarter turn; as much again, now to the left and back; twice."""
    walked = "forward_mm = 30, left_mm = 10, cycles = 4"
    route = f"{{ {walked} }}, {{ turn_deg = 15, cycles = 6 }}, {{ {walked} }}"
    job = plan_job(loads(text_of(route), str(JOBS / "test.toml")))
    assert planned_of(job, 0, 1).way == pytest.approx((0.12 - 0.04, 0.04 + 0.12, math.pi / 2), abs=1e-12)
    assert planned_of(job, 0, 2).way == pytest.approx((0.08 - 0.16, 0.16 + 0.08, math.pi), abs=1e-12)


def test_a_step_may_be_a_part_of_a_millisecond(walk: PlannedJob) -> None:
    """A step of the physics is a millisecond, or the part of one that is asked for."""
    for parts in (1, 4):
        _, built, world = standing(walk, TwinSettings(steps_per_ms=parts))
        assert world.step_s == 0.001 / parts
        assert f'timestep="{0.001 / parts:g}"' in built.text


def test_sensors_read_the_bodies_at_their_thresholds(walk: PlannedJob) -> None:
    rig, _, world = standing(walk, TwinSettings())
    rows = (
        SensorTable(pin="RA0", kind="foot", of="L2"),
        SensorTable(pin="RA1", kind="end-stop", of="R1_beta", at_deg=-20, side="below"),
        SensorTable(pin="RA2", kind="end-stop", of="L1_alpha", at_deg=10, level="high"),
        SensorTable(pin="RA3", kind="stall", above_a=1.25),
    )
    foot, below, above, stall = (sensor_reader(row, world, rig) for row in rows)
    assert [(each.pin, each.active) for each in (foot, below, above, stall)] == [
        (0, 0),
        (1, 0),
        (2, 1),
        (3, 0),
    ]
    assert [each.text for each in (foot, below, above, stall)] == [
        "foot L2",
        "end stop R1_beta",
        "end stop L1_alpha",
        "stall comparator",
    ]
    touch: Any = world.data.sensor("L2_touch").data
    for force, closed in ((0.0, False), (0.199, False), (0.2, True), (3.0, True)):
        touch[0] = force
        assert foot.reads() == closed
    for joint, sensor, place, sign in (("R1_beta", below, -20, -1), ("L1_alpha", above, 10, 1)):
        for off, pressed in ((-1e-6, False), (1e-6, True), (0.5, True), (-0.5, False)):
            world.data.joint(joint).qpos[0] = math.radians(place) + sign * off
            assert sensor.reads() == pressed
    for current, stalled in ((1.25, False), (1.2501, True), (0.0, False)):
        world.current = current
        assert stall.reads() == stalled


def test_a_film_shows_the_bodies_where_they_are_and_their_heading(walk: PlannedJob) -> None:
    live = LiveTwin(walk, walk.clock, lambda begin, end: edge_chunk((), (), ()))
    assert live.floating and live.legs == [mount.name for mount in walk.robot.mounts]  # type: ignore[union-attr]
    data = live.world.data
    yaw, pitch, roll = 2.2, 0.1, -0.2
    turn = rot("z", yaw) @ rot("y", pitch) @ rot("x", roll)
    half = [np.array([math.cos(angle / 2), math.sin(angle / 2)]) for angle in (yaw, pitch, roll)]
    (cz, sz), (cy, sy), (cx, sx) = half
    data.qpos[:7] = [
        *(0.3, -0.2, 0.5),
        cz * cy * cx + sz * sy * sx,
        cz * cy * sx - sz * sy * cx,
        cz * sy * cx + sz * cy * sx,
        sz * cy * cx - cz * sy * sx,
    ]
    seen = live.moment()
    assert seen.pose == pytest.approx([0.3, -0.2, 0.5, yaw])
    joints = first_joints(walk)
    angles = [[joints[f"{name}_alpha"], joints[f"{name}_beta"]] for name in live.legs]
    tip = np.array([0, 0, 0.003])
    own = feet(walk.robot, np.array(angles)) + tip  # type: ignore[arg-type]
    placed = own @ turn.T + [0.3, -0.2, 0.5] - tip  # the lowest point of the tip's ball
    assert seen.feet == pytest.approx(placed, abs=1e-9)
    assert seen.force.tolist() == [0.0] * 6 and seen.seconds == 0.0
    mujoco().mj_forward(live.world.model, data)
    for leg, foot, part in zip(live.legs, placed, seen.lines[-6:], strict=True):
        joints = [data.body(f"{leg}_{name}").xpos for name in ("coxa", "thigh", "foot")]
        assert np.array(part.frames)[0] == pytest.approx(np.array([*joints, foot]))


@pytest.fixture(scope="module")
def carrying() -> PlannedJob:
    """An arm with a tool, whose servos are in another order than its joints."""
    return plan_job(loads((JOBS / "scara-pick.toml").read_text(), str(JOBS / "test.toml")))


def test_an_end_stop_of_a_slide_is_in_millimetres(carrying: PlannedJob) -> None:
    rig, _, world = standing(carrying, TwinSettings())
    sensor = sensor_reader(SensorTable(pin="RA0", kind="end-stop", of="q3", at_mm=50), world, rig)
    for place, pressed in ((0.0499, False), (0.05, True), (0.2, True), (-0.05, False)):
        world.data.joint("q3").qpos[0] = place
        assert sensor.reads() == pressed
    zero = sensor_reader(SensorTable(pin="RA0", kind="end-stop", of="q3", at_mm=0, side="below"), world, rig)
    world.data.joint("q3").qpos[0] = 0.0
    assert zero.reads()


def begun(job: PlannedJob, settings: TwinSettings) -> Any:
    """Return a run whose chip is not there: frames of 20 ms, three of them before the job's own."""
    rig, built, world = standing(job, settings)
    made: Any = object.__new__(run.TwinRun)
    made.job, made.settings, made.rig, made.world, made.bodies = job, settings, rig, world, built
    made.schedule = SimpleNamespace(clock=Clock(4_000_000), period=20_000)
    made.lead_in_frames, made.feed, made.first_pulse, made.rows = 3, None, None, []
    made.limbs = [limb.name for limb in rig.robot.limbs if limb.mount is not None]
    model = world.model
    made.sites = [model.site(f"{name}_foot").id for name in made.limbs]
    made.tool = next((i for i in range(model.nsite) if model.site(i).name == "tool"), None)
    made.floating = model.joint(0).name == "body"
    made.every = 5
    return made


@pytest.mark.parametrize("name", ["walk", "carrying"])
def test_a_record_has_what_the_bodies_servos_and_supply_were_in_each_sample(
    name: str, request: pytest.FixtureRequest
) -> None:
    """The bodies are thrown about at random; yaw and tilt are those of the matrix of the body's frame."""
    job = request.getfixturevalue(name)
    made, random = begun(job, TwinSettings(loops=2)), np.random.default_rng(5)
    world, rig = made.world, made.rig
    data, hot, kept = world.data, world.state, []
    zero = np.array([binding.zero for binding in rig.bindings])
    for number in range(4):
        data.qpos[:] = random.normal(size=len(data.qpos))
        if made.floating:
            data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
        data.qvel[:] = random.normal(size=len(data.qvel))
        mujoco().mj_forward(world.model, data)
        world.voltage, world.current = random.random(2)
        world.duty = random.random(len(zero))
        hot.target = random.random(len(zero))
        hot.driven = np.array([float(index < number) for index in range(len(zero))])
        data.sensordata[:] = random.random(len(data.sensordata))
        made.sample(7 * number)
        kept.append(
            {
                "time": 0.007 * number,
                "voltage": world.voltage,
                "current": world.current,
                "angle": data.actuator_length + zero,
                "target": np.where(np.arange(len(zero)) < number, hot.target + zero, np.nan),
                "pulsed": hot.driven == 1,
                "duty": world.duty.copy(),
                "torque": data.actuator_force.copy(),
                "speed": data.actuator_velocity.copy(),
                "force": data.sensordata[: len(made.limbs)].copy(),
                "frame": data.xmat[1].reshape(3, 3).copy(),
                "place": data.xpos[1].copy(),
                "places": {
                    world.model.body(at).name: data.xpos[at].copy() for at in range(1, world.model.nbody)
                },
                "ends": np.array([data.site(f"{leg}_foot").xpos - [0, 0, 0.003] for leg in made.limbs]),
                "tool": None if made.tool is None else data.site("tool").xpos.copy(),
            }
        )
    made.first_pulse = 11
    found = made.record()
    for number, row in enumerate(kept):
        for key in (
            "time",
            "voltage",
            "current",
            "angle",
            "target",
            "pulsed",
            "duty",
            "torque",
            "speed",
            "force",
        ):
            assert getattr(found, key)[number] == pytest.approx(row[key], nan_ok=True), key
        assert {key: place[number].tolist() for key, place in found.places.items()} == {
            key: place.tolist() for key, place in row["places"].items()
        }
        if made.limbs:
            assert found.feet[number] == pytest.approx(row["ends"])
            assert found.pose[number, :3] == pytest.approx(row["place"])
            frame = row["frame"]
            assert math.remainder(found.pose[number, 3] - math.atan2(frame[1, 0], frame[0, 0]), math.tau) == (
                pytest.approx(0, abs=1e-12)
            )
            assert found.tilt[number] == pytest.approx(math.acos(frame[2, 2]))
        else:
            assert found.tool[number] == pytest.approx(row["tool"])
            assert found.pose[number].tolist() == [0] * 4 and found.tilt[number] == 0
    assert (np.abs(np.diff(found.pose[:, 3])) <= math.pi).all()
    trajectory = job.trajectory
    frames = trajectory.loop_start - 3 + 2 * (len(trajectory.angles) - trajectory.loop_start)
    assert found.motion == pytest.approx((0.011 + 0.06, 0.011 + 0.06 + 0.02 * frames))
    assert found.floating == (name == "walk") and found.changes == () and found.energies is None


def test_a_run_ends_after_its_motion_its_time_or_two_silent_seconds(walk: PlannedJob) -> None:
    trajectory = walk.trajectory
    for parts in (1, 2):
        made = begun(walk, TwinSettings(steps_per_ms=parts, loops=3))
        own = trajectory.loop_start - 3 + 3 * (len(trajectory.angles) - trajectory.loop_start)
        assert made.end_after(None) == 2000 * parts
        assert made.end_after(35) == 35 + 20 * parts * (3 + own)
        assert begun(walk, TwinSettings(steps_per_ms=parts, seconds=0.75)).end_after(35) == 750 * parts
    endless = begun(walk, TwinSettings(seconds=2000.0))
    assert endless.end_after(None) == 2_000_000  # 400 000 samples of five steps
    with pytest.raises(InputError, match="longer than half an hour"):
        begun(walk, TwinSettings(seconds=2000.005)).end_after(None)


def test_the_plan_of_a_walk_leads_along_its_route_as_often_as_it_is_played() -> None:
    """Ahead by 40 mm, then a turn by 30°; the second time ahead is along the new heading."""
    route = "{ forward_mm = 40, cycles = 1 }, { turn_deg = 15, cycles = 2 }"
    job = plan_job(loads(text_of(route), str(JOBS / "test.toml")))
    trajectory = job.trajectory
    loop = len(trajectory.angles) - trajectory.loop_start
    away = 0.04 * (1 + np.exp(1j * math.radians(30)))
    for loops, way in ((1, (0.04, 0.0, math.radians(30))), (2, (away.real, away.imag, math.radians(60)))):
        found = planned_of(job, 0, loops)
        assert found.way == pytest.approx(way, abs=1e-9)
        assert found.rigid is not None and len(found.rigid) == trajectory.loop_start + loops * loop
        assert found.rigid[-1] == pytest.approx(way, abs=0.02)
        assert found.height == pytest.approx(0.130, abs=1e-3)
        assert found.frame_s == pytest.approx(float(trajectory.clock.seconds(trajectory.period)))
        assert found.tool is None


def test_the_plan_of_an_arm_is_the_way_of_its_tool(carrying: PlannedJob) -> None:
    found = planned_of(carrying, 0, 1)
    assert (found.way, found.rigid, found.height) == (None, None, None)
    names = [servo.name for servo in carrying.servos]
    angles = carrying.trajectory.angles
    joints = np.stack(
        [
            (angles[:, names.index(binding.servo)] - binding.zero) / binding.ratio
            for binding in sorted(carrying.bindings, key=lambda each: each.joint)
        ],
        axis=1,
    )
    assert found.tool == pytest.approx(fk_position(arm("scara"), joints))
    led = replace(carrying, trajectory=replace(carrying.trajectory, loop_start=10))
    later = planned_of(led, 4, 2).tool  # after four frames of the engine six are played once
    assert later is not None and found.tool is not None
    assert later == pytest.approx(np.concatenate([found.tool[4:], found.tool[10:]]))


def test_the_plan_of_a_base_is_the_way_of_its_wheels() -> None:
    """The square of 300 mm closes; its farthest corner is both sides away."""
    job = plan_job(loads((JOBS / "omni-square.toml").read_text(), str(JOBS / "test.toml")))
    found = planned_of(job, 0, 1)
    assert found.rigid is not None and (found.tool, found.height) == (None, None)
    assert found.way == pytest.approx((0, 0, 0), abs=1e-3)
    assert found.rigid.max(axis=0)[:2] == pytest.approx([0.3, 0.3], abs=2e-3)
    assert np.abs(found.rigid[:, 2]).max() < 1e-3
