"""Random expressions: every operator of C on places of every type, with defined behaviour.

In: a random source, a `Scope`, the `Touch` of what surrounds the expression. Out: an `Expr`.
"""

from __future__ import annotations

import random
from collections.abc import Callable

from tests.compiler.random.program import (
    BIT,
    AddressOf,
    Array,
    Assign,
    Binary,
    Call,
    Cast,
    Choice,
    Comma,
    Deref,
    Divide,
    Element,
    Expr,
    Function,
    Int,
    Logic,
    Member,
    MemberOf,
    Num,
    Part,
    Place,
    Pointer,
    Shift,
    SizeOf,
    Step,
    Struct,
    TestBit,
    Unary,
    Update,
    Var,
    Variable,
)
from tests.compiler.random.scope import Scope, reaches, writable
from tests.compiler.random.touch import Touch
from tests.compiler.random.typing_rules import COMPARISONS, type_of

EDGES = (0, 1, 2, 3, 7, 8, 10, 15, 16, 31, 63, 64, 100, 127, 128, 129, 200, 254, 255)
WIDE_EDGES = (256, 257, 511, 1000, 0x7F00, 0x7FFF, 0x8000, 0x8001, 0xFF00, 0xFFFE, 0xFFFF)
WIDEST_EDGES = (0x10000, 0xFFFFFF, 0x800000, 100000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x12345678)
MAX_CALL_COST = 4000
_PURE = dict[str, float](
    binary=6, shift=1.5, divide=0.7, compare=1.2, unary=1.2, cast=1, choice=0.6, logic=0.5, bit=0.4
)
_EXPR = dict[str, float](
    binary=6,
    shift=1.5,
    divide=0.8,
    compare=1.4,
    unary=1.2,
    cast=1,
    choice=0.7,
    logic=0.8,
    bit=0.3,
    comma=0.15,
    assign=0.3,
    update=0.3,
    step=0.5,
    call=1.2,
    sizeof=0.05,
)
"""How often each kind of expression is made; pure ones have no side effects."""


