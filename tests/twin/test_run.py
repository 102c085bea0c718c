"""The coupled run: chip, servos, supply and bodies, on a tripod of two cycles at 130 mm."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from servogen.errors import InputError
from servogen.twin import Ground, TwinSettings, TwinVerdict
from servogen.twin.causes import EventKind
from servogen.twin.world import World
from tests.campaigns import sampled
from tests.twin.walking import AHEAD, SUPPLIED, walking, went_ahead


@pytest.fixture(scope="module")
def ahead() -> TwinVerdict:
    return went_ahead()


def test_the_tripod_goes_95_to_102_percent_of_its_way(ahead: TwinVerdict) -> None:
    assert ahead.planned.way == pytest.approx((0.080, 0.0, 0.0))
    assert 0.95 * 80 <= 1000 * ahead.done[0] <= 1.02 * 80
    assert abs(math.degrees(ahead.done[2])) < 3
    assert ahead.passed and ahead.events == ()


@pytest.mark.parametrize("chunk_ms", sampled([1, 7]))
def test_the_length_of_the_chunks_changes_nothing(ahead: TwinVerdict, chunk_ms: int) -> None:
    other = walking(AHEAD, extra=SUPPLIED).twin(TwinSettings(chunk_ms=chunk_ms))
    assert other.record.digest() == ahead.record.digest()


def test_another_ground_changes_the_run(ahead: TwinVerdict) -> None:
    """The digest sees differences at all."""
    other = walking(AHEAD, extra=SUPPLIED).twin(TwinSettings(ground=Ground(0.79)))
    assert other.record.digest() != ahead.record.digest()


@pytest.mark.campaign
def test_half_the_step_gives_the_same_way(ahead: TwinVerdict) -> None:
    half = walking(AHEAD, extra=SUPPLIED).twin(TwinSettings(steps_per_ms=2))
    assert half.done[0] == pytest.approx(ahead.done[0], rel=0.02)


def test_without_contacts_the_joints_follow_the_plan_within_the_lag_of_the_servos() -> None:
    """The lag that the equations give: dead band, band for the speed, Td ω; and the step of one frame."""
    job = walking(AHEAD)
    seen = job.twin(TwinSettings(contacts=False))
    record = seen.record
    part = slice(record.first, None)
    for index, drive in enumerate(record.rig.drives):
        error = np.abs(record.target - record.angle)[part, index]
        frame = np.abs(np.diff(job.found.job.trajectory.angles[:, record.rig.columns[index]])).max()
        fast = float(np.abs(record.speed[part, index]).max())
        lag = drive.dead_band + drive.band * fast / drive.no_load_speed + drive.damping_s * fast + frame
        assert error.max() <= lag, record.rig.servos[index].name


def test_a_robot_too_heavy_for_its_servos_is_seen_with_its_cause() -> None:
    extra = "\n[expect]\nrobot_within_mm = 10\n"
    heavy = walking(AHEAD, height=120, extra=extra).twin(mass=2.24)
    assert not heavy.passed
    assert heavy.cause is not None and heavy.cause.kind == EventKind.SATURATED
    assert re.fullmatch(
        r"[LR][123]-lift saturates at 0\.2\d N·m from \d\.\d\d s, \d+\.\d° from its target", heavy.cause.text
    )
    assert heavy.reasons()[-1] == f"first cause: {heavy.cause.text}"
    light = walking(AHEAD, height=120, extra=extra).twin()
    assert light.passed and light.events == ()


def test_a_servo_without_pulses_is_the_first_cause() -> None:
    seen = walking(AHEAD, extra="\n[expect]\nturn_within_deg = 3\n").twin(
        TwinSettings(unplugged=("R2-lift",))
    )
    assert not seen.passed
    assert seen.cause is not None and seen.cause.text == "R2-lift receives no pulses at all"


def test_a_broken_gear_is_the_first_cause() -> None:
    seen = walking(AHEAD).twin(TwinSettings(broken=("L1-turn", "L1-lift")))
    assert seen.cause is not None and seen.cause.text == "L1-turn turns nothing: its gear is broken"
    assert not any(event.text.startswith("L1-lift saturates") for event in seen.events)


@pytest.mark.campaign
def test_a_supply_that_gives_in_makes_the_rest_not_guaranteed() -> None:
    """Twelve servos that hold a robot of 2.24 kg ask a supply of 3.5 A for more."""
    extra = "\n[supply]\nvoltage_v = 5.0\nresistance_ohm = 0.05\nlimit_a = 3.5\n"
    seen = walking(AHEAD, height=120, extra=extra).twin(mass=2.24)
    assert seen.word == "not guaranteed" and not seen.passed
    assert seen.record.current.max() == pytest.approx(3.5)
    limit = next(event for event in seen.events if event.kind == EventKind.SUPPLY)
    assert limit.text.startswith("the supply is at its limit of 3.5 A from")
    assert seen.not_guaranteed_from == pytest.approx(
        float(seen.record.time[np.argmax(seen.record.voltage < 4.0)])
    )
    separate = walking(AHEAD, height=120, extra=extra + "feeds_chip = false\n").twin(mass=2.24)
    assert separate.not_guaranteed_from is None


@pytest.mark.campaign
def test_twelve_stalled_servos_at_a_supply_of_3_5_a() -> None:
    """With 15 kg on its legs the robot lies on the ground, and all its servos push in vain."""
    extra = "\n[supply]\nvoltage_v = 5.0\nresistance_ohm = 0.05\nlimit_a = 3.5\n"
    settings = TwinSettings(ground=Ground(1.0), seconds=1.0)
    seen = walking(AHEAD, height=120, extra=extra).twin(settings, mass=15.0)
    record, drive = seen.record, seen.record.rig.drives[0]
    assert seen.word == "not guaranteed" and not seen.passed
    assert seen.cause is not None and seen.cause.kind == EventKind.SUPPLY
    resistance, idle = drive.resistance, 12 * drive.idle_a
    volts = (3.5 - idle) * resistance / 12  # by hand: twelve motors at rest share the current
    asked = (idle + 12 * 5.0 / resistance) / (1 + 12 * 0.05 / resistance)
    assert re.fullmatch(
        r"the supply is at its limit of 3\.5 A from 0\.3\d s: with 12 stalled servos its voltage is "
        rf"{volts:.2f} V at 0\.\d\d s, where {asked:.1f} A are demanded",
        seen.cause.text,
    )
    assert seen.not_guaranteed_from is not None and seen.not_guaranteed_from >= seen.cause.seconds
    still = (np.abs(record.duty) == 1.0).all(axis=1) & (np.abs(record.speed) < 0.02).all(axis=1)
    assert still.sum() > 10
    assert record.voltage[still] == pytest.approx(volts, rel=0.01)
    assert record.current[still] == pytest.approx(3.5)
    plenty = walking(AHEAD, height=120, extra=extra.replace("limit_a = 3.5\n", "")).twin(settings, mass=15.0)
    assert not any("limit" in event.text for event in plenty.events)


@pytest.mark.parametrize("steps_per_ms", sampled([1, 2]))
def test_the_energies_of_a_walk_add_up(ahead: TwinVerdict, steps_per_ms: int) -> None:
    """What comes from the supply is heat in copper and gears, goes into contacts, or is in the bodies.

    Each is measured by itself: currents and speeds of the motors, forces of the contacts, place and motion of
    the bodies at the end.
    """
    seen = walking(AHEAD, extra=SUPPLIED).twin(TwinSettings(energies=True, steps_per_ms=steps_per_ms))
    account = seen.record.energies
    assert account is not None and account.electric > 1.0
    assert account.electric == pytest.approx(account.heat + account.taken + account.gained, rel=0.01)
    assert abs(account.work - account.taken - account.gained) < 0.0005 * account.electric
    height = seen.record.pose[-1, 2] - seen.record.pose[0, 2]
    assert account.gained == pytest.approx(0.64 * 9.80665 * height, abs=0.01)  # it stands again
    assert account.taken > 0  # sliding feet and contacts give none
    if steps_per_ms == 1:
        assert seen.record.digest() == ahead.record.digest(), "keeping the account changes nothing"


@pytest.mark.campaign
def test_a_lighter_foot_friction_and_a_moved_centre_change_little() -> None:
    from servogen.twin import Variation

    ground = Variation((0.7, 1.3, 1.0, 0.9, 1.1, 0.8), (0.01, -0.01))
    seen = walking(AHEAD, extra=SUPPLIED).twin(TwinSettings(variation=ground))
    assert 0.9 * 80 <= 1000 * seen.done[0] <= 1.05 * 80


def test_the_record_can_be_cut_at_any_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a second is 100 samples of 5 ms; no more than a record may have."""
    monkeypatch.setattr("servogen.twin.run.MAX_SAMPLES", 100)
    short = walking(AHEAD).twin(TwinSettings(seconds=0.5))
    assert short.record.time[-1] == pytest.approx(0.495)
    assert replace(short.record.settings, seconds=None) == TwinSettings()
    with pytest.raises(InputError, match="longer than half an hour"):
        walking(AHEAD).twin(TwinSettings(seconds=0.505))


