"""python -m tests.prove.stream_attack --mutants 60: faults of a stream program that only a line shows.

A mutant is a stream job's program with one changed bit in a word of its interrupt or of its C. A plain run
with a random line (commands, torn and broken frames, noise) must show an edge that the model of the chip does
not make: at another cycle, on another pin, or of a pulse with another width than was commanded. A run with an
idle line must not show it. Then `servogen prove --any-line` must not prove the program. If it prints a
counterexample, the command that it prints is executed, and the edges that `servogen simulate` then writes
must differ from those of the unchanged program in the same run, up to the cycle that is said to be wrong.

With --insert a mutant is the program's C with instructions put between two statements: they disturb for a
moment, and restore, what main and the interrupt share. Each is right by itself; only an interrupt in between
shows the fault, and a plain run may have none there. All of them must not be proven.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import random
import re
import shlex
import sys
from collections import Counter
from dataclasses import replace
from functools import cache
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from servogen.edges import PINS, join
from servogen.engines.firmware import ResourceError
from servogen.engines.stream.engine import stream
from servogen.engines.stream.firmware import firmware as compiled
from servogen.engines.stream.rendering import render_stream
from servogen.errors import InputError
from servogen.job import PlannedJob, load, plan_job
from servogen.pic.image import Image, read_hex, to_hex
from servogen.traces import read_edges
from servogen.units import Clock
from tests.engines.stream.stream_line import Line, talk
from tests.engines.stream.stream_soak import JOBS, Firmware, check, firmware, line_of
from tests.prove.attack import NOT_REPLAYED, REPLAYED, servogen

SECONDS = 6
SHARED = ("mask", "next_lo", "next_hi", "due", "rx_byte", "rx_left", "rx_bits", "rx_last", "command", "ticks")
"""Not `todo` and `value`: while a command is executed, interrupts only look whether there is one."""
MOMENTS = (
    *(f"    comf    _{name}, 1\n    comf    _{name}, 1" for name in SHARED),
    "    comf    PORTB, 1\n    comf    PORTB, 1",
    "    bsf     STATUS, 5\n    comf    TRISB, 1\n    comf    TRISB, 1\n    bcf     STATUS, 5",
    "    bcf     INTCON, 5\n    bsf     INTCON, 5",
    "    movlw   0x0B\n    movwf   FSR\n    bcf     INDF, 2",
    "    movlw   0x0B\n    movwf   FSR\n    bcf     INDF, 7\n    bsf     INDF, 7",
    "    movlw   0x06\n    movwf   FSR\n    comf    INDF, 1\n    comf    INDF, 1",
    "    movlw   0x81\n    movwf   FSR\n    comf    INDF, 1\n    comf    INDF, 1",
    "    movf    TMR0, 0\n    movwf   TMR0",
)
"""Instructions that disturb what is shared, for a moment."""


def fault(made: Firmware, image: Image, line: Line) -> bool:
    """Whether an edge of a plain run is not the model's."""
    return not check(replace(made, image=image), line).passed


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--dialect", default="c2c")
    parser.add_argument("--insert", action="store_true", help="put instructions into the C instead")
    parser.add_argument("jobs", nargs="*", default=["stream-arm", "stream-eight", "stream-fast"])
    args = parser.parse_args()
    dice = random.Random(args.seed)
    counts: Counter[str] = Counter()
    tried = quiet = 0
    while args.insert and counts.total() < args.mutants:
        name = args.jobs[counts.total() % len(args.jobs)]
        text, what = disturbed(render(name, args.dialect), dice)
        try:
            compiled(text, planned(name), args.dialect)
        except (InputError, ResourceError):
            continue  # it is no C, between `if` and `else`, or too large
        with TemporaryDirectory() as folder, contextlib.chdir(folder):
            answer, why, _ = asked(name, f"mutant.{args.dialect}.c", text)
        counts[answer] += 1
        print(f"{counts.total()}: {name}: {what}: {answer}: {why}", flush=True)
    while counts.total() < args.mutants:
        name = args.jobs[tried % len(args.jobs)]
        tried += 1
        made, line, idle = prepared(name, args.dialect, args.seed)
        at = dice.choice(sorted(made.image.program))
        word = made.image.program[at] ^ (1 << dice.randrange(14))
        image = replace(made.image, program={**made.image.program, at: word})
        if not fault(made, image, line):
            continue
        if fault(made, image, idle):
            quiet += 1
            continue
        answer, why = answered(name, made, image)
        counts[answer] += 1
        print(f"{counts.total()}: {name}: 0x{at:03X} = 0x{word:04X}: {answer}: {why}", flush=True)
    if not args.insert:
        print(
            f"{tried} mutants, {quiet} with a fault that an idle line shows; of those that only a line shows:"
        )
    print("\n".join(f"  {answer}: {count}" for answer, count in counts.most_common()))
    return int(any(answer.startswith("proven") or answer == NOT_REPLAYED for answer in counts))


