"""Replaces sequences by the shorter ones that the superoptimiser has found.

In: a `Function`, its liveness and the rules. Out: fewer instructions, and on no path more cycles: where
nothing jumps, an instruction takes one cycle whether it is skipped or not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

from servogen.compiler.ir.function import Function, Line, is_skipped
from servogen.compiler.ir.instruction import BIT_TESTS, BIT_WRITES, PURE, SKIPS, STATUS, Byte, Instruction
from servogen.compiler.passes.liveness import C_BIT, D_BIT, W_BIT, Z_BIT, Liveness, is_private
from servogen.compiler.passes.rules import FLAGS, Rule, RuleInstruction, rules
from servogen.pic.isa import by_mnemonic, mnemonics

BYTES = ("a", "b")
LITERALS = mnemonics(lambda row: row.operands == "k" and row.flow == "next")
OPERATIONS = PURE | SKIPS
"""What a rule may consist of: no jump, no call, nothing that waits."""
_LIVE = {"W": W_BIT, "C": C_BIT, "D": D_BIT, "Z": Z_BIT}
_BY_BIT = {bit: flag for flag, bit in FLAGS.items()}


@dataclass(slots=True)
class Window:
    """Instructions as a rule would write them, and what its names stand for."""

    instructions: tuple[RuleInstruction, ...]
    bytes: dict[str, Byte]
    literal: int | None = None

    def general(self) -> Window | None:
        """Return the window with its literal replaced by "k"; None if it has none, or several."""
        values = {each.k for each in self.instructions if each.k is not None}
        if len(values) != 1:
            return None
        (value,) = values
        assert isinstance(value, int)
        changed = tuple(
            each if each.k is None else RuleInstruction(each.op, k="k") for each in self.instructions
        )
        return Window(changed, self.bytes, value)


def windows(lines: Sequence[Line], at: int, longest: int) -> Iterator[Window]:
    """Yield the windows that begin at a line, from one instruction to `longest`.

    They contain no label, are not entered or left by a skip, and change nothing that others can see.
    """
    if is_skipped(lines, at):
        return
    names: dict[Byte, str] = {}
    found: list[RuleInstruction] = []
    skips = False
    for line in lines[at : at + longest]:
        if not isinstance(line, Instruction) or (skips and line.skips):
            return
        each = _as_rule(line, names)
        if each is None:
            return
        found.append(each)
        skips = line.skips
        if not skips:
            yield Window(tuple(found), {name: byte for byte, name in names.items()})


def _as_rule(ins: Instruction, names: dict[Byte, str]) -> RuleInstruction | None:
    """Return an instruction as rules write it; None for one that rules do not change."""
    if ins.fixed or ins.op not in OPERATIONS:
        return None
    if ins.op in LITERALS:
        return RuleInstruction(ins.op, k=ins.k) if isinstance(ins.k, int) else None
    if not by_mnemonic()[ins.op].operands:
        return RuleInstruction(ins.op)
    if ins.f == STATUS:
        flag = _BY_BIT.get(ins.b) if ins.op in BIT_TESTS | BIT_WRITES else None
        return RuleInstruction(ins.op, flag) if flag else None
    if not isinstance(ins.f, Byte) or ins.f.symbol.volatile or ins.f.symbol.kind == "fixed":
        return None
    if ins.f not in names:
        if len(names) == len(BYTES):
            return None
        names[ins.f] = BYTES[len(names)]
    return RuleInstruction(ins.op, names[ins.f], ins.d, ins.b)


def superoptimise(function: Function) -> bool:
    """Run the pass once; return whether something changed."""
    table = _table()
    if not table:
        return False
    longest = max(map(len, table))
    live = Liveness(function)
    lines = list(function.lines())
    out: list[Line] = []
    at, changed = 0, False
    while at < len(lines):
        found = _match(lines, at, longest, table, live)
        if found is None:
            out.append(lines[at])
            at += 1
            continue
        new, count = found
        out += new
        at += count
        changed = True
        out += lines[at : at + 1]  # liveness behind the window is as before, within it is not
        at += 1
    if changed:
        function.replace(out)
    return changed


def _match(
    lines: Sequence[Line],
    at: int,
    longest: int,
    table: dict[tuple[RuleInstruction, ...], list[Rule]],
    live: Liveness,
) -> tuple[list[Line], int] | None:
    """Return the best replacement of the lines from `at` on, and how many it replaces."""
    best: tuple[Rule, Window] | None = None
    for window in windows(lines, at, longest):
        for form in (window, window.general()):
            for rule in table.get(form.instructions, ()) if form else ():
                assert form is not None
                last = lines[at + len(rule.old) - 1]
                assert isinstance(last, Instruction)
                if best is not None and _saved(rule) <= _saved(best[0]):
                    continue
                if rule.dead <= dead_after(last, form.bytes, live):
                    best = rule, form
    if best is None:
        return None
    rule, window = best
    first = lines[at]
    assert isinstance(first, Instruction)
    return [_instruction(each, window, first) for each in rule.new], len(rule.old)


def _saved(rule: Rule) -> int:
    return len(rule.old) - len(rule.new)


def dead_after(last: Instruction, names: dict[str, Byte], live: Liveness) -> set[str]:
    """Return which of W, the flags and the bytes of a window are not needed behind its last instruction."""
    after = live.after[last]
    dead = {name for name, bit in _LIVE.items() if not after & bit}
    return dead | {name for name, byte in names.items() if is_private(byte) and not after & live.bit(byte)}


def _instruction(each: RuleInstruction, window: Window, first: Instruction) -> Instruction:
    """Return an instruction of a rule for the bytes and the literal of a window."""
    f = window.bytes.get(each.f, STATUS if each.f in FLAGS else None)
    b = FLAGS.get(each.f, each.b)
    k = window.literal if each.k == "k" else each.k
    return Instruction(each.op, f, each.d, b, int(k or 0), place=first.place)


@cache
def _table() -> dict[tuple[RuleInstruction, ...], list[Rule]]:
    """Return the rules by what they replace."""
    found: dict[tuple[RuleInstruction, ...], list[Rule]] = {}
    for rule in rules():
        found.setdefault(rule.old, []).append(rule)
    return found
