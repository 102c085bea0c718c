"""Programs that read their inputs: what they do after every press is specified; nothing wrong is proven."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from servogen.edges import PINS, EdgeChunk
from servogen.engines.firmware import Firmware
from servogen.job import loads, plan_job
from servogen.pic.assembler import assemble
from servogen.pic.device import device
from servogen.pic.image import Image
from servogen.programs import compile_program
from servogen.prove import Counterexample, Quantifiers, prove_for_all
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.simulator import Machine, NoRepeat, find_repeat, parse_stimuli
from servogen.units import Clock, Cycles
from servogen.workflows.engines import planned
from servogen.workflows.verification import judge_forever
from tests.campaigns import sampled
from tests.engines.player.player_jobs import job_text, sweep
from tests.prove.replay import is_wrong

SOFT = "soft_start_s = 0.16\n"
START, STOP = 'start_pin = "RA4"\n', 'stop_pin = "RB7"\n'
HOLD = 'stop_pulses = "hold"\n'
CLOCK = Clock(4_000_000)


@cache
def built(firmware: str) -> tuple[PulseSchedule, Firmware]:
    job = planned(plan_job(loads(job_text(3, sweep(3, 0.16), firmware=SOFT + firmware), "job.toml")))
    return job.plan.schedule, job.make("c2c")


@pytest.mark.parametrize(
    "firmware", sampled([STOP, STOP + HOLD, START, START + STOP, START + STOP + HOLD], 2)
)
def test_a_player_with_buttons_is_proven_for_every_press(firmware: str) -> None:
    schedule, program = built(firmware)
    assert schedule.buttons is not None
    found = prove_for_all(program.compilation.image, schedule)
    assert found.proven, found.reason
    assert found.states > 2 * (schedule.lead_in_frames + schedule.loop_frames)


@pytest.mark.campaign
def test_held_as_the_schedule_says_there_are_fewer_states() -> None:
    schedule, program = built(START + STOP)
    every, held = (
        prove_for_all(program.compilation.image, schedule, Quantifiers(inputs=each)) for each in (True, False)
    )
    assert held.proven
    assert held.states < every.states / 4
    assert any("RB7 is held at 1" in each for each in held.assumptions)


def changed(program: Firmware, old: str, new: str, tmp_path: Path) -> Image:
    text = program.text
    assert text.count(old) == 1, old
    file = tmp_path / "changed.c"
    file.write_text(text.replace(old, new))
    return compile_program(file).image


@pytest.mark.parametrize(
    ("firmware", "old", "new"),
    sampled(
        [
            # only a press that counts in one frame of one part
            (STOP + HOLD, "running = 0;", "running = 0; if (frames == 3) time += 7;"),
            (START + STOP, " " * 12 + "pins = 0xFF;", "if (frames == 2) pins = 0xFE; else pins = 0xFF;"),
            # pressed for two frames is not pressed
            (STOP + HOLD, "if (stop_seen == PRESSED_FRAMES) {", "if (stop_seen >= 2) {"),
            # start goes on where it was, instead of at the beginning
            (START + STOP, "        rewind();\n    }\n    if", "    }\n    if"),
        ],
        2,
    ),
)
def test_a_fault_that_needs_a_press_at_the_right_time_is_found(
    firmware: str, old: str, new: str, tmp_path: Path
) -> None:
    schedule, program = built(firmware)
    image = changed(program, old, new, tmp_path)
    held = prove_for_all(image, schedule, Quantifiers(inputs=False))
    assert held.proven, "nothing is wrong unless somebody presses"
    found = prove_for_all(image, schedule)
    assert not found.proven
    assert found.counterexample is not None, found.reason
    assert edges(image, schedule, found.counterexample) != edges(
        program.compilation.image, schedule, found.counterexample
    )


def edges(image: Image, schedule: PulseSchedule, found: Counterexample) -> list[tuple[int, ...]]:
    """Return the edges of an image with a counterexample's stimulus, from the first rise on."""
    stimuli = parse_stimuli(found.stimulus(schedule.clock), "found.toml", schedule.clock)
    machine = Machine(image, schedule.clock, found.options, stimuli)
    return driven(machine.run(found.cycle + schedule.period))


