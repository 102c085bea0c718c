"""Walks, drives and programs of a job: their units, their notes and warnings with numbers, their bounds."""

from __future__ import annotations

import math
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import Diagnostic, InputError
from servogen.job import PlannedJob, loads, plan_job
from servogen.kinematics.catalogue import arm, robot
from servogen.kinematics.hexapod import Hexapod
from servogen.kinematics.hexapod import feet as feet_of
from servogen.motion.trajectory import Part

HEAD = '[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n'
LEGS = ("L1", "L2", "L3", "R1", "R2", "R3")
PINS = [*(f"RB{n}" for n in range(8)), *(f"RA{n}" for n in range(4))]


@cache
def servos(more: str = "", legs: tuple[str, ...] = LEGS) -> str:
    names = [f"{leg}_{joint}" for leg in legs for joint in ("alpha", "beta")]
    return "".join(
        f'[[servo]]\nname = "s{i}"\npin = "{PINS[i]}"\nmodel = "mpx-tiny-s"\njoint = "{name}"\n{more}\n'
        for i, name in enumerate(names)
    )


def walk(text: str, robot: str = "hexapod", more: str = "", legs: tuple[str, ...] = LEGS) -> PlannedJob:
    frame = "[frame]\nper_slot = 2\n"
    return plan_job(
        loads(f'{HEAD}{servos(more, legs)}[robot]\nname = "{robot}"\n[walk]\n{text}\n{frame}', "job.toml")
    )


def notes(planned: PlannedJob, code: str) -> list[str]:
    return [note.message for note in planned.notes if note.code == code]


@cache
def straight() -> PlannedJob:
    return walk("body_height_mm = 130\ncycle_s = 0.541\nroute = [{ forward_mm = 30, cycles = 2 }]")


# ---- walks ----------------------------------------------------------------------------------------------


def feet(planned: PlannedJob) -> np.ndarray:
    """The feet (frames, legs, 3) in mm in the body frame, from the servos' angles."""
    found = planned.robot
    assert isinstance(found, Hexapod)
    angles = planned.trajectory.angles - math.pi / 2
    return 1000 * feet_of(found, angles.reshape(len(angles), len(found.mounts), 2))


def test_the_keys_of_a_walk_are_millimetres_seconds_and_degrees() -> None:
    planned = straight()
    heights = feet(planned)[:, :, 2]
    assert heights.min() == pytest.approx(-130, abs=1e-6)
    assert heights.max() == pytest.approx(-110, abs=1e-6)
    assert notes(planned, "cycle") == ["a cycle takes 28 frames, 0.56 s"]  # of 20 ms, an even number
    assert notes(planned, "lift") == ["the feet rise 20.0 mm"]
    assert planned.parts == (Part("segment 1 (forward_mm = 30)", 0),)
    lower = walk(
        "body_height_mm = 120\nlift_mm = 12.5\ncycle_s = 0.56\nroute = [{ turn_deg = 5, cycles = 1 }]"
    )
    assert np.ptp(feet(lower)[:, :, 2]) == pytest.approx(12.5, abs=1e-6)
    wide = walk("body_height_mm = 130\nstance_width_mm = 230\ncycle_s = 0.5\nroute = [{ cycles = 1 }]")
    assert wide.parts == (Part("segment 1 (standing)", 0),)
    assert notes(wide, "spring") != notes(planned, "spring")


def test_a_turn_is_noted_with_its_centre_and_a_straight_walk_is_not() -> None:
    """3 cm ahead while turning 0.1 rad: the centre is 300 mm to the left."""
    turned = walk(
        "body_height_mm = 130\ncycle_s = 0.5\nroute = [{ forward_mm = 20, cycles = 1 }, "
        f"{{ forward_mm = 30, turn_deg = {math.degrees(0.1):.9f}, cycles = 1 }}]"
    )
    assert notes(turned, "turn") == ["segment 2: the body turns about (0.0, 300.0) mm in its own frame"]
    assert [part.name for part in turned.parts] == [
        "segment 1 (forward_mm = 20)",
        "segment 2 (forward_mm = 30, turn_deg = 5.72958)",
    ]
    assert notes(straight(), "turn") == []


