"""The words at which loops are taken in one step: their periods, bytes and limits, and what they clear."""

from __future__ import annotations

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.pic.image import Image
from servogen.pic.isa import decode, encode
from servogen.simulator import Machine, SimulatorOptions
from servogen.simulator.regions import LONGEST_WAIT, fast_code, is_wait, marked_code, program_code
from servogen.simulator.words import BREAK, ERASED, EXIT, LOOP, SPIN, UNDEFINED, UNTIL, pack
from tests.simulator.helpers import CLOCK, image

WORDS = 1024


def fast(source: str) -> tuple[np.ndarray, np.ndarray, list[list[int]]]:
    """Return the plain program, its rows, and the bytes of RAM of each region."""
    plain = program_code(image(source))
    found = fast_code(plain)
    regions = [row[1 : 1 + row[0]].tolist() for row in found.regions.reshape(-1, 8)]
    return plain, found.code.reshape(-1, WORDS), regions


@pytest.mark.parametrize(
    ("source", "at", "op", "period", "clears"),
    [
        (" goto $\n", 0, SPIN, 2, 0),
        (" nop\nl nop\n nop\n goto l\n", 3, SPIN, 4, 0),
        ("l clrwdt\n nop\n goto l\n", 2, SPIN, 4, 1),
        ("l nop\n clrwdt\n nop\n goto l\n", 3, SPIN, 5, 2),
        ("l clrwdt\n nop\n clrwdt\n goto l\n", 3, SPIN, 5, 3),  # the last one counts
        ("l" + " nop\n" * 63 + " goto l\n", 63, SPIN, 65, 0),
    ],
)
def test_a_wait_without_a_test_turns_at_its_goto(
    source: str, at: int, op: int, period: int, clears: int
) -> None:
    """A word of it takes one cycle, GOTO two; a CLRWDT is counted from 1."""
    plain, rows, _ = fast(source)
    assert rows[0, at] == op | period << 8 | clears << 16
    others = np.arange(WORDS) != at
    assert np.array_equal(rows[0, others], plain[others])
    assert np.flatnonzero(is_wait(rows[0])).tolist() == [at]


@pytest.mark.parametrize(
    ("source", "at", "period", "clears"),
    [
        ("l btfss INTCON, 2\n goto l\n", 0, 3, 0),
        ("l nop\n nop\n btfsc PORTB, 7\n goto l\n", 2, 5, 0),
        ("l clrwdt\n nop\n btfss 0x20, 0\n goto l\n", 2, 5, 1),
        ("l nop\n clrwdt\n btfsc PORTA, 0\n goto l\n", 2, 5, 2),
        ("l btfss EEDATA, 1\n goto l\n", 0, 3, 0),  # EECON1 in bank 1
        ("l" + " nop\n" * 62 + " btfsc PORTA, 0\n goto l\n", 62, 65, 0),
    ],
)
def test_a_wait_with_a_test_turns_there(source: str, at: int, period: int, clears: int) -> None:
    plain, rows, _ = fast(source)
    assert rows[0, at] == int(plain[at]) | 1 << 24 | period << 25 | clears << 33
    assert np.flatnonzero(is_wait(rows[0])).tolist() == [at]


@pytest.mark.parametrize(
    "source",
    [
        "l" + " nop\n" * 64 + " goto l\n",  # too long
        "l nop\n goto m\nm goto m+1\n",  # forward
        "l movlw 1\n clrwdt\n goto l\n",
        "l movlw 1\n btfss PORTA, 0\n goto l\n",
        "l nop\n btfss STATUS, 0\n goto l\n",
        "l btfss PORTA, 0\n nop\n goto l\n",  # the test is not before the GOTO
        "l movf TMR0, w\n xorwf 0x20, w\n btfsc STATUS, Z\n goto l\n",
        "l nop\n movf TMR0, w\n xorwf 0x20, w\n btfss STATUS, Z\n goto l\n",
        "l movf TMR0, w\n subwf 0x20, w\n btfss STATUS, Z\n goto l\n",
        "l movf PORTB, w\n xorwf 0x20, w\n btfss STATUS, Z\n goto l\n",
        "l movf TMR0, w\n xorwf 0x20, w\n btfss INTCON, 2\n goto l\n",
    ],
)
def test_other_loops_are_no_waits(source: str) -> None:
    assert LONGEST_WAIT == 64
    assert not is_wait(fast(source)[1][0]).any()


