"""Merges code at the ends of paths: a call before a return becomes a jump, equal code before one label is
kept once.

In: a `Function` after the other passes. Out: fewer words, and no more cycles than before.
"""

from __future__ import annotations

from itertools import count, pairwise

from servogen.compiler.ir.function import Function, Line, is_skipped
from servogen.compiler.ir.instruction import DELAY, ENDS, Instruction, Label, Reg


def tail_calls(function: Function) -> bool:
    """Replace `CALL f; RETURN` with `GOTO f`, which saves a word, two cycles and a level of the stack; return
    whether something changed.
    """
    changed = False
    for one, two in pairwise(function.lines()):
        if isinstance(one, Label) or isinstance(two, Label) or one.fixed or two.fixed:
            continue
        if one.op == "CALL" and two.op == "RETURN" and one.table is None:
            one.op = "GOTO"
            changed = True
    if changed:
        function.rebuild()
    return changed


def merge_tails(function: Function) -> bool:
    """Merge one pair of equal instruction runs before jumps to the same label; return whether one was
    merged.
    """
    lines = list(function.lines())
    where = {line.name: index for index, line in enumerate(lines) if isinstance(line, Label)}
    jumps = {
        index: line
        for index, line in enumerate(lines)
        if isinstance(line, Instruction)
        and line.op == "GOTO"
        and not line.fixed
        and not is_skipped(lines, index)
    }
    # a merge invalidates these positions, so one call makes at most one
    for index, jump in jumps.items():
        target = where.get(jump.target)
        if target is None:
            continue
        rivals = [place for place, rival in jumps.items() if place < index and rival.target == jump.target]
        # the code that falls into the label ends there too
        before = target
        while before and isinstance(lines[before - 1], Label):
            before -= 1
        for rival in [*rivals, before]:
            length = _common(lines, index, rival)
            if length and not _timed_run(lines, index - length, index):
                _merge(function, lines, jump, index, rival, length)
                return True
            # where one of the two must keep its distance from a delay, the other one jumps to it
            if length and rival in jumps and not _timed_run(lines, rival - length, rival):
                _merge(function, lines, jumps[rival], rival, index, length)
                return True
    return False


def _timed_run(lines: list[Line], first: int, last: int) -> bool:
    """Return whether a run of instructions accesses a register and a delay leads into it without a branch, so
    that its distance from the delay must not change.
    """
    run = [line for line in lines[first:last] if isinstance(line, Instruction)]
    if not any(isinstance(ins.f, Reg) or ins.op == "CALL" for ins in run):
        return False
    index = first
    while index:
        index -= 1
        line = lines[index]
        if isinstance(line, Label):
            continue
        if is_timed(line):
            return True
        if line.op in ENDS or line.skips:
            return False
    return False


def is_timed(ins: Instruction) -> bool:
    """Return whether an instruction is a delay, constant or through a library routine."""
    return ins.op == DELAY or ins.target.startswith("__delay")


def _common(lines: list[Line], first: int, second: int) -> int:
    """Return how many instructions before two places are the same; between the two stands a jump or a label,
    at which the run of the later one ends.
    """
    best = 0
    before = zip(reversed(range(first)), reversed(range(second)), strict=False)
    for length, (a, b) in enumerate(before, 1):
        if not _same(lines[a], lines[b]):
            break
        # a run that begins behind a skip would be separated from it
        if not is_skipped(lines, a) and not is_skipped(lines, b):
            best = length
    return best


def _same(first: Line, second: Line) -> bool:
    """Return whether two lines are the same instruction, and one that may be shared."""
    if isinstance(first, Label) or isinstance(second, Label) or first.fixed or second.fixed:
        return False
    return first.op != DELAY and first.op not in ENDS and first.key == second.key


def _merge(
    function: Function, lines: list[Line], jump: Instruction, index: int, rival: int, length: int
) -> None:
    """Remove the instructions before the jump at `at` and redirect it to the equal ones before `rival`."""
    used = {line.name for line in lines if isinstance(line, Label)}
    free = next(number for number in count() if f"{function.name}.tail{number}" not in used)
    name = f"{function.name}.tail{free}"
    label = Label(name, jump.place)
    jump.target = name
    start = rival - length
    if start < index:
        del lines[index - length : index]
        lines.insert(start, label)
    else:
        lines.insert(start, label)
        del lines[index - length : index]
    function.replace(lines)
