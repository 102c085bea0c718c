"""Random programs that call through pointers to functions: they leave what gcc's code leaves.

The pointers are in tables, arrays, structures, parameters, results and conditional expressions. Every result
is converted to its type at once, so that the width of `int` does not matter.
"""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.campaigns import sampled
from tests.compiler.test_library import memory

GCC = shutil.which("gcc")
RESULTS = {"a": 1, "b": 1, "c": 2}

FIRST = """#include <stdint.h>
typedef uint8_t (*Byte)(uint8_t, uint16_t);
typedef uint16_t (*Word)(uint8_t);
typedef void (*Act)(void);
uint8_t i;
"""
HELPERS = """
uint8_t twice(Byte f, uint8_t x) { return f(f(x, c), c); }
Byte pick(uint8_t n) { if (n & 1) return f0; return n & 2 ? f1 : f2; }
Byte ram[3];
struct { Byte first; Word second; } both;
Act act;
"""


def program(seed: int) -> str:
    chance = random.Random(seed)

    def number(most: int = 99) -> int:
        return chance.randrange(1, most)

    def byte() -> str:
        return f"f{chance.randrange(5)}"

    def word() -> str:
        return f"w{chance.randrange(3)}"

    def element() -> str:
        return chance.choice([f"ram[{chance.randrange(3)}]", "ram[a % 3]", "table[b & 3]", "both.first"])

    lines = [FIRST, f"uint8_t a = {number()}, b = {number()}; uint16_t c = {number(60000)};"]
    for n in range(5):
        operator = chance.choice("+-^|")
        lines.append(
            f"uint8_t f{n}(uint8_t x, uint16_t y) {{"
            f" return (uint8_t)(x * {number()} {operator} (uint8_t)(y >> {chance.randrange(9)})); }}"
        )
    table = ", ".join(byte() for _ in range(4))
    lines.append(f"const Byte table[4] = {{ {table} }};")
    for n in range(3):  # which call through pointers themselves
        lines.append(
            f"uint16_t w{n}(uint8_t x) {{ return (uint16_t)(c * {number()} + table[(x + {n}) & 3](x, c)); }}"
        )
    for n in range(3):
        lines.append(f"void g{n}(void) {{ {chance.choice('ab')} += {number()}; c ^= {number(60000)}; }}")
    lines.append(HELPERS)
    statements = [
        lambda: f"ram[{chance.randrange(3)}] = {chance.choice([byte(), 'pick(a)', 'table[b & 3]'])};",
        lambda: f"a = {element()}(b, c);",
        lambda: f"both.first = {element()}; both.second = {word()};",
        lambda: "c = both.second(a);",
        lambda: f"act = {chance.choice(['g0', 'g1', 'g2', '0'])}; if (act) act();",
        lambda: f"b = twice({element()}, a);",
        lambda: f"if ({element()} == {byte()}) a += {number()};",
        lambda: "for (i = 0; i < 4; i++) b = table[i](b, c);",
        lambda: f"c = (a & 1 ? {word()} : {word()})(b);",
    ]
    lines.append(
        "void run(void) {\nram[0] = f0; ram[1] = f1; ram[2] = f2; both.first = f3; both.second = w0;"
    )
    lines += [chance.choice(statements)() for _ in range(14)]
    lines.append("}\n")
    return "\n".join(lines)


def on_the_chip(text: str) -> dict[str, int]:
    found = memory(text + "void main(void) { run(); while (1); }\n")
    return {name: int.from_bytes(found[name][:size], "little") for name, size in RESULTS.items()}


def on_the_host(text: str, folder: Path) -> dict[str, int]:
    main = '#include <stdio.h>\nint main(void) { run(); printf("%u %u %u", a, b, c); return 0; }\n'
    (folder / "run.c").write_text(text + main)
    assert GCC is not None
    subprocess.run([GCC, "-w", "-o", folder / "run", folder / "run.c"], check=True, timeout=120)
    done = subprocess.run([folder / "run"], capture_output=True, text=True, check=True, timeout=120)
    return dict(zip(RESULTS, map(int, done.stdout.split()), strict=True))


@pytest.mark.skipif(GCC is None, reason="gcc is not installed")
@pytest.mark.parametrize("seed", sampled(range(8), 3))
def test_calls_through_pointers_leave_what_gccs_code_leaves(seed: int, tmp_path: Path) -> None:
    text = program(seed)
    assert on_the_chip(text) == on_the_host(text, tmp_path)


def test_a_call_of_another_function_is_seen() -> None:
    text = program(0)
    table = re.compile(r"(table\[4\] = \{ )\w+, \w+, \w+, \w+")
    found = [on_the_chip(table.sub(rf"\1f{n}, f{n}, f{n}, f{n}", text)) for n in range(3)]
    assert len({tuple(each.values()) for each in found}) > 1
