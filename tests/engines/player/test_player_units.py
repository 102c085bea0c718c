"""The player's parts one by one: scales, rows, slots, buttons, codes, shares, budgets; numbers by hand."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.engines.firmware import ResourceError, TimingBudget
from servogen.engines.inputs.buttons import ButtonPin, ControlButtons, motion_with_wait, with_wait
from servogen.engines.inputs.commands import (
    CODES,
    CommandButton,
    CommandButtons,
    CommandLine,
    hearing_table,
    uart_byte,
)
from servogen.engines.player import engine, shares
from servogen.engines.player import firmware as compiling
from servogen.engines.player.arithmetic import blended, excursion, weights
from servogen.engines.player.encoding import Rows, WidthScale, row_table, scale_of, shift_of
from servogen.engines.player.firmware import cautions
from servogen.engines.player.layout import (
    Demand,
    Slot,
    SlotLayout,
    Used,
    _filled,
    _Frame,
    demand,
    layout,
    to_rise,
)
from servogen.engines.player.playing import leg_channels
from servogen.engines.player.rendering import Constants, _pad, _repeats
from servogen.engines.player.script import ScriptStep, StepTiming, chained, folded, script, timing
from servogen.engines.player.shares import Share
from servogen.engines.player.soft_start import soft_start, with_soft_start
from servogen.engines.stored_script import Stored, eeprom_room, in_eeprom, in_flash
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.motion.trajectory import JointTrajectory, Part
from servogen.prove.commands import SerialCodes
from servogen.pulse.plan import joined_runs
from servogen.pulse.quantise import NO_PULSE
from servogen.pulse.schedule import (
    Channel,
    CodeLine,
    DirectionButtons,
    Input,
    Pulse,
    PulseSchedule,
    Run,
    StepButton,
)
from servogen.units import Clock, Cycles
from tests.engines.player.player_jobs import job_text, sweep

playing = import_module("servogen.engines.player.playing")
layout_module = import_module("servogen.engines.player.layout")
"""The modules, not the functions of these names."""

CLOCK = Clock(4_000_000)
JOB = plan_job(loads(job_text(3, sweep(3, 0.04)), "job.toml"))

Floats = Sequence[Sequence[float]]


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


def test_bases_are_two_steps_below_the_shortest_pulse() -> None:
    scale = scale_of(rows([1000.9, 700], [1600, 900]))
    # A span of 599 needs steps of 4 cycles.
    assert scale.shifts.tolist() == [2, 2] and scale.bases.tolist() == [1000 - 8, 700 - 8]
    assert scale.exact(np.array([1000.0, 708.0])).tolist() == [2, 4]
    given = scale_of(rows([1000, 700]), np.array([0, 3]))
    assert given.bases.tolist() == [998, 700 - 16] and given.shifts.tolist() == [0, 3]
    moved = scale.moved([1], np.array([5]))
    assert moved.bases.tolist() == [992, 697] and scale.bases.tolist() == [992, 692]


def test_values_of_the_chip_are_16_bits() -> None:
    scale = WidthScale(np.array([1000, 500]), np.array([0, 2]))
    assert scale.widths(np.array([[256, 256], [65_535, 511]])).tolist() == [[1001, 504], [1255, 507]]
    assert scale.widths(np.array([[0, 0]])).tolist() == [[1000, 500]]
    for value in (-1, 65_536):
        with pytest.raises(ResourceError):
            scale.widths(np.array([[0, value]]))


def test_arithmetic_of_the_chip_rounds_down() -> None:
    assert excursion([255, 256, 511], [0, 0, 0]).tolist() == [0, 1, 1]
    assert excursion([255, 64, 63], [1, 2, 2]).tolist() == [1, 1, 0]
    assert blended(10, 20, 128) == 10 * 256 + 10 * 128 and blended(20, 10, 128, twice=True) == 20 * 256 - 2560
    table = [0, 16, 48, *([200] * 14)]
    # The sixteenth, and within it 16ths of the distance to the next entry.
    assert weights(table, [0, 1, 15, 16, 17, 31, 32, 255]).tolist() == [0, 1, 15, 16, 18, 46, 48, 200]


def test_rows_are_shared_by_poses_that_are_near_enough_to_their_middle() -> None:
    pose_rows = Rows(1.0)
    poses = ([10.0, 10.0], [12.0, 10.0], [11.0, 12.0], [11.0, 13.0], [12.0, 12.0], [14.0, 10.0])
    # 12 is 1 from the middle 11; with [11, 12] the middle of the second column is 11; 13 is too far. Of two
    # rows, [12, 12] is nearer to the second one, whose middle becomes [11.5, 12.5].
    assert [pose_rows.number(np.array(pose)) for pose in poses] == [0, 0, 0, 1, 1, 2]
    assert pose_rows.kept == [(11, 11), (12, 13), (14, 10)]
    assert Rows(0.0).number(np.array([1.0])) == 0
    ends = Rows(0.0)
    for value in (-3.0, 0.49, 0.5, 254.5, 260.0):
        ends.number(np.array([value]))
    assert ends.kept == [(0,), (0,), (1,), (255,), (255,)], "rounded, within a byte"


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


def test_the_time_of_a_step_is_counted_in_65536ths() -> None:
    assert timing(1) == StepTiming(1, 0) and timing(2) == StepTiming(2, 32_768) and timing(3).speed == 21_845
    assert timing(256).speed == 256 and timing(7).speed == 9362
    assert StepTiming(4, 16_384).times() == [0, 64, 128, 192]
    # Half of a 256th is added: 21845 / 256 = 85.33, 43690 / 256 = 170.66.
    assert timing(3).times() == [0, 85, 171]
    assert StepTiming(3, 32_768, start=64).times() == [64, 192, 64]


def entries_of(folds: Any) -> list[int]:
    return [entry.row for body, times in folds for _ in range(times) for entry in body]


def test_folding_keeps_what_is_played_and_costs_least() -> None:
    from servogen.engines.player.script import RowEntry

    def fold(*numbers: int) -> list[tuple[list[int], int]]:
        folds = folded([RowEntry(number, 0) for number in numbers])
        assert entries_of(folds) == list(numbers)
        return [([entry.row for entry in body], times) for body, times in folds]

    assert fold() == []
    assert fold(1, 2, 3) == [([1, 2, 3], 1)]
    # A repetition costs five bytes: six equal steps save one.
    assert fold(*[7] * 6) == [([7] * 6, 1)] and fold(*[7] * 7) == [([7], 7)]
    assert fold(1, *[2, 3] * 4, 4) == [([1], 1), ([2, 3], 4), ([4], 1)]
    assert fold(*[1, 2, 3] * 2) == [([1, 2, 3] * 2, 1)] and fold(*[1, 2, 3, 4, 5, 6] * 2) == [
        ([1, 2, 3, 4, 5, 6], 2)
    ]
    # At most 255 times: of 600 equal steps two hundred threes save most.
    assert fold(*[5] * 600) == [([5] * 3, 200)]


def test_rows_are_ordered_so_that_steps_lead_to_the_next_one() -> None:
    quick = timing(2)

    def order(*numbers: int) -> list[int]:
        return chained(
            [ScriptStep(numbers[0], quick)], [ScriptStep(n, quick) for n in numbers], max(numbers) + 1
        )

    assert order(2, 0, 1) == [2, 0, 1]
    assert sorted(order(3, 1, 2, 0, 3, 1)) == [0, 1, 2, 3]
    found = order(3, 1, 2, 0, 3, 1)
    assert found.index(1) == found.index(3) + 1, "the most frequent pair is kept together"


def test_a_script_repeats_where_its_byte_says_so() -> None:
    again, at = 0xFF, 0xFC
    assert not _repeats(bytes((1, 2, 3))) and not _repeats(b"")
    assert _repeats(bytes((1, again, 2, 3))) and _repeats(bytes((at, 7, again, 1, 2)))
    assert not _repeats(bytes((1, at, again, 5))), "the place of a row is no such byte"


def test_where_a_script_is() -> None:
    flash = in_flash(b"abcdef")
    assert (flash.size, flash.text, flash.offset) == (6, "6 bytes in flash", 250)
    assert flash.to_json() == {"flash_bytes": 6, "eeprom_bytes": 0, "eeprom_first": None}
    assert eeprom_room(12) == 52
    whole = in_eeprom(bytes(52), 12)
    assert (len(whole.flash), len(whole.eeprom), whole.first, whole.offset) == (0, 52, 12, 12)
    assert whole.text == "52 bytes in the EEPROM, bytes 12 to 63"
    more = in_eeprom(bytes(range(60)), 12)
    assert more.flash == bytes(range(8)) and more.eeprom == bytes(range(8, 60)) and more.size == 60
    # Byte 8 of the script is at address 12.
    assert (more.offset + 8) % 256 == 12
    assert more.text == "8 bytes in flash, 52 bytes in the EEPROM, bytes 12 to 63"
    assert more.to_json() == {"flash_bytes": 8, "eeprom_bytes": 52, "eeprom_first": 12}
    assert Stored(b"ab", b"c", 5).offset == 3


# slots


def servo(pin: str, limits: tuple[float, float] = (1000, 2000)) -> Any:
    return SimpleNamespace(name=pin, pin=pin, widths_us=limits, place=None)


FRAME = JOB.frame


def test_a_slot_keeps_a_margin_for_its_pulse_within_the_limits() -> None:
    used = Used(Cycles(1000), Cycles(1500))
    assert used.room(servo("RB0"), CLOCK) == 1520
    assert used.room(servo("RB0", (1000, 1507)), CLOCK) == 1507
    assert used.room(servo("RB0", (1000, 1400)), CLOCK) == 1500, "never shorter than the pulse"
    assert used.room(servo("RB0", (1000, 9000)), Clock(20_000_000)) == 1600


def test_a_pulse_rises_with_its_slot_or_a_stagger_later() -> None:
    slots = (Slot("B", (2, 0), 40), Slot("A", (1,), 50), Slot("B", (), 60))
    made = SlotLayout(slots, Cycles(32), Cycles(32))
    assert made.period == 32 * 150 and made.order == (2, 0, 1)
    # The first slot's ticks come last in the frame.
    assert [made.rise(channel) for channel in (2, 0, 1)] == [0, 32, 50 * 32]
    with pytest.raises(KeyError):
        made.rise(3)
    assert replace(made, stagger=Cycles(0)).rise(0) == 0
    assert [to_rise(Cycles(tick)) for tick in (32, 64, 256)] == [103, 199, 775]


def frame(longest: tuple[int, ...], period: int, **changes: int) -> _Frame:
    values = {"slot_c": 200, "frame_c": 1000, "tick": 32} | changes
    return _Frame(longest, values["slot_c"], values["frame_c"], values["tick"], period)


def ticks(cycles: int, tick: int = 32) -> int:
    return -(-cycles // tick)


def test_a_slot_is_its_way_to_the_rise_its_pulse_its_end_and_its_c() -> None:
    one = frame((1500, 1600), 20_000)
    # Three ticks and 7 cycles to the rise, 19 after the fall, and one for the look at the timer.
    for pulse, c in ((1500, 200), (0, 200), (1481, 0), (1482, 0)):
        assert one.whole(pulse, c) == ticks(3 * 32 + 7 + pulse + 19 + c + 1)
    assert one.minimum == one.whole(1500, 200) + one.whole(1600, 1200)


def test_the_rest_of_a_frame_is_one_wait_or_several() -> None:
    one = frame((1500, 1600), 8000)
    found = one.ticks(None, exceed=False)
    # 250 ticks in all: the slot of the first pulse counts to the second, the rest to the next frame.
    assert found is not None
    first = one.whole(1500, 200)
    assert found == [250 - first, first]
    long = frame((1500, 1600), 32 * 700)
    found = long.ticks(None, exceed=False)
    assert found is not None and sum(found) == 700 and len(found) > 2
    assert max(found) <= 255 and found[1] == first
    # The last parts are as long as they can be.
    assert found[0] == 255
    assert frame((1500, 1600), 32 * (one.minimum - 1)).ticks(None, exceed=False) is None
    exactly = frame((1500, 1600), 32 * one.minimum).ticks(None, exceed=False)
    assert exactly is not None and sum(exactly) == one.minimum


def test_the_watchdog_is_cleared_in_time_or_the_c_may_exceed_it() -> None:
    one = frame((1500, 1600), 32 * 700)
    fed = 6900
    found = one.ticks(fed, exceed=False)
    assert found is not None and sum(found) == 700
    # From one slot to the next, the way to the rise and the pulse: nothing clears it meanwhile.
    assert all(count * 32 + 103 + 1500 <= fed for count in found[:1])
    assert all(count * 32 + 103 <= fed for count in found[2:])
    late = frame((1500, 1600), 32 * 700, frame_c=9000)
    assert late.ticks(fed, exceed=False) is None
    assert late.ticks(None, exceed=False) is None, "9000 cycles are more than 255 ticks of 32"
    slower = frame((1500, 1600), 64 * 700, frame_c=9000, tick=64)
    assert slower.ticks(fed, exceed=False) is None and slower.ticks(fed, exceed=True) is not None


def test_only_without_a_reserve_the_c_may_exceed_the_watchdog_s_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reserves of 3, 2 and 2 times the C are given up for the watchdog; 1 is the C itself."""
    tried: list[tuple[int, int, int, int | None, bool]] = []

    def refused(longest: Any, slot_c: int, frame_c: int, tick: int, period: int) -> SimpleNamespace:
        def ticks(maximum: int | None, *, exceed: bool) -> None:
            tried.append((tick, slot_c, frame_c, maximum, exceed))

        return SimpleNamespace(ticks=ticks)

    monkeypatch.setattr(layout_module, "_Frame", refused)
    assert layout_module._slots([("B", (0,))], (Cycles(1500),), 1000, JOB.frame, CLOCK) is None
    slot_c = layout_module.SLOT_C
    assert tried == [
        (tick, slot * slot_c, motion * 1000, maximum, slot == 1)
        for tick in layout_module.TICKS
        for maximum in (6900, None)
        for slot, motion in ((3, 3), (2, 2), (2, 1), (1, 1))
    ]


