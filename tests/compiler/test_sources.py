"""Several sources, includes, the clock, the configuration word, the serial port, limits of the chip."""

from __future__ import annotations

from fractions import Fraction

import pytest

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.edges import PINS
from servogen.errors import InputError
from servogen.pic.device import device
from servogen.simulator import Machine
from servogen.simulator.sources import Serial
from servogen.simulator.stimulus import Stimuli
from servogen.units import Clock
from tests.compiler.bus import Bus

EMPTY = "void main(void) { }"


def build(text: str, **options: object) -> Compilation:
    return compile_sources([Source(text, "main.c")], Options(**options))  # type: ignore[arg-type]


def errors(text: str, **options: object) -> list[str]:
    with pytest.raises(InputError) as caught:
        build(text, **options)
    return [each.message for each in caught.value.diagnostics if each.severity == "error"]


# DS35007 register 6-1: bits 0-1 oscillator (LP 0, XT 1, HS 2, RC 3), bit 2 watchdog, bit 3 power-up timer off
@pytest.mark.parametrize(
    ("text", "word"),
    [
        (EMPTY, 0x3FF1),
        ("#pragma CLOCK_FREQ 4000000\n" + EMPTY, 0x3FF1),
        ("#pragma CLOCK_FREQ 10000000\n" + EMPTY, 0x3FF2),
        ("#pragma CLOCK_FREQ 32768\n" + EMPTY, 0x3FF0),
        ("#pragma config WDTE = ON\n" + EMPTY, 0x3FF5),
        ("#pragma config FOSC = EXTRC, PWRTE = OFF\n" + EMPTY, 0x3FFB),
        ("#pragma config CP = ON\n" + EMPTY, 0x0001),
        ("__CONFIG(FOSC_HS & WDTE_OFF & PWRTE_ON & CP_OFF);\n" + EMPTY, 0x3FF2),
        ("__CONFIG(0x3FF9);\n" + EMPTY, 0x3FF9),
        ("asm __config 0x3FF9\n" + EMPTY, 0x3FF9),
        ("asm { __config 0x3FF9 }\n" + EMPTY, 0x3FF9),
        ("asm\n{\n  __CONFIG H'3FF9' ; crystal\n}\n" + EMPTY, 0x3FF9),
        ("asm __config 3FF9h;\n" + EMPTY, 0x3FF9),
        ("asm __config _HS_OSC & _WDT_OFF & _PWRTE_ON\n" + EMPTY, 0x3FF2),
        ("#pragma DATA 0x2007, 0x3FF9\n" + EMPTY, 0x3FF9),
        ("#pragma DATA _CONFIG, _HS_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF\n" + EMPTY, 0x3FF2),
        ("void main(void) { __CONFIG(FOSC_HS & WDTE_OFF & PWRTE_ON); }", 0x3FF2),
        (f"typedef unsigned int word;\nword __at 0x2007 CONFIG = 0x3FF9;\n{EMPTY}", 0x3FF9),
        (f"#include <pic16f84a.h>\n__code unsigned __at(_CONFIG) c = _HS_OSC & _WDT_OFF;\n{EMPTY}", 0x3FFA),
    ],
)
def test_the_configuration_word(text: str, word: int) -> None:
    dialect = "xc8" if "CONFIG(" in text else "sdcc" if "__at" in text else "c2c"
    assert build(text, dialect=dialect).image.config == word


@pytest.mark.parametrize("text", [f"__IDLOC(12AF);\n{EMPTY}", "void main(void) { __IDLOC(12AF); }"])
def test_each_digit_of_idloc_is_in_a_word_of_its_own(text: str) -> None:
    assert build(text, dialect="xc8").image.ids == {0: 0x1, 1: 0x2, 2: 0xA, 3: 0xF}
    assert not build(EMPTY, dialect="xc8").image.ids


@pytest.mark.parametrize(
    ("text", "option", "hz"),
    [
        (EMPTY, None, None),
        (EMPTY, 8_000_000, 8_000_000),
        ("# pragma CLOCK_FREQ 4000000 // comment\n" + EMPTY, None, 4_000_000),
        ("#define _XTAL_FREQ 20000000UL\n" + EMPTY, None, 20_000_000),
        ("#ifndef _CLOCK_FREQ\n#define _CLOCK_FREQ (4 * 1000000)\n#endif\n" + EMPTY, None, 4_000_000),
        ("#define F 3579545\n#pragma CLOCK_FREQ F\n" + EMPTY, 3_579_545, 3_579_545),
    ],
)
def test_the_clock(text: str, option: int | None, hz: int | None) -> None:
    found = build(text, clock_hz=option)
    assert (found.clock.hz if found.clock else None) == hz


