"""Buttons that command a walk: every frame is the one of the rules in docs/firmware.md, typed again here."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from servogen.checker import check_certificate, read_certificate
from servogen.checker import plan as checker_plan
from servogen.drive.commands import script
from servogen.drive.on_command import CommandedDrive, CommandedFrame, Twin
from servogen.drive.serial_link import VirtualTime
from servogen.edges import HIGH, PINS, EdgeTrace
from servogen.engines.board import board_of, inputs_of
from servogen.engines.firmware import DIALECTS, Firmware
from servogen.errors import InputError
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.pic.image import Image
from servogen.prove import certificate, prove_for_all
from servogen.prove.commands import ButtonCommands, OneButton
from servogen.pulse.expected import expected
from servogen.pulse.schedule import (
    CommandRule,
    DirectionButtons,
    Input,
    PulseSchedule,
    Run,
    StepButton,
    from_json,
)
from servogen.report.wiring import wires
from servogen.simulator import Levels, Machine, SimulatorOptions, Stimuli
from servogen.units import Cycles
from servogen.verify import Verdict, verify
from servogen.workflows.engines import PlayedJob, planned
from tests.campaigns import sampled

ROBOT = """
name = "two"
kind = "hexapod"
leg = "pantograph"
lengths_mm = { ab = 25, bc = 40, cd = 40, df = 100 }
mount = [
    { name = "L1", x_mm = 0, y_mm = 50, mirrored = false },
    { name = "R1", x_mm = 0, y_mm = -50, mirrored = true },
]
"""
SERVOS = "\n".join(
    f'[[servo]]\nname = "{joint}"\npin = "RB{number}"\nmodel = "mpx-tiny-s"\njoint = "{joint}"\n'
    f"reverse = {str(joint.startswith('R')).lower()}"
    for number, joint in enumerate(("L1_alpha", "L1_beta", "R1_alpha", "R1_beta"))
)
COMMANDS = "commands = { forward_mm = 30, turn_deg = 15, buttons = { BUTTONS } }"
TWO, FOUR = 'back = "RA0", left = "RB7"', 'forward = "RB4", back = "RA0", left = "RB7", right = "RA4"'
TEXT = f"""
[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[robot]
name = "two.toml"
{SERVOS}
[walk]
duty = 0.5
lifts = {{ L1 = 0.0, R1 = 0.5 }}
allow_falling = true
{COMMANDS}
lift_mm = 20
body_height_mm = 130
cycle_s = 0.32
[frame]
per_slot = 2
[firmware]
engine = "player"
soft_start_s = 0.1
"""
BUTTONS = f"buttons = {{ {TWO} }}"
PINS_OF = {"forward": "RB4", "back": "RA0", "left": "RB7", "right": "RA4"}
SEEN = 3
"""The frames in which the same button must be held, or none."""


@cache
def job(buttons: str = TWO, old: str = "", new: str = "") -> PlannedJob:
    """Return the planned two-legged robot with these buttons, and `old` replaced by `new`."""
    with TemporaryDirectory() as folder:
        (Path(folder) / "two.toml").write_text(ROBOT)
        path = Path(folder) / "job.toml"
        path.write_text(TEXT.replace("BUTTONS", buttons).replace(old, new))
        return plan_job(load(path))


@cache
def made(
    dialect: str = "c2c", buttons: str = TWO, old: str = "", new: str = ""
) -> tuple[PlayedJob, Firmware]:
    found = planned(job(buttons, old, new))
    return found, found.make(dialect)


def schedule_of(buttons: str = TWO) -> PulseSchedule:
    return made("c2c", buttons)[0].plan.schedule


Held = list[frozenset[str]]
"""The buttons that are held in each frame."""


def flat(runs: tuple[Run, ...]) -> list[Run]:
    return [replace(run, frames=1) for run in runs for _ in range(run.frames)]


def frames_of(schedule: PulseSchedule, held: Held) -> list[Run]:
    """Return the frame that the rules ask for in each frame: a button counts once it alone was held in three
    frames, and so does none or several.
    """
    commanded: list[str] = []
    chosen: list[str] = []
    for buttons in held:
        chosen.append(next(iter(buttons)) if len(buttons) == 1 else "")
        same = len(chosen) >= SEEN and len(set(chosen[-SEEN:])) == 1
        commanded.append(chosen[-1] if same else commanded[-1] if commanded else "")
    return frames_commanded(schedule, commanded)


def frames_commanded(schedule: PulseSchedule, commanded: list[str]) -> list[Run]:
    """Return each frame if this is commanded after it: a direction is left only at the end of a part, by its
    stop.
    """
    assert schedule.commands is not None
    parts = {
        each.name: [flat(each.start), flat(each.cycle), flat(each.stop)]
        for each in schedule.commands.directions
    }
    coming = deque(flat(schedule.lead_in))
    wanted = direction = ""
    stops = False
    found = []
    for after in commanded:
        if not coming and direction and not stops:
            stops = wanted != direction
            coming.extend(parts[direction][2 if stops else 1])
        elif not coming:
            direction, stops = wanted, False
            coming.extend(parts[direction][0] if direction else flat(schedule.loop))
        found.append(coming.popleft())
        wanted = after
    return found


def first_rise(schedule: PulseSchedule, image: Image, options: SimulatorOptions) -> int:
    machine = Machine(image, schedule.clock, board_of(schedule, options), inputs_of(schedule))
    found = machine.run_to_edge(PINS.index(schedule.channels[0].pin), HIGH, 50 * schedule.period)
    assert found is not None
    return int(found)


def shown(schedule: PulseSchedule, image: Image, held: Held, pressed: int = 0, seed: int = 0) -> Verdict:
    """Compare what the pins do while buttons are held with the frames that the rules ask for."""
    assert schedule.commands is not None
    options = SimulatorOptions(start_seed=seed)
    start = first_rise(schedule, image, options)
    sources = []
    for direction in schedule.commands.directions:
        changes = [(0, 1 - pressed)]
        for frame, buttons in enumerate(held):
            level = pressed if direction.name in buttons else 1 - pressed
            changes.append((start + frame * schedule.period + 1000, level))
        assert isinstance(direction.selector, Input)
        sources.append(Levels(PINS.index(direction.selector.pin), tuple(changes)))
    return compared(schedule, image, sources, frames_of(schedule, held), options)


def compared(
    schedule: PulseSchedule, image: Image, sources: list[Levels], runs: list[Run], options: SimulatorOptions
) -> Verdict:
    """Compare what the pins do with these frames."""
    wanted = replace(schedule, lead_in=tuple(runs), loop=(runs[-1],), inputs=(), commands=None)
    limit = Cycles((len(runs) + 3) * schedule.period)
    machine = Machine(image, schedule.clock, board_of(schedule, options), Stimuli(sources))
    trace = EdgeTrace(schedule.clock, machine.stream(limit), limit)
    return verify(expected(wanted), trace, Cycles(len(runs) * schedule.period))


def stepped(schedule: PulseSchedule, pressed: list[int]) -> list[str]:
    """Return what is commanded after each frame: a press counts in its third frame; it is a stop, or, if the
    robot is to stand, the next direction.
    """
    assert schedule.commands is not None
    names = [each.name for each in schedule.commands.directions]
    wanted, latest, found = "", -1, []
    for frame in range(len(pressed)):
        if "".join(map(str, pressed[: frame + 1])).endswith("0" + SEEN * "1"):
            if not wanted:
                latest = (latest + 1) % len(names)
            wanted = "" if wanted else names[latest]
        found.append(wanted)
    return found


def holding(*pieces: tuple[int, str]) -> Held:
    """Return the buttons in each frame of pieces of so many frames, by names."""
    return [frozenset(names.split()) for frames, names in pieces for _ in range(frames)]


def random_hands(rng: np.random.Generator, frames: int, names: tuple[str, ...]) -> Held:
    """Return buttons that are held for long or too briefly, bounce, or are held together."""
    found: Held = []
    while len(found) < frames:
        one, other = (names[rng.integers(len(names))] for _ in range(2))
        kind = int(rng.integers(5))
        if kind == 0:
            found += holding((int(rng.integers(1, 80)), ""))
        elif kind == 1:
            found += holding((int(rng.integers(3, 150)), one))
        elif kind == 2:
            found += holding((int(rng.integers(1, 4)), one), (int(rng.integers(1, 4)), other))
        elif kind == 3:
            found += [frozenset((one,) if bit else ()) for bit in rng.integers(0, 2, 12)] + holding((20, one))
        else:
            found += holding((int(rng.integers(1, 40)), f"{one} {other}"))
    return found[:frames]


@pytest.mark.parametrize("dialect", sampled(DIALECTS))
def test_random_hands_walk_as_the_rules_say(dialect: str) -> None:
    image = made(dialect, FOUR)[1].compilation.image
    held = random_hands(np.random.default_rng(len(dialect)), 1200, tuple(PINS_OF))
    verdict = shown(schedule_of(FOUR), image, held, seed=len(dialect))
    assert verdict.passed, verdict.reasons


def test_a_held_button_walks_and_a_released_one_ends_in_the_stance() -> None:
    schedule = schedule_of()
    held = holding((80, ""), (120, "left"), (120, ""))
    runs, commands = frames_of(schedule, held), schedule.commands
    assert commands is not None
    left = next(each for each in commands.directions if each.name == "left")
    assert runs[83 : 83 + 16] == flat(left.start)
    assert runs[-1].pulses == schedule.loop[0].pulses
    assert shown(schedule, made()[1].compilation.image, held).passed


def test_two_frames_are_too_few_and_three_are_enough() -> None:
    schedule, image = schedule_of(), made()[1].compilation.image
    stance = schedule.loop[0].pulses
    for frames, moves in ((2, False), (3, True)):
        held = holding((80, ""), (frames, "back"), (80, ""))
        assert any(run.pulses != stance for run in frames_of(schedule, held)[80:]) == moves
        assert shown(schedule, image, held).passed


def test_two_buttons_at_once_stop_the_walk() -> None:
    schedule, image = schedule_of(), made()[1].compilation.image
    held = holding((80, ""), (60, "back"), (100, "back left"), (60, "left"))
    runs, commands = frames_of(schedule, held), schedule.commands
    assert commands is not None
    assert [run.pulses for run in runs[210:240]] == [schedule.loop[0].pulses] * 30
    assert runs[243] == flat(commands.directions[1].start)[0]
    assert shown(schedule, image, held).passed
    assert not shown(schedule, image, [*held[:140], *holding((100, "back")), *held[240:]]).reasons


def test_buttons_to_vdd_are_pressed_while_their_pins_are_high() -> None:
    found, firmware = made("c2c", TWO, "buttons =", 'button_level = "high", buttons =')
    schedule = found.plan.schedule
    assert schedule.inputs == (Input("RA0", 0), Input("RB7", 0))
    held = holding((80, ""), (60, "left"), (90, ""))
    assert shown(schedule, firmware.compilation.image, held, pressed=1).passed


@pytest.mark.campaign
def test_every_press_is_proven_and_the_certificate_is_valid() -> None:
    schedule, image = schedule_of(), made()[1].compilation.image
    proof = prove_for_all(image, schedule)
    assert proof.proven, proof.reason
    text = schedule.json_text().encode()
    claim = read_certificate(certificate(proof, image, schedule, text), "c")
    assert claim.held == {}
    checked = check_certificate(claim, image, text, "schedule.json")
    assert checked.states == claim.count > 1000


@pytest.mark.parametrize(("old", "new"), sampled([(3, 2), (8, 6)]))
def test_a_changed_word_is_refuted_with_a_counterexample(old: int, new: int) -> None:
    """A press counts after other numbers of frames; the button of left, twice 4, walks right, twice 3."""
    schedule, compilation = schedule_of(), made()[1].compilation
    (listen,) = (each for each in compilation.listing.functions if each.name == "listen")
    words = compilation.image.program
    literals = (at for at in range(listen.start, listen.end) if words[at] >> 12 == 3)
    address = next(at for at in literals if words[at] & 0xFF == old)
    changed = {**words, address: words[address] - old + new}
    proof = prove_for_all(replace(compilation.image, program=changed), schedule)
    assert not proof.proven
    assert proof.counterexample is not None


def test_the_rule_of_the_prover_counts_what_alone_is_pressed() -> None:
    """Read, for button n: bit 2n + 1, and bit 2n + 2 while it is pressed. Heard: direction + 8 per frame."""
    rule = ButtonCommands(DirectionButtons(3), (Input("RA0", 0), Input("RB7", 0)))
    heard = wanted = 0
    seen = []
    for back, left in ((0, 1), (0, 1), (0, 1), (0, 0), (0, 0), (0, 0), (1, 0), (1, 1), (1, 1), (1, 1)):
        read = 0
        for pin, level in ((PINS.index("RB7"), left), (PINS.index("RA0"), back)):
            assert rule.unread(read) is not None
            now = rule.sampled(heard, wanted, read, pin, level)
            assert now is not None
            heard, wanted, read = now
        assert rule.unread(read) is None
        assert rule.sampled(heard, wanted, read, PINS.index("RA0"), back) is None
        heard, wanted = rule.ended(heard, wanted, read)
        seen.append((heard, wanted))
    assert seen == [
        (9, 0), (17, 0), (25, 1), (8, 1), (16, 1), (24, 0), (10, 0), (8, 0), (16, 0), (24, 0),
    ]  # fmt: skip


def test_the_schedule_is_read_back() -> None:
    schedule = schedule_of(FOUR)
    assert schedule.inputs == tuple(Input(pin, 1) for pin in PINS_OF.values())
    assert isinstance(schedule.commands, CommandRule)
    text = schedule.json_text()
    assert from_json(text, "schedule.json") == schedule
    plan = checker_plan.read_plan(text.encode(), "schedule.json")
    buttons = [checker_plan.Button(PINS.index(pin), 0) for pin in PINS_OF.values()]
    assert plan.inputs == checker_plan.DirectionButtons(buttons, 3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"pressed_frames": 3', '"pressed_frames": 0', "commands.pressed_frames: is not a whole number"),
        ('"back", "pin": "RA0"', '"back", "pin": "RB0"', "commands.directions[0].pin: RB0 is a servo's"),
        ('"back", "pin": "RA0"', '"back", "pin": "RB7"', "two directions have the same pin"),
        ('"back", "pin": "RA0", ', '"back", ', "commands.directions[0]: 'pin' is missing"),
    ],
)
def test_a_schedule_with_wrong_buttons_is_refused(old: str, new: str, message: str) -> None:
    text = schedule_of().json_text()
    assert old in text
    with pytest.raises(InputError) as refused:
        from_json(text.replace(old, new), "schedule.json")
    assert message.split(": ")[-1] in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (BUTTONS, 'button = "RB1"', "RB1 is in use: L1_beta"),
        (BUTTONS, 'button = "RA9"', "unknown pin 'RA9'"),
        (BUTTONS, 'button = "RA0", pin = "RA1"', "either pin or button"),
        (BUTTONS, f'button = "RA1", {BUTTONS}', "either buttons or button"),
        (TWO, 'back = "RB1", left = "RB7"', "RB1 is in use: L1_beta"),
        (TWO, 'back = "RB7", left = "RB7"', "RB7 is in use: the button of back"),
        (TWO, 'back = "RC0", left = "RB7"', "unknown pin 'RC0'"),
        (TWO, 'up = "RB7"', "unknown key 'up'"),
        (TWO, "", "no direction has a button"),
        (TWO, 'left = "RB7"', "neither forward nor back has a button"),
        ("turn_deg = 15, ", "", "left has a button but no step"),
        ("buttons =", 'pin = "RA1", buttons =', "either pin or buttons"),
        (BUTTONS, 'button_level = "high"', "there are no buttons"),
        ("soft_start_s = 0.1", 'stop_pin = "RA1"', "has no start_pin and no stop_pin"),
    ],
)
def test_a_job_with_wrong_buttons_is_refused(old: str, new: str, message: str) -> None:
    assert old in TEXT.replace("BUTTONS", TWO)
    with pytest.raises(InputError) as refused:
        job(TWO, old, new)
    assert message in str(refused.value)
    assert "job.toml:" in str(refused.value)


def test_twelve_servos_leave_a_pin_for_one_button() -> None:
    text = (Path(__file__).parents[3] / "jobs" / "hexapod-command.toml").read_text()
    commands = 'commands = { forward_mm = 40, buttons = { forward = "RA4" } }'
    hexapod = plan_job(loads(re.sub("commands = .*", commands, text), "job.toml"))
    found = planned(hexapod)
    firmware = found.make("sdcc")
    assert firmware.compilation.words <= 1000
    assert firmware.compilation.ram_bytes <= 68
    assert "RA4: forward while it is held: button to ground" in firmware.text
    assert ("RA4", "forward button to ground, 10 kOhm pull-up to VDD") in [
        (wire.pin, wire.use) for wire in wires(hexapod)
    ]


ONE = 'button = "RB7"'


@pytest.mark.parametrize("dialect", sampled(DIALECTS))
def test_one_button_steps_through_the_directions(dialect: str) -> None:
    found, firmware = made(dialect, TWO, BUTTONS, ONE)
    schedule, image = found.plan.schedule, firmware.compilation.image
    assert schedule.inputs == (Input("RB7", 1),)
    rng = np.random.default_rng(3)
    pressed = [0] * 60
    for _ in range(40):
        pressed += [1] * int(rng.integers(1, 7)) + [0] * int(rng.integers(1, 60))
    options = SimulatorOptions(start_seed=len(dialect))
    begin = first_rise(schedule, image, options) + 1000
    changes = [(0, 1), *((begin + frame * schedule.period, 1 - on) for frame, on in enumerate(pressed))]
    commanded = stepped(schedule, pressed)
    assert list(dict.fromkeys(commanded)) == ["", "forward", "back", "left", "right"]
    runs = frames_commanded(schedule, commanded)
    verdict = compared(schedule, image, [Levels(PINS.index("RB7"), tuple(changes))], runs, options)
    assert verdict.passed, verdict.reasons


@pytest.mark.campaign
def test_every_press_of_one_button_is_proven_and_a_changed_word_refuted() -> None:
    """Two directions: the last one is twice 2. With twice 1 in its place, one of them is never walked."""
    found, firmware = made("c2c", TWO, f"turn_deg = 15, {BUTTONS}", ONE)
    schedule, compilation = found.plan.schedule, firmware.compilation
    proof = prove_for_all(compilation.image, schedule)
    assert proof.proven, proof.reason
    text = schedule.json_text().encode()
    assert from_json(text.decode(), "schedule.json") == schedule
    claim = read_certificate(certificate(proof, compilation.image, schedule, text), "c")
    assert check_certificate(claim, compilation.image, text, "schedule.json").states == claim.count > 1000
    (listen,) = (each for each in compilation.listing.functions if each.name == "listen")
    words = compilation.image.program
    literals = (at for at in range(listen.start, listen.end) if words[at] >> 12 == 3)
    address = next(at for at in literals if words[at] & 0xFF == 4)
    wrong = replace(compilation.image, program={**words, address: words[address] - 2})
    refuted = prove_for_all(wrong, schedule)
    assert not refuted.proven
    assert refuted.counterexample is not None


@pytest.mark.parametrize("gait", sampled(["tripod", "ripple"]))
def test_one_button_commands_all_four_directions_of_twelve_servos(gait: str) -> None:
    text = (Path(__file__).parents[3] / "jobs" / "hexapod-command.toml").read_text()
    commands = 'commands = { forward_mm = 40, turn_deg = 20, button = "RA4" }'
    text = re.sub("commands = .*", commands, text).replace('"tripod"', f'"{gait}"')
    hexapod = plan_job(loads(text, "job.toml"))
    firmware = planned(hexapod).make("sdcc")
    assert firmware.compilation.words <= 1000
    assert firmware.compilation.ram_bytes <= 68
    assert "RA4: pressed for 3 frames: button to ground" in firmware.text
    assert "walk button to ground, 10 kOhm pull-up to VDD" in [wire.use for wire in wires(hexapod)]


def test_drive_presses_the_one_button_of_a_simulated_chip() -> None:
    states: list[CommandedFrame] = []
    text = "wait 1\nnext\nwait 1\nstop\nstop\nwait 1\nnext\nwait 1\nstop\nwait 2\n"
    drive = CommandedDrive(Twin(job(TWO, BUTTONS, ONE)), script(text), VirtualTime().time(), states.append)
    drive.run(60)
    walked = list(dict.fromkeys((state.direction, state.part) for state in states))
    assert walked == [
        ("lead-in", ""),
        ("stance", ""),
        *(("forward", part) for part in ("start", "cycle", "stop")),
        *(("back", part) for part in ("start", "cycle", "stop")),
    ]
    assert (states[-1].direction, states[-1].part) == ("stance", "")


def test_drive_holds_the_buttons_of_a_simulated_chip() -> None:
    states: list[CommandedFrame] = []
    text = "wait 1\nleft\nwait 1\nback\nwait 1\nstop\nwait 2\n"
    drive = CommandedDrive(Twin(job()), script(text), VirtualTime().time(), states.append)
    drive.run(60)
    walked = [(state.direction, state.part) for state in states]
    assert [each for each, before in zip(walked, [None, *walked], strict=False) if each != before] == [
        ("lead-in", ""),
        ("stance", ""),
        *(("left", part) for part in ("start", "cycle", "stop")),
        *(("back", part) for part in ("start", "cycle", "stop")),
        ("stance", ""),
    ]
    with pytest.raises(InputError, match="unknown command 'forward'"):
        drive.command("forward")


def test_the_rule_of_one_button_steps_once_for_each_press_and_needs_a_look_in_each_frame() -> None:
    """Pressed (low) for three frames or more: a direction and a stop in turn."""
    rule = OneButton(StepButton(Input("RA4", 0), 3), 2)
    heard = wanted = 0
    for frames, after in ((2, 0), (3, 1), (5, 0), (2, 0), (4, 2), (3, 0), (3, 1)):
        for level in (*[0] * frames, 1):
            assert rule.unread(0) == PINS.index("RA4")
            now = rule.sampled(heard, wanted, 0, PINS.index("RA4"), level)
            assert now is not None
            heard, wanted, read = now
            assert rule.unread(read) is None
            assert (
                rule.sampled(heard, wanted, read, PINS.index("RA4"), 1 - level) is None
            )  # the first look counts
            heard, wanted = rule.ended(heard, wanted, read)
        assert wanted == after, frames
