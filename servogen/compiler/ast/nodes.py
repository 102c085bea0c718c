"""The typed tree of a program: symbols, expressions, statements, functions.

In: nothing; the semantic analysis builds these values. Out: the tree that the code generator translates.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from servogen.compiler.ast.types import CType, IntType
from servogen.errors import Location


@dataclass(eq=False, slots=True)
class Symbol:
    """A variable: its storage and what is known about its use."""

    name: str
    type: CType
    kind: str
    """ "global", "local", "param", "result", "temp", "fixed" (at `address`), "flash" or "eeprom"."""
    place: Location = field(default_factory=Location)
    function: str | None = None
    address: int | None = None
    bank1: bool = False
    pinned: bool = False
    """Reached through a pointer, an index or assembly: its bytes stay together and are never kept
    elsewhere.
    """
    volatile: bool = False
    initial: dict[int, Data] | None = None
    """What it starts with: a byte each, by offset."""
    persistent: bool = False
    """Not initialised: it keeps its value through a reset."""
    asm_name: str = ""

    @property
    def size(self) -> int:
        return self.type.size

    @property
    def static(self) -> bool:
        return self.kind in ("global", "fixed", "flash")

    def __repr__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class AddressByte:
    """One byte of the address of an object (plus an offset) as a constant; `part` 0 is the low byte."""

    symbol: Symbol
    offset: int
    part: int


Data = int | AddressByte


@dataclass(slots=True)
class Num:
    """A constant; of a floating-point type, its bytes as an integer."""

    value: int
    type: CType
    place: Location
    exact: int | None = None
    """The sum, difference or product of constants that C2C's 16 bits hold without a sign, where `value` is
    negative.
    """


@dataclass(slots=True)
class Ref:
    """An object or part of one, at `symbol` + `offset` + `index` bytes."""

    symbol: Symbol
    offset: int
    index: Expr | None
    type: CType
    place: Location
    bit: int | None = None
    width: int = 0
    """A bit-field of `type`, its lowest bit in the byte at `offset`."""


@dataclass(slots=True)
class Deref:
    """The object that a pointer points to, `offset` bytes further on."""

    pointer: Expr
    offset: int
    type: CType
    place: Location
    bit: int | None = None
    width: int = 0


@dataclass(slots=True)
class AddressOf:
    """The address of an object (its `index` included) as a pointer value."""

    target: Ref
    type: CType
    place: Location


@dataclass(slots=True)
class Cast:
    """A conversion to another type, explicit or implicit (ISO C 6.3)."""

    operand: Expr
    type: CType
    place: Location


@dataclass(slots=True)
class Unary:
    """`-`, `~`, or `!` (whose type is int)."""

    op: str
    operand: Expr
    type: CType
    place: Location


@dataclass(slots=True)
class Binary:
    """Arithmetic on operands of the result type, comparisons of operands of one type, and shifts by any
    integer.
    """

    op: str
    left: Expr
    right: Expr
    type: CType
    place: Location


@dataclass(slots=True)
class Logic:
    """`&&` or `||`."""

    op: str
    left: Expr
    right: Expr
    type: CType
    place: Location


@dataclass(slots=True)
class Choice:
    """The conditional operator, `? :`."""

    condition: Expr
    yes: Expr
    no: Expr
    type: CType
    place: Location


@dataclass(slots=True)
class Comma:
    """Two expressions, evaluated in order; the value is the second one's (ISO C 6.5.17)."""

    first: Expr
    second: Expr
    type: CType
    place: Location


@dataclass(slots=True)
class Assign:
    """`target = value`, where the value already has the target's type."""

    target: Ref | Deref
    value: Expr
    type: CType
    place: Location


@dataclass(slots=True)
class Update:
    """`target op= value`, computed in the type `work`; with `post`, the result is the previous value."""

    op: str
    target: Ref | Deref
    value: Expr
    work: IntType
    post: bool
    type: CType
    place: Location


@dataclass(slots=True)
class Call:
    """A call of a function by its name, with converted arguments."""

    function: str
    arguments: list[Expr]
    type: CType
    place: Location


@dataclass(slots=True)
class Builtin:
    """An operation of the chip or the library, identified by `name`; `data` holds whatever is not an
    expression.
    """

    name: str
    arguments: list[Expr]
    type: CType
    place: Location
    data: object = None
    pure: bool = False
    """Whether it only yields a value, so that not using the value is a mistake."""
    clears_watchdog: bool = False
    returns: bool = True


