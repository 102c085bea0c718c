"""Replaces sequences by the shorter ones that the superoptimiser has found: the rules in `rules.json`.

In: a `Function`, its liveness and the rules. Out: fewer instructions, and on no path more cycles: where
nothing jumps, an instruction takes one cycle whether it is skipped or not. `tools/superoptimiser` finds the
rules, and a test checks each for all values of the bytes and flags that it reads.

    {"from": ["MOVF a,W", "MOVWF b", "MOVF a,W"], "to": ["MOVF a,W", "MOVWF b"], "dead": ["Z"]}

`a` and `b` stand for two different bytes of RAM, `k` for any literal. Bytes and flags in `dead` may hold
anything afterwards, so the rule applies only where they are not needed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from servogen.compiler.ir.function import Function, Line, is_skipped
from servogen.compiler.ir.instruction import BIT_TESTS, BIT_WRITES, PURE, SKIPS, STATUS, Byte, Instruction
from servogen.compiler.passes.liveness import C_BIT, D_BIT, W_BIT, Z_BIT, Liveness, is_private
from servogen.pic.isa import by_mnemonic, mnemonics

FLAGS = {"C": 0, "D": 1, "Z": 2}
"""Bits of STATUS: DS35007 register 2-1."""

_TEXT = re.compile(r"(?P<op>[A-Z]+)(?: (?P<f>[abCDZ])(?:,(?P<d>[WF])|\.(?P<b>[0-7]))?| (?P<k>k|\d+))?")


@dataclass(frozen=True, slots=True)
class RuleInstruction:
    """One instruction: `f` is a, b, or a flag of a bit instruction; `k` a literal, or "k" for any."""

    op: str
    f: str = ""
    d: int = 0
    b: int = 0
    k: int | str | None = None

    @classmethod
    def parse(cls, text: str) -> RuleInstruction:
        """Return the instruction of a rule's text, such as "ADDWF a,F", "MOVLW 3", "BTFSC C", "BSF a.7"."""
        match = _TEXT.fullmatch(text)
        if match is None:
            raise ValueError(f"'{text}' is not an instruction of a rule")
        op, f, d, b, k = match.group("op", "f", "d", "b", "k")
        return cls(op, f or "", int(d == "F"), int(b or 0), int(k) if k and k != "k" else k)

    def __str__(self) -> str:
        """Return the text from which `parse` makes the same instruction."""
        if self.k is not None:
            return f"{self.op} {self.k}"
        if not self.f:
            return self.op
        if self.f in FLAGS:
            return f"{self.op} {self.f}"
        operands = by_mnemonic()[self.op].operands
        if "b" in operands:
            return f"{self.op} {self.f}.{self.b}"
        return f"{self.op} {self.f},{'WF'[self.d]}" if "d" in operands else f"{self.op} {self.f}"


@dataclass(frozen=True, slots=True)
class Rule:
    """`old` may be replaced by `new`, which is shorter, where what is in `dead` is not needed afterwards."""

    old: tuple[RuleInstruction, ...]
    new: tuple[RuleInstruction, ...]
    dead: frozenset[str]


@cache
def rules() -> tuple[Rule, ...]:
    """Return all rules, those that save most first."""
    data = json.loads(Path(__file__).with_name("rules.json").read_text())
    instruction = cache(RuleInstruction.parse)  # most texts occur in many rules
    parsed = [
        Rule(
            tuple(map(instruction, row["from"])),
            tuple(map(instruction, row["to"])),
            frozenset(row["dead"]),
        )
        for row in data
    ]
    return tuple(sorted(parsed, key=lambda rule: (len(rule.new) - len(rule.old), len(rule.old))))


BYTES = ("a", "b")
LITERALS = mnemonics(lambda row: row.operands == "k" and row.flow == "next")
OPERATIONS = PURE | SKIPS
"""What a rule may consist of: no jump, no call, nothing that waits."""
_LIVE = {"W": W_BIT, "C": C_BIT, "D": D_BIT, "Z": Z_BIT}
_BY_BIT = {bit: flag for flag, bit in FLAGS.items()}


