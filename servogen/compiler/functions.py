"""Code for statements, calls and whole functions.

In: a function of the typed tree. Out: its `Code`. Arguments go into the callee's own bytes; the last
argument of one byte goes in W. A result of one byte comes back in W, wider ones in the callee's result bytes.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.arith import imms
from servogen.compiler.conditions import Conditions
from servogen.compiler.ctypes import IntType, VoidType
from servogen.compiler.emitter import ISR_SUFFIX, Code
from servogen.compiler.fold import COMPARISONS, compare, has_effect, interval
from servogen.compiler.generate import calls_something, width_of
from servogen.compiler.inline_asm import AsmError, assemble_line
from servogen.compiler.machine import Byte, Imm, Ins, Loc, Operand, Z
from servogen.compiler.tables import table_name
from servogen.compiler.tree import (
    AddressByte,
    Asm,
    Assign,
    Binary,
    Block,
    Builtin,
    Call,
    CaseLabel,
    Cast,
    Deref,
    Expr,
    ExprStmt,
    If,
    Jump,
    LabelStmt,
    Loop,
    Num,
    Ref,
    Return,
    Stmt,
    Switch,
    Symbol,
)
from servogen.errors import Place


class FunctionGenerator(Conditions):
    """Makes the code of one function."""

    def __init__(
        self,
        function: object,
        signature: Callable[[str], Code],
        isr: bool,
        symbol: Callable[[Symbol], Symbol],
        library: Callable[[str, tuple[int, ...]], Code],
    ) -> None:
        super().__init__(function, signature, isr)  # type: ignore[arg-type]
        self._map = symbol
        self.library = library
        self._break: list[str] = []
        self._continue: list[str] = []
        self._cases: dict[CaseLabel, str] = {}
        self._user_labels: dict[str, str] = {}
        self._end = self.new_label("end")

    def symbol(self, symbol: Symbol) -> Symbol:
        return self._map(symbol)

    def generate(self) -> Code:
        function = self.function
        assert function.body is not None
        self.place = function.place
        if self.code.w_parameter is not None:
            self.store(Byte(self.code.w_parameter, 0))
        self.statement(function.body)
        self.label(self._end)
        self.place = None
        if function.interrupt:
            self.emit("RETFIE")
        elif function.name == "main":
            self.goto(self._end)  # there is nothing to return to
        else:
            self.emit("RETURN")
        return self.code

    # statements

    def statement(self, node: Stmt) -> None:
        getattr(self, "_stmt_" + type(node).__name__)(node)

    def _stmt_Block(self, node: Block) -> None:
        before: Stmt | None = None
        for each in node.body:
            if (
                isinstance(each, Loop)
                and not each.post
                and before is not None
                and _holds_at_first(each, before)
            ):
                self._loop(each, entered=True)
            else:
                self.statement(each)
            before = each

    def _stmt_ExprStmt(self, node: ExprStmt) -> None:
        self.effect(node.expr)

    def _stmt_If(self, node: If) -> None:
        self.place = node.place
        if node.no is None:
            end = self.new_label()
            if isinstance(node.yes, Jump) and node.yes.kind in ("break", "continue"):
                target = (self._break if node.yes.kind == "break" else self._continue)[-1]
                self.jump(node.condition, True, target)
                return
            self.jump(node.condition, False, end)
            self.statement(node.yes)
            self.label(end)
            return
        other, end = self.new_label(), self.new_label()
        self.jump(node.condition, False, other)
        self.statement(node.yes)
        self.goto(end)
        self.label(other)
        self.statement(node.no)
        self.label(end)

    def _stmt_Loop(self, node: Loop) -> None:
        self._loop(node, entered=False)

    def _loop(self, node: Loop, *, entered: bool) -> None:
        """The test stands in front, or at the end when it surely holds at first."""
        self.place = node.place
        top, again, end = (self.new_label(hint) for hint in ("top", "again", "end"))
        self._break.append(end)
        self._continue.append(again)
        self.label(top)
        in_front = node.condition is not None and not node.post and not entered
        if node.condition is not None and in_front:
            self.jump(node.condition, False, end)
        self.statement(node.body)
        self.label(again)
        if node.step is not None:
            self.effect(node.step)
        self.place = node.place
        if node.condition is not None and not in_front:
            self.jump(node.condition, True, top)
        else:
            self.goto(top)
        self.label(end)
        self._break.pop()
        self._continue.pop()

    def _stmt_Switch(self, node: Switch) -> None:
        self.place = node.place
        end = self.new_label()
        for _, label in node.cases:
            self._cases[label] = self.new_label("case")
        if node.default is not None:
            self._cases[node.default] = self.new_label("default")
        self._dispatch(node)
        self.goto(self._cases[node.default] if node.default is not None else end)
        self._break.append(end)
        self.statement(node.body)
        self._break.pop()
        self.label(end)

    def _dispatch(self, node: Switch) -> None:
        low, high = interval(node.value)
        possible = [(value, label) for value, label in node.cases if low <= value <= high]
        size, _ = width_of(low, high)
        if not possible:
            self.effect(node.value)
            return
        if size == 1:
            self.to_w(node.value)
            before = 0
            for value, label in possible:
                if (value ^ before) & 0xFF:
                    self.emit("XORLW", k=value ^ before)
                elif before == 0:
                    self.emit("IORLW", k=0)
                self.goto_if(Z, True, self._cases[label])
                before = value
            return
        operands = self.kept(self.value(node.value, size))
        for value, label in possible:
            other = self.new_label()
            for number, each in enumerate(operands):
                self._differ(each, Imm(value >> 8 * number & 0xFF))
                if number == size - 1:
                    self.goto_if(Z, True, self._cases[label])
                else:
                    self.goto_if(Z, False, other)
            self.label(other)

    def _stmt_CaseLabel(self, node: CaseLabel) -> None:
        self.label(self._cases[node])

    def _stmt_Jump(self, node: Jump) -> None:
        self.place = node.place
        if node.kind == "goto":
            self.goto(self._user_label(node.label))
        else:
            self.goto((self._break if node.kind == "break" else self._continue)[-1])

    def _user_label(self, name: str) -> str:
        if name not in self._user_labels:
            self._user_labels[name] = self.new_label(name)
        return self._user_labels[name]

    def _stmt_LabelStmt(self, node: LabelStmt) -> None:
        self.label(self._user_label(node.name))

    def _stmt_Return(self, node: Return) -> None:
        self.place = node.place
        if node.value is not None:
            if isinstance(node.value.type, VoidType):
                self.effect(node.value)
            elif self.code.returns_w:
                if (
                    isinstance(node.value.type, IntType)
                    and node.value.type.is_bool
                    and not isinstance(node.value, Num)
                ):
                    self.into(node.value, held := self.temp())
                    self.load(held[0])
                else:
                    self.to_w(node.value)
            else:
                assert self.code.result is not None
                size = self.code.result.size
                self.into(node.value, [Byte(self.code.result, each) for each in range(size)])
        self.goto(self._end)

    def _stmt_Asm(self, node: Asm) -> None:
        self.code.inline_asm = True
        labels: dict[str, str] = {}
        for place, text in node.lines:
            self.place = place
            try:
                found = assemble_line(text, place, self._asm_name(node), self._asm_label(labels))
            except AsmError as error:
                self.asm_error(error, place)
                continue
            for ins in found:
                ins.place, ins.fixed = place, True
                self.code.ins.append(ins)

    def asm_error(self, error: AsmError, place: Place) -> None:
        raise NotImplementedError

    def _asm_name(self, node: Asm) -> Callable[[str], Symbol | None]:
        def find(name: str) -> Symbol | None:
            symbol = node.names.get(name) or node.names.get("_" + name) or self.asm_symbol(name)
            return self.symbol(symbol) if symbol is not None else None

        return find

    def asm_symbol(self, name: str) -> Symbol | None:
        raise NotImplementedError

    def _asm_label(self, labels: dict[str, str]) -> Callable[[str], str]:
        def find(name: str) -> str:
            return labels.setdefault(name, f"{self.code.name}.asm.{name}")

        return find

    # calls

    def call(self, expr: Call) -> Code:
        name = expr.function
        code = self.signature(name)
        self._arguments(code, expr.arguments)
        self.place = expr.place if expr.place.line else self.place
        self.emit("CALL", target=code.name)
        return code

    def _arguments(self, code: Code, arguments: list[Expr]) -> None:
        """Arguments that call something go through temporaries, because calls use the callee's bytes."""
        parameters = code.parameters
        ready: list[list[Operand] | None] = [None] * len(arguments)
        for number, (parameter, argument) in enumerate(zip(parameters, arguments, strict=True)):
            later = any(calls_something(each) or has_effect(each) for each in arguments[number + 1 :])
            calls = calls_something(argument) and len(arguments) > 1
            if calls or (later and not isinstance(argument, Num)):
                held: list[Loc] = self.temp(parameter.size)
                self.into(argument, held)
                ready[number] = list(held)
        w_number = None
        for number, (parameter, argument) in enumerate(zip(parameters, arguments, strict=True)):
            if parameter is code.w_parameter:
                w_number = number
                continue
            target: list[Loc] = [Byte(parameter, each) for each in range(parameter.size)]
            done = ready[number]
            if done is not None:
                self.move_all(target, done)
            elif len(arguments) == 1 and calls_something(argument):
                held = self.temp(parameter.size)
                self.into(argument, held)
                self.move_all(target, list(held))
            else:
                self.into(argument, target)
        if w_number is not None:
            done = ready[w_number]
            if done is not None:
                self.load(done[0])
            else:
                self._argument_to_w(arguments[w_number])

    def _argument_to_w(self, argument: Expr) -> None:
        self.to_w(argument) if not _bool_cast(argument) else self._bool_to_w(argument)

    def _bool_to_w(self, argument: Expr) -> None:
        held = self.temp()
        self.into(argument, held)
        self.load(held[0])

    def library_call(self, code: Code, operands: list[list[Operand]]) -> list[Loc]:
        """Call a library routine with operands that are ready; gives its result bytes."""
        w_operand: Operand | None = None
        for parameter, values in zip(code.parameters, operands, strict=True):
            if parameter is code.w_parameter:
                w_operand = values[0]
                continue
            for number, each in enumerate(values):
                self.move(Byte(parameter, number), each)
        if w_operand is not None:
            self.load(w_operand)
        self.emit("CALL", target=code.name)
        if code.result is None:
            return []
        return [Byte(code.result, each) for each in range(code.result.size)]

    # multiplication and division

    def multiply(self, expr: Binary, target: list[Loc]) -> None:
        size = len(target)
        left, right = expr.left, expr.right
        if isinstance(left, Num):
            left, right = right, left
        if isinstance(right, Num) and self._multiply_constant(left, right.value, target):
            return
        (a, b), (c, d) = interval(left), interval(right)
        small = min(a, c) >= 0 and max(b, d) <= 0xFF
        width = 1 if (small and size <= 2) or size == 1 else size
        code = self.library("mul", (width, size))
        one, two = self.pair(left, right, width)
        result = self.library_call(code, [one, two])
        self.move_all(target, list(result[:size]))

    def _multiply_constant(self, left: Expr, value: int, target: list[Loc]) -> bool:
        """By a power of two, or a sum of two: shifts and an addition."""
        size = len(target)
        value &= (1 << 8 * size) - 1
        bits = [bit for bit in range(8 * size) if value >> bit & 1]
        if not bits:
            self.effect(left)
            self.move_all(target, [Imm(0)] * size)
            return True
        if len(bits) == 1:
            operand = self.apart(target, self.value(left, size))
            self.shift_left(target, operand, bits[0])
            return True
        if len(bits) == 2 and bits[1] <= 3 and size <= 2:
            operand = self.kept(self.value(left, size))
            held: list[Loc] = self.temp(size)
            self.shift_left(held, operand, bits[1] - bits[0])
            self.add(held, list(held), operand)
            if bits[0]:
                self.shift_left(held, list(held), bits[0])
            self.move_all(target, list(held))
            return True
        return False

    def divide(self, expr: Binary, target: list[Loc]) -> None:
        (a, b), (c, d) = interval(expr.left), interval(expr.right)
        full = width_of(*interval(expr))[0] if min(a, c) < 0 else 1
        size, signed = width_of(min(a, c), max(b, d))
        size = min(max(size, full), expr.type.size)
        if isinstance(expr.right, Num) and not signed and expr.right.value.bit_count() == 1:
            shift = expr.right.value.bit_length() - 1
            work = target if len(target) >= size else self.temp(size)
            part = work[:size]
            operand = self.apart(part, self.value(expr.left, size))
            if expr.op == "/":
                self.shift_right(part, operand, shift, signed=False)
            else:
                self.bitwise(
                    "&", part, operand, [Imm(expr.right.value - 1 >> 8 * each & 0xFF) for each in range(size)]
                )
            if work is target:
                self.move_all(target[size:], [Imm(0)] * (len(target) - size))
            else:
                self.move_all(target, list(work[: len(target)]))
            return
        code = self.library("sdivide" if signed else "divide", (size,))
        holder = self.library("divide", (size,)) if signed else code
        result_symbol = next(
            each for each in holder.own if each.name == ("quotient" if expr.op == "/" else "remainder")
        )
        one, two = self.pair(expr.left, expr.right, size)
        self.library_call(code, [one, two])
        have = min(len(target), size)
        self.move_all(target[:have], [Byte(result_symbol, each) for each in range(have)])
        if len(target) > have:
            self.widen(target, have, signed=signed)

    # flash

    def flash_byte(self, expr: Ref) -> None:
        """W = one byte of a table."""
        held = self._flash_index(expr)
        self._flash_call(expr.symbol, held, 0)

    def _flash_index(self, expr: Ref) -> list[Operand]:
        """The byte's number in its table: one byte, or two for large tables."""
        size = 1 if expr.symbol.size <= 256 else 2
        if expr.index is None:
            return [Imm(expr.offset >> 8 * each & 0xFF) for each in range(size)]
        index = expr.index
        if expr.offset:
            kind = index.type
            index = Binary("+", index, Num(expr.offset, kind, expr.place), kind, expr.place)
        return self.value(index, size)

    def _flash_call(self, symbol: Symbol, index: list[Operand], step: int) -> None:
        """W = byte index + step of a flash object."""
        if len(index) == 1:
            self.load(index[0])
            if step:
                self.emit("ADDLW", k=step)
            self.emit("CALL", target=table_name(symbol) + (ISR_SUFFIX if self.isr else ""))
            self.code.ins[-1].table = symbol
            return
        pointer: list[Loc] = self.temp(2)
        self.add(pointer, index, [Imm(AddressByte(symbol, step, 0)), Imm(AddressByte(symbol, step, 1))])
        self._read_pointer(pointer)

    def _read_pointer(self, pointer: list[Loc]) -> None:
        code = self.library("flash", ())
        self.library_call(code, [[pointer[1]], [pointer[0]]])

    def _from_flash(self, expr: Ref, target: list[Loc]) -> None:
        size = min(len(target), expr.type.size)
        index = self._flash_index(expr)
        if size > 1:
            index = self.kept(index)
        for number in range(size):
            self._flash_call(expr.symbol, index, number)
            self.store(target[number])
        if len(target) > size:
            self.widen(target, size, signed=self.negative_possible(expr))

    def _wide_load(self, expr: Deref, target: list[Loc]) -> None:
        size = min(len(target), expr.type.size)
        pointer: list[Loc] = self.temp(2)
        self.into(expr.pointer, pointer)
        if expr.offset:
            self.add(pointer, list(pointer), imms(expr.offset, 2))
        for number in range(size):
            if number:
                self._count_up(pointer)
            self._read_pointer(pointer)
            self.store(target[number])
        if len(target) > size:
            self.widen(target, size, signed=self.negative_possible(expr))

    def builtin(self, expr: Builtin) -> None:
        self.place = expr.place if expr.place.line else self.place
        match expr.name:
            case "instruction":
                self.code.ins.append(Ins(str(expr.data), place=self.place, fixed=True))
            case "delay":
                assert isinstance(expr.data, int)
                self.delay(expr.data)
            case "delay_variable":
                assert isinstance(expr.data, int)
                code = self.library("delay", (expr.data,))
                self.load(self.value(expr.arguments[0], 1)[0])
                self.code.ins[-1].fixed = True  # the load is part of the time
                self.emit("CALL", target=code.name)
            case "eeprom_read":
                code = self.library("eeprom_read", ())
                self.to_w(expr.arguments[0])
                self.emit("CALL", target=code.name)
            case "eeprom_write" | "putchar" | "getchar":
                data = expr.data if isinstance(expr.data, tuple) else ()
                code = self.library(expr.name, tuple(int(each) for each in data))
                operands = [self.value(each, 1) for each in expr.arguments]
                self.library_call(code, operands)


def _holds_at_first(loop: Loop, before: Stmt) -> bool:
    """Whether a loop's test surely holds at first: `for (i = 0; i < 8; i++)`."""
    if not isinstance(before, ExprStmt) or not isinstance(before.expr, Assign):
        return False
    target, value, test = before.expr.target, before.expr.value, loop.condition
    if not isinstance(target, Ref) or not isinstance(value, Num) or target.symbol.volatile:
        return False
    if not isinstance(test, Binary) or test.op not in COMPARISONS or not isinstance(test.right, Num):
        return False
    left = test.left
    while isinstance(left, Cast) and isinstance(left.type, IntType):
        if not left.type.low <= value.value <= left.type.high:
            return False
        left = left.operand
    if not isinstance(left, Ref) or (left.symbol, left.offset, left.index) != (
        target.symbol,
        target.offset,
        None,
    ):
        return False
    same = left.type.size == target.type.size and not left.width and not target.width and target.index is None
    return same and compare(test.op, value.value, test.right.value)


def _bool_cast(expr: Expr) -> bool:
    return isinstance(expr.type, IntType) and expr.type.is_bool and not isinstance(expr, Num)
