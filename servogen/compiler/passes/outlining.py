"""Moves equal runs of instructions, anywhere in the program, to one subroutine where that saves words.

In: the code of every function, with banks switched and delays not yet expanded. Out: the same in fewer words.
Each use takes four cycles more (two where the run ends its function), and a level of the stack unless the run
ends it.

Never shared: assembly, tables, the library; a run that contains a delay or is adjacent to one, so that pulses
keep their width; instructions that refer to variables of their own function, whose addresses depend on where
they are used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.compiler.ir.function import Function, Line, is_skipped
from servogen.compiler.ir.instruction import DELAY, ENDS, Byte, Instruction, Label
from servogen.compiler.passes.call_depth import room_for_calls
from servogen.compiler.passes.tail_merging import is_timed
from servogen.pic.device import PROGRAM_WORDS

_MAX_RUN = 40
_MAX_WORDS = 3 * PROGRAM_WORDS
"""A larger program does not fit the chip whatever is shared, and searching it takes long."""
_Run = tuple[int, ...]
_Place = tuple[str, int]
"""Function and line of a run's first instruction."""


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A run of instructions, the places where it stands, and the words that sharing it saves."""

    run: _Run
    places: tuple[_Place, ...]
    saved: int


def outline(functions: dict[str, Function], roots: list[str]) -> int:
    """Create subroutines as long as one saves words; return the number of words saved."""
    if sum(function.size for function in functions.values()) > _MAX_WORDS:
        return 0
    saved = 0
    refused: set[_Run] = set()
    while True:
        numbers: dict[object, int] = {}
        best = _best(_runs(functions, numbers), refused)
        if best is None:
            return saved
        if _apply(best, functions, roots):
            saved += best.saved
            # runs are numbered anew once the functions have changed
            refused.clear()
        else:
            refused.add(best.run)


def _best(runs: Mapping[_Run, list[tuple[_Place, bool]]], refused: set[_Run]) -> _Candidate | None:
    """Return the run that saves most; among equal ones the longest, then the first."""
    best: _Candidate | None = None
    for run, every in runs.items():
        if len(every) < 2 or run in refused:
            continue
        places: list[_Place] = []
        # overlapping occurrences within one function count once
        for (name, index), _ in every:
            if not places or places[-1][0] != name or index >= places[-1][1] + len(run):
                places.append((name, index))
        ends = every[0][1]
        # each place shrinks to one word; the subroutine takes the run and, unless that ends itself, a RETURN
        saved = len(places) * (len(run) - 1) - len(run) - (0 if ends else 1)
        if saved > 0 and (best is None or (saved, len(run)) > (best.saved, len(best.run))):
            best = _Candidate(run, tuple(places), saved)
    return best


def _runs(
    functions: Mapping[str, Function], numbers: dict[object, int]
) -> dict[_Run, list[tuple[_Place, bool]]]:
    """Return every run that may be shared, with its places and whether it needs no RETURN after it; equal
    instructions have the same number.
    """
    places: dict[_Run, list[tuple[_Place, bool]]] = {}
    for name, function in functions.items():
        if function.table is not None or function.inline_asm or name.startswith("__"):
            continue
        lines = list(function.lines())
        for first, stretch in _stretches(function, lines):
            keys = [numbers.setdefault(ins.key, len(numbers)) for ins in stretch]
            for start in range(len(stretch)):
                if is_skipped(lines, first + start):
                    continue
                for end in range(start + 2, min(len(stretch), start + _MAX_RUN) + 1):
                    # a skip at the end of a run would guard the RETURN
                    if not stretch[end - 1].skips:
                        run = tuple(keys[start:end])
                        ends = stretch[end - 1].op in ENDS or _ends_in_call(stretch[start:end])
                        places.setdefault(run, []).append(((name, first + start), ends))
    return places


def _stretches(function: Function, lines: list[Line]) -> Iterator[tuple[int, list[Instruction]]]:
    """Yield the parts of a function that can be moved, without those that a delay times, and the index where
    each begins.
    """
    labels = set(function.by_label())
    own = set(function.own)
    cuts: list[tuple[int, int, bool]] = []
    """Between labels and jumps: (first, behind last, whether a delay is in it)."""
    first = 0
    for index, line in enumerate(lines):
        leaves = isinstance(line, Instruction) and line.op in ENDS and not is_skipped(lines, index)
        if isinstance(line, Label) or leaves or index + 1 == len(lines):
            inside = [ins for ins in lines[first : index + 1] if isinstance(ins, Instruction)]
            cuts.append((first, index + 1, any(map(is_timed, inside))))
            first = index + 1
    for number, (first, behind, _) in enumerate(cuts):
        # moving a stretch next to a delay would change the time between pin changes
        if any(timed for _, _, timed in cuts[max(0, number - 1) : number + 2]):
            continue
        start, stretch = first, list[Instruction]()
        for index in range(first, behind):
            line = lines[index]
            if isinstance(line, Instruction) and _movable(
                line, labels, own, skipped=is_skipped(lines, index)
            ):
                stretch.append(line)
                continue
            yield start, stretch
            start, stretch = index + 1, []
        yield start, stretch


def _movable(ins: Instruction, labels: set[str], own: set[Symbol], *, skipped: bool) -> bool:
    """Return whether an instruction does the same in a subroutine."""
    if ins.fixed or ins.op in (DELAY, "RETFIE") or (ins.op in ENDS and skipped):
        return False
    if ins.op == "GOTO" and ins.target in labels:
        return False
    if isinstance(ins.f, Byte) and ins.f.symbol in own:
        return False
    return not (isinstance(ins.k, AddressByte) and ins.k.symbol in own)


def _ends_in_call(run: list[Instruction]) -> bool:
    """Return whether a run always ends in a call, which can become a jump; a call that may be skipped does
    not count.
    """
    last = run[-1]
    return last.op == "CALL" and last.table is None and not run[-2].skips


def _apply(shared: _Candidate, functions: dict[str, Function], roots: list[str]) -> bool:
    """Create the subroutine; return False, with nothing changed, if the stack has no level for it."""
    before = {name: list(functions[name].lines()) for name, _ in shared.places}
    room = room_for_calls(functions, roots)
    first_name, start = shared.places[0]
    run = before[first_name][start : start + len(shared.run)]
    body = [line.copy() for line in run if isinstance(line, Instruction)]
    ends = body[-1].op in ENDS
    if _ends_in_call(body):
        body[-1].op = "GOTO"
    elif not ends:
        body.append(Instruction("RETURN", place=body[-1].place))
    name = f"__shared_{1 + sum(existing.startswith('__shared_') for existing in functions)}"
    for user, lines in before.items():
        functions[user].replace(_replaced(user, lines, shared, name, "GOTO" if ends else "CALL"))
    functions[name] = Function(name)
    functions[name].extend(body)
    # functions with delays keep the level of the stack that shared delay routines need
    after = room_for_calls(functions, roots)
    if after is None or any(
        (room or {}).get(name) and not fits and _has_delay(functions[name]) for name, fits in after.items()
    ):
        del functions[name]
        for user, lines in before.items():
            functions[user].replace(lines)
        return False
    return True


def _has_delay(function: Function) -> bool:
    return any(ins.op == DELAY for ins in function.instructions())


def _replaced(user: str, lines: list[Line], shared: _Candidate, name: str, op: str) -> list[Line]:
    """Return a function's lines with a call in place of each run."""
    out: list[Line] = []
    copied = 0
    for function, start in shared.places:
        if function == user:
            out += [*lines[copied:start], Instruction(op, target=name, place=lines[start].place)]
            copied = start + len(shared.run)
    return out + lines[copied:]
