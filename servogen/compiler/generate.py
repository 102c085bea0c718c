"""Code for expressions: values into bytes, into W, into jumps, or for their effect only.

In: typed expressions. Out: instructions. Arithmetic is done in the fewest bytes that give the same result:
the low bytes of a sum depend on the low bytes of its operands only, and comparisons, divisions and right
shifts are as wide as the ranges of their operands ask.
"""

from __future__ import annotations

from servogen.compiler.arith import Arithmetic, imms
from servogen.compiler.ctypes import IntType, StructType, VoidType
from servogen.compiler.emitter import Code
from servogen.compiler.fold import COMPARISONS, has_effect, interval
from servogen.compiler.machine import FSR, INDF, Byte, Imm, Loc, Operand, Reg, Z
from servogen.compiler.tree import (
    AddressByte,
    AddressOf,
    Assign,
    Binary,
    Builtin,
    Call,
    Cast,
    Choice,
    Comma,
    Deref,
    Expr,
    Logic,
    Num,
    Ref,
    Symbol,
    Unary,
    Update,
)


def width_of(low: int, high: int) -> tuple[int, bool]:
    """(bytes, signed) that hold every value from `low` to `high`."""
    signed = low < 0
    size = 1
    while not (-(1 << 8 * size - 1) <= low and high < 1 << 8 * size - 1 if signed else high < 1 << 8 * size):
        size += 1
    return size, signed


def changes(expr: Expr) -> bool:
    """Whether evaluating it may change a variable; reading a volatile one does not count."""
    match expr:
        case Num():
            return False
        case Ref(index=index):
            return index is not None and changes(index)
        case Deref(pointer):
            return changes(pointer)
        case AddressOf(target):
            return changes(target)
        case Cast(operand) | Unary(_, operand):
            return changes(operand)
        case Binary(_, left, right) | Logic(_, left, right) | Comma(left, right):
            return changes(left) or changes(right)
        case Choice(condition, yes, no):
            return changes(condition) or changes(yes) or changes(no)
    return True


def calls_something(expr: Expr) -> bool:
    """Whether evaluating it may call a function or a library routine."""
    match expr:
        case Num():
            return False
        case Ref(symbol, _, index):
            return symbol.kind == "flash" or (index is not None and calls_something(index))
        case Deref(pointer):
            return pointer.type.size > 1 or calls_something(pointer)
        case AddressOf(target):
            return target.index is not None and calls_something(target.index)
        case Cast(operand) | Unary(_, operand):
            return calls_something(operand)
        case Binary(op, left, right):
            return op in ("*", "/", "%") or calls_something(left) or calls_something(right)
        case Logic(_, left, right) | Comma(left, right):
            return calls_something(left) or calls_something(right)
        case Choice(condition, yes, no):
            return calls_something(condition) or calls_something(yes) or calls_something(no)
        case Assign(target, value):
            return calls_something(target) or calls_something(value)
        case Update(_, target, value):
            return expr.op in ("*", "/", "%") or calls_something(target) or calls_something(value)
    return True


def touches(expr: Expr, locs: list[Loc]) -> bool:
    """Whether evaluating `expr` may read or change one of the bytes (given as symbols of the tree)."""
    symbols = {each.symbol for each in locs if isinstance(each, Byte)}
    registers = any(isinstance(each, Reg) for each in locs)
    return _touches(expr, symbols, registers)


def _touches(expr: Expr, symbols: set[Symbol], registers: bool) -> bool:
    match expr:
        case Num():
            return False
        case Ref(symbol, _, index):
            here = symbol in symbols or (registers and symbol.kind == "fixed")
            return here or (index is not None and _touches(index, symbols, registers))
        case Deref(pointer):
            return registers or any(each.pinned for each in symbols) or _touches(pointer, symbols, registers)
        case AddressOf(target):
            return target.index is not None and _touches(target.index, symbols, registers)
        case Cast(operand) | Unary(_, operand):
            return _touches(operand, symbols, registers)
        case Binary(_, left, right) | Logic(_, left, right) | Comma(left, right):
            return _touches(left, symbols, registers) or _touches(right, symbols, registers)
        case Choice(condition, yes, no):
            return any(_touches(each, symbols, registers) for each in (condition, yes, no))
        case Assign(target, value) | Update(_, target, value):
            return _touches(target, symbols, registers) or _touches(value, symbols, registers)
        case Call(_, arguments):
            outside = registers or any(each.static or each.pinned for each in symbols)
            return outside or any(_touches(each, symbols, registers) for each in arguments)
        case Builtin(_, arguments):
            return any(_touches(each, symbols, registers) for each in arguments)
    return True