def driven(chunk: EdgeChunk) -> list[tuple[int, ...]]:
    rows = [tuple(row) for row in zip(*(column.tolist() for column in chunk), strict=True)]
    first = next(cycle for cycle, _, level in rows if level == 1)
    return [(cycle - first, pin, level) for cycle, pin, level in rows if cycle >= first]


def schedule_of(period: int, width: int, frames: int = 1) -> PulseSchedule:
    run = Run(frames, (Pulse(Cycles(0), Cycles(width)),))
    return PulseSchedule(CLOCK, Cycles(period), (Channel("arm", "RB1", "futaba-s3001"),), (), (run,))


HEAD = """
        list p=16f84
        include "p16f84.inc"
        radix dec
        __config _XT_OSC & _WDT_OFF & _PWRTE_OFF
        org 0
        goto start
        org 4
{isr}
start   clrf PORTB
        bsf STATUS, RP0
        movlw 0xFD
        movwf TRISB
        movlw 0x84
        movwf OPTION_REG
        bcf STATUS, RP0
        clrf TMR0
"""


def assembled(text: str, isr: str = "        retfie") -> Image:
    source = HEAD.format(isr=isr) + text + "        end\n"
    return assemble(source, "test.asm", device("PIC16F84")).image


BETWEEN = """
        bcf PORTB, 1
{before}
frame   bsf PORTB, 1
        movlw 98
        movwf 0x21
wait    decfsz 0x21, f
        goto wait
        nop
        nop
        nop
        bcf PORTB, 1
        bsf STATUS, RP0
        {change} TRISB, 1
        bcf TRISB, 1
        bcf STATUS, RP0
        goto frame
"""
RELEASED = BETWEEN.format(change="bsf", before="")


@pytest.mark.parametrize("released", [True, False])
def test_a_servo_s_pin_that_is_an_input_between_pulses_is_assumed_to_be_low(released: bool) -> None:
    """Nothing drives it then: a pull-up would make another pulse of it."""
    body = RELEASED if released else BETWEEN.format(change="nop\n;", before="")
    found = prove_for_all(assembled(body), schedule_of(299 + 7, 299))
    assert found.proven, found.reason
    assumed = "RB1 is low while the program makes it an input"
    assert (assumed in found.assumptions) == released


def test_a_servo_s_pin_that_the_chip_itself_pulls_up_is_not_assumed_to_be_low() -> None:
    """DS35007 section 4.2: RBPU = 0 turns on the pull-ups of port B's inputs."""
    on = "        bsf STATUS, RP0\n        bcf OPTION_REG, 7\n        bcf STATUS, RP0\n"
    found = prove_for_all(assembled(BETWEEN.format(change="bsf", before=on)), schedule_of(299 + 7, 299))
    assert not found.proven
    assert "RB1: a pin with pulses, and an input with a pull-up" in found.reason


def test_a_schedule_without_pulses_is_followed_by_a_program_without_pulses() -> None:
    nothing = replace(schedule_of(306, 299), loop=(Run(1, (None,)),))
    silent = assembled("stop    goto stop\n")
    found = prove_for_all(silent, nothing)
    assert found.proven, found.counterexample or found.reason
    trimmed = prove_for_all(silent, nothing, Quantifiers(any_eeprom=True))
    assert trimmed.reason == "any EEPROM: the schedule has no pulses"
    forever = judge_forever(nothing, silent, Cycles(100_000))
    assert forever.verdict.passed and not forever.passed
    for body in (RELEASED, "        nop\n" * 300 + "        bsf PORTB, 1\nstop    goto stop\n"):
        pulsing = assembled(body)
        shown = prove_for_all(pulsing, nothing).counterexample
        assert shown is not None
        assert is_wrong(pulsing, nothing, shown)


SECOND = """
        bsf STATUS, RP0
        movlw 0xFD
        movwf TRISB
        bcf STATUS, RP0
frame   movlw 2
        movwf PORTB
        nop
        clrf PORTB
        bsf STATUS, RP0
        bcf TRISB, 2
        bcf STATUS, RP0
{clear}
        movlw 4
        movwf PORTB
        nop
        clrf PORTB
        nop
{again}
        goto frame
"""
"""RB1 is high in cycles 0 and 1 of a frame, RB2 in 7 and 8, or one later with `clear`, or not at all."""


