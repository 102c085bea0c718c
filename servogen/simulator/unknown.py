# ruff: noqa: SIM109 - in compiled code two comparisons are what they are; a tuple is an object
"""Values that differ between chips, and their first use. Compiled.

DS35007 table 6-4 marks with "x" what a power-on reset leaves undefined: RAM, W, FSR, TMR0, the port latches,
EEDATA, EEADR, the bits C, DC, Z, WRERR and RBIF. An undriven pin may also read as either level. The simulator
gives all of these a value, and a mask of the bits that could differ. The mask follows the data through every
instruction: a bit of a result is known if no choice of the unknown bits changes it, as far as a single
instruction shows. Copying unknown bits is harmless; only a *use* matters, by which they affect the program's
path, its timing or its pins (its kind: `layout`). The first use is kept.

An unknown byte travels as one integer of 16 bits: the mask, and above it the source (`layout`) of one of its
unknown bits, for the message.

One kind of unknown byte carries more: PHASED means that the byte is its value plus φ, modulo 256, where φ is
one unknown number for the whole chip. The prover sets TMR0 and the bytes that follow it so, and thereby
compares them without knowing either: phased - phased is a known number. Instructions that cannot keep this
relation make an ordinary unknown byte of it.
"""

from __future__ import annotations

from servogen.pic.device import masks
from servogen.simulator.compiled import Vector, compiled, compiled_once
from servogen.simulator.layout import (
    CYCLE,
    EECON1_UNKNOWN,
    FLOATING_PIN,
    GIE,
    HERE,
    INTCON,
    INTCON_UNKNOWN,
    INTF,
    OPTION,
    PHASED,
    PRESCALER_UNKNOWN,
    PSA,
    SLEEPING,
    SOURCE_PHASE,
    SOURCE_RB_CHANGE,
    SOURCE_TMR0,
    SOURCE_WRERR,
    T0CS,
    T0IF,
    TMR0_UNKNOWN,
    USE_CYCLE,
    USE_INTERRUPT,
    USE_KIND,
    USE_PLACE,
    USE_SOURCE,
    USE_SUBJECT,
    USE_WAKE,
)
from servogen.simulator.program import OPS

C, DC, Z, PD, TO = masks("C", "DC", "Z", "PD", "TO")

_ADDWF, _ADDLW, _SUBWF, _SUBLW = OPS["ADDWF"], OPS["ADDLW"], OPS["SUBWF"], OPS["SUBLW"]
_ANDWF, _ANDLW, _IORWF, _IORLW = OPS["ANDWF"], OPS["ANDLW"], OPS["IORWF"], OPS["IORLW"]
_XORWF, _XORLW = OPS["XORWF"], OPS["XORLW"]
_MOVF, _COMF, _INCF, _DECF = OPS["MOVF"], OPS["COMF"], OPS["INCF"], OPS["DECF"]
_INCFSZ, _DECFSZ, _SWAPF = OPS["INCFSZ"], OPS["DECFSZ"], OPS["SWAPF"]
_RLF, _RRF = OPS["RLF"], OPS["RRF"]


@compiled_once
def use(s: Vector, kind: int, subject: int, source: int) -> None:
    """Record what was used, where and when, unless there was an earlier use."""
    if s[USE_KIND] == 0:
        s[USE_KIND] = kind
        s[USE_SUBJECT] = subject
        s[USE_SOURCE] = source
        s[USE_PLACE] = s[HERE]
        s[USE_CYCLE] = s[CYCLE]


@compiled
def upward(mask: int) -> int:
    """Return the bits that a carry out of any bit of `mask` can reach, including these bits."""
    return -(mask & -mask) & 0xFF


@compiled
def without(unknown: int, bits: int) -> int:
    """Return an unknown byte of which `bits` have become known."""
    return unknown & ~bits if unknown & 0xFF & ~bits else 0


@compiled
def written_status(before: int, written: int) -> int:
    """Return the unknown bits of STATUS after a write of a byte: TO and PD stay what they were."""
    remaining = without(before, ~(TO | PD))
    source = SOURCE_TMR0 if written >> 8 == SOURCE_PHASE else written >> 8
    bits = written & 0xFF & ~(TO | PD)
    return remaining | bits | source << 8 if bits and not remaining else remaining | bits


@compiled
def keeps_phase(op: int, vu: int, wu: int) -> bool:
    """Return whether the result is PHASED, for unknown bits `vu` of the operand and `wu` of W."""
    if vu == PHASED:
        if op == _MOVF or op == _INCF or op == _DECF or op == _INCFSZ or op == _DECFSZ:
            return True
        return (op == _ADDWF or op == _SUBWF) and wu & 0xFF == 0
    return wu == PHASED and vu & 0xFF == 0 and (op == _ADDWF or op == _ADDLW)


