"""Start button and emergency stop of the player: when they count, what they do, and pins that are stuck."""

import re
from collections.abc import Sequence
from dataclasses import replace

import pytest

from servogen.edges import HIGH, LOW, EdgeTrace
from servogen.engines.board import board_of
from servogen.engines.inputs.buttons import with_wait
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.pulse import PulseSchedule, Run, from_json
from servogen.pulse.expected import expected
from servogen.pulse.schedule import Input
from servogen.simulator import BouncingButton, Levels, Machine, Stimuli
from servogen.simulator.sources import SignalSource, pin_number
from servogen.units import Cycles
from servogen.verify import Verdict, verify
from servogen.workflows.job_build import BuiltProgram
from servogen.workflows.verification import judge_forever
from tests.engines.player.player_jobs import built_text, first_frames, job_text, sweep

SOFT = "soft_start_s = 0.16\n"
START, STOP = 'start_pin = "RA4"\n', 'stop_pin = "RB7"\n'
HOLD = 'stop_pulses = "hold"\n'
RA4, RB7 = pin_number("RA4"), pin_number("RB7")


def text(firmware: str) -> str:
    return job_text(5, sweep(5, 0.64), firmware=SOFT + firmware)


def silent(schedule: PulseSchedule, frames: int = 1) -> Run:
    return Run(frames, (None,) * len(schedule.channels))


def shown(
    schedule: PulseSchedule, program: BuiltProgram, sources: Sequence[SignalSource], frames: int
) -> Verdict:
    """Compare what the pins do with these changes from outside with a schedule's first `frames` frames."""
    limit = Cycles((frames + 3) * schedule.period)
    machine = Machine(program.image, schedule.clock, board_of(schedule), Stimuli(sources))
    trace = EdgeTrace(schedule.clock, machine.stream(limit), limit)
    return verify(expected(schedule), trace, Cycles(frames * schedule.period))


def first_edge(program: BuiltProgram) -> int:
    assert program.verdict.start is not None
    return program.verdict.start


@pytest.mark.parametrize(("level", "frame"), [("low", 0), ("high", 1), ("low", 7), ("high", 20)])
def test_the_motion_waits_in_its_first_frame_until_start_was_seen_in_three_frames(
    level: str, frame: int
) -> None:
    done = built_text(text(START + f'start_level = "{level}"\n'))
    active = HIGH if level == "high" else LOW
    for program in done.programs:
        schedule = with_wait(done.plan.schedule, frame)
        pressed = first_edge(program) + frame * schedule.period + 100
        button = BouncingButton(RA4, pressed, pressed + 10 * schedule.period, active=active, seed=frame + 1)
        verdict = shown(schedule, program, [button], schedule.lead_in_frames + schedule.loop_frames)
        assert verdict.passed, verdict.reasons


def test_what_build_proves_has_start_pressed_and_stop_released_at_power_up() -> None:
    done = built_text(text(START + STOP))
    assert done.exact
    schedule = done.plan.schedule
    assert schedule.inputs == (Input("RA4", LOW), Input("RB7", HIGH))
    assert from_json(schedule.json_text(), "schedule.json") == schedule
    # Two more frames of the first one than without a button: it counts at the end of the third.
    plain = built_text(text("")).plan.schedule
    assert schedule.lead_in_frames == plain.lead_in_frames + 2
    found = judge_forever(schedule, done.programs[0].image, Cycles(1000 * schedule.period))
    assert found.passed, found.text()


def test_a_press_of_two_frames_is_no_press() -> None:
    done = built_text(text(START))
    schedule, program = done.plan.schedule, done.programs[0]
    begin = first_edge(program) + 5 * schedule.period + 100
    short = BouncingButton(RA4, begin, begin + 2 * schedule.period, bounces=0)
    waiting = replace(schedule, lead_in=(), loop=first_frames(schedule, 1))
    assert shown(waiting, program, [short], 40).passed
    enough = replace(short, released=begin + 3 * schedule.period)
    assert not shown(waiting, program, [enough], 40).agrees


