"""What a job becomes, value by value, and what its keys exclude, at the last value on either side."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from servogen.engines.inputs.commands import CommandButton, CommandButtons, CommandLine
from servogen.errors import InputError, Location
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.job.job import Job
from servogen.job.reader import calibrated, changed
from servogen.job.tip import ArmTip, LegTip
from servogen.kinematics.forward import fk_position
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.plan_error import PlanError, plan_text
from servogen.robot.binding import Binding

JOBS = Path(__file__).parents[2] / "jobs"

HEAD = '[chip]\ndevice = "{device}"\nclock_hz = {clock}\n'
SERVO = '[[servo]]\nname = "{name}"\npin = "{pin}"\nmodel = "futaba-s3001"\n{more}\n'
ARM = SERVO.format(name="arm", pin="RB0", more="")
POSES = "[motion]\nposes = [{ arm_deg = 90, hold_s = 0.1 }]\n"


def job(
    more: str = "", servos: str = ARM, motion: str = POSES, device: str = "PIC16F84A", clock: int = 4_000_000
) -> Job:
    return loads(HEAD.format(device=device, clock=clock) + servos + motion + more, "folder/my job.toml")


def refusal(**parts: object) -> str:
    with pytest.raises(InputError) as caught:
        plan_job(job(**parts))  # type: ignore[arg-type]
    return str(caught.value).split(": error: ", 1)[1]


# ---- chip, frame, name ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("device", "limit"), [("PIC16F84", 10_000_000), ("PIC16F84A", 20_000_000)])
def test_a_chip_runs_up_to_its_data_sheet_s_clock(device: str, limit: int) -> None:
    """DS30430D: 10 MHz; DS35007C: 20 MHz."""
    assert job(device=device, clock=limit).clock.hz == limit
    said = refusal(device=device, clock=limit + 1)
    assert said.startswith(f"chip.clock_hz: {limit + 1} Hz is above the {device}'s limit of {limit} Hz")


def test_a_chip_runs_from_the_clock_of_a_watch() -> None:
    assert job(clock=32_000).clock.hz == 32_000
    assert "31999 Hz is slower than any crystal: at least 32000 Hz" in refusal(clock=31_999)


def test_a_frame_is_a_millisecond_at_least_and_whole_cycles() -> None:
    assert job("[frame]\nperiod_us = 1000\n").frame.period.cycles == 1000
    assert "999.999 µs is not longer than a pulse" in refusal(more="[frame]\nperiod_us = 999.999\n")
    frame = job(
        "[frame]\nperiod_us = 18000.4\ngap_us = 300\nslot_us = 2500.5\nper_slot = 3\nmax_together = 2\n"
    ).frame
    assert (frame.period.cycles, frame.gap_us, frame.slot_us) == (18_000, 300, Fraction("2500.5"))
    assert (frame.per_slot, frame.max_together) == (3, 2)
    plain = job().frame
    assert (plain.period.cycles, plain.gap_us, plain.slot_us, plain.per_slot, plain.max_together) == (
        *(20_000, 250, None, 1, None),
    )


def test_a_job_is_shown_with_its_servos_and_its_chip() -> None:
    found = job(
        servos=ARM + SERVO.format(name="leg", pin="RA1", more=""),
        motion=POSES.replace("arm_deg", "leg_deg = 9, arm_deg"),
    )
    assert repr(found) == "<Job my job: arm on RB0, leg on RA1; PIC16F84A at 4 MHz>"
    html = found._repr_html_()
    assert "<caption>my job: PIC16F84A at 4 MHz</caption>" in html
    assert html.count("<tr>") == 3
    assert "<td>leg</td><td>RA1</td>" in html
    assert (found.file, found.limbs, found.base, found.wheel_columns) == ("folder/my job.toml", (), None, [])
    assert repr(plan_job(found)).startswith("<PlannedJob my job: ")


@pytest.mark.parametrize("name", ["..toml", "a\x1fb.toml"])
def test_a_job_s_name_is_that_of_a_folder(name: str) -> None:
    text = HEAD.format(device="PIC16F84A", clock=4_000_000) + ARM + POSES
    if name == "..toml":
        assert loads(text, "a b.toml").name == "a b"
        return
    with pytest.raises(InputError, match="which cannot be a folder"):
        loads(text, name)


# ---- servos ---------------------------------------------------------------------------------------------


def test_a_servo_is_what_its_table_says() -> None:
    more = "trim_us = -7\nreverse = true\nmin_deg = 20\nmax_deg = 170\n"
    (servo,) = job(servos=SERVO.format(name="arm", pin="RB3", more=more)).servos
    assert (servo.name, servo.pin, servo.trim_us, servo.reverse) == ("arm", "RB3", -7, True)
    assert [math.degrees(limit) for limit in servo.limits] == pytest.approx([20, 170])
    (plain,) = job().servos
    assert (plain.trim_us, plain.reverse) == (0, False)
    (open_drain,) = job(servos=SERVO.format(name="arm", pin="RA4", more="open_drain = true")).servos
    assert open_drain.pin == "RA4"


def test_limits_are_refused_at_the_key_that_is_given() -> None:
    for key, value in (("min_deg", -5), ("max_deg", 185)):
        said = refusal(servos=SERVO.format(name="arm", pin="RB0", more=f"{key} = {value}"))
        assert said.startswith(f"servo[1].{key}: arm cannot have limits of")
    for key in ("joint", "min_deg", "max_deg"):
        value = '"q1"' if key == "joint" else "5"
        wheel = SERVO.format(name="arm", pin="RB0", more=f"{key} = {value}").replace(
            "futaba-s3001", "continuous"
        )
        assert f"servo[1].{key}: arm turns continuously: {key} needs a servo with angles" in refusal(
            servos=wheel
        )


def test_up_to_thirteen_pins_have_a_servo() -> None:
    pins = [*(f"RB{n}" for n in range(8)), *(f"RA{n}" for n in range(5))]
    servos = "".join(
        SERVO.format(name=f"s{i}", pin=pin, more="open_drain = true" if pin == "RA4" else "")
        for i, pin in enumerate(pins)
    )
    angles = ", ".join(f"s{i}_deg = 9" for i in range(13))
    found = job(servos=servos, motion=f"[motion]\nposes = [{{ {angles}, hold_s = 1 }}]\n")
    assert [servo.pin for servo in found.servos] == pins


# ---- firmware -------------------------------------------------------------------------------------------


def test_the_firmware_is_what_its_table_says() -> None:
    plain = job().firmware
    assert (plain.dialect, plain.engine, plain.soft_start_s, plain.max_error_us) == ("c2c", "auto", 1, 10)
    assert (job().inputs, job().buttons.any, job().commands, job().stream) == ((), False, None, None)
    own = job(
        '[firmware]\ndialect = "sdcc"\nengine = "player"\nsoft_start_s = 0.25\nmax_error_us = 3.5\n'
    ).firmware
    assert (own.dialect, own.engine, own.soft_start_s, own.max_error_us) == (
        "sdcc",
        "player",
        Fraction(1, 4),
        3.5,
    )


def test_a_button_is_pressed_at_its_level() -> None:
    for name in ["start", "stop"]:
        for level, number in [("", 0), ("low", 0), ("high", 1)]:
            text = f'[firmware]\n{name}_pin = "RA2"\n' + (f'{name}_level = "{level}"\n' if level else "")
            buttons = job(text).buttons
            button, other = (
                (buttons.start, buttons.stop) if name == "start" else (buttons.stop, buttons.start)
            )
            assert button is not None
            assert (button.pin, button.level, other, buttons.any) == ("RA2", number, None, True)


def test_a_stop_switches_the_pulses_off_unless_they_are_held() -> None:
    for pulses, off in [("", True), ('stop_pulses = "off"', True), ('stop_pulses = "hold"', False)]:
        assert job(f'[firmware]\nstop_pin = "RA2"\n{pulses}\n').buttons.off is off


def test_buttons_that_cannot_be_are_refused() -> None:
    for text, said in [
        ('start_level = "high"', "firmware.start_level: there is no start_pin"),
        ('stop_level = "high"', "firmware.stop_level: there is no stop_pin"),
        ('stop_pulses = "hold"', "firmware.stop_pulses: there is no stop_pin"),
        ('start_pin = "RB0"', "firmware.start_pin: RB0 is in use: arm"),
        ('start_pin = "RA0"\nstop_pin = "RA0"', "firmware.stop_pin: RA0 is in use: start"),
        ('start_pin = "RB9"', "firmware.start_pin: unknown pin 'RB9'"),
        (
            'engine = "sequence"\nstop_pin = "RA0"',
            "firmware.stop_pin: the sequence engine does not read buttons",
        ),
        ('engine = "sequence"\n[stream]', "stream: the sequence engine does not read a serial line"),
    ]:
        assert said in refusal(more=f"[firmware]\n{text}\n")


def test_a_soft_start_counts_twice_towards_the_longest_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five frames of the pose, and twice 50 of the soft start of a second."""
    monkeypatch.setattr("servogen.job.plan.MAX_FRAMES", 105)
    assert len(plan_job(job()).trajectory.angles) == 5
    monkeypatch.setattr("servogen.job.plan.MAX_FRAMES", 104)
    assert (
        "the motion and a soft start of 1 s are 105 frames long [too-many-frames]\n"
        "  at most 104 frames, 2.08 s" in refusal()
    )