def test_spare_time_goes_to_the_later_parts_first() -> None:
    assert _filled([1, 1, 1], [5, 5, 5], 3) == [1, 1, 1]
    assert _filled([1, 1, 1], [5, 5, 5], 6) == [1, 1, 4]
    assert _filled([1, 1, 1], [5, 5, 5], 8) == [1, 2, 5]
    assert _filled([1, 1, 1], [5, 5, 5], 15) == [5, 5, 5]
    assert _filled([4], [9], 7) == [7]


def test_two_servos_of_a_port_share_a_slot_in_the_order_of_their_pins() -> None:
    servos = [servo(pin) for pin in ("RB3", "RA1", "RB0", "RB2", "RA0", "RB1")]
    used = [Used(Cycles(1000), Cycles(1500))] * 6
    made = layout(servos, used, FRAME, CLOCK)
    assert [(slot.port, slot.channels) for slot in made.slots if slot.channels] == [
        ("B", (2, 5)), ("B", (3, 0)), ("A", (4, 1))
    ]  # fmt: skip
    # With the margin and the trim; no stagger unless no two may start together.
    assert {slot.longest for slot in made.slots if slot.channels} == {1520 + 127} and made.stagger == 0
    apart = layout(servos, used, replace(FRAME, max_together=1), CLOCK)
    assert apart.stagger == 32 and apart.slots[0].longest == 1520 + 127 + 32
    assert made.tick == 32 and abs(made.period - 20_000) <= 16


