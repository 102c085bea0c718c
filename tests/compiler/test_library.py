"""The library in C against Python: formats against `%`, strings and conversions against bytes and int.

Python's `%` has C's conversions; numbers are reduced to 16 or 32 bits first, as C does.
"""

from __future__ import annotations

import random
import re
import string

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine
from servogen.units import Clock
from tests.campaigns import sampled

HEADS = {
    "xc8": "#include <xc.h>\n",
    "c2c": "",
    "sdcc": "#include <pic14/pic16f84a.h>\n",
}


def memory(text: str, dialect: str = "xc8", cycles: int = 400_000) -> dict[str, bytes]:
    """Return the bytes of each variable when main has ended."""
    found = compile_sources([Source(HEADS[dialect] + text, "main.c")], Options(dialect=dialect))
    machine = Machine(found.image, Clock(4_000_000))
    machine.run(cycles)
    ram = machine.state().ram
    return {
        name: bytes(ram[address - RAM_FIRST : address - RAM_FIRST + size])
        for address, name, size in found.listing.variables
    }


def shown(conversion: str, value: int) -> bytes:
    """Return what C shows of a number: Python's `%`, of the number reduced to the bits of its type."""
    bits = 32 if "l" in conversion else 16
    value &= (1 << bits) - 1
    if conversion[-1] in "di" and value >> bits - 1:
        value -= 1 << bits
    return (conversion.replace("l", "") % value).encode()


def formats(seed: int) -> list[tuple[str, int]]:
    chance = random.Random(seed)
    found = []
    for _ in range(3):
        flags = "".join(sorted(set(chance.choices("-0+ ", k=chance.randrange(3)))))
        kind = chance.choice("diuxXo")
        flags = flags if kind in "di" else flags.replace("+", "").replace(" ", "")
        width = chance.choice(["", "", "3", "7"])
        size = chance.choice(["", "", "l"])
        value = chance.choice([0, 1, 9, 10, -1, 12345, 32767, -32768, 65535, chance.getrandbits(32)])
        found.append((f"%{flags}{width}{size}{kind}", value))
    return found


@pytest.mark.parametrize("seed", sampled(range(6), 2))
def test_formats_are_written_as_python_writes_them(seed: int) -> None:
    for conversion, value in formats(seed):
        expected = b"<" + shown(conversion, value) + b">"
        number = f"(uint32_t){value & 0xFFFFFFFF}UL" if "l" in conversion else f"(uint16_t){value & 0xFFFF}U"
        text = (
            "#include <stdint.h>\n#include <stdio.h>\nchar b[20]; char n;\n"
            f'void main(void) {{ n = sprintf(b, "<{conversion}>", {number}); while (1); }}'
        )
        found = memory(text, dialect=("xc8", "c2c", "sdcc")[seed % 3])
        assert found["b"][: len(expected) + 1] == expected + b"\0", (conversion, value)
        assert found["n"][0] == len(expected)


def test_text_is_written_with_characters_strings_and_percent_signs() -> None:
    text = (
        '#include <stdio.h>\nchar b[24]; char name[4] = "Bob";\n'
        'void main(void) { sprintf(b, "%s:%5s|%-4s|%c%% %d", name, "ab", "c", 33, -7); while (1); }'
    )
    assert memory(text)["b"].split(b"\0")[0] == b"%s:%5s|%-4s|%c%% %d" % (b"Bob", b"ab", b"c", 33, -7)


@pytest.mark.parametrize(("dialect", "function"), [("xc8", "putch"), ("c2c", "putchar")])
def test_printf_sends_each_character_to_the_programs_function(dialect: str, function: str) -> None:
    text = (
        f"#include <stdio.h>\nchar b[12]; char at, n;\nvoid {function}(char c) {{ b[at++] = c; }}\n"
        'void main(void) { n = printf("x=%u\\n", 42U); puts("ok"); while (1); }'
    )
    found = memory(text, dialect)
    assert found["b"][:8] == b"x=42\nok\n"
    assert found["n"][0] == 5


@pytest.mark.parametrize(
    ("base", "value"), sampled([(10, 0), (10, -32768), (16, 0x7ABC), (2, 5), (10, 65535 - 65536)], 2)
)
def test_itoa_writes_a_number_that_python_reads_back(base: int, value: int) -> None:
    text = (
        "#include <stdlib.h>\nchar b[18]; int back;\n"
        f"void main(void) {{ itoa(b, {value}, {base}); back = atoi(b); while (1); }}"
    )
    found = memory(text)
    assert int(found["b"].split(b"\0")[0], base) == value
    if base == 10:
        assert int.from_bytes(found["back"], "little", signed=True) == value


@pytest.mark.parametrize(("base", "value"), [(10, 0), (10, 65535), (16, 0xFABC), (2, 9)])
def test_utoa_writes_a_number_that_python_reads_back(base: int, value: int) -> None:
    text = f"#include <stdlib.h>\nchar b[18];\nvoid main(void) {{ utoa(b, {value}, {base}); while (1); }}"
    assert int(memory(text)["b"].split(b"\0")[0], base) == value


