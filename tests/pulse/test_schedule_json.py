"""A schedule as JSON is the same schedule; a wrong file is refused with its key."""

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.errors import InputError
from servogen.pulse import Channel, Pulse, PulseSchedule, Run, from_json
from servogen.pulse.schedule import Input
from servogen.units import Clock, Cycles

SCHEDULE = PulseSchedule(
    Clock(4_000_000),
    Cycles(20_000),
    (Channel("vertical", "RB0", "mpx-tiny-s"), Channel("horizontal", "RA4", "mpx-tiny-s")),
    (Run(3, (None, None)),),
    (Run(20, (Pulse(Cycles(0), Cycles(1500)), None)), Run(1, (None, Pulse(Cycles(2000), Cycles(1250))))),
)

TEXT = """{
  "version": 1,
  "clock_hz": 4000000,
  "period_cycles": 20000,
  "channels": [
    {"name": "vertical", "pin": "RB0", "servo": "mpx-tiny-s"},
    {"name": "horizontal", "pin": "RA4", "servo": "mpx-tiny-s"}
  ],
  "lead_in": [
    {"frames": 3, "pulses": [null, null]}
  ],
  "loop": [
    {"frames": 20, "pulses": [[0, 1500], null]},
    {"frames": 1, "pulses": [null, [2000, 1250]]}
  ]
}
"""


def test_the_text_is_this_one() -> None:
    assert SCHEDULE.json_text() == TEXT


def test_reading_undoes_writing() -> None:
    assert from_json(TEXT, "schedule.json") == SCHEDULE


def changed(*path: Any, to: Any) -> str:
    data = json.loads(TEXT)
    at = data
    for step in path[:-1]:
        at = at[step]
    at[path[-1]] = to
    return json.dumps(data)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "s.json:1:2: error: JSON syntax"),
        ("[]", "schedule: is not an object with version"),
        (changed("version", to=2), "version: is 2, this servogen reads version 1"),
        (changed("clock_hz", to=0), "clock_hz: is not a whole number of 1 to 1000000000: 0"),
        (changed("clock_hz", to=True), "clock_hz: is not a whole number"),
        (changed("period_cycles", to=2e4), "period_cycles: is not a whole number"),
        (changed("channels", to=[]), "channels: is empty"),
        (changed("channels", 0, "pin", to="RB8"), "channels[0].pin: unknown pin 'RB8'"),
        (changed("channels", 0, "pin", to="RA4"), "channels: two channels have the pin RA4"),
        (changed("channels", 0, "name", to="horizontal"), "channels: two channels have the name horizontal"),
        (changed("channels", 0, "servo", to=3), "channels[0].servo: is not a text"),
        (changed("channels", 0, "colour", to=3), "channels[0].colour: unknown key"),
        (changed("loop", to=[]), "loop: is empty"),
        (changed("loop", to={}), "loop: is not an array"),
        (changed("loop", 0, "frames", to=0), "loop[0].frames: is not a whole number of 1 to 1000000000"),
        (changed("loop", 0, "frames", to=500_000), "loop: the schedule has 5000"),
        (changed("loop", 0, "frames", to=2**63), "loop[0].frames: is not a whole number of 1 to 1000000000"),
        (changed("loop", 0, "pulses", to=[None]), "loop[0].pulses: has 1 entries for 2 channels"),
        (changed("loop", 0, "pulses", 0, to=[0]), "loop[0].pulses[0]: is [rise, width] or null"),
        (changed("loop", 0, "pulses", 0, to=[-1, 5]), "loop[0].pulses[0][0]: is not a whole number"),
        (changed("loop", 0, "pulses", 0, to=[0, 0]), "loop[0].pulses[0][1]: is not a whole number"),
        (changed("loop", 0, "pulses", 0, to=[19000, 1000]), "its frame has only 20000"),
        (changed("loops", to=[]), "loops: unknown key [unknown-key]\n  did you mean 'loop'?"),
        (TEXT.replace('"version": 1,', ""), "schedule: 'version' is missing"),
        ("[" * 100_000, "JSON syntax"),
    ],
)
def test_a_wrong_file_is_refused_with_its_key(text: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        from_json(text, "s.json")
    assert says in str(caught.value)


@st.composite
def schedules(draw: st.DrawFn) -> PulseSchedule:
    pins = draw(st.lists(st.sampled_from(("RA0", "RA4", "RB0", "RB7")), min_size=1, unique=True))
    period = draw(st.integers(2, 10**6))
    pulse = st.builds(
        lambda rise, share: Pulse(Cycles(rise), Cycles(max(1, int((period - 1 - rise) * share)))),
        st.integers(0, period - 2),
        st.floats(0, 1),
    )
    run = st.builds(
        lambda frames, pulses: Run(frames, tuple(pulses)),
        st.integers(1, 10**4),
        st.lists(st.none() | pulse, min_size=len(pins), max_size=len(pins)),
    )
    return PulseSchedule(
        Clock(draw(st.integers(1, 20_000_000))),
        Cycles(period),
        tuple(Channel(f"servo {pin}", pin, "ä") for pin in pins),
        tuple(draw(st.lists(run, max_size=3))),
        tuple(draw(st.lists(run, min_size=1, max_size=3))),
    )


@settings(max_examples=100)
@given(schedule=schedules())
def test_every_schedule_comes_back(schedule: PulseSchedule) -> None:
    assert from_json(schedule.json_text(), "s.json") == schedule


HELD = replace(SCHEDULE, inputs=(Input("RB7", 0), Input("RA3", 1)))


def test_the_levels_of_inputs_are_kept_and_nothing_is_written_where_there_are_none() -> None:
    assert '"inputs": [{"pin": "RB7", "level": 0}, {"pin": "RA3", "level": 1}]' in HELD.json_text()
    assert from_json(HELD.json_text(), "schedule.json") == HELD
    assert "inputs" not in SCHEDULE.json_text()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"RB7"', '"RB0"', "RB0 is a servo's"),
        ('"RB7"', '"RB8"', "unknown pin 'RB8'"),
        ('"level": 0', '"level": 2', "is neither 0 nor 1: 2"),
        ('"level": 0', '"high": 0', "unknown key"),
    ],
)
def test_an_input_that_cannot_be_is_refused(old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        from_json(HELD.json_text().replace(old, new), "schedule.json")
    assert "inputs[0]" in str(refused.value)
