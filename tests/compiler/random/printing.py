"""What both spellings of a program share: statements, loops, and how indices, divisors and counts are
guarded.

In: statements. Out: lines of C. The guards are decided here, from the program alone, so that both spellings
always agree and no cut or replaced part can make behaviour undefined.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from tests.compiler.random.program import (
    U8,
    AddressOf,
    Again,
    Array,
    Block,
    Call,
    CopyStruct,
    Expr,
    ExprStmt,
    Function,
    Hang,
    If,
    Int,
    Jump,
    Leave,
    Loop,
    Num,
    Out,
    Place,
    Point,
    Pointer,
    Program,
    Return,
    SetBit,
    Skip,
    Stmt,
    Struct,
    Switch,
    Type,
    Var,
    Variable,
    Walk,
)
from tests.compiler.random.typing_rules import promote, type_of

STOP = Variable("stop", U8, "global")
"""Names the function that never returns."""


class Printer(ABC):
    """Prints a program; a subclass spells types, expressions and whatever needs them."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.dialect = program.dialect
        self.result: Int | None = None

    # what a spelling decides

    @abstractmethod
    def base(self, kind: Type) -> str:
        """The name of an integer or structure type."""

    @abstractmethod
    def name(self, variable: Variable) -> str: ...

    @abstractmethod
    def expr(self, expr: Expr) -> str: ...

    @abstractmethod
    def place(self, expr: Expr) -> str: ...

    @abstractmethod
    def pointer(self, expr: Expr) -> str: ...

    @abstractmethod
    def converted(self, expr: Expr, kind: Int) -> str:
        """The expression as something of a type is initialised with it, or a result returned."""

    @abstractmethod
    def case(self, value: int, kind: Int) -> str:
        """A case of a switch on a value of a type."""

    @abstractmethod
    def out(self, expr: Expr, pad: str) -> str: ...

    @abstractmethod
    def set_bit(self, stmt: SetBit) -> str: ...

    @abstractmethod
    def move_in(self, pointer: Variable, value: Expr, element: Int) -> str:
        """`*p++ = value;`"""

    @abstractmethod
    def move_out(self, pointer: Variable, target: Place) -> str:
        """`target = *p++;`"""

    # declarations

    def struct(self, struct: Struct) -> str:
        members = "".join(
            f" {self.declarator(each.type, each.name)}{f' : {each.width}' if each.width else ''};"
            for each in struct.members
        )
        return f"{self.base(struct)} {{{members} }};"

    def declarator(self, kind: Type, name: str) -> str:
        if isinstance(kind, Array):
            return f"{self.base(kind.element)} {name}" + "".join(f"[{each}]" for each in kind.dims)
        if isinstance(kind, Pointer):
            fixed = "const " if kind.fixed else ""
            return f"{'const ' if kind.const else ''}{self.base(kind.target)} *{fixed}{name}"
        return f"{self.base(kind)} {name}"

    def declaration(self, variable: Variable) -> str:
        storage = (
            "static " if variable.storage == "static" else "const " if variable.storage == "const" else ""
        )
        return f"{storage}{self.declarator(variable.type, self.name(variable))}{self.initial(variable)};"

    def initial(self, variable: Variable) -> str:
        value, kind = variable.initial, variable.type
        if value is None:
            return ""
        if isinstance(value, tuple):
            return f" = {self.values(list(value), kind)}"
        if isinstance(kind, Pointer):
            return f" = {self.pointer(value)}"
        assert isinstance(kind, Int)
        return f" = {self.converted(value, kind)}"

    def values(self, numbers: list[int], kind: Type) -> str:
        """Numbers as the initialiser of a type; they are taken from the list."""
        if isinstance(kind, Array):
            element = kind.element
            return nested([self.values(numbers, element) for _ in range(kind.count)], kind.dims)
        if isinstance(kind, Struct):
            members = kind.members[:1] if kind.union else kind.members
            return "{" + ", ".join(self.values(numbers, each.type) for each in members) + "}"
        assert isinstance(kind, Int)
        return self.number(numbers.pop(0), kind)

    def number(self, value: int, kind: Int) -> str:
        return str(value)

    def address(self, to: AddressOf) -> str:
        """What a pointer is given."""
        where = self.name(to.variable) if to.place is None else self.place(to.place)
        kind = to.variable.type if to.place is None else to.place.member.type
        if not isinstance(kind, Array):
            return f"&{where}"
        return where if to.index is None else f"&{where}[{self.index(to.index, kind.dims[0])}]"

    @abstractmethod
    def index(self, index: Expr, size: int) -> str:
        """An index, kept inside an array."""

    def body(self, function: Function) -> list[str]:
        self.result = function.result if isinstance(function.result, Int) else None
        start = [f"    {self.declaration(each)}" for each in function.locals]
        end = [f"    return {self.name(function.returns)};"] if function.returns else []
        return start + self.statements(function.body, 1) + end

    # guards

    def reduction(self, index: Expr, size: int) -> str:
        """How an index is kept inside an array: "plain", "mask" or "remainder"."""
        if isinstance(index, Num) and index.value < size:
            return "plain"
        if (
            isinstance(index, Var)
            and index.variable.storage == "counter"
            and 0 < index.variable.limit <= size
        ):
            return "plain"
        return "mask" if size & (size - 1) == 0 else "remainder"

    # statements

    def statements(self, body: tuple[Stmt, ...], depth: int) -> list[str]:
        return [line for each in body for line in self.statement(each, depth)]

    def braces(self, head: str, body: tuple[Stmt, ...], depth: int, tail: str = "") -> list[str]:
        pad = "    " * depth
        return [f"{pad}{head} {{", *self.statements(body, depth + 1), f"{pad}}}{tail}"]

    def statement(self, stmt: Stmt, depth: int) -> list[str]:
        pad = "    " * depth
        match stmt:
            case ExprStmt(expr):
                return [f"{pad}{self.expr(expr)};"]
            case Out(expr):
                return [self.out(expr, pad)]
            case If(condition, yes, no):
                lines = self.braces(f"if ({self.expr(condition)})", yes, depth)
                return lines + self.braces("else", no, depth) if no else lines
            case Loop():
                return self.loop(stmt, depth)
            case Walk():
                return self.walk(stmt, depth)
            case Switch():
                return self.switch(stmt, depth)
            case Jump(kind):
                return [f"{pad}{kind};"]
            case Skip(condition, label, body):
                lines = [f"{pad}if ({self.expr(condition)}) goto {label};", *self.statements(body, depth)]
                return [*lines, f"{pad}{label}: ;"]
            case Leave(label):
                return [f"{pad}goto {label};"]
            case Again(label, counter, rounds, body):
                head = [f"{pad}{counter.name} = {rounds};", f"{pad}{label}: ;"]
                return [*head, *self.statements(body, depth), f"{pad}if (--{counter.name}) goto {label};"]
            case Block(variables, body):
                inner = [f"{pad}    {self.declaration(each)}" for each in variables]
                return [f"{pad}{{", *inner, *self.statements(body, depth + 1), f"{pad}}}"]
            case Point(pointer, to):
                return [f"{pad}{pointer.name} = {self.pointer(to)};"]
            case CopyStruct(target, source):
                value = self.expr(source) if isinstance(source, Call) else self.place(source)
                return [f"{pad}{self.copy(target, value)}"]
            case Hang():
                return self.hang(stmt, depth)
            case SetBit():
                return [pad + self.set_bit(stmt)]
            case Return(None):
                return [f"{pad}return;"]
            case Return(expr):
                assert self.result is not None and expr is not None
                return [f"{pad}return {self.converted(expr, self.result)};"]
        raise TypeError(stmt)

    def copy(self, target: Var, value: str) -> str:
        """The assignment of a structure."""
        return f"{self.place(target)} = {value};"

    def hang(self, stmt: Hang, depth: int) -> list[str]:
        pad, never = "    " * depth, self.name(stmt.never)
        match stmt.form:
            case "self":
                return self.braces(f"while ({never})", stmt.body, depth)
            case "call":
                return [f"{pad}if ({never}) {self.name(STOP)}();"]
            case "jump":
                lines = [f"{pad}    {stmt.label}: ;", *self.statements(stmt.body, depth + 1)]
                return [f"{pad}if ({never}) {{", *lines, f"{pad}    goto {stmt.label};", f"{pad}}}"]
        heads = {"while": ("while (1)", ""), "for": ("for (;;)", ""), "do": ("do", " while (1);")}
        head, tail = heads[stmt.form]
        inner = self.braces(head, stmt.body, depth + 1, tail)
        return [f"{pad}if ({never}) {{", *inner, f"{pad}}}"]

    def loop(self, stmt: Loop, depth: int) -> list[str]:
        pad, name, rounds = "    " * depth, stmt.counter.name, stmt.rounds
        more = f" && ({self.expr(stmt.condition)})" if stmt.condition is not None else ""
        first = f"({self.expr(stmt.condition)}) && " if stmt.condition is not None else ""
        match stmt.form:
            case "up":
                return self.braces(f"for ({name} = 0; {name} < {rounds}{more}; {name}++)", stmt.body, depth)
            case "down":
                return self.braces(f"for ({name} = {rounds}; {name}{more}; {name}--)", stmt.body, depth)
            case "while":
                lines = self.braces(f"while ({first}{name} < {rounds})", stmt.body, depth)
                lines.insert(1, f"{pad}    {name}++;")
                return [f"{pad}{name} = 0;", *lines]
            case "countdown":
                return [f"{pad}{name} = {rounds};", *self.braces(f"while ({name}--{more})", stmt.body, depth)]
            case "do":
                return [
                    f"{pad}{name} = {rounds};",
                    *self.braces("do", stmt.body, depth, f" while (--{name}{more});"),
                ]
        raise TypeError(stmt.form)

    def walk(self, stmt: Walk, depth: int) -> list[str]:
        pad, p, name = "    " * depth, stmt.pointer.name, stmt.counter.name
        head = f"for ({name} = 0; {name} < {stmt.count}; {name}++"
        start = f"{pad}{p} = {self.address(stmt.start)};"
        if stmt.value is None and stmt.target is None:
            return [start, *self.braces(f"{head}, {stmt.step.format(p)})", stmt.body, depth), start]
        if stmt.value is not None:
            assert isinstance(stmt.pointer.type, Pointer) and isinstance(stmt.pointer.type.target, Int)
            move = self.move_in(stmt.pointer, stmt.value, stmt.pointer.type.target)
        else:
            assert stmt.target is not None
            move = self.move_out(stmt.pointer, stmt.target)
        body = self.statements(stmt.body, depth + 1)
        return [start, f"{pad}{head}) {{", *body, f"{pad}    {move}", f"{pad}}}", start]

    def switch(self, stmt: Switch, depth: int) -> list[str]:
        pad = "    " * depth
        lines = [f"{pad}switch ({self.expr(stmt.value)}) {{"]
        kind = promote(type_of(stmt.value, self.dialect), self.dialect)
        for case in stmt.cases:
            lines += [f"{pad}case {self.case(value, kind)}:" for value in case.values]
            lines += [f"{pad}default:"] if case.default else []
            lines += [f"{pad}    {{", *self.statements(case.body, depth + 2), f"{pad}    }}"]
            lines += [] if case.falls else [f"{pad}    break;"]
        return [*lines, f"{pad}}}"]


def count_mask(kind: Int) -> int:
    """What a shift count is cut to: below the number of bits."""
    return {8: 7, 16: 15, 24: 15, 32: 31}[kind.bits]


def nested(values: list[str], dims: tuple[int, ...]) -> str:
    """Initialisers in braces."""
    if len(dims) == 1:
        return "{" + ", ".join(values) + "}"
    step = len(values) // dims[0]
    rows = [nested(values[at : at + step], dims[1:]) for at in range(0, len(values), step)]
    return "{" + ", ".join(rows) + "}"
