"""The same programs on the host and on the simulated chip.

In: programs. Out: for each an `Outcome`: what gcc's and our compiler's code left, or why there is nothing
to compare.
"""

from __future__ import annotations

import subprocess
import tempfile
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from servogen.compiler import Compilation, CompileError, Options, Source, compile_sources
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine
from servogen.simulator import Options as MachineOptions
from servogen.units import Clock
from tests.compiler.random.host_c import batch
from tests.compiler.random.program import Program
from tests.compiler.random.target_c import CHECK, DONE, FINISHED, TargetC

CLOCK = Clock(4_000_000)
MAX_CYCLES = 8_000_000
MACHINE = MachineOptions(ram=0xA7)
"""The RAM holds anything at power-up, so nothing may count on zeros."""
GCC = ("gcc", "-O0", "-fwrapv", "-fno-strict-aliasing", "-w")
TOO_BIG = (
    "words of flash",
    "too large",
    "too big",
    "does not fit",
    "bytes of RAM",
    "program words",
    "levels",
    "too deep",
    "deep",
)
Check = tuple[int, int, int]


@dataclass(frozen=True)
class Outcome:
    """`kind`: "same", "different", "refused" (an error for a correct program), "too big", "crash",
    "endless".
    """

    kind: str
    expected: Check | None = None
    got: Check | None = None
    words: int = 0
    message: str = ""

    @property
    def bad(self) -> bool:
        return self.kind not in ("same", "too big")


def host(programs: Sequence[Program], *, timeout: float = 120) -> list[Check | None]:
    """The checksums by gcc, all programs in one call; None where a program did not end."""
    with tempfile.TemporaryDirectory() as folder:
        source, binary = Path(folder, "batch.c"), Path(folder, "batch")
        source.write_text(batch(list(programs)))
        subprocess.run([*GCC, "-o", binary, source], check=True, capture_output=True, text=True)
        try:
            printed = subprocess.run([binary], capture_output=True, text=True, timeout=timeout).stdout
        except subprocess.TimeoutExpired as late:
            printed = (late.stdout or b"").decode()
    lines: list[Check | None] = [tuple(map(int, line.split())) for line in printed.splitlines()]  # type: ignore[misc]
    return lines + [None] * (len(programs) - len(lines))


def compiled(program: Program) -> Compilation:
    options = Options(dialect=program.dialect, clock_hz=CLOCK.hz, optimise=program.level)
    return compile_sources([Source(TargetC(program).text(), "random.c")], options)


def target(program: Program, expected: Check | None) -> Outcome:
    """Compile and run one program, and compare."""
    try:
        found = compiled(program)
    except CompileError as error:
        message = next(each.message for each in error.diagnostics if each.severity == "error")
        return Outcome(
            "too big" if any(each in message for each in TOO_BIG) else "refused", expected, message=message
        )
    except Exception:
        return Outcome("crash", expected, message=traceback.format_exc(limit=-2))
    machine = Machine(found.image, CLOCK, MACHINE)
    for cycles in (20_000, 500_000, MAX_CYCLES):
        machine.run(cycles)
        state = machine.state()
        if state.ram[DONE - RAM_FIRST] == FINISHED:
            break
    else:
        return Outcome("endless", expected, words=found.words, message=f"at 0x{state.pc:03X}")
    at = CHECK - RAM_FIRST
    got: Check = (state.ram[at], state.ram[at + 1], state.ram[at + 2])
    if state.stack_wraps or state.undefined_words:
        return Outcome("crash", expected, got, found.words, "; ".join(map(str, state.warnings)))
    return Outcome("same" if got == expected else "different", expected, got, found.words)


def compare(programs: Sequence[Program]) -> list[Outcome]:
    """Both sides of every program."""
    expected = host(programs)
    return [target(*row) for row in zip(programs, expected, strict=True)]
