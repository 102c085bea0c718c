"""The player's kernel: cycles counted from its words over all paths, and all pairs of widths simulated.

For every length of the timer's tick, and for pins that rise together or one after the other.
"""

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.edges import join
from servogen.engines.player.layout import NONE, STAGGER, TAIL, TICKS, to_rise
from servogen.engines.player.rendering import PRESCALER, kernel
from servogen.pic.assembler import Assembly, assemble
from servogen.pic.device import device
from servogen.pic.isa import decode
from servogen.simulator import Machine
from servogen.units import Clock, Cycles

VARIABLES = (
    *("pulse_a_lo", "pulse_a_hi", "pulse_b_lo", "pulse_b_hi", "mask_a", "mask_b", "both", "port"),
    *("target", "ahead", "overrun", "stay", "fine", "apart", "count"),
)
FINE, APART, COUNT = "_fine", "_apart", "_count"
Z = (3, 2)


@cache
def assembled(tick: int = 32, stagger: int = 0) -> Assembly:
    names = "\n".join(f"_{name} equ 0x{0x20 + number:02X}" for number, name in enumerate(VARIABLES))
    chip = '    list p=16f84, r=dec\n    include "p16f84.inc"\n'
    text = kernel(Cycles(tick), Cycles(stagger))
    return assemble(f"{chip}{names}\n    org 0\n{text}\n    nop\n    end\n")


def label(name: str, code: Assembly | None = None) -> int:
    return dict((code or assembled()).labels)[name]


def ram(name: str) -> int:
    return 0x20 + VARIABLES.index(name.strip("_"))


Bits = dict[tuple[int, int], bool]


def cycles(start: int, ends: set[int], bits: Bits, code: Assembly | None = None) -> tuple[int, int]:
    """Static count from `start` to the first of `ends`: (cycles, where). `bits` answers every test of a bit.

    A counted pad (DECFSZ of _count) is taken as often as the MOVLW before it says.
    """
    program = (code or assembled()).image.program
    at, spent, literal, count = start, 0, 0, 0
    while at not in ends or spent == 0:
        word = decode(program[at])
        assert word is not None
        name, spent, step = word.instruction.mnemonic, spent + word.instruction.cycles, 1
        if name == "MOVLW":
            literal = word.k
        elif name == "MOVWF" and word.f == ram(COUNT):
            count = literal
        elif name == "DECFSZ" and word.f == ram(COUNT):
            count -= 1
            step = 2 if count == 0 else 1
        elif name in ("BTFSS", "BTFSC"):
            step = 2 if bits[word.f, word.b] == (name == "BTFSS") else 1
        elif name == "GOTO":
            at, step = word.k, 0
        else:
            assert not word.instruction.skips, f"{name} at {at}"
        spent += step == 2
        at += step
    return spent, at


def all_bits(name: str, number: int) -> Iterator[tuple[int, Bits]]:
    for value in range(1 << number):
        yield value, {(ram(name), bit): bool(value >> bit & 1) for bit in range(8)}


def rises(code: Assembly | None = None) -> list[int]:
    """The addresses of the writes to INDF, the first of which raises the pins."""
    program = (code or assembled()).image.program
    return [at for at, word in sorted(program.items()) if word == 0x0080]  # MOVWF INDF


@pytest.mark.parametrize("stagger", [NONE, STAGGER])
@pytest.mark.parametrize("tick", TICKS)
def test_the_lock_takes_out_every_phase_of_the_poll(tick: int, stagger: int) -> None:
    # The poll's read is 0 to 4 cycles after the tick; each later read is about the next increment's time.
    code = assembled(tick, stagger)
    program, rise = code.image.program, rises(code)[0]
    found = set()
    for late in range(5):
        at, time = label("pl_poll", code) + 4, late + 4  # movf, xorwf, btfss that skips, over the goto
        for _ in range(3):
            read = next(
                address
                for address in range(at, rise)
                if (word := decode(program[address])) and word.instruction.mnemonic == "SUBWF"
            )
            spent, _ = cycles(at, {read}, {}, code)
            after = (time + spent) // tick - time // tick
            assert after in (0, 1)
            tests = read + 1
            while program[tests] == program[read + 1]:
                tests += 2
            more, at = cycles(read, {tests}, {Z: after == 1}, code)
            time += spent + more
        # Not zero: there are pulses.
        found.add(time + cycles(at, {rise}, {Z: False}, code)[0])
    # The layout allows for the staggered kernel, which rises one cycle later.
    assert found == {to_rise(Cycles(tick)) - (0 if stagger else 1)}


def test_a_staggered_pin_rises_as_much_later_as_is_said() -> None:
    code = assembled(32, STAGGER)
    first, second = rises(code)[:2]
    assert cycles(first, {second}, {}, code)[0] == STAGGER


def test_the_kernel_ends_soon_after_the_later_fall() -> None:
    done, second = label("pl_done"), {0x10: label("pl_0") + 2, 0x20: label("pl_0") + 7}
    # The way through the second loop, which turns once after an early fall: seven cycles and its CLRF.
    loop = 7 + 1
    for flags, fall in second.items():
        bits = {(ram(APART), bit): bool(flags >> bit & 1) for bit in range(8)}
        assert cycles(fall, {label("pl_loop2")}, bits)[0] + loop <= TAIL
    both = {(ram(APART), bit): bit == 4 for bit in range(8)}
    assert cycles(label("pl_0"), {label("pl_loop2")}, both)[0] + loop == TAIL
    assert cycles(label("pl_one") + 7, {done}, {})[0] < TAIL


