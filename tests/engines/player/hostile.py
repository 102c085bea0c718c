"""A hostile back end: a compiler's output for a player with twelve servos, made slower wherever it may be.

Delays, moves through registers, switches of the bank, calls of empty functions and saved flags are inserted
at random places of the C, everywhere outside the kernel. Each place becomes a GOTO to free memory, where the
insertion and the word that was there stand. Variables are declared in a random order, and compiled for a
random dialect and level of optimisation.

The theorem (docs/firmware.md): with at most N cycles of C between slots every edge is the same; with at most
N' the edges are the same, or `overrun` is set.

    python -m tests.engines.player.hostile --builds 10000 [--seed N]
"""

from __future__ import annotations

import argparse
import random
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.edges import HIGH, EdgeChunk, join
from servogen.engines.board import machine_of
from servogen.engines.player.engine import play
from servogen.engines.player.firmware import CHECK, DONE, compiled
from servogen.engines.player.theorem import KERNEL, Allowance, allowances
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.pic.device import PROGRAM_WORDS, RAM_FIRST, RAM_LAST
from servogen.pic.image import Image
from servogen.pic.isa import decode, encode
from tests.engines.player.player_jobs import job_text, sweep

JOB = job_text(12, sweep(12, 0.16), firmware="soft_start_s = 0.08")
FRAMES = 24
DIALECTS, LEVELS, ORDERS = ("c2c", "xc8", "sdcc"), ("none", "speed", "size"), 3
STATUS, RP0 = 3, 5
AFTER_DONE = 4
"""The kernel's words from `pl_done` on, which nothing may part: CLRWDT, MOVLW 3, SUBWF; then its return."""


@dataclass(frozen=True)
class Base:
    """One compiler's output, as it is."""

    compilation: Compilation
    slots: Allowance
    frames: Allowance
    edges: EdgeChunk

    @property
    def image(self) -> Image:
        return self.compilation.image

    def address(self, variable: str) -> int:
        return next(at for at, name, _ in self.compilation.listing.variables if name == variable)


@cache
def played_by() -> tuple[object, object]:
    job = plan_job(loads(JOB, "hostile.toml"))
    return job, play(job)[1]


@cache
def _text(dialect: str) -> str:
    job, played = played_by()
    return compiled(job, played, dialect).text  # type: ignore[arg-type]


@cache
def base(dialect: str, level: str, order: int) -> Base | None:
    """Return the program with its declarations in an order, and its edges; None where it does not fit."""
    job, played = played_by()
    text = _reordered(_text(dialect), random.Random(order))
    options = Options(dialect=dialect, device=job.device, optimise=level)  # type: ignore[attr-defined]
    try:
        made = compile_sources([Source(text, f"main.{dialect}.c")], options)
    except InputError:  # too many words at that level
        return None
    slots, frames = allowances(made.listing, played.layout)  # type: ignore[attr-defined]
    found = Base(made, slots, frames, join([]))
    return replace(found, edges=run(found, made.image)[0])


def _reordered(text: str, rng: random.Random) -> str:
    """Return C with each declaration's variables in a random order, which moves them in RAM."""

    def shuffled(match: re.Match[str]) -> str:
        names = match[1].split(", ")
        rng.shuffle(names)
        return f"unsigned char {', '.join(names)};"

    return re.sub(r"^unsigned char ([\w, \[\]]+);", shuffled, text, flags=re.M)


def run(base: Base, image: Image) -> tuple[EdgeChunk, bool, int, int]:
    """Return the edges from the first one on, whether `overrun` is set, and the most cycles that the C took
    between two slots and between two frames.
    """
    _, played = played_by()
    schedule, slots = played.plan.schedule, len(played.layout.slots)  # type: ignore[attr-defined]
    machine = machine_of(schedule, image)
    listing = base.compilation.listing
    check, done = listing.label(CHECK), listing.label(DONE)
    machine.breakpoints = {check, done}
    chunks, since, number = [], None, 0
    longest = [0, 0]
    while number < FRAMES * slots:
        chunks.append(machine.run(400_000))
        if machine.pc == done:
            since, number = machine.cycles, number + 1
        elif machine.pc == check and since is not None:
            kind = int(number % slots == 0)
            longest[kind] = max(longest[kind], machine.cycles - since)
        elif machine.pc not in (check, done):
            break
    overrun = bool(machine.state().ram[base.address("overrun") - RAM_FIRST] & 1)
    return _from_first(join(chunks)), overrun, longest[0], longest[1]


def _from_first(edges: EdgeChunk) -> EdgeChunk:
    """Return the edges from the first rise on, in cycles from it."""
    high = np.flatnonzero(edges.level == HIGH)
    if not len(high):
        return join([])
    rest = EdgeChunk(*(column[high[0] :] for column in edges))
    return rest._replace(cycle=rest.cycle - rest.cycle[0])


def same(one: EdgeChunk, other: EdgeChunk) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