def test_the_stability_of_a_walk_is_noted_with_its_sign() -> None:
    (text,) = notes(straight(), "stability")
    margin = float(text.removeprefix("the centre of mass is always ").removesuffix(" mm inside the feet"))
    assert margin > 0
    # the legs of a side step together
    falling = walk(
        "allow_falling = true\nduty = 0.5\nlifts = { L1 = 0, L2 = 0, L3 = 0, R1 = 0.5, R2 = 0.5, R3 = 0.5 }\n"
        "cycle_s = 0.64\nbody_height_mm = 130\nroute = [{ forward_mm = 20, cycles = 1 }]"
    )
    assert notes(falling, "stability")[0].startswith("the robot falls: ")
    one = walk(
        'leg = "L2"\nbody_height_mm = 130\ncycle_s = 0.5\nroute = [{ forward_mm = 30, cycles = 1 }]',
        legs=("L2",),
    )
    assert notes(one, "stability") == []


@pytest.mark.parametrize(("end", "released"), [("hold", False), ("release", True)])
def test_a_walk_that_does_not_repeat_ends_standing_or_released(end: str, released: bool) -> None:
    planned = walk(
        f'body_height_mm = 130\ncycle_s = 0.5\nrepeat = false\nend = "{end}"\n'
        "route = [{ forward_mm = 30, cycles = 1 }]"
    )
    angles = planned.trajectory.angles
    assert planned.trajectory.loop_start == len(angles) - 1
    assert np.isnan(angles[-1]).all() == released
    assert released or (angles[-1] == angles[-2]).all()


def test_a_cycle_is_the_time_asked_for_rounded_up() -> None:
    for asked, frames in (("0.52", 26), ("0.5201", 28), ("0.48", 24)):
        planned = walk(
            f"body_height_mm = 130\ncycle_s = {asked}\nroute = [{{ forward_mm = 10, cycles = 1 }}]"
        )
        assert notes(planned, "cycle")[0].startswith(f"a cycle takes {frames} frames")


def test_without_a_time_the_slowest_of_all_servos_sets_the_cycle() -> None:
    route = "body_height_mm = 130\ncompensate = false\nroute = [{ forward_mm = 30, cycles = 1 }]"
    fast, slow = walk(route), walk(route, more="speed_deg_s = 200")
    first, second = (int(notes(each, "cycle")[0].split()[3]) for each in (fast, slow))
    assert second > first
    moved = np.abs(np.diff(slow.trajectory.angles, axis=0)).max() / 0.02
    assert 0.8 < moved / math.radians(200) <= 1 + 1e-9
    # a servo that turns 5/4 as far as its joint leaves the joint 4/5 of its speed
    geared = walk(route, more="speed_deg_s = 250\nratio = 1.25\nzero_deg = 90")
    assert notes(geared, "cycle") == notes(slow, "cycle")


def test_the_fastest_walk_names_the_servo_that_sets_its_cycle() -> None:
    """One servo of twelve is slow: a cycle of one grain of frames less is too fast for it."""

    def planned(time: str) -> PlannedJob:
        slow = servos().replace('joint = "L2_beta"', 'joint = "L2_beta"\nspeed_deg_s = 100')
        walk = f"[walk]\nbody_height_mm = 130\n{time}\nroute = [{{ forward_mm = 30, cycles = 1 }}]\n"
        return plan_job(loads(f'{HEAD}{slow}[robot]\nname = "hexapod"\n{walk}', "job.toml"))

    def speed(job: PlannedJob) -> float:
        column = job.trajectory.angles[:, job.trajectory.joints.index("s3")]
        return math.degrees(np.abs(np.diff(column)).max()) / 0.02

    fastest = planned('law = "fastest"')
    (said,) = notes(fastest, "cycle")
    assert said.endswith(f", the shortest, because of s3: it is at {speed(fastest):.0f} % of its speed")
    assert notes(planned(""), "cycle") == [said]
    assert speed(fastest) <= 100 < speed(planned(f"cycle_s = {0.02 * (int(said.split()[3]) - 2):g}"))


def test_the_fastest_walk_has_no_time_of_its_own() -> None:
    with pytest.raises(InputError, match='law = "fastest" finds the time of a cycle itself'):
        walk('law = "fastest"\ncycle_s = 1\nroute = [{ forward_mm = 30, cycles = 1 }]')