@pytest.mark.parametrize("byte", [0x0C, 0x20, 0x4F])
def test_a_wait_for_tmr0_turns_at_its_goto_with_the_address_of_the_byte(byte: int) -> None:
    _, rows, _ = fast(f" nop\nl movf TMR0, w\n xorwf {byte}, w\n btfss STATUS, Z\n goto l\n")
    assert rows[0, 4] == UNTIL | byte << 8


def test_a_region_has_a_row_of_its_own_with_its_heads_plain() -> None:
    source = "o movlw 9\n movwf 0x21\ni decfsz 0x21, f\n goto i\n decfsz 0x20, f\n goto o\n sleep\n"
    plain, rows, regions = fast(source)
    assert rows.shape == (3, WORDS)
    assert regions == [[0x20, 0x21], [0x21]]
    assert rows[0, [0, 2]].tolist() == [LOOP | 0 << 8, LOOP | 1 << 8]
    assert rows[1, :6].tolist() == [*plain[:2].tolist(), LOOP | 1 << 8, *plain[3:6].tolist()]
    assert rows[2, 2:4].tolist() == plain[2:4].tolist()
    assert set(rows[1, 6:].tolist()) == set(rows[2, 4:].tolist()) == set(rows[2, :2].tolist()) == {EXIT}


@pytest.mark.parametrize(("count", "found"), [(7, True), (8, False)])
def test_a_region_has_at_most_seven_bytes(count: int, found: bool) -> None:
    source = "l" + "".join(f" incf {0x20 + n}, f\n" for n in range(count)) + " decfsz 0x20, f\n goto l\n"
    _, rows, regions = fast(source)
    assert bool(rows[0, 0] & 63 == LOOP) is found
    assert regions == ([[0x20 + n for n in range(7)]] if found else [[]])


@pytest.mark.parametrize(
    ("body", "pure"),
    [
        ("bcf STATUS, C", True), ("bsf STATUS, DC", True), ("bsf STATUS, Z", True), ("bcf STATUS, 3", False),
        ("bsf STATUS, RP0", False), ("btfss STATUS, 7", True), ("movf STATUS, w", True),
        ("movf STATUS, f", False), ("swapf STATUS, w", False), ("movwf STATUS", False),
        ("incf FSR, f", False), ("movf 0x50, w", False), ("movf 0x0B, w", False), ("movf 0x0C, w", True),
        ("movf 0x4F, w", True), ("xorlw 3", True), ("clrw", True), ("nop", True), ("clrwdt", False),
        ("option", False), ("tris PORTB", False),
    ],
)  # fmt: skip
def test_a_region_has_instructions_on_w_flags_and_ram_only(body: str, pure: bool) -> None:
    _, rows, _ = fast(f"l {body}\n nop\n decfsz 0x20, f\n goto l\n sleep\n")
    assert bool((rows[0] & 63 == LOOP).any()) is pure


@pytest.mark.parametrize(
    ("source", "wait", "first", "last"),
    [
        (" nop\nl nop\n nop\n goto l\n nop\n", 3, 1, 3),
        (" nop\nl nop\n btfsc PORTA, 0\n goto l\n nop\n", 2, 1, 3),
        (" nop\nl movf TMR0, w\n xorwf 0x20, w\n btfss STATUS, Z\n goto l\n nop\n", 4, 1, 4),
    ],
)
def test_a_breakpoint_in_a_wait_makes_it_turn_word_by_word(
    source: str, wait: int, first: int, last: int
) -> None:
    plain, rows, _ = fast(source)
    code = rows.reshape(-1)
    for address in range(6):
        marked = marked_code(code, plain, frozenset([address])).reshape(-1, WORDS)[0]
        assert marked[address] == BREAK
        inside = first <= address <= last
        if address != wait:
            assert marked[wait] == (plain[wait] if inside else rows[0, wait]), address
    assert marked_code(code, plain, frozenset()) is code
    assert np.array_equal(code.reshape(-1, WORDS), rows)  # it is not changed


def test_a_breakpoint_in_a_region_takes_away_all_of_its_heads() -> None:
    source = " movlw 9\no movwf 0x21\ni decfsz 0x21, f\n goto i\n decfsz 0x20, f\n goto o\n sleep\n"
    plain, rows, _ = fast(source)
    heads = {address: sorted(np.flatnonzero(row & 63 == LOOP).tolist() for row in
             marked_code(rows.reshape(-1), plain, frozenset([address])).reshape(-1, WORDS))
             for address in range(8)}  # fmt: skip
    assert heads[0] == heads[6] == heads[7] == [[], [1, 2], [2]]
    assert heads[1] == heads[4] == heads[5] == [[], [2], [2]]  # the inner one is left
    assert heads[2] == heads[3] == [[], [], []]


