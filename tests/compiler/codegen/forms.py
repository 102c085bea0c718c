"""The instructions of small functions, with the names of variables in place of addresses.

In: the bodies of functions over the variables in `HEAD`. Out: for each body its instructions, without the
RETURN at the end; `$+2` is a jump to the instruction after the next; t1, t2, … are the bytes that are not
variables in `HEAD`, in the order in which the function names them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from servogen.compiler import Options, Source, compile_sources

HEAD = """
#include <xc.h>
struct pair { unsigned char first, second; };
struct fields { unsigned lo : 3; unsigned one : 1; unsigned hi : 4; };
unsigned char a, b, c, n, array[8], *p;
signed char s, t;
unsigned int u, v;
int i, j;
unsigned long l;
volatile unsigned char k;
struct pair r, *q;
struct fields f;
__bit flag, other;
const unsigned char table[4] = {3, 1, 4, 1};
const unsigned int wide[3] = {300, 1, 1000};
unsigned char get(unsigned char x) { return x ^ 5; }
unsigned int both(unsigned char x, unsigned char y) { return x + y; }
void act(void) { PORTA = 9; }
"""
USE = "void use(void) { a = b = c = n = s = t = k = 1; u = v = i = j = l = 1; }\n"


def table(text: str) -> dict[str, str]:
    """What stands on the line below each body; "nothing" is no instruction."""
    rows = [line.strip().replace("nothing", "") for line in text.strip("\n").splitlines()]
    return dict(zip(rows[::2], rows[1::2], strict=True))


@cache
def compiled(bodies: Sequence[str], level: str = "speed") -> dict[str, str]:
    """The instructions of each body, `; ` between them."""
    functions = "".join(f"void f{at}(void) {{ {body} }}\n" for at, body in enumerate(bodies))
    calls = " ".join(f"f{at}();" for at in range(len(bodies)))
    text = f"{HEAD}{USE}{functions}void main(void) {{ use(); {calls} while (1); }}\n"
    found = compile_sources(
        [Source(text, "main.c")], Options(dialect="xc8", clock_hz=4_000_000, optimise=level)
    )
    names: dict[int, str] = {}
    for address, name, size in found.listing.variables:
        if "." not in name and "temporary" not in name:
            names |= {address + at: name + (f"+{at}" if at else "") for at in range(size)}
    starts = {each.start: each.name.partition("@")[0] for each in found.listing.functions}
    shown = {}
    for each in found.listing.functions:
        if re.fullmatch(r"f\d+", each.name):
            rows = found.listing.rows[each.start : each.end]
            body = bodies[int(each.name[1:])]
            naming = _Naming(dict(names), starts, each.start, "array" in body)
            lines = [naming.line(row.assembly, row.address) for row in rows]
            if lines[-1] == "RETURN":
                lines.pop()
            shown[body] = "; ".join(lines)
    return shown


def words(bodies: Sequence[str], level: str) -> int:
    """The words of all bodies together, each without the RETURN at its end."""
    return sum(text.count(";") + 1 for text in compiled(tuple(bodies), level).values() if text)


@dataclass
class _Naming:
    """The names of bytes and functions, as one function sees them."""

    names: dict[int, str]
    starts: dict[int, str]
    own: int
    array: bool
    """Whether the address of `array` may be a literal."""
    others: int = 0

    def line(self, text: str, address: int) -> str:
        op, _, operands = text.partition(" ")
        if op in ("GOTO", "CALL"):
            target = int(operands, 0)
            if target in self.starts and target != self.own:
                return f"{op} {self.starts[target]}"
            return f"{op} ${target - address:+d}"
        if op.endswith("LW"):
            value = int(operands, 0)
            name = self.names.get(value, "") if self.array else ""
            return f"{op} {name if name.startswith('array') else value}"
        first, *rest = operands.split(", ")
        if first.startswith("0x"):
            first = self._byte(int(first, 0))
        bits = {"0": "C", "2": "Z", "5": "RP0"}
        if first == "STATUS" and rest and rest[0] in bits:
            return f"{op} {bits[rest[0]]}"
        return f"{op} {','.join([first, *rest])}".strip()

    def _byte(self, address: int) -> str:
        if address not in self.names:
            self.others += 1
            self.names[address] = f"t{self.others}"
        return self.names[address]
