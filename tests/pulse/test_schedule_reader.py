"""Every key of a schedule.json: what it may hold, at its limits, and the words with which it is refused."""

from __future__ import annotations

import json
from typing import Any

import pytest

from servogen.errors import InputError
from servogen.motion.trajectory import MAX_FRAMES
from servogen.plan_error import PlanError
from servogen.pulse import Channel, Pulse, PulseSchedule, Run, from_json
from servogen.pulse.schedule import (
    ButtonRule,
    CodeLine,
    CommandRule,
    DirectionButtons,
    DirectionRuns,
    Input,
    StepButton,
)
from servogen.units import Clock, Cycles

RUN = {"frames": 2, "pulses": [[0, 1500], None]}
DIRECTION: dict[str, Any] = {"name": "left", "start": [RUN], "cycle": [RUN, RUN], "stop": [RUN]}
CODES: dict[str, Any] = {
    "pin": "RA4", "rest_level": 1, "rest_frames": 9, "stop_frames": 4,
    "directions": [DIRECTION | {"code": "01"}, DIRECTION | {"code": "10"}],
}  # fmt: skip
BUTTONS: dict[str, Any] = {
    "pressed_frames": 3,
    "directions": [DIRECTION | {"pin": "RB6", "level": 0}, DIRECTION | {"pin": "RB7", "level": 1}],
}
ONE_BUTTON: dict[str, Any] = {
    "pin": "RB5",
    "level": 0,
    "pressed_frames": 2,
    "directions": [DIRECTION, DIRECTION],
}
WHOLE: dict[str, Any] = {
    "version": 1,
    "clock_hz": 4_000_000,
    "period_cycles": 20_000,
    "channels": [
        {"name": "arm", "pin": "RB0", "servo": "s3001"},
        {"name": "leg", "pin": "RB1", "servo": "tiny"},
    ],
    "inputs": [{"pin": "RA0", "level": 1}],
    "buttons": {
        "start": {"pin": "RA1", "level": 0}, "stop": {"pin": "RA2", "level": 1},
        "pulses": "off", "pressed_frames": 5,
    },
    "commands": CODES,
    "plan_error": {"width_us": 0.5, "angle_deg": 1, "speed_deg_s": None, "end": "tool", "end_mm": 0.25},
    "device": "PIC16F84A",
    "lead_in": [RUN],
    "loop": [RUN, {"frames": 1, "pulses": [None, [2000, 1000]]}],
}  # fmt: skip
RUNS = (Run(2, (Pulse(Cycles(0), Cycles(1500)), None)),)
LEFT = {"name": "left", "start": RUNS, "cycle": RUNS * 2, "stop": RUNS}


def read(data: object) -> PulseSchedule:
    return from_json(json.dumps(data), "s.json")


def changed(path: str, value: object, base: dict[str, Any] = WHOLE) -> dict[str, Any]:
    """Return a schedule with another value at a path such as `loop.0.frames`; `...` removes the key."""
    data = json.loads(json.dumps(base))
    *way, last = [int(step) if step.isdecimal() else step for step in path.split(".")]
    here: Any = data
    for step in way:
        here = here[step]
    if value is ...:
        del here[last]
    else:
        here[last] = value
    return data


def expected(commands: CommandRule) -> PulseSchedule:
    return PulseSchedule(
        clock=Clock(4_000_000),
        period=Cycles(20_000),
        channels=(Channel("arm", "RB0", "s3001"), Channel("leg", "RB1", "tiny")),
        lead_in=RUNS,
        loop=(*RUNS, Run(1, (None, Pulse(Cycles(2000), Cycles(1000))))),
        inputs=(Input("RA0", 1),),
        plan_error=PlanError(0.5, angle_deg=1.0, end="tool", end_mm=0.25),
        device="PIC16F84A",
        buttons=ButtonRule(Input("RA1", 0), Input("RA2", 1), True, 5),
        commands=commands,
    )