def test_servos_with_pulses_of_similar_length_share_a_slot_if_time_is_short() -> None:
    servos = [servo(f"RB{n}", (1000, 2500)) for n in range(8)]
    used = [Used(Cycles(1000), Cycles(2400 if n % 2 else 1000)) for n in range(8)]
    needs = demand(servos, used, FRAME, CLOCK)
    # Those of 1020 and of 2420 cycles in pairs; with 127 of trim, and 323 beside them, in ticks of 32.
    short, long = ticks(1147 + 323) * 32, ticks(2547 + 323) * 32
    assert needs.slots == (((0, 2), short), ((4, 6), short), ((1, 3), long), ((5, 7), long))
    # The C between two frames: 250, 240 for each channel, 40 for buttons.
    assert needs.frame_c == ticks(2547 + 323 + 250 + 8 * 240 + 40) * 32 - long
    assert needs.minimum == 2 * short + 2 * long + needs.frame_c
    assert Demand((((0,), Cycles(64)),), Cycles(32)).minimum == 96


@pytest.mark.parametrize(
    ("channels", "doublings", "legs", "c"),
    [
        (1, 0, False, 250 + 240 + 40),
        (12, 0, False, 250 + 12 * 240 + 40),
        (13, 0, False, 250 + 13 * 240),
        (2, 5, False, 250 + 480 + 20 + 40),
        (2, 0, True, 250 + 480 + 400 + 40),
    ],
)
def test_the_c_between_frames_grows_with_channels_doublings_and_legs(
    channels: int, doublings: int, legs: bool, c: int
) -> None:
    pins = [*(f"RB{n}" for n in range(8)), *(f"RA{n}" for n in range(5))][:channels]
    servos = [servo(pin) for pin in pins]
    needs = demand(servos, [Used(Cycles(1000), Cycles(1000))] * channels, FRAME, CLOCK, doublings, legs=legs)
    slot = 1020 + 127 + 323
    assert needs.frame_c == (ticks(slot + c) - ticks(slot)) * 32


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