class Expressions:
    """Makes expressions; `types` are those that the program uses."""

    def __init__(self, rng: random.Random, dialect: str, types: tuple[Int, ...]) -> None:
        self.rng = rng
        self.dialect = dialect
        self.types = types
        self.scope = Scope([], [])

    def pick(self, weighted: dict[str, float]) -> str:
        return self.rng.choices(list(weighted), list(weighted.values()))[0]

    def chance(self, probability: float) -> bool:
        return self.rng.random() < probability

    def type(self) -> Int:
        return self.rng.choice(self.types)

    # leaves

    def number(self, *, small: bool = False) -> Num:
        widest = max(each.bits for each in self.types)
        pool: tuple[int, ...] = EDGES
        if not small and self.chance(0.3):
            pool = WIDE_EDGES if widest <= 16 or self.chance(0.6) else WIDEST_EDGES
        value = self.rng.choice(pool) if self.chance(0.6) else self.rng.randrange(256)
        base = self.rng.choice((10, 10, 10, 16, 16, 2)) if value < 256 else self.rng.choice((10, 16))
        suffix = ""
        if base != 2 and self.chance(0.1):
            suffix = "U" if widest <= 16 or value <= 0xFFFF else "UL"
        if value > 0x7FFF and base == 10 and self.dialect == "xc8" and not suffix and widest <= 16:
            suffix = "U" if value <= 0xFFFF else suffix
        return Num(value, suffix, base)

    def place(
        self, touch: Touch, depth: int, *, write: bool, accept: Callable[[Int], bool] | None = None
    ) -> Place | None:
        """A place that may be touched now; its indices go to `touch`, itself does not yet."""
        candidates = [each for each in self.scope.visible if not write or writable(each)]
        self.rng.shuffle(candidates)
        for variable in candidates:
            objects = reaches(variable)
            allowed = touch.may_write(objects) if write else touch.may_read(objects)
            if not allowed or (isinstance(variable.type, Pointer) and not touch.may_read((variable,))):
                continue
            found = self.within(variable, touch, depth)
            if found is not None and (accept is None or accept(type_of(found, self.dialect))):
                if isinstance(variable.type, Pointer):
                    touch.reads.add(variable)
                return found
        return None

    def within(self, variable: Variable, touch: Touch, depth: int) -> Place | None:
        """An integer in a variable, or behind a pointer."""
        kind = variable.type
        base: Var | Deref = Var(variable)
        if isinstance(kind, Pointer) and variable.base:
            element = Element(Var(variable), (self.index(variable.limit, touch, depth),))
            if isinstance(kind.target, Struct):
                return self.member(element, kind.target, touch, depth)
            return element
        if isinstance(kind, Pointer):
            base, kind = Deref(variable, self.chance(0.3)), kind.target
        if isinstance(kind, Int):
            return base
        if isinstance(kind, Struct):
            return self.member(base, kind, touch, depth)
        assert isinstance(base, Var)
        element = Element(base, self.indices(kind, touch, depth))
        if isinstance(kind.element, Struct):
            return self.member(element, kind.element, touch, depth)
        return element

    def member(self, base: Var | Deref | Element, kind: Struct, touch: Touch, depth: int) -> Place:
        member = self.rng.choice(kind.members)
        found = MemberOf(base, member)
        if isinstance(member.type, Array):
            return Element(found, self.indices(member.type, touch, depth))
        return found

    def indices(self, kind: Array, touch: Touch, depth: int) -> tuple[Expr, ...]:
        return tuple(self.index(size, touch, depth) for size in kind.dims)

    def index(self, size: int, touch: Touch, depth: int) -> Expr:
        fitting = [
            each
            for each in self.scope.visible
            if each.storage == "counter" and 0 < each.limit <= size and touch.may_read((each,))
        ]
        if fitting and self.chance(0.6):
            return Var(self.rng.choice(fitting))
        if depth <= 0 or self.chance(0.4):
            return Num(self.rng.randrange(size))
        # no side effects in an index: a place may be printed twice
        return self.pure(depth - 1, touch)

    def read(self, touch: Touch, depth: int) -> Expr | None:
        found = self.place(touch, depth, write=False)
        if found is not None:
            touch.reads |= set(reaches(base_of(found)))
        return found

    def leaf(self, touch: Touch, depth: int = 0) -> Expr:
        if self.chance(0.7):
            found = self.read(touch, depth)
            if found is not None:
                return found
        return self.number()

    # expressions

    def pure(self, depth: int, touch: Touch) -> Expr:
        """Without side effects."""
        if depth <= 0 or self.chance(0.2):
            return self.leaf(touch, depth)
        return self.operator(self.pick(_PURE), depth, touch, self.pure)

    def expr(self, depth: int, touch: Touch) -> Expr:
        """Perhaps with side effects."""
        if depth <= 0 or self.chance(0.15):
            return self.leaf(touch, depth)
        return self.operator(self.pick(_EXPR), depth, touch, self.expr)

    def operator(self, kind: str, depth: int, touch: Touch, inner: Callable[[int, Touch], Expr]) -> Expr:
        low = depth - 1
        match kind:
            case "binary":
                op = self.rng.choice(("+", "+", "-", "-", "*", "&", "|", "^"))
                if op == "*" and self.chance(0.4):
                    return Binary(op, inner(low, touch), self.number(small=True))
                return Binary(op, inner(low, touch), inner(low, touch))
            case "compare":
                return self.comparison(low, touch, inner)
            case "shift":
                count: Expr = Num(self.rng.choice((0, 1, 1, 2, 3, 4, 5, 7, 8, 9, 12, 15)))
                return Shift(
                    self.rng.choice(("<<", ">>")),
                    inner(low, touch),
                    count if self.chance(0.65) else inner(low, touch),
                )
            case "divide":
                right = self.number(small=True) if self.chance(0.5) else inner(low, touch)
                return Divide(self.rng.choice("/%"), inner(low, touch), right)
            case "unary":
                return Unary(self.rng.choice(("-", "~", "!", "+")), inner(low, touch))
            case "cast":
                return Cast(self.type(), inner(low, touch))
            case "sizeof":
                return SizeOf(self.rng.choice([each for each in self.types if each not in (BIT,)]))
            case "bit":
                return self.bit(touch)
            case "choice":
                condition, (yes, no) = self.condition(low, touch, inner), self.sequenced(low, touch, inner, 2)
                return Choice(condition, yes, no)
            case "logic":
                left, right = self.sequenced(low, touch, inner, 2)
                return Logic(self.rng.choice(("&&", "||")), left, right)
            case "comma":
                first, second = self.sequenced(low, touch, inner, 2)
                return Comma(first, second)
            case "call":
                part = self.part(low, touch) if self.chance(0.3) else None
                return part or self.call(low, touch) or self.leaf(touch)
        return self.change(kind, low, touch) or self.leaf(touch)

    def comparison(self, depth: int, touch: Touch, inner: Callable[[int, Touch], Expr]) -> Expr:
        right: Expr = self.number() if self.chance(0.5) else inner(depth, touch)
        return Binary(self.rng.choice(COMPARISONS), inner(depth, touch), right)

    def condition(self, depth: int, touch: Touch, inner: Callable[[int, Touch], Expr]) -> Expr:
        return self.comparison(depth, touch, inner) if self.chance(0.6) else inner(depth, touch)

    def sequenced(
        self, depth: int, touch: Touch, inner: Callable[[int, Touch], Expr], count: int
    ) -> list[Expr]:
        """Parts with a sequence point between them: each must only agree with what is around all of them."""
        before, found = touch.copy(), []
        for _ in range(count):
            part = before.copy()
            found.append(inner(depth, part))
            touch.add(part)
        return found

    def bit(self, touch: Touch) -> Expr:
        found = [
            each
            for each in self.scope.visible
            if isinstance(each.type, Int)
            and each.type.kind == "int"
            and each.storage != "const"
            and touch.may_read((each,))
        ]
        if not found:
            return self.leaf(touch)
        variable = self.rng.choice(found)
        assert isinstance(variable.type, Int)
        touch.reads.add(variable)
        return TestBit(Var(variable), self.rng.randrange(variable.type.bits))

    def change(self, kind: str, depth: int, touch: Touch) -> Expr | None:
        """An assignment of one of the three kinds."""
        inner = touch.copy()
        plain = kind == "step"
        value = self.number() if plain else self.expr(depth, inner)
        outside = Touch(touch.reads, touch.writes | inner.writes)
        target = self.place(outside, depth, write=True, accept=_countable if kind == "step" else None)
        if target is None:
            return None
        touched = set(reaches(base_of(target)))
        touch.add(inner)
        touch.add(outside)
        touch.writes |= touched
        if kind == "assign":
            return Assign(target, value)
        if kind == "update":
            op = self.rng.choice(("+", "-", "*", "&", "|", "^", "+", "-", "&", "|", "<<", ">>", "/", "%"))
            return Update(op, target, value)
        field = isinstance(target, MemberOf) and target.member.width > 0
        return Step(self.rng.choice(("++", "--")), target, field or self.chance(0.4))

    # calls

    def call(self, depth: int, touch: Touch, function: Function | None = None) -> Call | None:
        choices = (
            [function] if function else [each for each in self.scope.callable if isinstance(each.result, Int)]
        )
        self.rng.shuffle(choices)
        for each in choices:
            if self.scope.rounds * each.cost > MAX_CALL_COST:
                continue
            if not (touch.may_write(each.writes) and touch.may_read(each.reads)):
                continue
            before = touch.copy()
            arguments = [self.argument(parameter, depth, touch) for parameter in each.parameters]
            if any(argument is None for argument in arguments):
                touch.reads, touch.writes = before.reads, before.writes
                continue
            touch.reads |= each.reads
            touch.writes |= each.writes
            self.scope.cost += self.scope.rounds * each.cost
            return Call(each, tuple(arguments))  # type: ignore[arg-type]
        return None

    def part(self, depth: int, touch: Touch) -> Part | None:
        """A scalar member of what a function gives."""
        makers = [each for each in self.scope.callable if isinstance(each.result, Struct)]
        if not makers:
            return None
        maker = self.rng.choice(makers)
        assert isinstance(maker.result, Struct)
        members = [each for each in maker.result.members if isinstance(each.type, Int)]
        made = self.call(depth, touch, maker) if members else None
        return Part(made, self.rng.choice(members)) if made is not None else None

    def argument(self, parameter: Variable, depth: int, touch: Touch) -> Expr | None:
        kind = parameter.type
        if isinstance(kind, Int):
            return self.expr(depth, touch)
        if isinstance(kind, Struct):
            found = [each for each in self.scope.visible if each.type == kind and touch.may_read((each,))]
            if not found:
                return None
            chosen = self.rng.choice(found)
            touch.reads.add(chosen)
            return Var(chosen)
        return self.address(self.rng.choice(parameter.pointees), kind.target, touch, parameter.limit)

    def address(self, variable: Variable, kind: Int | Struct, touch: Touch, limit: int = 0) -> AddressOf:
        """Where a pointer to `kind` may point in a variable; with a limit, to the first of so many."""
        whole = variable.type
        assert isinstance(whole, (Int, Array, Struct))
        if isinstance(whole, Int) or whole == kind:
            return AddressOf(variable)
        if isinstance(whole, Array) and whole.element == kind:
            inside = not limit and self.chance(0.4)
            return AddressOf(variable, self.index(whole.dims[0], touch, 0) if inside else None)
        base: Var | Element = Var(variable)
        if isinstance(whole, Array):
            base = Element(base, self.indices(whole, touch, 0))
        struct = whole.element if isinstance(whole, Array) else whole
        assert isinstance(struct, Struct)
        member = self.rng.choice([each for each in struct.members if elements(each, kind) >= max(limit, 1)])
        inside = isinstance(member.type, Array) and not limit and self.chance(0.4)
        size = member.type.dims[0] if isinstance(member.type, Array) else 0
        return AddressOf(variable, self.index(size, touch, 0) if inside else None, MemberOf(base, member))


def _countable(kind: Int) -> bool:
    return kind.kind == "int"


def elements(member: Member, kind: Int | Struct) -> int:
    """How many elements of a type a pointer to the member has behind it."""
    if isinstance(member.type, Array):
        return member.type.count if member.type.element == kind and len(member.type.dims) == 1 else 0
    return int(member.type == kind and not member.width)


def reachable(variable: Variable, kind: Int | Struct) -> int:
    """How many elements of a type lie in a row in a variable; 0 where a pointer to it has nothing there."""
    whole = variable.type
    if isinstance(whole, Array) and len(whole.dims) > 1:
        return 0
    if whole == kind:
        return 1
    if isinstance(whole, Array):
        if whole.element == kind:
            return whole.dims[0]
        whole = whole.element
    return max(elements(each, kind) for each in whole.members) if isinstance(whole, Struct) else 0


def base_of(place: Expr) -> Variable:
    """The variable that a place is in, or whose value points to it."""
    match place:
        case Var(variable) | Deref(variable):
            return variable
        case Element(inner, _) | MemberOf(inner, _):
            return base_of(inner)
    raise TypeError(place)
