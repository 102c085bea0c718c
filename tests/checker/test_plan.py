"""What the pins must do by a schedule: how inputs choose the frame, and which schedules are read.

The inputs follow docs/firmware.md. What they remember is compared with rules that look at all levels so far.
"""

from __future__ import annotations

import copy
import json
import random
from itertools import product
from typing import Any

import pytest

from servogen.checker.plan import (
    LARGEST,
    OVER,
    PINS,
    Button,
    DirectionButtons,
    Line,
    Memory,
    Place,
    Plan,
    PlanPosition,
    StartStop,
    StepButton,
    read_plan,
)
from servogen.errors import InputError

Inputs = StartStop | Line | StepButton | DirectionButtons


def heard(inputs: Inputs, levels: list[int]) -> list[Memory]:
    """Return the memory after each frame, in which the pins had these levels."""
    memory, found = inputs.power_up, []
    for level in levels:
        memory = inputs.hear(memory, level)
        found.append(memory)
    return found


# Lines with codes -----------------------------------------------------------------------------------------

CODES = ["01010", "00110", "11000", "11011"]


def commanded(line: str) -> int:
    """Return the direction that a line commands after all its levels, one per frame, by docs/firmware.md.

    A code is a low frame and five levels, after three high frames; five low frames in a row are the stop.
    Levels that cannot become a code any more have no effect until the line was high for three frames again.
    """
    wanted, begin, rested = 0, None, False
    for now, level in enumerate(line):
        if begin is not None:
            code = line[begin + 1 : now + 1]
            if code in CODES:
                wanted = CODES.index(code) + 1
            elif any(each.startswith(code) for each in CODES):
                continue
            begin, rested = None, False
        elif rested:
            begin = None if level == "1" else now
            continue
        wanted = 0 if line[: now + 1].endswith("00000") else wanted
        rested = line[: now + 1].endswith("111")
    return wanted


def test_a_line_commands_what_its_codes_and_its_stop_say() -> None:
    line = Line(pin=4, rest="1", rest_frames=3, stop_frames=5, codes=CODES)
    assert line.power_up == (0, "-0")
    dice = random.Random(4)
    frames = {0: 0, **dict.fromkeys(range(1, 5), 0)}
    for _ in range(60):
        pieces = ["111", "0" * 5, "1", "0", "0110", *("1110" + code + "111" for code in CODES)]
        text = "".join(dice.choice(pieces) for _ in range(12))
        for count, (wanted, _) in enumerate(heard(line, [int(level) << 4 for level in text]), 1):
            assert wanted == commanded(text[:count]), text[:count]
            frames[wanted] += 1
    assert min(frames.values()) > 100


@pytest.mark.parametrize("rest", "01")
def test_a_line_rests_at_either_level(rest: str) -> None:
    """Rest for two frames, and two frames of the other level command the stop; one code of two levels."""
    other = "10"[int(rest)]
    line = Line(pin=0, rest=rest, rest_frames=2, stop_frames=2, codes=[rest + other])

    def wanted(text: str) -> list[int]:
        return [memory[0] for memory in heard(line, [int(level) for level in text])]

    begin = rest * 2 + other
    assert line.power_up == (0, "-" + other)
    assert wanted(begin + rest + other) == [0, 0, 0, 0, 1]
    assert wanted(begin + rest + other + rest + other) == [0, 0, 0, 0, 1, 1, 1]
    assert wanted(begin + rest + other * 2) == [0, 0, 0, 0, 1, 0]  # the code ends in the first of the two
    assert wanted(rest + other + rest + other) == [0, 0, 0, 0]  # it had not rested for two frames
    assert wanted(begin + other + rest * 2) == [0] * 6
    assert heard(line, [int(level) for level in rest * 2])[-1] == (0, "")


def test_a_line_is_read_at_its_pin() -> None:
    line = Line(pin=7, rest="1", rest_frames=1, stop_frames=5, codes=["1"])
    high, low = 1 << 7, 0x1FFF & ~(1 << 7)
    assert [memory[0] for memory in heard(line, [high, low, high])] == [0, 0, 1]
    assert [memory[0] for memory in heard(line, [high, high, low, low])] == [0, 0, 0, 0]