@pytest.mark.parametrize(
    ("function", "base", "value"),
    sampled(
        [
            ("ltoa", 10, -(2**31)),
            ("ltoa", 10, 2**31 - 1),
            ("ltoa", 16, -0x7ABCDEF),
            ("ultoa", 10, 2**32 - 1),
            ("ultoa", 2, 0x10001),
        ],
        2,
    ),
)
def test_ltoa_and_ultoa_write_a_number_that_python_and_atol_read_back(
    function: str, base: int, value: int
) -> None:
    number = f"({value + 1}L - 1)" if value < 0 else f"{value}UL"  # 2147483648 is not a long
    text = (
        "#include <stdlib.h>\nchar b[20]; long back;\n"
        f"void main(void) {{ {function}(b, {number}, {base}); back = atol(b); while (1); }}"
    )
    found = memory(text)
    assert int(found["b"].split(b"\0")[0], base) == value
    if base == 10:
        assert int.from_bytes(found["back"], "little") == value % 2**32


@pytest.mark.parametrize(
    ("function", "value"), [("_itoa", -1234), ("_uitoa", 65000), ("_ltoa", -70000), ("_ultoa", 4_000_000_000)]
)
def test_sdccs_functions_take_the_number_first(function: str, value: int) -> None:
    suffix = "UL" if value > 70000 else "L" if "l" in function else "U" if value > 0 else ""
    call = f"{function}({value}{suffix}, b, 10)"
    text = f"#include <stdlib.h>\nchar b[18];\nvoid main(void) {{ {call}; while (1); }}"
    assert int(memory(text, "sdcc")["b"].split(b"\0")[0]) == value


@pytest.mark.parametrize("dialect", ["xc8", "sdcc"])
@pytest.mark.parametrize("value", [0, 1, -1, 12345, -12345, -32767, 70000, -70000, 1 - 2**31])
def test_absolute_values_are_pythons(value: int, dialect: str) -> None:
    call = f"n = abs({value});" if abs(value) < 2**15 else ""
    text = f"#include <stdlib.h>\nint n; long m; void main(void) {{ {call} m = labs({value}L); while (1); }}"
    found = memory(text, dialect)
    assert int.from_bytes(found["m"], "little") == abs(value)
    if call:
        assert int.from_bytes(found["n"], "little") == abs(value)


@pytest.mark.parametrize("text", sampled([" \t-32768", "+17x", "-", "", "0x10", "  42 43"], 2))
def test_a_number_is_read_up_to_what_is_not_a_digit(text: str) -> None:
    digits = re.match(r"\s*([+-]?\d+)", text)
    expected = int(digits[1]) if digits else 0
    literal = text.replace("\t", "\\t")
    source = (
        "#include <stdlib.h>\nint n; long m;\n"
        f'void main(void) {{ n = atoi("{literal}"); m = atol("{literal}"); while (1); }}'
    )
    found = memory(source)
    assert int.from_bytes(found["n"], "little", signed=True) == expected
    assert int.from_bytes(found["m"], "little", signed=True) == expected


