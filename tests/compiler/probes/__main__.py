"""python -m tests.compiler.probes: small pieces of C, judged by gcc's preprocessor, avr-gcc and gcc."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter

from tests.compiler.probes.compare import compare


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.compiler.probes", description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="how many programs")
    parser.add_argument("--seed", type=int, default=0, help="the first program's")
    parser.add_argument("--batch", type=int, default=400, help="programs in a call of each judge")
    parser.add_argument("--failures", type=int, default=5, help="print so many; all are counted")
    parser.add_argument("--refusals", action="store_true", help="print the first refusal of each kind")
    arguments = parser.parse_args()
    kinds, codes, printed = Counter[str](), Counter[str](), 0
    started, end = time.monotonic(), arguments.seed + arguments.count
    for first in range(arguments.seed, end, arguments.batch):
        last = min(first + arguments.batch, end)
        for outcome in compare(range(first, last)):
            kinds[outcome.kind] += 1
            if outcome.kind == "refused":
                codes[outcome.code] += 1
                if arguments.refusals and codes[outcome.code] == 1:
                    print(f"seed {outcome.seed}: {outcome.code}: {outcome.message}\n{outcome.text}")
            elif outcome.bad and printed < arguments.failures:
                printed += 1
                print(f"seed {outcome.seed}: {outcome.kind}\n{outcome.text}\n{outcome.message}", flush=True)
        seconds = time.monotonic() - started
        print(
            f"{last - arguments.seed} programs, {seconds:.0f} s: {dict(kinds)}; refused: {dict(codes)}",
            flush=True,
        )
    return int(kinds["wrong"] + kinds["crash"] > 0)


if __name__ == "__main__":
    sys.exit(main())