def two_servos(period: int, rise: int | None) -> PulseSchedule:
    one = schedule_of(period, 2)
    pulses = (Pulse(Cycles(0), Cycles(2)), None if rise is None else Pulse(Cycles(rise), Cycles(2)))
    channels = (*one.channels, Channel("other", "RB2", "futaba-s3001"))
    return replace(one, channels=channels, loop=(Run(1, pulses),))


def test_a_servo_s_pin_that_is_not_yet_an_output_in_the_first_frame_is_assumed_to_be_low() -> None:
    image = assembled(SECOND.format(clear="", again=""))
    found = prove_for_all(image, two_servos(14, 7))
    assert found.proven, found.reason
    assert "RB2 is low while the program makes it an input" in found.assumptions


def test_an_unknown_latch_is_not_driven_for_a_moment_once_there_are_pulses() -> None:
    """RB2's latch is not written before it is an output for three cycles of the first frame."""
    never = SECOND.replace("movlw 4\n        movwf PORTB", "nop\n        nop")
    text = HEAD.format(isr="        retfie").replace("clrf PORTB", "bcf PORTB, 1")
    body = never.format(clear="        bcf PORTB, 2\n", again="").replace("clrf PORTB", "bcf PORTB, 1")
    source = text + body.replace("movlw 2\n        movwf PORTB", "nop\n        bsf PORTB, 1")
    image = assemble(source + "        end\n", "test.asm", device("PIC16F84")).image
    schedule = two_servos(15, None)
    found = prove_for_all(image, schedule)
    assert found.counterexample is not None, found.reason or "proven"
    assert is_wrong(image, schedule, found.counterexample)


def test_a_program_that_polls_tmr0_absolutely_is_not_reduced() -> None:
    """Its phase counts: a pulse that is a cycle longer when TMR0 is 65 is found; without it, it is proven.

    A frame is 14 ticks of 32 cycles: TMR0 is 65 once in 128 frames.
    """
    body = """
        bcf PORTB, 1
        movlw 3
        movwf 0x20
frame   movlw 100
        movwf 0x21
wait    decfsz 0x21, f
        goto wait
        bsf PORTB, 1
{odd}
        bcf PORTB, 1
        movlw 33
        movwf 0x21
rest    decfsz 0x21, f
        goto rest
{pad}
        goto frame
"""
    fixed = "        nop\n        nop\n        nop\n        nop\n"
    odd = """
        movf TMR0, w
        xorlw 65
        btfsc STATUS, Z
        goto $+1
"""
    frame = 2 + 299 + 1 + 4 + 1 + 2 + 98 + 2
    pad = (-frame) % 32 + 32
    text = "        nop\n" * pad
    schedule = schedule_of(frame + pad, 5)
    good = prove_for_all(assembled(body.format(odd=fixed, pad=text)), schedule)
    assert good.proven, good.reason
    bad_image = assembled(body.format(odd=odd, pad=text))
    bad = prove_for_all(bad_image, schedule)
    assert not bad.proven
    assert bad.counterexample is not None, bad.reason
    never = assembled(body.format(odd=odd.replace("65", "64"), pad=text))
    assert prove_for_all(never, schedule).proven, "TMR0 is odd there"


PULSE = """
        bsf PORTB, 1
        movlw 100
        movwf 0x21
wide    decfsz 0x21, f
        goto wide
        bcf PORTB, 1
        movlw 250
        movwf 0x21
rest    decfsz 0x21, f
        goto rest
"""
PULSE_CYCLES = 1 + 2 + 299 + 1 + 2 + 749


@pytest.mark.parametrize(("enable", "isr"), sampled([("0x90", "INTF"), ("0x88", "RBIF")]))
def test_an_interrupt_that_moves_an_edge_is_found(enable: str, isr: str) -> None:
    body = " movlw {enable}\n movwf INTCON\nframe\n" + PULSE + " goto frame\n"
    handler = f"        movf PORTB, w\n        bcf INTCON, {isr}\n        retfie"
    schedule = schedule_of(PULSE_CYCLES + 2, 302)
    quiet = prove_for_all(assembled(body.format(enable="0"), handler), schedule)
    assert quiet.proven, quiet.reason
    found = prove_for_all(assembled(body.format(enable=enable), handler), schedule, max_states=100)
    assert not found.proven and found.counterexample is not None


