"""Code for statements and whole functions.

In: a function of the typed tree. Out: its `Function`.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from typing import Any

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.constant_folding import COMPARISONS, compare, interval
from servogen.compiler.ast.types import U8, IntType, VoidType
from servogen.compiler.codegen.conditions import differ, jump
from servogen.compiler.codegen.effects import width_of
from servogen.compiler.codegen.expressions import effect, into
from servogen.compiler.codegen.generator import FunctionGenerator
from servogen.compiler.codegen.inline_asm import assemble_line, program_label
from servogen.compiler.codegen.operands import operands_of, preserved
from servogen.compiler.codegen.operators import to_w
from servogen.compiler.ir.function import Function, LoopLines
from servogen.compiler.ir.instruction import Byte, Imm, Z
from servogen.errors import InputError


def generate(gen: FunctionGenerator) -> Function:
    """Generate the body of a function, and its return."""
    definition = gen.definition
    assert definition.body is not None
    gen.place = definition.place
    if gen.function.w_parameter is not None and not definition.naked:
        gen.store(Byte(gen.function.w_parameter, 0))
    statement(gen, definition.body)
    gen.label(gen.end_label)
    gen.place = None
    if definition.interrupt:
        gen.emit("RETFIE")
    elif definition.name == "main":
        gen.goto(gen.end_label)  # there is nothing to return to
    else:
        gen.emit("RETURN")
    return gen.function


def statement(gen: FunctionGenerator, node: tree.Stmt) -> None:
    _STATEMENTS[type(node)](gen, node)


def _stmt_block(gen: FunctionGenerator, node: tree.BlockStatement) -> None:
    """Generate the statements of a block; a loop whose test holds after the statement before it is entered
    without the test.
    """
    before: tree.Stmt | None = None
    for item in node.body:
        if (
            isinstance(item, tree.Loop)
            and not item.post
            and before is not None
            and _holds_at_first(item, before)
        ):
            _loop(gen, item, entered=True)
        else:
            statement(gen, item)
        before = item


def _stmt_expr_stmt(gen: FunctionGenerator, node: tree.ExprStmt) -> None:
    effect(gen, node.expr)


def _stmt_if(gen: FunctionGenerator, node: tree.If) -> None:
    """Generate an `if`."""
    gen.place = node.place
    if node.no is None:
        end = gen.new_label()
        # the condition itself jumps where `break` or `continue` leads
        if isinstance(node.yes, tree.Jump) and node.yes.kind in ("break", "continue"):
            target = (gen.break_labels if node.yes.kind == "break" else gen.continue_labels)[-1]
            jump(gen, node.condition, True, target)
            return
        jump(gen, node.condition, False, end)
        statement(gen, node.yes)
        gen.label(end)
        return
    other, end = gen.new_label(), gen.new_label()
    jump(gen, node.condition, False, other)
    statement(gen, node.yes)
    gen.goto(end)
    gen.label(other)
    statement(gen, node.no)
    gen.label(end)


def _stmt_loop(gen: FunctionGenerator, node: tree.Loop) -> None:
    _loop(gen, node, entered=False)


def _loop(gen: FunctionGenerator, node: tree.Loop, *, entered: bool) -> None:
    """Generate a loop; the test goes to the end if it certainly holds at first."""
    gen.place = node.place
    start = gen.function.size
    top, again, end = (gen.new_label(hint) for hint in ("top", "again", "end"))
    gen.break_labels.append(end)
    gen.continue_labels.append(again)
    gen.label(top)
    in_front = node.condition is not None and not node.post and not entered
    if node.condition is not None and in_front:
        jump(gen, node.condition, False, end)
    statement(gen, node.body)
    gen.label(again)
    if node.step is not None:
        effect(gen, node.step)
    gen.place = node.place
    # a test at the end costs one jump in each round instead of two
    if node.condition is not None and not in_front:
        jump(gen, node.condition, True, top)
    else:
        gen.goto(top)
    gen.label(end)
    gen.break_labels.pop()
    gen.continue_labels.pop()
    _note_loop(gen, node, start)


def _note_loop(gen: FunctionGenerator, node: tree.Loop, start: int) -> None:
    """Record the location of a loop, so that the listing can name loops without a known bound."""
    places = [
        node.place,
        *(ins.place for ins in islice(gen.function.instructions(), start, None) if ins.place is not None),
    ]
    inside = [(place.line or 0, place.column or 0) for place in places]
    gen.function.loops.append(LoopLines(node.kind, min(inside), max(inside)))


def _stmt_switch(gen: FunctionGenerator, node: tree.Switch) -> None:
    """Generate a switch: jumps to the cases, then the body with their labels."""
    gen.place = node.place
    end = gen.new_label()
    for _, label in node.cases:
        gen.case_labels[label] = gen.new_label("case")
    if node.default is not None:
        gen.case_labels[node.default] = gen.new_label("default")
    _dispatch(gen, node)
    gen.goto(gen.case_labels[node.default] if node.default is not None else end)
    gen.break_labels.append(end)
    statement(gen, node.body)
    gen.break_labels.pop()
    gen.label(end)


def _dispatch(gen: FunctionGenerator, node: tree.Switch) -> None:
    """Emit the comparisons of a switch with its cases."""
    low, high = interval(node.value)
    possible = [(value, label) for value, label in node.cases if low <= value <= high]
    size, _ = width_of(low, high)
    if not possible:
        effect(gen, node.value)
        return
    if size == 1:
        to_w(gen, node.value)
        # W holds the value ^ the case before; XORLW of both cases makes it 0 for this one, without a reload
        before = 0
        for value, label in possible:
            if (value ^ before) & 0xFF:
                gen.emit("XORLW", k=value ^ before)
            elif before == 0:
                gen.emit("IORLW", k=0)
            gen.goto_if(Z, True, gen.case_labels[label])
            before = value
        return
    operands = preserved(gen, operands_of(gen, node.value, size))
    for value, label in possible:
        other = gen.new_label()
        for number, operand in enumerate(operands):
            differ(gen, operand, Imm(value >> 8 * number & 0xFF))
            if number == size - 1:
                gen.goto_if(Z, True, gen.case_labels[label])
            else:
                gen.goto_if(Z, False, other)
        gen.label(other)


def _stmt_case_label(gen: FunctionGenerator, node: tree.CaseLabel) -> None:
    gen.label(gen.case_labels[node])


def _stmt_jump(gen: FunctionGenerator, node: tree.Jump) -> None:
    """Generate `break`, `continue` or `goto`."""
    gen.place = node.place
    if node.kind == "goto":
        gen.goto(_user_label(gen, node.label))
    else:
        gen.goto((gen.break_labels if node.kind == "break" else gen.continue_labels)[-1])


def _user_label(gen: FunctionGenerator, name: str) -> str:
    if name not in gen.user_labels:
        gen.user_labels[name] = gen.new_label(name)
    return gen.user_labels[name]


def _stmt_label_stmt(gen: FunctionGenerator, node: tree.LabelStmt) -> None:
    gen.place = node.place
    gen.label(_user_label(gen, node.name))


def _stmt_return(gen: FunctionGenerator, node: tree.Return) -> None:
    """Put the result where callers expect it, and jump to the function's end."""
    gen.place = node.place
    if node.value is not None:
        if isinstance(node.value.type, VoidType):
            effect(gen, node.value)
        elif gen.function.returns_w:
            to_w(gen, node.value)
        else:
            assert gen.function.result is not None
            size = gen.function.result.size
            into(gen, node.value, [Byte(gen.function.result, index) for index in range(size)])
    gen.goto(gen.end_label)


