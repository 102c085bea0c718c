"""Expands delays: each in place, or through routines where that saves words.

In: the code of every function, with each delay as one instruction. Out: the same code with the delays'
instructions.

Adjacent delays are merged. A delay that occurs often can be a routine of its own; delays of many lengths can
share a loop that takes its counters and is entered as many NOPs early as there are cycles left over:

    MOVLW c1                        MOVLW c2; MOVWF t; MOVLW c1
    CALL  loop1 - rest              CALL  loop2 - rest

Which of these is used is decided for all delays together, by the number of words.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.emit.delay_loops import instructions, plan
from servogen.compiler.ir.function import ISR_SUFFIX, Function, Line
from servogen.compiler.ir.instruction import DELAY, STATUS, Byte, Instruction, Label, Loc, Z

_CALL_AND_RETURN = 4
_LOOP_WORDS = {1: 4, 2: 6}
_SITE_WORDS = {1: 2, 2: 4}


@dataclass(slots=True)
class _Choice:
    """How the delays of one call tree are implemented."""

    words: int = 0
    merged: bool = True
    own: set[int] = field(default_factory=set)
    """Lengths with a routine of their own."""
    levels: dict[int, int] = field(default_factory=dict)
    """Lengths that go through a shared loop: the number of its counters."""


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
        options = [
            _choose(counts, shared, merged=kind)
            for kind, counts in ((True, merged), (False, single))
            for shared in product((False, True), (False, True))
        ]
        best = min(options, key=lambda each: each.words)
        for function in group:
            _expand(function, best if function in with_room else _Choice(), suffix, functions)
        _make_loops(best, suffix, functions)


def _lengths(function: Function, *, merged: bool) -> list[int]:
    """Return the delays of a function, with neighbours merged or each by itself."""
    found: list[int] = []
    before = False
    for ins in function.lines():
        if isinstance(ins, Instruction) and ins.op == DELAY:
            assert isinstance(ins.k, int)
            if before and merged:
                found[-1] += ins.k
            else:
                found.append(ins.k)
        before = isinstance(ins, Instruction) and ins.op == DELAY
    return found


def _choose(counts: Counter[int], shared: tuple[bool, bool], *, merged: bool) -> _Choice:
    """Return the cheapest implementation of each length, given these shared loops; `words` is the total."""
    choice = _Choice(merged=merged)
    rests: dict[int, list[int]] = {1: [], 2: []}
    for cycles, times in counts.items():
        # (words, kind): 0 expands in place, -1 is a routine of its own with one CALL per use, 1 and 2 are the
        # shared loops
        ways: list[tuple[int, int]] = [(times * plan(cycles).words, 0)]
        if cycles >= _CALL_AND_RETURN:
            ways.append((times + plan(cycles - _CALL_AND_RETURN).words + 1, -1))
        for level in (1, 2):
            if shared[level - 1] and _loop(cycles, level) is not None:
                ways.append((times * _SITE_WORDS[level], level))
        words, way = min(ways)
        choice.words += words
        if way == -1:
            choice.own.add(cycles)
        elif way:
            choice.levels[cycles] = way
            found = _loop(cycles, way)
            rests[way].append(found[-1] if found else 0)
    choice.words += sum(_LOOP_WORDS[level] + max(each) for level, each in rests.items() if each)
    return choice


def _loop(cycles: int, level: int) -> tuple[int, ...] | None:
    """Return (counters…, cycles left over) of a delay through the shared loop; None if it does not reach."""
    # Level 1: MOVLW, CALL and RETURN take 5 cycles, each turn 4, the last turn 3. Level 2 adds MOVLW, MOVWF
    # and the final DECFSZ; each further outer turn takes 256 inner turns and 3 cycles less 1.
    left = cycles - (4 if level == 1 else 8)
    outer = 0
    if level == 2:
        outer = min(255, max(0, (left - 4) // 1026))
        left -= 1026 * outer
    inner = min(256, left // 4)
    rest = left - 4 * inner
    if inner < 1 or rest > 5:
        return None
    return (inner, rest) if level == 1 else (inner, outer + 1, rest)


def _expand(function: Function, choice: _Choice, suffix: str, functions: dict[str, Function]) -> None:
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
        made = _made(function, cycles, choice, suffix, functions, f"{function.name}.delay{number}")
        for each in made:
            each.place = first.place
        inside = [each for each in made if isinstance(each, Instruction)]
        if len(inside) > 2:
            function.delays.append((inside[0], inside[-1]))
        out += made
    function.replace(out)


def _cycles(line: Line) -> int | None:
    """Return the length of a delay; None for any other line."""
    return line.k if isinstance(line, Instruction) and line.op == DELAY and isinstance(line.k, int) else None


def _made(
    function: Function, cycles: int, choice: _Choice, suffix: str, functions: dict[str, Function], label: str
) -> Sequence[Line]:
    """Return the instructions of one delay."""
    if cycles in choice.own:
        name = f"__delay_{cycles}{suffix}"
        if name not in functions:
            functions[name] = _routine(name, cycles - _CALL_AND_RETURN)
        return [Instruction("CALL", target=name, fixed=True)]
    level = choice.levels.get(cycles, 0)
    found = _loop(cycles, level) if level else None
    if found is None:
        return _inline(function, cycles, label)
    name = _loop_name(level, suffix)
    target = f"{name}.{found[-1]}" if found[-1] else name
    made: list[Instruction] = []
    if level == 2:
        if name not in functions:
            functions[name] = Function(name, own=[Symbol("count", U8, "param", function=name)])
        made += [
            Instruction("MOVLW", k=found[1] & 0xFF),
            Instruction("MOVWF", Byte(functions[name].own[0], 0)),
        ]
    elif name not in functions:
        functions[name] = Function(name)
    made += [Instruction("MOVLW", k=found[0] & 0xFF), Instruction("CALL", target=target)]
    for each in made:
        each.fixed = True
    function.also_calls = (*function.also_calls, name)
    return made


def _loop_name(level: int, suffix: str) -> str:
    return f"__delay_loop{level}{suffix}"


def _make_loops(choice: _Choice, suffix: str, functions: dict[str, Function]) -> None:
    """Create the loops that the delays share, preceded by as many NOPs as any of them needs."""
    for level in (1, 2):
        name = _loop_name(level, suffix)
        if name not in functions:
            continue
        found = [_loop(cycles, level) for cycles, each in choice.levels.items() if each == level]
        function = functions[name]
        for rest in range(max((each[-1] for each in found if each), default=0), 0, -1):
            function.extend([Label(f"{name}.{rest}"), Instruction("NOP")])
        loop = f"{name}.loop"
        function.extend(
            [
                Label(name),
                Label(loop),
                Instruction("ADDLW", k=0xFF),
                Instruction("BTFSS", STATUS, b=Z),
                Instruction("GOTO", target=loop),
            ]
        )
        if level == 2:
            function.extend(
                [Instruction("DECFSZ", Byte(function.own[0], 0), 1), Instruction("GOTO", target=loop)]
            )
        function.append(Instruction("RETURN"))
        for line in function.lines():
            line.fixed = True


def _inline(function: Function, cycles: int, label: str) -> list[Line]:
    found = plan(cycles)
    return instructions(found, counters(function, found.bytes), label)


def counters(function: Function, count: int) -> list[Loc]:
    """Return bytes for delay counters; all delays of a function use the same ones."""
    have = [symbol for symbol in function.own if symbol.name.startswith("delay_counter")]
    while len(have) < count:
        symbol = Symbol(f"delay_counter{len(have) + 1}", U8, "temp", function=function.name)
        function.own.append(symbol)
        have.append(symbol)
    return [Byte(symbol, 0) for symbol in have[:count]]


def _routine(name: str, cycles: int) -> Function:
    function = Function(name)
    function.extend([*_inline(function, cycles, f"{name}.loop"), Instruction("RETURN", fixed=True)])
    return function