def test_a_pin_that_is_read_twice_in_a_frame_is_not_decided_but_never_proven() -> None:
    schedule, program = built(STOP)
    rule = replace(schedule.buttons, pressed_frames=4) if schedule.buttons else None
    found = prove_for_all(program.compilation.image, replace(schedule, buttons=rule))
    assert not found.proven


def test_what_chips_differ_in_is_found_before_an_instruction_that_an_unknown_bit_decides() -> None:
    """A word that no data sheet defines stands just before a skip on unknown RAM: neither hides the other."""
    body = "{odd}\n btfss 0x30, 7\n goto $+1\n nop\nframe\n" + PULSE + " goto frame\n"
    schedule = schedule_of(PULSE_CYCLES + 2, 302)
    assert prove_for_all(assembled(body.format(odd=" nop")), schedule).proven
    assert not prove_for_all(assembled(body.format(odd=" dw 0x0001")), schedule).proven
    assert not prove_for_all(assembled(body.format(odd=" btfss 0x31, 6\n dw 0x0001")), schedule).proven


@pytest.mark.parametrize("flag", sampled(["INTF", "RBIF", "T0IF"], 2))
def test_a_flag_that_is_only_polled_makes_no_interrupt(flag: str) -> None:
    """The handler hangs: whoever went there would make no more edges."""
    polls = f" btfsc INTCON, {flag}\n nop\n goto frame\n"
    good = f" btfss INTCON, {flag}\n goto $+1\nframe\n{PULSE}{polls}"
    schedule = schedule_of(PULSE_CYCLES + 2 + 2, 302)
    assert prove_for_all(assembled(good, "        goto 4"), schedule).proven
    longer = good.replace(" nop\n", " goto $+1\n")  # a skip is as long as NOP
    assert not prove_for_all(assembled(longer, "        goto 4"), schedule).proven


def test_an_interrupt_of_a_timer_whose_value_nobody_knows_is_not_proven() -> None:
    """Written in each frame TMR0 never overflows; otherwise any frame may be hit."""
    body = " movlw 0xA0\n movwf INTCON\nframe {write}\n" + PULSE + " goto frame\n"
    handler = "        bcf INTCON, T0IF\n        retfie"
    schedule = schedule_of(1 + PULSE_CYCLES + 2, 302)
    image = assembled(body.format(write="clrf TMR0"), handler)
    assert prove_for_all(image, schedule, max_states=500).proven
    source = HEAD.replace("        clrf TMR0\n", "").format(isr=handler) + body.format(write="nop")
    image = assemble(source + "        end\n", "test.asm", device("PIC16F84")).image
    assert not prove_for_all(image, schedule, max_states=500).proven


COUNTED_ON = """
        bsf STATUS, RP0
        movlw 0x88
        movwf OPTION_REG
        bcf STATUS, RP0
frame   bsf PORTB, 1
        movf 0x30, w
        andlw 1
        {write}
        nop
        nop
        nop
        nop
        nop
        nop
        nop
        btfsc TMR0, 1
        goto on
on      movlw 98
        movwf 0x21
wait    decfsz 0x21, f
        goto wait
        bcf PORTB, 1
        goto frame
"""
"""Written with 0 or 1, TMR0 is read as 5 or 6: the skip takes two cycles, or the word after it is a jump."""


@pytest.mark.parametrize("write", ["movwf TMR0", "iorwf TMR0, f\n        movwf TMR0"])
def test_a_byte_of_which_a_bit_is_unknown_counts_on_in_tmr0(write: str) -> None:
    program = assembled(COUNTED_ON.format(write=write))
    machine = Machine(program, CLOCK)
    rise = machine.run_to_edge(PINS.index("RB1"), 1, 100)
    fall = machine.run_to_edge(PINS.index("RB1"), 0, 1000)
    again = machine.run_to_edge(PINS.index("RB1"), 1, 1000)
    assert rise is not None and fall is not None and again is not None
    schedule = schedule_of(again - rise, fall - rise)
    found = prove_for_all(program, schedule)
    assert found.counterexample is not None
    assert is_wrong(program, schedule, found.counterexample)
    endless = find_repeat(program, CLOCK, pin=PINS.index("RB1"), limit=100_000)
    assert isinstance(endless, NoRepeat) and "other chips" in endless.reason
