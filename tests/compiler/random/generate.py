"""A random program from a seed: the same seed, the same program.

In: a seed and a dialect. Out: a `Program` that has no undefined behaviour in C, ends after a bounded number
of operations and leaves a checksum of all that it computed.
"""

from __future__ import annotations

import random

from tests.compiler.random.expressions import reachable
from tests.compiler.random.program import (
    BIT,
    BOOL,
    FILES,
    S8,
    S16,
    S24,
    S32,
    U8,
    U16,
    U24,
    U32,
    AddressOf,
    Array,
    Element,
    Expr,
    ExprStmt,
    Function,
    Int,
    Loop,
    Member,
    MemberOf,
    Num,
    Out,
    Pointer,
    Program,
    Return,
    Stmt,
    Struct,
    Var,
    Variable,
)
from tests.compiler.random.scope import Scope
from tests.compiler.random.statements import NEVER, Statements
from tests.compiler.random.target_c import DONE
from tests.compiler.random.touch import BUS, CHECKSUM, Touch

_PROFILES: tuple[tuple[float, tuple[Int, ...]], ...] = (
    (4, (U8,)),
    (3, (U8, U8, S8)),
    (5, (U8, U8, U16, S16)),
    (4, (U8, S8, U16, S16, BOOL)),
    (1.5, (U8, U16, S16, BIT)),
    (1.5, (U8, S16, U32, S32)),
    (1, (U8, S16, U24, S24)),
    (1, (U8, S8, U16, S16, U24, S24, U32, S32, BOOL, BIT)),
)
_REGISTERS = ("EEADR", "EEDATA", "TRISB")
"""Registers that hold a byte and do nothing by themselves; TRISB lies in bank 1."""
_RAM = 26
"""Bytes of global variables at most, and about as much for locals."""