class Generator(Arithmetic):
    """Adds expressions."""

    # values as operands

    def value(self, expr: Expr, size: int) -> list[Operand]:
        """Operands of the low `size` bytes; they stay good until something is assigned or called."""
        match expr:
            case Num(value):
                return imms(value, size)
            case AddressOf(target) if target.index is None:
                return self._address_operands(target, expr.type.size, size)
            case Ref() if self.direct(expr):
                return self.extended(list(self.ref_locs(expr)), expr, size)
            case Cast(operand) if isinstance(expr.type, IntType) and not expr.type.is_bool:
                if expr.type.size >= size and operand.type.scalar:
                    return self.value(operand, size)
                inner = self.value(operand, expr.type.size)
                return self.extended(inner, expr, size)
            case Cast(operand) if not isinstance(expr.type, (IntType, VoidType)) and operand.type.scalar:
                return self.extended(self._pointer_cast(expr), expr, size)
        need = min(size, expr.type.size, width_of(*interval(expr))[0])
        held: list[Loc] = self.temp(need)
        self.into(expr, held)
        return self.extended(list(held), expr, size)

    def _pointer_cast(self, expr: Cast) -> list[Operand]:
        operand, size = expr.operand, expr.type.size
        return self.value(operand, size)

    def _address_operands(self, target: Ref, have: int, size: int) -> list[Operand]:
        symbol = self.symbol(target.symbol)
        found: list[Operand] = [
            Imm(AddressByte(symbol, target.offset, part)) for part in range(min(have, size))
        ]
        return found + imms(0, size - len(found))

    def extended(self, operands: list[Operand], expr: Expr, size: int) -> list[Operand]:
        """The bytes of a value, widened by its sign or zeros, or cut."""
        if len(operands) >= size:
            return operands[:size]
        missing = size - len(operands)
        if not self.negative_possible(expr):
            return operands + imms(0, missing)
        sign = self.sign_byte(operands[-1])
        return operands + [sign] * missing

    def negative_possible(self, expr: Expr) -> bool:
        return isinstance(expr.type, IntType) and expr.type.signed and interval(expr)[0] < 0

    def direct(self, expr: Expr) -> bool:
        """A whole variable, or a part of one at a known offset."""
        return isinstance(expr, Ref) and expr.index is None and not expr.width and expr.symbol.kind != "flash"

    def ref_locs(self, expr: Ref) -> list[Loc]:
        return self.locs(expr.symbol, expr.offset, expr.type.size)

    # values into bytes

    def into(self, expr: Expr, target: list[Loc]) -> None:
        """Store the low len(target) bytes of a value, widened where it has fewer."""
        before = self.place
        method = getattr(self, "_into_" + type(expr).__name__.removeprefix("Const"))
        method(expr, target)
        self.place = before

    def _into_Num(self, expr: Num, target: list[Loc]) -> None:
        self.move_all(target, imms(expr.value, len(target)))

    def _into_Ref(self, expr: Ref, target: list[Loc]) -> None:
        if self.direct(expr):
            self.move_all(target, self.value(expr, len(target)))
        elif expr.width:
            self._into_field(expr, target)
        elif expr.symbol.kind == "flash":
            self._from_flash(expr, target)
        else:
            self._indirect_load(expr, target)

    def _into_Deref(self, expr: Deref, target: list[Loc]) -> None:
        if expr.width:
            self._into_field(expr, target)
        elif expr.pointer.type.size > 1:
            self._wide_load(expr, target)
        else:
            self._indirect_load(expr, target)

    def _into_AddressOf(self, expr: AddressOf, target: list[Loc]) -> None:
        if expr.target.index is None:
            self.move_all(target, self.value(expr, len(target)))
            return
        index = expr.target.index
        base = self._address_operands(expr.target, expr.type.size, min(len(target), expr.type.size))
        offset = self.value(index, len(base))
        self.add(target[: len(base)], offset, base)
        self.move_all(target[len(base) :], imms(0, len(target) - len(base)))

    def _into_Cast(self, expr: Cast, target: list[Loc]) -> None:
        if isinstance(expr.type, VoidType):
            self.effect(expr.operand)
            return
        if isinstance(expr.type, IntType) and expr.type.is_bool:
            if expr.type.is_bit:
                self._boolean(expr, target)  # only the lowest bit counts
            else:
                self._boolean(expr, target)
            return
        size = expr.type.size
        if isinstance(expr.type, StructType):
            self.into(expr.operand, target)
        elif len(target) <= size:
            if expr.operand.type.scalar:
                self.into(expr.operand, target)
            else:
                self.move_all(target, self.value(expr.operand, len(target)))
        else:
            self.into(expr.operand, target[:size])
            self.widen(target, size, signed=self.negative_possible(expr))

    def widen(self, target: list[Loc], size: int, *, signed: bool) -> None:
        """Fill the bytes above `size` with the sign or zeros."""
        fill: Operand = Imm(0)
        if signed:
            top = target[size]
            self.emit("CLRF", top)
            self.skip_if(7, False, target[size - 1])
            self.emit("COMF", top, 1)
            self.move_all(target[size + 1 :], [top] * (len(target) - size - 1))
            return
        self.move_all(target[size:], [fill] * (len(target) - size))

    def _into_Unary(self, expr: Unary, target: list[Loc]) -> None:
        if expr.op == "!":
            self._boolean(expr, target)
            return
        size = min(len(target), expr.type.size)
        operand = self.value(expr.operand, size)
        part = target[:size]
        operand = self.apart(part, operand)
        (self.negate if expr.op == "-" else self.complement)(part, operand)
        if len(target) > size:
            self.widen(target, size, signed=self.negative_possible(expr))

    def _into_Logic(self, expr: Logic, target: list[Loc]) -> None:
        self._boolean(expr, target)

    def _boolean(self, expr: Expr, target: list[Loc]) -> None:
        """0 or 1 by a condition."""
        if target and isinstance(target[0], Byte) and not touches(expr, target):
            self.move_all(target, imms(0, len(target)))
            end = self.new_label()
            self.jump(expr, False, end)
            self.emit("INCF", target[0], 1)
            self.label(end)
            return
        self.condition_to_w(expr)
        self.store(target[0])
        self.move_all(target[1:], imms(0, len(target) - 1))

    def condition_to_w(self, expr: Expr) -> None:
        no, end = self.new_label(), self.new_label()
        self.jump(expr, False, no)
        self.emit("MOVLW", k=1)
        self.goto(end)
        self.label(no)
        self.emit("MOVLW", k=0)
        self.label(end)

    def _into_Choice(self, expr: Choice, target: list[Loc]) -> None:
        no, end = self.new_label(), self.new_label()
        part = target[: expr.type.size]
        self.jump(expr.condition, False, no)
        self.into(expr.yes, part)
        self.goto(end)
        self.label(no)
        self.into(expr.no, part)
        self.label(end)
        if len(target) > len(part):
            self.widen(target, len(part), signed=self.negative_possible(expr))

    def _into_Comma(self, expr: Comma, target: list[Loc]) -> None:
        self.effect(expr.first)
        self.into(expr.second, target)

    def _into_Assign(self, expr: Assign, target: list[Loc]) -> None:
        if isinstance(expr.type, IntType) and not expr.target.width and not expr.target.type.volatile:
            held: list[Loc] = self.temp(expr.type.size)
            self.into(expr.value, held)
            self.assign_bytes(expr.target, list(held))
            self.move_all(target, self.extended(list(held), expr, len(target)))
            return
        self.effect(expr)
        self._read_back(expr.target, target)

    def _read_back(self, source: Ref | Deref, target: list[Loc]) -> None:
        self.into(source, target)

    def _into_Update(self, expr: Update, target: list[Loc]) -> None:
        if isinstance(expr.target, Ref) and self.direct(expr.target):
            if expr.post:
                self.move_all(target, self.value(expr.target, len(target)))
                self.effect(expr)
            else:
                self.effect(expr)
                self.move_all(target, self.value(expr.target, len(target)))
            return
        # the address is evaluated once: an index or pointer with effects must not run twice
        source = self.settled(expr.target)
        if expr.post:
            self.into(source, target)
            self._update(expr, source)
        else:
            self._update(expr, source)
            self.into(source, target)

    def _into_Call(self, expr: Call, target: list[Loc]) -> None:
        code = self.call(expr)
        if code.returns_w:
            self.store(target[0])
            self._widen_result(expr, target, 1)
            return
        assert code.result is not None
        result: list[Operand] = [Byte(code.result, each) for each in range(min(expr.type.size, len(target)))]
        self.move_all(target[: len(result)], result)
        self._widen_result(expr, target, len(result))

    def _widen_result(self, expr: Expr, target: list[Loc], size: int) -> None:
        if len(target) > size:
            self.widen(target, size, signed=self.negative_possible(expr))

    def _into_Builtin(self, expr: Builtin, target: list[Loc]) -> None:
        self.builtin(expr)
        self.store(target[0])
        self.move_all(target[1:], imms(0, len(target) - 1))

    def builtin(self, expr: Builtin) -> None:
        raise NotImplementedError

    def call(self, expr: Call) -> Code:
        raise NotImplementedError

    # binary operators

    def _into_Binary(self, expr: Binary, target: list[Loc]) -> None:
        if expr.op in COMPARISONS:
            self._boolean(expr, target)
            return
        need = min(len(target), expr.type.size, width_of(*interval(expr))[0])
        part = target[:need]
        match expr.op:
            case "+" | "-" | "&" | "|" | "^":
                self._simple(expr, part)
            case "<<":
                self._shift(expr, part, left=True)
            case ">>":
                self._right_shift(expr, part)
            case "*":
                self.multiply(expr, part)
            case _:
                self.divide(expr, part)
        if len(target) > need:
            self.widen(target, need, signed=self.negative_possible(expr))

    def multiply(self, expr: Binary, target: list[Loc]) -> None:
        raise NotImplementedError

    def divide(self, expr: Binary, target: list[Loc]) -> None:
        raise NotImplementedError

    def pair(self, left: Expr, right: Expr, size: int) -> tuple[list[Operand], list[Operand]]:
        """Operands of two values; the first survives the evaluation of the second."""
        if not has_effect(right) and not calls_something(right):
            a = self.value(left, size)
            return a, self.value(right, size)
        b_first = not has_effect(left) and not calls_something(left)
        if b_first:
            b = self.kept(self.value(right, size))
            return self.value(left, size), b
        a = self.kept(self.value(left, size))
        return a, self.value(right, size)

    def kept(self, operands: list[Operand]) -> list[Operand]:
        """Copies of the operands that are variables, so that nothing can change them."""
        variables = [each for each in operands if not isinstance(each, Imm) and not self._is_temp(each)]
        if not variables:
            return operands
        held: list[Loc] = self.temp(len(operands))
        self.move_all(held, operands)
        return list(held)

    def _is_temp(self, operand: Operand) -> bool:
        return isinstance(operand, Byte) and operand.symbol.kind == "temp"

    def apart(self, target: list[Loc], operands: list[Operand]) -> list[Operand]:
        """Operands of which no byte is a target byte of another position."""
        for number, each in enumerate(operands):
            if any(each == t and at != number for at, t in enumerate(target)):
                held: list[Loc] = self.temp(len(operands))
                self.move_all(held, operands)
                return list(held)
        return operands

    def _simple(self, expr: Binary, target: list[Loc]) -> None:
        size = len(target)
        if size == 1 and self._through_w(expr, target[0]):
            return
        a, b = self.pair(expr.left, expr.right, size)
        a, b = self.apart(target, a), self.apart(target, b)
        if size > 1 and any(isinstance(each, Reg) for each in target):  # written once, with the result
            held: list[Loc] = self.temp(size)
            self._apply(expr.op, held, a, b)
            self.move_all(target, list(held))
            return
        self._apply(expr.op, target, a, b)

    def _apply(self, op: str, target: list[Loc], a: list[Operand], b: list[Operand]) -> None:
        if op == "+":
            self.add(target, a, b)
        elif op == "-":
            self.subtract(target, a, b)
        else:
            self.bitwise(op, target, a, b)

    def _through_w(self, expr: Binary, target: Loc) -> bool:
        """One byte: compute in W, store once. True when it was done that way."""
        left, right = expr.left, expr.right
        if self._simple_operand(left) and self.value(left, 1)[0] == target:
            return False
        if expr.op != "-" and self._simple_operand(right) and self.value(right, 1)[0] == target:
            return False
        self.binary_w(expr)
        self.store(target)
        return True

    def binary_w(self, expr: Binary) -> None:
        """W = the low byte of a sum, difference or bitwise operation."""
        left, right, op = expr.left, expr.right, expr.op
        if (op != "-" and self._simple_operand(left) and not self._simple_operand(right)) or (
            op != "-" and self._constant(left)
        ):
            left, right = right, left
        if self._constant(right):
            value = self.value(right, 1)[0]
            assert isinstance(value, Imm)
            if op == "-":
                if isinstance(value.value, int):
                    self.to_w(left)
                    self._w_constant("+", -value.value & 0xFF)
                    return
            else:
                self.to_w(left)
                self._w_constant(op, value.value)
                return
        if op == "-" and self._constant(left):
            self.to_w(right)
            value = self.value(left, 1)[0]
            assert isinstance(value, Imm)
            self.emit("SUBLW", k=value.value)
            return
        mnemonic = {"+": "ADDWF", "-": "SUBWF", "&": "ANDWF", "|": "IORWF", "^": "XORWF"}[op]
        if op == "-":
            # f - W: the left operand must be in memory, the right one in W
            if self._simple_operand(left) and not changes(right):
                self.to_w(right)
                self.emit(mnemonic, self.value(left, 1)[0], 0)  # type: ignore[arg-type]
                return
            held = self.temp()[0]
            self.into(left, [held])
            self.to_w(right)
            self.emit(mnemonic, held, 0)
            return
        if self._simple_operand(right) and not changes(left):
            self.to_w(left)
            self.emit(mnemonic, self.value(right, 1)[0], 0)  # type: ignore[arg-type]
            return
        held = self.temp()[0]
        self.into(left, [held])
        self.to_w(right)
        self.emit(mnemonic, held, 0)

    def _w_constant(self, op: str, value: int | AddressByte) -> None:
        mnemonic = {"+": "ADDLW", "&": "ANDLW", "|": "IORLW", "^": "XORLW"}[op]
        neutral = 0xFF if op == "&" else 0
        if value != neutral:
            self.emit(mnemonic, k=value)

    def _constant(self, expr: Expr) -> bool:
        return isinstance(_stripped(expr), Num) or (
            isinstance(_stripped(expr), AddressOf) and _stripped(expr).target.index is None  # type: ignore[union-attr]
        )

    def _simple_operand(self, expr: Expr) -> bool:
        """Its low byte is a byte of memory already."""
        return self.direct(_stripped(expr))

    def to_w(self, expr: Expr) -> None:
        """W = the low byte of a value."""
        inner = _stripped(expr)
        if isinstance(inner, Num) or self.direct(inner):
            self.load(self.value(inner, 1)[0])
        elif isinstance(inner, Binary) and inner.op in ("+", "-", "&", "|", "^"):
            self.binary_w(inner)
        elif isinstance(inner, Unary) and inner.op in ("-", "~"):
            self._unary_w(inner)
        elif isinstance(inner, Call):
            code = self.call(inner)
            if not code.returns_w:
                assert code.result is not None
                self.load(Byte(code.result, 0))
        elif isinstance(inner, Builtin):
            self.builtin(inner)
        elif isinstance(inner, (Ref, Deref)) and self._one_byte_indirect(inner):
            return
        elif _is_condition(inner):
            self.condition_to_w(inner)
        else:
            self.load(self.value(inner, 1)[0])

    def _unary_w(self, expr: Unary) -> None:
        operand = _stripped(expr.operand)
        if expr.op == "~":
            if self.direct(operand):
                self.emit("COMF", self.value(operand, 1)[0], 0)  # type: ignore[arg-type]
            else:
                self.to_w(operand)
                self.emit("XORLW", k=0xFF)
        else:
            self.to_w(operand)
            self.emit("SUBLW", k=0)

    # shifts

    def _shift(self, expr: Binary, target: list[Loc], *, left: bool) -> None:
        size = len(target)
        count = expr.right
        if isinstance(count, Num):
            operand = self.apart(target, self.value(expr.left, size))
            if left:
                self._apart_shift(target, operand, lambda t, o: self.shift_left(t, o, count.value & 0xFF))
            return
        self._variable_shift(expr, target, size, left=left, signed=False)

    def _apart_shift(self, target: list[Loc], operand: list[Operand], shift: object) -> None:
        if any(isinstance(each, Reg) for each in target):
            held: list[Loc] = self.temp(len(target))
            shift(held, operand)  # type: ignore[operator]
            self.move_all(target, list(held))
        else:
            shift(target, operand)  # type: ignore[operator]

    def _right_shift(self, expr: Binary, target: list[Loc]) -> None:
        low, high = interval(expr.left)
        size, signed = width_of(low, high)
        size = min(size, expr.left.type.size)
        count = expr.right
        size = max(size, len(target))
        work = target if len(target) == size else self.temp(size)
        if isinstance(count, Num):
            operand = self.apart(work, self.value(expr.left, size))
            self._apart_shift(
                work, operand, lambda t, o: self.shift_right(t, o, count.value & 0xFF, signed=signed)
            )
        else:
            self._variable_shift(expr, work, size, left=False, signed=signed)
        if work is not target:
            self.move_all(target, list(work[: len(target)]))

    def _variable_shift(
        self, expr: Binary, target: list[Loc], size: int, *, left: bool, signed: bool
    ) -> None:
        held: list[Loc] = self.temp(size)
        count = self.temp()[0]
        if has_effect(expr.left) or calls_something(expr.right) or has_effect(expr.right):
            a, b = self.pair(expr.left, expr.right, size)
            self.move(count, b[0])
            self.move_all(held, a)
        else:
            self.into(expr.right, [count])
            self.into(expr.left, held)
        loop, end = self.new_label(), self.new_label()
        self.emit("MOVF", count, 1)
        self.goto_if(Z, True, end)
        self.label(loop)
        if left:
            self.one_left(held)
        else:
            self.one_right(held, signed=signed)
        self.emit("DECFSZ", count, 1)
        self.goto(loop)
        self.label(end)
        self.move_all(target, list(held))

    # memory behind an index or a pointer

    def settled(self, target: Ref | Deref) -> Ref | Deref:
        """The same object with its address computed once, into a temporary."""
        from servogen.compiler.ctypes import U8, PointerType

        if isinstance(target, Ref) and (target.index is None or isinstance(target.index, Num)):
            return target
        if isinstance(target, Deref) and self.direct(target.pointer) and not has_effect(target.pointer):
            return target
        held = self.temp()
        self.address_to_w(target)
        self.store(held[0])
        assert isinstance(held[0], Byte)
        pointer = Ref(held[0].symbol, 0, None, PointerType(U8), target.place)
        return Deref(pointer, 0, target.type, target.place, target.bit, target.width)

    def address_to_w(self, target: Ref | Deref) -> None:
        """W = the RAM address of an object."""
        if isinstance(target, Ref):
            base = AddressByte(self.symbol(target.symbol), target.offset, 0)
            if target.index is None:
                self.emit("MOVLW", k=base)
                return
            self.to_w(target.index)
            self.emit("ADDLW", k=base)
            return
        self.to_w(target.pointer)
        if target.offset:
            self.emit("ADDLW", k=target.offset)

    def point(self, target: Ref | Deref) -> None:
        """FSR = the address of an object."""
        self.address_to_w(target)
        self.store(FSR)

    def _one_byte_indirect(self, expr: Ref | Deref) -> bool:
        """Load one byte through FSR or from flash straight into W."""
        if expr.width or (isinstance(expr, Deref) and expr.pointer.type.size > 1):
            return False
        if isinstance(expr, Ref) and expr.symbol.kind == "flash":
            self.flash_byte(expr)
            return True
        self.point(expr)
        self.emit("MOVF", INDF, 0)
        return True

    def flash_byte(self, expr: Ref) -> None:
        raise NotImplementedError

    def _from_flash(self, expr: Ref, target: list[Loc]) -> None:
        raise NotImplementedError

    def _wide_load(self, expr: Deref, target: list[Loc]) -> None:
        raise NotImplementedError

    def _indirect_load(self, expr: Ref | Deref, target: list[Loc]) -> None:
        size = min(len(target), expr.type.size)
        self.point(expr)
        for number in range(size):
            if number:
                self.emit("INCF", FSR, 1)
            self.emit("MOVF", INDF, 0)
            self.store(target[number])
        if len(target) > size:
            self.widen(target, size, signed=self.negative_possible(expr))

    # bit-fields

    def _into_field(self, expr: Ref | Deref, target: list[Loc]) -> None:
        assert expr.bit is not None
        signed = isinstance(expr.type, IntType) and expr.type.signed
        if expr.width == 1 and not signed:
            self._boolean(expr, target)
            return
        byte = self.field_byte(expr)
        self.into(byte, target[:1])
        self.shift_right(target[:1], list(target[:1]), expr.bit, signed=False)
        self.bitwise("&", target[:1], list(target[:1]), [Imm((1 << expr.width) - 1)])
        if signed:
            self.emit("MOVLW", k=1 << expr.width - 1)
            self.emit("XORWF", target[0], 1)
            self.emit("SUBWF", target[0], 1)
        if len(target) > 1:
            self.widen(target, 1, signed=signed)

    def field_byte(self, expr: Ref | Deref) -> Ref | Deref:
        """The byte that holds a bit-field."""
        from servogen.compiler.ctypes import U8

        if isinstance(expr, Ref):
            return Ref(expr.symbol, expr.offset, expr.index, U8, expr.place)
        return Deref(expr.pointer, expr.offset, U8, expr.place)

    # assignments

    def assign_bytes(self, target: Ref | Deref, value: list[Operand]) -> None:
        """Store bytes that are ready; they are temporaries or constants."""
        if isinstance(target, Ref) and self.direct(target):
            self.move_all(self.ref_locs(target), value)
            return
        self.point(target)
        for number, each in enumerate(value):
            if number:
                self.emit("INCF", FSR, 1)
            self.move(INDF, each)

    def effect(self, expr: Expr) -> None:
        """Evaluate for what it does."""
        before = self.place
        self.place = expr.place if expr.place.line else self.place
        self._effect(expr)
        self.place = before

    def _effect(self, expr: Expr) -> None:
        match expr:
            case Assign(target, value):
                self._assign(target, value)
            case Update():
                direct = isinstance(expr.target, Ref) and (self.direct(expr.target) or expr.target.width)
                source = expr.target if direct else self.settled(expr.target)
                self._update(expr, source)
            case Cast(operand) | Unary(_, operand):
                self._effect(operand)
            case Binary(_, left, right):
                self._effect(left)
                self._effect(right)
            case Comma(first, second):
                self._effect(first)
                self._effect(second)
            case Logic(op, left, right):
                end = self.new_label()
                self.jump(left, op == "||", end)
                self._effect(right)
                self.label(end)
            case Choice(condition, yes, no):
                other, end = self.new_label(), self.new_label()
                self.jump(condition, False, other)
                self._effect(yes)
                self.goto(end)
                self.label(other)
                self._effect(no)
                self.label(end)
            case Call():
                self.call(expr)
            case Builtin():
                self.builtin(expr)
            case Ref() | Deref() if has_effect(expr):
                if expr.type.scalar:
                    self.to_w(expr)

    def _assign(self, target: Ref | Deref, value: Expr) -> None:
        if target.width:
            self.assign_field(target, value)
            return
        size = target.type.size
        if isinstance(target, Ref) and self.direct(target):
            self._assign_direct(self.ref_locs(target), target, value)
            return
        if size == 1 and isinstance(value.type, IntType):
            if not has_effect(value) and self._operand_ready(value):
                self.point(target)
                self.move(INDF, self.value(value, 1)[0])
                return
            simple_address = not has_effect(target) and not calls_something(target)
            held = self.temp()[0]
            self.into(value, [held])
            del simple_address
            self.point(target)
            self.move(INDF, held)
            return
        operands = self.value(value, size) if value.type.scalar else self._struct_value(value)
        if has_effect(target) or calls_something(target):
            operands = self.kept(operands)
        self.assign_bytes(target, operands)

    def _operand_ready(self, value: Expr) -> bool:
        return self._constant(value) or self._simple_operand(value)

    def _struct_value(self, value: Expr) -> list[Operand]:
        if isinstance(value, Ref) and self.direct(value):
            return list(self.ref_locs(value))
        held: list[Loc] = self.temp(value.type.size)
        self.into(value, held)
        return list(held)

    def _assign_direct(self, locs: list[Loc], target: Ref, value: Expr) -> None:
        """A variable: in place where that is safe, else through a temporary."""
        multi_port = len(locs) > 1 and isinstance(locs[0], Reg)
        symbol_locs: list[Loc] = [Byte(target.symbol, 0)] if isinstance(locs[0], Byte) else locs
        if not multi_port and (self._in_place(value, locs) or not touches(value, symbol_locs)):
            self.into(value, locs)
            return
        if len(locs) == 1 and (isinstance(value.type, IntType) or value.type.scalar):
            self.to_w(value)
            self.store(locs[0])
            return
        held: list[Loc] = self.temp(len(locs))
        self.into(value, held)
        self.move_all(locs, list(held))

    def _in_place(self, value: Expr, locs: list[Loc]) -> bool:
        """Whether `into` may write the target although the value reads it: x = x + y, x = -x, x = x << 3."""
        inner = _stripped(value)
        symbols: list[Loc] = [each if isinstance(each, Reg) else Byte(each.symbol, 0) for each in locs]
        if inner.type.size < len(locs) or (len(locs) > 1 and isinstance(locs[0], Reg)):
            return False
        if self.direct(inner):
            return True
        if isinstance(inner, Unary) and inner.op in "-~" and isinstance(locs[0], Byte):
            return self._same_bytes(inner.operand, locs)
        if isinstance(inner, Binary) and inner.op in ("+", "-", "&", "|", "^"):
            if self._same_bytes(inner.left, locs) and not touches(inner.right, symbols):
                return not calls_something(inner.right) and not has_effect(inner.right)
            return (
                inner.op != "-"
                and self._same_bytes(inner.right, locs)
                and not touches(inner.left, symbols)
                and not calls_something(inner.left)
                and not has_effect(inner.left)
            )
        if isinstance(inner, Binary) and inner.op in ("<<", ">>") and isinstance(locs[0], Byte):
            return self._same_bytes(inner.left, locs) and isinstance(inner.right, Num)
        return False

    def _same_bytes(self, expr: Expr, locs: list[Loc]) -> bool:
        inner = _stripped(expr)
        return self.direct(inner) and self.ref_locs(inner)[: len(locs)] == locs  # type: ignore[arg-type]

    def _update(self, expr: Update, target: Ref | Deref) -> None:
        """target = target op value"""
        place = expr.place
        kind = target.type
        if isinstance(kind, IntType):
            old: Expr = target if kind.plain() == expr.work else Cast(target, expr.work, place)
        else:
            old = Cast(target, expr.work, place)
        right = expr.value
        if expr.op not in ("<<", ">>") and right.type.plain() != expr.work:
            right = (
                Num(right.value, expr.work, place)
                if isinstance(right, Num)
                else Cast(right, expr.work, place)
            )
        whole: Expr = Binary(expr.op, old, right, expr.work, place)
        if expr.op in "*/" and isinstance(right, Num) and right.value == 1:
            return
        plain = not target.width and not (isinstance(kind, IntType) and kind.is_bool)
        behind = plain and kind.size == 1 and not (isinstance(target, Ref) and self.direct(target))
        if behind and self._update_indirect(expr.op, target, right):
            return
        if isinstance(kind, IntType):
            whole = whole if kind.plain() == expr.work else Cast(whole, kind.plain(), place)
        self._assign(target, whole)

    def _update_indirect(self, op: str, target: Ref | Deref, right: Expr) -> bool:
        """One byte behind FSR, changed where it lies."""
        mnemonic = {"+": "ADDWF", "-": "SUBWF", "&": "ANDWF", "|": "IORWF", "^": "XORWF"}.get(op)
        if mnemonic is None:
            return False
        if isinstance(right, Num) and op in "+-" and right.value & 0xFF in (1, 0xFF):
            self.point(target)
            up = (right.value & 0xFF == 1) == (op == "+")
            self.emit("INCF" if up else "DECF", INDF, 1)
            return True
        if self._operand_ready(right):
            self.point(target)
            self.load(self.value(right, 1)[0])
        else:
            held = self.temp()[0]
            self.into(right, [held])
            self.point(target)
            self.load(held)
        self.emit(mnemonic, INDF, 1)
        return True

    def bit_source(self, loc: Loc) -> Loc:
        """Where a bit can be tested: registers of bank 1 are copied first, no switch can follow a skip."""
        if isinstance(loc, Reg) and loc.address & 0x80:
            held = self.temp()[0]
            self.move(held, loc)
            return held
        return loc

    def assign_field(self, target: Ref | Deref, value: Expr) -> None:
        """A bit or bit-field."""
        assert target.bit is not None
        byte: Loc
        if isinstance(target, Ref) and target.index is None:
            byte = self.loc(target.symbol, target.offset)
            pointed = False
        else:
            pointed = True
            byte = INDF
        if target.width == 1 and not (isinstance(target.type, IntType) and target.type.signed):
            self._assign_bit(target, byte, value, pointed=pointed)
            return
        mask = (1 << target.width) - 1
        if isinstance(value, Num):
            if pointed:
                self.point(self.field_byte(target))
            self.emit("MOVF", byte, 0)
            self.emit("ANDLW", k=~(mask << target.bit))
            if value.value & mask:
                self.emit("IORLW", k=(value.value & mask) << target.bit)
            self.store(byte)
            return
        held = self.temp()
        self.into(value, held)
        self.shift_left(held, list(held), target.bit)
        self.bitwise("&", held, list(held), [Imm(mask << target.bit & 0xFF)])
        if pointed:
            self.point(self.field_byte(target))
        self.emit("MOVF", byte, 0)
        self.emit("ANDLW", k=~(mask << target.bit))
        self.emit("IORWF", held[0], 0)
        self.store(byte)

    def _assign_bit(self, target: Ref | Deref, byte: Loc, value: Expr, *, pointed: bool) -> None:
        bit = target.bit or 0
        low_bit_only = isinstance(value, Cast) and isinstance(value.type, IntType) and value.type.is_bit
        if isinstance(value, Num):
            if pointed:
                self.point(self.field_byte(target))
            self.emit("BSF" if value.value & 1 else "BCF", byte, b=bit)
            return
        if low_bit_only:
            assert isinstance(value, Cast)
            value = value.operand if _is_condition(value.operand) else value
        if pointed:
            held = self.temp()[0]
            self.into(value, [held])
            self.point(self.field_byte(target))
            source: Loc = held
            source_bit = 0
        else:
            inner = value
            if isinstance(inner, Cast) and isinstance(inner.type, IntType) and inner.type.is_bit:
                inner = inner.operand
            if isinstance(inner, Ref) and inner.width == 1 and inner.index is None:
                source = self.bit_source(self.loc(inner.symbol, inner.offset))
                source_bit = inner.bit or 0
                if source == byte and source_bit == bit:
                    return
            else:
                no, end = self.new_label(), self.new_label()
                self.jump(value, False, no)
                self.emit("BSF", byte, b=bit)
                self.goto(end)
                self.label(no)
                self.emit("BCF", byte, b=bit)
                self.label(end)
                return
        if isinstance(source, Reg) or source == byte:
            held = self.temp()[0]
            self.emit("CLRF", held)
            self.skip_if(source_bit, False, source)
            self.emit("INCF", held, 1)
            source, source_bit = held, 0
        if isinstance(byte, Reg) and byte.address & 0x80:
            no, end = self.new_label(), self.new_label()
            self.goto_if(source_bit, False, no, source)
            self.emit("BSF", byte, b=bit)
            self.goto(end)
            self.label(no)
            self.emit("BCF", byte, b=bit)
            self.label(end)
            return
        self.skip_if(source_bit, False, source)
        self.emit("BSF", byte, b=bit)
        self.skip_if(source_bit, True, source)
        self.emit("BCF", byte, b=bit)

    def jump(self, expr: Expr, sense: bool, label: str) -> None:
        raise NotImplementedError


def _stripped(expr: Expr) -> Expr:
    """Without the integer conversions that do not change the low byte."""
    while isinstance(expr, Cast) and isinstance(expr.type, IntType) and not expr.type.is_bool:
        if not expr.operand.type.scalar:
            break
        expr = expr.operand
    return expr


def _is_condition(expr: Expr) -> bool:
    if isinstance(expr, Logic) or (isinstance(expr, Unary) and expr.op == "!"):
        return True
    if isinstance(expr, (Ref, Deref)) and expr.width == 1 and isinstance(expr.type, IntType):
        return not expr.type.signed
    return isinstance(expr, Binary) and expr.op in COMPARISONS