Names = dict[Byte, str]


@dataclass(slots=True)
class _Node:
    """The rules that begin with certain instructions, as a tree: what may follow, and which end here."""

    following: dict[RuleInstruction, _Node] = field(default_factory=dict)
    rules: list[Rule] = field(default_factory=list)


@dataclass(slots=True)
class Match:
    """A rule, and what its names stand for."""

    rule: Rule
    names: Names
    literal: int | None


def rule_instruction(ins: Instruction, names: Names) -> RuleInstruction | None:
    """Return an instruction as rules write it; None for one that rules do not change.

    A byte that has no name yet is given the next one.
    """
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
    tree = _tree()
    first = {pattern.op for pattern in tree.following}
    live = cache(lambda: Liveness(function))  # most functions have no place for any rule
    lines = list(function.lines())
    out: list[Line] = []
    index, changed = 0, False
    while index < len(lines):
        line = lines[index]
        match = None
        if isinstance(line, Instruction) and line.op in first:
            match = best_match(lines, index, tree, live)
        if match is not None:
            assert isinstance(line, Instruction)
            out += [_instruction(pattern, match, line) for pattern in match.rule.new]
            index += len(match.rule.old)
            changed = True
        # liveness behind a match is as before, within it is not: the next match begins one line later
        out += lines[index : index + 1]
        index += 1
    if changed:
        function.replace(out)
    return changed


def best_match(lines: Sequence[Line], index: int, tree: _Node, live: Callable[[], Liveness]) -> Match | None:
    """Return the rule that saves most of the lines from `at` on.

    What it replaces contains no label, is not entered or left by a skip, and others cannot see it.
    """
    if is_skipped(lines, index):
        return None
    best: Match | None = None
    names: Names = {}
    reached: list[tuple[_Node, int | None]] = [(tree, None)]
    while reached and index < len(lines):
        line = lines[index]
        if not isinstance(line, Instruction) or (pattern := rule_instruction(line, names)) is None:
            break
        reached = list(_steps(reached, pattern))
        for node, literal in reached:
            for rule in node.rules:
                better = best is None or _saved(rule) > _saved(best.rule)
                if better and rule.dead <= dead_after(line, names, live()):
                    best = Match(rule, dict(names), literal)
        index += 1
    return best


def _steps(
    reached: Iterable[tuple[_Node, int | None]], pattern: RuleInstruction
) -> Iterator[tuple[_Node, int | None]]:
    """Yield where an instruction leads in the tree, and what `k` then stands for."""
    for node, literal in reached:
        if pattern in node.following:
            yield node.following[pattern], literal
        if isinstance(pattern.k, int) and literal in (None, pattern.k):
            general = RuleInstruction(pattern.op, k="k")
            if general in node.following:
                yield node.following[general], pattern.k


def _saved(rule: Rule) -> int:
    return len(rule.old) - len(rule.new)


def dead_after(last: Instruction, names: Names, live: Liveness) -> set[str]:
    """Return which of W, the flags and the bytes with names are not needed behind an instruction."""
    after = live.after[last]
    dead = {name for name, bit in _LIVE.items() if not after & bit}
    return dead | {name for byte, name in names.items() if is_private(byte) and not after & live.bit(byte)}


def _instruction(pattern: RuleInstruction, match: Match, first: Instruction) -> Instruction:
    """Return an instruction of a rule for the bytes and the literal of a match."""
    f = next((byte for byte, name in match.names.items() if name == pattern.f), None)
    k = match.literal if pattern.k == "k" else pattern.k
    return Instruction(
        pattern.op,
        STATUS if pattern.f in FLAGS else f,
        pattern.d,
        FLAGS.get(pattern.f, pattern.b),
        int(k or 0),
        place=first.place,
    )


@cache
def _tree() -> _Node:
    """Return the rules, by what they replace."""
    root = _Node()
    for rule in rules():
        node = root
        for pattern in rule.old:
            node = node.following.setdefault(pattern, _Node())
        node.rules.append(rule)
    return root
