"""Random statements: loops that end, jumps that stay inside, every form of C's control flow.

In: a `Scope`. Out: statements. Loops count with variables that nothing else writes, so every program ends.
"""

from __future__ import annotations

from tests.compiler.random.expressions import Expressions, base_of, reachable
from tests.compiler.random.program import (
    S16,
    U8,
    U16,
    Again,
    Binary,
    Block,
    Case,
    CopyStruct,
    Expr,
    ExprStmt,
    Hang,
    If,
    Int,
    Jump,
    Leave,
    Loop,
    Num,
    Out,
    Point,
    Pointer,
    Return,
    SetBit,
    Skip,
    Stmt,
    Struct,
    Switch,
    Var,
    Variable,
    Walk,
)
from tests.compiler.random.scope import reaches, writable
from tests.compiler.random.touch import CHECKSUM, Touch
from tests.compiler.random.typing_rules import promote, type_of

_WEIGHTS = {
    "assign": 5.0, "update": 3.0, "step": 1.5, "out": 1.5, "call": 1.2, "if": 3.0, "loop": 1.5, "walk": 0.7,
    "switch": 0.9, "skip": 0.4, "again": 0.25, "block": 0.5, "point": 0.6, "copy": 0.4, "bits": 0.7,
    "jump": 0.8, "leave": 0.5, "return": 0.25, "expr": 0.2, "hang": 1.5,
}  # fmt: skip
NEVER = "never"
"""The variable that stays 0."""
_COMPOUND = ("if", "loop", "walk", "switch", "skip", "again", "block")
_COUNTERS = ((U8, "i"), (U8, "i"), (U8, "i"), (U16, "n"), (S16, "k"))


