"""python -m tests.prove.stream_attack --mutants 60: faults of a stream's interrupt that only a line shows.

A mutant is a stream job's program with one changed bit in a word of its interrupt. A plain run with a random
line (commands, torn and broken frames, noise) must show an edge that is not where the engine's edges are: a
pulse that does not begin at its slot's cycle, a pulse whose length is no servo's, or another pin that moves.
A run with an idle line must not show it. Then the theorem about every line must refuse the program.
"""

from __future__ import annotations

import argparse
import random
import sys
from dataclasses import replace

from servogen.edges import PINS
from servogen.engines.board import board_of
from servogen.engines.stream.engine import compiled
from servogen.engines.stream.protocol import MAX_TRIM
from servogen.engines.stream.theorem import InterruptChanged, guarantee
from servogen.job import load, plan_job
from servogen.pic.device import INTERRUPT_VECTOR
from servogen.pic.image import Image
from servogen.pic.listing import Listing
from servogen.pic.wcet import Program
from servogen.simulator import Machine, Stimuli
from tests.engines.stream.stream_line import Line, talk
from tests.engines.stream.stream_soak import JOBS, Firmware, firmware_of, line_of

SECONDS = 6


def changed(listing: Listing, at: int, word: int) -> Listing:
    """The listing with another word at an address."""
    rows = tuple(replace(row, word=word) if row.address == at else row for row in listing.rows)
    return replace(listing, rows=rows)


def fault(made: Firmware, image: Image, line: Line | None) -> str:
    """The first edge of a plain run that is none of the engine's; empty if there is none."""
    plan = made.streamed.plan.schedule
    machine = Machine(image, plan.clock, board_of(plan), Stimuli([line] if line else []))
    slot = made.streamed.layout.rounds * 256
    pins = {PINS.index(channel.pin): n for n, channel in enumerate(plan.channels)}
    out = made.streamed.stream.transmit_pin
    high: dict[int, int] = {}
    end = int(SECONDS * plan.clock.cycles_per_second)
    for chunk in machine.stream(end):
        for cycle, pin, level in zip(
            chunk.cycle.tolist(), chunk.pin.tolist(), chunk.level.tolist(), strict=True
        ):
            if cycle < made.first_rise or (out and pin == PINS.index(out)):
                continue
            if pin not in pins:
                return f"cycle {cycle}: {PINS[pin]} moves"
            number = (cycle - made.first_rise) // slot % made.streamed.layout.slots
            if level == 1:
                if (cycle - made.first_rise) % slot or number != pins[pin]:
                    return f"cycle {cycle}: {PINS[pin]} rises"
                high[pin] = cycle
            elif pin in high:
                travel, width = made.streamed.travels[pins[pin]], cycle - high.pop(pin)
                if not travel.minimum - MAX_TRIM - 1 <= width <= travel.maximum + MAX_TRIM:
                    return f"cycle {cycle}: a pulse of {width} cycles at {PINS[pin]}"
    return ""


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
        made, listing, words, line = prepared(name, args.seed)
        at = dice.choice(words)
        word = made.image.program[at] ^ (1 << dice.randrange(14))
        image = replace(made.image, program={**made.image.program, at: word})
        why = fault(made, image, line)
        if not why:
            continue
        if fault(made, image, None):
            quiet += 1
            continue
        shown += 1
        try:
            guarantee(changed(listing, at, word), made.streamed)
            bad.append(f"{name}: 0x{at:03X} = 0x{word:04X}: {why}")
        except InterruptChanged:
            refused += 1
    print(
        f"{tried} mutants, {quiet} with a fault that an idle line shows, "
        f"{shown} with a fault that only a line shows: {refused} refused, {len(bad)} proven"
    )
    print("\n".join(bad))
    return 1 if bad else 0


_PREPARED: dict[tuple[str, int], tuple[Firmware, Listing, list[int], Line]] = {}


def prepared(name: str, seed: int) -> tuple[Firmware, Listing, list[int], Line]:
    """A job's program, its listing, the addresses of its interrupt, and a random line."""
    if (name, seed) not in _PREPARED:
        job = plan_job(load(JOBS / f"{name}.toml"))
        made = firmware_of(job)
        listing = compiled(job, made.streamed, "c2c").compilation.listing
        program = Program({row.address: row.word for row in listing.rows}, ())
        line = line_of(made, seed)
        while line.now < SECONDS * made.job.clock.cycles_per_second:
            talk(line, 1)
            line.noise(line.dice.random() / 20)
        _PREPARED[name, seed] = made, listing, sorted(program.reached(INTERRUPT_VECTOR)), line
    return _PREPARED[name, seed]


if __name__ == "__main__":
    sys.exit(main())
