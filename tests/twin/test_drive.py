"""A servo's constants against its data sheet, computed and measured in the physics."""

import math
from dataclasses import replace

import pytest

from servogen.errors import InputError
from servogen.robot.servo import Motor, Servo, servo
from servogen.robot.servo_models import servo_model
from servogen.twin.drive import drive_of
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


@pytest.mark.parametrize(("name", "volts"), DATA_SHEETS)
def test_the_constants_give_speed_torque_and_current_of_the_data_sheet(name: str, volts: float) -> None:
    speed, torque, current = DATA_SHEETS[name, volts]
    drive = drive_of(of(name, volts))
    assert drive.no_load_speed == pytest.approx(speed, rel=0.01)
    assert drive.stall_torque == pytest.approx(torque, rel=0.01)
    if current is not None:
        assert drive.stall_current == pytest.approx(current, rel=0.01)
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
    drive = drive_of(of("futaba-s3001", motor=Motor(no_load_a=0.1)))
    assert drive.friction == pytest.approx(0.05556, rel=1e-3)
    assert drive.speed_constant == pytest.approx(2.2921, rel=1e-3)
    assert drive.no_load_speed == pytest.approx(1.8)
    assert drive.stall_torque == pytest.approx(0.34)


def test_assumptions_are_named_and_stated_facts_are_not() -> None:
    said = " ".join(drive_of(of("mpx-tiny-s")).assumptions)
    assert "efficiency = 0.66" in said and "1.03 A" in said
    motor = Motor(1.0, 0.05, None, 2.0, 5.0, 0.1, 0.01, 0.0)
    stated = drive_of(of("mpx-tiny-s", motor=motor, idle_a=0.01, max_a=None))
    assert stated.assumptions == ()


@pytest.mark.parametrize(
    ("facts", "text"),
    [
        ({"torque_nm": None}, "states no torque_ncm"),
        ({"speed": None}, "states no speed_deg_s"),
        ({"max_a": 0.1}, "more power than the motor takes"),
        ({"motor": Motor(stall_a=0.1, no_load_a=0.2)}, "not above that at full speed"),
        ({"motor": Motor(start_s=0.001)}, "too fast"),
    ],
)
def test_facts_that_no_motor_can_have_are_refused(facts: dict[str, object], text: str) -> None:
    with pytest.raises(InputError, match=text):
        drive_of(of("futaba-s3001" if "max_a" in facts else "mpx-tiny-s", **facts))


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
