"""What the parts of the semantic analysis share: the dialect, the scopes, errors, and conversions.

In: typed operands. Out: operands converted as ISO C 6.3 says, constants folded, with warnings for what is
lost.
"""

from __future__ import annotations

from typing import Any

from servogen.compiler.ctypes import (
    C2C_INT,
    C2C_SIGNED,
    S16,
    S32,
    U8,
    U16,
    U32,
    ArrayType,
    CType,
    IntType,
    PointerType,
    StructType,
    VoidType,
    common,
    promote,
    same,
)
from servogen.compiler.diagnostics import Fatal, Reporter
from servogen.compiler.dialect import C2C, named_types
from servogen.compiler.program import Function, Program
from servogen.compiler.scopes import Scopes
from servogen.compiler.syntax_errors import place_of
from servogen.compiler.tree import AddressOf, Binary, Cast, Data, Deref, Expr, Num, Ref, Symbol
from servogen.errors import Place

_ALL_ONES = (1 << 16, 1 << 24, 1 << 32)
"""One more than the numbers that stand for -1 where programs compare pointers with it."""


class Base:
    """State of one compilation's analysis."""

    def __init__(self, dialect: str, reporter: Reporter) -> None:
        self.dialect = dialect
        self.c2c = dialect == C2C
        self.reporter = reporter
        self.scopes = Scopes(lower_case=True)
        self.program = Program({}, [], [], {}, [])
        self.function: Function | None = None
        self.strings: dict[tuple[int, ...], Symbol] = {}
        self.types = dict(named_types())
        self.asm_symbols: dict[str, Symbol] = {}
        self.addresses: dict[tuple[str | None, int | None, int | None], int] = {}
        self.interrupts: set[str] = set()
        self.reading_config = False
        """Inside __CONFIG(…), where the masks' names are known."""

    @property
    def int_type(self) -> IntType:
        """The type of comparisons, enumerations and small literals."""
        return C2C_SIGNED if self.c2c else S16

    def fail(self, message: str, node: Any, hint: str | None = None) -> Fatal:
        return self.reporter.fatal(message, self.place(node), hint)

    def place(self, node: Any) -> Place:
        if isinstance(node, Place):
            return node
        return getattr(node, "place", None) or place_of(getattr(node, "coord", None))

    def number(self, value: int, kind: CType, place: Place) -> Num:
        return Num(kind.wrap(value) if isinstance(kind, IntType) else value, kind, place)

    # conversions

    def decay(self, expr: Expr) -> Expr:
        """An array as the address of its first element."""
        if isinstance(expr.type, ArrayType):
            kind = PointerType(expr.type.element)
            if isinstance(expr, Ref):
                return self.address(expr, kind)
            if isinstance(expr, Deref):
                return self.offset_pointer(expr.pointer, expr.offset, kind)
        return expr

    def address(self, target: Ref, kind: PointerType) -> Expr:
        target.symbol.pinned = True
        target.symbol.read = target.symbol.written = True
        return AddressOf(target, kind, target.place)

    def offset_pointer(self, pointer: Expr, offset: int, kind: CType) -> Expr:
        moved = Cast(pointer, kind, pointer.place)
        if offset == 0:
            return moved
        return Binary("+", moved, Num(offset, self._address_int(kind), pointer.place), kind, pointer.place)

    def _address_int(self, kind: CType) -> IntType:
        return U8 if kind.size == 1 else U16

    def rvalue(self, expr: Expr) -> Expr:
        """The value of an expression: arrays decay; void has none."""
        expr = self.decay(expr)
        if isinstance(expr.type, VoidType):
            raise self.fail("this has no value: its type is void", expr)
        return expr

    def arithmetic(self, expr: Expr) -> Expr:
        expr = self.rvalue(expr)
        if not isinstance(expr.type, IntType):
            raise self.fail(f"an integer is needed here, not '{expr.type}'", expr)
        return expr

    def promoted(self, expr: Expr) -> Expr:
        expr = self.arithmetic(expr)
        assert isinstance(expr.type, IntType)
        return self.cast(expr, promote(expr.type, c2c=self.c2c))

    def balance(self, left: Expr, right: Expr) -> tuple[Expr, Expr, IntType]:
        left, right = self.arithmetic(left), self.arithmetic(right)
        assert isinstance(left.type, IntType) and isinstance(right.type, IntType)
        kind = common(left.type, right.type, c2c=self.c2c)
        return self.cast(left, kind), self.cast(right, kind), kind

    def cast(self, expr: Expr, kind: CType) -> Expr:
        """A conversion without questions; folds constants and drops what changes nothing."""
        kind = kind.plain()
        if expr.type.plain() == kind:
            return expr
        if isinstance(expr, Num):
            if isinstance(kind, IntType):
                return Num(kind.wrap(expr.value), kind, expr.place)
            if isinstance(kind, PointerType):
                bits = 8 * kind.size
                if not -(1 << bits - 1) <= expr.value < 1 << bits and expr.value + 1 not in _ALL_ONES:
                    raise self.fail(
                        f"the address 0x{expr.value & 0xFFFFFFFF:X} does not fit '{kind}'",
                        expr,
                        hint=f"it has {kind.size} byte{'s' * (kind.size > 1)}",
                    )
                return Num(expr.value & (1 << bits) - 1, kind, expr.place)
        return Cast(expr, kind, expr.place)

    def convert(self, expr: Expr, kind: CType, what: str) -> Expr:
        """The implicit conversion of an assignment, argument, initialiser or result."""
        expr = self.rvalue(expr)
        kind = kind.plain()
        if isinstance(kind, IntType) and isinstance(expr.type, IntType):
            self._warn_range(expr, kind)
            return self.cast(expr, kind)
        if isinstance(kind, PointerType):
            return self._to_pointer(expr, kind, what)
        if isinstance(kind, StructType) and same(kind, expr.type):
            return expr
        if isinstance(kind, IntType) and isinstance(expr.type, PointerType):
            if kind.is_bool:
                return self.cast(expr, kind)
            self.reporter.warn(
                f"{what} makes '{kind}' of the pointer '{expr.type}' without a cast", expr.place
            )
            return self.cast(expr, kind)
        raise self.fail(f"{what} needs '{kind}', this is '{expr.type}'", expr)

    def _warn_range(self, expr: Expr, kind: IntType) -> None:
        if not isinstance(expr, Num) or kind.is_bool:
            return
        low = -(1 << 8 * kind.bytes - 1)
        high = (1 << 8 * kind.bytes - kind.signed) - 1
        if not low <= expr.value <= high:
            shown = kind.wrap(expr.value)
            self.reporter.warn(f"{expr.value} does not fit '{kind}' and becomes {shown}", expr.place)
        elif self.c2c and expr.value < 0 and kind == C2C_INT:
            self.reporter.warn(
                f"{expr.value} does not fit '{kind}' and becomes {kind.wrap(expr.value)}", expr.place
            )

    def _to_pointer(self, expr: Expr, kind: PointerType, what: str) -> Expr:
        if isinstance(expr, Num) and isinstance(expr.type, IntType):
            if expr.value != 0:
                self.reporter.warn(
                    f"{what} makes a pointer of the number {expr.value} without a cast", expr.place
                )
            return self.cast(expr, kind)
        if not isinstance(expr.type, PointerType):
            if isinstance(expr.type, IntType):
                self.reporter.warn(f"{what} makes a pointer of '{expr.type}' without a cast", expr.place)
                return self.cast(expr, kind)
            raise self.fail(f"{what} needs '{kind}', this is '{expr.type}'", expr)
        self.keep_const(expr, kind, what)
        source, target = expr.type.target, kind.target
        if not same(source, target) and not isinstance(source, VoidType) and not isinstance(target, VoidType):
            self.reporter.warn(f"{what} makes '{kind}' of '{expr.type}' without a cast", expr.place)
        return self.cast(expr, kind)

    def keep_const(self, expr: Expr, kind: CType, what: str) -> None:
        """Refuse to make a pointer that reaches RAM only of one that may lead to flash."""
        both = isinstance(expr.type, PointerType) and isinstance(kind, PointerType)
        if both and expr.type.size > kind.size:
            raise self.fail(
                f"{what} would drop const: '{expr.type}' may point to flash, '{kind}' cannot",
                expr,
                hint="declare the pointer as a pointer to const",
            )

    def truth(self, expr: Expr) -> Expr:
        """An operand of a condition."""
        expr = self.rvalue(expr)
        if not expr.type.scalar:
            raise self.fail(f"a condition needs a number or a pointer, not '{expr.type}'", expr)
        return expr

    # constants

    def literal_type(self, value: int, suffix: str, decimal: bool) -> IntType:
        """The type of an integer literal (ISO C 6.4.4.1 on these sizes)."""
        unsigned = "u" in suffix
        if "l" not in suffix:
            if value <= 32767 and not unsigned:
                return self.int_type
            if value <= 65535 and (unsigned or self.c2c or not decimal):
                return C2C_INT if self.c2c else U16
        return S32 if value <= 0x7FFFFFFF and not unsigned else U32

    def string(self, values: list[int], place: Place) -> Ref:
        """A string literal in flash, one copy of each."""
        key = tuple(values)
        if key not in self.strings:
            kind = ArrayType(U8_CONST, len(values))
            symbol = Symbol(f"string{len(self.strings)}", kind, "flash", place, pinned=True, read=True)
            symbol.initial = dict[int, Data](enumerate(values))
            self.strings[key] = symbol
            self.program.symbols.append(symbol)
        symbol = self.strings[key]
        return Ref(symbol, 0, None, symbol.type, place)


U8_CONST = IntType("unsigned char", 1, False, const=True)
