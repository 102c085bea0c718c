"""python -m tests.compiler.fuzz: mutated sources. The compiler must answer each with a program or with
diagnostics.
"""

from __future__ import annotations

import argparse
import faulthandler
import signal
import sys
import time
import traceback
from collections import Counter
from pathlib import Path
from types import FrameType

from servogen.compiler import Options, Source, compile_sources
from servogen.errors import InputError
from tests.compiler.fuzz.mutate import Corpus

LIMIT_S = 10
LEVELS = ("speed", "size", "none")
"""Of optimisation: each source has one of them."""


class TooLong(Exception):
    """The compiler took longer than it may."""


def _late(_number: int, _frame: FrameType | None) -> None:
    raise TooLong


def verdict(text: str, dialect: str, level: str = "speed", *, limit: bool = True) -> tuple[str, str]:
    """("program" | "diagnostics" | "traceback" | "slow", what was said)."""
    if limit:
        signal.setitimer(signal.ITIMER_REAL, LIMIT_S)
    try:
        compile_sources(
            [Source(text, "fuzz.c")], Options(dialect=dialect, clock_hz=4_000_000, optimise=level)
        )
        return "program", ""
    except InputError as error:
        places = all(each.message for each in error.diagnostics)
        return (
            ("diagnostics", "")
            if places and error.diagnostics
            else ("traceback", "an error without a message")
        )
    except TooLong:
        return "slow", traceback.format_exc(limit=-3)
    except Exception:
        return "traceback", traceback.format_exc(limit=-3)
    finally:
        if limit:
            signal.setitimer(signal.ITIMER_REAL, 0)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.compiler.fuzz", description=__doc__)
    parser.add_argument("--sources", type=int, default=1000, help="how many mutated sources")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--keep", type=Path, help="write the sources that failed into this directory")
    arguments = parser.parse_args()
    faulthandler.enable()
    signal.signal(signal.SIGALRM, _late)
    corpus, kinds = Corpus.of_tests(), Counter[str]()
    causes: dict[str, tuple[int, str]] = {}
    started, slowest = time.monotonic(), 0.0
    for seed in range(arguments.first, arguments.first + arguments.sources):
        text, dialect = corpus.mutated(seed)
        before = time.monotonic()
        level = LEVELS[seed % len(LEVELS)]
        kind, said = verdict(text, dialect, level)
        slowest = max(slowest, time.monotonic() - before)
        kinds[kind] += 1
        if kind in ("traceback", "slow"):
            cause = "\n".join(said.strip().splitlines()[-3:])
            if cause not in causes:
                causes[cause] = (seed, said)
                print(f"seed {seed} {dialect} {level}: {kind}\n{said}", flush=True)
                if arguments.keep:
                    arguments.keep.mkdir(parents=True, exist_ok=True)
                    (arguments.keep / f"{seed}.{dialect}.c").write_text(text)
        if (seed + 1) % 1000 == 0:
            print(f"{seed + 1 - arguments.first} sources: {dict(kinds)}", flush=True)
    seconds = time.monotonic() - started
    print(f"{arguments.sources} sources, {seconds:.0f} s, slowest {slowest:.1f} s: {dict(kinds)}")
    return int(bool(causes))


if __name__ == "__main__":
    sys.exit(main())
