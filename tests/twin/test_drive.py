"""A servo's constants against its data sheet, computed and measured in the physics."""

import math
from dataclasses import replace

import pytest

from servogen.errors import InputError
from servogen.robot.servo import Motor, Servo, calibration, servo
from servogen.robot.servo_models import servo_model
from servogen.twin.drive import ServoDrive, bank, servo_drive
from servogen.twin.pulses import ReceivedPulse
from servogen.twin.supply import Supply

DATA_SHEETS = {
    # model, supply: speed rad/s, torque N·m, current at standstill A (with the electronics), or None
    ("futaba-s3001", 4.8): (1.8, 0.34, 0.720),
    ("mpx-tiny-s", 4.8): (math.radians(60) / 0.08, 0.25, None),
    ("mpx-tiny-s", 6.0): (math.radians(60) / 0.06, 0.29, None),
}


def of(name: str, volts: float | None = None, **facts: object) -> Servo:
    model = servo_model(name, volts)
    return servo("arm", "RB0", replace(model, **facts) if facts else model)  # type: ignore[arg-type]


def stall_current(drive: ServoDrive) -> float:
    """Return the current from the supply at standstill, with that of the electronics."""
    return drive.supply_v / drive.resistance + drive.idle_a


@pytest.mark.parametrize(("name", "volts"), DATA_SHEETS)
def test_the_constants_give_speed_torque_and_current_of_the_data_sheet(name: str, volts: float) -> None:
    speed, torque, current = DATA_SHEETS[name, volts]
    drive = servo_drive(of(name, volts))
    assert drive.no_load_speed == pytest.approx(speed, rel=0.01)
    assert drive.stall_torque == pytest.approx(torque, rel=0.01)
    if current is not None:
        assert stall_current(drive) == pytest.approx(current, rel=0.01)
    assert drive.torque_constant <= drive.speed_constant  # no gear gives more power than it takes


@pytest.mark.parametrize(("name", "volts"), DATA_SHEETS)
def test_the_physics_shows_speed_torque_and_current_of_the_data_sheet(name: str, volts: float) -> None:
    """A disc on the shaft: free, it turns at the no-load speed; a stop feels the stall torque."""
    pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")
    from tests.twin.bench import on_the_bench

    speed, torque, current = DATA_SHEETS[name, volts]
    seen = on_the_bench(of(name, volts))
    assert seen.speed == pytest.approx(speed, rel=0.01)
    assert seen.torque == pytest.approx(torque, rel=0.01)
    if current is not None:
        assert seen.current == pytest.approx(current, rel=0.01)


def test_a_stated_no_load_current_becomes_dry_friction_and_keeps_the_data_sheet() -> None:
    """By hand: R = 4.8/0.712, Ke = (4.8 - R 0.1)/1.8 = 2.292, Kt = 0.34/0.612 = 0.5556, friction Kt 0.1."""
    drive = servo_drive(of("futaba-s3001", motor=Motor(no_load_a=0.1)))
    assert drive.friction == pytest.approx(0.05556, rel=1e-3)
    assert drive.speed_constant == pytest.approx(2.2921, rel=1e-3)
    assert drive.no_load_speed == pytest.approx(1.8)
    assert drive.stall_torque == pytest.approx(0.34)


def test_the_constants_of_a_tiny_s_by_hand() -> None:
    """At 4.8 V: 750 °/s, 0.25 N·m; 500 µs are 180°; the gear's efficiency 0.66 gives the stall current.

    The loop is critically damped: (D + K Td)² = 4 K J.
    """
    drive = servo_drive(of("mpx-tiny-s", 4.8))
    speed, torque = math.radians(750), 0.25
    stall = torque * speed / (0.66 * 4.8)
    assert drive.supply_v == 4.8
    assert drive.resistance == pytest.approx(4.8 / stall)
    assert drive.speed_constant == pytest.approx(4.8 / speed)
    assert drive.torque_constant == pytest.approx(torque / stall)
    damping = drive.torque_constant * drive.speed_constant / drive.resistance
    assert drive.inertia == pytest.approx(0.010 * damping)
    per_us = math.pi / 500
    assert (drive.dead_band, drive.band) == pytest.approx((2 * per_us, 5 * per_us))
    stiffness = torque / drive.band
    assert drive.damping_s > 0
    assert (damping + stiffness * drive.damping_s) ** 2 == pytest.approx(4 * stiffness * drive.inertia)
    assert (drive.friction, drive.backlash, drive.lost_s, drive.idle_a) == (0.0, 0.0, 0.1, 0.008)
    assert not drive.continuous
    assert drive.assumptions == tuple(
        f"Multiplex Tiny-S: {text}"
        for text in (
            "idle_ma = 8",
            "no_load_ma = 0 (A, no dry friction)",
            "efficiency = 0.66",
            "the current at standstill is 1.03 A, from speed, torque and efficiency",
            "start_ms = 10",
            "dead_band_us = 2",
            "full_drive_us = 5",
            "lost_ms = 100",
            "backlash_deg = 0",
        )
    )


