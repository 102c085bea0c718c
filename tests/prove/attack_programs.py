"""Programs without a job for the attack: each treats time, or its inputs, as the players do not.

Every path through one is as long as the others, so that whatever is read changes no edge; one changed word
changes that.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from tests.prove import test_asynchronous as at_any_time
from tests.prove.test_prove_inputs import assembled, schedule_of

INT_ON = "        bsf INTCON, INTE\n"
PULSE = """
        bsf PORTB, 1
{inside}
        movlw 100
        movwf 0x21
wide    decfsz 0x21, f
        goto wide
        bcf PORTB, 1
"""
PULSE_CYCLES = 1 + 2 + 299
POLL = "        btfsc PORTA, 2\n        incf 0x23, f\n        btfsc 0x23, 3\n        nop\n"
"""Counts in how many frames RA2 is high, in 4 cycles."""

SAVED_ISR = f"""
        movwf 0x0C
        swapf STATUS, w
        movwf 0x0D
        bcf INTCON, T0IF
{PULSE.format(inside=POLL)}
        swapf 0x0D, w
        movwf STATUS
        swapf 0x0C, f
        swapf 0x0C, w
        retfie
"""
"""A pulse in each interrupt of TMR0, which nobody writes."""
IN_AN_INTERRUPT = """
        clrf 0x24
        movlw 0xA0
        movwf INTCON
main    incf 0x24, f
        btfsc 0x24, 4
        nop
        goto main
"""

ABSOLUTE = "        movf TMR0, w\n        xorlw 65\n        btfsc STATUS, Z\n        incf 0x25, f\n"
CHANGED = """
        btfss INTCON, RBIF
        goto same
        movf PORTB, w
        bcf INTCON, RBIF
        incf 0x26, f
        goto both
same    nop
        nop
        nop
        nop
both    nop
"""
"""8 cycles on either way."""
REST = """
        movlw 33
        movwf 0x21
rest    decfsz 0x21, f
        goto rest
"""
REST_CYCLES = 2 + 98

FRAME = "frame\n{pulse}{rest}{pad}        goto frame\n"

START_CYCLES = 2 + 8 + 2
"""From address 0 to the first frame: GOTO, the registers, the counter below."""
SELF_RESET = (
    "        movlw 3\n        movwf 0x27\nframe\n{pulse}{rest}        decfsz 0x27, f\n        goto on\n"
)
SELF_RESET += "        goto 0\non\n{pad}        goto frame\n"


SELECTED = """
        clrf EEADR
        btfsc PORTA, 2
        bsf EEADR, 0
        btfsc PORTB, 7
        bsf EEADR, 1
        bsf STATUS, RP0
        bsf EECON1, RD
        bcf STATUS, RP0
        movf EEDATA, w
        movwf 0x28
kept    decfsz 0x28, f
        goto kept
"""
CELLS, SELECTED_CYCLES = dict.fromkeys(range(4), 20), 10 + 3 * 20 - 1
"""Two inputs select which of four bytes of the EEPROM is counted down, in 69 cycles."""


TRIMMED = "any EEPROM, one servo"
DELAY = """
        btfsc {byte}, 0
        goto $+1
        btfsc {byte}, 1
        goto $+1
        btfsc {byte}, 1
        goto $+1
        rrf {byte}, f
        rrf {byte}, w
        andlw 0x3F
        movwf 0x22
        incf 0x22, f
wait{byte} nop
        decfsz 0x22, f
        goto wait{byte}
"""
"""14 cycles, and as many more as the byte says."""
WITH_A_TRIM = f"""
frame   clrf EEADR
        bsf STATUS, RP0
        bsf EECON1, RD
        bcf STATUS, RP0
        movf EEDATA, w
        movwf 0x20
        incf 0x20, w
        btfsc STATUS, Z
        clrf 0x20
        movlw 0x80
        xorwf 0x20, f
        comf 0x20, w
        movwf 0x21
        bsf PORTB, 1
{DELAY.format(byte="0x20")}
        bcf PORTB, 1
{DELAY.format(byte="0x21")}
        goto frame
"""
"""The pulse is longer by as many cycles as the rest of the frame is shorter; FFh is no trim."""


def _asynchronous() -> dict[str, tuple[Image, PulseSchedule]]:
    """Return programs that are interrupted, sleep, or write the EEPROM."""
    window, written_later = at_any_time.WINDOW, at_any_time.written_later
    schedule = schedule_of(at_any_time.PERIOD, at_any_time.WIDTH)
    found = {}
    for name, enable, handler in (("INT", "0x90", at_any_time.INT), ("RB", "0x88", at_any_time.RB)):
        body = window.format(pulse=at_any_time.PULSE, enable=enable, fine=at_any_time.FINE)
        found[f"{name} in a window"] = at_any_time.assembled(body, handler), schedule
    sleeps = at_any_time.SLEEPER.format(after=at_any_time.AFTER_INT)
    found["sleeps"] = at_any_time.assembled(sleeps, watchdog="ON"), at_any_time.once()
    polled = at_any_time.written(at_any_time.POLL, "stop    goto stop\n")
    slow = replace(at_any_time.once(), period=64, clock=at_any_time.SLOW, device="PIC16F84A")
    woken = at_any_time.SLEEPER.format(after=at_any_time.TOLD + at_any_time.AFTER_INT)
    found["is woken by INT"] = at_any_time.assembled(INT_ON + woken), at_any_time.once()
    slowest = replace(at_any_time.once(), clock=at_any_time.SLOWER)
    found["an EEPROM write interrupts"] = at_any_time.interrupted_by_a_write(), slowest
    found["sleeps in an EEPROM write"] = at_any_time.sleeping_in_a_write("0x00"), slowest
    found["waits for the EEPROM"] = polled, slow
    found["writes the EEPROM"] = written_later()
    return found


def _frames(inside: str, cycles: int) -> tuple[Image, int, int]:
    """Return the program, its period and its width; the period is a multiple of 32."""
    length = PULSE_CYCLES + cycles + 1 + REST_CYCLES + 2
    pad = -length % 32 + 32
    text = FRAME.format(pulse=PULSE.format(inside=inside), rest=REST, pad="        nop\n" * pad)
    return assembled(text), length + pad, PULSE_CYCLES + cycles


@cache
def programs() -> dict[str, tuple[Image, PulseSchedule]]:
    """Return the programs with their schedules, by name."""
    found = {"polls in an interrupt": (assembled(IN_AN_INTERRUPT, SAVED_ISR), 8192, PULSE_CYCLES + 4)}
    found["TMR0 absolutely"] = _frames(ABSOLUTE, 4)
    found["RB change"] = _frames(CHANGED, 8)
    image, period_, width_ = _frames(SELECTED, SELECTED_CYCLES)
    found[TRIMMED] = assembled(WITH_A_TRIM), 300, 15 + 128
    found["selects in the EEPROM"] = replace(image, eeprom=CELLS), period_, width_
    pad = "        nop\n" * (2 + 2 + START_CYCLES - 3 - 2)
    text = SELF_RESET.format(pulse=PULSE.format(inside=POLL), rest=REST, pad=pad)
    period = PULSE_CYCLES + 4 + 1 + REST_CYCLES + 2 + 2 + START_CYCLES
    found["resets itself"] = (assembled(text), period, PULSE_CYCLES + 4)
    named = {name: (image, schedule_of(period, width)) for name, (image, period, width) in found.items()}
    return named | _asynchronous()