@pytest.mark.parametrize(
    ("commands", "rule"),
    [
        (
            CODES,
            CommandRule(
                CodeLine(Input("RA4", 1), 9, 4),
                (DirectionRuns(selector="01", **LEFT), DirectionRuns(selector="10", **LEFT)),  # type: ignore[arg-type]
            ),
        ),
        (
            BUTTONS,
            CommandRule(
                DirectionButtons(3),
                tuple(
                    DirectionRuns(selector=button, **LEFT)  # type: ignore[arg-type]
                    for button in (Input("RB6", 0), Input("RB7", 1))
                ),
            ),
        ),
        (
            ONE_BUTTON,
            CommandRule(
                StepButton(Input("RB5", 0), 2),
                (DirectionRuns(selector=None, **LEFT),) * 2,  # type: ignore[arg-type]
            ),
        ),
    ],
)
def test_a_schedule_with_every_key_is_read_and_written_again(
    commands: dict[str, Any], rule: CommandRule
) -> None:
    schedule = read(changed("commands", commands))
    assert schedule == expected(rule)
    text = schedule.json_text()
    assert from_json(text, "t.json") == schedule
    assert json.loads(text) == changed("commands", commands)


def test_what_a_schedule_says_of_itself() -> None:
    schedule = read(WHOLE)
    assert repr(schedule) == "<PulseSchedule arm on RB0, leg on RB1; 2 + 3 frames of 20 ms>"
    assert (schedule.lead_in_frames, schedule.loop_frames, schedule.plan_error_us) == (2, 3, 0.5)
    assert read(changed("plan_error", ...)).plan_error_us == 0
    html = schedule._repr_html_()
    assert "2 frames, then 3 repeatedly, of 20 ms" in html
    assert all(cell in html for cell in ("arm", "RB0", "1500 to 1500", "leg", "RB1", "1000 to 1000"))
    silent = read(changed("loop.1.pulses.1", None))._repr_html_()
    assert "none" in silent


def test_a_start_button_waits_for_all_but_one_of_its_frames() -> None:
    pressed = Input("RA1", 0)
    assert ButtonRule(pressed, None, False, 5).waiting == 4
    assert ButtonRule(None, pressed, False, 5).waiting == 0


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("version", 1),
        ("clock_hz", 1), ("clock_hz", 10**9),
        ("period_cycles", 3001), ("period_cycles", 10**9),
        ("loop.0.frames", 1), ("loop.0.pulses.0", [0, 1]), ("loop.0.pulses.0", [1, 19_998]),
        ("lead_in", []),
        ("lead_in.0.frames", MAX_FRAMES - 3),
        ("inputs.0.level", 0),
        ("buttons.start", None), ("buttons.stop", None), ("buttons.pulses", "hold"),
        ("buttons.pressed_frames", 1), ("buttons.pressed_frames", 10**9),
        ("commands.rest_frames", 1), ("commands.stop_frames", 1), ("commands.rest_level", 0),
        ("commands.directions.0.start.0.frames", MAX_FRAMES),
        ("plan_error.width_us", 0), ("plan_error.width_us", 1e9), ("plan_error.angle_deg", None),
        ("plan_error.speed_deg_s", 3),
        ("inputs", []), ("device", None), ("buttons", None), ("plan_error", None), ("commands", None),
        ("inputs", ...), ("device", ...), ("buttons", ...), ("plan_error", ...), ("commands", ...),
    ],
)  # fmt: skip
def test_what_is_allowed(path: str, value: object) -> None:
    schedule = read(changed(path, value))
    assert from_json(schedule.json_text(), "again.json") == schedule


WHOLE_1 = "is not a whole number of 1 to 1000000000: "
WIRE = {"pin": "RA1", "from": "RB0", "frames": 4, "cycles": 5, "quiet_cycles": 9, "restart": "RA4",
        "restart_cycles": 768}  # fmt: skip