# ---- a walk on command ----------------------------------------------------------------------------------


@cache
def hexapod_servos() -> str:
    pins = [*(f"RB{n}" for n in range(8)), *(f"RA{n}" for n in range(4))]
    names = [f"{leg}_{joint}" for leg in ("L1", "L2", "L3", "R1", "R2", "R3") for joint in ("alpha", "beta")]
    return "".join(
        SERVO.format(name=f"s{i}", pin=pin, more=f'joint = "{name}"')
        for i, (pin, name) in enumerate(zip(pins, names, strict=True))
    )


def commanded(commands: str, more: str = "") -> Job:
    motion = f'[robot]\nname = "hexapod"\n[walk]\ncommands = {{ {commands} }}\n'
    return job(more, servos=hexapod_servos(), motion=motion)


def test_commands_are_read_from_a_line_or_from_buttons() -> None:
    line = commanded("forward_mm = 30").commands
    assert line == CommandLine("RA4")
    one = commanded('forward_mm = 30, button = "RA4", button_level = "high"').commands
    assert isinstance(one, CommandButton)
    assert (one.button.pin, one.button.level) == ("RA4", 1)
    low = commanded('forward_mm = 30, button = "RA4"').commands
    assert isinstance(low, CommandButton)
    assert low.button.level == 0
    for level, number in (("", 0), (', button_level = "high"', 1)):
        several = commanded(f'turn_deg = 9, buttons = {{ left = "RA4" }}{level}').commands
        assert isinstance(several, CommandButtons)
        assert {name: (button.pin, button.level) for name, button in several.buttons.items()} == {
            "left": ("RA4", number)
        }


