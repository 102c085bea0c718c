"""python -m tests.prove.stream_attack --mutants 60: faults of a stream program that only a line shows.

A mutant is a stream job's program with one changed bit in a word of its interrupt or of its C. A plain run
with a random line (commands, torn and broken frames, noise) must show an edge that the model of the chip does
not make: at another cycle, on another pin, or of a pulse with another width than was commanded. A run with an
idle line must not show it. Then the proof for any line must refuse the program.
"""

from __future__ import annotations

import argparse
import random
import sys
from dataclasses import replace

from servogen.engines.stream.engine import compiled
from servogen.job import load, plan_job
from servogen.pic.image import Image
from servogen.pic.listing import Listing
from servogen.prove.stream.proof import prove_line
from tests.engines.stream.stream_line import Line, talk
from tests.engines.stream.stream_soak import JOBS, Firmware, check, firmware_of, line_of

SECONDS = 6


def fault(made: Firmware, image: Image, line: Line) -> bool:
    """Whether an edge of a plain run is not the model's."""
    return not check(replace(made, image=image), line).proven


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("jobs", nargs="*", default=["stream-arm", "stream-eight", "stream-fast"])
    args = parser.parse_args()
    dice = random.Random(args.seed)
    shown = refused = tried = quiet = 0
    bad = []
    while shown < args.mutants:
        name = args.jobs[tried % len(args.jobs)]
        tried += 1
        made, listing, line, idle = prepared(name, args.seed)
        at = dice.choice(listing.rows).address
        word = made.image.program[at] ^ (1 << dice.randrange(14))
        image = replace(made.image, program={**made.image.program, at: word})
        if not fault(made, image, line):
            continue
        if fault(made, image, idle):
            quiet += 1
            continue
        shown += 1
        proof = prove_line(image, listing, made.job, made.streamed, lambda text: None)
        print(f"{name}: 0x{at:03X} = 0x{word:04X}: {proof.reason or 'PROVEN'}", flush=True)
        refused += not proof.proven
        if proof.proven:
            bad.append(f"{name}: 0x{at:03X} = 0x{word:04X}")
    print(
        f"{tried} mutants, {quiet} with a fault that an idle line shows, "
        f"{shown} with a fault that only a line shows: {refused} refused, {len(bad)} proven"
    )
    print("\n".join(bad))
    return 1 if bad else 0


_PREPARED: dict[tuple[str, int], tuple[Firmware, Listing, Line, Line]] = {}


def prepared(name: str, seed: int) -> tuple[Firmware, Listing, Line, Line]:
    """A job's program, its listing, a random line, and an idle one."""
    if (name, seed) not in _PREPARED:
        job = plan_job(load(JOBS / f"{name}.toml"))
        made = firmware_of(job)
        listing = compiled(job, made.streamed, "c2c").compilation.listing
        line, idle = line_of(made, seed), line_of(made, seed)
        while line.now < SECONDS * made.job.clock.cycles_per_second:
            talk(line, 1)
            line.noise(line.dice.random() / 20)
        idle.now = line.now
        _PREPARED[name, seed] = made, listing, line, idle
    return _PREPARED[name, seed]


if __name__ == "__main__":
    sys.exit(main())
