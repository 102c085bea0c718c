# ruff: noqa: SIM109 - in compiled code two comparisons are what they are; a tuple is an object
"""The instruction loop. It is compiled in four variants: plain, with observation, with tracking of unknown
values, and noting the state at breakpoints.

In: the state vector, the program, events from outside. Out: the state vector later, edges in a buffer, and
the reason why it stopped. Instructions and cycles: DS35007 section 7, table 7-2; STATUS as a destination:
section 2.3.1; PCL as a destination: section 2.4; INDF and FSR: section 2.5.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.pic.device import RAM_FIRST, RAM_LAST, masks
from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.events import deliver_events, service_interrupts
from servogen.simulator.interrupts import GIE, note_flags, requested
from servogen.simulator.layout import (
    AT_BREAKPOINT,
    AT_END,
    CYCLE,
    DEEPEST_RECORDING,
    EDGE_COUNT,
    EDGE_LIMIT,
    EDGES_FULL,
    FSR,
    FSR_UNKNOWN,
    GOES_ON,
    HERE,
    HORIZON,
    IN_RESET,
    INTCON,
    INTCON_ADDRESS,
    NEEDS_STIMULUS,
    NOT_WRITTEN,
    PC,
    PCL_ADDRESS,
    PCLATH,
    PHASED,
    PRESCALER,
    READ_UNWRITTEN,
    RECORD,
    SLEEPING,
    STATUS,
    STATUS_ADDRESS,
    STATUS_UNKNOWN,
    STIM_COUNT,
    STIM_KNOWN,
    STIM_NEXT,
    T0_AT,
    TMR0_UNKNOWN,
    TRACE_COUNT,
    TRACE_FULL,
    TRACE_ROOM,
    UNKNOWN_SHIFT,
    USE_BANK,
    USE_JUMP,
    USE_POINTER,
    USE_SKIP,
    VISIT,
    W_UNKNOWN,
    WARN_ERASED,
    WARN_UNDEFINED,
    W,
)
from servogen.simulator.memo import lookup, pack_processor, pack_registers, recall, remember
from servogen.simulator.ports import A, B, tris_write
from servogen.simulator.program import (
    BREAK,
    ERASED,
    EXIT,
    FILE_OPS,
    LOOP,
    OPS,
    SPIN,
    UNDEFINED,
    UNTIL,
    WAITS_BIT,
)
from servogen.simulator.registers import read_register, write_option, write_register
from servogen.simulator.resets import PD, TO
from servogen.simulator.stack import pop, push
from servogen.simulator.timer import (
    settle_counters,
    t0_advance,
    t0_news_at,
    t0_read,
    t0_runs,
    t0_shift,
    t0_sync,
    wdt_clear,
)
from servogen.simulator.unknown import doubt, doubt_sleep, propagate, use, without, written_status
from servogen.simulator.warn import warn

ADDWF, ANDWF, CLRF, CLRW = OPS["ADDWF"], OPS["ANDWF"], OPS["CLRF"], OPS["CLRW"]
COMF, DECF, DECFSZ, INCF, INCFSZ = OPS["COMF"], OPS["DECF"], OPS["DECFSZ"], OPS["INCF"], OPS["INCFSZ"]
IORWF, MOVF, MOVWF, NOP = OPS["IORWF"], OPS["MOVF"], OPS["MOVWF"], OPS["NOP"]
RLF, RRF, SUBWF, SWAPF, XORWF = OPS["RLF"], OPS["RRF"], OPS["SUBWF"], OPS["SWAPF"], OPS["XORWF"]
BCF, BSF, BTFSC, BTFSS = OPS["BCF"], OPS["BSF"], OPS["BTFSC"], OPS["BTFSS"]
ADDLW, ANDLW, CALL, CLRWDT, GOTO = OPS["ADDLW"], OPS["ANDLW"], OPS["CALL"], OPS["CLRWDT"], OPS["GOTO"]
IORLW, MOVLW, RETFIE, RETLW = OPS["IORLW"], OPS["MOVLW"], OPS["RETFIE"], OPS["RETLW"]
RETURN, SLEEP, SUBLW, XORLW = OPS["RETURN"], OPS["SLEEP"], OPS["SUBLW"], OPS["XORLW"]
OPTION, TRIS = OPS["OPTION"], OPS["TRIS"]

PC_MASK = 0x1FFF  # 13 bits: DS35007 section 2.4
ROW_MASK = 0x03FF  # 1024 words, mirrored above: section 2.1
D, FLAGS, DIRECT = 1 << 6, 1 << 7, 1 << 15
ROW = 1024
C, DC, Z, RP0 = masks("C", "DC", "Z", "RP0")
UNWRITABLE = TO | PD
RAM_END = RAM_LAST + 1
NO_SLOT = -1
WAITS, PERIOD_SHIFT, CLEARS_SHIFT = 1 << WAITS_BIT, WAITS_BIT + 1, WAITS_BIT + 9
PERIOD_MASK, SPIN_CLEARS_SHIFT = 0xFF, 16
UNTIL_PERIOD, UNTIL_READ = 5, 3
"""Cycles of a turn of a wait for TMR0, and from its reading of TMR0 to its GOTO."""
PAGE_BITS = 0x18  # of PCLATH, for CALL and GOTO: section 2.4


@compiled
def stays(s: Vector, plain: Vector, pc: int) -> bool:
    """Return whether the GOTO at `pc` stays in its own page and mirror image."""
    return s[PCLATH] & PAGE_BITS == 0 and (plain[pc & ROW_MASK] >> 8 & 0x7FF) >> 10 == pc >> 10


@compiled
def turns_until(s: Vector, cycle: int, value: int, horizon: int) -> int:
    """Return how often the wait for TMR0 to equal `value` turns, from its GOTO in `cycle` on, before
    `horizon`.

    Up to the last of these turns it has not read the value; after it the GOTO is still before `horizon`.
    """
    first = cycle + UNTIL_PERIOD - UNTIL_READ
    ticks = (value - t0_read(s, first)) & 0xFF
    turns = (horizon - 1 - cycle) // UNTIL_PERIOD
    if ticks and t0_runs(s):
        shift = t0_shift(s)
        past = s[PRESCALER] & ((1 << shift) - 1)
        counted = max(0, past + first - s[T0_AT]) >> shift
        equal = s[T0_AT] + ((counted + ticks) << shift) - past
        turns = min(turns, (equal - 1 - first) // UNTIL_PERIOD + 1)
    return max(0, turns) if ticks else 0


def instruction_loop(observed: bool, tracked: bool, visits: bool = False) -> Callable[..., int]:
    """Return the loop as a Python function to be compiled.

    `observed` counts and traces every instruction, `tracked` tracks unknown values through each (unknown.py);
    with `visits` it does not return at a breakpoint, but copies the state to the trace and continues.
    """

    def run(
        s: Vector,
        end: int,
        edges: Vector,
        stim: Vector,
        code: Vector,
        plain: Vector,
        regions: Vector,
        memo: Vector,
        recording: Vector,
        resume: int,
        counts: Vector,
        trace: Vector,
    ) -> int:
        pc, w, status, cycle = s[PC], s[W], s[STATUS], s[CYCLE]
        wu, su = 0, 0
        if tracked:
            wu, su = s[W_UNKNOWN], s[STATUS_UNKNOWN]
        while True:
            s[PC] = pc
            s[HERE] = pc
            s[W] = w
            s[STATUS] = status
            s[CYCLE] = cycle
            if tracked:
                s[W_UNKNOWN] = wu
                s[STATUS_UNKNOWN] = su
            deliver_events(s, edges, stim)
            if s[CYCLE] >= s[STIM_KNOWN] and s[STIM_NEXT] == s[STIM_COUNT]:
                settle_counters(s, min(s[CYCLE], s[STIM_KNOWN]))
                return NEEDS_STIMULUS
            why = GOES_ON
            if s[CYCLE] >= end:
                why = AT_END
            elif s[EDGE_COUNT] >= s[EDGE_LIMIT]:
                why = EDGES_FULL
            elif observed and s[TRACE_ROOM] and s[TRACE_COUNT] >= s[TRACE_ROOM]:
                why = TRACE_FULL
            if why != GOES_ON:
                settle_counters(s, s[CYCLE])
                return why
            service_interrupts(s, edges, stim)
            if s[SLEEPING] or s[IN_RESET]:
                s[CYCLE] = max(s[CYCLE], min(end, s[HORIZON]))
            pc, status, cycle = s[PC], s[STATUS], s[CYCLE]
            if s[SLEEPING] or s[IN_RESET]:
                continue
            horizon = min(s[HORIZON], end)
            base = 0
            depth = 0
            bank = (status & RP0) << 2  # RP0 (bit 5) becomes bit 7 of the address
            while cycle < horizon:
                start = cycle
                instruction_pc = pc
                word = code[base + (pc & ROW_MASK)]
                op = word & 63
                if op >= EXIT:
                    if op == EXIT:  # the region that is being recorded is left
                        depth -= 1
                        remember(
                            s, memo, recording, depth, regions, cycle, pack_processor(pc, w, status, wu, su)
                        )
                        base = (recording[3 + RECORD * (depth - 1)] + 1) * ROW if depth else 0
                        continue
                    if op == BREAK:
                        if cycle != resume:
                            s[PC], s[W], s[STATUS], s[CYCLE] = pc, w, status, cycle
                            if tracked:
                                s[W_UNKNOWN], s[STATUS_UNKNOWN] = wu, su
                            settle_counters(s, cycle)
                            if not visits:
                                return AT_BREAKPOINT
                            if s[TRACE_COUNT] == s[TRACE_ROOM]:
                                return TRACE_FULL
                            for slot in range(VISIT):
                                trace[VISIT * s[TRACE_COUNT] + slot] = s[slot]
                            s[TRACE_COUNT] += 1
                            resume = cycle
                            break
                    elif op == LOOP:
                        region = word >> 8
                        # The memo's keys have no PCLATH: a region is recalled only where its GOTOs stay in
                        # page 0.
                        if s[PCLATH] & PAGE_BITS == 0:
                            registers = pack_registers(s, regions, region)
                            if registers >= 0:
                                key = pack_processor(pc, w, status, wu, su)
                                slot = lookup(memo, key, registers)
                                if slot >= 0:
                                    # Otherwise an event is due inside the region, which is then executed word
                                    # by word.
                                    if cycle + memo[slot + 2] <= horizon:
                                        cycle += memo[slot + 2]
                                        recall(s, memo, slot, regions, region)
                                        after = memo[slot + 3]
                                        pc, w, status = after >> 16 & PC_MASK, after >> 8 & 0xFF, after & 0xFF
                                        if tracked:
                                            wu, su = after >> 29 & 0xFFFF, after >> 45
                                        bank = (status & RP0) << 2
                                        continue
                                elif depth < DEEPEST_RECORDING:
                                    recording[0 + RECORD * depth] = key
                                    recording[1 + RECORD * depth] = registers
                                    recording[2 + RECORD * depth] = cycle
                                    recording[3 + RECORD * depth] = region
                                    depth += 1
                                    base = (region + 1) * ROW
                    elif op == SPIN and stays(s, plain, pc):
                        period = word >> 8 & PERIOD_MASK
                        turns = (horizon - cycle) // period
                        if word >> SPIN_CLEARS_SHIFT and turns:
                            wdt_clear(s, cycle + (turns - 1) * period + 2 + (word >> SPIN_CLEARS_SHIFT))
                            status |= UNWRITABLE
                        cycle += turns * period
                        if cycle >= horizon:
                            break
                        start = cycle
                    elif op == UNTIL and bank == 0 and stays(s, plain, pc):
                        slot = word >> 8 & 127
                        vu = s[slot] >> UNKNOWN_SHIFT
                        ru = s[TMR0_UNKNOWN]
                        # Both known, or both moving with the same phase: only then is the time known at which
                        # they are equal.
                        if vu == ru and (ru == 0 or ru == PHASED):
                            v = s[slot] & 0xFF
                            turns = turns_until(s, cycle, v, horizon)
                            if turns:
                                s[READ_UNWRITTEN + slot] |= s[slot] & NOT_WRITTEN != 0
                                cycle += turns * UNTIL_PERIOD
                                start = cycle
                                r = t0_read(s, cycle - UNTIL_READ)
                                if tracked and ru | su:
                                    su = propagate(MOVF, 0, r, ru, w, wu, su, r) >> 16
                                    ru = propagate(XORWF, 0, v, vu, r, ru, su, v ^ r)
                                    su = ru >> 16
                                    ru &= 0xFFFF
                                w = v ^ r
                                status &= ~Z
                                if tracked:
                                    wu = ru
                    word = plain[pc & ROW_MASK]
                    op = word & 63
                pc = (pc + 1) & PC_MASK
                cycle += 1
                if op < FILE_OPS:
                    # 1: the operand's place, and what is read there
                    slot = NO_SLOT
                    skip = False
                    vu = ru = 0
                    address = word >> 8 & 127
                    if word & DIRECT:
                        slot = address
                    else:
                        if address == 0:
                            address = s[FSR]
                            if tracked and s[FSR_UNKNOWN]:
                                s[CYCLE] = start
                                s[HERE] = pc - 1
                                use(s, USE_POINTER, 0, s[FSR_UNKNOWN] >> 8)
                        else:
                            address |= bank
                        low = address & 127
                        if low >= RAM_FIRST and low < RAM_END:
                            slot = low
                    if op == MOVWF:
                        r = w
                        if tracked:
                            ru = wu
                    elif op == CLRF:
                        r = 0
                        status |= Z
                        if tracked:
                            su = without(su, Z)
                    else:
                        if slot >= 0:
                            v = s[slot]
                            if v > 0xFF:
                                if v & NOT_WRITTEN:
                                    s[READ_UNWRITTEN + slot] = 1
                                if tracked:
                                    vu = v >> UNKNOWN_SHIFT
                                v &= 0xFF
                        elif address & 127 == STATUS_ADDRESS:
                            v = status
                            if tracked:
                                vu = su
                        elif address & 127 == PCL_ADDRESS:
                            v = pc & 0xFF
                        else:
                            s[CYCLE] = start
                            s[HERE] = pc - 1
                            bits = word >> 16 & 0xFF
                            v = read_register(s, address, start, bits if bits else 0xFF)
                            if tracked:
                                vu = v >> 8
                            v &= 0xFF
                        # 2: the operation
                        if op == BTFSC or op == BTFSS:
                            r = 1
                            skip = (v & word >> 16 & 0xFF != 0) == (op == BTFSS)
                            if not skip and word & WAITS and stays(s, plain, pc):
                                # the GOTO after it leads back here, and nothing changes until then:
                                flags = address & 127 == INTCON_ADDRESS
                                limit = min(horizon, t0_news_at(s)) if flags else horizon
                                period = word >> PERIOD_SHIFT & PERIOD_MASK
                                turns = max(0, limit - 1 - start) // period
                                if word >> CLEARS_SHIFT and turns:
                                    wdt_clear(s, start + (turns - 1) * period + 3 + (word >> CLEARS_SHIFT))
                                    status |= UNWRITABLE
                                cycle += turns * period
                        elif op == BCF:
                            r = v & ~(word >> 16) & 0xFF
                        elif op == BSF:
                            r = v | (word >> 16 & 0xFF)
                        elif op == MOVF:
                            r = v
                            status = status & ~Z | (Z if r == 0 else 0)
                        elif op == DECFSZ:
                            r = (v - 1) & 0xFF
                        elif op == INCFSZ:
                            r = (v + 1) & 0xFF
                        elif op == SWAPF:
                            r = (v >> 4 | v << 4) & 0xFF
                        elif op == RLF:
                            r = (v << 1 | status & C) & 0xFF
                            status = status & ~C | v >> 7
                        elif op == RRF:
                            r = v >> 1 | (status & C) << 7
                            status = status & ~C | v & C
                        elif op == ADDWF:
                            r = v + w
                            status = status & ~(C | DC) | r >> 8 | ((v & 15) + (w & 15) >> 4) << 1
                            r &= 0xFF
                            status = status & ~Z | (Z if r == 0 else 0)
                        elif op == SUBWF:
                            r = (v - w) & 0xFF
                            status &= ~(C | DC)
                            status |= (C if v >= w else 0) | (DC if v & 15 >= w & 15 else 0)
                            status = status & ~Z | (Z if r == 0 else 0)
                        else:
                            if op == ANDWF:
                                r = v & w
                            elif op == IORWF:
                                r = v | w
                            elif op == XORWF:
                                r = v ^ w
                            elif op == COMF:
                                r = v ^ 0xFF
                            elif op == DECF:
                                r = (v - 1) & 0xFF
                            else:
                                r = (v + 1) & 0xFF
                            status = status & ~Z | (Z if r == 0 else 0)
                        # 3: which of its bits are unknown
                        if tracked and vu | wu | su:
                            if op == BTFSC or op == BTFSS:
                                # What notes a use or a warning reads the cycle and the address of the
                                # instruction from the state, which otherwise lags behind the local variables.
                                if vu & word >> 16 & 0xFF:
                                    s[CYCLE] = start
                                    s[HERE] = pc - 1
                                    use(s, USE_SKIP, 0, vu >> 8)
                            else:
                                ru = propagate(op, word >> 16 & 0xFF, v, vu, w, wu, su, r)
                                su = ru >> 16
                                ru &= 0xFFFF
                    # 4: the destination
                    if op == DECFSZ or op == INCFSZ:
                        skip = r == 0
                        if tracked and ru and r & ~ru & 0xFF == 0:
                            s[CYCLE] = start
                            s[HERE] = pc - 1
                            use(s, USE_SKIP, 0, ru >> 8)
                    if op == BTFSC or op == BTFSS:
                        pass
                    elif word & D == 0:
                        w = r
                        if tracked:
                            wu = ru
                    elif slot >= 0:
                        s[slot] = r | ru << UNKNOWN_SHIFT if tracked else r
                    elif address & 127 == STATUS_ADDRESS:
                        if tracked and ru & RP0:
                            s[CYCLE] = start
                            s[HERE] = pc - 1
                            use(s, USE_BANK, 0, ru >> 8)
                        if word & FLAGS:
                            r = r & ~(C | DC | Z) | status & (C | DC | Z)
                        if tracked and word & FLAGS:
                            ru = without(ru, C | DC | Z) | su & (C | DC | Z)
                            if ru & 0xFF and ru & 0xFF00 == 0:
                                ru |= su & 0xFF00
                        if tracked:
                            su = written_status(su, ru)
                        status = r & ~UNWRITABLE | status & UNWRITABLE
                        bank = (status & RP0) << 2
                    elif address & 127 == PCL_ADDRESS:
                        if tracked and ru:
                            s[CYCLE] = start
                            s[HERE] = pc - 1
                            use(s, USE_JUMP, 0, ru >> 8)
                        pc = s[PCLATH] << 8 | r
                        cycle += 1
                        skip = False  # the word that a skip would discard is already discarded
                    else:
                        s[CYCLE] = start
                        s[HERE] = pc - 1
                        # The write may have moved the time of an event: the loop returns for a new horizon.
                        if write_register(s, edges, address, start, r, ru):
                            horizon = 0
                    if skip:
                        pc = (pc + 1) & PC_MASK
                        cycle += 1
                elif op == GOTO:
                    pc = (word >> 8 & 0x7FF) | (s[PCLATH] & PAGE_BITS) << 8
                    cycle += 1
                elif op == CALL:
                    s[CYCLE] = start
                    s[HERE] = pc - 1
                    push(s, pc)
                    pc = (word >> 8 & 0x7FF) | (s[PCLATH] & PAGE_BITS) << 8
                    cycle += 1
                elif op == MOVLW:
                    w = word >> 8 & 0xFF
                    if tracked:
                        wu = 0
                elif op == NOP:
                    pass
                elif op == RETURN or op == RETLW or op == RETFIE:
                    s[CYCLE] = start
                    s[HERE] = pc - 1
                    pc = pop(s)
                    cycle += 1
                    if op == RETLW:
                        w = word >> 8 & 0xFF
                        if tracked:
                            wu = 0
                    elif op == RETFIE:
                        t0_sync(s, start)
                        s[INTCON] |= GIE
                        note_flags(s, start + 1)
                        if tracked:
                            doubt(s, t0_runs(s))
                        horizon = 0
                elif op == ADDLW or op == ERASED:
                    v = word >> 8 & 0xFF
                    if op == ERASED:
                        s[CYCLE] = start
                        s[HERE] = pc - 1
                        warn(s, WARN_ERASED, instruction_pc & ROW_MASK)
                        v = 0xFF
                    r = v + w
                    status = status & ~(C | DC) | r >> 8 | ((v & 15) + (w & 15) >> 4) << 1
                    r &= 0xFF
                    status = status & ~Z | (Z if r == 0 else 0)
                    if tracked and wu | su:
                        ru = propagate(ADDLW, 0, v, 0, w, wu, su, r)
                        wu, su = ru & 0xFFFF, ru >> 16
                    w = r
                elif op == SUBLW:
                    v = word >> 8 & 0xFF
                    status &= ~(C | DC)
                    status |= (C if v >= w else 0) | (DC if v & 15 >= w & 15 else 0)
                    r = (v - w) & 0xFF
                    status = status & ~Z | (Z if r == 0 else 0)
                    if tracked and wu | su:
                        ru = propagate(SUBLW, 0, v, 0, w, wu, su, r)
                        wu, su = ru & 0xFFFF, ru >> 16
                    w = r
                elif op == CLRWDT:
                    wdt_clear(s, cycle)  # the deadline only moves away, so the horizon holds
                    status |= UNWRITABLE
                    if tracked:
                        su = without(su, UNWRITABLE)
                elif op == SLEEP:
                    t0_sync(s, start)
                    if tracked:
                        s[CYCLE] = start
                        s[HERE] = pc - 1
                        doubt_sleep(s)
                    if not requested(s):  # else it is a NOP: DS35007 section 6.11.3
                        wdt_clear(s, cycle)
                        status = status & ~PD | TO
                        if tracked:
                            su = without(su, UNWRITABLE)
                        t0_advance(s, cycle)
                        s[SLEEPING] = 1
                        horizon = 0
                elif op == OPTION:
                    s[CYCLE] = start
                    s[HERE] = pc - 1
                    write_option(s, start, w, wu)
                    horizon = 0
                elif op == TRIS:
                    s[CYCLE] = start
                    s[HERE] = pc - 1
                    tris_write(s, edges, start, A if word >> 8 & 127 == 5 else B, w, wu)
                    horizon = 0
                elif op == UNDEFINED:
                    s[CYCLE] = start
                    s[HERE] = pc - 1
                    warn(s, WARN_UNDEFINED, instruction_pc & ROW_MASK)
                else:
                    v = word >> 8 & 0xFF
                    if op == CLRW:
                        r = 0
                    elif op == ANDLW:
                        r = w & v
                    elif op == IORLW:
                        r = w | v
                    else:
                        r = w ^ v
                    status = status & ~Z | (Z if r == 0 else 0)
                    if tracked and op == CLRW:
                        wu = 0
                        su = without(su, Z)
                    elif tracked and wu | su:
                        ru = propagate(op, 0, v, 0, w, wu, su, r)
                        wu, su = ru & 0xFFFF, ru >> 16
                    w = r
                if observed:
                    counts[2 * (instruction_pc & ROW_MASK) + 0] += 1
                    counts[2 * (instruction_pc & ROW_MASK) + 1] += cycle - start
                    if s[TRACE_ROOM]:
                        i = s[TRACE_COUNT]
                        trace[4 * i + 0], trace[4 * i + 1], trace[4 * i + 2], trace[4 * i + 3] = (
                            start,
                            instruction_pc,
                            w,
                            status,
                        )
                        s[TRACE_COUNT] = i + 1
                        if i + 1 == s[TRACE_ROOM]:
                            break

    return run
