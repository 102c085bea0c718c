"""What surrounds the functions: vectors, start-up, the interrupt's saving of registers, delays made real.

In: the code of every function. Out: the same with delays expanded and the start-up code in front.
"""

from __future__ import annotations

from collections import Counter

from servogen.compiler.ctypes import U8
from servogen.compiler.delays import instructions, plan
from servogen.compiler.emitter import ISR_SUFFIX, Code
from servogen.compiler.machine import DELAY, Byte, Ins, Loc
from servogen.compiler.tree import Symbol

_CALL_AND_RETURN = 4


def expand_delays(codes: dict[str, Code], room_for_call: dict[str, bool]) -> None:
    """Replace each delay by its instructions; delays that occur often become routines where that saves words.

    `room_for_call` says of each function whether the stack has a level left for one more call from it.
    """
    for isr in (False, True):
        group = [code for name, code in codes.items() if name.endswith(ISR_SUFFIX) == isr]
        counts = Counter(
            int(ins.k)  # type: ignore[arg-type]
            for code in group
            if room_for_call.get(code.name, False)
            for ins in code.ins
            if ins.op == DELAY
        )
        shared = {
            cycles
            for cycles, times in counts.items()
            if cycles >= _CALL_AND_RETURN
            and times * plan(cycles).words > times + plan(cycles - _CALL_AND_RETURN).words + 1
        }
        for code in list(group):
            _expand(
                code,
                shared if room_for_call.get(code.name, False) else set(),
                ISR_SUFFIX if isr else "",
                codes,
            )


def _expand(code: Code, shared: set[int], suffix: str, codes: dict[str, Code]) -> None:
    out: list[Ins] = []
    for number, ins in enumerate(code.ins):
        if ins.op != DELAY:
            out.append(ins)
            continue
        assert isinstance(ins.k, int)
        if ins.k in shared:
            name = f"__delay_{ins.k}{suffix}"
            if name not in codes:
                codes[name] = _routine(name, ins.k - _CALL_AND_RETURN)
            made = [Ins("CALL", target=name, fixed=True)]
        else:
            made = _inline(code, ins.k, f"{code.name}.delay{number}")
        for each in made:
            each.place = ins.place
        out += made
    code.ins = out


def _inline(code: Code, cycles: int, label: str) -> list[Ins]:
    found = plan(cycles)
    return instructions(found, counters(code, found.bytes), label)


def counters(code: Code, count: int) -> list[Loc]:
    """Bytes for the counters of delays; the delays of one function use the same ones."""
    have = [symbol for symbol in code.own if symbol.name.startswith("delay_counter")]
    while len(have) < count:
        symbol = Symbol(f"delay_counter{len(have) + 1}", U8, "temp", function=code.name)
        code.own.append(symbol)
        have.append(symbol)
    return [Byte(symbol, 0) for symbol in have[:count]]


def _routine(name: str, cycles: int) -> Code:
    code = Code(name)
    code.ins = [*_inline(code, cycles, f"{name}.loop"), Ins("RETURN", fixed=True)]
    return code
