"""python -m tests.compiler.foreign FOLDER: compile, run and judge what others wrote."""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from tests.compiler.foreign.judge import Verdict, judge
from tests.compiler.foreign.suites import Program, programs


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.compiler.foreign", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the suite's C files lie, at any depth")
    parser.add_argument("--level", choices=("none", "speed", "size"), default="speed")
    parser.add_argument("--only", default="", help="only programs with this text in their names")
    parser.add_argument("--instances", type=int, default=64, help="at most so many programs of a template")
    parser.add_argument("--reasons", type=int, default=40, help="how many kinds of refusal to print")
    parser.add_argument("--verbose", action="store_true", help="print the verdict of each program")
    arguments = parser.parse_args(given)
    if not arguments.folder.is_dir():
        parser.error(f"{arguments.folder} is not a folder")
    kinds: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    started = time.monotonic()
    for program in programs(arguments.folder, arguments.instances):
        if arguments.only not in program.name:
            continue
        for name, verdict in verdicts(program, arguments.level):
            kinds[verdict.kind] += 1
            if verdict.kind == "refused":
                reasons["does not fit" if verdict.does_not_fit else shape(verdict.reason)] += 1
            if verdict.bad or arguments.verbose:
                print(f"{verdict.kind.upper()} {name}: {verdict.reason}", flush=True)
    for reason, count in reasons.most_common(arguments.reasons):
        print(f"{count:6} refused: {reason}")
    print(f"{kinds.total()} programs, {time.monotonic() - started:.0f} s: {dict(kinds)}")
    return int(any(Verdict(kind).bad for kind in kinds) or not kinds)


def verdicts(program: Program, level: str) -> list[tuple[str, Verdict]]:
    """Return the verdict of a program, or those of its parts where the chip is too small for all of them."""
    whole = judge(program, level)
    if whole.does_not_fit and program.alone:
        return [(each.name, judge(each, level)) for each in program.alone]
    return [(program.name, whole)]


def shape(reason: str) -> str:
    """Return a message without the names and numbers of its program."""
    return re.sub(r"\d+", "N", re.sub(r"'[^']*'", "'…'", reason.splitlines()[0]))


if __name__ == "__main__":
    sys.exit(main())
