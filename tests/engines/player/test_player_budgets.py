"""The player's scales, rows, slots, buttons, codes, shares and budgets; numbers by hand."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.engines.firmware import ResourceError, TimingBudget
from servogen.engines.inputs.buttons import ButtonPin, ControlButtons
from servogen.engines.inputs.commands import (
    CODES,
    CommandButton,
    CommandButtons,
    CommandLine,
    hearing_table,
    uart_byte,
)
from servogen.engines.player.encoding import WidthScale, row_table, shift_of
from servogen.engines.player.firmware import cautions
from servogen.engines.player.layout import FrameTimes, Used, layout
from servogen.engines.player.script import ScriptStep, StepTiming, script, timing
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.prove.commands import SerialCodes
from servogen.pulse.schedule import CodeLine, DirectionButtons, Input, StepButton
from servogen.units import Clock, Cycles
from tests.engines.player.player_jobs import job_text, sweep

playing = import_module("servogen.engines.player.playing")

CLOCK = Clock(4_000_000)
JOB = plan_job(loads(job_text(3, sweep(3, 0.04)), "job.toml"))


def rows(*frames: Sequence[float]) -> Any:
    return np.array(frames, dtype=float)


# scales and rows


@pytest.mark.parametrize(("span", "shift"), [(0, 0), (251, 0), (251.5, 1), (502, 1), (503, 2), (251 * 32, 5)])
def test_steps_are_as_small_as_the_span_of_a_byte_allows(span: float, shift: int) -> None:
    """Two steps stay free at both ends: 251 steps."""
    assert shift_of(rows([1000, 5], [1000 + span, 5])) == shift


def test_widths_too_far_apart_for_the_largest_steps_are_refused() -> None:
    with pytest.raises(ResourceError) as error:
        shift_of(rows([1000], [1000 + 251 * 32 + 1]))
    assert (error.value.code, error.value.message) == (
        "widths-too-far-apart", "the servos' widths are too far apart for the player"
    )  # fmt: skip


def test_values_of_the_chip_are_16_bits() -> None:
    scale = WidthScale(np.array([1000, 500]), np.array([0, 2]))
    assert scale.widths(np.array([[256, 256], [65_535, 511]])).tolist() == [[1001, 504], [1255, 507]]
    assert scale.widths(np.array([[0, 0]])).tolist() == [[1000, 500]]
    for value in (-1, 65_536):
        with pytest.raises(ResourceError):
            scale.widths(np.array([[0, value]]))


def test_a_table_of_rows_has_256_bytes_at_most() -> None:
    full = [(1, 2, 3, 4)] * 64
    assert row_table(full) == bytes((1, 2, 3, 4)) * 64
    with pytest.raises(ResourceError) as error:
        row_table([*full, (9,)])
    assert error.value.message == "the motion's poses have 257 bytes: their table holds 256"
    assert error.value.hint is not None and "[[chip]] twice" in error.value.hint
    assert len(row_table([*full, (9,)], limited=False)) == 257


# scripts


def test_a_script_has_255_bytes_at_most() -> None:
    def steps(count: int) -> list[ScriptStep]:
        # No row follows another: two bytes name it, and one how to get there.
        return [ScriptStep(2 * n % 61, timing(1 + n % 5)) for n in range(count)]

    lead = steps(1)
    full = script(lead, steps(84), 2, legs=False)
    assert len(full.data) == 3 * 85 == len(full.owners)
    with pytest.raises(ResourceError) as error:
        script(lead, steps(85), 2, legs=False)
    assert error.value.message == "the motion's script has 258 bytes: its table holds 255"
    assert len(script(lead, steps(85), 2, legs=False, limited=False).data) == 258


def test_a_motion_has_as_many_timings_as_bytes_that_name_one() -> None:
    """0xFC and above are not timings."""
    steps = [ScriptStep(0, StepTiming(1, number)) for number in range(253)]
    assert len(script(steps[:1], steps[:252], 1, legs=False, limited=False).timings) == 252
    with pytest.raises(ResourceError) as error:
        script(steps[:1], steps, 1, legs=False)
    assert error.value.message == "the motion has steps of 253 timings: the player holds 252"


# slots


def servo(pin: str, limits: tuple[float, float] = (1000, 2000)) -> Any:
    return SimpleNamespace(name=pin, pin=pin, widths_us=limits, place=None)


FRAME = JOB.frame


def frame(longest: tuple[int, ...], period: int, **changes: int) -> FrameTimes:
    values = {"slot_c": 200, "frame_c": 1000, "tick": 32} | changes
    return FrameTimes(longest, values["slot_c"], values["frame_c"], values["tick"], period)


def ticks(cycles: int, tick: int = 32) -> int:
    return -(-cycles // tick)


def test_pulses_shorter_than_the_kernel_s_way_are_refused() -> None:
    short = [Used(Cycles(192), Cycles(1000))]
    assert layout([servo("RB0")], short, FRAME, CLOCK)
    with pytest.raises(InputError) as error:
        layout([servo("RB0")], [replace(short[0], shortest=Cycles(191))], FRAME, CLOCK)
    assert (error.value.code, error.value.message, error.value.hint) == (
        "pulse-too-short",
        "RB0: a pulse of 191 µs is 191 cycles, the player's minimum is 192",
        "choose a faster clock",
    )
    with pytest.raises(InputError) as error:
        layout(
            [servo(f"RB{n}", (1000, 9000)) for n in range(8)],
            [Used(Cycles(1000), Cycles(8000))] * 8,
            FRAME,
            CLOCK,
        )
    slot = 8020 + 127 + 323
    whole = 3 * ticks(slot) * 32 + ticks(slot + 250 + 8 * 240 + 40) * 32
    assert (error.value.code, error.value.message, error.value.hint) == (
        "frame-too-short",
        "the pulses do not fit a frame: those of 8 servos, two at a time, and the C for them take "
        f"{whole} cycles, {whole} µs; a frame is 20000 cycles, 20000 µs",
        "lengthen period_us, or choose a faster clock",
    )


# buttons and codes

START, STOP = ButtonPin("RA3", 0), ButtonPin("RA4", 1)


def test_buttons_are_described_with_their_wiring_and_effect() -> None:
    assert START.text() == "button to ground, 10 kOhm pull-up to VDD"
    assert STOP.text() == "button to VDD, 10 kOhm pull-down to ground"
    first = (
        f"RA3: start, pressed for 3 frames: {START.text()}.",
        "Until then: the first frame's pulses.",
    )
    stop = f"RA4: stop, pressed for 3 frames: {STOP.text()}. Then "
    none, same = "no more pulses", "the same pulses again and again"
    assert tuple(ControlButtons(START).text()) == first
    assert tuple(ControlButtons(None, STOP).text()) == (f"{stop}{none}, until reset.",)
    assert tuple(ControlButtons(None, STOP, off=False).text()) == (f"{stop}{same}, until reset.",)
    assert tuple(ControlButtons(START, STOP).text()) == (*first, f"{stop}{none}, until start begins anew.")
    assert tuple(ControlButtons(START, STOP, off=False).text())[2] == f"{stop}{same}, until start goes on."


def test_a_line_and_buttons_as_rules_and_words() -> None:
    line = CommandLine("RA4")
    assert line.inputs == (Input("RA4", 1),) and line.rule == CodeLine(Input("RA4", 1), 3, 5)
    assert line.has("left") and line.selector("left") == "11000"
    assert line.text() == (
        "RA4: commands, one level per frame, high at rest: 10 kOhm pull-up to VDD.",
        "Low for 5 frames: stop.",
    )
    buttons = CommandButtons({"forward": START, "left": STOP})
    assert buttons.inputs == (Input("RA3", 1), Input("RA4", 0)) and buttons.rule == DirectionButtons(3)
    assert buttons.has("left") and not buttons.has("right") and buttons.selector("left") == Input("RA4", 1)
    assert buttons.text() == (
        f"RA3: forward while it is held: {START.text()}.",
        f"RA4: left while it is held: {STOP.text()}.",
        "None or several for 3 frames: stop.",
    )
    button = CommandButton(STOP)
    assert button.inputs == (Input("RA4", 0),) and button.rule == StepButton(Input("RA4", 1), 3)
    assert button.has("right") and button.selector("right") is None
    assert button.text() == (
        f"RA4: pressed for 3 frames: {STOP.text()}.",
        "A press commands a stop, or, if the robot is to stand, the next direction.",
    )


def test_codes_are_sent_by_the_bytes_of_the_page() -> None:
    """docs/firmware.md, "Walk on command"."""
    sent = {name: uart_byte(name) for name in CODES}
    assert sent == {"forward": 0xEA, "back": 0xEC, "left": 0xE3, "right": 0xFB} and uart_byte(None) == 0


@pytest.mark.parametrize(
    "names", [("forward", "back", "left", "right"), ("left", "right"), ("back", "forward")]
)
def test_the_table_of_the_line_follows_it_as_the_rule_does(names: tuple[str, ...]) -> None:
    """The chip's table against the rule of the schedule, for every waveform of eleven frames."""
    table = hearing_table(names)
    reader = SerialCodes(CommandLine("RA4").rule, tuple(CODES[name] for name in names))
    for levels in itertools.product((0, 1), repeat=11):
        state, wanted, heard, commanded = 0, 0, reader.at_power_up, 0
        for level in (1, 1, 1, *levels):
            entry = table[2 * state + level]
            state = entry & 31
            wanted = wanted if entry < 32 else (entry >> 5) - 1
            heard, direction = reader.heard(heard, level)
            commanded = commanded if direction is None else direction
            assert wanted == commanded, levels
    assert len(table) // 2 <= 32


