"""One operation on the simulated chip, with operands that are written into its RAM.

In: the statement of an operation on the variables x and y. Out: what it leaves in its variables, for any
number of operands, without compiling or starting the program again.
"""

from __future__ import annotations

from servogen.compiler import Options, Source, compile_sources
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine
from servogen.units import Clock

HEAD = """
#include <stdint.h>
#include <math.h>
float x, y, z;
volatile uint8_t c;
volatile int32_t i;
volatile uint32_t u;
volatile short long s;
volatile int16_t h;
volatile int8_t b;
"""
MAX_CYCLES = 60_000


class FloatMachine:
    """A chip that executes one statement again and again."""

    def __init__(self, statement: str, width: int, *, optimise: str = "speed") -> None:
        used = f"{HEAD}\nvoid main(void) {{ while (1) {{ NOP(); {statement} }} }}"
        found = compile_sources(
            [Source(used, "operation.c")], Options(dialect="xc8", float_bits=width, optimise=optimise)
        )
        self.words = found.words
        self._where = {name: (address, size) for address, name, size in found.listing.variables}
        self._start = next(row.address for row in found.listing.rows if row.assembly == "NOP")
        self._machine = Machine(found.image, Clock(4_000_000))
        assert self._machine.run_until(pc=self._start, limit=MAX_CYCLES)
        self.cycles = 0
        """The most cycles that the statement has taken."""

    def __call__(self, **operands: int) -> None:
        """Execute the statement once with these bytes in the variables."""
        for name, value in operands.items():
            address, size = self._where[name]
            for offset in range(size):
                self._machine.numbers[address + offset] = value >> 8 * offset & 0xFF
        before = int(self._machine.cycles)
        assert self._machine.run_until(pc=self._start, limit=MAX_CYCLES), "it does not end"
        self.cycles = max(self.cycles, int(self._machine.cycles) - before)

    def __getitem__(self, name: str) -> int:
        """Return the bytes of a variable."""
        address, size = self._where[name]
        start = address - RAM_FIRST
        return int.from_bytes(self._machine.ram[start : start + size], "little")