class Statements(Expressions):
    """Makes statements."""

    def body(self, depth: int, count: int) -> tuple[Stmt, ...]:
        found: list[Stmt] = []
        for _ in range(count):
            made = self.statement(depth)
            if made is not None:
                found.append(made)
        return tuple(found)

    def statement(self, depth: int) -> Stmt | None:
        weights = dict(_WEIGHTS) if depth > 0 else {k: v for k, v in _WEIGHTS.items() if k not in _COMPOUND}
        self.scope.cost += self.scope.rounds
        self.scope.made += 1
        if self.scope.made > 40:
            return None
        kind = self.pick(weights)
        made: Stmt | None = getattr(self, f"_{kind}")(depth)
        return made

    def settle(self, touch: Touch) -> None:
        """A full expression is made: what it touched counts for the function."""
        self.scope.touched.add(touch)

    def full(self, depth: int) -> Expr:
        touch = Touch()
        found = self.expr(depth, touch)
        self.settle(touch)
        return found

    def test(self, depth: int) -> Expr:
        touch = Touch()
        found = self.condition(depth, touch, self.expr)
        self.settle(touch)
        return found

    def changed(self, kind: str) -> Stmt | None:
        touch = Touch()
        found = self.change(kind, self.rng.choice((1, 2, 2, 3)), touch)
        self.settle(touch)
        return ExprStmt(found) if found is not None else None

    # simple statements

    def _assign(self, depth: int) -> Stmt | None:
        return self.changed("assign")

    def _update(self, depth: int) -> Stmt | None:
        return self.changed("update")

    def _step(self, depth: int) -> Stmt | None:
        return self.changed("step")

    def _expr(self, depth: int) -> Stmt | None:
        return ExprStmt(self.full(2))

    def _out(self, depth: int) -> Stmt | None:
        found = Out(self.full(self.rng.choice((0, 1, 2))))
        self.scope.touched.writes.add(CHECKSUM)
        return found

    def _call(self, depth: int) -> Stmt | None:
        touch = Touch()
        if not self.scope.callable:
            return None
        found = self.call(1, touch, self.rng.choice(self.scope.callable))
        self.settle(touch)
        return ExprStmt(found) if found is not None else None

    def _point(self, depth: int) -> Stmt | None:
        pointers = self.scope.pointers(const=self.chance(0.5))
        if not pointers:
            return None
        pointer = self.rng.choice(pointers)
        assert isinstance(pointer.type, Pointer)
        touch = Touch()
        to = self.address(self.rng.choice(pointer.pointees), pointer.type.target, touch)
        self.settle(touch)
        return Point(pointer, to)

    def _copy(self, depth: int) -> Stmt | None:
        found = [each for each in self.scope.visible if isinstance(each.type, Struct)]
        if not found:
            return None
        targets = [each for each in found if writable(each)]
        if not targets:
            return None
        target = self.rng.choice(targets)
        makers = [each for each in self.scope.callable if each.result == target.type]
        if makers and self.chance(0.6):
            touch = Touch()
            made = self.call(1, touch, self.rng.choice(makers))
            touch.writes |= set(reaches(target))
            self.settle(touch)
            if made is not None:
                return CopyStruct(Var(target), made)
        source = self.rng.choice([each for each in found if each.type == target.type])
        self.scope.touched.add(Touch({source}, set(reaches(target))))
        return CopyStruct(Var(target), Var(source))

    def _bits(self, depth: int) -> Stmt | None:
        found = [
            each
            for each in self.scope.visible
            if isinstance(each.type, Int)
            and each.type.kind == "int"
            and each.storage not in ("const", "counter", "never")
        ]
        if not found:
            return None
        target = self.rng.choice(found)
        assert isinstance(target.type, Int)
        self.scope.touched.add(Touch({target}, set(reaches(target))))
        return SetBit(
            self.rng.choice(("set", "clear", "toggle")), Var(target), self.rng.randrange(target.type.bits)
        )

    def _hang(self, depth: int) -> Stmt | None:
        never = [each for each in self.scope.visible if each.storage == "never"]
        if not never:
            return None
        forms = ("while", "for", "do", "self", "jump", "call")
        body = self.body(0, 1) if self.chance(0.4) else ()
        self.scope.touched.reads.add(never[0])
        form = self.rng.choice(forms)
        return Hang(never[0], form, self.label(), () if form == "call" else body)

    def _jump(self, depth: int) -> Stmt | None:
        kinds = ["break"] * (self.scope.breakable > 0) + ["continue"] * (self.scope.continuable > 0)
        return If(self.test(1), (Jump(self.rng.choice(kinds)),)) if kinds else None

    def _leave(self, depth: int) -> Stmt | None:
        return If(self.test(1), (Leave(self.rng.choice(self.scope.labels)),)) if self.scope.labels else None

    def _return(self, depth: int) -> Stmt | None:
        if self.scope.result is None:
            return None
        return If(self.test(1), (Return(self.full(1)),))

    # compound statements

    def _if(self, depth: int) -> Stmt | None:
        condition = self.test(2)
        yes = self.body(depth - 1, self.rng.choice((1, 1, 2)))
        no = self.body(depth - 1, self.rng.choice((1, 1, 2))) if self.chance(0.4) else ()
        return If(condition, yes, no)

    def counter(self, limit: int) -> Variable:
        """A counter of its own; those of one name share a variable, for they are never alive together."""
        kind, letter = self.rng.choice(_COUNTERS)
        name = f"{letter}{self.scope.loops}"
        if all(each.name != name for each in self.scope.locals):
            self.scope.locals.append(Variable(name, kind, "local", (0,)))
        return Variable(name, kind, "counter", limit=limit)

    def repeated(
        self, counter: Variable, rounds: int, depth: int, count: int, *, loop: bool = True
    ) -> tuple[Stmt, ...]:
        """A body that runs `rounds` times, with its counter in sight."""
        scope = self.scope
        scope.visible.append(counter)
        scope.loops += 1
        scope.breakable += loop
        scope.continuable += loop
        scope.rounds *= rounds
        found = self.body(depth, count)
        scope.rounds //= rounds
        scope.continuable -= loop
        scope.breakable -= loop
        scope.loops -= 1
        scope.visible.remove(counter)
        return found

    def rounds(self) -> int:
        return self.rng.randrange(1, 9) if self.scope.loops == 0 else self.rng.randrange(1, 5)

    def _loop(self, depth: int) -> Stmt | None:
        if self.scope.loops >= 2:
            return None
        form = self.pick({"up": 4, "down": 1.5, "while": 1.5, "countdown": 1.5, "do": 1.5})
        rounds = self.rounds()
        condition = self.test(1) if self.chance(0.3) else None
        counter = self.counter(rounds if form in ("up", "countdown") else rounds + 1)
        return Loop(
            form,
            counter,
            rounds,
            self.repeated(counter, rounds, depth - 1, self.rng.choice((1, 2, 3))),
            condition,
        )

    def _again(self, depth: int) -> Stmt | None:
        if self.scope.loops >= 2:
            return None
        rounds = self.rounds()
        counter = self.counter(rounds + 1)
        body = self.repeated(counter, rounds, depth - 1, self.rng.choice((1, 2)), loop=False)
        return Again(self.label(), counter, rounds, body)

    def _walk(self, depth: int) -> Stmt | None:
        if self.scope.loops >= 2:
            return None
        const = self.chance(0.5)
        choices = [
            (pointer, array, reachable(array, pointer.type.target))
            for pointer in self.scope.pointers(const=const)
            for array in pointer.pointees
            if isinstance(pointer.type, Pointer) and reachable(array, pointer.type.target) > 1
        ]
        if not choices:
            return None
        pointer, array, count = self.rng.choice(choices)
        assert isinstance(pointer.type, Pointer)
        touch = Touch()
        start = self.address(array, pointer.type.target, touch, count)
        self.settle(touch)
        counter = self.counter(count)
        self.scope.locked.add(pointer)
        value = target = None
        whole = isinstance(pointer.type.target, Int)
        if whole and self.chance(0.3) and not const:
            touch = Touch(set(), {pointer, *pointer.pointees})
            value = self.pure(2, touch)
            self.settle(touch)
        elif whole and self.chance(0.3):
            touch = Touch({pointer, *pointer.pointees}, {pointer})
            target = self.place(touch, 0, write=True)
            touch.writes |= set(reaches(base_of(target))) if target is not None else set()
            self.settle(touch)
        body = self.repeated(counter, count, depth - 1, self.rng.choice((1, 1, 2)))
        self.settle(Touch(set(pointer.pointees), set() if const else set(pointer.pointees)))
        self.scope.locked.discard(pointer)
        step = self.rng.choice(("{}++", "{}++", "++{}", "{} += 1", "{0} = {0} + 1"))
        return Walk(pointer, start, count, counter, body, value, target, step)

    def _switch(self, depth: int) -> Stmt | None:
        if self.scope.breakable > 2:
            return None
        value = self.full(2)
        if self.chance(0.6):
            value = _reduced(value, self.rng.choice((1, 3, 7)))
        pool = list(range(9)) + [self.rng.choice((15, 65, 127, 128, 200, 255)) for _ in range(2)]
        if self.chance(0.2):
            pool += [self.rng.choice((256, 300, 1000, 0x7FFF)) for _ in range(2)]
        if promote(type_of(value, self.dialect), self.dialect).signed and self.chance(0.3):
            pool += [-1, -2, -128, -32768]
        pool = sorted(set(pool))
        self.rng.shuffle(pool)
        cases: list[Case] = []
        count = self.rng.randrange(1, 6)
        default = self.rng.randrange(count + 2)
        self.scope.breakable += 1
        for number in range(count):
            values = tuple(pool.pop() for _ in range(self.rng.choice((1, 1, 1, 2))) if pool)
            body = self.body(depth - 1, self.rng.choice((1, 1, 2)))
            cases.append(Case(values, body, number == default, self.chance(0.3) and number < count - 1))
        self.scope.breakable -= 1
        return Switch(value, tuple(cases))

    def label(self) -> str:
        self.label_count = getattr(self, "label_count", 0) + 1
        return f"L{self.label_count}"

    def _skip(self, depth: int) -> Stmt | None:
        condition, label = self.test(1), self.label()
        self.scope.labels.append(label)
        body = self.body(depth - 1, self.rng.choice((1, 2, 3)))
        self.scope.labels.remove(label)
        return Skip(condition, label, body)

    def _block(self, depth: int) -> Stmt | None:
        if self.scope.has_block or self.scope.local_bytes() > 6:
            return None
        self.scope.has_block = True
        variables = []
        for number in range(self.rng.choice((1, 2))):
            name = f"b{number}"
            variables.append(Variable(name, self.type(), "local", self.full(1)))
        self.scope.visible += variables
        body = self.body(depth - 1, self.rng.choice((1, 2, 3)))
        for each in variables:
            self.scope.visible.remove(each)
        return Block(tuple(variables), body)


def _reduced(value: Expr, most: int) -> Expr:
    return Binary("&", value, Num(most))
