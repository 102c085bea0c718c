"""Levels of optimisation: equal code is shared only for size, and only where nothing else is lost."""

from __future__ import annotations

from itertools import pairwise

import pytest

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.compiler.options import LEVELS
from servogen.edges import PINS
from servogen.errors import InputError
from servogen.simulator import Machine
from servogen.units import Clock

EQUAL = """
unsigned char a, b, c, d;
void one(void) { PORTB = a; a = b + c; b = c ^ 5; c = a + 3; d = 1; }
void two(void) { d = 7; PORTB = a; a = b + c; b = c ^ 5; c = a + 3; }
void three(void) { PORTA = 1; PORTB = a; a = b + c; b = c ^ 5; c = a + 3; PORTA = 2; }
"""
MAIN = "void main(void) { TRISB = 0; a = 3; one(); two(); three(); two(); PORTB = c; }"


def build(text: str, level: str, dialect: str = "xc8") -> Compilation:
    return compile_sources(
        [Source(text, "main.c")], Options(dialect=dialect, clock_hz=4_000_000, optimise=level)
    )


def shared(found: Compilation) -> list[str]:
    return [each.name for each in found.listing.functions if each.name.startswith("__shared")]


def port(found: Compilation) -> list[tuple[int, int]]:
    edges = Machine(found.image, Clock(4_000_000)).run(20_000)
    return [(int(pin), int(level)) for pin, level in zip(edges.pin, edges.level, strict=True)]


def test_equal_runs_become_a_subroutine_for_size_only() -> None:
    found = {level: build(EQUAL + MAIN, level) for level in LEVELS}
    assert not shared(found["none"]) and not shared(found["speed"])
    assert shared(found["size"])
    assert found["size"].words < found["speed"].words <= found["none"].words
    assert port(found["none"]) == port(found["speed"]) == port(found["size"])


def test_a_shared_run_that_ends_in_a_skipped_call_returns() -> None:
    """`if (bad) stop();` three times: where `bad` is 0, the subroutine goes back to its caller."""
    text = """
    volatile unsigned char bad, a;
    void stop(void) { while (1) NOP(); }
    void main(void) { TRISB = 0; PORTB = 0; if (bad) stop(); PORTB = 1; if (bad) stop(); PORTB = 3;
        if (bad) stop(); PORTB = 7; }
    """
    found = build(text, "size")
    assert shared(found)
    assert port(found)[-3:] == [(PINS.index(f"RB{bit}"), 1) for bit in range(3)]
    assert port(found) == port(build(text, "none"))


def test_the_words_saved_are_those_of_the_copies_less_calls_and_return() -> None:
    """Nine instructions three times: twice nine less saved, three calls and perhaps a RETURN more."""
    plain, small = build(EQUAL + MAIN, "speed"), build(EQUAL + MAIN, "size")
    (name,) = shared(small)
    routine = next(each for each in small.listing.functions if each.name == name)
    length = routine.end - routine.start
    has_return = small.listing.rows[routine.end - 1].assembly == "RETURN"
    assert plain.words - small.words == 3 * (length - has_return) - length - 3


def calls(levels: int, innermost: str) -> str:
    """A chain of functions, the last of which has what others have too."""
    chain = f"void f{levels}(void) {{ {innermost} }}\n"
    for number in range(levels - 1, 0, -1):
        chain += f"void f{number}(void) {{ f{number + 1}(); PORTA = {number}; }}\n"
    return chain


SAME = "PORTB = a; a = b + c; b = c ^ 5; c = a + 3; d = 9; PORTA = 0;"


def test_a_full_stack_leaves_no_level_for_sharing() -> None:
    top = f"void main(void) {{ TRISB = 0; TRISA = 0; {SAME} f1(); {SAME} f1(); }}"
    for levels, wanted in ((7, True), (8, False)):
        text = "unsigned char a, b, c, d;\n" + calls(levels, f"PORTA = 3; {SAME} PORTA = 4;") + top
        assert "f8" in text or levels == 7
        found = build(text, "size")
        deepest = max(each.deepest_calls for each in found.listing.functions)
        assert deepest <= 8
        inner = next(each for each in found.listing.functions if each.name == f"f{levels}")
        assert bool(inner.deepest_calls) == wanted


def test_a_level_too_many_is_still_an_error() -> None:
    text = "unsigned char a, b, c, d;\n" + calls(9, SAME) + "void main(void) { f1(); }"
    with pytest.raises(InputError, match="calls are nested 9 levels deep"):
        build(text, "size")


@pytest.mark.parametrize("level", LEVELS)
def test_a_pulse_keeps_its_width_at_every_level(level: str) -> None:
    pulse = "RB0 = 1; __delay_us(100); RB0 = 0; a = b + c; b = c ^ 5; c = a + 3;"
    text = f"unsigned char a, b, c;\nvoid main(void) {{ TRISB = 0; PORTB = 0; {pulse * 4} }}"
    edges = Machine(build(text, level).image, Clock(4_000_000)).run(3000)
    times = [int(t) for t, p in zip(edges.cycle, edges.pin, strict=True) if PINS[p] == "RB0"][-8:]
    assert [two - one for one, two in pairwise(times)][::2] == [101] * 4


def test_assembly_is_never_shared() -> None:
    block = "asm movlw 1\n asm addwf _a, f\n asm movlw 2\n asm addwf _b, f\n asm nop\n"
    text = f"char a, b;\nvoid main() {{\n {block * 4} }}"
    assert build(text, "size", "c2c").words == build(text, "speed", "c2c").words


def test_a_skip_and_what_it_skips_are_not_parted() -> None:
    """Equal but for what stands before them: a skip in one place must not jump over the call of another."""
    text = """
    unsigned char a, b, c, d, e;
    void one(void) { if (RB0) a = 1; b = a + c; c = b ^ d; d = c + 1; }
    void two(void) { if (RB1) a = 1; b = a + c; c = b ^ d; d = c + 1; }
    void three(void) { if (RB2) a++; b = a + c; c = b ^ d; d = c + 1; e = 1; }
    void main(void) { while (1) { one(); two(); three(); } }
    """
    found = build(text, "size")
    rows = found.listing.rows
    (first, *_) = [each for each in found.listing.functions if each.name.startswith("__shared")]
    entries = {f"CALL 0x{first.start:03X}", f"GOTO 0x{first.start:03X}"}
    for one, two in pairwise(rows):
        assert not (one.assembly.startswith(("BTFS", "DECFSZ", "INCFSZ")) and two.assembly in entries)


def test_an_unknown_level_is_refused() -> None:
    with pytest.raises(InputError, match="unknown level of optimisation 'most'"):
        build(MAIN, "most")


def test_a_program_that_cannot_fit_is_not_searched_for_equal_code() -> None:
    """It is refused with its size in words, without the hint of -Os and without minutes of search."""
    statements = "PORTB = x + 1; x = PORTA; " * 900
    text = f"unsigned char x;\nvoid f(void) {{ {statements} }}\nvoid main(void) {{ f(); }}"
    with pytest.raises(InputError, match="words of flash, the chip has 1024") as caught:
        compile_sources([Source(text, "main.c")], Options(dialect="xc8", optimise="size"))
    assert caught.value.code == "program-too-large"
