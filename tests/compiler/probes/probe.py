"""A probe: a piece of C with values that two compilers must agree on. A program is a few probes.

In a text, `«a|b»` is `a` for this chip and `b` for the judge; `«a»` is nothing for the judge.
"""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from tests.compiler.random.target_c import CHECK, DONE, FINISHED

SHOWN = 0x4B
"""Where the chip stores each byte that it outputs."""
_EITHER = re.compile("«([^»|]*)(?:[|]([^»]*))?»")


@dataclass
class Probe:
    """Declarations of the file, declarations and statements of a function, and expressions: of each, the low
    byte counts.
    """

    kind: str
    file: str = ""
    body: str = ""
    values: list[str] = field(default_factory=list)

    def wide(self, expression: str, size: int) -> None:
        """Output all bytes of a value."""
        self.values += [f"({expression}) >> {8 * at}" if at else expression for at in range(size)]


@dataclass(frozen=True)
class Program:
    seed: int
    dialect: str
    level: str
    probes: Sequence[Probe]

    @property
    def kinds(self) -> set[str]:
        return {probe.kind for probe in self.probes}

    def chip(self) -> str:
        """The program for this chip; it leaves two sums over its bytes, as the random programs do."""
        names = {"show": SHOWN, "done": DONE, "sum": CHECK, "mix": CHECK + 1, "count": CHECK + 2}
        at = (
            "volatile unsigned char {} @ {:#x};"
            if self.dialect == "xc8"
            else ("volatile unsigned char __at({1:#x}) {0};")
        )
        head = [f"#include <{'xc' if self.dialect == 'xc8' else 'pic16f84a'}.h>"]
        head += ["#include <stdint.h>", "#include <stdio.h>", *(at.format(*row) for row in names.items())]
        head += ["static void out(unsigned char b) { show = b; sum += b; mix += sum; count++; }"]
        if "format" in self.kinds:
            head.append("static char buffer[20];")
        lines = [*head, *(probe.file for probe in self.probes)]
        calls = []
        for number, probe in enumerate(self.probes):
            values = "".join(f"  out((unsigned char)({value}));\n" for value in probe.values)
            lines.append(f"static void probe{number}(void) {{\n{probe.body}\n{values}}}")
            calls.append(f"probe{number}();")
        lines.append(
            f"void main(void) {{ sum = mix = count = 0; done = 0; {' '.join(calls)} done = {FINISHED:#x};"
            " while (1); }\n"
        )
        return _EITHER.sub(lambda match: match[1], "\n".join(lines))

    def judged(self) -> str:
        """The same for gcc, as functions with names of their own."""
        lines = [probe.file for probe in self.probes]
        for number, probe in enumerate(self.probes):
            values = "".join(f"  OUT({value});\n" for value in probe.values)
            body = f"{probe.body}\n{values}"
            lines.append(
                f"__attribute__((externally_visible)) void p{self.seed}_{number}(void)\n"
                f"{{\n  BEGIN({self.seed});\n{body}}}"
            )
        return _EITHER.sub(lambda match: match[2] or "", "\n".join(lines))


class Dice(random.Random):
    """Random choices, and names that no other probe has."""

    def __init__(self, seed: int) -> None:
        super().__init__(f"probes {seed}")
        self._stem, self._names = seed, 0

    def name(self, letter: str = "v") -> str:
        self._names += 1
        return f"{letter}{self._stem}_{self._names}"

    def may(self, chance: float) -> bool:
        return self.random() < chance