def test_two_clocks_that_differ_are_an_error() -> None:
    assert errors("#pragma CLOCK_FREQ 4000000\n" + EMPTY, clock_hz=8_000_000) == [
        "--clock-hz says 8000000 Hz, #pragma CLOCK_FREQ says 4000000 Hz"
    ]


def test_a_clock_that_the_chip_cannot_follow_is_an_error() -> None:
    assert errors("#pragma CLOCK_FREQ 20000000\n" + EMPTY, device=device("PIC16F84")) == [
        "20000000 Hz is too fast: PIC16F84 runs at up to 10000000 Hz"
    ]


def test_several_sources_share_what_is_not_static() -> None:
    one = "int shared; static int own = 1; void more(void);\nvoid main(void) { more(); shared += own; }"
    two = "int other = 5; extern int shared; static int own = 2;\nvoid more(void) { shared = other + own; }"
    found = compile_sources([Source(one, "one.c"), Source(two, "two.c")], Options())
    machine = Machine(found.image, Clock(4_000_000))
    machine.run(1000)
    address = next(address for address, name, _ in found.listing.variables if name == "shared")
    assert machine.state().ram[address - 0x0C] == 8


def test_static_functions_of_one_name_are_as_many_as_their_files() -> None:
    text = "static int get(int n) {{ return n + {0}; }} void f{0}(void) {{ PORTB = get({0}); }}\n"
    main = "void f1(void); void f2(void); void f4(void);\nvoid main(void) { f1(); f2(); f4(); while (1) ; }"
    sources = [Source(text.format(number), f"part{number}.c") for number in (1, 2, 4)]
    found = compile_sources([*sources, Source(main, "main.c")])
    assert [each.value for each in Bus(found.image, [6], {}, 6).run() if each.kind == "store"] == [2, 4, 8]


def test_included_files_come_from_the_resolver_and_keep_their_places() -> None:
    files = {"pins.h": "#define LED RB3\nvoid on(void) { LED = 1 }\n"}
    with pytest.raises(InputError) as caught:
        build('#include "pins.h"\nvoid main(void) { on(); }', include=lambda name, _: (name, files[name]))
    assert (
        str(caught.value).splitlines()[0]
        == "pins.h:2:24: error: syntax error: ';' is missing after '1' [c-syntax]"
    )


def test_a_program_that_is_too_large_says_how_large() -> None:
    text = "void main(void) {" + "PORTB = 1; PORTB = 2;" * 300 + "}"
    assert errors(text) == ["the program needs 1201 words of flash, the chip has 1024"]
    unlike = "".join(f"PORTB = {n}; PORTA = {n * n};" for n in range(10))
    table = "const unsigned char t[980] = {1}; unsigned int i;\n"
    for level, hint in (("speed", "optimise for size (-Os): equal code is shared"), ("size", None)):
        with pytest.raises(InputError) as caught:
            build(f"{table}void main(void) {{ PORTB = t[i]; {unlike} }}", optimise=level)
        assert caught.value.diagnostics[0].message.startswith("the program needs 10")
        assert caught.value.diagnostics[0].hint == hint


def test_calls_that_go_too_deep_show_their_path() -> None:
    functions = "".join(f"void f{n}(void) {{ f{n + 1}(); PORTB = {n}; }}\n" for n in range(1, 9))
    text = "void f9(void) { PORTB = 9; }\n" + functions + "void main(void) { TRISB = 0; f1(); }"
    with pytest.raises(InputError) as caught:
        build(text)
    (found,) = caught.value.diagnostics
    assert str(found.location) == "main.c:10:6"
    assert found.message.startswith("calls are nested 9 levels deep, the chip's stack has 8: main → f1 → f2")