@pytest.mark.parametrize("frame", [0, 12, 41])
def test_the_emergency_stop_ends_the_pulses_after_three_frames_until_reset(frame: int) -> None:
    done = built_text(text(STOP))
    for program in done.programs:
        schedule = done.plan.schedule
        pressed = first_edge(program) + frame * schedule.period + 100
        button = BouncingButton(RB7, pressed, pressed + 5 * schedule.period, seed=frame + 1)
        stopped = replace(schedule, lead_in=first_frames(schedule, frame + 3), loop=(silent(schedule),))
        verdict = shown(stopped, program, [button], frame + 60)
        assert verdict.passed, verdict.reasons


@pytest.mark.parametrize("frame", [0, 12, 41])
def test_the_emergency_stop_can_hold_the_pulses_of_that_moment(frame: int) -> None:
    done = built_text(text(STOP + HOLD))
    for program in done.programs:
        schedule = done.plan.schedule
        pressed = first_edge(program) + frame * schedule.period + 100
        button = BouncingButton(RB7, pressed, pressed + 5 * schedule.period, seed=frame + 1)
        before = first_frames(schedule, frame + 3)
        held = replace(schedule, lead_in=before, loop=(replace(before[-1], frames=1),))
        verdict = shown(held, program, [button], frame + 60)
        assert verdict.passed, verdict.reasons


def test_start_after_a_stop_that_took_the_pulses_begins_anew_with_the_neutral_pose() -> None:
    done = built_text(text(START + STOP))
    for program in done.programs:
        schedule = done.plan.schedule
        stop = first_edge(program) + 30 * schedule.period + 100
        again = first_edge(program) + 50 * schedule.period + 100
        presses = [
            Levels(RA4, ((0, LOW), (stop, HIGH), (again, LOW))),
            Levels(RB7, ((0, HIGH), (stop, LOW), (stop + 5 * schedule.period, HIGH))),
        ]
        # As at power-up, but that the first frame is not waited in.
        anew = first_frames(schedule, 60)
        anew = (replace(anew[0], frames=anew[0].frames - 3), *anew[1:])
        lead_in = (*first_frames(schedule, 33), silent(schedule, 20), *anew)
        verdict = shown(replace(schedule, lead_in=lead_in), program, presses, 33 + 20 + 57)
        assert verdict.passed, verdict.reasons


def test_start_after_a_stop_that_held_goes_on_from_there() -> None:
    done = built_text(text(START + STOP + HOLD))
    schedule, program = done.plan.schedule, done.programs[0]
    stop = first_edge(program) + 30 * schedule.period + 100
    again = first_edge(program) + 50 * schedule.period + 100
    presses = [
        Levels(RA4, ((0, LOW), (stop, HIGH), (again, LOW))),
        Levels(RB7, ((0, HIGH), (stop, LOW), (stop + 5 * schedule.period, HIGH))),
    ]
    # Frame 32 is the last one before the stop counts; it comes 20 times more.
    until, whole = first_frames(schedule, 33), first_frames(schedule, 90)
    rest = first_frames(replace(schedule, lead_in=whole), 90)
    after = _without(rest, 33)
    lead_in = (*until, replace(until[-1], frames=20), *after)
    verdict = shown(replace(schedule, lead_in=lead_in), program, presses, 33 + 20 + 50)
    assert verdict.passed, verdict.reasons


def _without(runs: tuple[Run, ...], frames: int) -> tuple[Run, ...]:
    """The runs without their first `frames` frames."""
    found = []
    for each in runs:
        left = max(0, each.frames - frames)
        frames = max(0, frames - each.frames)
        if left:
            found.append(replace(each, frames=left))
    return tuple(found)


def test_a_start_button_that_is_stuck_released_leaves_the_neutral_pose_for_ever() -> None:
    done = built_text(text(START))
    schedule = done.plan.schedule
    waiting = replace(schedule, lead_in=(), loop=first_frames(schedule, 1), inputs=(Input("RA4", HIGH),))
    for program in done.programs:
        found = judge_forever(waiting, program.image, Cycles(2000 * schedule.period))
        assert found.passed, found.text()