@compiled
def propagate(op: int, bits: int, v: int, vu: int, w: int, wu: int, su: int, r: int) -> int:
    """Return the unknown bits of an instruction's result and, above bit 15, those of STATUS after it.

    `v`, `w` and `r` are operand, W and result; `vu`, `wu` and `su` the unknown bits of operand, W and STATUS;
    `bits` is the mask of a bit instruction.
    """
    m, n = vu & 0xFF, wu & 0xFF
    source = (vu if m else wu if n else su) >> 8
    flags = Z
    f = 0
    both = vu == PHASED and wu == PHASED
    if op == _MOVF or op == _COMF:
        t = m
    elif op == _ANDWF or op == _ANDLW:
        t = (m | n) & (v | m) & (w | n)
    elif op == _IORWF or op == _IORLW:
        t = (m | n) & ~(v & ~m) & ~(w & ~n) & 0xFF
    elif op == _XORWF or op == _XORLW:
        t = 0 if both and v == w else m | n
        flags = 0 if both and v != w else Z  # the XOR of two different bytes is not 0
        su = without(su, Z)
    elif op == _INCF or op == _DECF:
        t = upward(m)
    elif op == _INCFSZ or op == _DECFSZ:
        t = upward(m)
        flags = 0
    elif op == _SWAPF:
        t = (m >> 4 | m << 4) & 0xFF
        flags = 0
    elif op == _RLF:
        t = (m << 1 | su & C) & 0xFF
        source = (vu if m else su) >> 8
        flags = C
        f = m >> 7
    elif op == _RRF:
        t = m >> 1 | (su & C) << 7
        source = (vu if m else su) >> 8
        flags = C
        f = m & C
    elif op == _ADDWF or op == _ADDLW or op == _SUBWF or op == _SUBLW:
        t = upward(m | n)
        flags = C | DC | Z
        f = (C if t else 0) | (DC if t & 0x0F else 0)
        if both and op == _SUBWF:
            t = 0  # but what is borrowed depends on φ
    else:  # BCF and BSF
        t = m & ~bits
        flags = 0
    if flags & Z and t and r & ~t & 0xFF == 0:
        f |= Z
    after = without(su, flags)
    if f:
        after = after & 0xFF | f | (SOURCE_TMR0 if source == SOURCE_PHASE else source) << 8
    if source == SOURCE_PHASE and not keeps_phase(op, vu, wu):
        source = SOURCE_TMR0
    return (t | source << 8 if t else 0) | after << 16


@compiled
def flags_in_doubt(s: Vector, pins: int) -> None:
    """Note that inputs among `pins` (a port word) have no known level, so that noise may set INTF or clock
    TMR0.
    """
    if pins & 1 << 5 and not s[INTCON] & INTF & ~s[INTCON_UNKNOWN]:
        s[INTCON_UNKNOWN] |= INTF
    if pins & 1 << 4 and s[OPTION] & T0CS and not s[SLEEPING]:
        s[TMR0_UNKNOWN] = 0xFF | (FLOATING_PIN + 4) << 8
        if not s[OPTION] & PSA:
            s[PRESCALER_UNKNOWN] = 0xFF
        timer_flag_in_doubt(s)


@compiled
def timer_flag_in_doubt(s: Vector) -> None:
    """Note that TMR0 counted from an unknown value, so that T0IF may be set."""
    if not s[INTCON] & T0IF & ~s[INTCON_UNKNOWN]:
        s[INTCON_UNKNOWN] |= T0IF


@compiled
def source_of_flag(s: Vector, flags: int) -> int:
    """Return why one of these bits of INTCON is unknown."""
    if flags & T0IF:
        return s[TMR0_UNKNOWN] >> 8 if s[TMR0_UNKNOWN] else SOURCE_TMR0
    return FLOATING_PIN + 5 if flags & INTF else SOURCE_RB_CHANGE


@compiled
def doubt_sleep(s: Vector) -> None:
    """Note a use if the beginning or the end of SLEEP depends on an unknown flag."""
    enabled = s[INTCON] >> 3 & 7
    flags = enabled & s[INTCON_UNKNOWN]
    if flags and not enabled & s[INTCON] & ~s[INTCON_UNKNOWN]:
        use(s, USE_WAKE, flags, source_of_flag(s, flags))


@compiled
def doubt(s: Vector, counts: bool) -> None:
    """Note a use if an interrupt, or the waking of a sleeping chip, depends on an unknown flag.

    `counts` tells whether the internal clock increments TMR0.
    """
    if s[SLEEPING]:
        doubt_sleep(s)
    if not s[INTCON] & GIE or s[SLEEPING]:
        return
    enabled = s[INTCON] >> 3 & 7
    if enabled & s[INTCON] & ~s[INTCON_UNKNOWN]:
        return  # the interrupt comes anyway
    flags = enabled & s[INTCON_UNKNOWN]
    if flags:
        use(s, USE_INTERRUPT, flags, source_of_flag(s, flags))
    elif counts and enabled & T0IF and s[TMR0_UNKNOWN]:
        use(s, USE_INTERRUPT, T0IF, s[TMR0_UNKNOWN] >> 8)


@compiled
def wrerr_source(s: Vector) -> int:
    """Return the unknown bits of EECON1."""
    return s[EECON1_UNKNOWN] | SOURCE_WRERR << 8 if s[EECON1_UNKNOWN] else 0