def test_commands_that_cannot_be_are_refused() -> None:
    for commands, more, said in [
        ('forward_mm = 30, pin = "RA4", button = "RA4"', "", "pin: a walk has either pin or button"),
        (
            'forward_mm = 30, pin = "RA4", buttons = { forward = "RA4" }',
            "",
            "a walk has either pin or buttons",
        ),
        ('forward_mm = 30, button = "RA4", buttons = { forward = "RA4" }', "", "either buttons or button"),
        ('forward_mm = 30, button_level = "low"', "", "walk.commands.button_level: there are no buttons"),
        ('forward_mm = 30, pin = "RB0"', "", "walk.commands.pin: RB0 is in use: s0"),
        ('forward_mm = 30, button = "RB7"', "", "walk.commands.button: RB7 is in use: s7"),
        ('forward_mm = 30, pin = "RA9"', "", "walk.commands.pin: unknown pin 'RA9'"),
        (
            'forward_mm = 30, buttons = { forward = "RA4", left = "RB0" }',
            "",
            "left: left has a button but no step",
        ),
        (
            'forward_mm = 30, turn_deg = 9, buttons = { left = "RA4" }',
            "",
            "forward_mm: neither forward nor back",
        ),
        (
            'forward_mm = 30, buttons = { forward = "RA4", back = "RA4" }',
            "",
            "RA4 is in use: the button of forward",
        ),
        ("forward_mm = 30, buttons = {}", "", "walk.commands.buttons: no direction has a button"),
        ("forward_mm = 30", '[firmware]\nstart_pin = "RA4"', "commands: a walk on command has no start_pin"),
        ("forward_mm = 30", '[firmware]\nengine = "sequence"', "commands: the sequence engine does not read"),
    ]:
        with pytest.raises(InputError) as caught:
            commanded(commands, more)
        assert said in str(caught.value)


