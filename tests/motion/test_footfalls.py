"""In a turn each foot stands on the line from the centre of rotation through its leg's axis.

Expected points are worked out by hand from c = i v / ω and F = A + ρ (A - c) / |A - c| with the example's
mounts at (90, 0, -90; ±50) mm and legs of l_BC = 60, l_DF = 80, r = 50 mm: a body 130 mm high has
cos β = 50/60, so (l_BC sin β)² = 3600 - 2500 = 1100 and ρ = √(2500 + 1100) = 60 mm.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.job import load, plan_job
from servogen.kinematics.protocol import BodyMotion, Posture
from servogen.motion.gait.phases import gait
from servogen.motion.gait.steps import Segment
from servogen.motion.gait.walk import Walk, walk
from servogen.units import Clock, Cycles
from tests.motion.robots import hexapod_with_limits

ROOT = Path(__file__).parents[2]
LOWER = Posture(body_height=0.130)
ON_THE_SPOT = Segment(turn=math.radians(20))
CURVE = Segment(forward=0.030, turn=math.radians(10))
FEET_MM = {
    # |A| = √(90² + 50²) = 102.956; 60 mm along (90, 50) / 102.956 = (52.450, 29.139)
    "on the spot": (
        ON_THE_SPOT,
        [
            (142.450, 79.139), (0, 110), (-142.450, 79.139), (142.450, -79.139), (0, -110),
            (-142.450, -79.139),
        ],
    ),
    # c = 30 / 0.174533 = 171.887 mm to the left. Left: A - c = (90, -121.887), 151.515 long, taken outwards.
    # Right: A - c = (90, -221.887), 239.443 long.
    "curve": (
        CURVE,
        [(54.360, 98.267), (0, 110), (-54.360, 98.267), (112.552, -105.601), (0, -110), (-112.552, -105.601)],
    ),
}  # fmt: skip


def walked(*segments: Segment, name: str = "tripod", posture: Posture = LOWER, alpha_deg: float = 90) -> Walk:
    robot = hexapod_with_limits(alpha_deg)
    return walk(
        robot, gait(name, robot), segments, posture, Cycles(20_000), Clock(4_000_000), frames_per_cycle=48
    )


def loop(made: Walk) -> slice:
    return slice(made.trajectory.loop_start, None)


@pytest.mark.parametrize("name", ("tripod", "ripple", "wave"))
@pytest.mark.parametrize("way", ["on the spot"])
def test_each_foot_is_on_the_line_when_its_circle_touches_the_ground_circle(name: str, way: str) -> None:
    segment, wanted = FEET_MM[way]
    made = walked(segment, name=name)
    feet = (made.feet + made.corrections)[loop(made)]
    springs = np.linalg.norm(made.corrections[loop(made)], axis=2)
    springs[~made.ground[loop(made)]] = np.inf
    for leg, (x, y) in enumerate(wanted):
        middle = int(np.argmin(springs[:, leg]))
        assert springs[middle, leg] < 1e-9
        assert 1000 * feet[middle, leg, :2] == pytest.approx((x, y), abs=0.002)


def test_on_a_curve_a_foot_stands_inside_of_where_the_circles_touch_so_that_its_spring_gives_half() -> None:
    """c²/16 (1/ρ ∓ 1/R): a left foot is 91.515 mm from c, between it and the axis, and goes 7.986 mm
    in a stance; a right one 299.443 mm, on the same side, and 26.131 mm.
    """
    made = walked(CURVE)
    springs = 1000 * np.linalg.norm(made.corrections[loop(made)], axis=2).max(axis=0)
    assert springs[[0, 2]] == pytest.approx(7.986**2 / 16 * (1 / 60 + 1 / 91.515), abs=0.03)
    assert springs[[3, 5]] == pytest.approx(26.131**2 / 16 * (1 / 60 - 1 / 299.443), abs=0.03)
    feet, (x, y) = 1000 * (made.feet + made.corrections)[loop(made)], FEET_MM["curve"][1][3]
    assert np.linalg.norm(feet[:, 3, :2] - [x, y], axis=1).min() < 1, "near where they touch"


def test_the_spring_gives_what_two_touching_circles_are_apart_at_the_stances_ends() -> None:
    # Circles about the centre (R = D + ρ) and about the axis (ρ), 5° of the turn to either side.
    made = walked(ON_THE_SPOT)
    far, rho = math.hypot(90, 50), 60.0
    out = far + rho
    apart = math.sqrt(out**2 + far**2 - 2 * out * far * math.cos(math.radians(5))) - rho
    assert 1000 * np.linalg.norm(made.corrections[loop(made)], axis=2).max() == pytest.approx(apart, abs=1e-6)
    assert apart == pytest.approx(1.055, abs=0.001)


def test_a_foot_straight_out_would_need_a_spring_of_eight_times_as_much() -> None:
    # The foot of L1 at (90, 50 + ρ): 5° about the centre move it nearly across its own circle.
    rho = 60.0
    foot, axis = 90 + 1j * (50 + rho), 90 + 50j
    ends = [abs(foot * np.exp(1j * math.radians(turn)) - axis) - rho for turn in (-5, 5)]
    assert max(map(abs, ends)) > 7
    made = walked(ON_THE_SPOT)
    assert 1000 * made.largest_correction_m < 1.1


def test_a_body_that_does_not_turn_has_no_centre_and_its_feet_stand_straight_out() -> None:
    assert BodyMotion(0.04, 0.0, 0.5).centre is None
    made = walked(Segment(forward=0.04), posture=Posture())
    assert made.centres == (None,)
    # c²/16ρ inside of ρ = 50 mm, with a stance of half the stride: 400 / 800 = 0.5 mm.
    wanted = [(x, side * 99.5) for side in (1, -1) for x in (90, 0, -90)]
    assert 1000 * (made.feet + made.corrections)[0, :, :2] == pytest.approx(np.array(wanted), abs=0.501)
    assert made.trajectory.loop_start == 48


@pytest.mark.parametrize(
    ("segment", "centre"),
    [
        (Segment(turn=0.2), 0j),
        (Segment(forward=0.03, turn=0.1), 0.3j),
        (Segment(forward=0.03, turn=-0.1), -0.3j),
        (Segment(left=0.02, turn=0.1), -0.2 + 0j),
    ],
)
def test_the_centre_of_rotation_is_the_point_that_does_not_move(segment: Segment, centre: complex) -> None:
    found = BodyMotion(complex(segment.forward, segment.left), segment.turn, 0.5).centre
    assert found == pytest.approx(centre)
    # The body's velocity at c: v + iω c = 0.
    assert found is not None
    assert complex(segment.forward, segment.left) + 1j * segment.turn * found == pytest.approx(0)


@pytest.mark.parametrize("name", ("tripod", "ripple", "wave"))
def test_the_feet_step_on_the_spot_before_and_after_a_turn(name: str) -> None:
    made = walked(replace(ON_THE_SPOT, cycles=2), name=name)
    angles = made.trajectory.angles.reshape(-1, 6, 2)
    assert np.abs(angles[0] - angles[-1]).max() < 1e-9
    for frames in (slice(0, 49), slice(-49, None)):
        for leg in (0, 2, 3, 5):
            part = made.ground[frames, leg]
            assert np.flatnonzero(part[:-1] & ~part[1:]).size == 1, "each corner foot lifts once"
        stands = made.ground[frames]
        assert stands[0].all() and stands[-1].all()
        feet = (made.feet + made.corrections)[frames]
        both = stands[1:] & stands[:-1]
        assert np.abs(np.diff(feet, axis=0)[both]).max() < 1e-12, "the body is at rest"
    # Before the first step and after the last one the legs point straight out.
    straight = walked(Segment(forward=0.04, cycles=1)).feet[0, :, 1]
    assert np.abs(np.abs(made.feet[0, :, 1]) - np.abs(straight)).max() < 1e-9
    assert made.minimum_margin_m > 0.01


def test_no_step_on_the_spot_where_the_feet_stand_alike() -> None:
    # A step on the spot before and after takes a cycle of 48 frames each, and the last frame stands.
    straight, other = Segment(forward=0.04, cycles=2), Segment(forward=0.03, cycles=2)
    assert len(walked(straight).ground) == 4 * 48 + 1
    assert len(walked(straight, other).ground) == 7 * 48 + 1
    assert len(walked(straight, straight).ground) == 6 * 48 + 1
    whole = walked(replace(straight, cycles=4)).trajectory.angles
    assert walked(straight, straight).trajectory.angles == pytest.approx(whole, abs=1e-12)


def test_the_sign_of_beta_is_chosen_by_leg() -> None:
    # L1 looks along (90, 50), 61° forward of straight out; β < 0 puts a foot atan(33 / 50) = 33.6° forward.
    made = walked(ON_THE_SPOT)
    angles = np.degrees(made.trajectory.angles.reshape(-1, 6, 2))
    assert np.sign(angles[0, :, 1]).tolist() == [-1, 1, 1, -1, 1, 1]
    assert np.abs(angles[:, :, 0]).max() < 61 - 33 + 20
    assert (np.sign(walked(Segment(forward=0.04)).trajectory.angles[0, 1::2]) == 1).all()
    rear = walked(Segment(forward=0.04), posture=replace(LOWER, beta_sign=-1))
    assert (np.sign(rear.trajectory.angles[0, 1::2]) == -1).all()


def test_a_foot_that_its_joint_cannot_turn_to_the_line_comes_as_near_as_it_can_and_that_is_said() -> None:
    # At the legs' full height the line of L1 is 61° forward, and a stance sweeps another 15° to either side.
    free = walked(ON_THE_SPOT, posture=Posture())
    assert not free.held_back
    made = walked(ON_THE_SPOT, posture=Posture(), alpha_deg=65)
    assert {each.leg for each in made.held_back} == {"L1", "L3", "R1", "R3"}
    assert "the limits of the joints of L1 keep its foot" in made.held_back[0].text()
    alphas = np.degrees(made.trajectory.angles[:, ::2])
    assert 60 < np.abs(alphas).max() <= 65
    assert made.largest_correction_m > free.largest_correction_m


def test_a_turn_that_the_joints_cannot_make_is_refused() -> None:
    with pytest.raises(InputError, match="L1_alpha would have to turn"):
        walked(Segment(turn=1.5), alpha_deg=30)


def test_slip_is_what_the_springs_take_up_along_a_stance() -> None:
    made = walked(Segment(forward=0.04), posture=Posture())
    # A stance of 24 steps along the line y = 49.5 mm while the foot stays on the circle of 50 mm.
    line = np.linspace(10, -10, 25) + 49.5j
    spring = line - 50 * line / np.abs(line)
    assert 1000 * made.slip.metres == pytest.approx(np.abs(np.diff(spring)).sum(), rel=0.01)
    assert "with rigid legs a foot would slip up to" in made.slip.text()
    assert walked(Segment()).slip.text() == "with rigid legs no foot would slip"


@pytest.mark.parametrize(("height", "way"), [(None, 10.909), (0.139, 4.454), (0.130, 1.460), (0.110, 0.565)])
def test_a_stance_at_the_legs_full_height_is_warned_of(height: float | None, way: float) -> None:
    # A foot at cos β moves by l_BC (sin β - sin β') until it is 1 mm higher.
    made = walked(Segment(forward=0.04), posture=Posture(body_height=height))
    assert 1000 * made.liftoff_slide_m == pytest.approx(way, abs=0.01)
    assert (made.full_height() is not None) == (way > 3)


def test_plan_shows_centre_slip_and_correction_and_warns_of_the_full_height(tmp_path: Path) -> None:
    text = (ROOT / "jobs" / "hexapod-turn.toml").read_text()
    notes = {}
    for height in (130, 140):
        file = tmp_path / f"at-{height}.toml"
        file.write_text(text.replace("body_height_mm = 130", f"body_height_mm = {height}"))
        planned = plan_job(load(file))
        notes[height] = [note.message for note in planned.notes], [each.code for each in planned.warnings]
    assert "segment 2: the body turns about (0.0, 0.0) mm in its own frame" in notes[130][0]
    assert "the legs' springs, or their feet, yield by up to 1.05 mm" in notes[130][0]
    assert any("slip up to" in note for note in notes[130][0])
    assert "full-height" not in notes[130][1]
    assert "full-height" in notes[140][1]