# the search for an encoding


def test_servos_that_rest_one_by_one_are_refused_with_the_frame() -> None:
    motion = JOB.trajectory
    angles = motion.angles.copy()
    angles[2, 1] = np.nan
    with pytest.raises(InputError) as error:
        playing.ideal_widths(replace(motion, angles=angles), JOB.servos, CLOCK)
    assert (error.value.code, error.value.message) == (
        "engine-unsupported", "in frame 2 some servos have pulses and some have none"
    )  # fmt: skip
    angles[2] = np.nan
    widths = playing.ideal_widths(replace(motion, angles=angles), JOB.servos, CLOCK)
    assert np.isnan(widths[2]).all() and not np.isnan(np.delete(widths, 2, axis=0)).any()
    angles[:] = np.nan
    with pytest.raises(InputError, match="the motion has no pulse"):
        playing.playing(replace(motion, angles=angles), JOB.servos, JOB.frame)


# budgets and constants


def test_a_budget_that_may_be_exceeded_has_a_warning() -> None:
    def budget(worst: int | None, room: int) -> TimingBudget:
        return TimingBudget("two slots", None if worst is None else Cycles(worst), Cycles(room), Cycles(9))

    assert list(cautions((budget(100, 100), budget(99, 100)))) == []
    (late, unknown) = cautions((budget(103, 100), budget(None, 100)))
    assert (late.severity, late.code) == ("warning", "player-room") == (unknown.severity, unknown.code)
    assert late.message == "the C between two slots may take 103 cycles, 3 more than it has"
    assert unknown.message == "the worst-case time of the C between two slots is not known"
    assert budget(103, 100).left == -3 and budget(None, 5).left is None
    assert budget(90, 100).to_json() == {
        "between": "two slots", "worst_cycles": 90, "room_cycles": 100, "left_cycles": 10,
        "late_is_seen_up_to_cycles": 9,
    }  # fmt: skip
