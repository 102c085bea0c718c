"""What a servo's electronics do with pulses: each has its own width, a dead band, and they may stop."""

import math
from fractions import Fraction

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from servogen.edges import HIGH, LOW, PINS, EdgeChunk
from servogen.robot.servo import Servo
from servogen.twin.drive import servo_drive
from servogen.twin.pulses import PulseReceiver, ReceivedPulse
from servogen.twin.world import World
from servogen.units import Clock
from tests.twin.bench import world_of
from tests.twin.test_drive import of

CLOCK = Clock(4_000_000)  # cycles of 1 µs
RB0, RB1 = PINS.index("RB0"), PINS.index("RB1")
EDGES = [
    (100, RB0, HIGH),
    (200, RB1, HIGH),
    (1600, RB0, LOW),
    (2000, RB1, LOW),
    (20_100, RB0, HIGH),
    (21_601, RB0, LOW),
]


def chunk(edges: list[tuple[int, int, int]]) -> EdgeChunk:
    return EdgeChunk(*(np.array(column) for column in zip(*edges, strict=True)))


@pytest.fixture(scope="module")
def tiny() -> Servo:
    return of("mpx-tiny-s", 4.8)


def turned(world: World, steps: int) -> float:
    """Return the shaft's angle after steps of a millisecond."""
    for _ in range(steps):
        world.advance()
    return float(world.data.qpos[0])


@pytest.mark.parametrize("cut", range(1, len(EDGES)))
def test_each_pulse_has_its_own_width_from_the_step_after_its_falling_edge(cut: int) -> None:
    receiver = PulseReceiver([PINS.index("RB0"), PINS.index("RB1")], CLOCK, Fraction(1, 1000))
    found = receiver.pulses(chunk(EDGES[:cut])) + receiver.pulses(chunk(EDGES[cut:]))
    assert found == [ReceivedPulse(2, 0, 1500.0), ReceivedPulse(2, 1, 1800.0), ReceivedPulse(22, 0, 1501.0)]


def test_each_width_is_a_new_target(tiny: Servo) -> None:
    world = world_of(tiny, 1e3)
    for angle in (0.3, -0.2, 0.25):
        world.pulse(ReceivedPulse(world.step, 0, angle))
        assert turned(world, 80) == pytest.approx(angle, abs=1.1 * servo_drive(tiny).dead_band)


def test_within_its_dead_band_a_servo_stays(tiny: Servo) -> None:
    band = servo_drive(tiny).dead_band
    assert math.degrees(band) == pytest.approx(0.72)  # 2 µs, where 500 µs are 180°
    world = world_of(tiny, 1e3)
    world.pulse(ReceivedPulse(0, 0, 0.99 * band))
    assert turned(world, 80) == 0
    world.pulse(ReceivedPulse(world.step, 0, 1.5 * band))
    assert turned(world, 80) > 0.4 * band


def test_a_servo_that_turns_round_loses_the_dead_band_on_both_sides(tiny: Servo) -> None:
    """It is led up and back in steps of 0.4 dead bands, one with each pulse."""
    band = servo_drive(tiny).dead_band
    world, command = world_of(tiny, 1e3), 0.0

    def led(step: float) -> float:
        nonlocal command
        command += step * band
        world.pulse(ReceivedPulse(world.step, 0, command))
        return turned(world, 20)

    for _ in range(30):
        led(0.4)
    top = turned(world, 60)
    assert 0.9 < (command - top) / band <= 1  # it stops on the side from which it comes
    back = [led(-0.4) for _ in range(8)]
    assert back[:4] == pytest.approx([top] * 4, abs=0.01 * band)  # 1.6 dead bands of command
    assert back[7] < top - band  # 3.2


def test_without_pulses_the_motor_is_open_after_its_time_and_the_next_pulse_drives_it_again(
    tiny: Servo,
) -> None:
    lost_ms = round(1000 * servo_drive(tiny).lost_s)
    world = world_of(tiny, 1e3)
    world.pulse(ReceivedPulse(0, 0, 500.0))
    turned(world, lost_ms)
    assert world.duty[0] == 1 and world.current > 0
    turned(world, 2)
    idle = servo_drive(tiny).idle_a
    assert world.duty[0] == 0 and world.current == pytest.approx(idle)
    assert float(world.data.actuator_force[0]) == 0
    here = turned(world, 100)
    assert here > 0.5  # the disc turns on: nothing brakes it
    world.pulse(ReceivedPulse(world.step, 0, 0.0))
    turned(world, 1)
    assert world.duty[0] == -1
