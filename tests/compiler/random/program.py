"""A random program as a value: types, variables, expressions, statements, functions.

In: nothing; `generate` makes these values, `shrink` cuts them, `target_c` and `host_c` print them. Nodes
carry no types of their own: `typing_rules` derives them, so any part may be replaced by any other.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Int:
    """An integer type by its own name; `kind` is "int", "bool" (0 or 1 by truth) or "bit" (the lowest
    bit).
    """

    name: str
    bits: int
    signed: bool
    kind: str = "int"

    @property
    def size(self) -> int:
        return (self.bits + 7) // 8

    def wrap(self, value: int) -> int:
        """`value` converted to this type."""
        if self.kind == "bool":
            return int(value != 0)
        value &= (1 << self.bits) - 1
        return value - (1 << self.bits) if self.signed and value >> self.bits - 1 else value


U8, S8 = Int("U8", 8, False), Int("S8", 8, True)
U16, S16 = Int("U16", 16, False), Int("S16", 16, True)
U24, S24 = Int("U24", 24, False), Int("S24", 24, True)
U32, S32 = Int("U32", 32, False), Int("S32", 32, True)
BOOL, BIT = Int("BOOL", 8, False, "bool"), Int("BIT", 1, False, "bit")


@dataclass(frozen=True)
class Array:
    element: Int | Struct
    dims: tuple[int, ...]

    @property
    def count(self) -> int:
        found = 1
        for each in self.dims:
            found *= each
        return found

    @property
    def size(self) -> int:
        return self.count * self.element.size


@dataclass(frozen=True)
class Member:
    """`width` is 0, or that of a bit-field."""

    name: str
    type: Int | Array
    width: int = 0


@dataclass(frozen=True)
class Struct:
    tag: str
    members: tuple[Member, ...]
    union: bool = False

    @property
    def size(self) -> int:
        """An upper bound: bit-fields count a byte each."""
        sizes = [each.type.size for each in self.members]
        return max(sizes) if self.union else sum(sizes)

    def offsets(self) -> tuple[int, ...]:
        """Where each member's byte lies, and the number of bytes behind them all: bit-fields fill a byte from
        bit 0 on and cross none.
        """
        found, at, bit = [], 0, 0
        for each in self.members:
            if bit and (not each.width or bit + each.width > 8):
                at, bit = at + 1, 0
            found.append(at)
            if each.width:
                bit += each.width
            else:
                at += each.type.size
        return (*found, at + (bit > 0))


@dataclass(frozen=True)
class Pointer:
    """To elements of one type; `const` ones may point to flash. `fixed` is `T *const p`."""

    target: Int | Struct
    const: bool = False
    fixed: bool = False

    @property
    def size(self) -> int:
        return 2 if self.const else 1


Type = Int | Array | Struct | Pointer


@dataclass(eq=False)
class Variable:
    """`storage`: "global", "const", "static", "local", "param", "counter", or "never": a global that stays 0.

    `initial` is a flat tuple of numbers, or an expression for a local. `pointees` are the objects that a
    pointer may point to. `limit` is a bound that a counter stays below, or
    the elements behind a pointer that is never moved.
    """

    name: str
    type: Type
    storage: str
    initial: tuple[int, ...] | Expr | None = None
    pointees: tuple[Variable, ...] = ()
    limit: int = 0
    where: str = ""
    """How the chip keeps a global: "volatile", "register" (the chip's of this name) or "@ address"; "hidden"
    is named by constant pointers alone, and every store to a "watched @ address" is compared."""

    @property
    def watched(self) -> int | None:
        """The address where a watcher of the bus sees every store, or None."""
        return int(self.where.split()[-1], 16) if self.where.startswith("watched") else None

    @property
    def watched_bytes(self) -> range:
        """Their addresses; none where it is not watched."""
        size = self.type.offsets()[-1] if isinstance(self.type, Struct) else self.type.size
        return range(0) if self.watched is None else range(self.watched, self.watched + size)

    @property
    def base(self) -> bool:
        """Whether a pointer always points to the first of at least `limit` elements."""
        return isinstance(self.type, Pointer) and self.limit > 0

    def __repr__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Num:
    """`suffix` as written; `base` 10, 16 or 2."""

    value: int
    suffix: str = ""
    base: int = 10


@dataclass(frozen=True)
class Var:
    variable: Variable


@dataclass(frozen=True)
class Element:
    """An array's element, also of a member array: indices are masked or reduced where they are printed."""

    array: Var | MemberOf
    indices: tuple[Expr, ...]


@dataclass(frozen=True)
class MemberOf:
    base: Var | Element | Deref
    member: Member


@dataclass(frozen=True)
class Deref:
    """`*p`, or `p[0]`."""

    pointer: Variable
    indexed: bool = False


@dataclass(frozen=True)
class Unary:
    op: str
    operand: Expr


@dataclass(frozen=True)
class Binary:
    """Operators that are defined for all values: + - * & | ^ and comparisons."""

    op: str
    left: Expr
    right: Expr


@dataclass(frozen=True)
class Divide:
    """/ or %; a divisor that is no constant is printed with `| 1`."""

    op: str
    left: Expr
    right: Expr


@dataclass(frozen=True)
class Shift:
    """<< or >>; a count that is no constant in range is printed masked."""

    op: str
    left: Expr
    right: Expr


@dataclass(frozen=True)
class Logic:
    op: str
    left: Expr
    right: Expr


@dataclass(frozen=True)
class Choice:
    condition: Expr
    yes: Expr
    no: Expr


@dataclass(frozen=True)
class Comma:
    first: Expr
    second: Expr


@dataclass(frozen=True)
class Cast:
    type: Int
    operand: Expr


@dataclass(frozen=True)
class SizeOf:
    type: Int


Place = Var | Element | MemberOf | Deref


@dataclass(frozen=True)
class Assign:
    target: Place
    value: Expr


@dataclass(frozen=True)
class Update:
    """`target op= value`; divisors and counts are guarded as in `Divide` and `Shift`."""

    op: str
    target: Place
    value: Expr


@dataclass(frozen=True)
class Step:
    """++ and --, before or behind."""

    op: str
    target: Place
    prefix: bool


@dataclass(frozen=True)
class AddressOf:
    """Where a pointer is to point: an element of an array (or the array itself), or a scalar. `place` is the
    member in the variable that is meant."""

    variable: Variable
    index: Expr | None = None
    place: MemberOf | None = None


@dataclass(frozen=True)
class Call:
    function: Function
    arguments: tuple[Expr, ...]


@dataclass(frozen=True)
class Part:
    """A member of the structure that a call gives."""

    made: Call
    member: Member


@dataclass(frozen=True)
class TestBit:
    """One bit of a variable: a built-in, a bit member or a mask."""

    target: Var
    bit: int


Expr = (
    Num
    | Var
    | Element
    | MemberOf
    | Deref
    | Unary
    | Binary
    | Divide
    | Shift
    | Logic
    | Choice
    | Comma
    | Cast
    | SizeOf
    | Assign
    | Update
    | Step
    | AddressOf
    | Call
    | Part
    | TestBit
)


@dataclass(frozen=True)
class ExprStmt:
    expr: Expr


@dataclass(frozen=True)
class Out:
    """Every byte of a value into the checksum."""

    expr: Expr


@dataclass(frozen=True)
class If:
    condition: Expr
    yes: tuple[Stmt, ...]
    no: tuple[Stmt, ...] = ()


@dataclass(frozen=True)
class Loop:
    """`form`: "up", "down", "while", "countdown", "do", "guarded" (with `condition`); at most `rounds`
    rounds.
    """

    form: str
    counter: Variable
    rounds: int
    body: tuple[Stmt, ...]
    condition: Expr | None = None


@dataclass(frozen=True)
class Walk:
    """A pointer over the `count` elements from `start` on, a step a round; with a value or target by
    `*p++ = value` or `target = *p++`.
    """

    pointer: Variable
    start: AddressOf
    count: int
    counter: Variable
    body: tuple[Stmt, ...]
    value: Expr | None = None
    target: Place | None = None
    step: str = "{}++"
    """How a walk without value and target moves its pointer."""


@dataclass(frozen=True)
class Case:
    values: tuple[int, ...]
    body: tuple[Stmt, ...]
    default: bool = False
    falls: bool = False


@dataclass(frozen=True)
class Switch:
    value: Expr
    cases: tuple[Case, ...]


@dataclass(frozen=True)
class Jump:
    """`break` or `continue`."""

    kind: str


@dataclass(frozen=True)
class Skip:
    """`if (condition) goto label; body; label: ;`"""

    condition: Expr
    label: str
    body: tuple[Stmt, ...]


@dataclass(frozen=True)
class Leave:
    """`goto label` of a `Skip` around it."""

    label: str


@dataclass(frozen=True)
class Again:
    """`label: body; if (--counter) goto label;`"""

    label: str
    counter: Variable
    rounds: int
    body: tuple[Stmt, ...]


@dataclass(frozen=True)
class Block:
    locals: tuple[Variable, ...]
    body: tuple[Stmt, ...]


@dataclass(frozen=True)
class Point:
    """`p = &array[index]`"""

    pointer: Variable
    to: AddressOf


@dataclass(frozen=True)
class CopyStruct:
    target: Var
    source: Var | Call


@dataclass(frozen=True)
class SetBit:
    """`what`: "set", "clear" or "toggle"."""

    what: str
    target: Var
    bit: int


@dataclass(frozen=True)
class Hang:
    """A loop that never ends, behind a condition that never holds: `never` stays 0. `form`: "while", "for",
    "do", "self" (`while (never);`), "jump" or "call" (of a function that never returns)."""

    never: Variable
    form: str
    label: str
    body: tuple[Stmt, ...] = ()


@dataclass(frozen=True)
class Return:
    value: Expr | None


Stmt = (
    ExprStmt
    | Out
    | If
    | Loop
    | Walk
    | Switch
    | Jump
    | Skip
    | Leave
    | Again
    | Block
    | Point
    | CopyStruct
    | SetBit
    | Hang
    | Return
)


@dataclass(eq=False)
class Function:
    """`reads` and `writes` are the objects outside that a call may touch."""

    name: str
    result: Int | Struct | None
    parameters: tuple[Variable, ...]
    locals: tuple[Variable, ...] = ()
    body: tuple[Stmt, ...] = ()
    reads: frozenset[Variable] = frozenset()
    writes: frozenset[Variable] = frozenset()
    cost: int = 1
    """Roughly how many operations a call takes."""
    returns: Variable | None = None
    """The structure that a function with such a result gives back at its end."""

    def __repr__(self) -> str:
        return self.name


FILES = ("one", "extern", "first", "last")
"""One file; one that declares every global `extern` before it defines it; two files, of which the first or
the last defines the globals that the other declares."""
LEVELS = ("speed", "size", "none")
"""Of optimisation."""


@dataclass(frozen=True)
class Program:
    """`functions` in an order in which each calls only earlier ones; the last is main."""

    seed: int
    dialect: str
    structs: tuple[Struct, ...] = ()
    globals: tuple[Variable, ...] = ()
    functions: tuple[Function, ...] = field(default=())
    interrupt: bool = False
    """Whether a timer interrupt runs beside it, which must change nothing."""
    files: str = "one"
    """`FILES`: how it is divided into source files."""
    level: str = "speed"
    """The level of optimisation that it is compiled at."""
