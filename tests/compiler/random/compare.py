"""The same programs on the host and on the simulated chip.

In: programs. Out: for each an `Outcome`: what gcc's and our compiler's code left, or why there is nothing
to compare.
"""

from __future__ import annotations

import subprocess
import tempfile
import traceback
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.errors import InputError
from servogen.pic.device import PROGRAM_WORDS, RAM_FIRST
from servogen.pic.image import Image
from servogen.pic.isa import Decoded, decode
from servogen.simulator import Machine, Observation, SimulatorOptions
from servogen.units import Clock
from tests.compiler.random.host_c import batch
from tests.compiler.random.program import Program
from tests.compiler.random.target_c import CHECK, DONE, FINISHED, TargetC

CLOCK = Clock(4_000_000)
MAX_CYCLES = 8_000_000
MACHINE = SimulatorOptions(start=(("ram", 0xA7),))
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
Check = tuple[int, ...]
"""Three bytes of checksums, then the address and the value of each store to a watched variable."""


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
    texts = TargetC(program).files()
    return compile_sources([Source(text, f"random{number}.c") for number, text in enumerate(texts)], options)


def target(program: Program, expected: Check | None) -> Outcome:
    """Compile and run one program, and compare."""
    try:
        found = compiled(program)
    except InputError as error:
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
    watched = {address for each in program.globals for address in each.watched_bytes}
    if watched:
        got += stores(found.image, watched, int(machine.cycles))
    if state.stack_wraps or state.undefined_words:
        return Outcome("crash", expected, got, found.words, "; ".join(map(str, state.warnings)))
    return Outcome("same" if got == expected else "different", expected, got, found.words)


def stores(image: Image, watched: Set[int], cycles: int) -> tuple[int, ...]:
    """Return each store to the RAM addresses `watched` as a watcher of the bus sees it.

    The watcher begins when the program has stored 0 at `DONE`. A first run says which instruction ran when; a
    second is stopped around each that may store there.
    """
    machine, found, begun = Machine(image, CLOCK, MACHINE), list[tuple[int, int]](), False
    for cycle, operand in candidates(image, {*watched, DONE}, cycles):
        machine.run_until(cycle=cycle)
        address = machine.state().registers["FSR"] & 0x7F if operand == 0 else operand
        if address != DONE and address not in watched:
            continue
        machine.run_until(cycle=cycle + 1)
        if address == DONE:
            begun = True
        elif begun:
            found.append((address, machine.state().ram[address - RAM_FIRST]))
    return tuple(number for pair in found for number in pair)


def stores_to_file(decoded: Decoded) -> bool:
    """Whether an instruction writes a file register."""
    target = decoded.instruction.operation.partition("-> ")[2].partition(",")[0]
    return target in ("f", "f<b>") or (target == "d" and decoded.d == 1)


def candidates(image: Image, addresses: Set[int], cycles: int) -> Iterator[tuple[int, int]]:
    """Give the cycle and operand of each executed instruction that stores to one of `addresses` or through
    INDF.
    """
    operands = np.full(PROGRAM_WORDS, -1)
    for address, word in image.program.items():
        decoded = decode(word)
        if decoded is not None and stores_to_file(decoded) and decoded.f in {0, *addresses}:
            operands[address] = decoded.f
    observation = Observation(trace=np.zeros((1 << 14, 4), dtype=np.int64))
    for _, rows in Machine(image, CLOCK, MACHINE).observe(cycles, observation):
        at = operands[rows[:, 1] % PROGRAM_WORDS]
        yield from zip(rows[at >= 0, 0].tolist(), at[at >= 0].tolist(), strict=True)


def compare(programs: Sequence[Program]) -> list[Outcome]:
    """Both sides of every program."""
    expected = host(programs)
    return [target(*row) for row in zip(programs, expected, strict=True)]
