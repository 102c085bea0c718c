# ruff: noqa: SIM109, SIM905 - compiled code compares integers
"""The chip with unknown bits: runs a program on a set of chips at once. Compiled by numba.

In: a vector of integers (the state), the decoded program, the edges expected in this frame. Out: the state
later, and the reason why it stopped. Every byte is v | m << 8 | p << 16: the bits of m are unknown (and 0
in v); if p is 1, the byte is v + φ mod 256, with one φ for all such bytes, the unknown phase of TMR0.
Sources: DS35007 sections 2 to 7; DS30430 figures 6-2 to 6-4 and 8-17.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from numba import njit

from servogen.pic.image import Image
from servogen.pic.isa import decode

Ints = npt.NDArray[np.int64]
F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Mark `function` to be compiled; the machine code is kept beside the source, or in the user's cache."""
    try:
        return cast(F, njit(cache=True, error_model="numpy")(function))
    except RuntimeError:  # neither can be written
        return cast(F, njit(error_model="numpy")(function))


# Slots of the state: a register of bank 0 at its address (ports: the latch), one of bank 1 at 0x50 + address.
T0, PCL, STATUS, FSR, PORTA, PORTB, EEDATA, EEADR, PCLATH, INTCON = 1, 2, 3, 4, 5, 6, 8, 9, 10, 11
W, OPTION, TRISA, TRISB, EECON1 = 0x50, 0x51, 0x55, 0x56, 0x58
PC, DEPTH, STACK = 0x60, 0x61, 0x62
CYCLE, PRESCALER, T0_AT, T0_DUE, IRQ, WDT_DUE, WDT_CLEARED, OUT = range(0x6A, 0x72)
DARK, FRAME, EDGE, GIVEN, GIVEN_BITS, ASKED, ASKED_BITS, DUE, SLOTS = range(0x72, 0x7B)
TIMES = np.array([T0_AT, T0_DUE, IRQ, WDT_DUE, WDT_CLEARED, DARK, FRAME])
RAM, RAM_END = 0x0C, 0x50
BYTES = np.array(
    [*range(RAM, RAM_END), T0, STATUS, FSR, PORTA, PORTB, EEDATA, EEADR, PCLATH, INTCON, EECON1, W]
)
"""The slots with bytes that may be unknown."""
NOWHERE = -1
UNKNOWN = 0xFF00
NEVER = 1 << 60
BEFORE = -NEVER
"""`FRAME`, the cycle in which the frame began, before the first pulse."""

# The parameters, beside the state: they do not change in a run.
LIMIT, PERIOD, CHANNELS, BUTTONS, HELD, LEVELS, WATCHDOG, EEPROM = range(8)
PARAMETERS = EEPROM + 64

KEPT = 64
"""How many runs are remembered."""
READ, WRITTEN = 1, 2
"""What `run` notes of a byte of RAM: that it was read before it was written, and that it was written."""

REASONS = (
    "cut", "frame", "fork", "button", "the cycle limit", "an edge that is not expected", "a missing edge",
    "a word that is not an instruction", "a stack of more than eight levels", "a return with an empty stack",
    "SLEEP", "an EEPROM write or EEIF", "an unknown value in a register",
    "control that depends on TMR0's phase", "an interrupt that depends on unknown values",
    "a watchdog that may time out", "a pin whose level is unknown or not driven", "the frame's last edge",
)  # fmt: skip
(CUT, NEW_FRAME, FORK, BUTTON, TOO_LONG, WRONG_EDGE, MISSING, NO_WORD, OVERFLOW, EMPTY, SLEEPS, EEPROM_WRITE,
 REGISTER, PHASE, INTERRUPT, WATCHED, DARK_PIN, LAST_EDGE) = range(18)  # fmt: skip
GOES_ON = -1

OPERATIONS = tuple(
    "ADD SUB AND IOR XOR COM DEC INC MOV CLR MOVWF RLF RRF SWAPF BCF BSF BTFSC BTFSS NOP GOTO CALL RETURN "
    "RETLW RETFIE CLRWDT SLEEP OPTION TRIS".split()
)
"""What instructions do; some of them with W, a literal or a register alike."""
(ADD, SUB, AND, IOR, XOR, COM, DEC, INC, MOV, CLR, STORE, RLF, RRF, SWAP, BCF, BSF, BTFSC, BTFSS, NOP, GOTO,
 CALL, RETURN, RETLW, RETFIE, CLRWDT, SLEEP, WRITE_OPTION, TRIS) = range(28)  # fmt: skip

