"""The checker's chip beside the simulator: every state of the simulator must be within the checker's.

In: an image, a seed. Out: how many instructions were compared, how many ways were split, and why it ended.
Wherever the checker asks for an unknown bit it is told what the simulator has.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from servogen.checker import chip, layout
from servogen.edges import PINS
from servogen.pic import device
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.simulator import EEPROM24, Machine, MachineState, SimulatorOptions, Stimuli, on_pins
from servogen.simulator import layout as at
from servogen.simulator.sources import Levels
from servogen.units import Clock
from tests.simulator import programs

CLOCK = Clock(4_000_000)
REGISTERS = {
    row.slot: {"PORTA": "LATA", "PORTB": "LATB", "OPTION": "OPTION_REG"}.get(name := row.name.upper(), name)
    for row in layout.REGISTERS
    if row.slot not in (layout.W, layout.STATUS, layout.TMR0)
}
FILES = {each.address: each.name for each in device.REGISTERS}
"""What the chip reads at addresses other than RAM; some alike in both banks."""
USED = {layout.PORTA: 0x1F, layout.TRISA: 0x1F, layout.EECON1: 0x0C, layout.INTCON: 0xFF}
NO_EDGES = np.zeros(0, dtype=np.int64)


PIECES = [each for each in programs.PIECES if each not in (programs.sleep, programs.eeprom)]

OVERTAKES: list[Callable[[random.Random], list[int]]] = [
    lambda rng: [encode("BCF", f=0x0B, b=2)],
    lambda rng: [encode("MOVLW", k=0xA0), encode("MOVWF", f=0x0B)],
    lambda rng: [encode("BSF", f=3, b=5), encode("BCF", f=1, b=rng.randrange(4)), encode("BCF", f=3, b=5)],
    lambda rng: [encode("INCF", f=1, d=1)],
]


def program(seed: int, timer_unknown: bool = False) -> Image:
    """A program of the pieces that the checker knows: no SLEEP, no EEPROM write, TMR0 counts cycles.

    With `timer_unknown` it does not write TMR0 before its interrupts are enabled.
    """
    rng = random.Random(seed)
    routine = [encode("BCF", f=3, b=5), encode("BCF", f=0x0B, b=2), encode("INCF", f=0x20, d=1)]
    words = [encode("GOTO", k=8), *[encode("NOP")] * 3, *routine, encode("RETFIE")]
    words += [encode("CLRF", f=5), encode("CLRF", f=6), encode("BSF", f=3, b=5)]
    for register, value in (
        (5, rng.randrange(256)),
        (6, rng.randrange(256)),
        (1, rng.choice((0xC0, 0xC2, 0xC8, 0xDF, 0xE8))),
    ):
        words += [encode("MOVLW", k=value), encode("MOVWF", f=register)]
    words += [encode("BCF", f=3, b=5)]
    if not timer_unknown:
        words += [encode("MOVLW", k=rng.randrange(256)), encode("MOVWF", f=1)]
    for address in rng.sample(programs.RAM, rng.randrange(7)):
        words += [encode("MOVLW", k=rng.randrange(256)), encode("MOVWF", f=address)]
    enables = (0xA0, 0xA0, 0xE0, 0xB0) if timer_unknown else (0, 0, 0xA0, 0x20, 0x80)
    words += [encode("MOVLW", k=rng.choice(enables)), encode("MOVWF", f=0x0B)]
    main = len(words)
    while timer_unknown and seed % 2 and len(words) < main + 9:  # a loop of nothing else
        words += rng.choice(OVERTAKES)(rng)
    while len(words) < main + (9 if timer_unknown and seed % 2 else 60):
        if timer_unknown and rng.random() < 0.1:  # as an overflow may just have come
            words += rng.choice(OVERTAKES)(rng)
        words += rng.choice(PIECES)(rng, len(words))
    words += [encode("GOTO", k=main)]
    return Image(dict(enumerate(words)), 0x3FF1, {cell: rng.randrange(256) for cell in range(4)})


SCL, SDA = 0x08, 0x10
"""Of a tape, on PORTA."""


def bus_program(seed: int) -> Image:
    """A program that talks to an EEPROM at random: whole bytes, mostly of a read, and now and then anything.

    What it has read is in 0x20 to 0x2F.
    """
    rng = random.Random(seed)
    words = [encode("MOVLW", k=SDA), encode("MOVWF", f=5), encode("BSF", f=3, b=5)]
    words += [encode("CLRF", f=5), encode("BCF", f=3, b=5)]
    main = len(words)

    def put(*levels: int) -> None:
        for level in levels:
            words.extend((encode("MOVLW", k=level), encode("MOVWF", f=5)))

    def clock(sda: int) -> None:
        put(sda, sda | SCL)
        words.extend((encode("MOVF", f=5, d=0), encode("MOVWF", f=0x20 + rng.randrange(16))))
        put(sda)

    def start() -> None:
        put(SDA, SDA | SCL)
        words.extend((encode("BTFSS", f=5, b=4), encode("GOTO", k=len(words) + 2)))
        put(SCL, 0)

    def give(byte: int) -> None:
        for bit in f"{byte:08b}1":
            clock(SDA * int(bit))

    def anything() -> None:
        put(*(rng.choice((0, SCL, SDA, SCL | SDA)) for _ in range(rng.randrange(1, 4))))
        words.append(encode(rng.choice(("BSF", "BCF")), f=5, b=rng.choice((3, 4))))

    while len(words) < 950:
        if rng.random() < 0.7:
            start()
        if rng.random() < 0.7:
            for byte in (0xA0, 0, rng.randrange(7)):
                give(byte)
            if rng.random() < 0.9:
                start()
        if rng.random() < 0.9:
            give(0xA1 if rng.random() < 0.9 else rng.randrange(256))
        for bit in range(rng.choice((9, 18, rng.randrange(20)))):
            clock(SDA * (bit % 9 < 8 or rng.random() < 0.1))
        if rng.random() < 0.3:
            anything()
    return Image(dict(enumerate([*words[:1020], encode("GOTO", k=main)])), 0x3FF1)


class Compared(NamedTuple):
    instructions: int
    asked: int
    reason: int
    phased: bool
    told: int = 0
    """How often the checker knew the level of SDA before an instruction, while SCL was high."""
    timed: int = 0
    """How often it knew TMR0 by its interrupt."""


def noise(rng: random.Random, cycles: int, bus: int = 0) -> Stimuli:
    """Any pin at any level at any time, but those of a bus."""
    sources = []
    for pin in (pin for pin in range(len(PINS)) if not bus >> pin & 1):
        times = sorted(rng.sample(range(cycles), rng.choice((0, 2, 40))))
        sources.append(Levels(pin, [(time, rng.randrange(2)) for time in times]))
    return Stimuli(sources)


def power_up(stage: int = layout.BEFORE) -> chip.Ints:
    return chip.after_reset(stage)


def memory(image: Image, tape: bytes = b"\0") -> chip.ChipMemory:
    return chip.memory_of(image, frozenset(), tape=tape)


def board(limit: int, recorded: int = 0) -> layout.ChipSurroundings:
    """A board on which nothing is held, that ends a run in the cycle `limit`; with bytes of a tape."""
    bus = {"bus": SCL | SDA, "size": 32768, "recorded": recorded, "low_time": 2, "high_time": 1}
    return layout.ChipSurroundings(
        limit, period=1 << 60, channels=0, buttons=0, held=0, levels=0, watchdog=0, **bus if recorded else {}
    )


def outputs(machine: Machine, cycles: int) -> tuple[chip.Ints, chip.Ints]:
    """The levels of the driven pins after each change, from the first that is not all low."""
    found: list[tuple[int, int]] = []
    last = 0
    while machine.cycles < cycles:
        began = machine.cycles
        machine.step()
        out = int(machine.numbers[at.LATCH]) & ~int(machine.numbers[at.TRIS]) & 0x1FFF
        if out != last:
            found.append((began, out))
            last = out
    at_, out_ = zip(*found, strict=True) if found else ((), ())
    return np.array(at_, dtype=np.int64), np.array(out_, dtype=np.int64)


def compare(
    image: Image, seed: int, cycles: int = 3000, tape: bytes = b"", watches: bool = False
) -> Compared:
    """Run both to the first thing that the checker refuses; raises AssertionError where they differ.

    A tape is in an EEPROM that has more bytes than the checker knows. With `watches` it runs as beside a
    contract.
    """
    rng, bus = random.Random(seed), SCL | SDA if tape else 0
    beside = [on_pins(EEPROM24(tape + b"\x3c", protected=True), scl="RA3", sda="RA4")] * bool(tape)
    floating = rng.random() < 0.5
    options = SimulatorOptions(
        start_seed=seed, floating=floating, ra4_pull_up=bool(tape), devices=tuple(beside),
        tmr0_phase=rng.randrange(4) if watches else 0,
    )  # fmt: skip
    stimulus = rng.randrange(1 << 30)
    edge_at = edge_out = NO_EDGES  # a program that talks to an EEPROM has no others
    if not tape and not watches:
        first = Machine(image, CLOCK, options, noise(random.Random(stimulus), cycles))
        edge_at, edge_out = outputs(first, cycles)
    machine = Machine(image, CLOCK, options, noise(random.Random(stimulus), cycles, bus))
    held = memory(image, tape or b"\0")
    s = power_up(layout.WATCHES if watches else layout.BEFORE)
    if tape:
        s[[layout.TAKES, layout.POINTER]] = layout.ANYTHING, -1
    phase, asked, instructions, stride, told = -1, 0, 0, rng.choice((31, 37) if tape else (1, 1, 7, 300)), 0
    timed = 0
    while s[layout.CYCLE] < cycles:
        used = np.zeros(layout.SLOTS, dtype=np.int64)
        why = chip.run(s, used, edge_at, edge_out, held, board(int(s[layout.CYCLE]) + stride, len(tape)))
        if tape:  # with a device each step takes as long as this
            machine.run(int(s[layout.CYCLE]) - machine.cycles)
        while machine.cycles < s[layout.CYCLE]:
            machine.step()
            instructions += 1
        state = machine.state()
        if why == layout.FORK:
            asked += 1
            give(s, state, image)
            continue
        if why == layout.MAY_INTERRUPT:
            s[layout.WAY] = way_of(machine, s)
            timed += s[layout.WAY] in (layout.T0IF, layout.T0IF << layout.IS_NOP)
            continue
        if why not in (layout.TOO_LONG, layout.LAST_EDGE):
            return Compared(instructions, asked, why, phase >= 0, told, timed)
        assert machine.cycles == s[layout.CYCLE] and state.pc & 0x3FF == s[layout.PC], f"seed {seed}"
        contained(s, state, phase, seed)
        told += s[layout.SEEN] == layout.UNREAD and s[layout.TAKES] == layout.GIVING
        if (
            phase < 0
            and not watches
            and s[layout.TMR0] >> 8 == 0
            and not s[layout.INTCON] & 0x20
            and rng.random() < 0.02
        ):
            phase = rng.randrange(256)
            forget(s, rng, phase)
    return Compared(instructions, asked, layout.TOO_LONG, phase >= 0, told, timed)


def way_of(machine: Machine, s: chip.Ints) -> int:
    """The way that the simulator takes: an interrupt that was sampled a cycle ago, or two; or none, or one
    that the checker has sampled, too.
    """
    ago, ways = machine.cycles - int(machine.numbers[at.IRQ_AT]), int(s[layout.ASKED_BITS])
    if ago <= 0 or s[layout.SAMPLED] > 1:
        return layout.NOTHING
    flags = [flag for flag in (layout.INTF, layout.RBIF, layout.T0IF) if ways & flag]
    set_now = machine.state().registers["INTCON"]
    flag = next((flag for flag in flags if set_now & flag), flags[-1])  # the instruction may have cleared it
    return flag if ago > 1 else flag << layout.IS_NOP


def give(s: chip.Ints, state: MachineState, image: Image) -> None:
    """Answer the checker's question with the simulator's value."""
    slot, bits = int(s[layout.ASKED]), int(s[layout.ASKED_BITS])
    if slot != layout.CHOSEN:
        value = concrete(state, slot)
        assert s[slot] >> 8 & bits
        s[slot] = s[slot] & ~(bits << 8) | value & bits
        return
    f = image.program[int(s[layout.PC])] & 0x7F
    address = state.registers["FSR"] if f == 0 else f | (state.status & 0x20) << 2
    value = state.registers[FILES[address if address in FILES else address & 0x7F]]
    s[layout.CHOSEN] = s[layout.CHOSEN] & ~(bits << 8) | value & bits


def concrete(state: MachineState, slot: int) -> int:
    if layout.RAM <= slot < layout.RAM_END:
        return state.ram[slot - layout.RAM]
    if slot == layout.W:
        return state.w
    return state.status if slot == layout.STATUS else state.registers[REGISTERS[slot]]


def contained(s: chip.Ints, state: MachineState, phase: int, seed: int) -> None:
    """The simulator's state is one of the checker's."""
    for slot in (*range(layout.RAM, layout.RAM_END), layout.W, layout.STATUS, *REGISTERS):
        cell, value = int(s[slot]), concrete(state, slot)
        used = USED.get(slot, 0xFF)
        if slot == layout.INTCON:
            cell |= 0x400 if s[layout.TMR0] >> 8 else 0
        if cell >> 16:
            assert (cell + phase) & 0xFF == value, f"seed {seed}: slot {slot:#x}"
        else:
            assert (cell ^ value) & ~(cell >> 8) & used == 0, (
                f"seed {seed}: slot {slot:#x} {cell:#x} {value:#x}"
            )
    timer = int(s[layout.TMR0])
    if timer >> 16:
        assert (timer + phase) & 0xFF == state.registers["TMR0"], f"seed {seed}: TMR0"
    elif timer >> 8 == 0:
        assert timer == state.registers["TMR0"], f"seed {seed}: TMR0"
    depth = int(s[layout.DEPTH])
    stack = [level & 0x3FF for level in state.stack[:depth]][::-1]
    assert s[layout.STACK : layout.STACK + depth].tolist() == stack, f"seed {seed}: stack"


def forget(s: chip.Ints, rng: random.Random, phase: int) -> None:
    """Let TMR0 and some bytes of RAM be known only relative to each other."""
    for slot in (*rng.sample(range(layout.RAM, layout.RAM_END), 30), 0x0C, 0x0D, 0x20):
        if s[slot] >> 8 == 0:
            s[slot] = (s[slot] - phase) & 0xFF | 1 << 16
    s[layout.TMR0] = (s[layout.TMR0] - phase) & 0xFF | 1 << 16
