"""[drive] of a job: a contour of the omni base as the widths of three continuous-rotation servos."""

from math import ceil, cos, degrees, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.pulse.plan import plan

JOBS = Path(__file__).parents[2] / "jobs"
TEXT = (JOBS / "omni-square.toml").read_text("utf-8")
CORNERS = next(line for line in TEXT.splitlines() if line.startswith("corners_mm"))


def made(*replacements: tuple[str, str]) -> PlannedJob:
    text = TEXT
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new, 1)
    return plan_job(loads(text, "job.toml"))


def error_of(*replacements: tuple[str, str]) -> str:
    with pytest.raises(InputError) as caught:
        made(*replacements)
    return str(caught.value)


def test_the_square_s_widths_are_those_of_the_inverse_kinematics() -> None:
    job = plan_job(load(JOBS / "omni-square.toml"))
    planned = plan(job.trajectory, job.servos, job.frame)
    assert (job.warnings, planned.warnings) == ((), ())
    runs = [
        (run.frames, *(pulse.width if pulse else 0 for pulse in run.pulses)) for run in planned.schedule.loop
    ]
    # 100 mm/s, r = 40 mm: v/r = 2.5 rad/s; along x ω = ±(√3/2) v/r, along y -v/2r, -v/2r and v/r; 1.5°/s a µs
    fast = round(degrees(sqrt(3) / 2 * 2.5) / 1.5)
    slow, third = round(degrees(1.25) / 1.5), round(degrees(2.5) / 1.5)
    stop = (25, 1500, 1500, 1500)
    assert runs == [
        (150, 1500 + fast, 1500 - fast, 1500),
        stop,
        (150, 1500 - slow, 1500 - slow, 1500 + third),
        stop,
        (150, 1500 - fast, 1500 + fast, 1500),
        stop,
        (150, 1500 + slow, 1500 + slow, 1500 - third),
        stop,
    ]


def test_notes_say_the_routines_and_the_closing_error() -> None:
    notes = [(note.code, str(note)) for note in plan_job(load(JOBS / "omni-square.toml")).notes]
    assert [code for code, _ in notes] == ["stretch"] * 4 + ["closing"]
    turns = 16 * 300 * sin(pi / 3) / (pi * 80)
    assert f"{turns:.3f} motor turns, {2048 * turns:.0f} counts" in notes[0][1]
    assert "300.0 mm at 90.0°, three wheels, 150 frames, 3 s" in notes[1][1]
    # along y -48, -48 and +95 µs add up to -1 µs, 1.5°/s: r · 1.5°/s / 3l for 3 s turn the base by 0.444°,
    # so that the side of 83 µs, 0.301 m, ends 2.3 mm beside where it began
    assert (
        notes[4][1]
        .removesuffix(" [closing]")
        .endswith("with pulses of whole cycles, a round ends 2.34 mm and 0.000° from its start")
    )


def test_a_finer_clock_closes_the_contour_better() -> None:
    def closing(job: PlannedJob) -> float:
        return float(str(job.notes[-1]).split(" ends ")[1].split(" mm")[0])

    fine = made(('"PIC16F84"', '"PIC16F84A"'), ("4_000_000", "20_000_000"))
    assert closing(fine) < closing(made())


def test_six_directions_alone_drive_the_same_square_in_six_routines() -> None:
    job = made(("# directions = ", "directions = "), ('"six" drives', '"six" # drives'))
    stretches = [str(note) for note in job.notes if note.code == "stretch"]
    assert len(stretches) == 6
    assert all("two wheels" in text for text in stretches)
    assert "173.2 mm at 60°" in stretches[1]


def test_a_reversed_wheel_has_its_widths_on_the_other_side_of_stop() -> None:
    job = made(('model = "continuous" #', 'model = "continuous"\nreverse = true #'))
    first = plan(job.trajectory, job.servos, job.frame).schedule.loop[0].pulses[0]
    assert first is not None
    assert first.width == 1500 - round(degrees(sqrt(3) / 2 * 2.5) / 1.5)


