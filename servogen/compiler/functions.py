"""Code for statements and whole functions.

In: a function of the typed tree. Out: its `Code`.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.ctypes import U8, IntType, VoidType
from servogen.compiler.effects import width_of
from servogen.compiler.emitter import Code, LoopLines
from servogen.compiler.flash import Flash
from servogen.compiler.fold import COMPARISONS, compare, interval
from servogen.compiler.inline_asm import AsmError, assemble_line
from servogen.compiler.machine import Byte, Imm, Z
from servogen.compiler.program import (
    Asm,
    Block,
    CaseLabel,
    ExprStmt,
    If,
    Jump,
    LabelStmt,
    Loop,
    Return,
    Stmt,
    Switch,
)
from servogen.compiler.tree import Assign, Binary, Cast, Num, Ref, Symbol
from servogen.errors import Place


class FunctionGenerator(Flash):
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
        self._library = library
        self._break: list[str] = []
        self._continue: list[str] = []
        self._cases: dict[CaseLabel, str] = {}
        self._user_labels: dict[str, str] = {}
        self._end = self.new_label("end")

    def library(self, kind: str, key: tuple[int, ...]) -> Code:
        return self._library(kind, key)

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
        start = len(self.code.ins)
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
        self._note_loop(node, start)

    def _note_loop(self, node: Loop, start: int) -> None:
        """Remember where a loop stands: the listing names loops without a known end."""
        places = [node.place, *(each.place for each in self.code.ins[start:] if each.place is not None)]
        inside = [(each.line or 0, each.column or 0) for each in places]
        self.code.loops.append(LoopLines(node.kind, min(inside), max(inside)))

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
        self.place = node.place
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
                found = assemble_line(text, place, self._asm_name(node), self._asm_label(node, labels))
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

    def _asm_label(self, node: Asm, labels: dict[str, str]) -> Callable[[str], str]:
        """A label is its block's; `_name` may be a C function."""

        def find(name: str) -> str:
            if any(call.function == name.removeprefix("_") for call in node.calls):
                return self.signature(name.removeprefix("_")).name
            return labels.setdefault(name, f"{self.code.name}.asm.{name}")

        return find


def _holds_at_first(loop: Loop, before: Stmt) -> bool:
    """Whether a loop's test surely holds at first: `for (i = 0; i < 8; i++)`."""
    if not isinstance(before, ExprStmt) or not isinstance(before.expr, Assign):
        return False
    target, value, test = before.expr.target, before.expr.value, loop.condition
    if not isinstance(target, Ref) or not isinstance(value, Num) or target.symbol.volatile:
        return False
    if isinstance(test, Ref) and value.value:
        test = Binary("!=", test, Num(0, U8, test.place), U8, test.place)
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
