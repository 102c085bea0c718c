"""One program: compiled in a process with limits, run on the simulator, judged.

In: a `Program`, the level of optimisation. Out: a `Verdict`.
"""

from __future__ import annotations

import re
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from servogen import isolation
from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.edges import PINS
from servogen.errors import InputError
from servogen.isolation import COMPILING, LimitExceeded, ProcessDied, WorkLimits
from servogen.pic.device import RAM_FIRST
from servogen.pic.image import Image
from servogen.simulator import Machine, SimulatorOptions
from servogen.units import Clock
from tests.compiler.foreign.headers import DONE, FAILED, FINISHED, HEADERS
from tests.compiler.foreign.suites import Program

CLOCK = Clock(4_000_000)
MAX_CYCLES = 400_000_000
LIMITS = replace(COMPILING, elapsed_s=600)
"""Those of the commands, however busy the machine is."""
Compiler = Callable[[Sequence[Source], Options], Compilation]
_TARGET = re.compile(r"dg-require-effective-target\s+(\w+)")
"""What a test of gcc's suite says that it needs: 32 bits in an `int`, as a rule."""
_ELSEWHERE = {
    "00166.c": "constants of 20 bits shown with %d",
    "00178.c": "the sizes of int and double on another machine",
    "00212.c": "a 32-bit or 64-bit data model",
    "0039-sizeof.c": "a 32-bit int and 64-bit pointers",
    "86_memory-model.c": "a 32-bit or 64-bit data model",
    "bitfld-2.c": "bit-fields that cross the limits of bytes",
    "inline.c": "a pointer that fwk/lib/extern2.c defines",
    "pr23467.c": "an attribute that aligns objects",
}
"""Programs, by file name, that need another `int` or layout, or another file of their suite."""
TOO_LARGE = re.compile(
    r"words of flash|too large|too big|does not fit|bytes of RAM|program words|too deep|levels"
    r"|instructions up to here"
)


@dataclass(frozen=True, slots=True)
class Verdict:
    """`kind`: "right", "refused", "unsuitable" (the program says that it is for other targets), "wrong",
    "crash" or "over limit"; `reason` says why.
    """

    kind: str
    reason: str = ""

    @property
    def bad(self) -> bool:
        return self.kind not in ("right", "refused", "unsuitable")

    @property
    def does_not_fit(self) -> bool:
        return self.kind == "refused" and bool(TOO_LARGE.search(self.reason))


def judge(
    program: Program,
    level: str = "speed",
    limits: WorkLimits = LIMITS,
    cycles: int = MAX_CYCLES,
    compiler: Compiler = compile_sources,
) -> Verdict:
    """Compile a program in a process with limits, run it for at most so many cycles, and judge it."""
    if needed := _TARGET.search(program.text):
        return Verdict("unsuitable", f"needs the target {needed[1]}")
    if program.file.name in _ELSEWHERE:
        return Verdict("unsuitable", _ELSEWHERE[program.file.name])
    try:
        image = isolation.run(partial(compiled, program, level, compiler), limits)
    except InputError as error:
        messages = [each.message for each in error.diagnostics if each.severity == "error"]
        said = next((each for each in messages if not TOO_LARGE.search(each)), messages[0])
        return Verdict("refused", said)
    except LimitExceeded as error:
        return Verdict("over limit", str(error))
    except ProcessDied as error:
        return Verdict("crash", str(error))
    except Exception as error:
        return Verdict("crash", "".join(traceback.format_exception(error)))
    return ran(Image(*image), program.output, cycles)


def compiled(program: Program, level: str, compiler: Compiler) -> tuple[dict[int, int], int | None]:
    """Return the words and the configuration of a program: the work of the child process."""
    options = Options(
        program.dialect, optimise=level, clock_hz=CLOCK.hz, include=_include, defines=program.defines
    )
    image = compiler([Source(program.text, str(program.file))], options).image
    return dict(image.program), image.config


def _include(name: str, including: str) -> tuple[str, str] | None:
    """Return a file that lies beside the program."""
    if name in HEADERS:  # its text stands before the program
        return f"<{name}>", ""
    path = Path(including).parent / name
    return (str(path), path.read_text(encoding="latin-1")) if path.is_file() else None


def ran(image: Image, output: str | None, limit: int) -> Verdict:
    """Run a program and judge what it leaves."""
    machine = Machine(image, CLOCK, SimulatorOptions(start=(("ram", 0xA7),)))
    written = Port()
    while machine.cycles < limit:
        cycles = min(max(20_000, 10 * machine.cycles), limit - machine.cycles)
        for chunk in machine.stream(cycles):
            written.take(chunk.pin.tolist(), chunk.level.tolist())
        state = machine.state()
        if state.stack_wraps or state.undefined_words:
            return Verdict("wrong", "; ".join(map(str, state.warnings[:3])))
        if state.ram[DONE - RAM_FIRST] == FINISHED:
            break
    else:
        return Verdict("wrong", f"does not end in {limit} cycles")
    if status := state.ram[FAILED - RAM_FIRST]:
        return Verdict("wrong", f"status {status}")
    if output is not None and written.text != output:
        return Verdict("wrong", f"wrote {written.text!r} instead of {output!r}")
    return Verdict("right")


class Port:
    """Reads what a program writes: each rise of RA0 takes the byte on port B."""

    def __init__(self) -> None:
        self.text = ""
        self._byte = 0
        self._bits = {PINS.index(f"RB{bit}"): 1 << bit for bit in range(8)}
        self._strobe = PINS.index("RA0")

    def take(self, pins: list[int], levels: list[int]) -> None:
        for pin, level in zip(pins, levels, strict=True):
            if pin in self._bits:
                self._byte = self._byte & ~self._bits[pin] | (self._bits[pin] if level == 1 else 0)
            elif pin == self._strobe and level == 1:
                self.text += chr(self._byte)