# ---- sensors, sections ----------------------------------------------------------------------------------

SCARA = "".join(
    SERVO.format(
        name=f"s{i}",
        pin=f"RB{i}",
        more=f'joint = "q{i + 1}"\n' + ("deg_per_mm = 0.5" if i == 2 else "ratio = 0.5"),
    )
    for i in range(4)
)
SCARA_POSES = """[robot]
name = "scara"
[motion]
poses = [{ s0_deg = 90, s1_deg = 90, s2_deg = 120, s3_deg = 90, hold_s = 1 }]
"""


def test_a_sensor_needs_what_it_senses() -> None:
    for sensor, said in [
        ('kind = "end-stop"\nof = "q1"\nat_deg = 5', None),
        ('kind = "end-stop"\nof = "q3"\nat_mm = 5', None),
        ('kind = "stall"\nabove_a = 1', None),
        ('kind = "end-stop"\nof = "q1"', "sensor[1]: an end stop needs its position"),
        ('kind = "end-stop"\nof = "q1"\nat_deg = 5\nat_mm = 5', "sensor[1]: an end stop needs its position"),
        ('kind = "end-stop"\nof = "q9"\nat_deg = 5', "sensor[1].of: the robot has no joint 'q9'"),
        ('kind = "end-stop"\nat_deg = 5', "sensor[1].of: it does not state which joint it watches"),
        ('kind = "foot"\nof = "L1"', "sensor[1].of: the robot has no leg 'L1'"),
        ('kind = "foot"', "sensor[1].of: it does not state which leg it watches"),
        ('kind = "stall"', "sensor[1]: a stall comparator needs its current"),
    ]:
        text = f'[[sensor]]\npin = "RA0"\n{sensor}\n'
        if said is None:
            (found,) = job(text, servos=SCARA, motion=SCARA_POSES).sensors
            assert (found.pin, found.level) == ("RA0", "low")
        else:
            assert said in refusal(more=text, servos=SCARA, motion=SCARA_POSES)


def test_a_sensor_needs_a_pin_of_its_own() -> None:
    stall = '[[sensor]]\npin = "{}"\nkind = "stall"\nabove_a = 1\n'
    assert "sensor[1].pin: RB0 is in use: arm" in refusal(more=stall.format("RB0"))
    assert "sensor[1].pin: unknown pin 'RC0'" in refusal(more=stall.format("RC0"))
    assert "sensor[2].pin: RA1 is in use: sensor[1]" in refusal(more=stall.format("RA1") * 2)


def test_a_job_has_one_section_that_moves_and_an_end_if_it_ends() -> None:
    assert "a job has one of [motion], [walk], [program], [drive] [job-sections]\n  add [motion]" in refusal(
        motion=""
    )
    for end, repeat, fits in (("hold", "false", True), ("release", "false", True), ("hold", "true", False)):
        motion = POSES.replace("[motion]\n", f'[motion]\nrepeat = {repeat}\nend = "{end}"\n')
        if fits:
            assert plan_job(job(motion=motion)).trajectory.loop_start == 5
        else:
            assert "motion.end: a motion that repeats has no end" in refusal(motion=motion)