def test_rand_is_the_generator_of_the_c_standard() -> None:
    text = "#include <stdlib.h>\nint a, b; void main(void) { srand(5); a = rand(); b = rand(); while (1); }"
    state, expected = 5, []
    for _ in range(2):  # ISO C 7.22.2.2, example
        state = (state * 1103515245 + 12345) % 2**32
        expected.append(state // 65536 % 32768)
    found = memory(text)
    assert [int.from_bytes(found[name], "little") for name in ("a", "b")] == expected


def test_characters_are_classed_as_python_classes_them() -> None:
    names = ("isdigit", "isalpha", "isalnum", "isupper", "islower", "isspace", "isprint")
    masks = " | ".join(f"({name}(c) ? {1 << bit} : 0)" for bit, name in enumerate(names))
    text = (
        "#include <ctype.h>\nunsigned char sums[8], changed[8];\n"
        f"void main(void) {{ unsigned char c = 0; do {{ sums[c >> 5] = sums[c >> 5] * 31 + ({masks});"
        " changed[c >> 5] = changed[c >> 5] * 31 + (toupper(c) ^ (unsigned char)(tolower(c) << 1)); }"
        " while (++c < 128); while (1); }"
    )
    sums, changed = [0] * 8, [0] * 8
    for c in range(128):
        character = chr(c)
        is_print = 32 <= c < 127
        space = character in " \t\n\v\f\r"
        classes = (
            character.isdigit(), character.isalpha(), character.isalnum(), character.isupper(),
            character.islower(), space, is_print,
        )  # fmt: skip
        mask = sum(bool(each) << bit for bit, each in enumerate(classes))
        both = ord(character.upper()) ^ ord(character.lower()) << 1 & 0xFF
        sums[c >> 5] = (sums[c >> 5] * 31 + mask) & 0xFF
        changed[c >> 5] = (changed[c >> 5] * 31 + both) & 0xFF
    found = memory(text, cycles=800_000)
    assert list(found["sums"]) == sums
    assert list(found["changed"]) == changed


def test_other_classes_of_characters_are_pythons() -> None:
    classes = {
        "isxdigit": set(string.hexdigits),
        "ispunct": set(string.punctuation),
        "isgraph": set(string.ascii_letters + string.digits + string.punctuation),
        "iscntrl": {chr(c) for c in (*range(32), 127)},
    }
    masks = " | ".join(f"({name}(c) ? {1 << bit} : 0)" for bit, name in enumerate(classes))
    text = (
        "#include <ctype.h>\nunsigned char sums[16];\n"
        "void main(void) { unsigned char c = 0; do {"
        f" sums[c >> 4] = sums[c >> 4] * 31 + ({masks}); }} while (++c); while (1); }}"
    )
    sums = [0] * 16
    for c in range(256):
        mask = sum((chr(c) in members) << bit for bit, members in enumerate(classes.values()))
        sums[c >> 4] = (sums[c >> 4] * 31 + mask) & 0xFF
    assert list(memory(text, cycles=800_000)["sums"]) == sums


@pytest.mark.parametrize("dialect", ["xc8", "c2c", "sdcc"])
def test_memory_is_set_copied_and_searched(dialect: str) -> None:
    text = """
#include <string.h>
const unsigned char table[4] = { 9, 8, 7, 6 };
unsigned char a[6], b[6], place, missing, same;
void main(void) {
  memset(a, 0xA5, 5);
  memcpy(a + 1, table, 3);
  same = memcpy(b, a, 6) == b;
  place = (unsigned char *)memchr(b, 7, 6) - b;
  missing = memchr(b, 7, 3) == 0;
  memmove(b, b + 1, 4);
  memset(b, 1, 0);
  while (1);
}"""
    state = memory(text, dialect)
    copied = bytes((0xA5, 9, 8, 7, 0xA5, 0))
    assert state["a"] == copied
    assert state["b"] == copied[1:5] + copied[4:]
    assert (state["place"][0], state["missing"][0], state["same"][0]) == (copied.index(7), 1, 1)


def test_strings_are_copied_joined_compared_and_searched() -> None:
    text = """
#include <string.h>
char a[12], b[8]; int signs[5]; char found[4]; char n;
void main(void) {
  strcpy(a, "abc"); strcat(a, "de"); strncat(a, "fghij", 2); n = strlen(a);
  strncpy(b, "xyz", 6); memmove(a + 1, a, 4);
  signs[0] = strcmp("abc", "abd"); signs[1] = strcmp("abc", "abc"); signs[2] = strcmp("b", "abc");
  signs[3] = strncmp("abX", "abY", 2); signs[4] = memcmp("\\x80", "\\x7F", 1);
  found[0] = strchr(a, 'g') - a; found[1] = strrchr(a, 'b') - a; found[2] = strchr(a, 'z') == 0;
  found[3] = strstr(a, "fg") - a;
  while (1);
}"""
    state = memory(text)
    joined = b"abc" + b"de" + b"fg"
    moved = joined[:1] + joined[:4] + joined[5:]
    assert state["a"].split(b"\0")[0] == moved
    assert state["b"][:6] == b"xyz\0\0\0"
    assert state["n"][0] == len(joined)
    signs = [int.from_bytes(state["signs"][at : at + 2], "little", signed=True) for at in range(0, 10, 2)]
    assert [(each > 0) - (each < 0) for each in signs] == [-1, 0, 1, 0, 1]
    assert list(state["found"]) == [moved.find(b"g"), moved.rfind(b"b"), 1, moved.find(b"fg")]


def test_what_a_program_does_not_call_costs_nothing() -> None:
    plain = "char x; void main(void) { x = 5; while (1); }"
    headers = "".join(f"#include <{name}.h>\n" for name in ("string", "stdlib", "stdio", "ctype", "math"))
    sizes = {
        compile_sources([Source(HEADS["xc8"] + text, "main.c")], Options(dialect="xc8")).words
        for text in (plain, headers + plain)
    }
    assert len(sizes) == 1


def test_a_programs_own_function_replaces_the_librarys() -> None:
    text = (
        "#include <string.h>\nunsigned int n; unsigned int strlen(const char *s) { return 1000; }\n"
        'void main(void) { n = strlen("ab"); while (1); }'
    )
    assert int.from_bytes(memory(text)["n"], "little") == 1000


def test_what_only_assembly_calls_is_in_the_program() -> None:
    text = '#include <ctype.h>\nvoid main(void) { asm("call _toupper"); while (1); }'
    found = compile_sources([Source(HEADS["xc8"] + text, "main.c")], Options("xc8"))
    assert [each.name for each in found.listing.functions if each.name.startswith("to")] == ["toupper"]
