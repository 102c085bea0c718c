"""A tape whose segments are chosen: each frame is the one of the rules, typed again in the player's tests."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import cast

import numpy as np
import pytest

from servogen.drive.commands import script
from servogen.drive.on_command import CommandedDrive, CommandedFrame, Twin
from servogen.drive.serial_link import VirtualTime
from servogen.edges import PINS
from servogen.engines.firmware import DIALECTS
from servogen.engines.tape.content import AGAIN, END, sum_of
from servogen.errors import InputError
from servogen.job import PlannedJob, load, plan_job
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Run, from_json
from servogen.report.wiring import wires
from servogen.simulator import Levels, SimulatorOptions
from servogen.verify import Verdict
from servogen.workflows.engines import PlayedJob, planned
from tests.campaigns import sampled
from tests.engines.player.command_walks import CODES, Target, Walker
from tests.engines.player.test_direction_buttons import (
    compared,
    first_rise,
    flat,
    frames_commanded,
    frames_of,
    holding,
    random_hands,
    shown,
    stepped,
)
from tests.engines.player.test_direction_buttons import job as walk_job
from tests.engines.tape.tape_jobs import text, with_content

POSES = (
    "{ arm_deg = 90, hand_deg = 90, foot_deg = 90, hold_s = 0.02 }",
    "{ arm_deg = 87, hand_deg = 92, foot_deg = 80, move_s = 0.06 }",
    "{ arm_deg = 90, hand_deg = 90, foot_deg = 90, move_s = 0.06 }",
)
SEGMENTS = (
    'segments = [{ name = "wave", from_s = 0.02, to_s = 0.12, repeat = true }, '
    '{ name = "bow", from_s = 0.02, to_s = 0.08 }]'
)
ON_TAPE = '[firmware]\nengine = "player"', '[tape]\n[firmware]\nengine = "tape"'
BUTTONS, LINE, ONE = 'buttons = { wave = "RB6", bow = "RB7" }', 'pin = "RB7"', 'button = "RB7"'


def written(commands: str = BUTTONS, firmware: str = "") -> str:
    found = text("", POSES) + firmware
    if commands:
        found = found.replace("[frame]", f"[motion.commands]\n{commands}\n{SEGMENTS}\n[frame]")
    return found


@cache
def job(commands: str = BUTTONS, firmware: str = "", old: str = "", new: str = "") -> PlannedJob:
    with TemporaryDirectory() as folder:
        file = Path(folder, "dance.toml")
        file.write_text(written(commands, firmware).replace(old, new))
        return plan_job(load(file))


@cache
def made(dialect: str = "c2c", commands: str = BUTTONS, firmware: str = "") -> tuple[PulseSchedule, Image]:
    played: PlayedJob = planned(job(commands, firmware))
    return played.plan.schedule, played.make(dialect).compilation.image


def levels(pin: str, each: list[int], schedule: PulseSchedule, start: int) -> Levels:
    changes = [(start + frame * schedule.period + 1000, level) for frame, level in enumerate(each)]
    return Levels(PINS.index(pin), ((0, 1), *changes))


def read_on(each: list[int], pin: str, commands: str, runs: list[Run], dialect: str = "c2c") -> Verdict:
    """Compare the pins with frames, while an input has a level in each frame."""
    schedule, image = made(dialect, commands)
    start = first_rise(schedule, image, SimulatorOptions())
    return compared(schedule, image, [levels(pin, each, schedule, start)], runs, SimulatorOptions())


@pytest.mark.parametrize("dialect", sampled(DIALECTS))
def test_the_segment_whose_button_is_held_plays(dialect: str) -> None:
    schedule, image = made(dialect)
    held = random_hands(np.random.default_rng(len(dialect)), 150, ("wave", "bow"))
    verdict = shown(schedule, image, held)
    assert verdict.passed, verdict.reasons


def arm(runs: tuple[Run, ...]) -> list[int]:
    return [int(pulse.width) for run in flat(runs) if (pulse := run.pulses[0])]


def test_a_segment_repeats_or_holds_its_last_frame_as_the_job_says() -> None:
    commands = made()[0].commands
    assert commands is not None
    wave, bow = commands.directions
    frames = [1494, 1489, 1483, 1489, 1494]
    assert arm((*wave.start, *wave.cycle, *wave.cycle)) == [*frames, *frames, frames[0]]
    assert (arm(bow.start), arm(bow.cycle)) == (frames[:3], frames[2:3])
    assert [arm(each.stop) for each in (wave, bow)] == [[1500], [1500]]


@pytest.mark.parametrize("dialect", sampled(DIALECTS))
def test_one_button_steps_through_the_segments(dialect: str) -> None:
    pressed = [0] * 8 + ([1] * 5 + [0] * 15) * 5
    schedule = made(dialect, ONE)[0]
    runs = frames_commanded(schedule, stepped(schedule, pressed))
    assert len({run.pulses for run in runs}) == 4
    verdict = read_on([1 - each for each in pressed], "RB7", ONE, runs, dialect)
    assert verdict.passed, verdict.reasons


@pytest.mark.parametrize("dialect", sampled(DIALECTS))
def test_a_code_of_the_line_chooses_a_segment_and_a_low_line_the_rest(dialect: str) -> None:
    of = {"forward": "wave", "back": "bow", "": ""}
    wave, bow, *_ = CODES
    line = [int(level) for level in "1111" + wave + "1" * 20 + bow + "1" * 15 + "00000" + "1" * 12]
    walker, commanded = Walker(cast(Target, None)), []
    for level in line:
        walker.hear(level)
        commanded.append(of[walker.wanted])
    assert {*commanded} == {"", "wave", "bow"}
    verdict = read_on(line, "RB7", LINE, frames_commanded(made(dialect, LINE)[0], commanded), dialect)
    assert verdict.passed, verdict.reasons


@pytest.mark.parametrize("dialect", sampled(DIALECTS))
def test_the_tape_waits_for_start_and_begins_anew_after_a_stop(dialect: str) -> None:
    schedule, image = made(dialect, "", 'start_pin = "RB6"\nstop_pin = "RB7"\n')
    frames = [*flat(schedule.lead_in)[2:], *flat(schedule.loop) * 5]
    silent = replace(frames[0], pulses=(None,) * 3)
    # Both buttons count in their third frame.
    wait, plays, off = 6, 20, 8
    runs = [*[frames[0]] * (wait + 2), *frames[: plays + 3], *[silent] * off, *frames[1:20]]
    start_at = first_rise(schedule, image, SimulatorOptions())
    stop = wait + 2 + plays
    again = stop + off
    pressed = {"RB6": [range(wait, wait + 4), range(again, again + 4)], "RB7": [range(stop, stop + 4)]}
    sources = [
        levels(pin, [1 - any(n in each for each in held) for n in range(len(runs))], schedule, start_at)
        for pin, held in pressed.items()
    ]
    assert schedule.buttons is not None
    plain = replace(schedule, buttons=None)
    verdict = compared(plain, image, sources, runs, SimulatorOptions())
    assert verdict.passed, verdict.reasons


def test_a_wrong_byte_of_a_segment_is_found_when_it_plays() -> None:
    schedule, image = made()
    assert schedule.tape is not None
    data, mark = schedule.tape.content, bytes([AGAIN])
    assert data.count(mark + bytes([sum_of(mark)])) == 4 and data.endswith(bytes([END, sum_of(bytes([END]))]))
    at = data.rindex(mark) - 2  # the last width of the last segment's cycle
    wrong = with_content(schedule, data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
    assert shown(wrong, image, holding((12, ""), (20, "wave"), (12, ""))).passed
    assert not shown(wrong, image, holding((12, ""), (20, "bow"), (12, ""))).agrees


def test_the_schedule_is_read_back() -> None:
    for commands in (BUTTONS, LINE, ONE):
        schedule = replace(made("c2c", commands)[0], tape=None)
        assert from_json(schedule.json_text(), "schedule.json") == schedule


def test_drive_presses_the_buttons_of_segments() -> None:
    told: list[CommandedFrame] = []
    twin = Twin(job())
    source = script("wait 0.4\nwave\nwait 0.6\nstop\nwait 0.4\nbow\nwait 0.4")
    CommandedDrive(twin, source, VirtualTime().time(), told.append).run(10)
    assert list(dict.fromkeys(each.direction for each in told)) == ["stance", "wave", "bow"]
    bowed = [each.widths_us["arm"] for each in told if each.direction == "bow"]
    assert bowed[-3:] == [1483] * 3


def test_the_wiring_names_the_buttons() -> None:
    uses = {wire.pin: wire.use for wire in wires(job())}
    assert uses["RB6"] == "wave button to ground, 10 kOhm pull-up to VDD"
    assert {wire.pin: wire.use for wire in wires(job(ONE))}["RB7"].startswith("motion button")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[tape]\n", "", "only the tape plays segments"),
        ('wave = "RB6"', 'wave = "RA3"', "RA3 is in use: SCL"),
        (', bow = "RB7"', "", "bow has no button"),
        (', bow = "RB7"', ', bw = "RB7"', "no segment is named 'bw'"),
        ('name = "bow"', 'name = "wave"', "two segments have the name wave"),
        ('name = "bow"', 'name = "stop"', "stop is a word of `servogen drive`"),
        ("repeat = true\nposes", "repeat = false\nposes", "waits for commands without end"),
        ("to_s = 0.08", "to_s = 9", "bow ends at 9 s"),
        ("to_s = 0.08", "to_s = 0.02", "bow ends at 0.02 s"),
        ("repeat = true\nposes", 'repeat = false\nend = "hold"\nposes', "has no end"),
        ("soft_start_s", 'start_pin = "RB5"\nsoft_start_s', "a motion on command has no start_pin"),
        (BUTTONS, f"{BUTTONS}\n{ONE}", "a motion has either buttons or button"),
        (BUTTONS, "", "RA4 is in use: SDA"),
    ],
)
def test_segments_that_cannot_be(old: str, new: str, said: str) -> None:
    assert old in written()
    with pytest.raises(InputError) as refused:
        job(old=old, new=new)
    assert said in str(refused.value)


def test_a_walk_on_command_plays_from_a_tape() -> None:
    pins = {"forward": "RB4", "back": "RB5", "left": "RB6", "right": "RB7"}
    found = planned(walk_job(", ".join(f'{name} = "{pin}"' for name, pin in pins.items()), *ON_TAPE))
    schedule, image = found.plan.schedule, found.make("c2c").compilation.image
    held = holding((12, ""), (30, "left"), (25, "back"), (25, ""))
    assert found.engine == "tape" and len({run.pulses for run in frames_of(schedule, held)}) > 40
    verdict = shown(schedule, image, held)
    assert verdict.passed, verdict.reasons
