"""Jumps on conditions: comparisons, bits, logical operators.

In: typed expressions and a label. Out: instructions that jump to the label when the condition has a given
truth value.
"""

from __future__ import annotations

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import COMPARISONS, MIRRORED, has_effect, interval
from servogen.compiler.ast.types import IntType
from servogen.compiler.codegen.arithmetic import biased, compare_less, zero_test
from servogen.compiler.codegen.effects import in_flash, stripped, width_of
from servogen.compiler.codegen.expressions import effect
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.indirect import bit_source, field_byte, point_fsr
from servogen.compiler.codegen.operands import is_direct, operands_of, pair, ref_locs
from servogen.compiler.codegen.operators import binary_w, to_w
from servogen.compiler.ir.instruction import INDF, SETS_Z, Byte, C, Imm, Operand, Reg, Z, exposed


def comparison(gen: FunctionGenerator, expr: tree.Binary, sense: bool, label: str) -> None:
    """Jump to `label` if the truth of a comparison is `sense`."""
    left, right, op = expr.left, expr.right, expr.op
    if isinstance(left, tree.Num) and not isinstance(right, tree.Num):
        left, right, op = right, left, MIRRORED[op]
    size, signed = _width(left, right)
    if op in ("==", "!="):
        _equality(gen, left, right, size, sense == (op == "=="), label)
        return
    if isinstance(right, tree.Num):
        bound = right.value
        # left > n is left >= n + 1; the width is chosen anew for that bound, so that it cannot wrap
        if op == ">":
            bound, op = bound + 1, ">="
        elif op == "<=":
            bound, op = bound + 1, "<"
        _against_constant(gen, left, bound, size, sense == (op == ">="), label)
        return
    # left < right or left >= right, by turning the others around
    if op in (">", "<="):
        left, right, op = right, left, MIRRORED[op]
    a, b = pair(gen, left, right, size)
    if signed:
        a, b = biased(gen, a), biased(gen, b)
    compare_less(gen, a, b)
    gen.goto_if(C, sense == (op == ">="), label)


def _width(left: tree.Expr, right: tree.Expr) -> tuple[int, bool]:
    """Return (bytes, signed) in which two operands are compared: as few as hold the values of both."""
    if not isinstance(left.type, IntType) or not isinstance(right.type, IntType):
        return max(left.type.size, right.type.size), False
    (a, b), (c, d) = interval(left), interval(right)
    return width_of(min(a, c), max(b, d))


def _against_constant(
    gen: FunctionGenerator, left: tree.Expr, bound: int, size: int, at_least: bool, label: str
) -> None:
    """Jump if (left >= bound) equals `at_least`."""
    low, high = interval(left)
    if not isinstance(left.type, IntType):
        low, high = 0, (1 << 8 * size) - 1
    if bound > high or bound <= low:  # decided by the range of the type
        effect(gen, left)
        if (bound <= low) == at_least:
            gen.goto(label)
        return
    size, signed = width_of(min(low, bound), max(high, bound))
    # the sign bit alone tells whether a value is at least 0
    if signed and bound == 0:
        top = operands_of(gen, left, size)[-1]
        if isinstance(top, (Byte, Reg)):
            gen.goto_if(7, not at_least, label, bit_source(gen, top))
            return
    if size == 1:
        if signed:
            to_w(gen, left)
            # inverting the sign bit turns the signed order into the unsigned one
            gen.emit("XORLW", k=0x80)
            gen.emit("ADDLW", k=0x100 - (bound + 0x80))
        # an unsigned value is at least 1 if it is not 0
        elif bound == 1:
            to_w_with_zero(gen, left)
            gen.goto_if(Z, not at_least, label)
            return
        # an unsigned value is at least 128 if its top bit is set
        elif bound == 0x80 and is_direct(stripped(left)):
            top = operands_of(gen, left, 1)[0]
            assert not isinstance(top, Imm)
            gen.goto_if(7, at_least, label, bit_source(gen, top))
            return
        elif is_direct(stripped(left)):
            operand = operands_of(gen, left, 1)[0]
            assert not isinstance(operand, Imm)
            if bound == 0xFF:
                # only 255 plus 1 is 0
                gen.emit("INCF", operand, 0)
                gen.goto_if(Z, at_least, label)
                return
            gen.emit("MOVLW", k=bound)
            gen.emit("SUBWF", operand, 0)
        else:
            to_w(gen, left)
            # the sum carries exactly where W is at least the bound; SUBLW would subtract the other way round
            gen.emit("ADDLW", k=0x100 - bound)
        gen.goto_if(C, at_least, label)
        return
    operands = operands_of(gen, left, size)
    if signed:
        operands = biased(gen, operands)
        bound += 1 << 8 * size - 1
    compare_less(gen, operands, [Imm(bound >> 8 * index & 0xFF) for index in range(size)])
    gen.goto_if(C, at_least, label)


