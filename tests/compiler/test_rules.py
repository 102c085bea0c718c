"""The superoptimiser's rules: each is proven for all values, and the pass applies it only where it holds."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.ir.function import Function, Line
from servogen.compiler.ir.instruction import STATUS as STATUS_REGISTER
from servogen.compiler.ir.instruction import Byte, Instruction, Label, Reg
from servogen.compiler.passes.superoptimise import FLAGS, Rule, RuleInstruction, rules, superoptimise
from servogen.pic.image import Image
from servogen.pic.isa import by_mnemonic, encode
from servogen.simulator import Machine
from servogen.units import Clock
from tools.superoptimiser.enumeration import ALL
from tools.superoptimiser.machine import NAMES, run
from tools.superoptimiser.proof import differing

A, B = 0x0C, 0x0D
STATUS = 3


def name_of(rule: Rule) -> str:
    return f"{'; '.join(map(str, rule.old))} -> {'; '.join(map(str, rule.new))}"


@pytest.mark.parametrize("rule", rules(), ids=name_of)
def test_both_sides_of_a_rule_leave_the_same_for_all_values(rule: Rule) -> None:
    assert differing(rule.old, rule.new) <= rule.dead


@pytest.mark.parametrize("rule", rules(), ids=name_of)
def test_a_rule_saves_words_and_never_costs_a_cycle(rule: Rule) -> None:
    """A skip takes two cycles instead of its own and the skipped one's: every instruction is one cycle."""
    assert len(rule.new) < len(rule.old)
    for side in (rule.old, rule.new):
        skips = [by_mnemonic()[each.op].skips for each in side]
        assert not any(one and two for one, two in pairwise(skips))
        assert not (skips and skips[-1])
    assert {each.f for each in rule.new} <= {each.f for each in rule.old} | {"", *FLAGS}


def test_a_wrong_rule_is_found() -> None:
    def differs(old: str, new: str) -> set[str]:
        sides = (tuple(map(RuleInstruction.parse, side.split("; "))) for side in (old, new))
        return differing(*sides)

    assert differs("MOVF a,W; MOVWF b", "MOVF b,W") == {"W", "b", "Z"}
    assert differs("INCF a,F", "DECF a,F") == {"a", "Z"}
    assert differs("MOVF a,W; SUBWF b,W", "COMF a,W; ADDWF b,W; ADDLW 1") == {"C", "D"}
    assert differs("MOVF a,W; XORLW 1", "DECF a,W") == {"W"}
    assert differs("RLF a,W", "MOVF a,W; ADDWF a,W") == {"W", "D", "Z"}  # C is bit 7 of a, both times


def word(ins: RuleInstruction) -> int:
    """The instruction with `a` at 0x0C and `b` at 0x0D, by the simulator's own table."""
    fields: dict[str, int] = {}
    row = by_mnemonic()[ins.op]
    if "f" in row.operands:
        fields["f"] = {"a": A, "b": B}.get(ins.f, STATUS)
    if "d" in row.operands:
        fields["d"] = ins.d
    if "b" in row.operands:
        fields["b"] = FLAGS.get(ins.f, ins.b)
    if "k" in row.operands:
        fields["k"] = int(ins.k or 0)
    return encode(ins.op, **fields)


CASES = [each for each in ALL if each.k != "k" and not by_mnemonic()[each.op].skips]
SKIPS = [each for each in ALL if by_mnemonic()[each.op].skips]


@pytest.mark.parametrize("ins", [*CASES, *SKIPS], ids=str)
def test_the_rules_machine_does_what_the_simulator_does(ins: RuleInstruction) -> None:
    """A skip is followed by an instruction that shows whether it was taken."""
    sequence = (ins, RuleInstruction.parse("MOVWF b")) if ins in SKIPS else (ins,)
    dice = np.random.default_rng(len(str(ins)))
    starts = []
    for _ in range(12):
        values = {name: int(dice.integers(0, 2 if name in FLAGS else 256)) for name in NAMES}
        if dice.random() < 0.4:
            values["a"] = int(dice.choice([0, 1, 0xFF]))
        starts.append(values)
    for values, found in zip(starts, simulated(sequence, starts), strict=True):
        expected = run(sequence, {name: np.array([value], np.uint8) for name, value in values.items()})
        assert found == {name: int(expected[name][0]) for name in NAMES}