WRONG = [
    ("version", 2, "version", "is 2, this servogen reads version 1"),
    ("version", 0, "version", "is 0, this servogen reads version 1"),
    ("version", "1", "version", "is not a whole number of 0 to 1000000000: '1'"),
    ("version", -1, "version", "is not a whole number of 0 to 1000000000: -1"),
    ("clock_hz", 0, "clock_hz", WHOLE_1 + "0"),
    ("clock_hz", 10**9 + 1, "clock_hz", WHOLE_1 + "1000000001"),
    ("clock_hz", True, "clock_hz", WHOLE_1 + "True"),
    ("clock_hz", 4e6, "clock_hz", WHOLE_1 + "4000000.0"),
    ("clock_hz", "x" * 38, "clock_hz", WHOLE_1 + f"'{'x' * 38}'"),
    ("clock_hz", "x" * 39, "clock_hz", WHOLE_1 + f"'{'x' * 36}…"),
    ("period_cycles", 0, "period_cycles", WHOLE_1 + "0"),
    ("channels", [], "channels", "is empty: a schedule has at least one channel"),
    ("channels", {}, "channels", "is not an array"),
    ("channels.1.name", "arm", "channels", "two channels have the name arm"),
    ("channels.1.pin", "RB0", "channels", "two channels have the pin RB0"),
    ("channels.1.pin", "RB8", "channels[1].pin", "unknown pin 'RB8'"),
    ("channels.0.servo", 5, "channels[0].servo", "is not a text: 5"),
    ("channels.0", 5, "channels[0]", "is not an object with name, pin, servo"),
    ("channels.0.servo", ..., "channels[0]", "'servo' is missing"),
    ("channels.0.srvo", 5, "channels[0].srvo", "unknown key"),
    ("loop", [], "loop", "is empty: the motion must be followed by a frame, at least one without pulses"),
    ("loop", ..., "schedule", "'loop' is missing"),
    ("lop", [], "lop", "unknown key"),
    ("lead_in.0.frames", 0, "lead_in[0].frames", WHOLE_1 + "0"),
    ("lead_in.0.frames", MAX_FRAMES - 2, "loop", f"the schedule has {MAX_FRAMES + 1} frames"),
    ("loop.1.pulses", [None], "loop[1].pulses", "has 1 entries for 2 channels"),
    ("loop.1.pulses.1", [1], "loop[1].pulses[1]", "is [rise, width] or null, not 1 numbers"),
    ("loop.1.pulses.1", [-1, 1], "loop[1].pulses[1][0]", "is not a whole number of 0 to 1000000000: -1"),
    ("loop.1.pulses.1", [0, 0], "loop[1].pulses[1][1]", WHOLE_1 + "0"),
    ("loop.1.pulses.1", [1, 19_999], "loop[1].pulses[1]", "ends in cycle 20000, its frame has only 20000"),
    ("inputs.0.pin", "RB0", "inputs[0].pin", "RB0 is a servo's"),
    ("inputs.0.pin", "RC0", "inputs[0].pin", "unknown pin 'RC0'"),
    ("inputs.0.level", 2, "inputs[0].level", "is neither 0 nor 1: 2"),
    ("inputs.0.level", -1, "inputs[0].level", "is not a whole number of 0 to 1000000000: -1"),
    ("buttons", {**WHOLE["buttons"], "start": None, "stop": None}, "buttons",
     "has neither 'start' nor 'stop'"),
    ("buttons.pulses", "on", "buttons.pulses", "is neither 'off' nor 'hold': 'on'"),
    ("buttons.pressed_frames", 0, "buttons.pressed_frames", WHOLE_1 + "0"),
    ("buttons.start.level", 2, "buttons.start.level", "is neither 0 nor 1: 2"),
    ("buttons.stop.pin", "RB1", "buttons.stop.pin", "RB1 is a servo's"),
    ("commands.rest_frames", 0, "commands.rest_frames", WHOLE_1 + "0"),
    ("commands.stop_frames", 0, "commands.stop_frames", WHOLE_1 + "0"),
    ("commands.directions", [], "commands.directions", "is empty: at least one direction can be commanded"),
    ("commands.directions.1.code", "01", "commands.directions", "two directions have the same code"),
    ("commands.directions.1.code", "", "commands.directions[1].code", "is not a string of 0 and 1: ''"),
    ("commands.directions.1.code", "012", "commands.directions[1].code", "is not a string of 0 and 1: '012'"),
    ("commands.directions.1.code", 1, "commands.directions[1].code", "is not a text: 1"),
    ("commands.directions.0.name", 1, "commands.directions[0].name", "is not a text: 1"),
    ("commands.directions.0.stop", [], "commands.directions[0].stop",
     "is empty: at least one frame is needed"),
    ("commands.directions.0.cycle.1.frames", 0, "commands.directions[0].cycle[1].frames", WHOLE_1 + "0"),
    ("commands.directions.0.start.0.frames", MAX_FRAMES + 1, "commands.directions[0].start",
     "has too many frames"),
    ("commands.directions.0.start.0.pulses.0", [0, 20_000], "commands.directions[0].start[0].pulses[0]",
     "ends in cycle 20000, its frame has only 20000"),
    ("commands", 5, "commands",
     "is not an object with pin, rest_level, rest_frames, stop_frames, directions"),
    ("commands", {"pressed_frames": 0, "directions": []}, "commands.pressed_frames", WHOLE_1 + "0"),
    ("commands", {**ONE_BUTTON, "pressed_frames": 0}, "commands.pressed_frames", WHOLE_1 + "0"),
    ("commands", changed("directions.1.pin", "RB6", BUTTONS), "commands.directions",
     "two directions have the same pin"),
    ("commands", changed("directions.1.level", 2, BUTTONS), "commands.directions[1].level",
     "is neither 0 nor 1: 2"),
    ("plan_error.width_us", None, "plan_error.width_us", "is not a number from 0 to 1e+09: None"),
    ("plan_error.width_us", -0.5, "plan_error.width_us", "is not a number from 0 to 1e+09: -0.5"),
    ("plan_error.width_us", 1.5e9, "plan_error.width_us", "is not a number from 0 to 1e+09: 1500000000.0"),
    ("plan_error.angle_deg", True, "plan_error.angle_deg", "is not a number from 0 to 1e+09: True"),
    ("plan_error.end", None, "plan_error",
     "has only one of 'end' and 'end_mm': state both, or null for both"),
    ("plan_error.end_mm", None, "plan_error",
     "has only one of 'end' and 'end_mm': state both, or null for both"),
    ("plan_error.end_mm", "1", "plan_error.end_mm", "is not a number from 0 to 1e+09: '1'"),
    ("device", 84, "device", "is not a text: 84"),
    ("wire", {**WIRE, "restart_cycles": 0}, "wire.restart_cycles", WHOLE_1 + "0"),
    ("wire", {**WIRE, "restart": "RA3"}, "wire.restart", "is not RA4: 'RA3'"),
    ("wire", {**WIRE, "crystal_ppm": 1001}, "wire.crystal_ppm", "is not a whole number of 0 to 1000: 1001"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "key", "message"), WRONG)