def test_the_motion_runs_with_start_pressed_and_stop_released() -> None:
    both = ControlButtons(START, STOP)
    assert both.inputs == (Input("RA3", 0), Input("RA4", 0)) and both.waiting == 2
    assert ControlButtons(ButtonPin("RA3", 1), ButtonPin("RA4", 0)).inputs == (
        Input("RA3", 1),
        Input("RA4", 1),
    )
    rule = both.rule
    assert rule is not None
    assert (rule.start, rule.stop, rule.off, rule.pressed_frames) == (
        Input("RA3", 0),
        Input("RA4", 1),
        True,
        3,
    )
    none = ControlButtons()
    assert (none.any, none.rule, none.inputs, none.waiting) == (False, None, (), 0)
    assert ControlButtons(None, STOP).any and ControlButtons(START).any
    assert ControlButtons(None, STOP).waiting == 0


def schedule(lead_in: tuple[Run, ...], loop: tuple[Run, ...]) -> PulseSchedule:
    return PulseSchedule(CLOCK, Cycles(20_000), (Channel("a", "RB0", "x"),), lead_in, loop)


A, B = (Pulse(Cycles(0), Cycles(1000)),), (Pulse(Cycles(0), Cycles(1500)),)


def test_waiting_repeats_the_first_frame() -> None:
    one = schedule((Run(2, A), Run(1, B)), (Run(5, B),))
    assert with_wait(one, 0) is one
    assert with_wait(one, 2).lead_in == (Run(4, A), Run(1, B)) and with_wait(one, 2).loop == one.loop
    no_lead = schedule((), (Run(5, B), Run(1, A)))
    assert with_wait(no_lead, 2).lead_in == (Run(2, B),)
    motion = JointTrajectory(("a",), CLOCK, Cycles(20_000), rows([1], [2], [3]), 1)
    after = motion_with_wait(motion, 2)
    assert after.angles[:, 0].tolist() == [1, 1, 1, 2, 3] and after.loop_start == 3


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