def simulated(sequence: tuple[RuleInstruction, ...], starts: list[dict[str, int]]) -> list[dict[str, int]]:
    """What the simulator's registers hold after a sequence that begins with each of these, in one program."""
    words: list[int] = []
    ends = []
    for values in starts:
        words += [*setup(values), *map(word, sequence)]
        ends.append(len(words))
    words.append(encode("GOTO", k=len(words)))
    machine = Machine(Image(dict(enumerate(words))), Clock(4_000_000))
    return [registers(machine, end) for end in ends]


def setup(values: dict[str, int]) -> list[int]:
    flags = sum(values[name] << bit for name, bit in FLAGS.items())
    return [
        *(
            code
            for f, name in ((A, "a"), (B, "b"))
            for code in (encode("MOVLW", k=values[name]), encode("MOVWF", f=f))
        ),
        encode("MOVLW", k=0x18 | flags),
        encode("MOVWF", f=STATUS),
        encode("MOVLW", k=values["W"]),
    ]


def registers(machine: Machine, end: int) -> dict[str, int]:
    assert machine.run_until(pc=end, limit=1000)
    state = machine.state()
    found = {"W": state.w, "a": state.ram[0], "b": state.ram[1]}
    return found | {name: state.status >> bit & 1 for name, bit in FLAGS.items()}


def one_function(*instructions: Instruction) -> Function:
    function = Function("f")
    function.extend([*instructions, Instruction("RETURN")])
    return function


def byte(name: str, kind: str = "local", *, volatile: bool = False) -> Byte:
    return Byte(Symbol(name, U8, kind, function="f", volatile=volatile), 0)


def ops(function: Function) -> list[str]:
    return [each.op for each in function.instructions()]


def test_a_rule_applies_where_what_it_loses_is_not_needed() -> None:
    """`MOVF a,W; XORLW 1` only to test Z is `DECF a,W`; if W is needed it is not."""
    a, b = byte("a"), byte("b")
    test = [Instruction("BTFSS", STATUS_REGISTER, b=2), Instruction("INCF", b, 1)]
    function = one_function(Instruction("MOVF", a), Instruction("XORLW", k=1), *test)
    function.result = b.symbol
    assert superoptimise(function)
    assert ops(function) == ["DECF", "BTFSS", "INCF", "RETURN"]
    kept = one_function(
        Instruction("MOVF", a),
        Instruction("XORLW", k=1),
        *[each.copy() for each in test],
        Instruction("MOVWF", b),
    )
    kept.result = b.symbol
    assert not superoptimise(kept)


@pytest.mark.parametrize("kind", ["volatile", "register", "fixed", "label", "skipped"])
def test_no_rule_applies_to_what_others_can_see_or_enter(kind: str) -> None:
    a, b = byte("a", volatile=kind == "volatile"), byte("b")
    loc = Reg(6) if kind == "register" else a
    lines: list[Line] = [
        Instruction("MOVF", loc, fixed=kind == "fixed"),
        *([Label("here")] if kind == "label" else []),
        Instruction("XORLW", k=1),
        Instruction("BTFSS", STATUS_REGISTER, b=2),
        Instruction("INCF", b, 1),
    ]
    if kind == "skipped":
        lines.insert(0, Instruction("BTFSC", b, b=3))
    function = Function("f", result=b.symbol)
    function.extend([*lines, Instruction("RETURN")])
    before = ops(function)
    assert not superoptimise(function)
    assert ops(function) == before