def test_a_motor_that_brakes_enough_by_itself_needs_no_feedback_of_its_speed() -> None:
    """A soft loop: the motor's own damping is more than critical."""
    assert servo_drive(of("mpx-tiny-s", motor=Motor(full_drive_us=900.0))).damping_s == 0.0


def test_what_is_assumed_where_a_file_states_little() -> None:
    """A continuous servo states neither speed nor torque: the greatest speed of its points, 0.3 N·m."""
    bare = {"speed": None, "torque_nm": None, "supply_v": None, "motor": Motor(efficiency=0.8)}
    drive = servo_drive(of("continuous", **bare))
    assert drive.continuous
    assert drive.no_load_speed == pytest.approx(math.radians(300))
    assert drive.stall_torque == pytest.approx(0.3)
    said = [text.partition(": ")[2] for text in drive.assumptions]
    assert said[:2] == ["supply_v = 5", "torque_ncm = 30"]
    assert "lost_ms = 100" in said and not any("efficiency =" in text for text in said)
    stated = servo_drive(of("continuous", **bare | {"speed": 2.0, "torque_nm": 0.1}))
    assert (stated.no_load_speed, stated.stall_torque) == (pytest.approx(2.0), pytest.approx(0.1))


def test_the_stall_current_is_the_stated_one_then_the_greatest_one_without_the_electronics() -> None:
    plain = of("futaba-s3001")
    drive = servo_drive(plain)
    assert stall_current(drive) == pytest.approx(0.720) and drive.idle_a == 0.008
    assert drive.supply_v / drive.resistance == pytest.approx(0.712)
    assert "the current at standstill is its max_ma, 0.72 A" in " ".join(drive.assumptions)
    known = servo_drive(of("futaba-s3001", motor=Motor(stall_a=0.9)))
    assert known.supply_v / known.resistance == pytest.approx(0.9)
    assert "max_ma" not in " ".join(known.assumptions)


def test_motors_at_the_limits_of_what_can_be() -> None:
    """As much power as it takes; no more current at standstill than at full speed; the fastest loop."""
    ideal = servo_drive(of("mpx-tiny-s", 4.8, motor=Motor(efficiency=1.0)))
    assert ideal.torque_constant == pytest.approx(ideal.speed_constant)
    with pytest.raises(InputError, match="not above that at full speed"):
        servo_drive(of("mpx-tiny-s", motor=Motor(stall_a=2.0, no_load_a=2.0)))
    base = servo_drive(of("mpx-tiny-s", 4.8))
    damping = base.torque_constant * base.speed_constant / base.resistance
    narrow = 0.01 * of("mpx-tiny-s").calibration.per_us
    fastest = 0.25 / narrow / 6000**2 / damping  # K / J = 6000²/s²: 0.3 rad in 50 µs
    kept = servo_drive(of("mpx-tiny-s", 4.8, motor=Motor(full_drive_us=0.01, start_s=1.001 * fastest)))
    assert kept.steps_per_ms == 20
    with pytest.raises(InputError, match=f"start_ms = {999 * fastest:.3g}.* too fast for steps of 50 µs"):
        servo_drive(of("mpx-tiny-s", 4.8, motor=Motor(full_drive_us=0.01, start_s=0.999 * fastest)))


@pytest.mark.parametrize("stated", [Motor(), Motor(start_s=0.01), Motor(full_drive_us=5.0)])
def test_the_steps_follow_the_loop_of_a_fast_servo(stated: Motor) -> None:
    """600 °/s and 180° in 1900 µs: √(K/J) = √(ω0 / (5 µs · 10 ms)) = 356/s, more than 0.3 rad in 1 ms."""
    curve = calibration(((0.0, 500.0), (math.pi, 2400.0)))
    fast = of("mpx-tiny-s", calibration=curve, speed=math.radians(600), torque_nm=0.176, motor=stated)
    assert servo_drive(fast).steps_per_ms == 2
    slow = replace(fast, model=replace(fast.model, speed=math.radians(400)))
    assert servo_drive(slow).steps_per_ms == 1


