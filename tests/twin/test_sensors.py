"""Sensors in lock-step: firmware of one leg that stops lowering its foot when the foot switch closes."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.simulator import Levels, Stimuli
from servogen.twin import Ground, TwinSettings, TwinVerdict, run
from servogen.twin.bodies import bodies
from servogen.twin.run import standing
from servogen.workflows.twinning import twin_of

ROBOT = """
name = "one-leg"
kind = "hexapod"
like = "hexapod"
mount = [{ name = "L2", x_mm = 0, y_mm = 50 }]
"""

JOB = """
[chip]
device = "PIC16F84A"
clock_hz = 4_000_000

[robot]
name = "one.toml"

[[servo]]
name = "turn"
pin = "RB0"
model = "mpx-tiny-s"
joint = "L2_alpha"

[[servo]]
name = "lift"
pin = "RB1"
model = "mpx-tiny-s"
joint = "L2_beta"

[[sensor]]
pin = "RA0"
kind = "foot"
of = "L2"

[motion]
repeat = false
poses = [{ turn_deg = 90, lift_deg = 45, hold_s = 1 }, { lift_deg = 90, hold_s = 1 }]
"""

FIRMWARE = """
#pragma CLOCK_FREQ 4000000
/* Lowers the foot a little in every fourth frame, until the foot switch pulls RA0 to ground. */
char width;
char frame;
char i;
void pulse(void) { for (i = 0; i < width; i++) delay_us(5); }
void main(void)
{
    set_bit(STATUS, RP0);
    set_tris_a(0xFF);
    set_tris_b(0x00);
    clear_bit(STATUS, RP0);
    output_port_b(0);
    width = 0;
    frame = 0;
    while (1)
    {
        output_port_b(1); delay_ms(1); delay_us(250); delay_us(250); output_port_b(0);
        output_port_b(2); delay_ms(1); delay_us(250); delay_us(125); pulse(); output_port_b(0);
        delay_ms(17);
        frame++;
        if ((frame & 3) == 0 && (input_port_a() & 1) && width < 9) width++;
    }
}
"""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("leg")
    (folder / "one.toml").write_text(ROBOT)
    (folder / "leg.c").write_text(FIRMWARE)
    return folder


def lowered(bench: Path, ground: Ground, stimuli: Stimuli | None = None, sensor: bool = True) -> TwinVerdict:
    text = JOB if sensor else JOB.replace(JOB[JOB.index("[[sensor]]") : JOB.index("[motion]")], "")
    job = plan_job(loads(text, str(bench / "leg.toml")))
    return twin_of(job, TwinSettings(ground, seconds=1.2), bench / "leg.c", stimuli)


def test_the_switch_ends_the_lowering_early_in_the_pins_and_in_the_motion(bench: Path) -> None:
    """On a step of 10 mm the foot is stopped 10 mm higher than on the floor, and the pulses stay."""
    floor, step = lowered(bench, Ground()).record, lowered(bench, ON_A_STEP).record
    assert step.feet[-1, 0, 2] == pytest.approx(0.010, abs=0.0005)
    assert floor.feet[-1, 0, 2] < 0.004
    closed = [change for change in step.changes if change.level == 0]
    assert closed and closed[0].pin == 0
    first, last = closed[0].cycle / 1e6, closed[-1].cycle / 1e6  # the foot bounces
    later = step.time > last + 0.045
    assert np.ptp(step.target[later, 1]) == 0.0  # the firmware has seen the pin in the frame after
    assert np.nanmax(step.target[:, 1]) < np.nanmax(floor.target[:, 1])
    before = (step.time > 0.06) & (step.time < first)
    assert np.ptp(step.target[before, 1]) > 0


def test_without_the_switch_the_foot_is_pressed_on(bench: Path) -> None:
    """The pin is held high from a script, as a broken wire would."""
    high = Stimuli([Levels(0, ((0, 1),))])
    pressed = lowered(bench, ON_A_STEP, high, sensor=False).record
    stopped = lowered(bench, ON_A_STEP).record
    assert pressed.target[-1, 1] == pytest.approx(lowered(bench, Ground()).record.target[-1, 1])
    assert pressed.target[-1, 1] > stopped.target[-1, 1] + np.radians(20)


def test_lock_step_is_repeatable_and_reads_the_sensors_in_every_millisecond(
    bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    levels, read = run.TwinRun.set_levels, []

    def reading(made: run.TwinRun, step: int) -> None:
        read.append(step)
        levels(made, step)

    monkeypatch.setattr(run.TwinRun, "set_levels", reading)
    one, other = (lowered(bench, ON_A_STEP).record for _ in range(2))
    assert one.digest() == other.digest() and one.changes == other.changes
    assert read == [*range(1201), *range(1201)]


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('pin = "RA0"', 'pin = "RB1"', "RB1 is in use: lift"),
        ('pin = "RA0"', 'pin = "RC0"', "unknown pin 'RC0'"),
        ('of = "L2"', 'of = "L3"', "no leg 'L3'"),
        ('of = "L2"', "", "does not state which leg it watches"),
        ('kind = "foot"\nof = "L2"', 'kind = "end-stop"\nof = "L2_beta"', "an end stop needs its position"),
        ('kind = "foot"\nof = "L2"', 'kind = "stall"', "a stall comparator needs its current"),
    ],
)
def test_sensors_that_cannot_be_are_refused(bench: Path, old: str, new: str, text: str) -> None:
    with pytest.raises(InputError, match=text):
        loads(JOB.replace(old, new), str(bench / "leg.toml"))


def test_an_end_stop_and_a_stall_comparator_answer(bench: Path) -> None:
    extra = """
[[sensor]]
pin = "RA1"
kind = "end-stop"
of = "L2_beta"
at_deg = -40
level = "high"

[[sensor]]
pin = "RA2"
kind = "stall"
above_a = 0.3
"""
    job = plan_job(loads(JOB.replace("[motion]", extra + "[motion]"), str(bench / "leg.toml")))
    record = twin_of(job, TwinSettings(ON_A_STEP, seconds=1.2), bench / "leg.c").record
    beta = record.angle[:, 1] - record.rig.bindings[1].zero
    rises = [change.cycle / 1e6 for change in record.changes if change.pin == 1 and change.level == 1]
    passed = float(record.time[np.argmax(beta > np.radians(-40))])
    assert rises and rises[0] == pytest.approx(passed, abs=0.006)
    stalls = [change.cycle / 1e6 for change in record.changes if change.pin == 2 and change.level == 0]
    assert stalls and record.current.max() > 0.3


def test_a_robot_without_a_leg_for_the_switch_has_no_bodies_for_it() -> None:
    job = plan_job(loads(JOB.replace("one.toml", "hexapod"), "leg.toml"))
    assert "L2_touch" in bodies(job.robot).text  # type: ignore[arg-type]


def test_a_leg_on_the_bench_is_held_where_its_lowest_planned_foot_touches(bench: Path) -> None:
    """β is 0 with the lift servo at 90°: the foot is then l_BC + l_DF below the body."""
    job = plan_job(loads(JOB, str(bench / "leg.toml")))
    _, built, world = standing(job, TwinSettings())
    lengths = job.robot.leg.length  # type: ignore[union-attr]
    height = lengths["bc"] + lengths["df"]
    assert world.data.body("body").xpos == pytest.approx([0, 0, height], abs=1e-6)
    assert f"the body is held at {1000 * height:.4g} mm: it has too few legs to stand" in built.assumptions


ON_A_STEP = Ground(step=0.010, step_at=-1.0)