def test_values_of_a_job_can_be_changed_and_the_rest_stays() -> None:
    found = job(
        servos=ARM + SERVO.format(name="leg", pin="RB1", more=""),
        motion=POSES.replace("arm_deg", "leg_deg = 9, arm_deg"),
    )
    other = changed(
        found, {("servo", 1, "trim_us"): 5, ("frame", "period_us"): 18_000, ("chip", "clock_hz"): 8_000_000}
    )
    assert [servo.trim_us for servo in other.servos] == [0, 5]
    assert (other.clock.hz, other.frame.period.cycles) == (8_000_000, 36_000)
    assert other.document.data["motion"] == found.document.data["motion"]
    assert [servo.trim_us for servo in found.servos] == [0, 0]
    with pytest.raises(InputError, match="there is no calibration file"):
        calibrated(found, "leg", "gone.toml")


# ---- what the servos move -------------------------------------------------------------------------------


def test_joints_are_bound_in_radians_and_metres() -> None:
    found = job(servos=SCARA, motion=SCARA_POSES)
    quarter = math.pi / 2
    assert found.bindings == (
        Binding("q1", "s0", quarter, 0.5),
        Binding("q2", "s1", quarter, 0.5),
        Binding("q3", "s2", quarter, pytest.approx(math.radians(500))),
        Binding("q4", "s3", quarter, 0.5),
    )
    assert isinstance(found.tip, ArmTip)
    assert (found.tip.key, found.tip.limb.name) == ("tip_mm", "tool")
    angles = np.array([[quarter + 0.1, quarter, quarter + math.radians(50), quarter]])
    assert found.tip.where(angles)[0] == pytest.approx(fk_position(found.tip.arm, [0.2, 0.0, 0.1, 0.0]))
    zero = job(servos=SCARA.replace('joint = "q1"', 'joint = "q1"\nzero_deg = 30'), motion=SCARA_POSES)
    assert zero.bindings[0].zero == pytest.approx(math.radians(30))


LEG = """[leg]
ab_mm = 25
bc_mm = 40
cd_mm = {cd}
df_mm = 60
alpha = "arm"
beta = "hand"
{more}
"""
TWO = ARM + SERVO.format(name="hand", pin="RB1", more="")
BOTH = "[motion]\nposes = [{ arm_deg = 90, hand_deg = 90, hold_s = 0.1 }]\n"


def leg(more: str = "", cd: float = 40) -> LegTip:
    found = job(LEG.format(more=more, cd=cd), servos=TWO, motion=BOTH).tip
    assert isinstance(found, LegTip)
    return found


def test_a_leg_has_its_lengths_in_metres_and_its_zeros_in_radians() -> None:
    found = leg()
    assert (found.leg.ab, found.leg.bc, found.leg.cd, found.leg.df) == (0.025, 0.04, 0.04, 0.06)
    assert [binding.zero for binding in found.bindings] == pytest.approx([math.pi / 2] * 2)
    assert (found.key, found.beta_sign, found.tolerance, found.limb.end) == ("foot_mm", 0, 0.0005, "foot")
    own = leg("alpha_zero_deg = 80\nbeta_zero_deg = 100\ntolerance_mm = 2")
    assert [math.degrees(binding.zero) for binding in own.bindings] == pytest.approx([80, 100])
    assert own.tolerance == 0.002
    assert [leg(f'beta_sign = "{sign}"').beta_sign for sign in ("positive", "negative", "nearest")] == [
        1,
        -1,
        0,
    ]
    assert leg(cd=0).leg.cd == 0
    text = LEG.format(more="", cd=0).replace("ab_mm = 25", "ab_mm = 0")
    assert "leg.cd_mm: ab_mm and cd_mm are both 0" in refusal(more=text, servos=TWO, motion=BOTH)


def test_a_foot_may_be_off_its_surface_by_the_tolerance() -> None:
    for off_mm, fits in [(0.0, True), (0.49, True), (-0.49, True), (0.51, False), (-0.51, False)]:
        tip = leg()
        before, place = np.full(2, math.pi / 2), Location("x")
        # at β = 0 the surface's lowest circle: a point straight below it is off by its height
        foot = tip.leg.fk(0.2, 0.0) - np.array([0.0, 0.0, abs(off_mm) / 1000])
        nearest = tip.leg.nearest(foot)
        assert np.linalg.norm(foot - nearest) == pytest.approx(abs(off_mm) / 1000, abs=1e-8)
        if fits:
            angles = tip.choices(foot, None, before, place)
            assert tip.where(angles)[0] == pytest.approx(nearest, abs=1e-6)
        else:
            with pytest.raises(Unreachable, match="cannot be reached"):
                tip.choices(foot, None, before, place)
        both = tip.solutions(np.array([foot]), np.zeros(1), None, before[None])
        assert np.isnan(both).all() != fits


