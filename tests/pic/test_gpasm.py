"""Where gpasm is installed: random sources give the same words in both assemblers.

The tests elsewhere hold without it; this one looks where nobody thought to.
"""

from __future__ import annotations

import random
import shutil
import subprocess
from pathlib import Path

import pytest

from servogen.pic.assembler import assemble
from servogen.pic.image import Image, from_hex
from servogen.pic.isa import by_mnemonic
from tests.campaigns import sampled

pytestmark = pytest.mark.skipif(shutil.which("gpasm") is None, reason="gpasm is not installed")

BINARY = ("+", "-", "*", "&", "|", "^", "<<", ">>", "<", ">", "<=", ">=", "==", "!=", "&&", "||")
UNARY = ("-", "~", "!", "+", "high ", "low ", "upper ")
NAMES = ("one", "big", "there", "counter")
SPECIAL = ("SKPC", "SKPNZ", "CLRZ", "SETDC", "BZ there", "BNC there", "MOVFW 20", "TSTF 20", "NEGF 20,f")
DATA = ('dt "ab", 1', 'data "abc"', "db 1,2,3", 'da "xyz"', "fill 12,2", "res 1", "dw 3FF")


def number(rng: random.Random) -> str:
    value = rng.randrange(1, 256)
    return rng.choice(
        [
            f"0x{value:X}", f"0{value:X}h", f"H'{value:x}'", f"D'{value}'", f".{value}", f"B'{value:b}'",
            f"O'{value:o}'",
        ]
    )  # fmt: skip


def expression(rng: random.Random, depth: int = 3) -> str:
    """Nothing divides, for nothing keeps a divisor from being 0."""
    choice = rng.random()
    if depth == 0 or choice < 0.3:
        return rng.choice([number(rng), rng.choice(NAMES), "$", "'k'"])
    if choice < 0.45:
        return f"{rng.choice(UNARY)}({expression(rng, depth - 1)})"
    if choice < 0.6:
        return f"({expression(rng, depth - 1)})"
    return f"{expression(rng, depth - 1)} {rng.choice(BINARY)} {expression(rng, depth - 1)}"


def line(rng: random.Random) -> str:
    choice = rng.random()
    if choice < 0.1:
        return f" {rng.choice(SPECIAL)}"
    if choice < 0.2:
        return f" {rng.choice(DATA)}"
    if choice < 0.25:
        return f"counter set ({expression(rng)}) & 7F"
    if choice < 0.35:
        return f" if {expression(rng)}\n movlw 1\n else\n clrw\n endif"
    if choice < 0.45:
        return f" work {number(rng)}, {rng.choice(NAMES)}"
    row = by_mnemonic()[rng.choice([name for name in by_mnemonic() if name != "TRIS"])]
    operands = {
        "f": f"({expression(rng)}) & 7F",
        "d": rng.choice(["w", "f", "0", "1"]),
        "b": f"({expression(rng)}) & 7",
        "k": f"({expression(rng)}) & 3FF" if row.width("k") == 11 else expression(rng),
    }
    return f" {row.mnemonic.lower()} " + ", ".join(operands[field] for field in row.operands)


def source(seed: int) -> str:
    rng = random.Random(seed)
    head = (
        "one equ 1\nbig equ 12345\ncounter set 3\n"
        "work macro p, q\n local x\nx movlw low(p+q)\n goto x\n endm\n"
    )
    body = "\n".join(line(rng) for _ in range(120))
    return f" list p=16f84\n{head} org 0\n{body}\nthere nop\n end\n"


def made_by_gpasm(text: str, folder: Path) -> Image:
    (folder / "t.asm").write_text(text)
    subprocess.run(["gpasm", "-q", "t.asm"], cwd=folder, check=True, timeout=60)
    return from_hex((folder / "t.hex").read_text())


@pytest.mark.parametrize("seed", sampled(range(12), 4))
def test_random_sources_give_the_same_words(seed: int, tmp_path: Path) -> None:
    text = source(seed)
    assert assemble(text).image == made_by_gpasm(text, tmp_path)