def _equality(
    gen: FunctionGenerator, left: tree.Expr, right: tree.Expr, size: int, equal: bool, label: str
) -> None:
    """Jump if (left == right) equals `equal`."""
    if isinstance(right, tree.Num):
        value = right.value & (1 << 8 * size) - 1
        low, high = interval(left)
        if isinstance(left.type, IntType) and not low <= right.value <= high:
            effect(gen, left)
            if not equal:
                gen.goto(label)
            return
        if size == 1 and value:
            if _all_set(gen, left, value):
                gen.goto_if(Z, equal, label)
                return
            # W ^ n is 0 exactly where W is n
            to_w(gen, left)
            gen.emit("XORLW", k=value)
            gen.goto_if(Z, equal, label)
            return
        if value == 0:
            gen.lower.jump(gen, left, not equal, label)
            return
    if size == 1:
        binary_w(gen, tree.Binary("^", left, right, left.type, left.place))
        gen.goto_if(Z, equal, label)
        return
    a, b = pair(gen, left, right, size)
    if sum(operand != Imm(0) for operand in b) == 1 and not any(isinstance(operand, Imm) for operand in a):
        _equal_in_one_byte(gen, a, b)
        gen.goto_if(Z, equal, label)
        return
    other = gen.new_label()
    for number, (one, two) in enumerate(zip(a, b, strict=True)):
        differ(gen, one, two)
        if number == size - 1:
            gen.goto_if(Z, equal, label)
        else:
            gen.goto_if(Z, False, other if equal else label)
    if equal:
        gen.label(other)


def _all_set(gen: FunctionGenerator, expr: tree.Expr, mask: int) -> bool:
    """Set Z if `x & mask` has all bits of the mask; return whether the expression had that form."""
    masked = stripped(expr)
    if not isinstance(masked, tree.Binary) or masked.op != "&":
        return False
    left, right = masked.left, masked.right
    if isinstance(left, tree.Num):
        left, right = right, left
    if not isinstance(right, tree.Num) or right.value != mask or not is_direct(stripped(left)):
        return False
    operand = operands_of(gen, left, 1)[0]
    assert not isinstance(operand, Imm)
    # no bit of the mask is left of the complement if all are set in the byte
    gen.emit("COMF", operand, 0)
    gen.emit("ANDLW", k=mask)
    return True


def _equal_in_one_byte(gen: FunctionGenerator, variable: list[Operand], value: list[Operand]) -> None:
    """Set Z if `variable` equals `value`, of which all bytes but one are the constant 0."""
    pairs = sorted(zip(variable, value, strict=True), key=lambda one: one[1] == Imm(0))
    differ(gen, *pairs[0])
    for byte, _ in pairs[1:]:
        assert not isinstance(byte, Imm)
        gen.emit("IORWF", byte, 0)


def differ(gen: FunctionGenerator, left: Operand, right: Operand) -> None:
    """Set Z if two bytes are equal."""
    if isinstance(left, Imm):
        left, right = right, left
    if right == Imm(0) and not isinstance(left, Imm):
        gen.emit("MOVF", left, 0)
    elif isinstance(left, Imm):
        gen.load(left)
        gen.emit("XORLW", k=right.value if isinstance(right, Imm) else 0)
    elif isinstance(right, Imm):
        gen.load(left)
        gen.emit("XORLW", k=right.value)
    else:
        gen.load(right)
        gen.emit("XORWF", left, 0)


# zero


def to_w_with_zero(gen: FunctionGenerator, expr: tree.Expr) -> None:
    """Load a one-byte value into W and set Z according to it."""
    to_w(gen, expr)
    last = gen.last
    sets_zero = last is not None and last.op in SETS_Z and last.d == 0 and last.writes_w
    if sets_zero and not gen.last_may_be_skipped:
        return
    # MOVLW, calls and the like do not set Z
    gen.emit("IORLW", k=0)


def jump(gen: FunctionGenerator, expr: tree.Expr, sense: bool, label: str) -> None:
    """Jump to `label` if the truth value of `expr` is `sense`, otherwise fall through."""
    match expr:
        case tree.Num(value):
            if bool(value) == sense:
                gen.goto(label)
        case tree.AddressOf():
            if sense:
                gen.goto(label)
        case tree.Unary("!", operand):
            jump(gen, operand, not sense, label)
        case tree.Logic(op, left, right):
            _logic_jump(gen, op == "||", left, right, sense, label)
        case tree.Comma(first, second):
            effect(gen, first)
            jump(gen, second, sense, label)
        case tree.Choice(condition, yes, no):
            other, end = gen.new_label(), gen.new_label()
            jump(gen, condition, False, other)
            jump(gen, yes, sense, label)
            gen.goto(end)
            gen.label(other)
            jump(gen, no, sense, label)
            gen.label(end)
        case tree.Binary(op) if op in COMPARISONS:
            comparison(gen, expr, sense, label)
        case tree.Binary("&") if _bit_test(gen, expr, sense, label):
            pass
        case tree.Cast(operand) if isinstance(expr.type, IntType) and _same_truth(expr):
            jump(gen, operand, sense, label)
        case tree.Cast(operand) if isinstance(expr.type, IntType) and expr.type.is_bit:
            _lowest_bit(gen, operand, sense, label)
        case tree.Ref() | tree.Deref() if expr.width == 1:
            _bit(gen, expr, sense, label)
        case tree.Update() if _counted(gen, expr, sense, label):
            pass
        case tree.Assign(target, value) if (
            not target.width and isinstance(target, tree.Ref) and is_direct(target) and not has_effect(target)
        ):
            effect(gen, expr)
            zero_test(gen, list(ref_locs(gen, target)))
            gen.goto_if(Z, not sense, label)
        case _:
            _nonzero(gen, expr, sense, label)