@pytest.mark.parametrize("fine", range(8))
def test_the_fine_delay_is_as_long_as_its_three_bits_say(fine: int) -> None:
    bits = {(ram(FINE), bit): bool(fine >> bit & 1) for bit in range(8)}
    assert cycles(rises()[0], {label("pl_loop1")}, bits)[0] == 11 + fine


def test_every_way_to_the_first_fall_takes_the_same_cycles() -> None:
    after_loop = label("pl_loop1") + 6
    falls = {label(f"pl_{number}") for number in range(8)}
    one = next(at for at in range(label("pl_one"), label("pl_7")) if at in rises())
    for value, bits in all_bits(APART, 3):
        assert cycles(after_loop, falls, bits) == (14, label(f"pl_{value}"))
    at_once = {(ram(APART), bit): bit == 3 for bit in range(8)}
    assert cycles(after_loop, {one}, at_once) == (14, one)


def test_the_other_fall_comes_as_many_cycles_later_as_the_case_says() -> None:
    for value in range(8):
        start = label(f"pl_{value}")
        first, second = (label("pl_0") + 2, label("pl_0") + 7)  # the two early CLRF INDF
        for flags, end, least in ((0x10, first, 2), (0x20, second, 10)):
            bits = {(ram(APART), bit): bool((value | flags) >> bit & 1) for bit in range(8)}
            assert cycles(start, {end}, bits) == (least + value, end)
        bits = {(ram(APART), bit): bool(value >> bit & 1) for bit in range(8)}
        # Two more cycles of the loop come before its first DECFSZ; one pass that ends takes 7 cycles.
        assert cycles(start, {label("pl_loop2")}, bits)[0] + 7 == 18 + value


DRIVER = """
#pragma CLOCK_FREQ 4000000
%s
unsigned char a_lo, a_hi, b_lo, b_hi, times;
void play(void) { asm {
%s
} }
void main(void)
{
    PORTB = 0; overrun = 0;
    set_bit(STATUS, RP0); TRISB = 0; OPTION_REG = %d; clear_bit(STATUS, RP0);
    mask_a = 0x10; mask_b = 0x02; both = 0x12; port = 6; ahead = %d;
    a_lo = %d; a_hi = %d; b_lo = %d; b_hi = %d; times = 0;
    target = TMR0;
    while (1) {
        pulse_a_lo = a_lo; pulse_a_hi = a_hi; pulse_b_lo = b_lo; pulse_b_hi = b_hi;
        target += %d;
        play();
        b_lo++; if (b_lo == 0) b_hi++;
        times++;
        if (times == %d) {
            times = 0;
            b_lo = %d; b_hi = %d;
            a_lo++; if (a_lo == 0) a_hi++;
        }
    }
}
"""


def sweep(
    first: int, other: int, count: int, rounds: int, ticks: int, tick: int = 32, stagger: int = 0
) -> tuple[np.ndarray, np.ndarray, int]:
    """Widths of RB4 and RB1 while RB4's grows once in `count` slots, RB1's in each; wrong rises."""
    text = DRIVER % (
        "\n".join(f"unsigned char {name};" for name in VARIABLES),
        kernel(Cycles(tick), Cycles(stagger)),
        PRESCALER + TICKS.index(Cycles(tick)),
        ticks,
        first & 255,
        first >> 8,
        other & 255,
        other >> 8,
        ticks,
        count,
        other & 255,
        other >> 8,
    )
    image = compile_sources([Source(text, "sweep.c")], Options(device=device("PIC16F84"))).image
    end = tick * ticks * (count * rounds + 3)
    chunk = join(Machine(image, Clock(4_000_000)).stream(end))
    widths, up_at = [], []
    for pin in (9, 6):
        up, down = (chunk.cycle[(chunk.pin == pin) & (chunk.level == level)] for level in (1, 0))
        down = down[down > up[0]]
        slots = count * rounds
        widths.append(down[:slots] - up[:slots])
        up_at.append(up[:slots])
    wrong = int((up_at[1] - up_at[0] != stagger).sum() + (np.diff(up_at[0]) != tick * ticks).sum())
    return widths[0], widths[1], wrong


@pytest.mark.parametrize(
    ("first", "other", "count", "rounds", "stagger"),
    [(600, 560, 80, 17, NONE), (256, 200, 120, 9, NONE), (300, 200, 120, 9, STAGGER)],
)
def test_every_pair_of_widths_that_cross_is_exact_to_the_cycle(
    first: int, other: int, count: int, rounds: int, stagger: int
) -> None:
    a, b, wrong = sweep(first, other, count, rounds, 48, stagger=stagger)
    assert wrong == 0
    assert (a == first + np.arange(count * rounds) // count).all()
    assert (b == other + np.arange(count * rounds) % count).all()


@pytest.mark.parametrize("tick", TICKS)
def test_the_longest_and_the_furthest_are_exact_too(tick: int) -> None:
    longest = 200 * tick - 1400 - 3 * tick
    a, b, wrong = sweep(200, longest, 16, 3, 200, tick)
    assert wrong == 0
    assert (a == 200 + np.arange(48) // 16).all()
    assert (b == longest + np.arange(48) % 16).all()