def test_what_is_refused_with_its_key_and_reason(path: str, value: object, key: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        read(changed(path, value))
    error = caught.value
    assert error.location is not None
    assert (error.location.file, error.location.key, error.message) == ("s.json", key, message)


def test_too_many_frames_say_how_many_are_allowed() -> None:
    for path in ("lead_in.0.frames", "commands.directions.0.stop.0.frames"):
        with pytest.raises(InputError) as caught:
            read(changed(path, MAX_FRAMES + 1))
        assert caught.value.hint == f"at most {MAX_FRAMES}"


OBJECT = "is not an object with version, clock_hz, period_cycles, channels, lead_in, loop"


@pytest.mark.parametrize(
    ("text", "message", "line", "column"),
    [
        ('{\n "version": x}', "JSON syntax: Expecting value", 2, 13),
        ("[" * 100_000, "JSON syntax: nested too deeply", None, None),
        ("[]", f"{OBJECT}, inputs, buttons, commands, plan_error, device, wire, tape", None, None),
    ],
)
def test_a_text_that_is_not_a_schedule(text: str, message: str, line: int | None, column: int | None) -> None:
    with pytest.raises(InputError) as caught:
        from_json(text, "s.json")
    assert caught.value.message == message
    place = caught.value.location
    assert place is not None
    assert (place.file, place.line, place.column) == ("s.json", line, column)


def test_a_number_of_more_digits_than_python_reads_is_an_error_of_the_file() -> None:
    with pytest.raises(
        InputError, match=r"^s\.json: error: JSON syntax: Exceeds the limit \(4300 digits\)"
    ) as caught:
        from_json(f'{{"version": {"1" * 4301}}}', "s.json")
    assert caught.value.code == "json-syntax"
    with pytest.raises(InputError, match="'clock_hz' is missing"):
        from_json(f'{{"version": {"1" * 4300}}}', "s.json")