class HostileBackEnd:
    """Inserts code into one program."""

    def __init__(self, base: Base, rng: random.Random) -> None:
        self._rng = rng
        self._words = dict(base.image.program)
        listing = base.compilation.listing
        kernel = next(each for each in listing.functions if each.name == KERNEL)
        self._kernel = range(kernel.start, listing.label(DONE) + AFTER_DONE)
        used = {at + offset for at, _, size in listing.variables for offset in range(size)}
        free = [at for at in range(RAM_FIRST, RAM_LAST + 1) if at not in used]
        self._bytes = rng.sample(free, 3)
        self._free = max(self._words) + 1
        self._image = base.image
        self._put([encode("RETURN")])
        self._stub = self._free - 1
        self._places = self._possible_places()

    def _possible_places(self) -> list[int]:
        """Return the words that may move: no table, none in bank 1, none of the kernel but its first."""
        found, bank_1 = [], False
        for at, number in sorted(self._words.items()):
            word = decode(number)
            assert word is not None
            name = word.instruction.mnemonic
            if name in ("BSF", "BCF") and (word.f, word.b) == (STATUS, RP0):
                bank_1 = name == "BSF"
                continue
            in_kernel = at in self._kernel and at != self._kernel.start
            if not (bank_1 or in_kernel or at == self._stub or word.instruction.flow == "return"):
                found.append(at)
        return [at for at in found if not self._writes_pcl(at)]

    def _writes_pcl(self, at: int) -> bool:
        word = decode(self._words[at])
        assert word is not None
        return word.f == 2 and "f" in word.instruction.operands

    def _put(self, words: Iterable[int]) -> None:
        for word in words:
            self._words[self._free] = word
            self._free += 1

    def insert(self, longest_delay: int) -> bool:
        """Insert at one random place; return whether there was room."""
        at = self._rng.choice(self._places)
        moved = self._words[at]
        word = decode(moved)
        assert word is not None
        before = self._free
        filler = self._filler(longest_delay)
        if self._free + len(filler) + 3 > PROGRAM_WORDS:
            return False
        self._places.remove(at)
        self._words[at] = encode("GOTO", k=before)
        self._put([*filler, moved])
        if word.instruction.flow != "jump":
            self._put([encode("GOTO", k=at + 1)])
        if word.instruction.skips:
            self._put([encode("GOTO", k=at + 2)])
        return True

    def _filler(self, longest_delay: int) -> list[int]:
        """Return words that leave every register and flag as it is."""
        w, counter, status = self._bytes
        to_w = [encode("MOVWF", f=w)]
        from_w = [encode("SWAPF", f=w, d=1), encode("SWAPF", f=w, d=0)]
        kind = self._rng.randrange(6)
        if kind == 0:
            return [encode("NOP")] * self._rng.randint(1, 5)
        if kind == 1:  # bank 1 and back, with a byte of RAM that is in both
            bank = [encode(name, f=STATUS, b=RP0) for name in ("BSF", "BCF")]
            return [*to_w, bank[0], encode("CLRWDT"), bank[1], *from_w]
        if kind == 2:
            return [encode("CALL", k=self._stub)] * self._rng.randint(1, 2)
        if kind == 3:  # flags saved, destroyed and restored
            lost = [encode("CLRF", f=counter), encode("INCF", f=counter, d=1), encode("RLF", f=counter, d=1)]
            saved = [encode("SWAPF", f=STATUS, d=0), encode("MOVWF", f=status)]
            restored = [encode("SWAPF", f=status, d=0), encode("MOVWF", f=STATUS)]
            return [*to_w, *saved, *lost, *restored, *from_w]
        if kind == 4:
            return [*to_w, *from_w] * self._rng.randint(1, 3)
        turns = self._rng.randint(1, max(1, min(255, longest_delay // 3)))
        loop = self._free + 3
        delay = [encode("MOVLW", k=turns), encode("MOVWF", f=counter)]
        return [*to_w, *delay, encode("DECFSZ", f=counter, d=1), encode("GOTO", k=loop), *from_w]

    def image(self) -> Image:
        return replace(self._image, program=self._words)


def hostile(seed: int) -> tuple[Base, Image]:
    """Return the base of a hostile build and its program."""
    rng = random.Random(seed)
    found = None
    while found is None:
        found = base(rng.choice(DIALECTS), rng.choice(LEVELS), rng.randrange(ORDERS))
    back_end = HostileBackEnd(found, rng)
    delay = rng.choice((3, 30, 100, 300, 700))
    for _ in range(rng.choice((1, 3, 10, 30))):
        back_end.insert(delay)
    return found, back_end.image()


def outcome(seed: int) -> str:
    """Return what a hostile build does: "exact", "exact, overrun", "overrun", "beyond N'" or a fault."""
    found, image = hostile(seed)
    edges, overrun, slots, frames = run(found, image)
    exact = same(edges, found.edges)
    if slots > found.slots.late_is_seen or frames > found.frames.late_is_seen:
        return "beyond N'"
    in_time = slots <= found.slots.same_edges and frames <= found.frames.same_edges
    if in_time:
        return "exact" if exact and not overrun else "FAULT: in time, and not exact"
    if exact:
        return "later than N, exact, overrun" if overrun else "later than N, exact"
    return "overrun" if overrun else "SILENT"


def main() -> int:
    """Run as many hostile builds as asked for and print what they did."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--builds", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found: Counter[str] = Counter()
    seed, counted = options.seed, 0
    while counted < options.builds:
        result = outcome(seed)
        found[result] += 1
        counted += result != "beyond N'"
        if result.isupper() or result.startswith("FAULT"):
            print(f"seed {seed}: {result}")
        seed += 1
    for result, number in sorted(found.items()):
        print(f"{number:6} {result}")
    return int(any(result.isupper() or result.startswith("FAULT") for result in found))


if __name__ == "__main__":
    raise SystemExit(main())
