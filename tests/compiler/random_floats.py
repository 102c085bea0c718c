"""Random programs with floating-point values, compiled by gcc and by servogen, run, and compared bit by bit.

A program is one text. Its operators are macros: for the chip they are C's operators, for the host they
compute in `float` (32 bits), or in `double` rounded to 15 bits of mantissa after each operation (24 bits),
which is correctly rounded because a double has more than twice as many digits. Integers have the types of
<stdint.h>, and what is converted to one is cut to 32 bits first, as docs/compiler.md says.

    python -m tests.compiler.random_floats --seeds 2000
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from servogen.compiler import Options, Source, compile_sources
from servogen.errors import InputError
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine, SimulatorOptions
from servogen.units import Clock
from tests.compiler.float_reference import canonical

GCC = ("gcc", "-O1", "-msse2", "-ffp-contract=off", "-fwrapv", "-fno-strict-aliasing", "-w")
MAX_CYCLES = 4_000_000
INTEGERS = {"c": "uint8_t", "b": "int8_t", "h": "int16_t", "w": "uint16_t", "i": "int32_t", "u": "uint32_t"}
VARIANTS = (("xc8", 24), ("xc8", 32), ("c2c", 32), ("sdcc", 24), ("sdcc", 32))
LEVELS = ("speed", "size", "none")

CHIP = """
#include <stdint.h>
#include <math.h>
#define L(x) x
#define OP(a, op, b) ((a) op (b))
#define REL(a, op, b) ((a) op (b))
#define INT(type, x) ((type)(x))
#define ASSIGN_INT(type, target, x) target = (x)
#define UPDATE(target, op, x) target op##= (x)
#define UPDATE_INT(type, target, op, x) target op##= (x)
#define AFTER(target, op) ((target)op##op)
#define BEFORE(target, op) (op##op(target))
#define FROM(x) ((float)(x))
typedef float real;
"""
HOST = """
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <math.h>
static uint32_t whole(double x) {
  return isfinite(x) ? (uint32_t)(int64_t)fmod(trunc(x), 4294967296.0) : 0;
}
#if BITS == 32
typedef float real;
#define ROUND(x) ((float)(x))
#define L(x) ((float)x##f)
#define FABS(x) fabsf(x)
#else
typedef double real;
static double ROUND(double x) {
  if (x == 0 || !isfinite(x)) return x;
  int exponent = ilogb(x);
  double unit = ldexp(1, (exponent < -126 ? -126 : exponent) - 15), found = nearbyint(x / unit) * unit;
  return fabs(found) >= 0x1p128 ? copysign(INFINITY, x) : found;
}
#define L(x) ROUND(x)
#define FABS(x) fabs(x)
#endif
#define F(x) ((real)ROUND(x))
#define OP(a, op, b) ((real)ROUND(F(a) op F(b)))
#define REL(a, op, b) (F(a) op F(b))
#define INT(type, x) ((type)whole(x))
#define ASSIGN_INT(type, target, x) target = INT(type, x)
#define UPDATE(target, op, x) target = OP(target, op, x)
#define UPDATE_INT(type, target, op, x) target = INT(type, OP(target, op, x))
#define AFTER(target, op) ({ real before = target; target = OP(target, op, 1); before; })
#define BEFORE(target, op) (target = OP(target, op, 1))
#define FROM(x) F(x)
#define fabs(x) FABS(x)
static void show(double x) {
  float narrow = x;
  uint32_t bits;
  memcpy(&bits, &narrow, 4);
  printf("%u ", bits >> 32 - BITS);
}
"""


@dataclass
class Writer:
    """Writes the text of one program; names begin with @, which becomes the program's prefix."""

    chance: random.Random
    names: list[str] = field(default_factory=list)
    """The floating-point objects that may be used here."""
    integers: list[str] = field(default_factory=list)
    calls: bool = True

    def literal(self) -> str:
        chance = self.chance
        return chance.choice(
            (
                f"{chance.randrange(100)}.{chance.randrange(1000)}",
                f"0.{chance.randrange(1, 10000):04}",
                f"{chance.randrange(1, 10)}.{chance.randrange(100)}e{chance.randrange(-6, 7)}",
                f"{chance.randrange(1, 2000)}.0",
                "1.0",
                "0.0",
            )
        )

    def number(self, depth: int) -> str:
        """Return an expression of the floating-point type."""
        chance = self.chance
        if depth == 0:
            return f"L({self.literal()})" if chance.random() < 0.25 else chance.choice(self.names)
        match chance.randrange(12):
            case 0:
                return f"(-{self.number(depth - 1)})"
            case 1:
                return f"({self.condition(depth - 1)} ? {self.number(depth - 1)} : {self.number(depth - 1)})"
            case 2:
                return f"FROM({self.integer()})"
            case 3:
                op, operand = chance.choice("+-*/"), self.number(depth - 1)
                left, right = chance.choice(((operand, self.integer()), (self.integer(), operand)))
                return f"OP({left}, {op}, {right})"
            case 4 if self.calls:
                return f"@call{chance.randrange(2)}({self.number(depth - 1)}, {self.integer()})"
            case 5:
                return f"fabs({self.number(depth - 1)})"
        op = chance.choice("++--**/")
        return f"OP({self.number(depth - 1)}, {op}, {self.number(depth - 1)})"

    def integer(self) -> str:
        return self.chance.choice((*self.integers, str(self.chance.randrange(0, 200))))

    def condition(self, depth: int) -> str:
        chance = self.chance
        left = self.number(depth)
        match chance.randrange(5):
            case 0:
                return left
            case 1:
                return f"!{left}" if left[0] != "-" else left
            case 2:
                joined = chance.choice(("&&", "||"))
                return f"({self.condition(0)} {joined} {self.condition(0)})"
        right = chance.choice((self.number(0), self.number(depth), self.integer()))
        return f"REL({left}, {chance.choice(('<', '<=', '==', '!=', '>', '>='))}, {right})"

    def place(self) -> str:
        return self.chance.choice(self.names)

    def statement(self, depth: int) -> str:
        chance = self.chance
        integer = chance.choice(self.integers)
        kind = INTEGERS[integer.lstrip("@")[0]]
        match chance.randrange(12):
            case 0:
                return f"if ({self.condition(1)}) {{ {self.block(depth)} }} else {{ {self.block(depth)} }}"
            case 1 if depth:
                loop = f"k{depth}"
                return (
                    f"for ({loop} = 0; {loop} < {chance.randrange(2, 5)}; {loop}++) {{ {self.block(depth)} }}"
                )
            case 2 | 3:
                return f"UPDATE({self.place()}, {chance.choice('+-*/')}, {self.number(1)});"
            case 4:
                return f"ASSIGN_INT({kind}, {integer}, {self.number(1)});"
            case 5:
                return f"UPDATE_INT({kind}, {integer}, {chance.choice('+-*')}, {self.number(0)});"
            case 6:
                return f"{self.place()} = FROM(INT({kind}, {self.number(1)}));"
            case 7:
                step = f"{chance.choice(('AFTER', 'BEFORE'))}({self.place()}, {chance.choice('+-')})"
                return f"{self.place()} = {step};" if chance.random() < 0.5 else f"{step};"
            case 8:
                return f"*p = {self.number(1)};"
        return f"{self.place()} = {self.number(2)};"

    def block(self, depth: int) -> str:
        return " ".join(self.statement(max(depth - 1, 0)) for _ in range(self.chance.randrange(1, 3)))