# A decoded word: the operation in bits 0 to 5, then these.
F_AT, BIT_AT, K_AT, FLAGS_AT = 8, 16, 24, 36
READS_F, TO_W, TO_F, TESTS_ZERO, CUT_HERE = (1 << n for n in range(40, 45))
C, DC, Z, RP0, TO_PD = 1, 2, 4, 0x20, 0x18
GIE, EEIE, T0IE, INTE, RBIE, T0IF = 0x80, 0x40, 0x20, 0x10, 0x08, 0x04
T0CS, PSA, PS = 0x20, 0x08, 0x07
GLITCH = 10
"""Cycles for which a pin may be driven with an unknown level before the first pulse."""


def program_code(image: Image, cuts: frozenset[int]) -> Ints:
    """Return the program decoded, with -1 for what is not an instruction; runs stop at `cuts`."""
    code = np.full(1024, -1, dtype=np.int64)
    for address, word in image.program.items():
        found = decode(word)
        if found is None:
            continue
        row = found.instruction
        name = row.mnemonic if row.mnemonic in OPERATIONS else row.mnemonic[:3]
        code[address] = (
            OPERATIONS.index(name)
            | found.f << F_AT
            | (1 << found.b) << BIT_AT
            | found.k << K_AT
            | sum(bit for flag, bit in (("C", C), ("D", DC), ("Z", Z)) if flag in row.flags) << FLAGS_AT
            | (READS_F if "f" in row.reads else 0)
            | (TO_W if row.writes_w(found.d) else 0)
            | (TO_F if row.writes_file(found.d) else 0)
            | (TESTS_ZERO if row.skips and row.writes else 0)
            | (CUT_HERE if address in cuts else 0)
        )
    return code


@compiled
def operate(op: int, a: int, w: int, status: int, bits: int, flags: int) -> int:
    """Return the result of operand `a` and W and, from bit 24 on, STATUS with those of `flags` set by it."""
    v, m, p = a & 0xFF, a >> 8 & 0xFF, a >> 16
    x, n, q = w & 0xFF, w >> 8 & 0xFF, w >> 16
    base = -1  # of a result that moves with the phase
    apart = v - x & 0xFF
    if (op == ADD and p != q and m == n) or (op == SUB and p and not q and n == 0):
        base = v + x if op == ADD else apart
    elif p and (op == MOV or op == INC or op == DEC):
        base = v + (op == INC) - (op == DEC)
    elif q and op == STORE:
        base = x
    if p:
        v, m = 0, 0xFF
    if q:
        x, n = 0, 0xFF
    carry, doubt = 0, 0  # of C and DC: which are set, and which are unknown
    if op == ADD or op == SUB:
        if op == SUB:
            x = ~x & ~n & 0xFF
        one = 1 if op == SUB else 0
        r, high = v + x + one, v + m + x + n + one
        nibble, most = (v & 15) + (x & 15) + one, (v & 15) + (m & 15) + (x & 15) + (n & 15) + one
        t = (r ^ high) | m | n  # a carry that is the same in the least and the largest sum is known
        carry = r >> 8 | (nibble >> 4) << 1
        doubt = t >> 8 | ((nibble ^ most) >> 4) << 1
    elif op == INC or op == DEC:
        r = v + (1 if op == INC else 0xFF)
        t = (r ^ r + m) | m
    elif op == AND:
        r, t = v & x, (m | n) & (v | m) & (x | n)
    elif op == IOR:
        r, t = v | x, (m | n) & ~v & ~x
    elif op == XOR:
        r, t = v ^ x, m | n
    elif op == MOV:
        r, t = v, m
    elif op == STORE:
        r, t = x, n
    elif op == COM:
        r, t = ~v, m
    elif op == RLF:
        r, t = v << 1 | status & C, m << 1 | status >> 8 & C
        carry, doubt = v >> 7, m >> 7
    elif op == RRF:
        r, t = v >> 1 | (status & C) << 7, m >> 1 | (status >> 8 & C) << 7
        carry, doubt = v & C, m & C
    elif op == SWAP:
        r, t = v >> 4 | v << 4, m >> 4 | m << 4
    elif op == BCF:
        r, t = v & ~bits, m & ~bits
    elif op == BSF:
        r, t = v | bits, m & ~bits
    else:  # CLR
        r, t = 0, 0
    t &= 0xFF
    r &= 0xFF & ~t
    if base >= 0:
        r, t, doubt = base & 0xFF, 0x100, doubt | Z
    elif p and q and (op == SUB or (op == XOR and apart == 0)):
        r, t = apart, 0
    elif r == 0 and t and not (p and q and op == XOR):
        doubt |= Z
    if r == 0 and t == 0:
        carry |= Z
    doubt &= flags
    status = (status & ~(flags | flags << 8)) | (carry & flags & ~doubt) | doubt << 8
    return r | t << 8 | status << 24


