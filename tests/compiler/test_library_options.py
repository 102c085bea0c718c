"""Where the library's functions are defined and declared, the options' defaults, the limits."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from servogen.compiler import limits
from servogen.compiler.library import HEADERS, MISSING, declared_in, header, source, sources
from servogen.compiler.options import LEVELS, VERIFY_IR, Options, Source


def test_every_function_that_a_header_declares_has_its_source() -> None:
    assert all(header(name) for name in HEADERS)
    assert sources()["strlen"] == "string.c" and sources()["atoi"] == "stdlib.c"
    assert sources()["isdigit"] == "ctype.c" and sources()["floor"] == "math.c"
    for function in sources():
        # what a program may call is declared in a header
        assert function.startswith("__") or declared_in(function) is not None, function


def test_printf_and_sprintf_are_made_of_one_source() -> None:
    for name in ("printf", "sprintf"):
        text = source(f"{name}.c")
        assert text.startswith(f"#define TO_{name.upper()}\n")
        assert (
            text.removeprefix(f"#define TO_{name.upper()}\n")
            == source("string.c")[:0] + text.partition("\n")[2]
        )
        own = {function for function, file in sources().items() if file == f"{name}.c"}
        assert own and all(function.startswith(f"__{name}") for function in own)
    assert source("printf.c").partition("\n")[2] == source("sprintf.c").partition("\n")[2]


@pytest.mark.parametrize(
    ("function", "name"),
    [
        ("strlen", "string.h"),
        ("puts", "stdio.h"),
        ("isdigit", "ctype.h"),
        ("sqrt", "math.h"),
        ("strle", None),
    ],
)
def test_the_header_of_a_function(function: str, name: str | None) -> None:
    assert declared_in(function) == name
    assert declared_in("strl.n") is None


def test_the_functions_of_math_that_are_missing_are_in_no_header() -> None:
    """C99 7.12 has them all; the library has fabs, floor, ceil and sqrt."""
    assert {"sin", "cos", "tan", "exp", "log", "pow", "fmod"} <= MISSING
    assert not {"fabs", "floor", "ceil", "sqrt"} & MISSING
    assert all(declared_in(name) is None for name in MISSING)


def test_what_a_compilation_is_without_options(monkeypatch: pytest.MonkeyPatch) -> None:
    """As docs/compiler.md says: C2C for the PIC16F84A, optimised for speed, all warnings shown."""
    monkeypatch.delenv(VERIFY_IR, raising=False)
    made = Options()
    assert (made.dialect, made.device.name, made.optimise) == ("c2c", "PIC16F84A", "speed")
    assert (made.faster_device, made.clock_hz, made.include, made.float_bits, made.dump_ir) == (None,) * 5
    assert (dict(made.defines), made.unwanted, made.verify_ir) == ({}, frozenset(), False)
    assert Source("x").file == "main.c" and list(LEVELS) == ["none", "speed", "size"]
    monkeypatch.setenv(VERIFY_IR, "1")
    assert Options().verify_ir
    monkeypatch.setenv(VERIFY_IR, "0")
    assert not Options().verify_ir


def test_no_program_that_fits_the_chip_meets_a_limit() -> None:
    """1024 words: the largest of the tests' own programs stay a factor of four below each limit."""
    texts = [path.read_text(errors="replace") for path in Path(__file__).parent.glob("size/*.c")]
    assert 4 * max(map(len, texts)) < limits.SOURCE_CHARACTERS < limits.ALL_CHARACTERS
    assert 4 * max(len(re.findall(r"\w+|\S", text)) for text in texts) < limits.TOKENS
    assert limits.DIGITS > 32 and limits.INSTRUCTIONS > 4 * 1024
