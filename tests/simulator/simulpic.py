"""Instructions on a third simulator: `simulpic`, a Debian package by another author, where it is installed.

    python -m tests.simulator.simulpic --programs 200 --seed 1

Random programs run on both, instruction by instruction: before each its cycle, address, W, STATUS, FSR and
PCLATH must be the same. Ports and timers are left alone.
"""

from __future__ import annotations

import argparse
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from servogen.pic.image import Image, to_hex
from servogen.pic.isa import INSTRUCTIONS, decode, encode
from servogen.simulator import Machine
from tests.simulator.helpers import CLOCK

PROGRAM = shutil.which("simulpic")
STEPS = 300
SECONDS = 20
RAM = (0x0C, 0x0D, 0x20, 0x4F)
CYCLE_MS = 0.0004
"""At 10 MHz, with which simulpic begins."""
LEFT_OUT = ("CLRWDT", "SLEEP", "RETFIE", "RETURN", "RETLW", "CALL", "GOTO", "DECFSZ", "INCFSZ")
"""At random. Calls and jumps have pieces of their own; DECFSZ and INCFSZ change Z in simulpic, contrary to
DS35007 table 7-2 and to every other witness.
"""

Row = tuple[int, int, int, int, int, int]
"""Cycle, address, W, STATUS, FSR, PCLATH, before an instruction."""

BLOCK = re.compile(
    r"Executing: ([0-9A-F]{4}):[0-9A-F]{4}.*\n"
    r"STATUS ([0-9A-F]{2})\s+W\s+([0-9A-F]{2})\s+PCLATH ([0-9A-F]{2}).*\n"
    r"OPTION [0-9A-F]{2}\s+FSR ([0-9A-F]{2}).*\n\s*([0-9.]+) ms>"
)


def image(seed: int) -> Image:
    """A program of 100 words that runs round: arithmetic, skips, pointers, calls and jumps."""
    rng = random.Random(seed)
    words = [encode("GOTO", k=4), encode("RETLW", k=rng.randrange(256)), encode("RETURN"), encode("NOP")]
    names = [row for row in INSTRUCTIONS if row.mnemonic not in LEFT_OUT]
    while len(words) < 100:
        kind = rng.random()
        if kind < 0.1:
            words.append(encode("CALL", k=rng.choice((1, 2))))
        elif kind < 0.2:
            words.append(encode("GOTO", k=len(words) + rng.choice((1, 2))))
        elif kind < 0.3:
            words += [encode("NOP"), encode("MOVLW", k=rng.choice(RAM)), encode("MOVWF", f=4)]
            words.append(encode(rng.choice(("INCF", "ADDWF", "MOVF", "RRF")), f=0, d=rng.randrange(2)))
        else:
            row = rng.choice(names)
            fields = {
                "f": rng.choice(RAM),
                "d": rng.randrange(2),
                "b": rng.randrange(8),
                "k": rng.randrange(256),
            }
            words.append(encode(row.mnemonic, **{name: fields[name] for name in row.operands}))
    return Image(dict(enumerate([*words[:102], encode("NOP"), encode("NOP"), encode("GOTO", k=4)])), 0x3FF1)


def ours(program: Image) -> list[Row]:
    machine, found = Machine(program, CLOCK), []
    while machine.cycles < STEPS:
        state = machine.state()
        fsr, pclath = state.registers["FSR"], state.registers["PCLATH"]
        found.append((int(machine.cycles), state.pc, state.w, state.status, fsr, pclath))
        machine.step()
    return found


def theirs(program: Image) -> list[Row]:
    assert PROGRAM is not None
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "a.hex").write_text(to_hex(program))
        script = "l a.hex\n" + "s 1\n" * (STEPS + 1) + "q\n"
        done = subprocess.run(
            [PROGRAM], input=script, capture_output=True, text=True, timeout=SECONDS, cwd=folder, check=False
        )
    found = []
    for address, status, w, pclath, fsr, ms in BLOCK.findall(done.stdout):
        cycle = round(float(ms) / CYCLE_MS) - 1
        found.append((cycle, *(int(text, 16) for text in (address, w, status, fsr, pclath))))
    return [row for row in found if row[0] < STEPS]  # type: ignore[misc]


def difference(program: Image) -> str:
    """The first row that differs, or nothing."""
    here, there = ours(program), theirs(program)
    if len(there) < STEPS // 3:
        return f"simulpic printed {len(there)} instructions"
    for mine, other in zip(here, there, strict=False):
        if mine != other:
            row = decode(program.program[here[max(0, here.index(mine) - 1)][1]])
            return f"{mine} here, {other} there, after {row.instruction.mnemonic if row else '?'}"
    return "" if len(here) == len(there) else f"{len(here)} instructions here, {len(there)} there"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    if PROGRAM is None:
        print("simulpic is not installed", file=sys.stderr)
        return 3
    counts: Counter[str] = Counter()
    instructions = 0
    for seed in range(asked.seed, asked.seed + asked.programs):
        program = image(seed)
        found = difference(program)
        instructions += len(ours(program))
        counts["different" if found else "the same"] += 1
        if found:
            print(f"seed {seed}: {found}")
    print(f"{asked.programs} programs, {instructions} instructions: {dict(counts)}")
    return int(counts["different"] > 0)


if __name__ == "__main__":
    sys.exit(main())
