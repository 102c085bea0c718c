"""The judges: gcc's preprocessor for tokens, avr-gcc for values (its `int` has 16 bits), gcc for formats.

In: programs, many at once. Out: the tokens or the bytes of each that a judge can tell.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from tests.compiler.probes.macros import Text
from tests.compiler.probes.probe import Program

Bytes = tuple[int, ...]
_AVR = (
    "avr-gcc",
    "-mmcu=atmega1284",
    "-O2",
    "-fwrapv",
    "-funsigned-char",
    "-std=gnu11",
    "-w",
    "-S",
    "-o",
    "-",
)
_HOST = ("gcc", "-O1", "-fwrapv", "-funsigned-char", "-std=gnu11", "-w")
_AVR_HEAD = """#include <stdint.h>
#define volatile
#define BEGIN(n) __asm__ volatile("; BEGIN %0" :: "n"(n))
#define OUT(x) __asm__ volatile("; OUT %0" :: "nr"((unsigned char)(x)))
"""
_HOST_HEAD = """#include <stdint.h>
#include <stdio.h>
static char buffer[64];
#define BEGIN(n) printf("\\n; BEGIN %d\\n", n)
#define OUT(x) printf("; OUT %d\\n", (unsigned char)(x))
"""
_TOKEN = re.compile(
    r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'|\.?\d(?:[eEpP][+-]|[\w.])*|[A-Za-z_]\w*'
    r"|\.\.\.|<<=|>>=|->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&^|]=|##|\S"
)
_INTEGER = re.compile(r"(0[xX][0-9a-fA-F]+|0[bB][01]+|0[0-7]*|[1-9]\d*)([uUlL]*)")


def _outputs(text: str) -> dict[int, list[int | None]]:
    """What the functions of each program output, in the order of the functions."""
    found: dict[int, list[int | None]] = {}
    current: list[int | None] = []
    for word, value in re.findall(r"; (BEGIN|OUT) (\S+)", text):
        if word == "BEGIN":
            current = found.setdefault(int(value), [])
        else:
            current.append(int(value) & 0xFF if re.fullmatch(r"-?\d+", value) else None)
    return found


def _avr(text: str) -> str:
    return subprocess.run(
        [*_AVR, "-x", "c", "-"], input=text, check=True, capture_output=True, text=True
    ).stdout


def _host(text: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        binary = Path(folder, "batch")
        subprocess.run(
            [*_HOST, "-o", binary, "-x", "c", "-"], input=text, check=True, capture_output=True, text=True
        )
        return subprocess.run([binary], check=True, capture_output=True, text=True, timeout=60).stdout


def _judged(
    programs: Sequence[Program], head: str, tail: str, judge: Callable[[str], str]
) -> dict[int, Bytes]:
    """Ask once for all; where the judge refuses, halves are asked, down to the program that it refuses."""
    text = "\n".join([head, *(program.judged() for program in programs)])
    calls = "".join(
        f"p{program.seed}_{number}();" for program in programs for number in range(len(program.probes))
    )
    try:
        found = _outputs(judge(text + tail.replace("CALLS", calls)))
    except subprocess.CalledProcessError:
        if len(programs) == 1:
            return {}
        half = len(programs) // 2
        return {
            seed: row
            for part in (programs[:half], programs[half:])
            for seed, row in _judged(part, head, tail, judge).items()
        }
    return {seed: tuple(row) for seed, row in found.items() if None not in row}  # type: ignore[misc]


def bytes_of(programs: Sequence[Program]) -> dict[int, Bytes]:
    """The bytes of each program that a judge can tell."""
    formats = [program for program in programs if "format" in program.kinds]
    others = [program for program in programs if "format" not in program.kinds]
    found: dict[int, Bytes] = {}
    if others:
        found |= _judged(others, _AVR_HEAD, "", _avr)
    if formats:
        found |= _judged(formats, _HOST_HEAD, "\nint main(void) { CALLS }\n", _host)
    return found


def normal(text: str) -> list[str]:
    """The tokens of a text, with one spelling of each integer."""
    return [_plain(token) for token in _TOKEN.findall(text)]


def _plain(token: str) -> str:
    if match := _INTEGER.fullmatch(token):
        digits = match[1]
        base = 8 if re.fullmatch("0[0-7]+", digits) else 0
        return f"{int(digits, base)}{''.join(sorted(match[2].lower()))}"
    return token


def tokens_of(texts: Mapping[int, Text]) -> dict[int, list[str]]:
    """The tokens of each text by gcc, all texts in one call."""
    with tempfile.TemporaryDirectory() as folder:
        for text in texts.values():
            for name, inside in text.files.items():
                Path(folder, name).write_text(inside)
        whole = "\n".join(line for seed, text in texts.items() for line in (f"; BEGIN {seed} ;", *text.lines))
        ran = subprocess.run(
            ["gcc", "-E", "-P", "-w", "-std=gnu11", f"-I{folder}", "-x", "c", "-"],
            input=whole + "\n",
            capture_output=True,
            text=True,
        )
    if ran.returncode and len(texts) > 1:
        rows = list(texts.items())
        half = len(rows) // 2
        return tokens_of(dict(rows[:half])) | tokens_of(dict(rows[half:]))
    if ran.returncode:
        return {}
    parts = re.split(r"; BEGIN (\d+) ;", ran.stdout)
    return {int(seed): normal(text) for seed, text in zip(parts[1::2], parts[2::2], strict=True)}
