"""The world of two servos on two shafts: electronics, supply and bodies in one step, and back to a moment."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from servogen.twin.bodies import Bodies
from servogen.twin.drive import ServoDrive, servo_drive
from servogen.twin.ground import Ground
from servogen.twin.mjcf import Actuator, Scene, add_actuators, add_joint, document
from servogen.twin.pulses import ReceivedPulse
from servogen.twin.supply import Supply
from servogen.twin.world import Energies, ServoWiring, World
from tests.twin.test_drive import of

RATIOS = (2.0, -1.0)
TINY, S3001 = servo_drive(of("mpx-tiny-s", 4.8)), servo_drive(of("futaba-s3001"))
WHEEL = servo_drive(of("continuous", speed=5.0, torque_nm=0.2))


def two(
    drives: tuple[ServoDrive, ServoDrive] = (TINY, S3001), supply: Supply | None = None, **options: bool
) -> World:
    """Return discs on upright shafts through gears of these ratios; the second servo may be broken."""
    root, world = document("two", Ground())
    actuators = [
        Actuator(name, name, ratio, -math.inf, math.inf, drive.friction, drive.inertia)
        for name, ratio, drive in zip(("one", "two"), RATIOS, drives, strict=True)
    ]
    scene = Scene(root, world, Ground(), actuators)
    for name in ("one", "two"):
        body = xml.SubElement(world, "body", pos="0 0 1", name=name)
        add_joint(scene, body, name, (1.0, 0.0, 0.0), 1.0, 0.0)
        xml.SubElement(body, "inertial", pos="0 0 0", mass="0.01", diaginertia="1e-5 1e-5 1e-5")
    add_actuators(scene)
    broken = options.pop("broken", False)
    wirings = [
        ServoWiring(drive, lambda width: width / 1000, zero, broken and zero > 0)
        for drive, zero in zip(drives, (0.0, 0.25), strict=True)
    ]
    made = Bodies(xml.tostring(root, encoding="unicode"), (), 0.02)
    return World(made, wirings, supply or Supply(4.8), 0.001, **options)


def expected_duty(drive: ServoDrive, error: float, speed: float) -> float:
    """Full drive at `band` beyond the dead band, for the error less Td ω."""
    seen = error - drive.damping_s * speed
    return math.copysign(min(max((abs(seen) - drive.dead_band) / drive.band, 0.0), 1.0), seen)


def test_a_step_drives_each_motor_by_its_error_and_the_supply_by_the_sum_of_both() -> None:
    random = np.random.default_rng(4)
    supply = Supply(5.5, 0.3)
    for _ in range(30):
        world = two(supply=supply)
        angles, speeds, errors = random.normal(size=2), random.normal(size=2), random.normal(size=2)
        errors *= 1.5 * (TINY.dead_band + TINY.band)
        world.data.qpos[:], world.data.qvel[:] = angles, 0.1 * speeds
        turned, turning = angles * RATIOS, 0.1 * speeds * RATIOS
        for servo, zero in enumerate((0.0, 0.25)):
            world.pulse(ReceivedPulse(0, servo, 1000 * (turned[servo] + errors[servo] + zero)))
        world.advance()
        drives = (TINY, S3001)
        duty = [expected_duty(d, e, w) for d, e, w in zip(drives, errors, turning, strict=True)]
        assert world.duty == pytest.approx(duty)
        idle = TINY.idle_a + S3001.idle_a
        a = sum(u**2 / d.resistance for u, d in zip(duty, drives, strict=True))
        b = sum(
            u * w * d.speed_constant / d.resistance for u, w, d in zip(duty, turning, drives, strict=True)
        )
        assert (world.voltage, world.current) == pytest.approx(supply.under(idle, a, b))
        for u, drive, ratio, before, after in zip(
            duty, drives, RATIOS, 0.1 * speeds, world.data.qvel, strict=True
        ):
            mean = ratio * (before + after) / 2
            ampere = (u * world.voltage - drive.speed_constant * mean) / drive.resistance
            inertia = 1e-5 + drive.inertia * ratio**2
            push = 0.001 * ratio * drive.torque_constant * ampere / inertia
            assert after - before == pytest.approx(push, rel=1e-6)


def test_a_wheel_is_driven_in_proportion_to_its_speed_and_no_more_than_fully() -> None:
    world = two((TINY, WHEEL))
    for width, duty in ((2750.0, 0.5), (-4750.0, -1.0), (9000.0, 1.0), (250.0, 0.0)):
        world.pulse(ReceivedPulse(world.step, 1, width))  # 1000 of it are 1 rad/s, 250 its standstill
        world.advance()
        assert world.duty.tolist() == [0.0, pytest.approx(duty)]


@pytest.mark.filterwarnings("ignore:invalid value encountered")
@pytest.mark.parametrize("value", [math.nan, -math.inf, 1e10 + 1e4])
@pytest.mark.parametrize("what", ["qpos", "qvel"])
def test_bodies_that_diverged_do_not_start_again_in_silence(
    what: str,
    value: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """As MuJoCo would let them; ten steps later it can still be seen, and nothing else was written."""
    monkeypatch.chdir(tmp_path)
    world = two()
    world.data.qvel[0] = 0.9e10
    assert not world.diverged
    world.data.qvel[0] = 0.0
    getattr(world.data, what)[1] = value
    assert world.diverged
    for _ in range(10):
        world.advance()
    assert world.diverged
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr() == ("", "")


def test_a_broken_gear_turns_nothing_and_a_servo_without_pulses_is_open() -> None:
    world = two(broken=True)
    for servo in (0, 1):
        world.pulse(ReceivedPulse(0, servo, 3000.0))
    for _ in range(20):
        world.advance()
    assert world.data.qpos[0] > 0.05 and world.data.qpos[1] == 0.0
    assert world.duty[1] == 1.0 and world.data.actuator_force[1] == 0.0
    world = two()
    world.data.qvel[:] = 1.0
    for _ in range(20):
        world.advance()
    assert world.data.qvel == pytest.approx([1.0, 1.0])  # a motor whose circuit is open does not brake
    assert world.current == pytest.approx(TINY.idle_a + S3001.idle_a)


def test_each_servo_is_lost_its_own_time_after_its_own_last_pulse() -> None:
    """Both are driven for 100 ms: those up to and with step 100 and step 140, which began at 0 and at 40."""
    world, driven = two(), []
    for step in range(150):
        if step in (0, 40):
            world.pulse(ReceivedPulse(step, step // 40, 500.0))
        world.advance()
        driven.append(world.state.driven.tolist())
    assert [row[0] for row in driven] == [1.0] * 101 + [0.0] * 49
    assert [row[1] for row in driven] == [0.0] * 40 + [1.0] * 101 + [0.0] * 9
    world.pulse(ReceivedPulse(world.step, 0, 500.0))
    world.advance()
    assert world.state.driven.tolist() == [1.0, 0.0]


def test_a_servo_that_is_lost_does_not_take_another_one_with_it() -> None:
    """In step 100 the one that waits for 60 ms since step 39 is lost; the other is so a step later."""
    world, driven = two((TINY, replace(S3001, lost_s=0.060))), []
    for step in range(103):
        if step in (0, 39):
            world.pulse(ReceivedPulse(step, step // 39, 500.0))
        world.advance()
        driven.append(world.state.driven.tolist())
    assert driven[98:] == [[1.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0], [0.0, 0.0]]


def test_a_world_goes_back_and_on_the_same_way() -> None:
    """To a moment in which one servo is about to be lost, after which the other has had a pulse."""

    def on(world: World) -> list[bytes]:
        seen = []
        for step in range(90, 160):
            if step == 110:
                world.pulse(ReceivedPulse(step, 1, 1200.0))
            world.advance()
            state = world.state
            parts = (world.data.qpos, world.data.qvel, world.duty, state.driven, state.target, state.last)
            seen.append(
                b"".join(part.tobytes() for part in parts) + repr((world.voltage, state.wake)).encode()
            )
        return seen

    world = two(supply=Supply(5.0, 0.2))
    for step in range(90):
        if step == 0:
            world.pulse(ReceivedPulse(step, 0, 700.0))
            world.pulse(ReceivedPulse(step, 1, -300.0))
        world.advance()
    kept = world.snapshot()
    assert (kept.step, world.seconds) == (90, pytest.approx(0.090))
    first = on(world)
    world.restore(kept)
    assert world.step == 90
    assert on(world) == first
    world.restore(kept)
    assert on(world) == first  # what was kept has not changed either


def test_where_the_bodies_are_at_the_start_and_how_they_lean() -> None:
    world = two()
    world.place({"two": 0.3, "one": -0.4})
    assert world.data.qpos.tolist() == [-0.4, 0.3]
    assert world.tilt == pytest.approx(0.4)  # of the first body
    world.place({"one": 0.0})
    assert world.tilt == 0.0 and world.data.qpos[1] == 0.3
    root, floor = document("free", Ground())
    body = xml.SubElement(floor, "body", name="body")
    xml.SubElement(body, "freejoint", name="body")
    xml.SubElement(body, "inertial", pos="0 0 0", mass="0.5", diaginertia="1e-3 1e-3 1e-3")
    free = World(Bodies(xml.tostring(root, encoding="unicode"), (), 0.5), (), Supply(5.0), 0.002)
    free.place({}, 0.7)
    assert free.data.qpos.tolist() == [0, 0, 0.7, 1, 0, 0, 0]
    assert free.energy() == pytest.approx(0.5 * 9.80665 * 0.7)
    free.advance()
    assert free.seconds == 0.002 and (free.voltage, free.current) == (5.0, 0.0)


def test_contacts_can_be_switched_off() -> None:
    def height(**options: bool) -> float:
        root, floor = document("ball", Ground())
        body = xml.SubElement(floor, "body", pos="0 0 0.011")
        xml.SubElement(body, "freejoint")
        xml.SubElement(body, "geom", type="sphere", size="0.01", mass="0.1", contype="1", conaffinity="0")
        world = World(
            Bodies(xml.tostring(root, encoding="unicode"), (), 0.1), (), Supply(5.0), 0.001, **options
        )
        for _ in range(100):
            world.advance()
        return float(world.data.qpos[2])

    assert height() > 0.009
    assert height(contacts=False) < -0.03  # g t² / 2 is 49 mm


def test_the_energies_of_two_motors_are_those_of_their_currents() -> None:
    """U i of what the bridges give, R i² in copper, (Ke - Kt) i ω in the gears, Kt i ω to the joints."""
    world = two(supply=Supply(5.0, 0.2))
    world.energies = account = Energies()
    drives = (TINY, S3001)
    electric = heat = work = 0.0
    for step in range(60):
        if step % 20 == 0:
            world.pulse(ReceivedPulse(step, 0, 600.0))
            world.pulse(ReceivedPulse(step, 1, -300.0 + 10 * step))
        before = world.data.qvel * RATIOS
        world.advance()
        after = world.data.qvel * RATIOS
        for drive, u, one, other in zip(drives, world.duty * world.voltage, before, after, strict=True):
            mean = (one + other) / 2
            ampere = (u - drive.speed_constant * mean) / drive.resistance
            electric += 0.001 * u * ampere
            turned = drive.torque_constant * ampere * mean
            heat += 0.001 * (drive.resistance * ampere**2 + drive.speed_constant * ampere * mean - turned)
            work += 0.001 * turned
    assert (account.electric, account.heat, account.work) == pytest.approx((electric, heat, work))
    assert electric > 0.01 and account.electric == pytest.approx(account.heat + account.work)
    moving = world.energy() - 2 * 0.01 * 9.80665
    assert account.work - account.taken == pytest.approx(moving, abs=1e-6)
