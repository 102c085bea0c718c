"""Delays of an exact number of cycles in as few words as these loops give.

In: a number of instruction cycles. Out: a `LoopNest`: nested loops and a filler, or the instructions of one.

    MOVLW c2      Two families of loops of the same size; the better is taken. With the inner counter in
    MOVWF t2      memory a pass takes 3 cycles (DECFSZ, GOTO), with the inner counter in W it takes 4
    MOVLW c1      (ADDLW, BTFSS, GOTO) and needs a byte less. After their first run the counters start at 0,
    MOVWF t1      which counts 256. With F the cycles of a whole inner loop, one more pass of the outer
 L: DECFSZ t1,F   one takes S = 3 + F.
    GOTO L
    DECFSZ t2,F   cycles = set-up + inner(c1) + (c2 - 1) S2 + 2 + (c3 - 1) S3 + 2 + ...
    GOTO L
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from servogen.compiler.ir.function import Line
from servogen.compiler.ir.instruction import STATUS, Instruction, Label, Loc, Z

MAX_LEVELS = 5


@dataclass(frozen=True, slots=True)
class LoopNest:
    """Loop counters, innermost first (none: no loop), whether the inner one counts in W, and the cycles left
    over.
    """

    counts: tuple[int, ...]
    in_w: bool
    rest: int

    @property
    def words(self) -> int:
        levels = len(self.counts)
        loops = 4 * levels if levels else 0  # each level: two words to set it up and two to count
        return loops + self.rest // 2 + self.rest % 2

    @property
    def bytes(self) -> int:
        """Return the number of counters in memory."""
        return max(len(self.counts) - self.in_w, 0)


@lru_cache(maxsize=4096)
def plan(cycles: int) -> LoopNest:
    """Return the plan of exactly `cycles` cycles with the fewest words and, among those, the fewest bytes."""
    plans = [LoopNest((), False, cycles)] if cycles <= 16 else []
    for levels in range(1, MAX_LEVELS + 1):
        for in_w in (True, False):
            loops = _loops(cycles, levels, in_w)
            if loops is not None:
                plans.append(loops)
        if plans and levels >= 2 and any(len(candidate.counts) < levels for candidate in plans):
            break
    return min(plans, key=lambda candidate: (candidate.words, candidate.bytes, candidate.rest))


def _loops(cycles: int, levels: int, in_w: bool) -> LoopNest | None:
    """Return nested loops of `levels` counters for a delay; None if it is too short, or leaves too many
    cycles over.
    """
    step = 4 if in_w else 3
    setup = 2 * levels - in_w
    full = step * 256 - 1
    steps = []
    for _ in range(levels - 1):
        steps.append(3 + full)
        full += 255 * (3 + full) + 2
    left = cycles - setup - 2 * (levels - 1) + 1  # what the inner counter's passes and the outer passes share
    if left < step:
        return None
    counts = []
    for outer in reversed(steps):
        more = min(255, (left - step) // outer)
        left -= more * outer
        counts.append(more + 1)
    inner = min(256, left // step)
    rest = left - inner * step
    if rest > 12:
        return None
    return LoopNest((inner, *reversed(counts)), in_w, rest)


def instructions(loops: LoopNest, counters: list[Loc], label: str) -> list[Line]:
    """Return the instructions of a plan; `counters` are its bytes, `label` names its loop."""
    out: list[Line] = []
    memory = list(counters)
    levels = len(loops.counts)
    places: list[Loc | None] = []
    for level in range(levels):
        places.append(None if level == 0 and loops.in_w else memory.pop(0))
    for level in reversed(range(levels)):
        out.append(Instruction("MOVLW", k=loops.counts[level] & 0xFF))
        place = places[level]
        if place is not None:
            out.append(Instruction("MOVWF", place))
    if levels:
        out.append(Label(label))
    for place in places:
        if place is None:
            out += [
                Instruction("ADDLW", k=0xFF),
                Instruction("BTFSS", STATUS, b=Z),
                Instruction("GOTO", target=label),
            ]
        else:
            out += [Instruction("DECFSZ", place, 1), Instruction("GOTO", target=label)]
    out += filler(loops.rest, label)
    for line in out:
        line.fixed = True
    return out


def filler(cycles: int, label: str) -> list[Line]:
    """Return instructions of `cycles` cycles: GOTOs to the next instruction, two cycles per word, and a NOP
    for an odd cycle.
    """
    out: list[Line] = []
    for number in range(cycles // 2):
        after = f"{label}.f{number}"
        out += [Instruction("GOTO", target=after), Label(after)]
    if cycles % 2:
        out.append(Instruction("NOP"))
    return out