OUTPUTS = ("@f0", "@f1", "@f2", "@list[0]", "@list[1]", "@part.value")


@dataclass(frozen=True)
class FloatProgram:
    seed: int
    dialect: str
    bits: int
    level: str
    text: str
    integers: tuple[str, ...]

    def chip(self) -> str:
        end = "volatile uint8_t done; void main(void) { body(); done = 0xA5; while (1); }"
        return CHIP + self.text.replace("@", "") + end

    def host(self, number: int) -> str:
        """Return the program as part of a batch."""
        text = self.text.replace("body(", "@body(").replace("@", f"p{number}_")
        shown = "".join(f"show({each});" for each in OUTPUTS)
        shown += "".join(f'printf("%u ", (uint32_t){each});' for each in self.integers)
        return f'{text}static void run{number}(void) {{ p{number}_body(); {shown} puts(""); }}\n'.replace(
            "@", f"p{number}_"
        )


def generate(seed: int) -> FloatProgram:
    """Return the program of a seed."""
    chance = random.Random(seed)
    dialect, bits = VARIANTS[seed % len(VARIANTS)]
    level = LEVELS[seed // len(VARIANTS) % len(LEVELS)]
    chosen = chance.sample(sorted(INTEGERS), 2)
    integers = tuple(f"@{name}0" for name in chosen)
    writer = Writer(chance)
    parts = ["real @f0, @f1 = 2.5, @f2 = -0.375, @list[2] = {1, 100};\n"]
    parts.append("struct @pair { uint8_t n; real value; } @part;\n")
    parts.append("const real @table[3] = {0.5, -3, 1024};\n")
    parts += [f"{INTEGERS[name]} @{name}0;\n" for name in chosen]
    for number in range(2):
        inside = Writer(chance, ["a", "a", "@f1", "@table[2]"], ["n"], calls=False)
        parts.append(f"real @call{number}(real a, int8_t n) {{ ")
        if chance.random() < 0.5:
            parts.append(f"if ({inside.condition(0)}) return {inside.number(1)}; ")
        parts.append(f"return {inside.number(1)}; }}\n")
    writer.names = [*OUTPUTS, "*p", "@table[1]", "x"]
    writer.integers = list(integers)
    places = Writer(chance, [*OUTPUTS, "*p", "x"], list(integers))
    parts.append("void body(void) { uint8_t k0, k1, k2; real x = 1, *p = @list;\n")
    parts.append(f"@f0 = L({writer.literal()}); @part.value = L({writer.literal()}); @part.n = 1;\n")
    parts += [f"{name} = {chance.randrange(120)};\n" for name in integers]
    for _ in range(chance.randrange(2, 6)):
        parts.append(f"  {places.statement(2)}\n")
    if chance.random() < 0.5:
        parts.append("  p = &@f2;\n")
        parts.append(f"  {places.statement(1)}\n")
    parts.append("  (void)x; (void)p; (void)k0; (void)k1; (void)k2;\n}\n")
    return FloatProgram(seed, dialect, bits, level, "".join(parts), integers)


def host(programs: Sequence[FloatProgram]) -> list[list[int]]:
    """Return what each program leaves in its variables, by gcc; the programs have one size of values."""
    text = "".join(program.host(number) for number, program in enumerate(programs))
    calls = "".join(f"run{number}();" for number in range(len(programs)))
    with tempfile.TemporaryDirectory() as folder:
        source, binary = Path(folder, "batch.c"), Path(folder, "batch")
        source.write_text(f"{HOST}{text}int main(void) {{ {calls} return 0; }}\n")
        subprocess.run([*GCC, f"-DBITS={programs[0].bits}", "-o", binary, source, "-lm"], check=True)
        printed = subprocess.run([binary], check=True, capture_output=True, text=True).stdout
    return [[int(each) for each in line.split()] for line in printed.splitlines()]


@dataclass(frozen=True)
class Outcome:
    """`kind`: "same", "different", "too big", "refused", "endless"."""

    kind: str
    detail: str = ""

    @property
    def bad(self) -> bool:
        return self.kind not in ("same", "too big")


def target(program: FloatProgram, expected: Sequence[int]) -> Outcome:
    """Compile a program for the chip, run it, and compare its variables with what gcc's code left."""
    try:
        found = compile_sources(
            [Source(program.chip(), "program.c")],
            Options(dialect=program.dialect, float_bits=program.bits, optimise=program.level),
        )
    except InputError as error:
        errors = [each for each in error.diagnostics if each.severity == "error"]
        big = all(each.code in ("program-too-large", "c-call-depth") for each in errors)
        return Outcome("too big" if big else "refused", str(error))
    machine = Machine(found.image, Clock(4_000_000), SimulatorOptions(start=(("ram", 0xA7),)))
    where = {name: address - RAM_FIRST for address, name, _ in found.listing.variables}
    for _ in range(MAX_CYCLES // 50_000):
        machine.run(50_000)
        if machine.ram[where["done"]] == 0xA5:
            break
    else:
        return Outcome("endless")
    size = program.bits // 8
    places = [
        where.get("f0"),
        where.get("f1"),
        where.get("f2"),
        where.get("list"),
        where.get("list"),
        where.get("part"),
    ]
    shifts = (0, 0, 0, 0, size, 1)
    for name, value, place, shift in zip(OUTPUTS, expected, places, shifts, strict=False):
        if place is None:
            continue  # the program does not use it
        got = int.from_bytes(machine.ram[place + shift : place + shift + size], "little")
        if canonical(got, program.bits) != canonical(value, program.bits):
            return Outcome("different", f"{name[1:]}: gcc 0x{value:X}, chip 0x{got:X}")
    for name, value in zip(program.integers, expected[len(OUTPUTS) :], strict=True):
        width = 1 if name[1] in "cb" else 2 if name[1] in "hw" else 4
        at = where.get(name[1:])
        got = value if at is None else int.from_bytes(machine.ram[at : at + width], "little")
        if (got ^ value) & (1 << 8 * width) - 1:
            return Outcome("different", f"{name[1:]}: gcc 0x{value:X}, chip 0x{got:X}")
    return Outcome("same")


def compare(programs: Sequence[FloatProgram]) -> list[Outcome]:
    """Return the outcome of each program."""
    found: dict[int, Outcome] = {}
    for bits in (24, 32):
        chosen = [each for each in programs if each.bits == bits]
        if chosen:
            for program, expected in zip(chosen, host(chosen), strict=True):
                found[program.seed] = target(program, expected)
    return [found[each.seed] for each in programs]


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.compiler.random_floats", description="Random programs with float against gcc."
    )
    parser.add_argument("--seeds", type=int, default=500, help="how many programs")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--batch", type=int, default=100, help="programs in a call of gcc")
    parser.add_argument("--failures", type=int, default=5, help="stop after so many")
    arguments = parser.parse_args()
    kinds: Counter[str] = Counter()
    started, failures, last = time.monotonic(), 0, arguments.first + arguments.seeds
    for first in range(arguments.first, last, arguments.batch):
        programs = [generate(seed) for seed in range(first, min(first + arguments.batch, last))]
        for program, outcome in zip(programs, compare(programs), strict=True):
            kinds[outcome.kind] += 1
            if outcome.bad:
                failures += 1
                head = f"seed {program.seed} {program.dialect} {program.bits} {program.level}"
                print(f"{head}: {outcome.kind} {outcome.detail}\n{program.chip()}", flush=True)
        print(
            f"{sum(kinds.values())} programs, {time.monotonic() - started:.0f} s: {dict(kinds)}", flush=True
        )
        if failures >= arguments.failures:
            break
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
