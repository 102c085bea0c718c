"""Equal runs of instructions, anywhere in the program, made one subroutine where that saves words.

In: the code of every function, with banks switched and delays still whole. Out: the same in fewer words.
Each place takes four cycles more (two where the run ends its function), and a level of the stack where the
run does not end it.

Never shared: assembly, tables, the library; what stands in one run with a delay, or next to it, so that
pulses keep their width; what names variables of its own function, whose places depend on where they are used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from servogen.compiler.emitter import Code
from servogen.compiler.machine import DELAY, ENDS, LABEL, SKIPS, Byte, Ins
from servogen.compiler.stack import room_for_calls
from servogen.compiler.tails import is_timed
from servogen.compiler.tree import AddressByte, Symbol

_LONGEST = 40
_Run = tuple[int, ...]
_Place = tuple[str, int]
"""Function and index of a run's first instruction."""


@dataclass(frozen=True, slots=True)
class _Candidate:
    run: _Run
    places: tuple[_Place, ...]
    saved: int


def share(codes: dict[str, Code], roots: list[str]) -> int:
    """Make subroutines as long as one saves words; gives how many words were saved."""
    saved = 0
    refused: set[_Run] = set()
    while True:
        numbers: dict[object, int] = {}
        best = _best(_runs(codes, numbers), refused)
        if best is None:
            return saved
        if _apply(best, codes, roots):
            saved += best.saved
            refused.clear()
        else:
            refused.add(best.run)


def _best(runs: Mapping[_Run, list[tuple[_Place, bool]]], refused: set[_Run]) -> _Candidate | None:
    """The run that saves most; of equal ones the longest, then the first."""
    found: _Candidate | None = None
    for run, every in runs.items():
        if len(every) < 2 or run in refused:
            continue
        places: list[_Place] = []
        for (name, at), _ in every:
            if not places or places[-1][0] != name or at >= places[-1][1] + len(run):
                places.append((name, at))
        ends = every[0][1]
        saved = len(places) * (len(run) - 1) - len(run) - (0 if ends else 1)
        if saved > 0 and (found is None or (saved, len(run)) > (found.saved, len(found.run))):
            found = _Candidate(run, tuple(places), saved)
    return found


def _runs(codes: Mapping[str, Code], numbers: dict[object, int]) -> dict[_Run, list[tuple[_Place, bool]]]:
    """Return every run that may be shared, with its places and whether it needs no RETURN behind it; equal
    instructions have one number.
    """
    found: dict[_Run, list[tuple[_Place, bool]]] = {}
    for name, code in codes.items():
        if code.table is not None or code.inline_asm or name.startswith("__"):
            continue
        for first, last in _stretches(code):
            keys = [numbers.setdefault(_key(each), len(numbers)) for each in code.ins[first:last]]
            for start in range(first, last - 1):
                if start and code.ins[start - 1].op in SKIPS:
                    continue
                for end in range(start + 2, min(last, start + _LONGEST) + 1):
                    if code.ins[end - 1].op in SKIPS:
                        continue
                    run = tuple(keys[start - first : end - first])
                    ends = code.ins[end - 1].op in ENDS or _ends_in_call(code.ins[start:end])
                    found.setdefault(run, []).append(((name, start), ends))
    return found


def _stretches(code: Code) -> Iterator[tuple[int, int]]:
    """The parts of a function that can be moved: (first, behind last), without what a delay times."""
    labels = {ins.target for ins in code.ins if ins.op == LABEL}
    own = set(code.own)
    cuts: list[tuple[int, int, bool]] = []
    """Between labels and jumps: (first, behind last, whether a delay is in it)."""
    first = 0
    for at, ins in enumerate(code.ins):
        leaves = ins.op in ENDS and not (at and code.ins[at - 1].op in SKIPS)
        if ins.op == LABEL or leaves or at + 1 == len(code.ins):
            timed = any(is_timed(each) for each in code.ins[first : at + 1])
            cuts.append((first, at + 1, timed))
            first = at + 1
    for number, (first, behind, _) in enumerate(cuts):
        if any(timed for _, _, timed in cuts[max(0, number - 1) : number + 2]):
            continue
        start = first
        for at in range(first, behind):
            if not _movable(code.ins, at, labels, own):
                yield start, at
                start = at + 1
        yield start, behind


def _movable(ins: list[Ins], at: int, labels: set[str], own: set[Symbol]) -> bool:
    """Whether an instruction does the same in a subroutine."""
    each = ins[at]
    shadow = at > 0 and ins[at - 1].op in SKIPS
    if each.fixed or each.op in (LABEL, DELAY, "ORG", "RETFIE") or (each.op in ENDS and shadow):
        return False
    if each.op == "GOTO" and each.target in labels:
        return False
    if isinstance(each.f, Byte) and each.f.symbol in own:
        return False
    return not (isinstance(each.k, AddressByte) and each.k.symbol in own)


def _key(ins: Ins) -> object:
    return ins.op, ins.f, ins.d, ins.b, ins.k, ins.target


def _ends_in_call(run: list[Ins]) -> bool:
    """Return whether a run always ends in a call, which may be a jump: one that is never skipped."""
    last = run[-1]
    return last.op == "CALL" and last.table is None and run[-2].op not in SKIPS


def _apply(found: _Candidate, codes: dict[str, Code], roots: list[str]) -> bool:
    """Make the subroutine; false, and nothing changed, where the stack has no level for it."""
    before = {name: codes[name].ins for name, _ in found.places}
    room = room_for_calls(codes, roots)
    first_name, at = found.places[0]
    body = [each.copy() for each in codes[first_name].ins[at : at + len(found.run)]]
    ends = body[-1].op in ENDS
    if _ends_in_call(body):
        body[-1].op = "GOTO"
    elif not ends:
        body.append(Ins("RETURN", place=body[-1].place))
    name = f"__shared_{1 + sum(each.startswith('__shared_') for each in codes)}"
    for function in before:
        codes[function].ins = _replaced(codes[function], found, name, "GOTO" if ends else "CALL")
    codes[name] = Code(name, body)
    after = room_for_calls(codes, roots)
    if after is None or any(
        (room or {}).get(each) and not fits and _has_delay(codes[each]) for each, fits in after.items()
    ):
        del codes[name]
        for function, ins in before.items():
            codes[function].ins = ins
        return False
    return True


def _has_delay(code: Code) -> bool:
    return any(each.op == DELAY for each in code.ins)


def _replaced(code: Code, found: _Candidate, name: str, op: str) -> list[Ins]:
    """The function's instructions with a call in the place of each run."""
    out: list[Ins] = []
    done = 0
    for function, at in found.places:
        if function == code.name:
            out += [*code.ins[done:at], Ins(op, target=name, place=code.ins[at].place)]
            done = at + len(found.run)
    return out + code.ins[done:]
