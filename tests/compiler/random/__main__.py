"""python -m tests.compiler.random: random programs, compiled by gcc and by servogen, run, and compared."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from dataclasses import replace

from tests.compiler.random.compare import Outcome, compare
from tests.compiler.random.generate import generate
from tests.compiler.random.program import LEVELS, Program
from tests.compiler.random.shrink import shrink
from tests.compiler.random.target_c import TargetC


def report(program: Program, outcome: Outcome, *, cut: bool) -> str:
    """A failure with the seed, the smallest program that shows it, and both results."""
    if cut:
        program, outcome = shrink(program, outcome)
    head = f"seed {program.seed} {program.dialect} {program.level}: {outcome.kind}"
    both = f"gcc {outcome.expected}, chip {outcome.got}"
    return f"{head}; {both} {outcome.message}\n{TargetC(program).text()}"


def made(seed: int, level: str | None) -> Program:
    """The program of a seed: dialects in turn, and levels where none is asked for."""
    program = generate(seed // 2, ("xc8", "c2c")[seed % 2])
    return replace(program, level=level or LEVELS[seed // 2 % len(LEVELS)])


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.compiler.random", description=__doc__)
    parser.add_argument(
        "--seeds", type=int, default=1000, help="how many programs, half of them of each dialect"
    )
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--batch", type=int, default=200, help="programs in a call of gcc")
    parser.add_argument(
        "--level", choices=LEVELS, help="only this level of optimisation, instead of all in turn"
    )
    parser.add_argument(
        "--whole", action="store_true", help="print failing programs as they are, without shrinking"
    )
    parser.add_argument("--failures", type=int, default=5, help="stop after so many")
    arguments = parser.parse_args()
    kinds: Counter[str] = Counter()
    started, failures = time.monotonic(), 0
    for first in range(arguments.first, arguments.first + arguments.seeds, arguments.batch):
        last = min(first + arguments.batch, arguments.first + arguments.seeds)
        programs = [made(seed, arguments.level) for seed in range(first, last)]
        for program, outcome in zip(programs, compare(programs), strict=True):
            kinds[outcome.kind] += 1
            if outcome.bad:
                failures += 1
                print(report(program, outcome, cut=not arguments.whole), flush=True)
                if failures >= arguments.failures:
                    break
        seconds = time.monotonic() - started
        print(f"{last - arguments.first} programs, {seconds:.0f} s: {dict(kinds)}", flush=True)
        if failures >= arguments.failures:
            break
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
