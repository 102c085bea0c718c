"""Lists the nodes of the typed tree, and of pycparser's tree.

In: a node. Out: it and all nodes below it; those of the typed tree in the order of the source.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeGuard

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.nodes import Expr

_LEAVES = frozenset(
    ("bool", "int", "int | None", "str", "CType", "IntType", "Location", "Symbol", "dict[str, Symbol]")
) | {"list[tuple[Location, str]]"}
"""Types of fields that hold no nodes, as they are annotated."""


CHILD_FIELDS = {
    kind: tuple(name for name, member in reversed(fields.items()) if member.type not in _LEAVES)
    for kind in vars(tree).values()
    if getattr(kind, "__module__", "") == tree.__name__ and kind is not tree.Symbol
    if (fields := getattr(kind, "__dataclass_fields__", None)) is not None
}
"""The fields that may hold nodes, last first, by the class of a node."""


VALUES = (
    *(tree.Num, tree.Ref, tree.Deref, tree.AddressOf, tree.Cast, tree.Unary),
    *(tree.Binary, tree.Logic, tree.Comma, tree.Choice),
)
"""The expressions that change nothing by themselves."""


def nodes(root: object) -> Iterator[object]:
    """Yield a statement or an expression, and all below it; of a list or tuple, those of its elements."""
    waiting = [root]
    while waiting:
        node = waiting.pop()
        names = CHILD_FIELDS.get(node.__class__)
        if names is not None:
            yield node
            for name in names:
                waiting.append(getattr(node, name))
        elif isinstance(node, (list, tuple)):
            waiting += reversed(node)


def expressions(root: object) -> Iterator[Expr]:
    """Yield every expression in a statement or expression, including itself."""
    return filter(_is_expression, nodes(root))


def evaluated(root: Expr) -> Iterator[Expr]:
    """Yield an expression and all below it that are evaluated with it: of an address, the index, but not the
    object that is there.
    """
    addressed: Expr | None = None
    for expr in expressions(root):
        if expr is not addressed:
            yield expr
        addressed = expr.target if isinstance(expr, tree.AddressOf) else None  # which comes next


def _is_expression(node: object) -> TypeGuard[Expr]:
    return hasattr(node, "type")


def syntax_nodes(root: Any) -> list[Any]:
    """Return a node of pycparser's tree and all below it, the upper ones first."""
    nodes_below = [root]
    for node in nodes_below:
        nodes_below += node
    return nodes_below
