"""Counting loops: fewer instructions for the counter, and the same results."""

from __future__ import annotations

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine
from servogen.units import Clock

HEAD = "#include <xc.h>\nunsigned char seen, last; unsigned int sum;\n"


class Program:
    """A compiled program: what a function's instructions are, what main leaves, how long a function takes."""

    def __init__(self, text: str, level: str = "speed") -> None:
        options = Options(dialect="xc8", clock_hz=4_000_000, optimise=level, verify_ir=True)
        self.made = compile_sources([Source(HEAD + text, "main.c")], options)

    def mnemonics(self, function: str = "f") -> list[str]:
        listed = next(each for each in self.made.listing.functions if each.name == function)
        return [row.assembly.split()[0] for row in self.made.listing.rows[listed.start : listed.end]]

    def maximum_cycles(self, function: str = "f") -> int | None:
        return next(each for each in self.made.listing.functions if each.name == function).maximum_cycles

    def values(self, *names: str) -> tuple[int, ...]:
        """What variables hold at the end, as unsigned numbers."""
        machine = Machine(self.made.image, Clock(4_000_000))
        machine.run(300_000)
        ram = machine.state().ram
        found = {}
        for address, name, size in self.made.listing.variables:
            found[name] = int.from_bytes(ram[address - RAM_FIRST : address - RAM_FIRST + size], "little")
        return tuple(found[name] for name in names)


def loops(body: str, variable: str = "unsigned char i;") -> Program:
    return Program(f"void f(void) {{ {variable} {body} }}\nvoid main(void) {{ f(); while (1); }}\n")


@pytest.mark.parametrize(
    ("loop", "trips"),
    [
        ("for (i = 0; i < 8; i++) seen++;", 8),
        ("for (i = 3; i <= 9; i++) seen++;", 7),
        ("for (i = 5; i != 10; ++i) seen++;", 5),
        ("for (i = 0; i < 255; i++) seen++;", 255),
        ("for (i = 0; i < 4; i++) { if (seen == 2) continue; seen++; }", 2),
        ("for (i = 0; i < 9; i++) { if (seen == 3) break; seen++; }", 3),
        ("for (i = 0; i < 3; i++) seen++; for (i = 0; i < 5; i++) seen++;", 8),
    ],
)
def test_a_loop_whose_index_is_unused_counts_down(loop: str, trips: int) -> None:
    made = loops(loop)
    assert made.values("seen") == (trips,)
    assert made.mnemonics().count("DECFSZ") == loop.count("for")
    assert "SUBWF" not in made.mnemonics()


@pytest.mark.parametrize(
    ("first", "end"), [(0, 256), (0, 257), (0, 300), (-100, 200), (1, 30000), (7, 0x300 + 7)]
)
def test_a_counter_of_two_bytes_counts_down_both(first: int, end: int) -> None:
    made = loops(f"for (i = {first}; i < {end}; i++) sum++;", "int i;")
    trips = end - first
    assert made.mnemonics().count("DECFSZ") == (1 if trips <= 256 else 2)
    if trips < 20_000:
        assert made.values("sum") == (trips,)
    if trips <= 300:  # per round INCF, BTFSC, (INCF), DECFSZ, GOTO: 6 or 7 cycles
        assert made.maximum_cycles() is not None
        assert made.maximum_cycles() < 7.1 * trips + 20  # type: ignore[operator]


@pytest.mark.parametrize(
    "body",
    [
        "for (i = 0; i < 20; i++) seen++; last = i;",  # needed afterwards
        "for (i = 0; i < 20; i++) { seen++; last = i + 1; }",
        "for (i = 0; i < 20; i++) { seen++; last = 20; if (seen == 40) i = 5; }",
        "unsigned char *p = &i; for (i = 0; i < 20; i++) { seen++; last = 20; if (seen == 40) *p = 0; }",
        "for (i = 0; i < 20; i++) { seen++; again: last = 20; } if (seen == 40) { i = 3; goto again; }",
        "while (seen < 20) { last = i; for (i = 0; i < 20; i++) seen++; } last = i;",
    ],
)
def test_an_index_that_is_used_counts_up(body: str) -> None:
    made = loops(body, "unsigned char i = 0;")
    assert "DECFSZ" not in made.mnemonics()
    assert made.values("seen", "last") == (20, 20)


def test_an_inner_loop_with_the_same_variable_is_left_alone() -> None:
    made = loops("for (i = 0; i < 20; i++) { for (i = 5; i < 17; i++) seen++; }")
    # 12 inner rounds, then i is 17, 18: three outer rounds would be (17 + 1 < 20 …), each with 12 inner ones
    i, seen = 0, 0
    while i < 20 and seen < 256:
        i = 5
        while i < 17:
            seen, i = seen + 1, i + 1
        i += 1
    assert seen >= 256  # the outer loop never ends
    assert "DECFSZ" not in made.mnemonics()


def test_a_case_in_a_loop_leaves_it_alone() -> None:
    text = "switch (seen) { case 0: for (i = 0; i < 6; i++) { sum++; case 1: seen = 9; } }"
    made = loops(text)
    assert "DECFSZ" not in made.mnemonics()
    assert made.values("sum") == (6,)