@pytest.mark.parametrize("address", [-1, 1024])
def test_a_breakpoint_is_in_the_program_memory(address: int) -> None:
    plain, rows, _ = fast(" nop\n")
    for good in (0, 1023):
        assert marked_code(rows.reshape(-1), plain, {good})[good] == BREAK
    with pytest.raises(InputError, match="the program has 1024 words"):
        marked_code(rows.reshape(-1), plain, {address})


# Fields of a word -----------------------------------------------------------------------------------------


def packed(word: int) -> int:
    decoded = decode(word)
    assert decoded is not None
    return pack(decoded)


@pytest.mark.parametrize("f", [0, 0x0B, 0x0C, 0x4F, 0x50, 0x7F])
def test_the_fields_of_a_word(f: int) -> None:
    """Bit 6: the result goes to the register; 7: it changes flags; 8 to 14: f; 15: RAM; 16 to 23: the bit."""
    ram = 0x0C <= f <= 0x4F
    for d in (0, 1):
        assert packed(encode("ADDWF", f=f, d=d)) >> 6 == d | 2 | f << 2 | ram << 9
        assert packed(encode("SWAPF", f=f, d=d)) >> 6 == d | f << 2 | ram << 9
    for bit in range(8):
        assert packed(encode("BSF", f=f, b=bit)) >> 6 == 1 | f << 2 | ram << 9 | 1 << 10 + bit
        assert packed(encode("BTFSC", f=f, b=bit)) >> 6 == f << 2 | ram << 9 | 1 << 10 + bit
    assert packed(encode("GOTO", k=0x7FF)) >> 8 == 0x7FF
    assert packed(encode("SUBLW", k=0xA5)) >> 7 == 1 | 0xA5 << 1


def test_places_without_an_instruction() -> None:
    code = program_code(Image({0: 0x0001, 1: encode("NOP"), 1023: encode("NOP")}, 0x3FF1))
    assert len(code) == WORDS
    assert code[[0, 2, 1022]].tolist() == [UNDEFINED, ERASED, ERASED]
    assert code[1] == code[1023] == packed(encode("NOP"))


# Waits and regions in a run -------------------------------------------------------------------------------


@pytest.mark.parametrize("nops", [0, 1, 5])
@pytest.mark.parametrize("place", ["first", "last"])
@pytest.mark.parametrize("test", ["", " btfss 0x20, 0\n"])
def test_a_wait_that_clears_the_watchdog_clears_it_in_its_cycle(nops: int, place: str, test: str) -> None:
    """The watchdog times out one period after the latest CLRWDT, which a later program would see."""
    body = " clrwdt\n" + " nop\n" * nops if place == "first" else " nop\n" * nops + " clrwdt\n"
    program = image(f" clrf 0x20\nl{body}{test} goto l\n", " __config _XT_OSC & _WDT_ON & _PWRTE_OFF\n")
    for cycles in range(40, 60):
        one, other = (Machine(program, CLOCK, SimulatorOptions(watchdog_us=300)) for _ in range(2))
        one.run(cycles)
        while other.cycles < cycles:
            other.step()
        assert one.state() == other.state()
        assert one.state().status & 0x18 == 0x18


def test_a_region_is_taken_in_one_step_when_it_comes_again() -> None:
    """It takes the same cycles, and leaves W, flags and bytes alike; another start is another region."""
    source = (
        "l movlw 3\n movwf 0x20\ni addlw 7\n rlf 0x21, f\n decfsz 0x20, f\n goto i\n movwf PORTB\n goto l\n"
    )
    chip, slow = (Machine(image(" clrf 0x21\n" + source), CLOCK) for _ in range(2))
    for turn in range(1, 12):
        for each in (chip, slow):
            if each is chip:
                each.run_until(pc=7)
            else:
                while True:
                    each.step()
                    if each.pc == 7:
                        break
        assert chip.cycles == slow.cycles == 1 + 2 + 3 * 5 - 1 + (turn - 1) * (2 + 3 * 5 - 1 + 3)
        assert chip.fingerprint() == slow.fingerprint()
    assert (chip.memo != -1).any()