def test_lost_motion_is_the_servo_s_over_its_ratio_and_said_to_be_assumed() -> None:
    """Tiny-S: a dead band of 2 µs on both sides at 0.36° per µs; with a ratio of 1.25 four fifths of that."""
    route = "body_height_mm = 130\ncycle_s = 1\nroute = [{ forward_mm = 30, cycles = 1 }]"
    (text,) = notes(walk(route), "lost-motion")
    assert "lost motion of 1.44°" in text
    assert text.endswith(" (assumed: dead_band_us)")
    (text,) = notes(walk(route, more="ratio = 1.25"), "lost-motion")
    assert "lost motion of 1.15°" in text
    (text,) = notes(walk(route, more="ratio = -1.25"), "lost-motion")
    assert "lost motion of 1.15°" in text
    assert notes(walk(f"compensate = false\n{route}"), "lost-motion") == []


HEAVY = 'name = "heavy"\nkind = "hexapod"\nlike = "hexapod"\nmass_g = {mass}\n'


def test_a_servo_that_cannot_carry_the_robot_is_warned_of_with_its_ratio(tmp_path: Path) -> None:
    """A servo that turns 0.8 of its joint's angle needs 1/0.8 of its torque."""

    def warnings(mass: int, ratio: float) -> list[Diagnostic]:
        (tmp_path / "heavy.toml").write_text(HEAVY.format(mass=mass))
        text = servos(f"ratio = {ratio}") + '[robot]\nname = "heavy.toml"\n[walk]\nbody_height_mm = 110\n'
        text += "cycle_s = 1\nroute = [{ forward_mm = 10, cycles = 1 }]\n[frame]\nper_slot = 2\n"
        planned = plan_job(loads(HEAD + text, str(tmp_path / "job.toml")))
        return [each for each in planned.warnings if each.code == "too-heavy"]

    def needed(found: list[Diagnostic]) -> float:
        return float(found[0].message.split(" needs ")[1].split()[0])

    plain, geared = warnings(4000, 1.0), warnings(4000, 0.8)
    assert plain[0].message.startswith("s")
    assert needed(geared) == pytest.approx(needed(plain) / 0.8, abs=0.01)
    assert needed(warnings(4000, -0.8)) == pytest.approx(needed(plain) / 0.8, abs=0.01)
    assert warnings(100, 1.0) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "walk: a walk needs a route"),
        ("route = [{ forward_mm = 9 }]\nrepeat = false",
            "walk.repeat: a route whose last segment has no cycles"),
        ("lifts = { L1 = 0 }\nroute = [{ cycles = 1 }]",
            "walk.lifts: a custom gait also needs a duty factor"),
        ("duty = 0.5\nroute = [{ cycles = 1 }]", "walk.duty: a custom gait also needs the phase of each leg"),
        ('leg = "L7"\nroute = [{ cycles = 1 }]', "walk.leg: hexapod has no leg 'L7'"),
        ("commands = { forward_mm = 9 }\nroute = [{ cycles = 1 }]",
            "walk.route: a walk on command has no route"),
        ("commands = { pin = 'RA4' }", "walk.commands: the walk has no direction"),
    ],
)  # fmt: skip
def test_a_walk_that_cannot_be_is_refused(text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        walk(text)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("leg", "legs", "message"),
    [
        ("", LEGS[:5],
            "no servo turns the joint 'R3_alpha' [joint-binding]\n  add joint = \"R3_alpha\" to a servo"),
        ('leg = "L2"\n', ("L3",),
            "no servo turns the joint 'L2_alpha' [joint-binding]\n  add joint = \"L2_alpha\" to a servo"),
        ('leg = "L2"\n', ("L2", "L3"),
            "the motion does not move a joint 'L3_alpha' [unknown-joint]\n  did you mean 'L2_alpha'?"),
    ],
)  # fmt: skip
def test_the_servos_of_a_walk_are_those_of_its_legs(leg: str, legs: tuple[str, ...], message: str) -> None:
    line = len((HEAD + servos("", legs) + "[robot]\nname\n").splitlines()) + 1
    with pytest.raises(InputError) as caught:
        walk(f"{leg}body_height_mm = 130\ncycle_s = 0.5\nroute = [{{ cycles = 1 }}]", legs=legs)
    assert str(caught.value) == f"job.toml:{line}:1: error: walk: {message}"