def _lowest_bit(gen: FunctionGenerator, operand: tree.Expr, sense: bool, label: str) -> None:
    """Jump on the lowest bit, which is all that a conversion to `bit` keeps."""
    byte = operands_of(gen, operand, 1)[0]
    if isinstance(byte, Imm):
        temporary = gen.temp()[0]
        gen.move_all([temporary], [byte])
        byte = temporary
    gen.goto_if(0, sense, label, bit_source(gen, byte))


def _same_truth(expr: tree.Cast) -> bool:
    """Return whether a conversion keeps the truth value of its operand."""
    assert isinstance(expr.type, IntType)
    if expr.type.is_bool and not expr.type.is_bit:
        return True
    if not isinstance(expr.operand.type, IntType):
        return False
    low, high = interval(expr.operand)
    return expr.type.low <= low and high <= expr.type.high


def _logic_jump(
    gen: FunctionGenerator, either: bool, left: tree.Expr, right: tree.Expr, sense: bool, label: str
) -> None:
    """Jump on `&&` or `||`; the right operand is evaluated only if the left one decides nothing."""
    if either == sense:
        jump(gen, left, sense, label)
        jump(gen, right, sense, label)
        return
    end = gen.new_label()
    jump(gen, left, not sense, end)
    jump(gen, right, sense, label)
    gen.label(end)


def _bit(gen: FunctionGenerator, expr: tree.Ref | tree.Deref, sense: bool, label: str) -> None:
    """Jump on one bit of memory."""
    assert expr.bit is not None
    if in_flash(expr):
        to_w(gen, field_byte(expr))
        gen.emit("ANDLW", k=1 << expr.bit)
        gen.goto_if(Z, not sense, label)
        return
    if isinstance(expr, tree.Ref) and expr.index is None:
        gen.goto_if(expr.bit, sense, label, bit_source(gen, gen.loc(expr.symbol, expr.offset)))
        return
    point_fsr(gen, field_byte(expr))
    gen.goto_if(expr.bit, sense, label, INDF)


def _bit_test(gen: FunctionGenerator, expr: tree.Binary, sense: bool, label: str) -> bool:
    """Jump on `x & 0x10` by testing one bit; return whether the expression had that form."""
    left, right = stripped(expr.left), expr.right
    if isinstance(expr.left, tree.Num):
        left, right = stripped(expr.right), expr.left
    if not isinstance(right, tree.Num) or not is_direct(left) or not isinstance(left, tree.Ref):
        return False
    mask = right.value & (1 << 8 * expr.type.size) - 1
    if mask.bit_count() != 1:
        return False
    bit = mask.bit_length() - 1
    if bit >= 8 * left.type.size:
        return False
    gen.goto_if(bit % 8, sense, label, bit_source(gen, gen.loc(left.symbol, left.offset + bit // 8)))
    return True


def _counted(gen: FunctionGenerator, expr: tree.Update, sense: bool, label: str) -> bool:
    """Jump on a one-byte `--n`, `n--` or `++n` with DECFSZ or INCFSZ; return whether that was possible."""
    target = expr.target
    if not (isinstance(target, tree.Ref) and is_direct(target) and target.type.size == 1):
        return False
    if expr.op not in "+-" or not isinstance(expr.value, tree.Num) or expr.value.value != 1:
        return False
    if isinstance(target.type, IntType) and target.type.is_bool:
        return False
    loc = ref_locs(gen, target)[0]
    # no bank switch can stand between a skip and what it skips
    if isinstance(loc, Reg) and loc.address & 0x80:
        return False
    if expr.post:
        if expr.op == "+" or exposed(loc):
            return False
        gen.emit("DECF", loc, 1)
        if sense:
            # n-- has the value from before: the new one plus 1, which is 0 where the jump is not taken
            gen.emit("INCFSZ", loc, 0)
            gen.goto(label)
        else:
            gen.emit("INCF", loc, 0)
            gen.goto_if(Z, True, label)
        return True
    if sense:
        gen.emit("DECFSZ" if expr.op == "-" else "INCFSZ", loc, 1)
        gen.goto(label)
    else:
        gen.emit("DECF" if expr.op == "-" else "INCF", loc, 1)
        gen.goto_if(Z, True, label)
    return True


def _nonzero(gen: FunctionGenerator, expr: tree.Expr, sense: bool, label: str) -> None:
    """Jump on any value: whether it is other than 0."""
    size = expr.type.size
    if isinstance(expr.type, IntType):
        size = min(size, width_of(*interval(expr))[0])
    if size == 1:
        to_w_with_zero(gen, expr)
    else:
        zero_test(gen, operands_of(gen, expr, size))
    gen.goto_if(Z, not sense, label)