@pytest.mark.parametrize("declared", ["volatile unsigned char i;", "static unsigned char i;"])
def test_a_variable_that_others_may_see_is_left_alone(declared: str) -> None:
    made = loops("for (i = 0; i < 6; i++) seen++;", declared)
    assert "DECFSZ" not in made.mnemonics()
    assert made.values("seen") == (6,)


def test_without_optimisation_the_loop_is_as_written() -> None:
    text = "void f(void) { unsigned char i; for (i = 0; i < 6; i++) seen++; }\n"
    made = Program(text + "void main(void) { f(); while (1); }\n", "none")
    assert "DECFSZ" not in made.mnemonics()
    assert made.values("seen") == (6,)


def test_a_bound_that_is_a_power_of_two_is_one_bit() -> None:
    made = loops("for (i = 2; i < 16; i++) sum += i;")
    assert made.values("sum") == (sum(range(2, 16)),)
    assert made.mnemonics()[-4:] == ["INCF", "BTFSS", "GOTO", "RETURN"]


def test_a_wide_index_that_stays_below_256_is_compared_by_its_low_byte() -> None:
    made = loops("for (i = 0; i < 20; i++) { if (i > 4) sum += i; } sum += 3 * i;", "int i;")
    assert made.values("sum") == (sum(range(5, 20)) + 60,)
    narrow = loops("for (i = 0; i < 20; i++) { if (i > 4) sum += i; } sum += 3 * i;")
    assert len(made.mnemonics()) <= len(narrow.mnemonics()) + 8  # of `3 * i` in two bytes


def test_crc8_of_eight_bytes_takes_less_than_640_cycles() -> None:
    """By hand about 575: per bit BCF, RLF, BTFSC, XORLW, MOVWF, DECFSZ, GOTO are 8 cycles."""
    text = """unsigned char data[8] = {0x31, 0x32, 0x33, 0x34, 0x35, 0x36, 0x37, 0x38};
    unsigned char f(void) {
        unsigned char crc = 0, i, j;
        for (i = 0; i < 8; i++) {
            crc ^= data[i];
            for (j = 0; j < 8; j++)
                if (crc & 0x80) crc = (crc << 1) ^ 0x07;
                else crc <<= 1;
        }
        return crc;
    }
    void main(void) { seen = f(); while (1); }
    """
    crc = 0
    for byte in b"12345678":
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07 if crc & 0x80 else crc << 1) & 0xFF
    made = Program(text)
    assert made.values("seen") == (crc,)
    assert made.maximum_cycles() is not None
    assert made.maximum_cycles() <= 640  # type: ignore[operator]


@pytest.mark.parametrize("divisor", [2, 4, 8, 16, 128, 256, 1024])
def test_a_signed_division_by_a_power_of_two_shifts_and_rounds_towards_zero(divisor: int) -> None:
    dividends = [
        -32768, -32767, -1025, -1024, -257, -256, -129, -17, -16, -15, -2, -1, 0, 1, 15, 16, 255, 32767,
    ]  # fmt: skip
    lines = "".join(f"x = {each}; y[{at}] = x / {divisor};\n" for at, each in enumerate(dividends))
    text = f"int y[{len(dividends)}]; volatile int x;\nvoid main(void) {{ {lines} while (1); }}\n"
    made = Program(text, "size")
    assert not any(each.name.startswith("__sdivide") for each in made.made.listing.functions)
    (found,) = made.values("y")
    results = [
        int.from_bytes(found.to_bytes(36, "little")[at : at + 2], "little", signed=True)
        for at in range(0, 36, 2)
    ]
    assert results == [int(each / divisor) for each in dividends]


def test_other_signed_divisions_call_the_library() -> None:
    made = Program("volatile int x = -7, y;\nvoid main(void) { y = x / 6; while (1); }\n")
    assert any(each.name.startswith("__sdivide") for each in made.made.listing.functions)
    assert made.values("y") == (0xFFFF,)


def test_what_was_just_loaded_is_not_tested_again() -> None:
    """MOVF sets Z by what it loads, and neither MOVWF nor MOVLW changes Z."""
    text = (
        "unsigned char a, b;\nvoid f(void) { b = a; if (b) seen = 1; }\nvoid main(void) { f(); while (1); }\n"
    )
    assert Program(text).mnemonics().count("MOVF") == 1
    text = text.replace("b = a;", "b = a; last++;")  # INCF changes Z
    assert Program(text).mnemonics().count("MOVF") == 2


def test_what_both_arms_begin_with_stands_in_front() -> None:
    text = """unsigned char a, b;
    void f(void) { if (seen & 4) { a <<= 1; b = 3; last = 8; } else { a <<= 1; b = 9; sum = 4; } }
    void main(void) { a = 5; f(); while (1); }
    """
    made = Program(text)
    assert made.mnemonics().count("RLF") == 1
    assert made.values("a", "b", "sum") == (10, 9, 4)
    text = text.replace("seen & 4", "a & 4")  # the shift changes what is tested
    assert Program(text).values("a", "b") == (10, 3)
