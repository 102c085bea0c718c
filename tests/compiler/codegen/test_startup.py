"""The code before main and around the interrupt function, in the order in which it is placed."""

from __future__ import annotations

import re

from servogen.compiler import Compilation, Options, Source, compile_sources
from tests.compiler.cases import every


def compiled(text: str) -> Compilation:
    return compile_sources([Source("#include <xc.h>\n" + text, "main.c")], Options(dialect="xc8"))


def listed(found: Compilation, function: str) -> list[str]:
    """The instructions of a function with the names of its variables."""
    names = {
        address + at: name.rpartition(".")[2].replace(" (temporary)", "") + (f"+{at}" if at else "")
        for address, name, size in found.listing.variables
        for at in range(size)
    }
    each = next(each for each in found.listing.functions if each.name == function)
    rows = [
        row.assembly
        for row in found.listing.rows[0 : len(found.listing.rows)]
        if each.start <= row.address < each.end
    ]
    return [re.sub(r"(?<=F )0x..", lambda match: names[int(match[0], 0)], row) for row in rows]


def started(text: str) -> list[str]:
    return listed(compiled(text), "__start")


@every("size", [1, 7, 8, 9, 20])
def test_zeros_are_cleared_in_a_loop_from_nine_bytes_on(size: int) -> None:
    """MOVLW, MOVWF FSR; CLRF INDF, INCF FSR, MOVLW, XORWF FSR, BTFSS, GOTO: eight words for any number."""
    found = started(f"unsigned char z[{size}], n; void main(void) {{ PORTB = z[n]; z[0] = n = 1; }}")
    if size <= 7:
        assert sorted(found) == sorted(["CLRF n", *(f"CLRF z{f'+{at}' if at else ''}" for at in range(size))])
    else:
        first, last = 0x0C, 0x0C + size + 1
        assert found == [
            *(f"MOVLW 0x{first:02X}", "MOVWF FSR", "CLRF INDF", "INCF FSR, F"),
            *(f"MOVLW 0x{last:02X}", "XORWF FSR, W", "BTFSS STATUS, 2", "GOTO 0x002"),
        ]


def test_a_fixed_variable_is_not_cleared_by_the_loop() -> None:
    text = "unsigned char z[9]; unsigned char x __at(0x20); void main(void) { z[1] = PORTB; PORTB = z[x]; }"
    assert started(text) == [f"CLRF z{f'+{at}' if at else ''}" for at in range(9)]


def test_equal_values_are_loaded_once() -> None:
    text = "unsigned char z[5] = {5, 7, 5, 0, 7}; void main(void) { z[1] = PORTB; PORTB = z[PORTA]; }"
    assert started(text) == [
        *("CLRF z+3", "MOVLW 0x05", "MOVWF z", "MOVWF z+2", "MOVLW 0x07", "MOVWF z+1", "MOVWF z+4"),
    ]


def test_variables_that_nobody_uses_are_not_initialised() -> None:
    text = "unsigned char a = 3, b = 4, c; void main(void) { PORTB = a; a = 9; }"
    assert started(text) == ["MOVLW 0x03", "MOVWF a"]


def test_a_variable_that_only_a_pointer_leads_to_is() -> None:
    text = "unsigned char a = 3, *p = &a; void main(void) { PORTB = *p; p = 0; }"
    assert started(text) == ["MOVLW 0x03", "MOVWF a", "MOVLW 0x0C", "MOVWF p"]


HEAD = """unsigned char n, list[3]; const unsigned char t[3] = {1, 2, 3};
unsigned char f(unsigned char x) { return t[x]; }
"""
MAIN = "void main(void) { list[n] = 2; PORTB = f(n); GIE = 1; T0IE = 1; while (1) n = list[n]; }"


@every(
    ("body", "extra"),
    [
        ("n++;", []), ("list[n] = 1;", ["fsr"]), ("n = t[n];", ["pclath"]),
        ("list[n] = t[n];", ["fsr", "pclath"]), ("n = f(n);", ["pclath"]),
        ('asm("call _f");', ["fsr", "pclath"]), ('asm("clrf _n");', []), ("PCLATH = 3;", ["pclath"]),
        ("FSR = 3;", ["fsr"]),
    ],
)  # fmt: skip
def test_the_interrupt_saves_what_it_uses(body: str, extra: list[str]) -> None:
    """DS35007 section 6.9: SWAPF moves STATUS and W back without changing the flags."""
    found = compiled(f"{HEAD}void __interrupt() isr(void) {{ {body} T0IF = 0; }}\n{MAIN}")
    handler = listed(found, "isr")
    before = ["MOVWF isr", "SWAPF STATUS, W", "MOVWF isr+1", "CLRF STATUS"]
    for at, name in enumerate(extra, 2):
        before += [f"MOVF {name.upper()}, W", f"MOVWF isr+{at}"]
    after = ["SWAPF isr+1, W", "MOVWF STATUS", "SWAPF isr, F", "SWAPF isr, W", "RETFIE"]
    for at, name in enumerate(extra, 2):
        after = [f"MOVF isr+{at}, W", f"MOVWF {name.upper()}", *after]
    renamed = [re.sub(r"saved_w|saved_status|saved_\w+", "isr", line) for line in handler]
    saved = [line.split(" ")[0] for line in before]
    assert [line.split(" ")[0] for line in renamed[: len(before)]] == saved
    assert [line.split(" ")[0] for line in renamed[-len(after) :]] == [line.split(" ")[0] for line in after]
    registers = [line for line in renamed if "FSR" in line or "PCLATH" in line]
    for name in ("fsr", "pclath"):
        uses = [line for line in registers if line in (f"MOVF {name.upper()}, W",)]
        assert len(uses) == (name in extra)
    # what is saved first is restored last, each from its own byte
    stores = [line.split(" ")[1] for line in renamed[: len(before)] if line.startswith("MOVWF")]
    loads = [
        line.split(" ")[1].rstrip(",")
        for line in renamed[-len(after) :]
        if line.startswith(("MOVF", "SWAPF isr"))
    ]
    assert list(dict.fromkeys(loads)) == [*stores[::-1][: len(extra)], stores[1], stores[0]]
    assert len(set(stores)) == 2 + len(extra)


def test_the_vectors() -> None:
    found = compiled(f"{HEAD}void __interrupt() isr(void) {{ T0IF = 0; }}\n{MAIN}")
    starts = {each.name: each.start for each in found.listing.functions}
    assert (starts["__reset"], starts["isr"]) == (0, 4)
    assert found.listing.rows[0].assembly == f"GOTO 0x{starts['__start']:03X}"
    # without an interrupt, the start-up code begins at 0 and main follows it
    plain = compiled(HEAD + "void main(void) { n = 1; while (1) PORTB = f(n); }")
    (start, main) = (
        next(each for each in plain.listing.functions if each.name == name) for name in ("__start", "main")
    )
    assert (start.start, main.start) == (0, start.end)


def test_persistent_variables_keep_their_values() -> None:
    """Beside 20 bytes that a loop clears and an initial value, the persistent byte is not written."""
    text = (
        "unsigned char z[20], n, i = 3; persistent unsigned char kept; static __persistent int also;"
        "void main(void) { PORTB = z[n] + kept + i + also; z[0] = n = i = kept = also = 1; }"
    )
    found = [row for row in started(text) if "F " in row]
    assert not any("kept" in row or "also" in row for row in found)
    assert any(row.endswith(" i") for row in found)