# motions


def test_legs_are_pairs_of_channels() -> None:
    def binding(joint: str, name: str) -> Any:
        return SimpleNamespace(joint=joint, servo=name)

    servos: Any = [SimpleNamespace(name=name) for name in ("a", "b", "c", "d", "e")]
    bound = [
        binding("left_beta", "a"), binding("left_alpha", "b"), binding("head", "c"),
        binding("right_alpha", "d"), binding("right_beta", "e"),
    ]  # fmt: skip
    assert leg_channels(servos, bound) == [(1, 0), (3, 4)]
    assert leg_channels(servos, bound[:4]) == [(1, 0)] and leg_channels(servos, []) == []


def test_equal_frames_are_one_run() -> None:
    widths = np.array([[1000, 1500], [1000, 1500], [1000, 1501], [7, 7], [9, 9], [1000, 1501]])
    heard = np.array([True, True, True, False, False, True])
    rises = [Cycles(0), Cycles(32)]
    pulses = np.where(heard[:, None], widths, NO_PULSE)
    found = joined_runs(pulses, rises)
    assert [run.frames for run in found] == [2, 1, 2, 1]
    assert found[0].pulses == (Pulse(Cycles(0), Cycles(1000)), Pulse(Cycles(32), Cycles(1500)))
    assert found[2].pulses == (None, None)
    assert joined_runs(pulses[:0], rises) == ()