@compiled
def ratio(s: Ints) -> int:
    """Return the cycles in which TMR0 counts one."""
    return 1 if s[OPTION] & PSA else 2 << (s[OPTION] & PS)


@compiled
def timer_exact(s: Ints) -> bool:
    """Return whether TMR0's value, and so T0IF, is known in every cycle to come."""
    return bool(s[T0] >> 8 == 0 and s[PRESCALER] >= 0 and s[OPTION] & T0CS == 0)


@compiled
def timer(s: Ints, at: int) -> int:
    """Return what an instruction in cycle `at` reads from TMR0."""
    if s[OPTION] & T0CS or s[PRESCALER] < 0 or s[T0] & UNKNOWN:
        return UNKNOWN
    if at <= s[T0_AT]:
        return int(s[T0])
    return int(s[T0] + (s[PRESCALER] + at - s[T0_AT]) // ratio(s) & 0xFF | s[T0] & 1 << 16)


@compiled
def rebase(s: Ints) -> None:
    """Count the cycles from now on: TMR0 and its prescaler become what they are, and the cycle 0."""
    now = s[CYCLE]
    if now > s[T0_AT]:
        value = timer(s, now)
        if s[PRESCALER] >= 0:
            s[PRESCALER] = (s[PRESCALER] + now - s[T0_AT]) % ratio(s)
        s[T0], s[T0_AT] = value, now
    for slot in TIMES:
        if abs(s[slot]) != NEVER:
            s[slot] -= now
    s[CYCLE] = 0


@compiled
def within(s: Ints, outer: Ints, slots: Ints) -> bool:
    """Return whether every chip of `s` is one of `outer`, both in cycle 0, as far as `slots`, TMR0's further
    course and the watchdog are concerned.
    """
    shift = -1
    for slot in slots:
        a, b = s[slot], outer[slot]
        if b >> 16:  # one φ must fit all bytes that have it: that of `s`, if it has one, and a difference
            found = a - b & 0xFF | a >> 16 << 8
            if a >> 8 & 0xFF or (shift >= 0 and found != shift):
                return False
            shift = found
        elif (0xFF if a >> 16 else a >> 8) & ~(b >> 8) or (a ^ b) & 0xFF & ~(b >> 8):
            return False
    if outer[T0] & UNKNOWN == 0:
        if s[T0_AT] != outer[T0_AT] or s[PRESCALER] != outer[PRESCALER]:
            return False
        if outer[T0_DUE] != NEVER and s[T0_DUE] != outer[T0_DUE]:
            return False
    if outer[WDT_DUE] == NEVER:
        return True
    return bool(s[WDT_DUE] >= outer[WDT_DUE] and s[WDT_CLEARED] >= outer[WDT_CLEARED])


@compiled
def plan_overflow(s: Ints) -> None:
    """Set the cycle in which T0IF is next seen set: one before TMR0 is read as 00h."""
    s[T0_DUE] = NEVER
    if timer_exact(s):
        s[T0_DUE] = s[T0_AT] + (256 - s[T0]) * ratio(s) - s[PRESCALER] - 1


@compiled
def plan_time_out(s: Ints, parameters: Ints, at: int, changed: int) -> None:
    """Set the first cycle in which any chip's watchdog may time out."""
    short = parameters[WATCHDOG]
    if short:
        known = changed & PSA == 0 and s[OPTION] & PSA  # its prescaler's count is 0 since CLRWDT
        s[WDT_DUE] = s[WDT_CLEARED] + (short << (s[OPTION] & PS) if known else short)
        if changed and at - s[WDT_CLEARED] >= short:
            s[WDT_DUE] = at


@compiled
def complete(states: Ints, flagged: Ints, parameters: Ints) -> int:
    """Derive, in listed states, what follows from the rest: prescaler and events to come. Return the first
    state in which an interrupt could come at an unknown time; -1 if there is none.
    """
    for number, s in enumerate(states):
        counted = ratio(s) - 1
        s[PRESCALER] = -1 if s[PRESCALER] >> 8 & counted else s[PRESCALER] & counted
        plan_overflow(s)
        if flagged[number] and timer_exact(s):
            s[T0_DUE] += 256 * ratio(s)
        s[WDT_DUE] = NEVER
        plan_time_out(s, parameters, 0, 0)
        if sample(s.copy(), 0) != GOES_ON:
            return number
    return -1


@compiled
def sample(s: Ints, at: int) -> int:
    """Note whether an interrupt is requested from cycle `at` on; refuse what is not known."""
    intcon = s[INTCON]
    wanted = False
    if intcon & GIE:
        if intcon & (INTE | RBIE) or (intcon & T0IE and (intcon >> 8 & T0IF or not timer_exact(s))):
            return INTERRUPT
        wanted = intcon & T0IE != 0 and intcon & T0IF != 0
    if wanted:
        s[IRQ] = min(s[IRQ], at)
    elif s[IRQ] >= at:
        s[IRQ] = NEVER
    return GOES_ON


@compiled
def pins(s: Ints) -> int:
    """Return the pins that are driven high, or with an unknown level."""
    latch = s[PORTA] & 0x1F | s[PORTA] >> 8 & 0x1F | (s[PORTB] & 0xFF | s[PORTB] >> 8) << 5
    return int(latch & ~(s[TRISA] | s[TRISB] << 5))


@compiled
def drive(s: Ints, parameters: Ints, edge_at: Ints, edge_out: Ints, at: int) -> int:
    """Compare the pins with the expected edges after the instruction of cycle `at` wrote a port or TRIS."""
    tris = s[TRISA] & 0x1F | s[TRISB] << 5
    out = (s[PORTA] & 0x1F | (s[PORTB] & 0xFF) << 5) & ~tris
    dark = (s[PORTA] >> 8 & 0x1F | (s[PORTB] >> 8 & 0xFF) << 5) & ~tris
    if s[FRAME] == BEFORE:
        if dark == 0:
            s[DARK] = NEVER
        elif s[DARK] == NEVER:
            s[DARK] = at + GLITCH
        if out == 0:
            return GOES_ON
        if dark or tris & parameters[CHANNELS]:
            return DARK_PIN
        if len(edge_at) == 0 or out != edge_out[0]:
            return WRONG_EDGE
        s[FRAME] = at - edge_at[0]
        s[EDGE] = 1
        s[OUT] = out
        return GOES_ON
    if dark or tris & parameters[CHANNELS]:
        return DARK_PIN
    if out != s[OUT]:
        edge = s[EDGE]
        if edge == len(edge_at) or at != s[FRAME] + edge_at[edge] or out != edge_out[edge]:
            return WRONG_EDGE
        s[EDGE] = edge + 1
        s[OUT] = out
    return GOES_ON


@compiled
def read(s: Ints, parameters: Ints, slot: int, at: int) -> int:
    """Return the byte that an instruction in cycle `at` reads from a register."""
    if slot == PORTA or slot == PORTB:
        driven, used, shift = ~s[slot + TRISA - PORTA], 0x1F, 0
        if slot == PORTB:
            used, shift = 0xFF, 5
        elif s[PORTA] & ~parameters[CHANNELS] & 0x10:
            driven &= ~0x10  # RA4 is an open drain: anybody may pull it low
        held = ~driven & parameters[HELD] >> shift
        unknown = (s[slot] >> 8 & driven | ~driven & ~held) & used
        return int((s[slot] & driven | parameters[LEVELS] >> shift & held) & used & ~unknown | unknown << 8)
    if slot == INTCON:  # INT and RB change are anybody's
        unknown = s[INTCON] >> 8 | 3 | (0 if timer_exact(s) else T0IF)
        return int(s[INTCON] & 0xFF & ~unknown | unknown << 8)
    if slot == T0:
        return timer(s, at)
    if slot == PCL:
        return int(s[PC] + 1 & 0xFF)
    return int(s[slot]) if slot != NOWHERE else 0


@compiled
def write(s: Ints, parameters: Ints, slot: int, at: int, r: int) -> int:
    """Write a register other than PCL, STATUS and the ports by an instruction in cycle `at`."""
    m = 0xFF if r >> 16 else r >> 8
    if slot == T0:
        if not timer_exact(s):  # it may have overflowed
            s[INTCON] = s[INTCON] & ~T0IF | T0IF << 8
        s[T0], s[T0_AT] = r, at + 3
        if s[OPTION] & PSA == 0:
            s[PRESCALER] = 0
        plan_overflow(s)
        return sample(s, at + 1)
    if slot == INTCON:
        if m & 0xF8:
            return REGISTER
        s[INTCON] = r & 0xFF | (m & T0IF) << 8
        return sample(s, at + 1)
    if slot == OPTION:
        if m:
            return REGISTER
        changed = s[OPTION] ^ r
        s[OPTION] = r
        if changed & (T0CS | PSA | PS):  # when TMR0 begins to count by the new clock is not specified
            s[T0] = UNKNOWN
            s[PRESCALER] = 0 if r & PSA else -1
            s[T0_AT] = at
            plan_time_out(s, parameters, at, changed)
        plan_overflow(s)
        return sample(s, at + 1)
    if slot == EECON1:
        if m & ~8 or r & 0x12:
            return EEPROM_WRITE
        s[EECON1] = r & 0x80C
        if r & 1:
            known = s[EEADR] < 64
            s[EEDATA] = parameters[EEPROM + s[EEADR]] if known else UNKNOWN
    elif slot == PCLATH:
        s[PCLATH] = r & ~m & 0x1F | (m & 0x1F) << 8
    elif slot != NOWHERE:
        s[slot] = r
    return GOES_ON


@compiled
def place(s: Ints, f: int) -> int:
    """Return the slot of file register `f` in the selected bank, or through FSR, which is known."""
    low, bank = f, s[STATUS] & RP0
    if f == 0:
        low, bank = s[FSR] & 0x7F, s[FSR] & 0x80
    if RAM <= low < RAM_END or low == PCL or low == STATUS or low == FSR or low == PCLATH or low == INTCON:
        return int(low)
    if low == T0 or low == PORTA or low == PORTB or low == EEDATA:
        return int(low + 0x50 if bank else low)
    return EEADR if low == EEADR and not bank else NOWHERE


@compiled
def ask(s: Ints, slot: int, bits: int) -> int:
    """Stop before an instruction that depends on unknown `bits` of `slot` (NOWHERE: of what it reads)."""
    s[ASKED], s[ASKED_BITS] = slot, bits
    return FORK


@compiled
def attend(s: Ints, parameters: Ints, edge_at: Ints) -> int:
    """Process the events due between two instructions; return the reason to stop."""
    now = s[CYCLE]
    if now >= s[T0_DUE]:
        s[INTCON] |= T0IF
        due = s[T0_DUE]
        s[T0_DUE] += 256 * ratio(s)
        sample(s, due)
    if now >= s[WDT_DUE]:
        return WATCHED
    if now > s[DARK]:
        return DARK_PIN
    if s[FRAME] != BEFORE:
        if s[EDGE] < len(edge_at):
            if now > s[FRAME] + edge_at[s[EDGE]]:
                return MISSING
        elif now >= s[FRAME] + parameters[PERIOD]:
            return NEW_FRAME
    if s[IRQ] < now:
        if s[DEPTH] == 8:
            return OVERFLOW
        s[STACK + s[DEPTH]] = s[PC]
        s[DEPTH] += 1
        s[PC] = 4
        s[INTCON] &= ~GIE
        s[CYCLE] = s[IRQ] + 3
        s[IRQ] = NEVER
    return TOO_LONG if now >= parameters[LIMIT] else GOES_ON


@compiled
def horizon_of(s: Ints, parameters: Ints, edge_at: Ints) -> int:
    """Return the first cycle in which `attend` has something to do."""
    first = min(s[T0_DUE], s[WDT_DUE], s[DARK] + 1, s[IRQ] + 1, parameters[LIMIT])
    if s[FRAME] != BEFORE:
        edge = s[EDGE]
        first = min(first, s[FRAME] + (edge_at[edge] + 1 if edge < len(edge_at) else parameters[PERIOD]))
    return int(first)


@compiled
def run(s: Ints, code: Ints, parameters: Ints, used: Ints, edge_at: Ints, edge_out: Ints) -> int:
    """Run to the next cut, fork, frame or last edge of a frame, and return the reason; the instruction at PC
    is not executed.

    Note in `used` which bytes of RAM were read before they were written, and which were written. The run
    depends on no other byte of RAM, and changes none but the written ones.
    """
    horizon = 0
    pulses = s[EDGE] < len(edge_at)
    while True:
        if s[CYCLE] >= horizon:
            if pulses and s[EDGE] == len(edge_at):
                return LAST_EDGE
            pc = s[PC]
            why = attend(s, parameters, edge_at)
            if why >= 0:
                return why
            horizon = horizon_of(s, parameters, edge_at)
            if s[CYCLE] >= horizon:  # the interrupt has taken time
                horizon = 0
            if s[PC] != pc:
                continue
        pc, at = s[PC], s[CYCLE]
        word = code[pc]
        if word < 0:
            return NO_WORD
        if word & CUT_HERE and at > 0 and (s[FRAME] != BEFORE or len(edge_at) == 0):
            return CUT
        op = word & 63
        after, cycles = pc + 1, 1
        # 1: the operand
        slot = NOWHERE
        a = word >> K_AT & 0xFF
        if word & (READS_F | TO_F):
            f = word >> F_AT & 0x7F
            if f == 0:
                if s[FSR] >> 8:
                    return PHASE if s[FSR] >> 16 else ask(s, FSR, s[FSR] >> 8)
            elif s[STATUS] >> 8 & RP0 and (f == T0 or f == PORTA or f == PORTB or f == EEDATA or f == EEADR):
                return ask(s, STATUS, RP0)
            slot = f if RAM <= f < RAM_END else place(s, f)
            if word & READS_F:
                if RAM <= slot < RAM_END:
                    a = s[slot]
                    if used[slot] == 0:
                        used[slot] = READ
                else:
                    a = read(s, parameters, slot, at)
                given = s[GIVEN]
                if given:
                    a = (a & ~(given << 8) & ~given) | s[GIVEN_BITS]
                if (slot == PORTA or slot == PORTB) and a >> 8:
                    asked = a >> 8 & parameters[BUTTONS] >> (5 if slot == PORTB else 0)
                    if op == BTFSC or op == BTFSS:
                        asked &= word >> BIT_AT
                    if asked & 0xFF and not word & TO_F:
                        ask(s, slot, asked & 0xFF)
                        return BUTTON
        # 2: the operation
        if op < BTFSC:
            w, flags = s[W], word >> FLAGS_AT & 7
            result = operate(op, a, w, s[STATUS], word >> BIT_AT & 0xFF, flags)
            r = result & 0x1FFFF
            m = r >> 8
            if word & TESTS_ZERO:
                if (m and r & 0xFF == 0) or m >> 8:
                    return PHASE if m >> 8 else ask(s, slot if RAM <= slot < RAM_END else NOWHERE, a >> 8)
                if r == 0:
                    after, cycles = pc + 2, 2
            if word & TO_F and slot == PCL:
                if m:
                    if m >> 8:
                        return PHASE
                    return ask(s, W, w >> 8) if w >> 8 else ask(s, NOWHERE, a >> 8)
                if s[PCLATH] >> 8 & 3:
                    return ask(s, PCLATH, s[PCLATH] >> 8 & 3)
                after, cycles = s[PCLATH] << 8 | r, 2
            s[STATUS] = result >> 24
            if word & TO_W:
                s[W] = r
            elif RAM <= slot < RAM_END:
                s[slot] = r
                used[slot] |= WRITTEN
            elif slot == STATUS:
                keep = TO_PD | (7 if flags else 0)
                keep |= keep << 8
                s[STATUS] = (s[STATUS] & keep) | ((UNKNOWN if m >> 8 else r) & ~keep)
            elif slot == PORTA or slot == PORTB or slot == TRISA or slot == TRISB:
                if m and (m >> 8 or slot >= TRISA):
                    return REGISTER
                s[slot] = r & 0x1F1F if slot == PORTA or slot == TRISA else r
                why = drive(s, parameters, edge_at, edge_out, at)
                if why >= 0:
                    return why
                horizon = 0
            elif slot != PCL and slot != FSR:
                why = write(s, parameters, slot, at, r)
                if why >= 0:
                    return why
                horizon = 0
            elif slot == FSR:
                s[FSR] = r
        elif op <= BTFSS:
            bit = word >> BIT_AT & 0xFF
            if a >> 16:
                return PHASE
            if a >> 8 & bit:
                stored = RAM <= slot < RAM_END or slot == STATUS or slot == FSR
                return ask(s, slot if stored else NOWHERE, bit)
            if (a & bit != 0) == (op == BTFSS):
                after, cycles = pc + 2, 2
        elif op == GOTO:
            after, cycles = word >> K_AT & 0x3FF, 2
        elif op == CALL or op == RETURN or op == RETLW or op == RETFIE:
            cycles = 2
            if op == CALL:
                if s[DEPTH] == 8:
                    return OVERFLOW
                s[STACK + s[DEPTH]] = after & 0x3FF
                s[DEPTH] += 1
                after = word >> K_AT & 0x3FF
            else:
                if s[DEPTH] == 0:
                    return EMPTY
                s[DEPTH] -= 1
                after = s[STACK + s[DEPTH]]
                s[STACK + s[DEPTH]] = 0
                if op == RETLW:
                    s[W] = a
                elif op == RETFIE:
                    s[INTCON] |= GIE
                    why = sample(s, at + 1)
                    if why >= 0:
                        return why
                    horizon = 0
        elif op == CLRWDT:
            s[STATUS] = s[STATUS] & ~(TO_PD << 8) | TO_PD
            s[WDT_CLEARED] = at + 1
            plan_time_out(s, parameters, at, 0)
            horizon = 0
        elif op == SLEEP:
            return SLEEPS
        elif op == WRITE_OPTION or op == TRIS:
            if s[W] >> 8:
                return REGISTER
            if op == TRIS:
                s[(word >> F_AT & 7) + TRISA - PORTA] = s[W] & (0x1F if word >> F_AT & 7 == PORTA else 0xFF)
                why = drive(s, parameters, edge_at, edge_out, at)
            else:
                why = write(s, parameters, OPTION, at, s[W])
            if why >= 0:
                return why
            horizon = 0
        s[GIVEN] = s[GIVEN_BITS] = 0
        s[PC] = after & 0x3FF
        s[CYCLE] = at + cycles


@compiled
def alike(row: Ints, start: Ints, used: Ints) -> bool:
    """Return whether `row` goes the way that `start` went, which used bytes of RAM as `used` says."""
    for slot in range(SLOTS - 1, -1, -1):
        if row[slot] != start[slot] and (not RAM <= slot < RAM_END or used[slot] & READ):
            return False
    return True


@compiled
def run_all(
    rows: Ints, code: Ints, parameters: Ints, begins: Ints, edge_at: Ints, edge_out: Ints, reasons: Ints
) -> int:
    """Run each of `rows` until it stops, note the `reasons`, and return the number of cycles.

    A run is determined by the slots outside of RAM and the bytes of RAM that it reads before it writes them.
    So a row that agrees in these with one of the runs before it goes the same way, without being run.
    The expected edges of a row are those from `begins[row[DUE]]` on.
    """
    starts = np.zeros((KEPT, SLOTS), dtype=np.int64)
    ends, used = starts.copy(), starts.copy()
    whys = np.zeros(KEPT, dtype=np.int64)
    runs, cycles = 0, 0
    for number, row in enumerate(rows):
        kept = 0
        while kept < min(runs, KEPT) and not alike(row, starts[kept], used[kept]):
            kept += 1
        if kept == min(runs, KEPT):
            kept = runs % KEPT
            runs += 1
            starts[kept] = ends[kept] = row[:SLOTS]
            used[kept] = 0
            first, last = begins[row[DUE]], begins[row[DUE] + 1]
            edges = edge_at[first:last], edge_out[first:last]
            whys[kept] = run(ends[kept], code, parameters, used[kept], edges[0], edges[1])
            cycles += ends[kept, CYCLE] - starts[kept, CYCLE]
        for slot in range(SLOTS):
            if not RAM <= slot < RAM_END or used[kept, slot] & WRITTEN:
                row[slot] = ends[kept, slot]
        reasons[number] = whys[kept]
    return cycles