def test_a_walk_on_command_that_no_walk_of_whole_cycles_stops_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One cycle is enough for this gait; none is not."""
    text = 'leg = "L2"\nbody_height_mm = 130\ncycle_s = 0.48\ncommands = { forward_mm = 20 }'
    monkeypatch.setattr("servogen.job.walks.MAX_COMMANDED_CYCLES", 2)
    assert len(walk(text, legs=("L2",)).directions) == 2
    monkeypatch.setattr("servogen.job.walks.MAX_COMMANDED_CYCLES", 1)
    line = len((HEAD + servos("", ("L2",)) + "[robot]\nname\n[walk]\n" + text).splitlines())
    with pytest.raises(InputError) as caught:
        walk(text, legs=("L2",))
    assert str(caught.value) == (
        f"job.toml:{line}:1: error: walk.commands: the walk cannot be stopped: its gait leaves a leg behind "
        "[endless-motion]"
    )


def test_a_walk_on_command_has_two_directions_for_each_step_and_notes_their_frames() -> None:
    planned = walk(
        "body_height_mm = 130\ncycle_s = 0.48\ncompensate = false\n"
        "commands = { forward_mm = 20, turn_deg = 4 }"
    )
    assert [direction.name for direction in planned.directions] == ["forward", "back", "left", "right"]
    ahead, back = planned.directions[:2]
    assert (ahead.angles == back.angles[::-1]).all()
    stance = planned.trajectory.angles
    assert stance.shape == (1, 12)
    assert (ahead.angles[0] == stance[0]).all()
    cycle = ahead.end - ahead.first
    assert cycle % 4 == 0  # swings of an even number of frames in a gait of two halves
    last = len(ahead.angles) - 1
    assert notes(planned, "command")[0] == (
        f"forward and back: a start of {ahead.first} frames, a cycle of {cycle} frames, "
        f"a stop of {last - ahead.end} frames"
    )


@pytest.mark.parametrize(("key", "size"), [("forward_mm", 20), ("turn_deg", 4)])
def test_the_cycle_of_a_command_is_that_of_the_endless_route(key: str, size: int) -> None:
    """A walk of one direction has the stance of the route of one segment."""
    same = "body_height_mm = 130\ncycle_s = 0.48\ncompensate = false\n"
    route = walk(f"{same}route = [{{ {key} = {size} }}]").trajectory
    found = walk(f"{same}commands = {{ {key} = {size} }}").directions[0]
    loop = route.angles[route.loop_start :]
    assert found.angles[found.first + 1 : found.end + 1] == pytest.approx(np.roll(loop, -1, axis=0))


# ---- programs -------------------------------------------------------------------------------------------


def program(tmp_path: Path, text: str, more: str = "", servo: str = "", hand: str = "") -> PlannedJob:
    (tmp_path / "p.rvm").write_text(text)
    zeros = (0, 60, 120, 90, 0)
    rows = "".join(
        f'[[servo]]\nname = "s{i}"\npin = "RB{i}"\nmodel = "futaba-s3001"\njoint = "q{i + 1}"\n'
        f"zero_deg = {zero}\n{servo}\n"
        for i, zero in enumerate(zeros)
    )
    rows += '[[servo]]\nname = "hand"\npin = "RB5"\nmodel = "futaba-s3001"\n' if hand else ""
    job = f'{HEAD}{rows}[robot]\nname = "rv-m1"\n[program]\nfile = "p.rvm"\n{more}\n{hand}\n'
    return plan_job(loads(job, str(tmp_path / "job.toml")))


def test_a_program_moves_the_servos_from_home_and_notes_its_time(tmp_path: Path) -> None:
    planned = program(tmp_path, "10 TI 10\n20 OD 3\n30 ED", "repeat = false")
    home = np.degrees(planned.trajectory.angles[0])
    assert home == pytest.approx([90, 60, 120, 90, 90])  # q1 and q5 are at 90° at home, the others at 0
    assert notes(planned, "program") == ["the program takes 52 frames, 1.04 s"]
    assert notes(planned, "output-port")[0].startswith("the program writes its output port 1 times")
    assert planned.parts == (Part("line 10", 1),)


@pytest.mark.parametrize(("end", "released"), [("hold", False), ("release", True)])
def test_a_program_may_release_its_servos_at_its_end(tmp_path: Path, end: str, released: bool) -> None:
    planned = program(tmp_path, "10 ED", f'repeat = false\nend = "{end}"')
    assert np.isnan(planned.trajectory.angles[-1]).all() == released
    assert not np.isnan(planned.trajectory.angles[:-1]).any()


def test_a_hand_opens_and_closes_between_its_angles(tmp_path: Path) -> None:
    hand = 'hand = { servo = "hand", open_deg = 30, closed_deg = 100 }'
    planned = program(tmp_path, "10 GC\n20 ED", "repeat = false", hand=hand)
    assert np.degrees(planned.trajectory.angles[[0, -1], 5]) == pytest.approx([30, 100])
    for wrong, said in (
        (hand.replace("100", "181"), "program.hand.closed_deg: hand cannot go to 181°"),
        (hand.replace("30", "-1"), "program.hand.open_deg: hand cannot go to -1°"),
        (hand.replace('"hand",', '"s0",'), "program.hand.servo: 's0' already turns a joint"),
        (hand.replace('"hand",', '"hond",'), "program.hand.servo: there is no servo 'hond'"),
    ):
        with pytest.raises(InputError) as caught:
            program(tmp_path, "10 ED", hand=wrong)
        assert said in str(caught.value)


def test_a_servo_that_cannot_bring_its_joint_home_is_refused_with_what_it_reaches(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        program(tmp_path, "10 ED", servo="min_deg = 91")
    assert (
        "servo[1].zero_deg: s0 cannot bring q1 to its home of 90°: it reaches 91° to 180° [servo-limit]"
        in str(caught.value)
    )
    assert program(tmp_path, "10 ED", servo="max_deg = 120").trajectory.loop_start >= 0


def test_a_servo_s_speed_and_its_ratio_set_that_of_a_program(tmp_path: Path) -> None:
    """q3 turns 20° at 1.8 rad/s, the servo's, or at its own speed if that is lower; 4/3 for the ramps."""
    planned = program(tmp_path, "SP 9\nMJ 0, 0, -20, 0, 0\n10 ED", "repeat = false")
    own = arm("rv-m1").joints[2].speed or math.inf
    frames = math.ceil(math.radians(20) / min(1.8, own) * 4 / 3 / 0.02 - 1e-9)
    angles = np.degrees(planned.trajectory.angles[:, 2])
    assert angles[0] == pytest.approx(120) and angles[-1] == pytest.approx(100)
    assert int(np.argmin(np.abs(angles - 100) > 1e-9)) == frames