SERIAL = """
#pragma CLOCK_FREQ 4000000
#pragma RS232_TXPORT 0x06
#pragma RS232_TXPIN 2
#pragma RS232_BAUD 9600
void main(void) { PORTB = 4; TRISB = 0; delay_us(200); putchar('K'); putchar(0); delay_ms(1); PORTB = 0; }
"""


def test_putchar_sends_each_bit_for_the_cycles_of_the_baud_rate() -> None:
    found = build(SERIAL)
    assert found.clock is not None
    edges = Machine(found.image, found.clock).run(5000)
    times = [int(cycle) for cycle, pin in zip(edges.cycle, edges.pin, strict=True) if PINS[pin] == "RB2"]
    levels = [int(level) for level, pin in zip(edges.level, edges.pin, strict=True) if PINS[pin] == "RB2"]
    bit = 104  # 1 000 000 / 9600, rounded
    start = next(time for time, level in zip(times, levels, strict=True) if level == 0 and time > 150)

    def at(cycle: int) -> int:
        return next(level for time, level in reversed(list(zip(times, levels, strict=True))) if time <= cycle)

    sent = [at(start + bit // 2 + bit * number) for number in range(10)]
    assert sent == [0, *(ord("K") >> number & 1 for number in range(8)), 1]
    changes = [time - start for time in times if start < time <= start + 9 * bit]
    assert all(change % bit == 0 for change in changes)


def test_true_rs232_0_turns_every_level_over() -> None:
    """The same edges at the same times, the other way round."""
    plain = SERIAL.replace("PORTB = 4;", "PORTB = 0; PORTB = 4;")
    other = "#pragma TRUE_RS232 0" + SERIAL.replace("PORTB = 4;", "PORTB = 4; PORTB = 0;")
    sent = []
    for text in (plain, other):
        found = build(text)
        assert found.clock is not None
        edges = Machine(found.image, found.clock).run(2500)
        pins = zip(edges.cycle, edges.level, edges.pin, strict=True)
        sent.append(
            [(int(cycle), int(level)) for cycle, level, pin in pins if PINS[pin] == "RB2" and cycle > 100]
        )
    first = [part[0][0] for part in sent]
    times = [[cycle - start for cycle, _ in part] for part, start in zip(sent, first, strict=True)]
    assert times[0] == times[1]
    assert [level for _, level in sent[0]] == [1 - level for _, level in sent[1]]
    assert sent[0][0][1] == 0
    assert len(sent[0]) > 4


HEARD = """
#pragma CLOCK_FREQ 4000000
#pragma RS232_RXPORT PORTB
#pragma RS232_RXPIN 0
#pragma RS232_BAUD 9600
#pragma TRUE_RS232 {true}
char c[3];
void main(void) {{ char i; for (i = 0; i < 3; i++) c[i] = getchar(); }}
"""


@pytest.mark.parametrize("error", [Fraction(0), Fraction(2, 100), Fraction(-2, 100)])
@pytest.mark.parametrize("true", [0, 1])
def test_getchar_hears_a_line_of_either_level(true: int, error: Fraction) -> None:
    found = build(HEARD.format(true=true))
    assert found.clock is not None
    sent = b"\x55\x01\xe7"
    address = next(address for address, name, _ in found.listing.variables if name == "c")
    for inverted in (False, True):
        line = Serial(PINS.index("RB0"), sent, Fraction(9600), 500, error, inverted, gap=300)
        machine = Machine(found.image, found.clock, stimulus=Stimuli((line,)))
        machine.run(5000)
        heard = bytes(machine.state().ram[address - 0x0C :][:3])
        assert (heard == sent) is (inverted is (true == 0))


def test_extensions_in_the_functions_of_every_file_are_kept() -> None:
    one = "void set(void) { static char held @ 0x20; held = 7; }\n"
    two = "void set(void);\nchar x @ 0x30;\nvoid main(void) { x = 1; set(); while (1); }\n"
    found = compile_sources([Source(one, "one.c"), Source(two, "two.c")], Options(dialect="xc8"))
    where = {name: address for address, name, _ in found.listing.variables}
    assert (where["set.held"], where["x"]) == (0x20, 0x30)


def test_the_shortest_comment_is_a_comment() -> None:
    assert build(f"/**/{EMPTY}/**/").image == build(EMPTY).image
    assert errors(f"{EMPTY}\n/*/") == ["the comment is not closed"]