def test_a_stop_that_is_stuck_pressed_leaves_no_pulses_whatever_start_does() -> None:
    done = built_text(text(START + STOP))
    schedule = done.plan.schedule
    stopped = replace(
        schedule, lead_in=(replace(first_frames(schedule, 1)[0], frames=3),), loop=(silent(schedule),)
    )
    for program in done.programs:
        start = first_edge(program) + 20 * schedule.period
        for presses in ((), ((start, LOW),), ((start, LOW), (start + 200_000, HIGH), (start + 400_000, LOW))):
            sources = [Levels(RA4, ((0, LOW), (10, HIGH), *presses)), Levels(RB7, ((0, LOW),))]
            verdict = shown(stopped, program, sources, 60)
            assert verdict.passed, verdict.reasons


def test_a_start_that_is_stuck_pressed_does_not_start_again_after_a_stop() -> None:
    done = built_text(text(START + STOP))
    schedule, program = done.plan.schedule, done.programs[0]
    stop = first_edge(program) + 30 * schedule.period + 100
    sources = [Levels(RA4, ((0, LOW),)), Levels(RB7, ((0, HIGH), (stop, LOW), (stop + 100_000, HIGH)))]
    stopped = replace(schedule, lead_in=first_frames(schedule, 33), loop=(silent(schedule),))
    assert shown(stopped, program, sources, 90).passed


def test_an_input_that_flutters_moves_no_edge() -> None:
    done = built_text(text(STOP))
    schedule, program = done.plan.schedule, done.programs[0]
    # Pressed for two frames of three, for ever.
    beats = [(at * schedule.period, HIGH) for at in range(0, 300, 3)]
    beats += [((at + 1) * schedule.period + 777, LOW) for at in range(0, 300, 3)]
    verdict = shown(schedule, program, [Levels(RB7, tuple(sorted(beats)))], 200)
    assert verdict.passed, verdict.reasons


@pytest.mark.parametrize(
    ("firmware", "message"),
    [
        ('start_pin = "RB0"\n', "RB0 is in use: s0"),
        ('start_pin = "RA3"\nstop_pin = "RA3"\n', "RA3 is in use: start"),
        ('stop_pin = "RC1"\n', "unknown pin 'RC1'"),
        ('start_level = "high"\n', "there is no start_pin"),
        ('stop_pulses = "hold"\n', "there is no stop_pin"),
    ],
)
def test_a_pin_that_cannot_be_a_button_is_refused(firmware: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        plan_job(loads(text(firmware), "job.toml"))


def test_the_sequence_engine_has_no_buttons_and_auto_takes_the_player() -> None:
    with pytest.raises(InputError, match="the sequence engine does not read buttons"):
        plan_job(loads(text(START).replace('"player"', '"sequence"'), "job.toml"))
    lab = text(START).replace('"player"', '"auto"')
    assert built_text(lab).engine == "player"


@pytest.mark.campaign
def test_the_tripod_has_room_for_both_buttons() -> None:
    from tests.engines.player.test_player import TRIPOD

    done = built_text(TRIPOD + 'start_pin = "RA4"\n')
    assert done.exact
    assert max(program.firmware.compilation.words for program in done.programs) <= 1024


DRIVE = (
    "[robot]\nname = \"omni\"\n[drive]\nwheels = ['s0', 's1', 's2']\nspeed_mm_s = 100\n"
    'routines = [{ name = "turn", turn_deg = 90 },'
    ' { name = "translation", direction_deg = 0, distance_mm = 90 }]\n'
)


def test_a_bumper_stops_the_wheels_of_a_drive_for_good() -> None:
    wheels = job_text(3, DRIVE, firmware=SOFT + STOP)
    wheels = re.sub(r'model = "futaba-s3001"\nmin_deg = .*\nmax_deg = .*', 'model = "continuous"', wheels)
    done = built_text(wheels)
    schedule, program = done.plan.schedule, done.programs[0]
    for frame, still_pressed in ((9, True), (120, False)):
        touched = first_edge(program) + frame * schedule.period + 100
        bumper = BouncingButton(
            RB7, touched, touched + (10_000 if still_pressed else 5) * schedule.period, seed=frame
        )
        stopped = replace(schedule, lead_in=first_frames(schedule, frame + 3), loop=(silent(schedule),))
        verdict = shown(stopped, program, [bumper], frame + 200)
        assert verdict.passed, verdict.reasons
    assert not shown(stopped, program, [], 200).agrees
