"""The rules that the superoptimiser has found, as data: `rules.json`.

In: the file. Out: `Rule`s. `tools/superoptimiser` finds them, and a test proves each for all values of the
bytes and flags that it reads.

    {"from": ["MOVF a,W", "MOVWF b", "MOVF a,W"], "to": ["MOVF a,W", "MOVWF b"], "dead": ["Z"]}

`a` and `b` stand for two different bytes of RAM, `k` for any literal. Bytes and flags in `dead` may hold
anything afterwards, so the rule applies only where they are not needed.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from servogen.pic.isa import by_mnemonic

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
    data = json.loads((files("servogen.compiler.passes") / "rules.json").read_text())
    parsed = [
        Rule(
            tuple(map(RuleInstruction.parse, row["from"])),
            tuple(map(RuleInstruction.parse, row["to"])),
            frozenset(row["dead"]),
        )
        for row in data
    ]
    return tuple(sorted(parsed, key=lambda rule: (len(rule.new) - len(rule.old), len(rule.old))))