def test_a_soft_start_is_the_neutral_pose_and_then_even_steps() -> None:
    servos: Any = [SimpleNamespace(neutral=1.0), SimpleNamespace(neutral=2.0)]
    motion = JointTrajectory(("a", "b"), CLOCK, Cycles(20_000), rows([np.nan, np.nan], [3, 2], [4, 4]), 1)
    begun = soft_start(motion, servos, 4)
    assert begun.angles[:8].tolist() == [[1, 2]] * 5 + [[1.5, 2], [2, 2], [2.5, 2]]
    assert begun.loop_start == 9 and len(begun.angles) == 11
    made, ends = with_soft_start(motion, servos, CLOCK, Fraction(8, 100))
    assert ends == (4, 8) and made.angles[:8].tolist() == begun.angles[:8].tolist()
    # A motion that begins in the neutral pose needs no steps to it: within a thousandth of a radian.
    for away, frames in ((0.0, 4), (0.0009, 4), (0.0011, 8)):
        near = replace(motion, angles=rows([1 + away, 2], [4, 4]))
        assert len(soft_start(near, servos, 4).angles) == 2 + frames
    assert soft_start(motion, servos, 0) is motion
    assert with_soft_start(motion, servos, CLOCK, Fraction(0)) == (motion, ())
    silent = replace(motion, angles=rows([np.nan, np.nan]))
    assert soft_start(silent, servos, 4) is silent


# the search for an encoding


class Sizes:
    """Encodings of given sizes, from the closest to the coarsest; None: refused."""

    def __init__(self, *sizes: int | None) -> None:
        self.sizes, self.asked = list(sizes), []

    def __call__(self, *arguments: Any, **keys: Any) -> Any:
        self.asked.append(arguments[-2:])
        size = self.sizes[len(self.asked) - 1]
        if size is None:
            raise ResourceError("does-not-fit", f"refusal {len(self.asked)}")
        return SimpleNamespace(size=size)


def encoded(monkeypatch: pytest.MonkeyPatch, poses: Any, most: int, legs: Any = None) -> Any:
    monkeypatch.setattr(playing, "poses_encoded", poses)
    monkeypatch.setattr(playing, "legs_encoded", legs or (lambda *_, **keys: None))
    pairs = [(0, 1)] if legs else []
    return playing.encoded_motion(rows([1.0, 2.0]), 0, (), pairs, 10.0, Clock(8_000_000), most)


def test_the_closest_encoding_that_fits_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = Sizes(400, 330, 329, 328, 300)
    assert encoded(monkeypatch, sizes, 328).size == 328 and len(sizes.asked) == 4
    # At 8 MHz 10 µs are 20 cycles: the law may use 0.15 of it first, and poses 0.3 steps.
    assert sizes.asked[:2] == [(20 * 0.15, 0.3), (20 * 0.2, 0.5)]
    assert encoded(monkeypatch, Sizes(400, 500, None, 390, 391, 600, 600, 600), 328).size == 390
    refusing = Sizes(*[None] * 8)
    with pytest.raises(ResourceError, match="refusal 8"):
        encoded(monkeypatch, refusing, 328)
    assert [near for _, near in refusing.asked] == [0.3, 0.5, 0.7, 0.9, 1.1, 1.4, 1.7, 2.2]
    assert [round(far / 20, 9) for far, _ in refusing.asked] == [0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8]


def test_a_walk_is_tried_by_its_legs_first(monkeypatch: pytest.MonkeyPatch) -> None:
    never = Sizes()
    assert encoded(monkeypatch, never, 328, legs=Sizes(400, 300)).size == 300 and never.asked == []
    # Legs that fit no size are nevertheless the encoding; where they refuse all, so is the smallest of them.
    assert encoded(monkeypatch, never, 328, legs=Sizes(*range(408, 400, -1))).size == 401
    assert never.asked == []
    no_walk: Any = lambda *_, **keys: None  # noqa: E731
    monkeypatch.setattr(playing, "poses_encoded", Sizes(310))
    assert encoded(monkeypatch, Sizes(310), 328, legs=no_walk).size == 310


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


