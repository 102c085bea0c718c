"""Replaces short sequences with shorter ones.

In: a `Function` and its liveness. Out: an operation on a byte in place instead of through W, CLRF for a
stored zero, one skip instead of a skip and two jumps.
"""

from __future__ import annotations

from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import IN_PLACE, Instruction, exposed
from servogen.compiler.passes.liveness import C_BIT, D_BIT, W_BIT, Z_BIT, Liveness, is_private
from servogen.pic.isa import literal_forms

_COUNTS: dict[object, str] = {1: "INCF", 0xFF: "DECF"}
"""By the constant that is added."""
_COMMUTING = {literal: file for file, literal in literal_forms().items() if file != "SUBWF"}
"""Operations whose operands can be exchanged, by the literal form."""


def peephole(function: Function) -> bool:
    """Run the pass once; return whether something changed."""
    live = Liveness(function)
    changed = False
    for block in function.blocks:
        out: list[Instruction] = []
        index = 0
        while index < len(block.instructions):
            match = _match(block.instructions[index : index + 3], live)
            if match is None:
                out.append(block.instructions[index])
                index += 1
                continue
            new, count = match
            for ins in new:
                ins.place = block.instructions[index].place
            out += new
            index += count
            changed = True
        block.instructions = out
    if changed:
        function.rebuild()
    return changed


def _match(window: list[Instruction], live: Liveness) -> tuple[list[Instruction], int] | None:
    """Return the replacement of the first instructions of a window and their number; None if no rule
    applies.
    """
    if len(window) < 2 or window[0].fixed or window[1].fixed:
        return None
    one, two = window[:2]
    after_two = live.after[two]
    if two.op == "MOVWF" and not after_two & W_BIT:
        # OP f,W; MOVWF f: the same in place, where W is not needed afterwards
        if one.op in IN_PLACE and one.d == 0 and one.f == two.f:
            return [Instruction(one.op, one.f, 1)], 2
        # MOVLW 0; MOVWF f: CLRF does not load W, but sets Z
        if one.op == "MOVLW" and one.k == 0 and not after_two & Z_BIT:
            return [Instruction("CLRF", two.f)], 2
        # MOVF f,W; MOVWF f: nothing but Z is changed
        copied = one.op == "MOVF" and one.d == 0 and one.f == two.f
        if copied and not exposed(one.f) and not after_two & Z_BIT:
            return [], 2
    if not after_two & (C_BIT | D_BIT):
        # adding 1 or -1: INCF and DECF do not set C and DC
        if one.op == "MOVLW" and one.k in _COUNTS and two.op == "ADDWF" and not (two.d and after_two & W_BIT):
            return [Instruction(_COUNTS[one.k], two.f, two.d)], 2
        if one.op == "MOVF" and one.d == 0 and two.op == "ADDLW" and two.k in _COUNTS:
            return [Instruction(_COUNTS[two.k], one.f)], 2
    # MOVLW k; RETURN
    if one.op == "MOVLW" and two.op == "RETURN":
        return [Instruction("RETLW", k=one.k)], 2
    three = window[2] if len(window) > 2 else None
    if three is not None and not three.fixed and _swaps(one, two, three):
        needed = live.bit(one.f)  # type: ignore[arg-type]
        if not live.after[three] & needed:
            return [Instruction(three.op, two.f, 0)], 3
    if three is not None and not three.fixed and three.op == "MOVWF" and not live.after[three] & W_BIT:
        loads = one.op == "MOVF" and one.d == 0
        combines = two.op in _COMMUTING.values() and two.d == 0
        # MOVF f,W; ANDLW k; MOVWF f: with the constant in W, in place
        if loads and one.f == three.f and two.op in _COMMUTING:
            return [Instruction("MOVLW", k=two.k), Instruction(_COMMUTING[two.op], one.f, 1)], 3
        # MOVF f,W; ANDWF g,W; MOVWF g: the result goes to g directly
        if loads and combines and two.f == three.f:
            return [one, Instruction(two.op, two.f, 1)], 3
        # MOVF f,W; ANDWF g,W; MOVWF f: the operation commutes, so that f can be its target
        if loads and combines and one.f == three.f and two.f != one.f:
            return [Instruction("MOVF", two.f, 0), Instruction(two.op, one.f, 1)], 3
    return _flags(one, two)


def _swaps(one: Instruction, two: Instruction, three: Instruction) -> bool:
    """Return whether `MOVWF t; MOVF x,W; XORWF t,W` can be `XORWF x,W`, because t is not needed any more."""
    return (
        one.op == "MOVWF"
        and is_private(one.f)
        and (two.op, two.d) == ("MOVF", 0)
        and two.f != one.f
        and three.op in _COMMUTING.values()
        and (three.f, three.d) == (one.f, 0)
    )


def _flags(one: Instruction, two: Instruction) -> tuple[list[Instruction], int] | None:
    """Return one instruction in place of two if the second, an IORLW 0, sets Z as the first already has; else
    None.
    """
    if (
        two.op == "IORLW"
        and two.k == 0
        and "Z" in one.flags
        and one.d == 0
        and one.writes_w
        and one.op != "CALL"
    ):
        return [one], 2
    return None
