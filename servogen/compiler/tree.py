"""The typed tree: what the program means, every conversion explicit, names resolved, constants folded.

In: nothing; this is the value that passes from the semantic analysis to the code generator. Every
expression has a type and a place. Addresses inside an object are byte offsets.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from servogen.compiler.ctypes import CType, IntType
from servogen.errors import Place


@dataclass(eq=False, slots=True)
class Symbol:
    """A variable: its storage and what is known of its use."""

    name: str
    type: CType
    kind: str
    """ "global", "local", "param", "result", "temp", "fixed" (at `address`) or "flash"."""
    place: Place = field(default_factory=Place)
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
    read: bool = False
    written: bool = False
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
    """One byte of the address of an object (plus an offset) as a constant: `part` 0 is the low one."""

    symbol: Symbol
    offset: int
    part: int


Data = int | AddressByte


@dataclass(slots=True)
class Num:
    value: int
    type: CType
    place: Place


@dataclass(slots=True)
class Ref:
    """An object or a part of it: `symbol` + `offset` + `index` bytes."""

    symbol: Symbol
    offset: int
    index: Expr | None
    type: CType
    place: Place
    bit: int | None = None
    width: int = 0
    """A bit-field of `type`, its lowest bit in the byte at `offset`."""


@dataclass(slots=True)
class Deref:
    """What a pointer points to, `offset` bytes on."""

    pointer: Expr
    offset: int
    type: CType
    place: Place
    bit: int | None = None
    width: int = 0


@dataclass(slots=True)
class AddressOf:
    """The address of an object (its `index` included) as a pointer value."""

    target: Ref
    type: CType
    place: Place


@dataclass(slots=True)
class Cast:
    operand: Expr
    type: CType
    place: Place


@dataclass(slots=True)
class Unary:
    """`-`, `~`, or `!` (whose type is int)."""

    op: str
    operand: Expr
    type: CType
    place: Place


@dataclass(slots=True)
class Binary:
    """Arithmetic on operands of the result's type; comparisons on operands of one type; shifts by any
    integer.
    """

    op: str
    left: Expr
    right: Expr
    type: CType
    place: Place


@dataclass(slots=True)
class Logic:
    """`&&` or `||`."""

    op: str
    left: Expr
    right: Expr
    type: CType
    place: Place


@dataclass(slots=True)
class Choice:
    """`? :`"""

    condition: Expr
    yes: Expr
    no: Expr
    type: CType
    place: Place


@dataclass(slots=True)
class Comma:
    first: Expr
    second: Expr
    type: CType
    place: Place


@dataclass(slots=True)
class Assign:
    target: Ref | Deref
    value: Expr
    type: CType
    place: Place


@dataclass(slots=True)
class Update:
    """`target op= value`, computed in the type `work`; `post` gives the value from before."""

    op: str
    target: Ref | Deref
    value: Expr
    work: IntType
    post: bool
    type: CType
    place: Place


@dataclass(slots=True)
class Call:
    function: str
    arguments: list[Expr]
    type: CType
    place: Place


@dataclass(slots=True)
class Builtin:
    """An operation of the chip or the library; `name` says which, `data` carries what is not an
    expression.
    """

    name: str
    arguments: list[Expr]
    type: CType
    place: Place
    data: object = None


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
)