# Buttons --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pressed", [0, 1])
@pytest.mark.parametrize("frames", [1, 3])
def test_a_press_of_the_one_button_commands_the_next_direction_or_a_stop(pressed: int, frames: int) -> None:
    """A press counts once, when the button was seen pressed in so many frames in a row."""
    rule = StepButton(Button(9, pressed), frames=frames, directions=4)
    assert rule.power_up == (0, 0, 0)
    dice = random.Random(frames)
    downs = [dice.random() < 0.75 for _ in range(300)]
    levels = [(pressed if down else 1 - pressed) << 9 | 0x40 for down in downs]
    expected, presses = [], 0
    for count in range(1, len(downs) + 1):
        run = next((n for n, down in enumerate(reversed(downs[:count])) if not down), count)
        presses += run == frames
        # 1st press: direction 1, 2nd: stop, 3rd: direction 2, … the 9th is direction 1 again
        expected.append((presses // 2 % 4 + 1 if presses % 2 else 0, min(run, frames)))
    assert [(wanted, seen) for wanted, _, seen in heard(rule, levels)] == expected
    assert presses > 20


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_a_direction_is_commanded_by_its_button_alone(frames: int) -> None:
    rule = DirectionButtons([Button(2, 0), Button(5, 1), Button(12, 1)], frames)
    assert rule.power_up == (0, 0, 0)
    dice = random.Random(frames)
    alone: list[int] = []
    levels = []
    while len(levels) < 400:
        down = dice.choice([(), (), (0,), (0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2)])
        word = (0 not in down) << 2 | (1 in down) << 5 | (2 in down) << 12 | 0x0100
        for _ in range(dice.randrange(1, 5)):
            levels.append(word)
            alone.append(down[0] + 1 if len(down) == 1 else 0)
    wanted = 0
    for count, memory in enumerate(heard(rule, levels), 1):
        now = alone[count - 1]
        run = next((n for n, one in enumerate(reversed(alone[:count])) if one != now), count)
        # Before power-up no button was pressed, for no frame that counts.
        wanted = now if run >= frames else wanted
        assert memory == (wanted, now, min(run, frames))


@pytest.mark.parametrize(
    ("start", "stop", "off", "frames"), [*product((0, 1, None), (0, 1, None), (False, True), (1, 3))]
)
def test_start_and_stop_count_frames_in_a_row(
    start: int | None, stop: int | None, off: bool, frames: int
) -> None:
    """Start counts when it was pressed in so many frames in a row, once; stop as long as it is."""
    buttons = (None if start is None else Button(3, start), None if stop is None else Button(11, stop))
    rule = StartStop(*buttons, off=off, frames=frames)
    assert rule.power_up == (int(start is None), 1, 0, 0)
    dice = random.Random(frames)
    levels = [level << 3 | other << 11 for level, other in dice.choices([*product((0, 1), (0, 1))], k=300)]

    def runs(pin: int, pressed: int | None) -> list[int]:
        found = [0]
        for level in levels:
            found.append(found[-1] + 1 if pressed is not None and level >> pin & 1 == pressed else 0)
        return found[1:]

    running, on = int(start is None), 1
    for memory, started, stopped in zip(heard(rule, levels), runs(3, start), runs(11, stop), strict=True):
        if started == frames:
            running = on = 1
        if stopped >= frames:
            running, on = 0, 0 if off else on
        assert memory == (running, on, min(started, frames), min(stopped, frames))


# Frames ---------------------------------------------------------------------------------------------------

PERIOD = 2000


def data(**changes: Any) -> dict[str, Any]:
    """Return a schedule of two servos: a lead-in of three frames, a loop of two runs with five frames."""
    found: dict[str, Any] = {
        "clock_hz": 4_000_000,
        "period_cycles": PERIOD,
        "channels": [{"pin": "RB0"}, {"pin": "RA4"}],
        "lead_in": [{"frames": 3, "pulses": [None, None]}],
        "loop": [{"frames": 2, "pulses": [[0, 300], None]}, {"frames": 3, "pulses": [[5, 1994], [305, 100]]}],
    }
    return found | changes


def plan_of(value: object) -> Plan:
    return read_plan(json.dumps(value).encode(), "schedule.json")


def reason(value: object) -> str:
    with pytest.raises(InputError) as refused:
        plan_of(value)
    assert refused.value.location is not None
    assert (refused.value.code, refused.value.location.file) == ("not-a-schedule", "schedule.json")
    return str(refused.value)


def test_pins_are_numbered_from_ra0() -> None:
    assert [PINS.index(pin) for pin in ("RA0", "RA4", "RB0", "RB7")] == [0, 4, 5, 12]
    assert len(PINS) == 13


def test_the_frames_of_a_schedule_without_inputs() -> None:
    plan = plan_of(data())
    assert (plan.clock_hz, plan.period, plan.channels, plan.buttons) == (4_000_000, PERIOD, 0x30, 0)
    assert (plan.loop, plan.loop_end, plan.ends, plan.parts, plan.waiting) == (3, 8, [3, 5, 8], [], 0)
    servo, other = 1 << 5, 1 << 4
    edges = [list(zip(*(column.tolist() for column in each), strict=True)) for each in plan.edges]
    both = servo | other
    assert edges == [
        [],
        [(0, servo), (300, 0)],
        [(5, servo), (305, both), (405, servo), (1999, 0)],
        [],
    ]
    assert plan.first == PlanPosition(3, (1, 1, 0, 0))  # the lead-in has no pulse
    frames, position = [], plan.first
    for _ in range(8):
        frames.append((position.frame, plan.run_of(position)))
        position = plan.following(position.frame, position.memory)
    assert frames == [(3, 1), (4, 1), (5, 2), (6, 2), (7, 2), (3, 1), (4, 1), (5, 2)]
    assert (
        plan.run_of(PlanPosition(0, plan.inputs.power_up))
        == plan.run_of(PlanPosition(2, plan.inputs.power_up))
        == 0
    )
    assert plan.run_of(OVER) == 3


def test_pulses_that_meet_in_a_cycle_are_one_edge_and_equal_ones_are_none() -> None:
    run = {"frames": 1, "pulses": [[10, 90], [100, 50]]}
    (cycles, levels), _ = plan_of(data(lead_in=[], loop=[run])).edges
    assert (cycles.tolist(), levels.tolist()) == ([10, 100, 150], [0x20, 0x10, 0])


def test_after_a_loop_without_pulses_and_buttons_nothing_follows() -> None:
    lead_in = [{"frames": 2, "pulses": [[0, 300], None]}]
    silent = [{"frames": 4, "pulses": [None, None]}]
    plan = plan_of(data(lead_in=lead_in, loop=silent))
    memory = plan.inputs.power_up
    assert plan.first.frame == 0
    assert plan.following(0, memory) == PlanPosition(1, memory)
    assert plan.following(1, memory) == OVER
    stop = {"start": None, "stop": {"pin": "RA0", "level": 1}, "pulses": "hold", "pressed_frames": 2}
    plan = plan_of(data(lead_in=lead_in, loop=silent, buttons=stop))
    assert plan.following(1, (1, 1, 0, 0)) == PlanPosition(2, (1, 1, 0, 0))


def buttons(**changes: Any) -> dict[str, Any]:
    found = {
        "start": {"pin": "RA0", "level": 0},
        "stop": {"pin": "RB7", "level": 1},
        "pulses": "off",
        "pressed_frames": 3,
    }
    return found | changes


def test_the_frames_of_a_schedule_with_start_and_stop() -> None:
    plan = plan_of(data(buttons=buttons()))
    assert plan.inputs == StartStop(Button(0, 0), Button(12, 1), off=True, frames=3)
    assert (plan.buttons, plan.waiting) == (0x1001, 2)
    assert plan.first == PlanPosition(3, (0, 1, 0, 0))
    assert plan.following(4, (0, 1, 2, 0)) == PlanPosition(4, (0, 1, 2, 0))  # it waits
    assert plan.following(4, (1, 1, 3, 0)) == PlanPosition(5, (1, 1, 3, 0))
    assert plan.following(7, (1, 1, 3, 2)) == PlanPosition(3, (1, 1, 3, 2))
    assert plan.following(7, (0, 0, 0, 3)) == PlanPosition(2, (0, 0, 0, 3))  # stopped: from the beginning
    assert plan.run_of(PlanPosition(4, (0, 0, 0, 3))) == 3  # without pulses
    assert plan.run_of(PlanPosition(4, (0, 1, 0, 0))) == 1
    hold = plan_of(data(buttons=buttons(pulses="hold")))
    assert hold.inputs == StartStop(Button(0, 0), Button(12, 1), off=False, frames=3)
    assert hold.following(7, (0, 1, 0, 3)) == PlanPosition(7, (0, 1, 0, 3))
    only_stop = plan_of(data(buttons=buttons(start=None)))
    assert (only_stop.waiting, only_stop.buttons) == (0, 0x1000)
    assert only_stop.following(4, (0, 0, 0, 3)) == OVER
    assert only_stop.following(4, (1, 1, 0, 2)) == PlanPosition(5, (1, 1, 0, 2))
    early = plan_of(data(lead_in=[], buttons=buttons(pressed_frames=5)))
    assert early.first.frame == early.waiting == 4


WALK = [
    {
        "code": code,
        "pin": pin,
        "level": 0,
        "start": [{"frames": 2, "pulses": [[0, 310], [310, 100]]}],
        "cycle": [{"frames": 3, "pulses": [[0, 320], [320, 100]]}],
        "stop": [{"frames": 1, "pulses": [[0, 330], [330, 100]]}],
    }
    for code, pin in (("01", "RA0"), ("10", "RA1"))
]
LINE = {"pin": "RA3", "rest_level": 1, "rest_frames": 3, "stop_frames": 5, "directions": WALK}
STEP = {"pin": "RA3", "level": 0, "pressed_frames": 3, "directions": WALK}
EACH = {"pressed_frames": 3, "directions": WALK}


@pytest.mark.parametrize(
    ("commands", "inputs", "pins"),
    [
        (LINE, Line(3, "1", 3, 5, ["01", "10"]), 0x08),
        (STEP, StepButton(Button(3, 0), 3, 2), 0x08),
        (EACH, DirectionButtons([Button(0, 0), Button(1, 0)], 3), 0x03),
    ],
)
def test_the_frames_of_a_schedule_with_commands(commands: dict[str, Any], inputs: Inputs, pins: int) -> None:
    """Lead-in 0 to 2, the stance 3 to 7; direction 1: start 8, 9, cycle 10 to 12, stop 13; 2: 14 to 19."""
    plan = plan_of(data(commands=commands))
    assert (plan.inputs, plan.buttons, plan.loop, plan.loop_end) == (inputs, pins, 3, 8)
    assert plan.parts == [(3, 8, 8, 8), (8, 10, 13, 14), (14, 16, 19, 20)]
    expected = {
        # frame: (the next one if nothing, the first, the second direction is commanded)
        0: (1, 1, 1), 1: (2, 2, 2), 2: (3, 8, 14),
        3: (4, 4, 4), 6: (7, 7, 7), 7: (3, 8, 14),
        8: (9, 9, 9), 9: (13, 10, 13), 10: (11, 11, 11), 11: (12, 12, 12), 12: (13, 10, 13), 13: (3, 8, 14),
        14: (15, 15, 15), 15: (19, 19, 16), 17: (18, 18, 18), 18: (19, 19, 16), 19: (3, 8, 14),
    }  # fmt: skip
    for frame, following in expected.items():
        for wanted, then in enumerate(following):
            memory = (wanted, *inputs.power_up[1:])
            assert plan.following(frame, memory) == PlanPosition(then, memory)
    assert [plan.run_of(PlanPosition(frame, inputs.power_up)) for frame in range(20)] == [
        0, 0, 0, 1, 1, 2, 2, 2, 3, 3, 4, 4, 4, 5, 6, 6, 7, 7, 7, 8,
    ]  # fmt: skip
    assert plan.waiting == 0


def test_an_input_is_read_once_in_a_frame() -> None:
    at_end = plan_of(data(commands=EACH))
    first = at_end.sample(Place((0, 0, 0)), 1, 1)
    assert first == Place((0, 0, 0), 0b10, 0b10)
    assert at_end.sample(first, 1, 0) is None
    assert at_end.sample(first, 0, 0) == Place((0, 0, 0), 0b10, 0b11)
    assert at_end.sample(first, 0, 1) == Place((0, 0, 0), 0b11, 0b11)
    start_stop = plan_of(data(buttons=buttons()))
    assert start_stop.sample(Place((0, 1, 0, 0)), 12, 1) == Place((0, 1, 0, 0), 1 << 12, 1 << 12)
    at_once = plan_of(data(commands=STEP))
    assert at_once.sample(Place((0, 0, 0)), 3, 0) == Place((0, 0, 1), 0, 0b1000)
    assert at_once.sample(Place((0, 0, 2)), 3, 1) == Place((0, 0, 0), 0, 0b1000)
    assert at_once.sample(Place((0, 0, 1), 0, 0b1000), 3, 0) is None
    assert at_once.sample(Place((0, 0, 1), 0, 0b0100), 3, 0) is not None


# What is read ---------------------------------------------------------------------------------------------


def changed(value: dict[str, Any], path: str, new: object) -> dict[str, Any]:
    """Return a copy of `value` with another value at `path`: keys and numbers with dots between them."""
    value = copy.deepcopy(value)
    *way, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    place: Any = value
    for key in way:
        place = place[key]
    place[last] = new
    return value


@pytest.mark.parametrize(
    ("commands", "path", "least", "most"),
    [
        (None, "period_cycles", 2000, LARGEST),
        (None, "clock_hz", 4, LARGEST),
        (None, "lead_in.0.frames", 1, LARGEST),
        (None, "loop.1.frames", 1, LARGEST),
        (None, "loop.1.pulses.0.0", 0, 5),  # the pulse ends in the last cycle of the frame
        (None, "loop.1.pulses.0.1", 1, 1994),
        (None, "buttons.start.level", 0, 1),
        (None, "buttons.stop.level", 0, 1),
        (None, "buttons.pressed_frames", 1, LARGEST),
        (LINE, "commands.rest_level", 0, 1),
        (LINE, "commands.rest_frames", 1, 99),
        (LINE, "commands.stop_frames", 1, 99),
        (STEP, "commands.level", 0, 1),
        (STEP, "commands.pressed_frames", 1, LARGEST),
        (EACH, "commands.pressed_frames", 1, LARGEST),
        (EACH, "commands.directions.1.level", 0, 1),
        (EACH, "commands.directions.0.stop.0.frames", 1, LARGEST),
    ],
)
def test_numbers_within_their_range_are_read_and_others_are_not(
    commands: dict[str, Any] | None, path: str, least: int, most: int
) -> None:
    whole = data(commands=commands) if commands else data(buttons=buttons())
    for good in (least, most):
        plan_of(changed(whole, path, good))
    for bad in (least - 1, most + 1, 1.0, True, "1", None):
        assert "not a schedule: " in reason(changed(whole, path, bad))
    assert LARGEST == 10**9
    if most == 99:
        assert f"100 is not a number of {least} to 99" in reason(changed(whole, path, 100))


@pytest.mark.parametrize(
    ("value", "why"),
    [
        (data(loop=[]), "ValueError: it needs frames in the loop and in all directions, and a pin for each"),
        (data(channels=[{"pin": "RB0"}, {"pin": "RB0"}]), "it needs frames"),
        (data(buttons=buttons(), commands=LINE), "it needs frames"),
        (changed(data(commands=LINE), "commands.directions.1.stop", []), "it needs frames"),
        (changed(data(commands=LINE), "commands.directions.0.start", []), "it needs frames"),
        (data(loop=[{"frames": 1, "pulses": [None, None]}]), "ValueError: it has no pulses"),
        (data(loop=[{"frames": 1, "pulses": [[0, 9]]}]), "ValueError: "),
        (data(channels=[{"pin": "RA5"}, {"pin": "RB0"}]), "ValueError: "),
        (data(buttons=buttons(pulses="on")), "ValueError: "),
        (data(buttons={}), "KeyError: 'start'"),
        (changed(data(commands=EACH), "commands.directions.1.pin", "RA0"), "the inputs need different pins"),
        (changed(data(buttons=buttons()), "buttons.stop.pin", buttons()["start"]["pin"]), "different pins"),
        (changed(data(commands=EACH), "commands.directions", []), "the directions need buttons"),
        (changed(data(commands=STEP), "commands.directions", []), "0 is not a number of 1"),
        (changed(data(commands=LINE), "commands.directions", []), "codes of levels"),
        (changed(data(commands=LINE), "commands.directions.1.code", "01"), "different codes of levels"),
        (changed(data(commands=LINE), "commands.directions.1.code", ""), "codes of levels"),
        (changed(data(commands=LINE), "commands.directions.1.code", "02"), "codes of levels"),
    ],
)
def test_a_schedule_that_makes_no_sense_is_refused(value: dict[str, Any], why: str) -> None:
    assert why in reason(value)


def test_a_lead_in_may_be_empty_and_pulses_may_come_first_in_the_last_run() -> None:
    assert plan_of(data(lead_in=[])).ends == [2, 5]
    late = [{"frames": 7, "pulses": [None, None]}, {"frames": 1, "pulses": [None, [0, 1]]}]
    assert plan_of(data(lead_in=[], loop=late)).first.frame == 7
