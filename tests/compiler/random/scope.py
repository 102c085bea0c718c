"""What a function under construction can see, and the places that can be read or written in it."""

from __future__ import annotations

from dataclasses import dataclass, field

from tests.compiler.random.program import Array, Function, Int, Pointer, Struct, Variable
from tests.compiler.random.touch import BUS, Touch


@dataclass
class Scope:
    """State of one function's making; blocks push and pop `visible`."""

    visible: list[Variable]
    callable: list[Function]
    result: Int | None = None
    locals: list[Variable] = field(default_factory=list)
    touched: Touch = field(default_factory=Touch)
    """Everything outside that the function has touched so far."""
    locked: set[Variable] = field(default_factory=set)
    """Pointers that a walk moves."""
    labels: list[str] = field(default_factory=list)
    loops: int = 0
    breakable: int = 0
    continuable: int = 0
    rounds: int = 1
    """How often the statement being made runs in a call of the function."""
    cost: int = 0
    made: int = 0
    has_block: bool = False

    def pointers(self, *, const: bool) -> list[Variable]:
        return [
            each
            for each in self.visible
            if isinstance(each.type, Pointer)
            and each.type.const == const
            and each not in self.locked
            and not each.base
            and not each.type.fixed
        ]

    def local_bytes(self) -> int:
        return sum(each.type.size for each in self.locals if each.storage != "static")


def reaches(variable: Variable) -> tuple[Variable, ...]:
    """The objects that an access through a variable may touch: itself, or what it points to."""
    if isinstance(variable.type, Pointer):
        return variable.pointees
    return (variable,) if variable.watched is None else (variable, BUS)


def writable(variable: Variable) -> bool:
    if variable.storage in ("const", "counter", "never"):
        return False
    return not (isinstance(variable.type, Pointer) and variable.type.const)


def has_numbers(variable: Variable) -> bool:
    """Whether some place in it is an integer."""
    kind = variable.type
    if isinstance(kind, Pointer):
        kind = kind.target
    return isinstance(kind, (Int, Array, Struct))
