"""Makes `char *` a pointer to const where a program reads strings through it and never writes.

In: pycparser's trees of all files of a program. Out: the same trees, where `void show(char *text)`, called
with `"Hello"`, declares a `const char *`. Strings are stored in flash, which only a pointer to const reaches.
A pointer that something is written through stays as it is, and the analysis reports the string that is
assigned to it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from pycparser import c_ast

from servogen.compiler.ast.walk import syntax_nodes
from servogen.compiler.diagnostics import is_own_file
from servogen.compiler.frontend.syntax_errors import place_of

Key = tuple[str, str]
"""A variable or parameter: (function or "", name); a member: ("struct", name); a result: (function,
"return").
"""
_MEMBER, _RESULT, _GLOBAL = "struct", "return", ""
_UNKNOWN: Key = ("?", "?")
"""Where a pointer may go that this module does not follow."""


def infer_const_pointers(files: Iterable[list[Any]]) -> None:
    """Add `const` to what those pointers point to that strings reach and nothing is written through."""
    pointers = _Pointers()
    units = [unit for file in files for unit in file]
    for unit in units:
        pointers.declare(unit)
    for unit in units:
        with suppress(RecursionError):  # the analysis reports it, with its place
            pointers.follow(unit)
    for key in pointers.readable():
        for target in pointers.targets.get(key, ()):
            if "const" not in target.quals:
                target.quals = [*target.quals, "const"]


@dataclass(slots=True)
class _Pointers:
    """The pointers of a program, and where each is copied to and written through."""

    targets: dict[Key, list[Any]] = field(default_factory=dict)
    """The type that each pointer points to, in every declaration of it."""
    constant: set[Key] = field(default_factory=set)
    """What is in flash by its own declaration, or a pointer to it."""
    parameters: dict[str, list[list[Key | None]]] = field(default_factory=dict)
    """The parameters of each function, for each of its declarations."""
    defined: set[str] = field(default_factory=set)
    library: set[str] = field(default_factory=set)
    """The functions that the compiler's own headers declare."""
    flows: set[tuple[Key | None, Key]] = field(default_factory=set)
    """(from, to) of every pointer that is copied; None is a string."""
    written: set[Key] = field(default_factory=set)
    dimensions: dict[Key, int] = field(default_factory=dict)
    """How many dimensions each array of pointers has."""
    function: str = _GLOBAL
    locals: set[str] = field(default_factory=set)

    # declarations

    def declare(self, unit: Any) -> None:
        """Note the pointers that a file declares outside functions, and the parameters of its functions."""
        if isinstance(unit, c_ast.FuncDef):
            self.defined.add(unit.decl.name)
            self.variable(unit.decl, _GLOBAL)
        elif isinstance(unit, (c_ast.Decl, c_ast.Typedef)):
            self.variable(unit, _GLOBAL)
            if is_own_file(place_of(unit.coord)):
                self.library.add(unit.name or "")

    def variable(self, decl: Any, scope: str) -> None:
        """Note the pointers of one declaration: its members, parameters and result among them."""
        kind = decl.type
        for member in _members(kind):
            self.pointer(member.type, (_MEMBER, member.name or ""))
        if isinstance(kind, c_ast.FuncDecl):
            keys: list[Key | None] = []
            for number, parameter in enumerate(kind.args.params if kind.args is not None else []):
                name = getattr(parameter, "name", None) or f"#{number}"
                key = (decl.name or "", name)
                pointer = hasattr(parameter, "type") and self.pointer(_adjusted(parameter.type), key)
                keys.append(key if pointer else None)
            self.parameters.setdefault(decl.name or "", []).append(keys)
            self.pointer(kind.type, (decl.name or "", _RESULT))
        elif decl.name is not None and not isinstance(decl, c_ast.Typedef):
            self.pointer(kind, (scope, decl.name))

    def pointer(self, kind: Any, key: Key) -> bool:
        """Note a pointer, an array of pointers or a constant array; return whether it is one."""
        array = isinstance(kind, c_ast.ArrayDecl)
        inner = kind
        while isinstance(inner, c_ast.ArrayDecl):
            inner = inner.type
        target = inner.type if isinstance(inner, c_ast.PtrDecl) else inner if array else None
        if not isinstance(target, c_ast.TypeDecl):
            return False
        if array and isinstance(inner, c_ast.PtrDecl):
            self.dimensions[key] = max(self.dimensions.get(key, 0), _dimensions(kind))
        if "const" in target.quals:
            self.constant.add(key)
        elif isinstance(inner, c_ast.PtrDecl):
            self.targets.setdefault(key, []).append(target)
        return True

    # where pointers go

    def follow(self, unit: Any) -> None:
        """Follow the pointers through a function, or through an initialiser at file level."""
        if isinstance(unit, c_ast.Decl):
            self.visit(unit)
        elif isinstance(unit, c_ast.FuncDef):
            self.function = unit.decl.name
            arguments = unit.decl.type.args if isinstance(unit.decl.type, c_ast.FuncDecl) else None
            self.locals = {
                parameter.name
                for parameter in (arguments.params if arguments else [])
                if hasattr(parameter, "name")
            }
            for node in syntax_nodes(unit.body):
                if isinstance(node, c_ast.Decl) and node.name is not None:
                    self.locals.add(node.name)
                    self.variable(node, self.function)
            self.visit(unit.body)
            self.function, self.locals = _GLOBAL, set()

    def visit(self, node: Any) -> None:
        """Note what a node and the nodes below it copy and write."""
        match node:
            case c_ast.Decl(init=init) if init is not None:
                self.initialise(self.name(node.name or ""), init)
            case c_ast.Assignment():
                self.write(node.lvalue)
                if node.op == "=" and (place := self.place(node.lvalue)) is not None:
                    self.flow(node.rvalue, place)
            case c_ast.UnaryOp(op="++" | "--" | "p++" | "p--"):
                self.write(node.expr)
            case c_ast.UnaryOp(op="&", expr=c_ast.ID(name=name)):
                self.written.add(self.name(name))
            case c_ast.Return() if node.expr is not None:
                self.flow(node.expr, (self.function, _RESULT))
            case c_ast.FuncCall(name=c_ast.ID()):
                self.call(node)
                if node.args is not None:
                    self.visit(node.args)
                return
            case c_ast.FuncCall():
                self.call(node)
            case c_ast.ID(name=name) if name in self.parameters and name not in self.locals:
                self.taken(name)
        for child in node:
            self.visit(child)

    def call(self, node: Any) -> None:
        """Note the arguments of a call as copied to the parameters."""
        name = node.name.name if isinstance(node.name, c_ast.ID) else ""
        # what a library function does is known from its declaration, not from its body
        own = name in self.defined or name not in self.library
        declared = self.parameters.get(name, []) if own else []
        for number, argument in enumerate(node.args.exprs if node.args is not None else []):
            keys = [keys[number] for keys in declared if number < len(keys)]
            known = [key for key in keys if key is not None]
            for key in known:
                self.flow(argument, key)
            if not own:
                self.outside(name, number, argument)

    def taken(self, name: str) -> None:
        """Keep the type of a function whose address is taken: a pointer to the function has that type."""
        self.written.add((name, _RESULT))
        self.written.update(key for keys in self.parameters[name] for key in keys if key is not None)

    def outside(self, name: str, number: int, value: Any) -> None:
        """Follow a pointer into a function of the library: its declaration says whether it writes."""
        for keys in self.parameters.get(name, []):
            if number < len(keys) and (key := keys[number]) is not None and key not in self.constant:
                self.flow(value, _UNKNOWN)

    def initialise(self, key: Key, value: Any) -> None:
        """Note the values of an initialiser as copied to a variable or its members."""
        match value:
            case c_ast.InitList():
                for item in value.exprs:
                    self.initialise(key, item)
            case c_ast.NamedInitializer():
                names = [designator.name for designator in value.name if isinstance(designator, c_ast.ID)]
                self.initialise((_MEMBER, names[-1]) if names else key, value.expr)
            case _:
                self.flow(value, key)
                for member in [target for target in self.targets if target[0] == _MEMBER]:
                    if key not in self.targets and isinstance(value, c_ast.Constant):
                        self.flow(value, member)

    def flow(self, value: Any, to: Key) -> None:
        """Note that a value is copied to a pointer."""
        if to not in self.targets and to not in self.constant and to != _UNKNOWN:
            return  # a number, such as the distance of two pointers
        for source in self.sources(value):
            if source in self.dimensions and isinstance(value, (c_ast.ID, c_ast.StructRef)):
                self.written.add(source)  # the array as a whole: its pointers keep their size
                continue
            self.flows.add((source, to))

    def sources(self, value: Any) -> Iterator[Key | None]:
        """Yield the pointers that a value may be a copy of; None for a string."""
        match value:
            case c_ast.Constant(type="string"):
                yield None
            case c_ast.ID(name=name):
                yield self.name(name)
            case c_ast.StructRef():
                yield (_MEMBER, value.field.name)
            case c_ast.ArrayRef():
                yield from (
                    source for source in self.sources(value.name) if not self.is_character(value, source)
                )
            case c_ast.UnaryOp(op="&", expr=c_ast.ArrayRef(name=array)):
                yield from self.sources(array)
            case c_ast.UnaryOp(op="&" | "++" | "--" | "p++" | "p--"):
                yield from self.sources(value.expr)
            case c_ast.BinaryOp(op="+" | "-"):
                yield from self.sources(value.left)
                yield from self.sources(value.right)
            case c_ast.TernaryOp():
                yield from self.sources(value.iftrue)
                yield from self.sources(value.iffalse)
            case c_ast.Assignment():
                yield from self.sources(value.lvalue)
            case c_ast.ExprList():
                yield from self.sources(value.exprs[-1])
            case c_ast.FuncCall(name=c_ast.ID(name=name)):
                yield (name, _RESULT)

    def write(self, target: Any) -> None:
        """Note the pointer that a target is written through."""
        while isinstance(target, (c_ast.ArrayRef, c_ast.UnaryOp, c_ast.StructRef)):
            through = not isinstance(target, c_ast.StructRef) or target.type == "->"
            inner = target.expr if isinstance(target, c_ast.UnaryOp) else target.name
            if through:
                for key in self.sources(inner):
                    if key is not None and not self.is_array_of_pointers(target, key):
                        self.written.add(key)
            target = inner

    def is_array_of_pointers(self, target: Any, key: Key) -> bool:
        """Return whether a write to `target` changes a pointer in an array, not what it points to."""
        return 0 < _indices(target) <= self.dimensions.get(key, 0)

    def is_character(self, value: Any, key: Key | None) -> bool:
        """Return whether an element, `text[i]` or `texts[i][j]`, is a character, not a pointer."""
        return key is None or (key in self.targets and _indices(value) > self.dimensions.get(key, 0))

    def place(self, target: Any) -> Key | None:
        """Return the pointer that an assignment stores to; None where it is not followed."""
        match target:
            case c_ast.ID(name=name):
                return self.name(name)
            case c_ast.StructRef():
                return (_MEMBER, target.field.name)
            case c_ast.ArrayRef():
                return self.place(target.name)
        return None

    def name(self, name: str) -> Key:
        return (self.function if name in self.locals else _GLOBAL, name)

    # the result

    def readable(self) -> set[Key]:
        """Return the pointers that strings reach and that nothing is written through."""
        return self.reached() - self.writing()

    def reached(self) -> set[Key]:
        """Return the pointers that strings reach, directly or through copies."""
        targets = {to for source, to in self.flows if source is None}
        while more := {to for source, to in self.flows if source in targets} - targets:
            targets |= more
        return targets & self.targets.keys()

    def writing(self) -> set[Key]:
        """Return the pointers that are written through, by themselves or by a pointer they are copied to."""
        writers = self.written | {_UNKNOWN}
        flows = self.flows | self.between_declarations()
        while more := {source for source, to in flows if to in writers and source is not None} - writers:
            writers |= more
        return writers

    def between_declarations(self) -> set[tuple[Key | None, Key]]:
        """Return the flows that make a parameter the same in all declarations of its function."""
        same = [keys for declared in self.parameters.values() for keys in zip(*declared, strict=False)]
        return {(one, two) for keys in same for one in keys for two in keys if two is not None}


def _adjusted(kind: Any) -> Any:
    """Return the type of a parameter: `char text[]` is a pointer (ISO C 6.7.6.3)."""
    array = isinstance(kind, c_ast.ArrayDecl) and isinstance(kind.type, c_ast.TypeDecl)
    return c_ast.PtrDecl([], kind.type) if array else kind


def _dimensions(kind: Any) -> int:
    return 1 + _dimensions(kind.type) if isinstance(kind, c_ast.ArrayDecl) else 0


def _indices(value: Any) -> int:
    """Return how many indices follow a name; 0 where they follow another expression."""
    depth = 0
    while isinstance(value, c_ast.ArrayRef):
        value, depth = value.name, depth + 1
    return depth if isinstance(value, (c_ast.ID, c_ast.StructRef)) else 0


def _members(kind: Any) -> Iterator[Any]:
    """Yield the members of the structures that a declaration defines."""
    for node in syntax_nodes(kind):
        if isinstance(node, (c_ast.Struct, c_ast.Union)):
            yield from (decl for decl in node.decls or [] if isinstance(decl, c_ast.Decl))