FLOAT_OPERATIONS = frozenset(
    (
        "float_add",
        "float_subtract",
        "float_multiply",
        "float_divide",
        "float_compare",
        "float_to_integer",
        "float_from_integer",
        "float_square_root",
    )
)
"""The names of `Builtin`s that compute with floating-point values. Elsewhere in the tree such a value is only
moved: a `Cast` to or from an integer of the same size reads its bytes as they are.
"""

LESS, EQUAL, GREATER = 1, 2, 4
"""The results of `float_compare`; 0 where an operand is not a number."""


@dataclass(slots=True)
class WideField:
    """A bit-field of 9 to 15 bits: the low `width` bits of two bytes. The semantic analysis replaces it."""

    container: Ref | Deref
    width: int
    type: CType
    place: Location


@dataclass(slots=True)
class EepromObject:
    """A variable in the EEPROM, or a part of one. The semantic analysis replaces it by reads and writes."""

    address: Expr
    type: CType
    place: Location


class ConstNum(Num):
    """The known value of a const object: a number that remembers its location, so that `&` works."""

    __slots__ = ("reference",)

    def __init__(self, reference: Ref, value: int) -> None:
        super().__init__(value, reference.type.plain(), reference.place)
        self.reference = reference


Expr = (
    Num
    | Ref
    | Deref
    | AddressOf
    | Cast
    | Unary
    | Binary
    | Logic
    | Choice
    | Comma
    | Assign
    | Update
    | Call
    | Builtin
    | WideField
    | EepromObject
)


@dataclass(slots=True)
class ExprStmt:
    """An expression that is evaluated for its effect."""

    expr: Expr


@dataclass(slots=True)
class BlockStatement:
    """Statements, one after the other."""

    body: list[Stmt]


@dataclass(slots=True)
class If:
    """An `if`, with or without an `else`."""

    condition: Expr
    yes: Stmt
    no: Stmt | None
    place: Location


@dataclass(slots=True)
class Loop:
    """A `while`, `for` or `do` loop. The test comes first unless `post` is set; `step` runs before the test
    is repeated.
    """

    condition: Expr | None
    body: Stmt
    step: Expr | None
    post: bool
    place: Location
    kind: str
    """The keyword it was written with."""


@dataclass(slots=True)
class Switch:
    """A `switch`; its cases are labels somewhere in its body (ISO C 6.8.4.2)."""

    value: Expr
    cases: list[tuple[int, CaseLabel]]
    default: CaseLabel | None
    body: Stmt
    place: Location


@dataclass(eq=False, slots=True)
class CaseLabel:
    """The place of a `case` or `default` in the body of a switch."""

    place: Location


@dataclass(slots=True)
class Jump:
    """`break`, `continue` or `goto label`."""

    kind: str
    label: str
    place: Location


@dataclass(slots=True)
class LabelStmt:
    """A label that `goto` names."""

    name: str
    place: Location


@dataclass(slots=True)
class Return:
    """A `return`, with or without a value."""

    value: Expr | None
    place: Location


@dataclass(slots=True)
class Asm:
    """Lines of assembly with their locations; `names` are the C variables visible to them, `calls` the C
    functions that they call.
    """

    lines: list[tuple[Location, str]]
    names: dict[str, Symbol]
    calls: list[Call]
    place: Location


Stmt = ExprStmt | BlockStatement | If | Loop | Switch | CaseLabel | Jump | LabelStmt | Return | Asm


@dataclass(eq=False, slots=True)
class FunctionDefinition:
    """A function: its signature and, where it is defined, its body."""

    name: str
    result: CType
    parameters: list[Symbol]
    place: Location
    body: BlockStatement | None = None
    interrupt: bool = False
    naked: bool = False
    """Its body is assembly that returns by itself: no code is added before or after it."""
    prototyped: bool = True
    static: bool = False
    origin: int | None = None
    """The word of program memory at which it must begin."""
    locals: list[Symbol] = field(default_factory=list)
    end: Location = field(default_factory=Location)


@dataclass(slots=True)
class ProgramTree:
    """All source files of a program, merged."""

    functions: dict[str, FunctionDefinition]
    symbols: list[Symbol]
    """Globals, fixed-address variables and flash tables."""
    asm: list[Asm]
    """Assembly at file level."""
    eeprom: dict[int, int]
    ids: dict[int, int] = field(default_factory=dict)
    """The user's ID words, by number."""