@pytest.mark.campaign
def test_at_full_height_the_warning_of_the_plan_is_the_cause() -> None:
    seen = walking(AHEAD, height=140, extra="\n[expect]\nrobot_within_mm = 4\n").twin()
    assert not seen.passed and seen.events == ()
    assert seen.reasons()[-1].startswith("the plan warned: the legs stand at their full height")


def test_a_run_ends_where_the_physics_diverges(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 95 ms, and chunks have 20 ms: no job was found that gets there by its own numbers."""
    step_on = World.advance

    def advance(world: World) -> None:
        if world.step == 95:
            world.data.qvel[7] = math.nan
        step_on(world)

    monkeypatch.setattr(World, "advance", advance)
    with pytest.raises(InputError, match=r": the physics diverged before 0\.1 s ") as error:
        walking(AHEAD).twin()
    assert error.value.code == "unstable"


@pytest.mark.campaign
def test_a_slope_and_rough_ground_cost_way() -> None:
    made = walking(AHEAD, extra=SUPPLIED)
    flat = made.twin()
    up = made.twin(TwinSettings(Ground(0.5, slope=math.radians(12))))
    down = made.twin(TwinSettings(Ground(0.5, slope=math.radians(-12))))
    assert up.done[0] < flat.done[0] - 0.002 < down.done[0]
    one, other = (made.twin(TwinSettings(Ground(0.8, rough=0.008, seed=seed))) for seed in (1, 2))
    assert one.record.digest() != other.record.digest()
    assert one.record.digest() == made.twin(TwinSettings(Ground(0.8, rough=0.008, seed=1))).record.digest()
    assert one.record.tilt.max() > 3 * flat.record.tilt.max()


def test_a_slope_steeper_than_friction_holds_lets_the_robot_slide() -> None:
    """atan 0.3 is 16.7°: on 14° the standing robot leans in its servos' dead bands, on 20° it slides.

    By hand: g (sin 20° - 0.3 cos 20°) (0.3 s)² / 2 = 26 mm.
    """
    made = walking(AHEAD, extra=SUPPLIED)
    stays, slides = (
        made.twin(TwinSettings(Ground(0.3, slope=math.radians(degrees)), seconds=0.3)) for degrees in (14, 20)
    )
    assert -0.006 < stays.record.pose[-1, 0] < 0
    assert 0.018 < -slides.record.pose[-1, 0] < 0.045  # and it leans


def test_dry_friction_holds_a_servo_without_pulses() -> None:
    """Without friction the leg gives way; a gear that needs 0.3 A without load holds it."""
    made = walking(AHEAD, height=120)
    settings = TwinSettings(unplugged=("R2-lift",), seconds=1.2)
    loose = made.twin(settings)
    held = made.with_motor(no_load_a=0.3).twin(settings)

    def way(verdict: TwinVerdict) -> float:
        index = [servo.name for servo in verdict.record.rig.servos].index("R2-lift")
        return float(np.ptp(verdict.record.angle[:, index]))

    assert way(held) < 0.2 * way(loose)


@pytest.mark.campaign
def test_backlash_is_a_joint_of_its_own_and_changes_the_walk() -> None:
    made = walking(AHEAD, extra=SUPPLIED)
    worn = made.with_motor(backlash=math.radians(3)).twin()
    assert worn.record.bodies.text.count('_play"') == 12
    assert abs(worn.done[0] - made.twin().done[0]) > 0.001


def test_the_map_of_a_walk_shows_the_rigid_way_and_the_simulated_one_from_the_same_start(
    ahead: TwinVerdict,
) -> None:
    """Rigid legs go the 80 mm that the job asks for."""
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    from matplotlib.figure import Figure

    from servogen.twin.pictures import draw_path

    axes = Figure().add_subplot()
    draw_path(axes, ahead)
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    rigid, simulated = lines["rigid legs, ideal wheels"], lines["simulated"]
    assert rigid[-1] == pytest.approx([80, 0], abs=0.5)
    assert simulated[0] == pytest.approx([0, 0], abs=1e-9)
    assert simulated[-1] == pytest.approx(1000 * np.array(ahead.done[:2]), abs=0.5)
