"""The chip's registers in a whole program, and the functions built into the dialects, at their limits."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import servogen.compiler.library
from servogen.compiler import Options, Source, compile_sources
from servogen.compiler.sema.builtins import BUILTINS as BUILT_IN
from servogen.pic.device import device
from servogen.pic.isa import encode
from servogen.simulator import Machine
from servogen.units import Clock
from tests.compiler.marked import CARET, diagnostics, found_in, stated

GLOBALS = "unsigned char a, b; int n; unsigned char *q;\n"


def program(text: str, said: list[str], *, before: str = "", dialect: str = "xc8") -> None:
    marked = f"{GLOBALS}{before}void main(void) {{ {text} }}"
    assert found_in(marked, dialect) == stated(marked, said)


def is_input(*pins: str) -> list[str]:
    return [f"c-input-pin: {pin} is an input: TRIS{pin[1]} never makes it an output" for pin in pins]


DIRECTION = (
    "c-port-direction: all pins of PORT{0} are inputs: TRIS{0} is never written // TRIS{0} = 0 "
    "makes all of them outputs"
)
DRAIN = "c-open-drain: RA4 is an open-drain output: it is high only with a pull-up resistor"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("‸RB0 = 1;", is_input("RB0")), ("‸RB7 = 0;", is_input("RB7")), ("‸RA0 = 1;", is_input("RA0")),
        ("‸‸PORTB |= 5;", is_input("RB0", "RB2")), ("‸PORTB ^= 0x80;", is_input("RB7")), ("PORTB |= 0;", []),
        ("PORTB |= a;", []), ("‸RB3 ^= 1;", is_input("RB3")),
        ("TRISB0 = 0; RB0 = 1; ‸RB1 = 1;", is_input("RB1")),
        ("TRISB0 = 1; ‸RB0 = 1;", is_input("RB0")), ("TRISB0 = a; RB0 = 1;", []),
        ("TRISB = 0xFE; RB0 = 1; ‸RB1 = 1;", is_input("RB1")),
        ("TRISB = 0x7F; RB7 = 1; ‸RB6 = 1;", is_input("RB6")),
        ("TRISB = a; RB7 = 1;", []), ("TRISB &= 0xFE; RB7 = 1;", []),
        ("TRISA = 0; ‸RB0 = 1;", is_input("RB0")), ("TRISB = 0; ‸RA0 = 1;", is_input("RA0")),
        ("q = &a; *q = 1; RB0 = 1;", []), ("q = &a; RB0 = 1;", []), ('RB0 = 1; asm("nop");', []),
        ("a = RB0;", []), ("‸PORTB = 5;", [DIRECTION.format("B")]),
        ("‸PORTA = 5; PORTA = 6;", [DIRECTION.format("A")]),
        ("PORTB = 5; TRISB = 0;", []), ("PORTB = 5; TRISB1 = 0;", []),
        ("‸PORTB = a;", [DIRECTION.format("B")]),
        ("TRISA = 0; ‸PORTB = 5;", [DIRECTION.format("B")]),
        ("PORTB += 5;", []), ("PORTB &= 5;", []), ("q = &a; PORTB = 5;", []), ('PORTB = 5; asm("nop");', []),
        ("TRISA4 = 0; ‸RA4 = 1;", [DRAIN]), ("TRISA = 0xEF; ‸RA4 = 1;", [DRAIN]),
        ("TRISA = 0; ‸PORTA = 0x10;", [DRAIN]), ("TRISA = 0; ‸PORTA = 0x1F;", [DRAIN]),
        ("TRISA = 0; PORTA = 0x20;", []), ("TRISA = 0; PORTA = 0x3F;", []), ("TRISA = 0; PORTA = 0x0F;", []),
        ("TRISA = 0; ‸PORTA |= 0x30;", [DRAIN]), ("TRISA = 0; PORTA |= 0x0F;", []),
        ("TRISA = 0; PORTA &= 0x1F;", []), ("TRISA = 0; PORTA = a;", []),
        ("TRISA &= 0xEF; ‸RA4 = 1;", [DRAIN]), ("TRISA &= 0x10; RA4 = 1;", []),
        ("TRISA = a; ‸RA4 = 1; RA4 = 1;", [DRAIN]), ("TRISA = 0; RA4 = 0;", []), ("TRISA = 0; RA3 = 1;", []),
    ],
)  # fmt: skip
def test_the_directions_of_the_pins(text: str, said: list[str]) -> None:
    program(text, said)


NO_HANDLER = "c-interrupt-enable: GIE is set, but there is no interrupt function"
NEVER = "c-interrupt-enable: this interrupt function is never called: GIE is never set"


def uncleared(flag: str) -> str:
    return (
        f"c-interrupt-flag: this interrupt function never clears {flag}: it is called again as soon "
        "as it returns"
    )


@pytest.mark.parametrize(
    ("handler", "text", "said"),
    [
        ("", "‸GIE = 1;", [NO_HANDLER]),
        ("", "‸INTCON = 0x80; GIE = 1;", [NO_HANDLER]),
        ("", "‸INTCON |= 0xC0;", [NO_HANDLER]), ("", "INTCON = 0x7F; GIE = 0;", []), ("", "INTCON |= a;", []),
        ("", "INTCON = a;", []), ("", "‸ei();", [NO_HANDLER]), ("", 'GIE = 1; asm("nop");', []),
        ("T0IF = 0;", "", [NEVER]), ("T0IF = 0;", "GIE = 0;", [NEVER]), ("T0IF = 0;", "INTCON = a;", []),
        ("T0IF = 0;", "INTCON |= 0x80;", []), ("T0IF = 0;", "INTCON &= 0x80;", [NEVER]),
        ("T0IF = 0; GIE = 1;", "", []), ("T0IF = 0;", "GIE = a;", []),
        ("T0IF = 0;", "T0IE = 1; GIE = 1;", []),
        ("b = 1;", "T0IE = 1; GIE = 1;", [uncleared("T0IF")]),
        ("b = 1;", "INTE = 1; GIE = 1;", [uncleared("INTF")]),
        ("b = 1;", "RBIE = 1; GIE = 1;", [uncleared("RBIF")]),
        ("b = 1;", "EEIE = 1; GIE = 1;", [uncleared("EEIF")]),
        ("b = 1;", "INTCON = 0xF8; ", [uncleared("T0IF"), uncleared("INTF"), uncleared("RBIF"), uncleared(
            "EEIF")]),
        ("T0IF = 0; INTF = 0; RBIF = 0; EEIF = 0;", "INTCON = 0xF8;", []),
        ("INTF = 0;", "T0IE = 1; GIE = 1;", [uncleared("T0IF")]),
        ("T0IF = 1;", "T0IE = 1; GIE = 1;", [uncleared("T0IF")]),
        ("T0IF = a;", "T0IE = 1; GIE = 1;", []),
        ("INTCON &= 0xFB;", "T0IE = 1; GIE = 1;", []),
        ("INTCON &= 0xFD;", "T0IE = 1; GIE = 1;", [uncleared("T0IF")]),
        ("INTCON = 0x20;", "T0IE = 1; GIE = 1;", []),
        ("INTCON |= 4;", "T0IE = 1; GIE = 1;", [uncleared("T0IF")]),
        ("b = 1;", "T0IE = a; GIE = 1;", []),
        ("b = 1;", "T0IF = 0; T0IE = 1; GIE = 1;", [uncleared("T0IF")]),
        ("q = &b; *q = 1;", "T0IE = 1;", []),
    ],
)  # fmt: skip
def test_interrupts_are_enabled_and_their_flags_cleared(handler: str, text: str, said: list[str]) -> None:
    """DS35007 section 6.8: GIE is bit 7 of INTCON, EEIE 6, T0IE 5, INTE 4, RBIE 3, T0IF 2, INTF 1, RBIF 0."""
    before = f"void __interrupt() {CARET * len(said)}isr(void) {{ {handler} }}\n" if handler else ""
    program(text, said, before=before)


DOG = (
    "c-watchdog: the watchdog is on and never cleared: it resets the chip again and again // switch "
    "it off in the configuration word, or clear it in the main loop"
)


@pytest.mark.parametrize(
    ("text", "dialect", "said"),
    [
        ("while (1) ;", "xc8", 1), ("while (1) CLRWDT();", "xc8", 0), ("SLEEP();", "xc8", 0),
        ("NOP();", "xc8", 1), ("__delaywdt_us(8);", "xc8", 0), ("__delay_us(8);", "xc8", 1),
        ("clear_wdt();", "c2c", 0), ("sleep();", "c2c", 0), ("nop();", "c2c", 1), ('asm("nop");', "xc8", 0),
    ],
)  # fmt: skip
def test_a_watchdog_that_nothing_clears(text: str, dialect: str, said: int) -> None:
    marked = (
        f"#pragma config WDTE = ON\n#pragma CLOCK_FREQ 4000000\nvoid {CARET * said}main(void) {{ {text} }}"
    )
    assert found_in(marked, dialect) == stated(marked, [DOG] * said)
    off = marked.replace("= ON", "= OFF").replace(CARET, "")
    assert found_in(off, dialect) == []


SHARED = (
    "c-shared-variable: '{}' has {} bytes and is shared with the interrupt, which can occur between "
    "two of them // disable interrupts around its uses in the main program"
)


@pytest.mark.parametrize(
    ("kind", "in_isr", "in_main", "said"),
    [
        ("int", "x++;", "a = x;", 2), ("int", "x = 1;", "x = 2;", 2), ("int", "b = x;", "x = 2;", 2),
        ("int", "b = x;", "a = x;", 0), ("int", "x++;", "a = 1;", 0), ("int", "b = 1;", "x = 1;", 0),
        ("long", "x++;", "a = x;", 4), ("unsigned char", "x++;", "a = x;", 0),
        ("int", "x++;", "GIE = 0; a = x; GIE = 1;", 0),
        ("int", "x++;", "GIE = 0; a = x; GIE = 1; a = x;", 2),
        ("int", "x++;", "di(); a = x; ei();", 0),
        ("int", "x++;", "if (a) { GIE = 0; b = x; GIE = 1; }", 0),
        ("int", "x++;", "GIE = 0; if (a) b = x; GIE = 1;", 0),
        ("int", "x++;", "if (x) b = 1;", 2), ("int", "x++;", "if (a) b = x;", 2),
        ("int", "x++;", "if (a) b = 1; else b = x;", 2),
        ("int", "x++;", "while (x) b = 1;", 2),
        ("int", "x++;", "for (a = 0; a < 3; x++) b = 1;", 2),
        ("int", "x++;", "for (a = 0; a < 3; a++) b = x;", 2),
        ("int", "x++;", "switch (x) { case 1: b = 1; }", 2),
        ("int", "x++;", "switch (a) { case 1: b = x; }", 2),
        ("int", "x++;", "switch (a) { case 1: GIE = 0; b = x; GIE = 1; }", 0),
        ("int", "x++;", "GIE = 0; GIE = 1; a = x;", 2),
        ("int", "x++;", "RBIE = 0; a = x;", 2), ("int", "x++;", "GIE = b; a = x;", 2),
        ("static const int", "b = x;", "a = x;", 0),
    ],
)  # fmt: skip
def test_variables_of_several_bytes_that_an_interrupt_shares(
    kind: str, in_isr: str, in_main: str, said: int
) -> None:
    value = " = 5" if "const" in kind else ""
    marked = (
        f"unsigned char a, b; {kind} {CARET * bool(said)}x{value};\n"
        f"void __interrupt() isr(void) {{ RBIF = 0; {in_isr} }}\n"
        f"void main(void) {{ {in_main} INTCON |= 0x80; }}"
    )
    assert found_in(marked) == stated(marked, [SHARED.format("x", said)] if said else [])


def test_functions_that_the_interrupt_calls_share_too() -> None:
    marked = (
        "int ‸x; void set(void) { x = 3; }\nvoid __interrupt() isr(void) { RBIF = 0; set(); }\n"
        "int get(void) { return x; }\nvoid main(void) { int y = get(); PORTB = y; TRISB = 0; GIE = 1; }"
    )
    assert found_in(marked) == stated(marked, [SHARED.format("x", 2)])


UNUSED = "c-unused-result: the result of '{}' is not used, and the call has no other effect"


@pytest.mark.parametrize(
    ("function", "acts"),
    [
        ("{ return n; }", False), ("{ int t = n; t += 2; return t; }", False), ("{ a = 1; return n; }", True),
        ("{ a += 1; return n; }", True), ("{ n = 2; return n; }", False), ("{ return v + n; }", True),
        ("{ *q = 1; return n; }", True),
        ("{ static char s; s = n; return s; }", True),
        ("{ NOP(); return n; }", True), ('{ asm("nop"); return n; }', True), ("{ act(); return n; }", True),
        ("{ return quiet(n); }", False), ("{ return later(n); }", True),
    ],
)  # fmt: skip
def test_a_call_whose_only_effect_is_its_result(function: str, acts: bool) -> None:
    marked = (
        "unsigned char a; volatile char v; unsigned char *q; void act(void) { a = 3; }\n"
        "int quiet(int m) { return m + 1; } int later(int m);\n"
        f"int f(int n) {function}\nint later(int m) {{ act(); return m; }}\n"
        f"void main(void) {{ q = &a; a = f(1); {'' if acts else CARET}f(2); act(); "
        "a = quiet(1) + later(1); }"
    )
    assert found_in(marked) == stated(marked, [] if acts else [UNUSED.format("f")])


def test_errors_in_the_calls_of_a_program() -> None:
    hint = "the variables of a function have fixed addresses; use a loop"
    for marked, texts in (
        (
            "void f(void);\nvoid main(void) { ‸f(); }",
            ["error c-undefined: the function 'f' is declared but not defined"],
        ),
        ("void f(void);\nvoid main(void) { }", []),
        (
            "void f(void) { ‸f(); }\nvoid main(void) { f(); }",
            [f"error c-call-depth: recursion is not possible on this chip: f → f // {hint}"],
        ),
        (
            "void g(void); void f(void) { ‸g(); } void g(void) { f(); }\nvoid main(void) { g(); f(); }",
            [f"error c-call-depth: recursion is not possible on this chip: g → f → g // {hint}"],
        ),
        (
            (
                "void h(void) { } void g(void) { h(); } void f(void) { g(); h(); }\nvoid main(void) "
                "{ f(); g(); h(); }"
            ),
            [],
        ),
        (
            (
                "void f(void) { ‸f(); }\nvoid __interrupt() i(void) { RBIF = 0; f(); }\nvoid "
                "main(void) { GIE = 1; }"
            ),
            [f"error c-call-depth: recursion is not possible on this chip: f → f // {hint}"],
        ),
        ("void f(void) { f(); }\nvoid main(void) { }", []),
        (
            "void f(void) { } void g(void) { ‸g(); }\nvoid main(void) { f(); g(); }",
            [f"error c-call-depth: recursion is not possible on this chip: g → g // {hint}"],
        ),
        (
            (
                "void __interrupt() i(void) { RBIF = 0; }\nvoid __interrupt() ‸j(void) { }\nvoid "
                "main(void) { GIE = 1; }"
            ),
            ["error c-interrupt: there is a second interrupt function // the first is 'i' at main.c:1:20"],
        ),
        (
            "void __interrupt() ‸i(char x) { RBIF = x; }\nvoid main(void) { GIE = 1; }",
            ["error c-interrupt: an interrupt function has no parameters and returns void"],
        ),
    ):
        assert found_in(marked) == stated(marked, texts)
    for text in ("", "void f(void) { }", "void main(void);"):
        assert found_in(text) == [("error c-undefined: there is no function 'main'", 0, 0)]


# built-in functions

CLOCK = "#pragma CLOCK_FREQ 4000000\n"
CYCLES = "error c-argument: '{}' takes 0 to 50463240 cycles, not {}"


@pytest.mark.parametrize(
    ("marked", "dialect", "said"),
    [
        ("_delay(0);", "xc8", ""), ("_delay(50463240);", "xc8", ""),
        ("_delay(‸50463241);", "xc8", CYCLES.format("_delay", 50463241)),
        ("_delay(-‸1);", "xc8", CYCLES.format("_delay", -1)),
        ("_delaywdt(-‸1);", "xc8", CYCLES.format("_delaywdt", -1)),
        ("_delay(‸2.5);", "xc8", "error c-argument: the time must be a whole number"),
        ("_delay(‸a);", "xc8", "error c-argument: '_delay' needs a constant argument // call it in a "
            "loop that counts the variable"),
        ("__delay_us(50463240);", "xc8", ""),
        ("__delay_us(‸50463241);", "xc8", "error c-argument: '__delay_us' takes at most 50463240 "
            "cycles, not 50463241 // call it several times, or in a loop"),
        ("__delay_ms(50463.24);", "xc8", ""),
        ("__delay_ms(‸50464);", "xc8", "error c-argument: '__delay_ms' takes at most 50463240 cycles, "
            "not 50464000 // call it several times, or in a loop"),
        ("__delay_us(0);", "xc8", ""),
        ("__delay_us(-‸1);", "xc8", "error c-argument: '__delay_us' cannot take a negative time"),
        ("__delay_us(-‸0.5);", "xc8", "error c-argument: '__delay_us' cannot take a negative time"),
        ("‸__delay_us(2.5);", "xc8",
            "delay-rounded: 2.5 µs is not a whole number of cycles at 4000000 Hz: 2 cycles are 2 µs"),
        ("‸__delay_us(2.9);", "xc8",
            "delay-rounded: 2.9 µs is not a whole number of cycles at 4000000 Hz: 2 cycles are 2 µs"),
        ("__delay_ms(2.5);", "xc8", ""), ("__delay_us(2.5 * 2);", "xc8", ""),
        ("__delay_us(5 / 2);", "xc8", ""),
        ("‸__delay_us(5 / 2.0);", "xc8",
            "delay-rounded: 2.5 µs is not a whole number of cycles at 4000000 Hz: 2 cycles are 2 µs"),
        ("__delay_us(1.5 + 0.5);", "xc8", ""), ("__delay_us(4.5 - 0.5);", "xc8", ""),
        ("__delay_us(-2.5 + 4.5);", "xc8", ""), ("__delay_us(+2.0);", "xc8", ""),
        ("__delay_us(2e0f);", "xc8", ""), ("delay_us(0);", "c2c", ""), ("delay_us(255);", "c2c", ""),
        ("delay_us(‸256);", "c2c", "error c-argument: 'delay_us' takes 0 to 255, not 256"),
        ("delay_10us(-‸1);", "c2c", "error c-argument: 'delay_10us' takes 0 to 255, not -1"),
        ("delay_us(‸1.5);", "c2c", "error c-argument: the time must be a whole number"),
        ("delay_100us(a);", "c2c", ""),
        ("delay_s(‸n);", "c2c", "c-conversion: 'delay_s' takes 0 to 255: only the low 8 bits of this "
            "'int' are used // call it in a loop"),
        ("set_bit(a, 7);", "c2c", ""),
        ("‸set_bit(a, 8);", "c2c", "error c-bit: 'unsigned char' has no bit 8"),
        ("set_bit(n, 15);", "c2c", ""),
        ("‸toggle_bit(n, 16);", "c2c", "error c-bit: 'int' has no bit 16"),
        ("‸clear_bit(5, 1);", "c2c", "error c-argument: the first argument must be a variable or a register"),
        ("‸set_bit(a);", "c2c", "error c-argument: 'set_bit' takes 2 arguments, 1 is given"),
        ("‸set_bit();", "c2c", "error c-argument: 'set_bit' takes 2 arguments, 0 are given"),
        ("‸set_bit(a, 1, 2);", "c2c", "error c-argument: 'set_bit' takes 2 arguments, 3 are given"),
        ("‸delay_us();", "c2c", "error c-argument: 'delay_us' takes 1 argument, 0 are given"),
        ("‸nop(1);", "c2c", "error c-argument: 'nop' takes 0 arguments, 1 is given"),
        ("set_tris_b(‸256);", "c2c", "c-conversion: 256 does not fit 'unsigned char' and becomes 0"),
        ("eeprom_write(‸256, 1);", "xc8", "c-conversion: 256 does not fit 'unsigned char' and becomes 0"),
        ("eeprom_write(1, ‸300);", "xc8", "c-conversion: 300 does not fit 'unsigned char' and becomes 44"),
        ("‸eeprom_read(1);", "xc8", "c-unused-result: the result of this expression is not used"),
        ("‸delay_ms(1);", "xc8", "error c-unsupported: 'delay_ms' belongs to the C2C dialect // the "
            "option --dialect c2c selects it"),
        ("‸__delay_ms(1);", "c2c", "error c-unsupported: '__delay_ms' belongs to the XC8 dialect // the "
            "option --dialect xc8 selects it"),
        ("‸getchar();", "c2c", "error c-argument: 'getchar' needs '#pragma RS232_RXPORT …'"),
        ("‸putchar(1);", "c2c", "error c-argument: 'putchar' needs '#pragma RS232_TXPORT …'"),
    ],
)  # fmt: skip
def test_the_arguments_of_a_built_in_function(marked: str, dialect: str, said: str) -> None:
    program_ = f"{CLOCK}{GLOBALS}void main(void) {{ {marked} }}"
    found = [each for each in found_in(program_, dialect) if not each[0].startswith("c-interrupt")]
    assert found == stated(program_, [said] if said else [])


def documented(dialect: str) -> dict[str, list[str]]:
    """Return function -> parameters, as docs/compiler.md has them; a name alone has those before it."""
    page = (Path(__file__).parents[2] / "docs" / "compiler.md").read_text()
    table = page.split(f"| {dialect.upper()} | |\n|---|---|\n")[1].split("\n\n")[0]
    functions: dict[str, list[str]] = {}
    parameters = ""
    for row in table.splitlines():
        for name, own, given in re.findall(r"`(\w+)(\((.*?)\))?`", row.split("|")[1]):
            parameters = given if own else parameters
            functions[name] = re.findall(r"\w+", parameters)
    return {name: given for name, given in functions.items() if name in BUILT_IN}


ARGUMENTS = {dialect: documented(dialect) for dialect in ("c2c", "xc8")}


def test_the_page_of_the_compiler_lists_every_built_in_function() -> None:
    """Those with which the library's own headers are written, such as `__sqrt`, are not for programs;
    `printf`, which takes any number of arguments, is in the table of the library.
    """
    library = " ".join(
        each.read_text() for each in Path(servogen.compiler.library.__file__).parent.glob("*.h")
    )
    own = [
        (name, row[0]) for name, row in BUILT_IN.items() if row[1] is not None and f"{name}(" not in library
    ]
    missing = [(each, name) for name, dialects in own for each in dialects if name not in ARGUMENTS[each]]
    assert missing == []


@pytest.mark.parametrize("dialect", ARGUMENTS)
def test_each_built_in_function_takes_its_number_of_arguments(dialect: str) -> None:
    for more in (1, -1):
        rows = []
        for name, parameters in ARGUMENTS[dialect].items():
            count, given = len(parameters), len(parameters) + more
            plural, verb = "" if count == 1 else "s", "is" if given == 1 else "are"
            if given >= 0:
                said = f"error c-argument: '{name}' takes {count} argument{plural}, {given} {verb} given"
                rows.append((f"‸{name}({', '.join('a' * given)});\n", said))
        program("".join(call for call, _ in rows), [said for _, said in rows], dialect=dialect)


RUN = """#pragma CLOCK_FREQ 4000000
#pragma config WDTE = {}
#pragma RS232_TXPORT PORTB
#pragma RS232_TXPIN 7
#pragma RS232_RXPORT PORTB
#pragma RS232_RXPIN 6
#pragma RS232_BAUD 9600
unsigned char a;
void __interrupt() handler(void) {{ INTF = 0; }}
char f(char n) {{ if (n) return 1; {}; }}
void main(void) {{ TRISB = 0x7F; INTCON = 0x12; f(0); EEADR = 77; while (1) ; }}
"""
"""INTF and INTE are set: SLEEP ends at once (DS35007 section 6.11.2)."""


@pytest.mark.parametrize(
    ("dialect", "name"), [(each, name) for each in ARGUMENTS for name in ARGUMENTS[each]]
)
def test_what_the_warnings_assume_of_a_built_in_function_is_what_it_does(dialect: str, name: str) -> None:
    """One that clears the watchdog has CLRWDT or SLEEP; one that returns comes to the next statement."""
    arguments = ["a" if each == "v" else "1" for each in ARGUMENTS[dialect][name]]
    call = f"{name}({', '.join(arguments)})"
    codes = {each.code for each in diagnostics(RUN.format("ON", call), dialect)}
    image = compile_sources([Source(RUN.format("OFF", call), "main.c")], Options(dialect)).image
    feeding = {encode("CLRWDT"), encode("SLEEP")} & set(image.program.values())
    assert bool(feeding) == ("c-watchdog" not in codes)
    chip = Machine(image, Clock(4_000_000))
    chip.run(1_100_000)
    assert (chip.state().registers["EEADR"] == 77) == ("c-missing-return" in codes)


@pytest.mark.parametrize(("dialect", "other"), [("c2c", "xc8"), ("xc8", "c2c"), ("sdcc", "c2c")])
def test_a_built_in_function_of_another_dialect_is_named_as_that(dialect: str, other: str) -> None:
    names = [name for name in ARGUMENTS[other] if name not in ARGUMENTS.get(dialect, ())]
    said = "error c-unsupported: '{}' belongs to the {} dialect // the option --dialect {} selects it"
    program(
        "".join(f"‸{name}();\n" for name in names),
        [said.format(name, other.upper(), other) for name in names],
        dialect=dialect,
    )


def test_a_delay_needs_a_clock() -> None:
    hint = "write '#pragma CLOCK_FREQ 4000000' or '#define _XTAL_FREQ 4000000', or give --clock-hz"
    for text, dialect in (("‸delay_us(1);", "c2c"), ("‸__delay_us(1);", "xc8"), ("‸delay_us(a);", "c2c")):
        program(text, [f"error c-clock: the clock frequency is not known // {hint}"], dialect=dialect)
    program("_delay(5);", [])


LINE = CLOCK + "#pragma RS232_TXPORT {port}\n#pragma RS232_TXPIN {pin}\n#pragma RS232_BAUD {baud}\n"


@pytest.mark.parametrize(
    ("port", "pin", "baud", "said"),
    [
        ("PORTB", "7", "9600", ""), ("portb", "0", "9600", ""), ("0x06", "0x7", "9600", ""),
        ("0X4F", "0", "9600", ""), ("79", "0", "9600", ""),
        ("80", "0", "9600", "error c-argument: the serial pin 80.0 does not exist"),
        ("PORTB", "8", "9600", "error c-argument: the serial pin 6.8 does not exist"),
        ("PORTB", "-1", "9600", "error c-argument: '#pragma RS232_TXPIN -1': a number is needed"),
        ("PORTX", "1", "9600", "error c-argument: '#pragma RS232_TXPORT PORTX': a number is needed"),
        ("PORTB", "1", "0", "error c-argument: the baud rate must be positive, not 0"),
        ("PORTB", "1", "1", ""), ("PORTB", "1", "62500", ""), ("PORTB", "1", "64516", ""),
        ("PORTB", "1", "64517",
            "error c-argument: 64517 baud is too fast: a bit has only 15 cycles, 16 are needed"),
    ],
)  # fmt: skip
def test_the_serial_line(port: str, pin: str, baud: str, said: str) -> None:
    """At 4 MHz a cycle is 1 µs: 1 000 000 / 15.5 = 64516.1 baud is the last rate that rounds to 16 cycles."""
    head = LINE.format(port=port, pin=pin, baud=baud)
    marked = f"{head}void main(void) {{ TRISB = 0; {CARET * bool(said)}putchar('a'); }}"
    assert found_in(marked, "c2c") == stated(marked, [said] if said else [])


def test_the_clock_limits_what_a_delay_can_be() -> None:
    marked = "void main(void) { ‸delay_us(100); }"
    said = "delay-rounded: 100 µs is not a whole number of cycles at 32768 Hz: 1 cycle is 122.0703125 µs"
    assert found_in(marked, "c2c", clock_hz=32_768) == stated(marked, [said])
    variable = "char a; void main(void) { ‸‸delay_10us(a); }"
    said_too = [
        "delay-rounded: 10 µs is not a whole number of cycles at 32768 Hz: 0 cycles are 0 µs",
        "error c-clock: 'delay_10us' with a variable argument needs a clock whose cycle is at most 10 µs",
    ]
    assert found_in(variable, "c2c", clock_hz=32_768) == stated(variable, said_too)
    fast = "void main(void) { _delay(1); }"
    assert found_in(fast, device=device("PIC16F84"), clock_hz=10_000_000) == []


PRINT = "#include <stdio.h>\nchar t[9]; int n; long w; unsigned char c; float f; const char *s;\n"


@pytest.mark.parametrize(
    ("marked", "said"),
    [
        ('sprintf(t, "%d%u%x", n, n, n);', ""),
        ('sprintf(t, "%ld", w);', ""),
        ('sprintf(t, "%ld", n);', ""),
        ('sprintf(t, "%c", c);', ""),
        ('sprintf(t, "%s", s);', ""),
        ('sprintf(t, "%d", ‸w);', "c-conversion: 'sprintf': %d prints only the low 16 bits of 'long' // "
            "%ld prints 32 bits"),
        ('sprintf(t, "%5x", ‸w);', "c-conversion: 'sprintf': %5x prints only the low 16 bits of 'long' "
            "// %lx prints 32 bits"),
        ('sprintf(t, "%c", ‸w);', "c-conversion: 'sprintf': %c prints only the low 16 bits of 'long' // "
            "%lc prints 32 bits"),
        ('sprintf(t, "%d", ‸f);', "error c-argument: 'sprintf': %d cannot print 'float' // convert it "
            "to an integer with a cast"),
        ('‸sprintf(t, "%d%d", n);', "error c-argument: 'sprintf': there is no argument for %d"),
        ('sprintf(t, "%d", n, ‸c, w);', "error c-argument: 'sprintf': the format has no conversion for "
            "this argument"),
        ('sprintf(t, ‸"%f", f);', "error c-unsupported: the format of 'sprintf': '%f' is not supported; "
            "there are %d %i %u %x %X %o %c %s, flags - 0 + and space, a width up to 255, hh h l"),
        ("sprintf(t, ‸s);", "error c-unsupported: the format of 'sprintf' must be a string constant"),
        ("‸sprintf(t);", "error c-argument: 'sprintf' needs a format string"),
        ("‸printf();", "error c-argument: 'printf' needs a format string"),
        ('sprintf(t, "%s", ‸n);', "c-conversion: the argument of 'sprintf' makes a pointer from 'int' "
            "without a cast"),
    ],
)  # fmt: skip
def test_the_arguments_of_a_format(marked: str, said: str) -> None:
    text = f"{PRINT}void main(void) {{ {marked} }}"
    assert found_in(text) == stated(text, [said] if said else [])