def _stmt_asm(gen: FunctionGenerator, node: tree.Asm) -> None:
    """Assemble the lines of an assembly statement; errors are reported at their lines."""
    gen.function.inline_asm = True
    labels: dict[str, str] = {}
    for place, text in node.lines:
        gen.place = place
        try:
            lines = assemble_line(text, place, _asm_name(gen, node), _asm_label(gen, node, labels))
        except InputError as error:
            gen.context.reporter.error(error.code, f"assembly: {error.message}", place, error.hint)
            continue
        for line in lines:
            line.place, line.fixed = place, True
            gen.function.append(line)


def _asm_name(gen: FunctionGenerator, node: tree.Asm) -> Callable[[str], tree.Symbol | None]:
    """Return what resolves C names in assembly: locals of the block first, then the program's."""

    def find(name: str) -> tree.Symbol | None:
        symbol = node.names.get(name) or node.names.get("_" + name) or gen.context.asm_symbols.get(name)
        return gen.symbol(symbol) if symbol is not None else None

    return find


def _asm_label(gen: FunctionGenerator, node: tree.Asm, labels: dict[str, str]) -> Callable[[str], str]:
    """Return the function that resolves labels: they are local to their block; `_name` may be a C
    function.
    """

    def find(name: str) -> str:
        if any(call.function == name.removeprefix("_") for call in node.calls):
            return gen.signature(name.removeprefix("_")).name
        return labels.setdefault(name, program_label(gen.function.name, name))

    return find


def _holds_at_first(loop: tree.Loop, before: tree.Stmt) -> bool:
    """Return whether the test of a loop certainly holds at first: `for (i = 0; i < 8; i++)`."""
    if not isinstance(before, tree.ExprStmt) or not isinstance(before.expr, tree.Assign):
        return False
    target, value, test = before.expr.target, before.expr.value, loop.condition
    if not isinstance(target, tree.Ref) or not isinstance(value, tree.Num) or target.symbol.volatile:
        return False
    if isinstance(test, tree.Ref) and value.value:
        test = tree.Binary("!=", test, tree.Num(0, U8, test.place), U8, test.place)
    if (
        not isinstance(test, tree.Binary)
        or test.op not in COMPARISONS
        or not isinstance(test.right, tree.Num)
    ):
        return False
    left = test.left
    while isinstance(left, tree.Cast) and isinstance(left.type, IntType):
        if not left.type.low <= value.value <= left.type.high:
            return False
        left = left.operand
    if not isinstance(left, tree.Ref) or (left.symbol, left.offset, left.index) != (
        target.symbol,
        target.offset,
        None,
    ):
        return False
    same = left.type.size == target.type.size and not left.width and not target.width and target.index is None
    return same and compare(test.op, value.value, test.right.value)


_STATEMENTS: dict[type, Callable[[FunctionGenerator, Any], None]] = {
    tree.BlockStatement: _stmt_block,
    tree.ExprStmt: _stmt_expr_stmt,
    tree.If: _stmt_if,
    tree.Loop: _stmt_loop,
    tree.Switch: _stmt_switch,
    tree.CaseLabel: _stmt_case_label,
    tree.Jump: _stmt_jump,
    tree.LabelStmt: _stmt_label_stmt,
    tree.Return: _stmt_return,
    tree.Asm: _stmt_asm,
}
