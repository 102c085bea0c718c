"""The typed tree of a program: statements, functions, the program.

In: nothing; this is the value that passes from the semantic analysis to the code generator.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from servogen.compiler.ctypes import CType
from servogen.compiler.tree import Call, Expr, Symbol
from servogen.errors import Place


@dataclass(slots=True)
class ExprStmt:
    expr: Expr


@dataclass(slots=True)
class Block:
    body: list[Stmt]


@dataclass(slots=True)
class If:
    condition: Expr
    yes: Stmt
    no: Stmt | None
    place: Place


@dataclass(slots=True)
class Loop:
    """`while`, `for` and `do`: the test comes first unless `post`; `step` runs before the test is
    repeated.
    """

    condition: Expr | None
    body: Stmt
    step: Expr | None
    post: bool
    place: Place
    kind: str
    """The keyword it was written with."""


@dataclass(slots=True)
class Switch:
    value: Expr
    cases: list[tuple[int, CaseLabel]]
    default: CaseLabel | None
    body: Stmt
    place: Place


@dataclass(eq=False, slots=True)
class CaseLabel:
    place: Place


@dataclass(slots=True)
class Jump:
    """`break`, `continue` or `goto label`."""

    kind: str
    label: str
    place: Place


@dataclass(slots=True)
class LabelStmt:
    name: str
    place: Place


@dataclass(slots=True)
class Return:
    value: Expr | None
    place: Place


@dataclass(slots=True)
class Asm:
    """Lines of assembly with their places; `names` are the C variables that they can see, `calls` the C
    functions that they call.
    """

    lines: list[tuple[Place, str]]
    names: dict[str, Symbol]
    calls: list[Call]
    place: Place


Stmt = ExprStmt | Block | If | Loop | Switch | CaseLabel | Jump | LabelStmt | Return | Asm


@dataclass(eq=False, slots=True)
class Function:
    name: str
    result: CType
    parameters: list[Symbol]
    place: Place
    body: Block | None = None
    interrupt: bool = False
    prototyped: bool = True
    static: bool = False
    locals: list[Symbol] = field(default_factory=list)
    end: Place = field(default_factory=Place)


@dataclass(slots=True)
class Program:
    """All source files together."""

    functions: dict[str, Function]
    symbols: list[Symbol]
    """Globals, fixed-address variables and flash tables."""
    asm: list[Asm]
    """Assembly at file level."""
    eeprom: dict[int, int]
    config_words: list[tuple[str, str, Place]]