# ---- drives ---------------------------------------------------------------------------------------------


def drive(text: str, wheels: str = '["w1", "w2", "w3"]', more: str = "") -> PlannedJob:
    rows = "".join(
        f'[[servo]]\nname = "w{n}"\npin = "RB{n}"\nmodel = "continuous"\n{more}\n' for n in (1, 2, 3)
    )
    return plan_job(
        loads(f'{HEAD}{rows}[robot]\nname = "omni"\n[drive]\nwheels = {wheels}\n{text}\n', "job.toml")
    )


SQUARE = "corners_mm = [[0, 0], [100, 0], [100, 100]]\n"


def test_the_keys_of_a_drive_are_millimetres_and_seconds() -> None:
    planned = drive(f"{SQUARE}speed_mm_s = 50\npause_s = 0.2\nramp_s = 0.1\nrepeat = false")
    stretches = notes(planned, "stretch")
    assert (
        stretches[0].startswith("stretch 1: 100.0 mm at 0.0°, two wheels, 1")
        or "100.0 mm at 0°" in stretches[0]
    )
    base = robot("omni")
    angles = planned.trajectory.angles
    still = (np.abs(angles) < 1e-12).all(axis=1)
    assert still.sum() == 3 * 10 + 1
    speed = np.linalg.norm(base.body_speed(angles)[:, :2], axis=1)  # type: ignore[attr-defined]
    assert 0.045 < speed.max() <= 0.05 * (1 + 1e-9)


def test_wheels_may_be_named_in_any_order() -> None:
    one = drive(f"{SQUARE}speed_mm_s = 50").trajectory.angles
    other = drive(f"{SQUARE}speed_mm_s = 50", '["w3", "w1", "w2"]').trajectory.angles
    assert (other[:, [2, 0, 1]] == one).all()


def test_a_drive_that_is_too_fast_is_told_the_speed_that_is_not() -> None:
    """The wheels turn at up to 300°/s; along x the rims of two of them go at √3/2 of the base's speed."""
    rim = 300 / 360 * 2 * math.pi * 40
    limit = math.floor(rim / (math.sqrt(3) / 2))
    text = "corners_mm = [[0, 0], [300, 0]]\nspeed_mm_s = {}"
    drive(text.format(limit - 2))
    for asked in (limit + 10, 3 * limit):
        with pytest.raises(InputError) as caught:
            drive(text.format(asked))
        assert "its speeds are -300°/s to 300°/s" in str(caught.value)
        advised = int(str(caught.value).split("at most ")[1].split()[0])
        assert advised == limit
        drive(text.format(advised))
    with pytest.raises(InputError, match="on this drive"):
        drive(f'routines = [{{ name = "turn", turn_deg = 90 }}]\nspeed_mm_s = {3 * limit}')


