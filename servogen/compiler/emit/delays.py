"""Expands delays: each in place, or through routines where that saves words.

In: the code of every function, with each delay as one instruction. Out: the same code with the delays'
instructions.

Adjacent delays are merged. A delay that occurs often can be a routine of its own; delays of many lengths can
share a loop that takes its counters and is entered as many NOPs early as there are cycles left over. Where
many of them have the same outer counter, a routine sets it:

    MOVLW c1                   MOVLW c2; MOVWF t; MOVLW c1         MOVLW c1
    CALL  loop1 - rest         CALL  loop2 - rest                  CALL  turns2 - rest

                               turns2:  CLRF t; BSF t,1; GOTO loop2

Which of these is used is decided for all delays together, by the number of words.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from operator import itemgetter
from typing import NamedTuple

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.emit.delay_loops import instructions, plan
from servogen.compiler.ir.function import ISR_SUFFIX, Function, Line
from servogen.compiler.ir.instruction import DELAY, STATUS, Byte, Instruction, Label, Loc, Z

_CALL_AND_RETURN = 4
_GOTO = 2
_OUTER_TURN = 1026
_MAX_TURNS = 3
"""Outer counters, the most frequent ones, for which a routine that sets them is tried."""


class Entry(NamedTuple):
    """An entry into a shared loop: its counters, and the outer one's value where a routine sets it."""

    counters: int
    turns: int = 0

    @property
    def bits(self) -> list[int]:
        """Return the bits of the outer counter that a routine sets; 0 counts 256."""
        return [bit for bit in range(8) if self.turns >> bit & 1]

    def name(self, suffix: str) -> str:
        kind = f"turns{self.turns}" if self.turns else f"loop{self.counters}"
        return f"__delay_{kind}{suffix}"

    @property
    def words(self) -> int:
        """Return the words of the loop, or of the routine before it, without NOPs."""
        if self.turns:
            return 2 + len(self.bits)
        return 4 if self.counters == 1 else 6

    @property
    def site_words(self) -> int:
        """Return the words of each delay that uses this entry."""
        return 4 if self == _TWO else 2

    def fit(self, cycles: int) -> tuple[int, int, int] | None:
        """Return (inner counter, outer counter, cycles left over) of a delay; None if it does not reach."""
        # One counter: MOVLW, CALL and RETURN take 5 cycles, each turn 4, the last turn 3. Two counters add
        # MOVLW, MOVWF and the final DECFSZ; each further outer turn takes 256 inner turns and 3 cycles less
        # 1. The GOTO of a routine that sets the outer counter takes as long as MOVLW and MOVWF.
        left = cycles - (4 if self.counters == 1 else 8)
        outer = 0
        if self.turns:
            left -= 1 + len(self.bits)
            outer = self.turns - 1
        elif self.counters == 2:
            outer = min(255, max(0, (left - 4) // _OUTER_TURN))
        left -= _OUTER_TURN * outer
        inner = min(256, left // 4)
        rest = left - 4 * inner
        return (inner, outer + 1, rest) if inner >= 1 and rest <= 5 else None


_ONE, _TWO = Entry(1), Entry(2)


class _Route(NamedTuple):
    """How delays of one length are implemented: by a shared loop or not, in a routine of their own or not."""

    entry: Entry | None = None
    own: bool = False

    def inside(self, cycles: int) -> int:
        """Return the cycles that are left where the delay is implemented, in its routine or at its place."""
        if not self.own:
            return cycles
        return cycles - (_GOTO if self.entry else _CALL_AND_RETURN)

    def cost(self, cycles: int, times: int) -> tuple[int, int] | None:
        """Return (words, NOPs before the entry) of all delays of a length, without the entry's own words.

        None if it does not reach.
        """
        inside = self.inside(cycles)
        if self.entry is None:
            if inside < 0:
                return None
            words, nops = plan(inside).words + self.own, 0
        else:
            fitted = self.entry.fit(inside)
            if fitted is None:
                return None
            words, nops = self.entry.site_words, fitted[-1]
        return (times + words if self.own else times * words), nops


_IN_PLACE = _Route()

_Costs = dict[int, list[tuple[int, int, _Route]]]
"""(words, NOPs, route) of each route that can produce a delay, by its length, the shortest first."""


@dataclass(slots=True)
class _Choice:
    """How the delays of one call tree are implemented."""

    words: int = 0
    merged: bool = True
    routes: dict[int, _Route] = field(default_factory=dict)
    """By length; all others are expanded in place."""
    nops: dict[Entry, int] = field(default_factory=dict)
    """The entries that are used, and how many NOPs precede each."""


def expand_delays(
    functions: dict[str, Function], room_for_call: dict[str, bool], interrupt: set[str]
) -> None:
    """Replace each delay with its instructions.

    `room_for_call` tells, for each function, whether the stack has a level left for one more call from it.
    The functions that the `interrupt` reaches have delay routines of their own, because it may come in the
    middle of one of main's.
    """
    for isr in (False, True):
        suffix = ISR_SUFFIX if isr else ""
        group = [function for name, function in functions.items() if (name in interrupt) == isr]
        with_room = [function for function in group if room_for_call.get(function.name, False)]
        merged = Counter(cycles for function in with_room for cycles in _lengths(function, merged=True))
        single = Counter(cycles for function in with_room for cycles in _lengths(function, merged=False))
        options = []
        for kind, counts in ((True, merged), (False, single))[: 1 if merged == single else 2]:
            entries = _entries(counts)
            costs = _costs(counts, entries)
            options += [
                _choose(costs, used, merged=kind)
                for size in range(len(entries) + 1)
                for used in combinations(entries, size)
            ]
        best = min(options, key=lambda choice: choice.words)
        loops = _shared(best, suffix)
        for function in group:
            if function in with_room:
                _expand(function, best, loops, suffix, functions)
            else:
                _expand(function, _Choice(), {}, suffix, functions)
        functions.update({loop.name: loop for loop in loops.values()})


def _lengths(function: Function, *, merged: bool) -> list[int]:
    """Return the delays of a function, with neighbours merged or each by itself."""
    lengths: list[int] = []
    before = False
    for ins in function.lines():
        if isinstance(ins, Instruction) and ins.op == DELAY:
            assert isinstance(ins.k, int)
            if before and merged:
                lengths[-1] += ins.k
            else:
                lengths.append(ins.k)
        before = isinstance(ins, Instruction) and ins.op == DELAY
    return lengths


def _entries(counts: Counter[int]) -> list[Entry]:
    """Return the entries to try."""
    turns: Counter[int] = Counter()
    for cycles, times in counts.items():
        fitted = _TWO.fit(cycles)
        if fitted is not None:
            turns[fitted[1]] += times
    frequent = [Entry(2, count) for count, times in turns.most_common(_MAX_TURNS) if times > 1]
    return [_ONE, _TWO, *frequent] if counts else []


def _costs(counts: Counter[int], entries: Sequence[Entry]) -> _Costs:
    """Return what the delays of each length cost by each route that can produce them."""
    routes = [_Route(entry, own) for own in (True, False) for entry in (None, *entries)]
    return {
        cycles: sorted(
            [(*cost, route) for route in routes if (cost := route.cost(cycles, times)) is not None],
            key=itemgetter(0),
        )
        for cycles, times in counts.items()
    }


def _choose(costs: _Costs, used: Sequence[Entry], *, merged: bool) -> _Choice:
    """Return the cheapest implementation of each length, given these entries; `words` is the total."""
    choice = _Choice(merged=merged)
    allowed = {None, *used}
    for cycles, priced in costs.items():
        words, nops, route = next(row for row in priced if row[2].entry in allowed)
        choice.words += words
        if route != _IN_PLACE:
            choice.routes[cycles] = route
        if route.entry is not None:
            choice.nops[route.entry] = max(choice.nops.get(route.entry, 0), nops)
            if route.entry.turns:
                choice.nops.setdefault(_TWO, 0)
    choice.words += sum(entry.words + nops for entry, nops in choice.nops.items())
    return choice


def _shared(choice: _Choice, suffix: str) -> dict[Entry, Function]:
    """Return the loops that the delays share, and the routines before them, each preceded by its NOPs."""
    functions = {entry: Function(entry.name(suffix)) for entry in choice.nops}
    if _TWO in functions:
        functions[_TWO].own = [Symbol("count", U8, "param", function=functions[_TWO].name)]
    for entry, function in functions.items():
        name = function.name
        for rest in range(choice.nops[entry], 0, -1):
            function.extend([Label(f"{name}.{rest}"), Instruction("NOP")])
        function.append(Label(name))
        if entry.turns:
            count = Byte(functions[_TWO].own[0], 0)
            function.extend(
                [
                    Instruction("CLRF", count),
                    *(Instruction("BSF", count, b=bit) for bit in entry.bits),
                    Instruction("GOTO", target=functions[_TWO].name),
                ]
            )
        else:
            loop = f"{name}.loop"
            function.extend(
                [
                    Label(loop),
                    Instruction("ADDLW", k=0xFF),
                    Instruction("BTFSS", STATUS, b=Z),
                    Instruction("GOTO", target=loop),
                ]
            )
            if entry == _TWO:
                outer = [Instruction("DECFSZ", Byte(function.own[0], 0), 1), Instruction("GOTO", target=loop)]
                function.extend(outer)
            function.append(Instruction("RETURN"))
        for line in function.lines():
            line.fixed = True
    return functions


def _expand(
    function: Function,
    choice: _Choice,
    loops: dict[Entry, Function],
    suffix: str,
    functions: dict[str, Function],
) -> None:
    """Replace the delays of one function, those that follow one another together if the choice says so."""
    out: list[Line] = []
    number = 0
    lines = list(function.lines())
    while number < len(lines):
        first = lines[number]
        number += 1
        cycles = _cycles(first)
        if cycles is None:
            out.append(first)
            continue
        while choice.merged and number < len(lines) and (more := _cycles(lines[number])) is not None:
            cycles += more
            number += 1
        expansion = _implementation(
            function, cycles, choice, loops, suffix, functions, f"{function.name}.delay{number}"
        )
        for line in expansion:
            line.place = first.place
        inside = [line for line in expansion if isinstance(line, Instruction)]
        if len(inside) > 2:
            function.delays.append((inside[0], inside[-1]))
        out += expansion
    function.replace(out)


def _cycles(line: Line) -> int | None:
    """Return the length of a delay; None for any other line."""
    return line.k if isinstance(line, Instruction) and line.op == DELAY and isinstance(line.k, int) else None


def _implementation(
    function: Function,
    cycles: int,
    choice: _Choice,
    loops: dict[Entry, Function],
    suffix: str,
    functions: dict[str, Function],
    label: str,
) -> Sequence[Line]:
    """Return the instructions of one delay, and create the routine for its length if it has one."""
    route = choice.routes.get(cycles, _IN_PLACE)
    if route.own:
        name = f"__delay_{cycles}{suffix}"
        if name not in functions:
            functions[name] = _routine(name, route, cycles, loops)
        return [Instruction("CALL", target=name, fixed=True)]
    if route.entry is None:
        return _inline(function, cycles, label)
    function.also_calls = (*function.also_calls, loops[route.entry].name)
    return _enter("CALL", route.entry, cycles, loops)


def _enter(op: str, entry: Entry, cycles: int, loops: dict[Entry, Function]) -> list[Instruction]:
    """Return the instructions that go to a shared loop by a CALL or GOTO."""
    fitted = entry.fit(cycles)
    assert fitted is not None, cycles
    inner, outer, rest = fitted
    entering: list[Instruction] = []
    if entry == _TWO:
        count = Byte(loops[_TWO].own[0], 0)
        entering += [Instruction("MOVLW", k=outer & 0xFF), Instruction("MOVWF", count)]
    name = loops[entry].name
    entering += [
        Instruction("MOVLW", k=inner & 0xFF),
        Instruction(op, target=f"{name}.{rest}" if rest else name),
    ]
    for ins in entering:
        ins.fixed = True
    return entering


def _routine(name: str, route: _Route, cycles: int, loops: dict[Entry, Function]) -> Function:
    """Return the routine of the delays of one length."""
    function = Function(name)
    if route.entry is None:
        inside = _inline(function, route.inside(cycles), f"{name}.loop")
        function.extend([*inside, Instruction("RETURN", fixed=True)])
    else:
        function.extend(_enter("GOTO", route.entry, route.inside(cycles), loops))
        function.also_jumps_to = (loops[route.entry].name,)
    return function


def _inline(function: Function, cycles: int, label: str) -> list[Line]:
    loops = plan(cycles)
    return instructions(loops, counters(function, loops.bytes), label)


def counters(function: Function, count: int) -> list[Loc]:
    """Return bytes for delay counters; all delays of a function use the same ones."""
    have = [symbol for symbol in function.own if symbol.name.startswith("delay_counter")]
    while len(have) < count:
        symbol = Symbol(f"delay_counter{len(have) + 1}", U8, "temp", function=function.name)
        function.own.append(symbol)
        have.append(symbol)
    return [Byte(symbol, 0) for symbol in have[:count]]