@cache
def planned(name: str) -> PlannedJob:
    return plan_job(load(JOBS / f"{name}.toml"))


@cache
def render(name: str, dialect: str) -> str:
    """A job's C."""
    job = planned(name)
    return render_stream(stream(job)[1], dialect, job.device, job.name)


def disturbed(text: str, dice: random.Random) -> tuple[str, str]:
    """A program's C with instructions behind a statement of main's loop or of what it calls, and what they
    are.
    """
    # Before the request of a pulse is cleared, no interrupt takes what is prepared: nothing is wrong there.
    begin, prepares = text.index("void position(void)"), text.index("void begin_frame(void)")
    ends = [match.end() for match in re.finditer(r"^ {4,}[^;{}\n]*;(?= *$| *//| */\*)", text, re.MULTILINE)]
    inside = re.compile(r"(?:_asm|asm \{|#asm|__asm)[^}]*?(?:_endasm|\}|#endasm|__endasm)")
    assembly = [match.span() for match in inside.finditer(text)]
    loop = text.index("while (1)")
    fit = [
        end
        for end in ends
        if end > begin and not prepares < end < loop and not any(a < end < b for a, b in assembly)
    ]
    at, moment = dice.choice(fit), dice.choice(MOMENTS)
    line = text.count("\n", 0, at) + 1
    words = "; ".join(" ".join(word.split()) for word in moment.split("\n"))
    return f"{text[:at]}\nasm {{\n{moment}\n}}\n{text[at:]}", f"line {line}: {words}"


def asked(name: str, file: str, text: str) -> tuple[str, str, dict[str, Any]]:
    """The answer of `servogen prove` about a program for any line, its reason, and all that it says."""
    job, schedule = JOBS / f"{name}.toml", JOBS.parent / "firmware" / name / "schedule.json"
    Path(file).write_text(text)
    said = json.loads(servogen("prove", file, "--against", schedule, "--any-line", job, "--json"))
    return str(said["answer"]), str(said["reason"]), said


def answered(name: str, made: Firmware, image: Image) -> tuple[str, str]:
    """The answer of `servogen prove`, whose counterexample `servogen simulate` repeats, and the reason."""
    with TemporaryDirectory() as folder, contextlib.chdir(folder):
        answer, reason, said = asked(name, "mutant.hex", to_hex(image))
        shown = said["counterexample"]
        if shown is None:
            return answer, reason
        words = shlex.split(shown["command"])
        clock, out = made.job.clock, made.streamed.stream.transmit_pin
        wrong = edges_of(words, clock, out)
        kept = read_hex(Path(words[2]).read_text(), words[2]).image.eeprom
        Path(words[2]).write_text(to_hex(replace(made.image, eeprom=kept)))
        repeated = first_difference(wrong, edges_of(words, clock, out)) <= shown["cycle"]
        return REPLAYED if repeated else NOT_REPLAYED, f"{shown['message']} ({reason})"


Edges = list[tuple[int, int, int]]


def edges_of(words: list[str], clock: Clock, out: str | None) -> Edges:
    """The edges of the servos' pins that a `servogen simulate` command writes; `out` is the transmit pin."""
    servogen(*words[1:])
    chunk = join(read_edges(Path("counterexample.csv"), clock).chunks)
    edges = zip(*(column.tolist() for column in chunk), strict=True)
    return [edge for edge in edges if edge[2] in (0, 1) and PINS[edge[1]] != out]


def first_difference(some: Edges, others: Edges) -> int:
    """The first cycle in which there is an edge in one of two runs only."""
    for one, other in zip_longest(some, others):
        if one != other:
            return int(min(each[0] for each in (one, other) if each))
    return sys.maxsize


@cache
def prepared(name: str, dialect: str, seed: int) -> tuple[Firmware, Line, Line]:
    """A job's program, a random line, and an idle one."""
    made = firmware(name, dialect)
    line, idle = line_of(made, seed), line_of(made, seed)
    while line.now < SECONDS * made.job.clock.cycles_per_second:
        talk(line, 1)
        line.noise(line.dice.random() / 20)
    idle.now = line.now
    return made, line, idle


if __name__ == "__main__":
    sys.exit(main())