def test_the_solutions_of_a_leg_have_the_asked_sign_and_the_nearest_is_first() -> None:
    for sign, betas in [("nearest", [-0.6, 0.6]), ("positive", [0.6]), ("negative", [-0.6])]:
        tip = leg(f'beta_sign = "{sign}"')
        foot = tip.leg.fk(0.1, 0.6)
        for before in (-0.6, 0.6):
            found = tip.choices(foot, None, np.array([0.1, before]) + math.pi / 2, Location("x"))
            assert sorted(round(float(row[1]) - math.pi / 2, 6) for row in found) == betas
            first = float(found[0][1]) - math.pi / 2
            assert first == pytest.approx(before if before in betas else betas[0])


def test_solutions_beyond_the_servos_travel_are_left_out() -> None:
    narrow = SERVO.format(name="hand", pin="RB1", more="min_deg = 90")
    found = job(LEG.format(more="", cd=40), servos=ARM + narrow, motion=BOTH).tip
    assert isinstance(found, LegTip)
    foot = found.leg.fk(0.1, 0.6)
    (only,) = found.choices(foot, None, np.full(2, math.pi / 2), Location("x"))
    assert float(only[1]) > math.pi / 2
    stuck = SERVO.format(name="hand", pin="RB1", more="min_deg = 88\nmax_deg = 92")
    other = job(LEG.format(more="", cd=40), servos=ARM + stuck, motion=BOTH).tip
    assert other is not None
    with pytest.raises(
        InputError, match=r"needs angles outside the servos' travel: arm .*°, hand .*° or arm"
    ):
        other.choices(foot, None, np.full(2, math.pi / 2), Location("x"))


def test_speeds_of_servos_and_joints_limit_each_other() -> None:
    """An S3001 turns at 1.8 rad/s; at a ratio of 1/2 its joint at 3.6 rad/s, unless the joint is slower."""
    poses = SCARA_POSES.replace("hold_s = 1 }", "hold_s = 1 }, { s0_deg = 130, hold_s = 1, law = 'linear' }")
    planned = plan_job(job(servos=SCARA, motion=poses))
    own = planned.servos[0]
    assert own.model.speed == 1.8
    fastest = np.abs(np.diff(planned.trajectory.angles[:, 0])).max() / 0.02
    joint = planned.tip.limb.arm.joints[0] if planned.tip else None
    assert joint is not None
    limit = min(1.8, (joint.speed or math.inf) * 0.5)
    assert 0.9 * limit < fastest <= limit * (1 + 1e-9)


# ---- the plan's error -----------------------------------------------------------------------------------


def test_the_distance_from_a_plan_in_words() -> None:
    for error, text in [
        (PlanError(0.25), "0.25 µs"),
        (PlanError(19.008, 6.843, end="foot L1", end_mm=7.223), "19.008 µs, 6.843°, 7.223 mm at the foot L1"),
        (PlanError(1.0, None, 1.5, "base", 2.0), "1 µs, 1.5°/s, 2 mm at the base"),
        (PlanError(0.0, 0.0, 0.0), "0 µs, 0°, 0°/s"),
    ]:
        assert error.text() == text
        assert plan_text(error) == f"the schedule is within {text} of the plan"
        assert plan_text(None) == "no plan to compare with"
        assert list(error.to_json().values()) == [
            error.width_us,
            error.angle_deg,
            error.speed_deg_s,
            error.end,
            error.end_mm,
        ]


def test_jobs_on_wheels_name_their_base() -> None:
    found = load(JOBS / "omni-square.toml")
    assert found.base is found.robot
    assert found.wheel_columns == [
        [servo.name for servo in found.servos].index(wheel) for wheel in found.wheels
    ]
    assert isinstance(replace(plan_job(job())), PlannedJob)