class Generator(Statements):
    """Makes one program."""

    def __init__(self, seed: int, dialect: str) -> None:
        rng = random.Random(f"{seed} {dialect}")
        types = rng.choices([each for _, each in _PROFILES], [weight for weight, _ in _PROFILES])[0]
        super().__init__(rng, dialect, types)
        self.seed = seed
        self.globals: list[Variable] = []
        self.structs: list[Struct] = []
        self.functions: list[Function] = []
        self.used = 0
        self.top = DONE

    def program(self) -> Program:
        self._globals()
        interrupt = self.chance(0.12)
        files = self.rng.choice(FILES) if self.chance(0.4) else "one"
        count = self.rng.choice((0, 1, 1, 2, 2, 3))
        for number in range(count):
            self._function(number)
        self._main()
        return Program(
            self.seed,
            self.dialect,
            tuple(self.structs),
            tuple(self.globals),
            tuple(self.functions),
            interrupt,
            files,
        )

    # data

    def value(self, kind: Int) -> int:
        if kind.kind != "int":
            return self.rng.randrange(2)
        edge = (0, 1, 2, 5, 100, 127, 128, 255, kind.wrap(-1), 1 << kind.bits - 1, (1 << kind.bits - 1) - 1)
        return kind.wrap(self.rng.choice(edge) if self.chance(0.5) else self.rng.getrandbits(kind.bits))

    def stored(self) -> Int:
        """A type that arrays and members may have."""
        return self.rng.choice([each for each in self.types if each != BIT] or [U8])

    def add(self, variable: Variable) -> None:
        if variable.storage != "const":
            if self.used + variable.type.size > _RAM:
                return
            self.used += variable.type.size
        self.globals.append(variable)

    def _globals(self) -> None:
        rng = self.rng
        for number in range(rng.randrange(2, 6)):
            kind = self.type()
            initial = (self.value(kind),) if self.chance(0.6) and kind != BIT else None
            self.add(self._kept(Variable(f"g{number}", kind, "global", initial)))
        for name in rng.sample(_REGISTERS, rng.choice((0, 0, 0, 0, 1, 2))):
            self.globals.append(Variable(name, U8, "global", (rng.randrange(256),), where="register"))
        for number in range(rng.choice((0, 1, 1, 2))):
            kind = self.stored()
            dims = (rng.choice((2, 3, 4, 4, 5, 8)),) if kind.bits == 8 else (rng.choice((2, 3, 4)),)
            if self.chance(0.15) and kind.bits == 8:
                dims = (2, rng.choice((2, 3)))
            array = Array(kind, dims)
            initial = tuple(self.value(kind) for _ in range(array.count)) if self.chance(0.5) else None
            self.add(Variable(f"a{number}", array, "global", initial))
        for number in range(rng.choice((0, 0, 1, 1, 2))):
            kind = self.stored()
            dims = (
                (rng.choice((3, 4, 8, 10, 16)),)
                if self.chance(0.8)
                else (rng.choice((2, 4)), rng.choice((3, 4)))
            )
            table = Array(kind, dims)
            self.add(
                Variable(f"t{number}", table, "const", tuple(self.value(kind) for _ in range(table.count)))
            )
        if self.chance(0.4):
            self._structures()
        if self.chance(0.3):
            self._watched()
        if self.chance(0.3):
            self._constant_pointers()
        if self.chance(0.35):
            where = rng.choice(("", "volatile"))
            self.add(Variable(NEVER, U8, "never", (0,) if self.chance(0.5) else None, where=where))

    def _structures(self) -> None:
        rng = self.rng
        members: list[Member] = []
        for number in range(rng.randrange(2, 5)):
            if self.chance(0.3):
                kind = S8 if self.chance(0.25) else U8
                members.append(Member(f"f{number}", kind, rng.choice((1, 1, 2, 3, 4, 7))))
            elif self.chance(0.3):
                members.append(Member(f"m{number}", Array(U8, (self.rng.choice((2, 2, 3)),))))
            else:
                members.append(Member(f"m{number}", self.stored()))
        self.structs.append(Struct("S0", tuple(members)))
        if self.chance(0.3):
            whole = (Member("w", U16), Member("b", Array(U8, (2,))))
            self.structs.append(Struct("U0", whole, union=True))
        for number in range(rng.choice((1, 2, 2))):
            kind = rng.choice(self.structs)
            if self.chance(0.2):
                self.add(Variable(f"r{number}", Array(kind, (2,)), "global"))
            else:
                self.add(Variable(f"s{number}", kind, "global"))
        for number in range(rng.choice((0, 1, 1, 2))):
            struct = rng.choice(self.structs)
            held = Array(struct, (rng.choice((2, 3, 4)),)) if self.chance(0.7) else struct
            self.add(Variable(f"c{number}", held, "const", tuple(self.flat(held))))

    def flat(self, kind: Int | Array | Struct) -> list[int]:
        """Random initial values of everything in a type."""
        if isinstance(kind, Array):
            return [value for _ in range(kind.count) for value in self.flat(kind.element)]
        if isinstance(kind, Int):
            return [self.value(kind)]
        members = kind.members[:1] if kind.union else kind.members
        found: list[int] = []
        for each in members:
            if each.width:
                assert isinstance(each.type, Int)
                found.append(Int("", each.width, each.type.signed).wrap(self.rng.getrandbits(each.width)))
            else:
                found += self.flat(each.type)
        return found

    def _watched(self) -> None:
        """Volatile variables of which every store is compared. Bit-fields fill their bytes."""
        for number in range(self.rng.choice((1, 1, 2))):
            kind: Int | Struct = self.rng.choice((U8, U8, S8, BOOL))
            if self.chance(0.35):
                widths = self.rng.choice(((3, 5), (1, 7), (4, 4), (1, 2, 5), (2, 6)))
                fields = [
                    Member(f"f{each}", S8 if self.chance(0.2) else U8, width)
                    for each, width in enumerate(widths)
                ]
                plain = Member("m9", self.rng.choice((U8, Array(U8, (2,)))))
                kind = Struct(f"W{number}", (*fields, plain))
                self.structs.append(kind)
            size = kind.offsets()[-1] if isinstance(kind, Struct) else 1
            if self.used + size > _RAM:
                return
            self.used += size
            self.top -= size
            self.globals.append(Variable(f"w{number}", kind, "global", where=f"watched @ 0x{self.top:02X}"))

    def _constant_pointers(self) -> None:
        """`T *const p`, perhaps to an object that nothing else names."""
        for number in range(self.rng.choice((1, 1, 2))):
            if self.chance(0.4):
                kind = self.stored()
                held = Array(kind, (2,)) if self.chance(0.5) else kind
                hidden = Variable(f"h{number}", held, "global", where="hidden")
                self.add(hidden)
                if hidden not in self.globals or kind.kind != "int":
                    continue
                limit = reachable(hidden, kind) if self.chance(0.5) else 0
                pointer = Variable(
                    f"z{number}", Pointer(kind, False, True), "global", AddressOf(hidden), (hidden,), limit
                )
            else:
                found = self.pointer(f"z{number}", "constant")
                if found is None:
                    continue
                pointer = found
            self.add(pointer)

    def _kept(self, variable: Variable) -> Variable:
        """Perhaps volatile, or at an address of its own below the checksum."""
        if self.chance(0.08):
            variable.where = "volatile"
        elif self.chance(0.06) and variable.type != BIT:
            self.top -= variable.type.size
            variable.where, variable.initial = f"@ 0x{self.top:02X}", variable.initial or (0,)
        return variable

    def named(self) -> list[Variable]:
        """The globals that functions may name."""
        return [each for each in self.globals if each.where != "hidden"]

    # functions

    def pointees(self, *, const: bool) -> dict[Int | Struct, tuple[Variable, ...]]:
        """The globals that a pointer may point to, by the type it points at."""
        found: dict[Int | Struct, list[Variable]] = {}
        for each in self.globals:
            if each.storage == "const" and not const:
                continue
            if each.watched is not None or each.where == "hidden" or each.storage == "never":
                continue
            kinds = {*self.types, *self.structs} - {BIT}
            for kind in sorted(kinds, key=repr):
                if reachable(each, kind):
                    found.setdefault(kind, []).append(each)
        return {kind: tuple(objects) for kind, objects in found.items()}

    def pointer(self, name: str, storage: str) -> Variable | None:
        const = self.chance(0.5)
        choices = self.pointees(const=const)
        if not choices:
            return None
        structs = [each for each in choices if isinstance(each, Struct)]
        kind = self.rng.choice(structs if structs and self.chance(0.4) else list(choices))
        if isinstance(kind, Int) and kind.kind != "int":
            return None
        pointees, limit = choices[kind], 0
        arrays = tuple(each for each in pointees if reachable(each, kind) > 1)
        if arrays and self.chance(0.4):
            pointees = arrays
            limit = min(reachable(each, kind) for each in arrays)
        if storage == "param":
            return Variable(name, Pointer(kind, const), storage, None, pointees, limit)
        scope, touch = self.scope, Touch()
        fixed = storage == "constant" or self.chance(0.15)
        if storage == "constant":
            self.scope = Scope([], [])  # nothing variable may be in its address
        target = self.rng.choice(pointees)
        initial = self.address(target, kind, touch, limit)
        self.scope = scope
        self.settle(touch)
        storage = "global" if storage == "constant" else storage
        return Variable(name, Pointer(kind, const, fixed), storage, initial, pointees, limit)

    def _function(self, number: int) -> None:
        rng = self.rng
        parameters: list[Variable] = []
        for each in range(rng.choice((0, 1, 1, 2, 2, 3))):
            kind = rng.random()
            found: Variable | None = None
            if kind < 0.2:
                found = self.pointer(f"q{each}", "param")
            elif kind < 0.25 and any(isinstance(one.type, Struct) for one in self.globals):
                struct = rng.choice([one.type for one in self.globals if isinstance(one.type, Struct)])
                found = Variable(f"q{each}", struct, "param")
            parameters.append(found or Variable(f"q{each}", self.type(), "param"))
        result: Int | Struct | None = self.type() if self.chance(0.75) else None
        whole = [each for each in (*self.globals, *parameters) if isinstance(each.type, Struct)]
        returns = rng.choice(whole) if whole and self.chance(0.2) else None
        if returns is not None:
            assert isinstance(returns.type, Struct)
            result = returns.type
        called = [each for each in self.functions if self.chance(0.6)]
        own = result if isinstance(result, Int) else None
        self.scope = Scope([*self.named(), *parameters], called, own)
        locals_ = self._locals(rng.choice((0, 1, 1, 2)))
        body = self.body(2, rng.randrange(1, 5))
        if returns is not None:
            self.settle(Touch({returns}))
        elif result:
            body = (*body, Return(self.full(2)))
        self._finish(f"f{number}", result, tuple(parameters), locals_, body)
        self.functions[-1].returns = returns

    def _finish(
        self,
        name: str,
        result: Int | Struct | None,
        parameters: tuple[Variable, ...],
        locals_: list[Variable],
        body: tuple[Stmt, ...],
    ) -> None:
        scope = self.scope
        outside = {*self.globals, BUS, CHECKSUM, *(each for each in scope.locals if each.storage == "static")}
        for function in scope.callable:
            outside |= function.reads | function.writes
        touched = scope.touched
        counters = [each for each in scope.locals if each not in locals_]
        self.functions.append(
            Function(
                name,
                result,
                parameters,
                (*locals_, *counters),
                body,
                frozenset(touched.reads & outside),
                frozenset(touched.writes & outside),
                scope.cost + 1,
            )
        )

    def _locals(self, count: int) -> list[Variable]:
        found: list[Variable] = []
        for number in range(count):
            made: Variable | None
            choice = self.rng.random()
            if choice < 0.25:
                made = self.pointer(f"p{number}", "local")
            elif choice < 0.4:
                kind = self.type()
                made = Variable(f"v{number}", kind, "static", (self.value(kind),) if kind != BIT else None)
            elif choice < 0.5:
                kind = self.stored()
                array = Array(kind, (self.rng.choice((2, 3, 4)),))
                made = Variable(
                    f"v{number}", array, "local", tuple(self.value(kind) for _ in range(array.count))
                )
            else:
                touch = Touch()
                initial: Expr = self.pure(1, touch)
                self.settle(touch)
                made = Variable(f"v{number}", self.type(), "local", initial)
            if made is not None and self.scope.local_bytes() + made.type.size <= 8:
                found.append(made)
                self.scope.locals.append(made)
                self.scope.visible.append(made)
        return found

    def _main(self) -> None:
        self.scope = Scope(self.named(), list(self.functions))
        locals_ = self._locals(self.rng.choice((0, 1, 2)))
        body: list[Stmt] = []
        for function in self.functions:
            body += self.body(1, 1)
            touch = Touch()
            call = self.call(1, touch, function)
            if call is not None:
                body.append(Out(call) if isinstance(function.result, Int) else ExprStmt(call))
        body += self.body(3, self.rng.randrange(2, 7))
        for variable in self.named():
            if variable.storage != "const" and not isinstance(variable.type, Pointer):
                body += self._shown(variable)
        self._finish("main", None, (), locals_, tuple(body))

    def _shown(self, variable: Variable) -> list[Stmt]:
        kind = variable.type
        if isinstance(kind, Int):
            return [Out(Var(variable))]
        if isinstance(kind, Struct):
            return [Out(each) for each in _members(Var(variable), kind)]
        assert isinstance(kind, Array)
        counters = []
        for size in kind.dims:
            counters.append(self.counter(size))
            self.scope.loops += 1
        self.scope.loops -= len(kind.dims)
        element = Element(Var(variable), tuple(Var(each) for each in counters))
        inner: tuple[Stmt, ...] = (Out(element),)
        if isinstance(kind.element, Struct):
            inner = tuple(Out(each) for each in _members(element, kind.element))
        for counter, size in reversed(list(zip(counters, kind.dims, strict=True))):
            inner = (Loop("up", counter, size, inner),)
        return list(inner)


def _members(base: Var | Element, kind: Struct) -> list[Expr]:
    found: list[Expr] = []
    for member in kind.members:
        place = MemberOf(base, member)
        if isinstance(member.type, Array):
            found += [Element(place, (Num(index),)) for index in range(member.type.count)]
        else:
            found.append(place)
    return found


def generate(seed: int, dialect: str) -> Program:
    """The program of a seed."""
    return Generator(seed, dialect).program()