# shares


def test_a_share_adds_up_and_is_json() -> None:
    share = Share("walk", rows=12, script=5, timings=6, laws=34, error_us=1.25)
    assert share.bytes == 57
    assert share.to_json() == {
        "part": "walk", "bytes": 57, "rows": 12, "script": 5, "timings": 6, "laws": 34, "error_us": 1.25
    }  # fmt: skip


def test_a_frame_belongs_to_the_last_part_that_has_begun() -> None:
    parts = [Part("soft start", 0), Part("walk", 10), Part("turn", 20)]
    assert [shares._part(parts, frame) for frame in (0, 9, 10, 19, 20, 99)] == [
        "soft start", "soft start", "walk", "walk", "turn", "turn"
    ]  # fmt: skip
    assert shares._part(parts[1:], 3) == "walk", "what comes before the first part belongs to it"


def test_the_shares_of_a_job_are_its_tables() -> None:
    found = shares.shares(JOB)
    played = engine.play(JOB)[1]
    assert found.bytes == played.encoded.size == sum(part.bytes for part in found.parts)
    assert not found.legs and len(found.pulses) == 3
    assert sum(part.script for part in found.parts) == len(played.encoded.script.data)
    assert sum(part.timings for part in found.parts) == 3 * len(played.encoded.script.timings)
    errors = [part.error_us for part in found.parts if part.error_us is not None]
    assert errors and max(errors) <= JOB.firmware.max_error_us
    needs = found.frame(JOB.servos, JOB.frame, JOB.clock)
    assert needs.minimum <= JOB.frame.period.cycles


def test_the_parts_begin_behind_the_soft_start_and_a_motion_without_parts_is_one() -> None:
    hard = replace(JOB, firmware=replace(JOB.firmware, soft_start_s=Fraction(0)))
    for job, soft in ((JOB, ["soft start"]), (hard, [])):
        found, whole = shares.shares(job), shares.shares(replace(job, parts=()))
        assert [part.name for part in found.parts] == [*soft, "pose 2", "pose 1"]
        assert [part.name for part in whole.parts] == [*soft, "motion"]
        assert whole.bytes == found.bytes


def test_what_follows_the_motion_belongs_to_where_its_loop_goes_on() -> None:
    """The last ten of twenty frames repeat: frame 20 is frame 10 again, that of the second part."""
    timings = [StepTiming(frames, speed) for speed, frames in enumerate((7, 10, 5, 5))]
    encoded: Any = SimpleNamespace(
        steps=[SimpleNamespace(row=row, timing=timing) for row, timing in enumerate(timings)],
        legs=None, widths=np.zeros((1, 2)), rows=[0] * 8, laws=(),
        script=SimpleNamespace(owners=[0, 1, 2, 3, 3], timings=[timings[0], timings[2]]),
    )  # fmt: skip
    parts = [Part("a", 0), Part("b", 10), Part("c", 15)]
    begins = [0, 0, 10, 15]
    assert [shares._part(parts, begin) for begin in begins] == ["a", "a", "b", "c"]
    ledger = shares._shares(encoded, parts, 20, 10)
    assert {name: share.script for name, share in ledger.found.items()} == {"a": 2, "b": 1, "c": 2}
    later = SimpleNamespace(**vars(encoded))
    later.steps = [*encoded.steps, SimpleNamespace(row=4, timing=timings[3])]
    later.script = SimpleNamespace(owners=[0, 1, 2, 3, 4, 4, 4], timings=[timings[0]])
    found = shares._shares(later, parts, 20, 10).found  # type: ignore[arg-type]
    assert {name: share.script for name, share in found.items()} == {"a": 2, "b": 4, "c": 1}


def test_the_largest_distance_of_each_part_is_kept() -> None:
    ledger = shares._Ledger()
    shares._add_errors(ledger, ["a", "b", "a", "b"], np.array([0.12345, 2.0, 0.5, 1.0]))
    assert {name: share.error_us for name, share in ledger.found.items()} == {"a": 0.5, "b": 2.0}
    shares._add_errors(ledger, ["c"], np.array([0.00049]))
    assert ledger.found["c"].error_us == 0.0


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


