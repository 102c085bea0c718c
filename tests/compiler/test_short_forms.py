"""What an expert in this chip's assembly would write: the compiler finds these forms too."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine, SimulatorOptions
from servogen.units import Clock
from tests.compiler.variables import value


def mnemonics(text: str, function: str = "main") -> list[str]:
    """The instructions of a function, without operands."""
    found = compile_sources([Source(text, "main.c")], Options(dialect="xc8", clock_hz=4_000_000))
    listed = next(each for each in found.listing.functions if each.name == function)
    return [row.assembly.split()[0] for row in found.listing.rows[listed.start : listed.end]]


@pytest.mark.parametrize(
    "loop",
    [
        "for (n = 8; n; n--) PORTB = n;",
        "for (n = 8; n != 0; --n) PORTB = n;",
        "n = 8; do PORTB = n; while (--n);",
        "n = 8; while (n) { PORTB = n; n--; }",
    ],
)
def test_a_loop_that_counts_down_ends_with_decfsz(loop: str) -> None:
    """MOVLW 8; MOVWF n; MOVF n,W; MOVWF PORTB; DECFSZ n,F; GOTO; RETURN."""
    text = f"void count(void) {{ unsigned char n; {loop} }}\nvoid main(void) {{ count(); }}"
    found = mnemonics(text, "count")
    assert found.count("DECFSZ") == 1
    assert found.count("GOTO") == 1
    assert len(found) == 7


def test_a_constant_result_is_a_retlw() -> None:
    text = "unsigned char f(void) { if (RB0) return 5; return 9; }\nvoid main(void) { PORTA = f(); }"
    assert mnemonics(text, "f") == ["BTFSC", "RETLW", "RETLW"]


def test_a_bit_is_copied_by_two_skips() -> None:
    text = "unsigned char x;\nvoid main(void) { x = PORTA; while (1) { RB3 = x & 1; x++; } }"
    found = mnemonics(text)
    copy = found.index("BTFSS")
    assert found[copy : copy + 4] == ["BTFSS", "BCF", "BTFSC", "BSF"]


def test_a_register_that_may_change_is_tested_once() -> None:
    """Two skips on a port could see two levels."""
    found = mnemonics("void main(void) { while (1) RB3 = RA0; }")
    assert len([each for each in found if each in ("BTFSS", "BTFSC")]) == 1


def test_one_of_two_constants_needs_no_jump() -> None:
    text = "unsigned char x, y;\nvoid main(void) { x = PORTA; y = x ? 7 : 3; PORTB = y; }"
    assert mnemonics(text).count("GOTO") == 1  # the end of main
    assert value(text, "y") == 3


def test_a_pointers_address_is_loaded_once() -> None:
    text = """
    struct pair { unsigned char a, b; } s = {1, 2};
    void next(struct pair *p) { p->b++; p->b ^= 5; }
    void main(void) { next(&s); }
    """
    assert value(text, "s") == 1
    found = compile_sources([Source(text, "main.c")], Options(dialect="xc8"))
    next_ = next(each for each in found.listing.functions if each.name == "next")
    loads = [row for row in found.listing.rows[next_.start : next_.end] if row.assembly == "MOVWF FSR"]
    assert len(loads) == 1


def test_two_values_are_compared_where_they_are() -> None:
    """CALL; XORWF x,W; BTFSC STATUS,Z: the result of a call needs no place of its own."""
    text = "unsigned char x;\nunsigned char f(void) { return PORTA; }\n"
    text += "void main(void) { if (f() == x) RB0 = 1; }"
    found = mnemonics(text)
    assert found[found.index("CALL") + 1] == "XORWF"


BYTES = (
    "unsigned char x = 237, n = 10, q, r, *p = &x; volatile unsigned char v = 237; "
    "void other(void) { x = 9; }"
)
WORDS = "unsigned int x = 54321, q, r;"


@pytest.mark.parametrize(
    ("head", "body", "calls", "quotient", "remainder"),
    [
        (BYTES, "q = x / 10; r = x % 10;", 1, 23, 7),
        (BYTES, "r = x % n; q = x / n;", 1, 23, 7),
        (WORDS, "q = x / 1000; r = x % 1000;", 1, 54, 321 & 0xFF),
        # What changes between the two is divided again.
        (BYTES, "q = x / 10; x = 9; r = x % 10;", 2, 23, 9),
        (BYTES, "x = x / 10; q = x; r = x % 10;", 2, 23, 3),
        (BYTES, "q = x / n; n = 4; r = x % n;", 2, 23, 1),
        (BYTES, "q = x / 10; *p = 9; r = x % 10;", 2, 23, 9),
        (BYTES, "q = x / 10; other(); r = x % 10;", 3, 23, 9),
        (BYTES, "q = x / 10; if (n) x = 9; r = x % 10;", 2, 23, 9),
        (BYTES, "q = x / 10; while (n) { n--; r = x % 10; }", 2, 23, 7),
        (BYTES, "q = x / 10; r = x % 11;", 2, 23, 6),
        (BYTES, "q = v / 10; r = v % 10;", 2, 23, 7),
    ],
)
def test_a_quotient_and_a_remainder_of_the_same_values_are_one_division(
    head: str, body: str, calls: int, quotient: int, remainder: int
) -> None:
    text = f"{head}\nvoid main(void) {{ {body} while (1); }}"
    assert mnemonics(text).count("CALL") == calls
    assert (value(text, "q"), value(text, "r")) == (quotient, remainder)


@pytest.mark.parametrize(
    ("choice", "expected"),
    [
        # MOVF n,W; SUBWF m,W; BTFSC/BTFSS C; BSF/BCF; BTFSS/BTFSC C; BCF/BSF; RETURN
        ("if (m < n) RB1 = 1; else RB1 = 0;", 7),
        # MOVF m,W; MOVLW 0; BTFSS Z; MOVLW 64; MOVWF n; RETURN
        ("n = m ? 64 : 0;", 6),
        # COMF PORTB,W; ANDLW 0xF0; BTFSC Z; INCF n,F; RETURN
        ("if ((PORTB & 0xF0) == 0xF0) n++;", 5),
        # INCF m,W; BTFSC Z; INCF n,F; RETURN
        ("if (m == 255) n++;", 4),
        ("if (m >= 255) n++;", 4),
        # MOVF wide,W; XORLW 7; IORWF wide+1,W; BTFSC Z; INCF n,F; RETURN
        ("if (wide == 7) n++;", 6),
        # MOVF m,W; SUBWF n,W; BTFSS C; CLRF n; CLRF m; RETURN
        ("if (n < m) n = 0; m = 0;", 6),
    ],
)
def test_a_choice_without_jumps(choice: str, expected: int) -> None:
    text = "#include <xc.h>\nunsigned char m, n; unsigned int wide;\n"
    found = mnemonics(f"{text}void f(void) {{ {choice} }}\nvoid main(void) {{ f(); }}", "f")
    assert "GOTO" not in found
    assert len(found) <= expected


@pytest.mark.parametrize(
    ("flag", "n"),
    [
        # on, ^5; on, ^3; off, ^5; off, ^3: 16, 21; 37, 38; 39, 34; 35, 32
        (0, 32),
        # off, ^5; on, ^3; off, ^5; off, ^3: 1, 4; 20, 23; 24, 29; 30, 29
        (1, 29),
    ],
)
def test_a_condition_that_a_called_function_may_change_is_tested_once(flag: int, n: int) -> None:
    text = f"""
    bit flag; unsigned char n;
    void on(void) {{ flag = 1; n += 16; }}
    void off(void) {{ flag = 0; n += 1; }}
    void either(void) {{ if (flag) off(); else on(); n ^= 5; }}
    void other(void) {{ if (!flag) on(); else off(); n ^= 3; }}
    void main(void) {{
        flag = {flag}; n = 0; either(); flag = 0; other(); either(); flag = 1; other();
        while (1);
    }}
    """
    assert value(text, "n") == n


def test_a_skip_does_not_lead_into_a_delay() -> None:
    """A delay is several words: a skip in front of it would lead to its second one."""
    text = """
    #include <xc.h>
    #define _XTAL_FREQ 4000000
    unsigned char flag, n;
    void wait(void) { if (flag & 1) __delay_ms(100); else n |= 4; n++; }
    void main(void) { n = 0; flag = 2; wait(); wait(); while (1); }
    """
    assert value(text, "n") == 6, "4 and 1, with 4 still set, and 1"


CONDITIONS: dict[str, Callable[[int, int], bool]] = {
    "m < n": lambda m, n: m < n, "m >= 255": lambda m, n: m >= 255, "m < 255": lambda m, n: m < 255,
    "m == 255": lambda m, n: m == 255, "(m & 0x81) == 0x81": lambda m, n: m & 0x81 == 0x81,
    "(m & 0x81) != 0x81": lambda m, n: m & 0x81 != 0x81, "wide == 0x8000u": lambda m, n: m == 128 and n == 0,
    "wide != 0x00FFu": lambda m, n: (m, n) != (0, 255),
}  # fmt: skip


def test_choices_without_jumps_are_right() -> None:
    """The program does not clear what lies at a fixed address: m and n begin with the bytes of the test."""
    tests = "".join(
        f"if ({test}) seen |= {1 << at}; else other |= {1 << at};\n" for at, test in enumerate(CONDITIONS)
    )
    text = (
        "#include <xc.h>\nunsigned char seen, other, chosen; volatile unsigned char m @ 0x40, n @ 0x41;\n"
        f"void main(void) {{ unsigned int wide; wide = m << 8 | n;\n{tests}chosen = m ? 64 : 0; while (1); }}"
    )
    made = compile_sources([Source(text, "main.c")], Options(dialect="xc8"))
    where = {name: address - RAM_FIRST for address, name, _ in made.listing.variables}
    for m, n in product((0, 1, 127, 128, 254, 255), (0, 127, 128, 255)):
        options = SimulatorOptions(start=(("0x40", m), ("0x41", n)))
        machine = Machine(made.image, Clock(4_000_000), options=options)
        machine.run(1_000)
        ram = machine.state().ram
        expected = sum(1 << at for at, test in enumerate(CONDITIONS.values()) if test(m, n))
        assert (ram[where["seen"]], ram[where["other"]]) == (expected, expected ^ 0xFF), (m, n)
        assert ram[where["chosen"]] == (64 if m else 0)


def test_a_skip_over_one_instruction_stays_in_front_of_it() -> None:
    """`BTFSS Z; GOTO a; INCF n,F; GOTO a` first loses the GOTO behind the skip, then the one at its end."""
    text = (
        "#include <xc.h>\nunsigned char b = 210, c, n, m;\n"
        "unsigned char f(void) { switch (0) { default: n = !b; break; } return 0; }\n"
        "unsigned char g(void) { switch (0) { default: m = !c; break; } return 0; }\n"
        "void main(void) { f(); g(); while (1); }\n"
    )
    assert (value(text, "n"), value(text, "m")) == (0, 1)