def test_routines_are_in_degrees_and_millimetres_and_say_where_they_lead() -> None:
    planned = drive(
        'routines = [{ name = "translation", direction_deg = 60, distance_mm = 100 }, '
        '{ name = "turn", turn_deg = 45 }]\n'
        "speed_mm_s = 40"
    )
    (text,) = notes(planned, "closing")
    assert text.startswith(
        "a round leads to x 50.0, y 86.6 mm, heading 45.0°; with pulses of whole cycles it ends "
    )
    assert [each.split(", ")[0] for each in notes(planned, "stretch")] == [
        "stretch 1: 100.0 mm at 60°",
        "stretch 2: turn by 45.0°",
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("cycle_s = 0.6\nroute = [{ forward_mm = 30 }]", "an endless walk has no end that could be compared"),
        ('gait = "tripod"\ncommands = { forward_mm = 30 }', "ends where its commands lead"),
        ("cycle_s = 0.6\nroute = [{ forward_mm = 30, cycles = 2 }]", None),
    ],
)
@pytest.mark.parametrize("key", ["robot_within_mm", "turn_within_deg", "drag_mm"])
def test_the_end_of_a_walk_that_has_none_cannot_be_expected(key: str, text: str, says: str | None) -> None:
    job = f'{HEAD}{servos()}[robot]\nname = "hexapod"\n[walk]\n{text}\n[frame]\nper_slot = 2\n'
    job += f"[expect]\n{key} = 5\n"
    if says is None or key == "drag_mm":
        loads(job, "job.toml")
        return
    with pytest.raises(InputError, match=says) as caught:
        loads(job, "job.toml")
    assert f"expect.{key}" in str(caught.value)


def test_a_cycle_that_the_gait_lengthens_is_said() -> None:
    """A ripple is a multiple of 6 frames: 25 become 30, 20 % more; 47 become 48, which is 2 %."""
    text = 'gait = "ripple"\nbody_height_mm = 130\ncycle_s = {}\nroute = [{{ forward_mm = 10, cycles = 1 }}]'
    (long,), (short,) = (notes(walk(text.format(seconds)), "cycle") for seconds in (0.5, 0.94))
    assert long == (
        "a cycle takes 30 frames, 0.6 s, 20 % more than the 25 frames that were asked for or that the servos "
        "need, so that every foot lifts and lands on a frame"
    )
    assert short == "a cycle takes 48 frames, 0.96 s"


def test_legs_that_meet_are_refused_with_their_names_distance_and_frame(tmp_path: Path) -> None:
    """The foot parts stand upright: seen from above, legs that meet have feet that are near each other."""
    mounts = ", ".join(
        f'{{ name = "{side}{row}", x_mm = {x}, y_mm = {y}{", mirrored = true" if side == "R" else ""} }}'
        for side, y in (("L", 34.5), ("R", -34.5))
        for row, x in (("1", "FRONT"), ("2", "0"), ("3", "-FRONT"))
    )
    text = f'name = "own"\nkind = "hexapod"\nleg = "pantograph"\nmount = [{mounts}]\n'
    text += "lengths_mm = { ab = 33, bc = 72, cd = 109, df = 94 }\n"
    way = 'gait = "ripple"\ncycle_s = 1.04\nlift_mm = 17\nbody_height_mm = 159.8\nrepeat = false\n'
    way += "route = [{ forward_mm = 96, cycles = 2 }]"
    (tmp_path / "own.toml").write_text(text.replace("FRONT", "153.5"))
    walk(way, str(tmp_path / "own.toml"))
    (tmp_path / "own.toml").write_text(text.replace("FRONT", "53.5"))
    with pytest.raises(InputError, match="less than the gap of 12 mm") as caught:
        walk(way, str(tmp_path / "own.toml"))
    assert caught.value.diagnostics[0].code == "legs-collide"
    assert re.search(r"the leg (L1 and the leg L2|L2 and the leg L3) come within \d", str(caught.value))
    frame = int(str(caught.value).split("frame ")[1].split(",")[0])
    planned = feet(walk(f"{way}\ngap_mm = 0", str(tmp_path / "own.toml")))[:, :, :2]
    near = np.linalg.norm(planned[:, :2] - planned[:, 1:3], axis=2)
    assert near[frame].min() < 12, "the feet are as near as that, seen from above"