def test_small_tables_are_one_with_a_place_for_each() -> None:
    constants = Constants()
    constants.add("A", [1, 2, 3], "first")
    constants.add("B", ["0x10"])
    assert constants.add("", [9], "without a name") == 4
    assert constants.add("C", iter((7, 8)), "last") == 5
    assert constants.groups == [
        ([1, 2, 3], "A"), (["0x10"], "B"), ([9], "without a name"), ([7, 8], "C")
    ]  # fmt: skip
    assert constants.named == [("A", 0, "first"), ("B", 3, ""), ("C", 5, "last")]


def test_a_pad_is_turns_of_three_cycles_and_the_rest() -> None:
    for cycles in range(3, 250):
        pad = _pad(cycles)
        rest = {(): 0, ("nop",): 1, ("goto    $+1",): 2}[pad.rest]
        assert 3 * pad.turns + rest == cycles


def test_a_motion_that_misses_its_limit_is_tried_with_its_script_in_the_eeprom(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Three trims leave 61 bytes of the EEPROM; the C that reads a script takes 16 words."""
    asked = []

    def play(job: Any, limit: float, more_bytes: int = 0, halves: bool = False) -> tuple[Any, Any, Any]:
        if halves:
            raise ResourceError("does-not-fit", "two tables hold it no better")
        asked.append(more_bytes)
        error = errors[1 if more_bytes else 0]
        plan = SimpleNamespace(schedule=SimpleNamespace(plan_error_us=error))
        encoded = SimpleNamespace(size=300 + more_bytes, scale=SimpleNamespace(bent=False))
        return "motion", SimpleNamespace(plan=plan, encoded=encoded, chain=None), "whole"

    monkeypatch.setattr(engine, "play", play)
    job: Any = SimpleNamespace(
        servos=(1, 2, 3), inputs=(), firmware=SimpleNamespace(max_error_us=10.0, precise=False, dialect="c2c")
    )
    for errors, calls, size in (  # noqa: B007 - `play` reads it
        ((10.0, 1.0), [0], 300),
        ((10.1, 10.0), [0, 45], 345),
        ((10.1, 10.05), [0, 45], 300),
    ):
        asked.clear()
        made = engine.ENGINE.plan(job)
        assert (asked, made.data_bytes, made.tour) == (calls, size, None)


def test_a_program_too_large_for_flash_is_tried_once_more(monkeypatch: pytest.MonkeyPatch) -> None:
    played: Any = SimpleNamespace(
        encoded=SimpleNamespace(script=SimpleNamespace(data=bytes(100))), order=range(12), layout=None
    )
    still = SimpleNamespace(angles=np.zeros((1, 12)), period=20_000)
    job: Any = SimpleNamespace(
        inputs=(), device=None, name="x", trajectory=still, clock=CLOCK, parts=(), directions=(), ends=()
    )
    tried: list[Stored] = []
    needed: dict[str, object] = {}

    def render(played: Any, stored: Stored, *rest: Any) -> str:
        tried.append(stored)
        return ""

    def firmware(*arguments: Any) -> Any:
        error = ResourceError("does-not-fit", "too large")
        error.details = needed
        raise error from InputError("program-too-large", "still too large")

    monkeypatch.setattr(compiling, "render_player", render)
    monkeypatch.setattr(compiling, "firmware", firmware)
    # 52 of the script's bytes can go to the EEPROM.
    for words, again in ((1024 + 52, True), (1024 + 53, False), (None, False)):
        tried.clear()
        needed.clear()
        needed |= {} if words is None else {compiling.WORDS_NEEDED: words}
        with pytest.raises(ResourceError) as error:
            compiling.compiled(job, played, "c2c")
        assert [len(stored.eeprom) for stored in tried] == ([0, 52] if again else [0])
        both = "too large; with its script in the EEPROM, as far as it fits there, still too large"
        assert error.value.message == (both if again else "too large")
        assert not again or error.value.hint == "fewer parts: let more of the motion repeat"
