"""Two small programs with a wire between them, in which every cycle is counted: frames of 1000 cycles.

The second one's pulses come `CYCLES` cycles after the wire's rises, from that of frame `FRAMES` on. It looks
at the wire as the player's second chip does (docs/firmware.md, "Two chips"), without TMR0. `OWN` is a second
one with a crystal of its own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from servogen.pic.assembler.assembly import assemble
from servogen.pic.device import device
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run, WireRule
from servogen.units import Clock, Cycles

PERIOD, FRAMES, CYCLES, QUIET = 1000, 3, 10, 1023
SOURCE, WIRE = "RB0", "RA1"
LEADING = 100, 130
"""The widths of the first chip's pulses, one frame after the other."""
FOLLOWING = 200, 260
HEAD = """
        list p=16f84
        include "p16f84.inc"
        radix dec
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON
        org 0
        clrf PORTA
        clrf PORTB
        bsf STATUS, RP0
        movlw 0xFE
        movwf TRISB
        bcf STATUS, RP0
"""
JOIN = """
wire    movlw 64
        movwf 0x21
quiet   btfsc PORTA, 1
        goto wire
{look}
        decfsz 0x21, f
        goto quiet
rise    btfss PORTA, 1
        goto rise
        movlw 2
        movwf 0x22
        nop
later
{turn}
        btfss PORTA, 1
        goto $+1
        decfsz 0x22, f
        goto later
{last}
"""
LOOK = """
        comf PORTA, w
        andwf PORTA, w
        andwf PORTA, w
        movwf 0x23
        btfss 0x23, 1
        goto wire
"""


OWN_PPM, LOOKS = 1000, 9
"""Of a drift of 2 cycles in a frame the next whole number is 3: from 8 cycles before to 8 after, every 2."""
OWN_LOOK = (
    """
        btfsc PORTA, 1
        goto wire
"""
    + "        btfsc PORTA, 1\n        goto {rose}\n" * (LOOKS - 1)
    + "        goto wire\n{rose}\n"
)
OWN_JOIN = """
wire    movlw 64
        movwf 0x21
quiet   btfsc PORTA, 1
        goto wire
{look}
        decfsz 0x21, f
        goto quiet
rise    btfss PORTA, 1
        goto rise
{last}
"""


def wait(cycles: int) -> str:
    """Return words that take so many cycles."""
    turns, rest = divmod(max(cycles - 1, 0), 3)
    if turns > 255:
        return wait(700) + wait(cycles - 700)
    if not turns:
        return "        nop\n" * cycles
    return f"        movlw {turns}\n        movwf 0x20\n        decfsz 0x20, f\n        goto $-1\n" + wait(
        rest
    )


def _pulse(width: int, after: int) -> str:
    """Return a pulse, which begins with the second cycle, and a wait after it."""
    return f"        movlw 1\n        movwf PORTB\n{wait(width - 1)}        clrf PORTB\n{wait(after)}"


def _assembled(text: str, old: str, new: str) -> Image:
    if old:
        assert old in text
        text = text.replace(old, new)
    return assemble(f"{HEAD}{text}        end\n", "wired.asm", device("PIC16F84")).image


@cache
def first_chip(old: str = "", new: str = "", frames: int = FRAMES) -> Image:
    """The program whose pulses are the wire, with a part of its text replaced everywhere; 12 frames without
    any come before its motion, which begins with `frames` equal ones.
    """
    silence = f"        movlw 12\n        movwf 0x22\nquiet\n{wait(997)}"
    silence += "        decfsz 0x22, f\n        goto quiet\n"
    begin = frames * _pulse(LEADING[0], PERIOD - LEADING[0] - 2)
    low, high = LEADING
    loop = _pulse(low, PERIOD - low - 2) + _pulse(high, PERIOD - high - 4)
    return _assembled(f"{silence}{begin}loop\n{loop}        goto loop\n", old, new)


@cache
def second_chip(old: str = "", new: str = "") -> Image:
    """The program that follows the wire, with a part of its text replaced everywhere."""
    low = LOOK + wait(4) + _pulse(FOLLOWING[0], PERIOD - 12 - FOLLOWING[0])
    high = LOOK + wait(4) + _pulse(FOLLOWING[1], PERIOD - 14 - FOLLOWING[1])
    join = JOIN.format(look=wait(11), turn=wait(994), last=wait(995))
    return _assembled(f"{join}loop\n{low}{high}        goto loop\n", old, new)


@cache
def own_second_chip(old: str = "", new: str = "") -> Image:
    """The program with a crystal of its own that follows the wire, with a part of its text replaced once."""
    frames = ""
    for rose, width, back in (("one", FOLLOWING[0], 0), ("two", FOLLOWING[1], 2)):
        frames += OWN_LOOK.format(rose=rose) + wait(6) + _pulse(width, PERIOD - 19 - back - width)
    join = OWN_JOIN.format(look=wait(11), last=wait(PERIOD - 10))
    return _assembled(f"{join}loop\n{frames}        goto loop\n", old, new)


@cache
def own_schedules() -> tuple[PulseSchedule, PulseSchedule]:
    """The schedules of both chips with a crystal each."""
    first, second = schedules()
    rule = second.wire
    assert rule is not None
    rule = replace(rule, frames=1, crystal_ppm=OWN_PPM)
    return replace(first, lead_in=_runs(LEADING[:1])), replace(second, wire=rule)


def _runs(widths: tuple[int, ...]) -> tuple[Run, ...]:
    return tuple(Run(1, (Pulse(Cycles(0), Cycles(width)),)) for width in widths)


@cache
def schedules() -> tuple[PulseSchedule, PulseSchedule]:
    """The schedules of both chips."""
    clock, channels = Clock(4_000_000), (Channel("arm", "RB0", "futaba-s3001"),)
    begin = (Run(FRAMES, _runs(LEADING[:1])[0].pulses),)
    rule = WireRule(WIRE, SOURCE, FRAMES, Cycles(CYCLES), Cycles(QUIET))
    return (
        PulseSchedule(clock, Cycles(PERIOD), channels, begin, _runs(LEADING), device="PIC16F84"),
        PulseSchedule(clock, Cycles(PERIOD), channels, (), _runs(FOLLOWING), device="PIC16F84", wire=rule),
    )