@pytest.mark.parametrize("stated", [Motor(), Motor(start_s=0.01), Motor(full_drive_us=0.001)])
def test_assumed_values_alone_never_make_the_loop_too_fast(stated: Motor) -> None:
    """A servo that turns 4000 times a second, of a file that states at most one of the two values."""
    unknown = of("mpx-tiny-s", speed=25_000.0, torque_nm=0.002, motor=stated)
    drive = servo_drive(unknown)
    assert drive.steps_per_ms == 20
    told = " ".join(text for text in drive.assumptions if "full_drive_us" in text or "start_ms" in text)
    assert ("full_drive_us" in told) == (stated.full_drive_us is None)
    assert ("start_ms" in told) == (stated.start_s is None)


def test_a_greatest_current_that_speed_and_torque_exceed_is_not_that_at_standstill() -> None:
    """34 N·cm at 1.8 rad/s are 0.61 W: 0.1 A at 4.8 V cannot be all that it takes."""
    drive = servo_drive(of("futaba-s3001", max_a=0.1))
    assert drive.stall_torque == pytest.approx(0.34) and stall_current(drive) > 0.61 / 4.8
    assert "from speed, torque and efficiency" in " ".join(drive.assumptions)


def test_a_bank_has_the_constants_of_each_servo_and_their_current_together() -> None:
    drives = (servo_drive(of("mpx-tiny-s", 4.8)), servo_drive(of("futaba-s3001")))
    found = bank(drives)
    for key in ("resistance", "torque_constant", "speed_constant", "dead_band", "band"):
        assert getattr(found, key).tolist() == [getattr(drive, key) for drive in drives]
    assert found.damping.tolist() == [drive.damping_s for drive in drives]
    assert found.idle_a == pytest.approx(0.016)


def test_assumptions_are_named_and_stated_facts_are_not() -> None:
    said = " ".join(servo_drive(of("mpx-tiny-s")).assumptions)
    assert "efficiency = 0.66" in said and "1.03 A" in said
    motor = Motor(1.0, 0.05, None, 2.0, 5.0, 0.1, 0.01, 0.0)
    stated = servo_drive(of("mpx-tiny-s", motor=motor, idle_a=0.01, max_a=None))
    assert stated.assumptions == ()


@pytest.mark.parametrize(
    ("facts", "text"),
    [
        ({"torque_nm": None}, "states no torque_ncm"),
        ({"speed": None}, "states no speed_deg_s"),
        ({"motor": Motor(stall_a=0.1)}, "more power than the motor takes"),
        ({"motor": Motor(stall_a=0.1, no_load_a=0.2)}, "not above that at full speed"),
        ({"motor": Motor(start_s=0.001, full_drive_us=0.001)}, "too fast"),
    ],
)
def test_facts_that_no_motor_can_have_are_refused(facts: dict[str, object], text: str) -> None:
    with pytest.raises(InputError, match=text):
        servo_drive(of("mpx-tiny-s", **facts))


def test_a_supply_sags_as_the_circuit_says() -> None:
    """Kirchhoff by hand: 5 V behind 0.5 Ω, a stalled motor of 2 Ω at full duty: I = 5/2.5 = 2 A, 4 V."""
    voltage, current = Supply(5.0, 0.5).under(0.0, 1 / 2.0, 0.0)
    assert (voltage, current) == (pytest.approx(4.0), pytest.approx(2.0))


def test_a_supply_at_its_limit_gives_its_limit() -> None:
    voltage, current = Supply(5.0, 0.0, 1.5).under(0.1, 0.5, 0.0)
    assert current == 1.5
    assert voltage == pytest.approx((1.5 - 0.1) / 0.5)
    assert Supply(5.0, 0.0, 3.0).under(0.1, 0.5, 0.0) == (5.0, pytest.approx(2.6))


def test_lifting_a_weight_gives_the_work_of_its_height() -> None:
    """A weight of 0.2 kg on an arm of 50 mm, lifted from hanging to level: m g l, and nothing else moves."""
    mujoco = pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo")
    from tests.twin.bench import weight_world

    world, energies = weight_world(of("futaba-s3001"), 0.2, 0.05)
    mujoco.mj_forward(world.model, world.data)
    before = world.energy()
    for step in range(3000):
        if step % 20 == 0:
            world.pulse(ReceivedPulse(step, 0, math.pi / 2))
        world.advance()
    gained = world.energy() - before
    assert gained == pytest.approx(0.2 * 9.80665 * 0.05, rel=0.05)  # the servo stops within its dead band
    assert energies.work == pytest.approx(gained, rel=0.01)
    assert energies.electric == pytest.approx(energies.heat + energies.work, rel=0.01)