def test_a_drive_may_end_stopped_or_released() -> None:
    held = made(("pause_s = 0.5", "repeat = false\npause_s = 0.5")).trajectory
    assert (held.angles[held.loop_start :] == 0).all()
    released = made(("pause_s = 0.5", 'repeat = false\nend = "release"\npause_s = 0.5')).trajectory
    assert np.isnan(released.angles[-1]).all()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"wheel2", "wheel3"]', '"wheel2", "wheel4"]', "drive.wheels[3]: there is no servo 'wheel4'"),
        ('"wheel2", "wheel3"]', '"wheel2"]', "drive.wheels: omni has 3 wheels, not 2"),
        ('"wheel2", "wheel3"]', '"wheel2", "wheel2"]',
            "drive.wheels[3]: 'wheel2' is the servo of two wheels"),
        ('model = "continuous" #', 'model = "futaba-s3001" #', "'wheel1' is not a continuous-rotation servo"),
        ('name = "omni"', 'name = "rv-m1"', "drive: a drive needs a robot on wheels"),
        ("[[0, 0], [300, 0], [300, 300], [0, 300]]", "[[0, 0], [0, 0]]",
            "drive.corners_mm: the contour has no length"),
        ("[frame]", '[[servo]]\nname = "x"\npin = "RB7"\nmodel = "continuous"\n\n[frame]',
            "x turns no wheel"),
        ('model = "continuous" #', 'model = "continuous"\nmin_deg = 0 #', "wheel1 turns continuously"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_key(old: str, new: str, message: str) -> None:
    assert message in error_of((old, new))


def test_a_drive_that_is_too_fast_says_how_fast_it_may_be() -> None:
    # along y wheel 3 turns at v / r: 300 mm/s are 7.5 rad/s, and 300°/s allow 0.04 · 5.236 = 209 mm/s
    assert error_of(("speed_mm_s = 100", "speed_mm_s = 300")).endswith(
        "drive.speed_mm_s: wheel3 would have to turn at -430°/s: its speeds are -300°/s to 300°/s "
        "[servo-limit]\n"
        "  at most 209 mm/s on this contour"
    )


@pytest.mark.parametrize(
    ("keys", "key"),
    [
        (CORNERS, "corners_mm"),
        ('routines = [{ name = "translation", direction_deg = 0, distance_mm = 300 }]', "routines"),
    ],
)
def test_a_drive_of_too_many_frames_is_refused_at_the_key_that_says_where_it_goes(
    keys: str, key: str
) -> None:
    """At 0.02 mm/s and 20 ms a frame 300 mm take 750,000 frames."""
    line = TEXT.splitlines().index(CORNERS) + 1
    assert error_of((CORNERS, keys), ("speed_mm_s = 100", "speed_mm_s = 0.02")) == (
        f"job.toml:{line}:1: error: drive.{key}: the drive is more than 500000 frames long "
        "[too-many-frames]\n  raise its speed"
    )


def test_poses_give_a_wheel_its_speed() -> None:
    text = (
        TEXT.split("[drive]")[0]
        + "[motion]\nposes = [{ wheel1_deg_s = 150, wheel2_deg_s = 0, wheel3_deg_s = -75, hold_s = 1 }]\n"
    )
    job = plan_job(loads(text, "job.toml"))
    (run,) = plan(job.trajectory, job.servos, job.frame).schedule.loop
    assert [pulse.width for pulse in run.pulses if pulse] == [1600, 1500, 1450]
    with pytest.raises(InputError, match="'wheel1_deg' is not given in deg: write wheel1_deg_s"):
        plan_job(loads(text.replace("wheel1_deg_s", "wheel1_deg"), "job.toml"))


def by_routines(*rows: str, more: str = "") -> PlannedJob:
    return made((CORNERS, f"routines = [{', '.join(rows)}]\n{more}"))


def test_routines_are_driven_one_after_the_other() -> None:
    job = by_routines(
        '{ name = "turn", turn_deg = 90 }',
        '{ name = "translation", direction_deg = 0, distance_mm = 300 }',
        '{ name = "medium-circle", direction_deg = 30, turn_deg = 180 }',
    )
    texts = [str(note) for note in job.notes]
    assert "stretch 1: turn by 90.0°" in texts[0]
    assert "300.0 mm at 0°, two wheels" in texts[1]
    assert "medium circle, radius 270.0 mm, by 180.0°, first towards 30°" in texts[2]
    # 300 mm ahead after the turn is (0, 300); half a circle is 540 mm across, 90° left of 30° + 90°
    x, y = 540 * cos(radians(210)), 300 + 540 * sin(radians(210))
    assert f"a round leads to x {x:.1f}, y {y:.1f} mm, heading 270.0°; with pulses" in texts[3]
    # the turn: l π/2 = 212 mm of rim at 100 mm/s; the wheels' speeds as pulses at 1.5°/s a microsecond
    first = plan(job.trajectory, job.servos, job.frame).schedule.loop[0]
    frames = ceil(135 * pi / 2 / 100 / 0.02)
    speed = degrees(135 * (pi / 2) / 40 / (frames * 0.02))
    assert first.frames == frames
    assert [pulse.width for pulse in first.pulses if pulse] == [1500 - round(speed / 1.5)] * 3


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ('{ name = "turm", turn_deg = 90 }', "did you mean 'turn'"),
        ('{ name = "turn" }', "drive.routines[1]: turn needs turn_deg"),
        (
            '{ name = "large-circle", direction_deg = 30, turn_deg = 90 }',
            "drive.routines[1]: no large circle that begins towards 30° turns counter-clockwise",
        ),
        ('{ name = "turn", degrees = 90 }', "degrees"),
    ],
)
def test_a_wrong_routine_is_named_with_its_place(row: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        by_routines(row)
    assert message in str(caught.value)
    assert caught.value.location is not None
    assert caught.value.location.line == TEXT.splitlines().index(CORNERS) + 1


def test_a_drive_has_corners_or_routines() -> None:
    both = f'{CORNERS}\nroutines = [{{ name = "turn", turn_deg = 90 }}]'
    assert "drive: a drive needs corners_mm or routines" in error_of((CORNERS, ""))
    assert "a drive has either corners_mm or routines" in error_of((CORNERS, both))


def test_a_bumper_may_not_hold_the_pulses_of_wheels() -> None:
    bumper = '[firmware]\nengine = "player"\nstop_pin = "RA4"\n'
    assert made(("[frame]", f"{bumper}[frame]")).buttons.any
    assert (
        "firmware.stop_pulses: wheel1 turns continuously: pulses that are held keep it turning"
        in error_of(("[frame]", f'{bumper}stop_pulses = "hold"\n[frame]'))
    )
