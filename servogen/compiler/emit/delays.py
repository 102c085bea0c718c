"""Delays made real: each in place, or by routines where that saves words.

In: the code of every function, with delays as one instruction each. Out: the same with their instructions.

Delays that stand one behind the other are one delay. A delay that occurs often can be a routine of its own;
delays of many lengths can share a loop that takes its counters, entered so many NOPs before it as cycles are
left over:

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
    """How the delays of one call tree are made."""

    words: int = 0
    merged: bool = True
    own: set[int] = field(default_factory=set)
    """Lengths with a routine of their own."""
    levels: dict[int, int] = field(default_factory=dict)
    """Lengths that go through a shared loop: the number of its counters."""


def expand_delays(codes: dict[str, Function], room_for_call: dict[str, bool], interrupt: set[str]) -> None:
    """Replace each delay by its instructions.

    `room_for_call` says of each function whether the stack has a level left for one more call from it. What
    the `interrupt` reaches has routines of its own: it may come in the middle of one of main's.
    """
    for isr in (False, True):
        suffix = ISR_SUFFIX if isr else ""
        group = [code for name, code in codes.items() if (name in interrupt) == isr]
        with_room = [code for code in group if room_for_call.get(code.name, False)]
        merged = Counter(cycles for code in with_room for cycles in _lengths(code, merged=True))
        single = Counter(cycles for code in with_room for cycles in _lengths(code, merged=False))
        options = [
            _choose(counts, shared, merged=kind)
            for kind, counts in ((True, merged), (False, single))
            for shared in product((False, True), (False, True))
        ]
        best = min(options, key=lambda each: each.words)
        for code in group:
            _expand(code, best if code in with_room else _Choice(), suffix, codes)
        _make_loops(best, suffix, codes)


def _lengths(code: Function, *, merged: bool) -> list[int]:
    """The delays of a function, neighbours as one or each by itself."""
    found: list[int] = []
    before = False
    for ins in code.lines():
        if isinstance(ins, Instruction) and ins.op == DELAY:
            assert isinstance(ins.k, int)
            if before and merged:
                found[-1] += ins.k
            else:
                found.append(ins.k)
        before = isinstance(ins, Instruction) and ins.op == DELAY
    return found


def _choose(counts: Counter[int], shared: tuple[bool, bool], *, merged: bool) -> _Choice:
    """The cheapest way for each length when these shared loops exist; `words` is the sum."""
    choice = _Choice(merged=merged)
    rests: dict[int, list[int]] = {1: [], 2: []}
    for cycles, times in counts.items():
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
    """(counters…, cycles left over) of a delay through the shared loop; None when it does not reach."""
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


def _expand(code: Function, choice: _Choice, suffix: str, codes: dict[str, Function]) -> None:
    out: list[Line] = []
    number = 0
    lines = list(code.lines())
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
        made = _made(code, cycles, choice, suffix, codes, f"{code.name}.delay{number}")
        for each in made:
            each.place = first.place
        inside = [each for each in made if isinstance(each, Instruction)]
        if len(inside) > 2:
            code.delays.append((inside[0], inside[-1]))
        out += made
    code.replace(out)


def _cycles(line: Line) -> int | None:
    """The length of a delay; None for what is not one."""
    return line.k if isinstance(line, Instruction) and line.op == DELAY and isinstance(line.k, int) else None


def _made(
    code: Function, cycles: int, choice: _Choice, suffix: str, codes: dict[str, Function], label: str
) -> Sequence[Line]:
    """The instructions of one delay."""
    if cycles in choice.own:
        name = f"__delay_{cycles}{suffix}"
        if name not in codes:
            codes[name] = _routine(name, cycles - _CALL_AND_RETURN)
        return [Instruction("CALL", target=name, fixed=True)]
    level = choice.levels.get(cycles, 0)
    found = _loop(cycles, level) if level else None
    if found is None:
        return _inline(code, cycles, label)
    name = _loop_name(level, suffix)
    target = f"{name}.{found[-1]}" if found[-1] else name
    made: list[Instruction] = []
    if level == 2:
        if name not in codes:
            codes[name] = Function(name, own=[Symbol("count", U8, "param", function=name)])
        made += [Instruction("MOVLW", k=found[1] & 0xFF), Instruction("MOVWF", Byte(codes[name].own[0], 0))]
    elif name not in codes:
        codes[name] = Function(name)
    made += [Instruction("MOVLW", k=found[0] & 0xFF), Instruction("CALL", target=target)]
    for each in made:
        each.fixed = True
    code.also_calls = (*code.also_calls, name)
    return made


def _loop_name(level: int, suffix: str) -> str:
    return f"__delay_loop{level}{suffix}"


def _make_loops(choice: _Choice, suffix: str, codes: dict[str, Function]) -> None:
    """The loops that the delays share, behind as many NOPs as one of them needs."""
    for level in (1, 2):
        name = _loop_name(level, suffix)
        if name not in codes:
            continue
        found = [_loop(cycles, level) for cycles, each in choice.levels.items() if each == level]
        code = codes[name]
        for rest in range(max((each[-1] for each in found if each), default=0), 0, -1):
            code.extend([Label(f"{name}.{rest}"), Instruction("NOP")])
        loop = f"{name}.loop"
        code.extend(
            [
                Label(name),
                Label(loop),
                Instruction("ADDLW", k=0xFF),
                Instruction("BTFSS", STATUS, b=Z),
                Instruction("GOTO", target=loop),
            ]
        )
        if level == 2:
            code.extend([Instruction("DECFSZ", Byte(code.own[0], 0), 1), Instruction("GOTO", target=loop)])
        code.append(Instruction("RETURN"))
        for line in code.lines():
            line.fixed = True


def _inline(code: Function, cycles: int, label: str) -> list[Line]:
    found = plan(cycles)
    return instructions(found, counters(code, found.bytes), label)


def counters(code: Function, count: int) -> list[Loc]:
    """Bytes for the counters of delays; the delays of one function use the same ones."""
    have = [symbol for symbol in code.own if symbol.name.startswith("delay_counter")]
    while len(have) < count:
        symbol = Symbol(f"delay_counter{len(have) + 1}", U8, "temp", function=code.name)
        code.own.append(symbol)
        have.append(symbol)
    return [Byte(symbol, 0) for symbol in have[:count]]


def _routine(name: str, cycles: int) -> Function:
    code = Function(name)
    code.extend([*_inline(code, cycles, f"{name}.loop"), Instruction("RETURN", fixed=True)])
    return code
