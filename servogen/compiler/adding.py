"""Addition and subtraction of operands of one to four bytes, byte by byte, low byte first.

In: target bytes and operand bytes of the same number. Out: instructions. A target may be the left operand
itself (then the operation happens in place); where it overlaps otherwise the caller has put a copy between.

The middle bytes of an addition use INCFSZ on the operand with the carry: when operand + carry is 256 the byte
stays as it is and the carry stays set, so that skipping the ADDWF is exactly right.
"""

from __future__ import annotations

from servogen.compiler.emitter import Emitter
from servogen.compiler.machine import C, Imm, Loc, Operand, Z, exposed


def const(operands: list[Operand]) -> int | None:
    """The value of operands that are all known constants."""
    total = 0
    for number, each in enumerate(operands):
        if not isinstance(each, Imm) or not isinstance(each.value, int):
            return None
        total |= each.value << 8 * number
    return total


def imms(value: int, size: int) -> list[Operand]:
    return [Imm(value >> 8 * each & 0xFF) for each in range(size)]


class Adding(Emitter):
    """Adds sums, differences and negation."""

    def result(self, target: Loc, left: Operand) -> int:
        """The destination bit: in place when the target is the left operand."""
        return int(target == left)

    def finish(self, target: Loc, left: Operand) -> None:
        if target != left:
            self.store(target)

    def add(self, target: list[Loc], left: list[Operand], right: list[Operand]) -> None:
        if isinstance(left[0], Imm) or (target == right and target != left):
            left, right = right, left
        constant = const(right)
        if constant is not None and const(left) is None:
            self._add_constant(target, left, constant)
            return
        size = len(target)
        for number, (t, a, b) in enumerate(zip(target, left, right, strict=True)):
            last = number == size - 1
            if number == 0:
                self._add_first(t, a, b)
            elif last and isinstance(b, Imm):
                self._carry_last(t, a, b)
            elif isinstance(b, Imm) or isinstance(a, Imm):
                self._carry_middle_imm(t, a, b)
            elif t == a:
                b = self._load_twice(b)
                self.skip_if(C, False)
                self.emit("INCFSZ", b, 0)
                self.emit("ADDWF", a, 1)
            elif last:
                self.load(a)
                self.skip_if(C, False)
                self.emit("ADDLW", k=1)
                self.emit("ADDWF", b, self.result(t, b))
                self.finish(t, b)
            elif t == b:
                a = self._load_twice(a)
                self.skip_if(C, False)
                self.emit("INCFSZ", a, 0)
                self.emit("ADDWF", b, 1)
            else:
                self.move(t, a)
                b = self._load_twice(b)
                self.skip_if(C, False)
                self.emit("INCFSZ", b, 0)
                self.emit("ADDWF", t, 1)

    def _load_twice(self, operand: Operand) -> Loc:
        """W = a byte of memory; return where it can be read again."""
        operand = self.steady(operand)
        assert not isinstance(operand, Imm)
        self.load(operand)
        return operand

    def _add_first(self, t: Loc, a: Operand, b: Operand) -> None:
        if isinstance(a, Imm):
            a, b = b, a
        self.load(b)
        if isinstance(a, Imm):
            self.emit("ADDLW", k=a.value)
            self.store(t)
            return
        self.emit("ADDWF", a, self.result(t, a))
        self.finish(t, a)

    def _carry_last(self, t: Loc, a: Operand, b: Imm) -> None:
        """The top byte plus a constant plus the carry."""
        if isinstance(a, Imm):
            self.load(a)
            self.skip_if(C, False)
            self.emit("ADDLW", k=1)
            if b != Imm(0):
                self.emit("ADDLW", k=b.value)
            self.store(t)
        elif b == Imm(0) and t == a:
            self.skip_if(C, False)
            self.emit("INCF", a, 1)
        elif b == Imm(0xFF) and t == a:
            self.skip_if(C, True)
            self.emit("DECF", a, 1)
        elif isinstance(b.value, int):
            self.emit("MOVLW", k=b.value)
            self.skip_if(C, False)
            self.emit("MOVLW", k=b.value + 1)
            self.emit("ADDWF", a, self.result(t, a))
            self.finish(t, a)
        else:
            self.load(a)
            self.skip_if(C, False)
            self.emit("ADDLW", k=1)
            self.emit("ADDLW", k=b.value)
            self.store(t)

    def _carry_middle_imm(self, t: Loc, a: Operand, b: Operand) -> None:
        """A middle byte where one operand is a constant: the target first becomes the other."""
        if isinstance(a, Imm):
            a, b = b, a
        if isinstance(a, Imm):
            held = self.temp()[0]
            self.move(held, a)
            a = held
        assert isinstance(b, Imm)
        self.move(t, a)
        if b == Imm(0xFF):
            self.emit("MOVLW", k=0xFF)
            self.skip_if(C, True)
            self.emit("ADDWF", t, 1)
        elif b == Imm(0):
            self.emit("MOVLW", k=1)
            self.skip_if(C, False)
            self.emit("ADDWF", t, 1)
        elif isinstance(b.value, int):
            self.emit("MOVLW", k=b.value)
            self.skip_if(C, False)
            self.emit("MOVLW", k=b.value + 1)
            self.emit("ADDWF", t, 1)
        else:
            held = self.temp()[0]
            self.move(held, b)
            self.load(held)
            self.skip_if(C, False)
            self.emit("INCFSZ", held, 0)
            self.emit("ADDWF", t, 1)

    def _add_constant(self, target: list[Loc], left: list[Operand], value: int) -> None:
        size = len(target)
        mask = (1 << 8 * size) - 1
        value &= mask
        start = 0
        while start < size and not value >> 8 * start & 0xFF:
            self.move(target[start], left[start])
            start += 1
        if start == size:
            return
        t, a = target[start:], left[start:]
        value >>= 8 * start
        ones = (1 << 8 * len(t)) - 1
        if value == 1 and t == a:
            self._count_up(t)
            return
        if value == ones and t == a:
            self._count_down(t)
            return
        bytes_ = imms(value, len(t))
        low = value & 0xFF
        if len(t) == 1 and not isinstance(a[0], Imm) and low in (1, 0xFF):
            op = "INCF" if low == 1 else "DECF"
            self.emit(op, a[0], self.result(t[0], a[0]))
            self.finish(t[0], a[0])
            return
        for number in range(len(t)):
            if number == 0:
                self._add_first(t[0], a[0], bytes_[0])
            elif number == len(t) - 1:
                self._carry_last(t[number], a[number], bytes_[number])  # type: ignore[arg-type]
            else:
                self._carry_middle_imm(t[number], a[number], bytes_[number])

    def _count_up(self, t: list[Loc]) -> None:
        for number, each in enumerate(t):
            if number:
                self.skip_if(Z, False)
            self.emit("INCF", each, 1)

    def _count_down(self, t: list[Loc]) -> None:
        if len(t) == 1:
            self.emit("DECF", t[0], 1)
            return
        if len(t) == 2 and not exposed(t[0]):
            self.emit("MOVF", t[0], 1)
            self.skip_if(Z, False)
            self.emit("DECF", t[1], 1)
            self.emit("DECF", t[0], 1)
            return
        self.emit("MOVLW", k=1)
        self.emit("SUBWF", t[0], 1)
        for each in t[1:-1]:
            self.skip_if(C, True)
            self.emit("SUBWF", each, 1)
        self.skip_if(C, True)
        self.emit("DECF", t[-1], 1)

    def subtract(self, target: list[Loc], left: list[Operand], right: list[Operand]) -> None:
        constant = const(right)
        size = len(target)
        if constant is not None and const(left) is None:
            self._add_constant(target, left, -constant)
            return
        if target == right and size > 2:
            held: list[Loc] = self.temp(size)
            self.subtract(held, left, right)
            self.move_all(target, list(held))
            return
        for number, (t, a, b) in enumerate(zip(target, left, right, strict=True)):
            last = number == size - 1
            if number == 0 or (last and t != a) or (last and isinstance(b, Imm)):
                self.load(b)
                if number:
                    self.skip_if(C, True)
                    self.emit("ADDLW", k=1)
                if isinstance(a, Imm):
                    self.emit("SUBLW", k=a.value)
                    self.store(t)
                else:
                    self.emit("SUBWF", a, self.result(t, a))
                    self.finish(t, a)
                continue
            if isinstance(b, Imm):
                held_b = self.temp()[0]
                self.move(held_b, b)
                b = held_b
            self.move(t, a)
            b = self._load_twice(b)
            self.skip_if(C, True)
            self.emit("INCFSZ", b, 0)
            self.emit("SUBWF", t, 1)

    def negate(self, target: list[Loc], operand: list[Operand]) -> None:
        if len(target) == 1:
            if target == operand:
                self.emit("COMF", target[0], 1)
                self.emit("INCF", target[0], 1)
            else:
                self.load(operand[0])
                self.emit("SUBLW", k=0)
                self.store(target[0])
            return
        self.complement(target, operand)
        self._count_up(target)

    def complement(self, target: list[Loc], operand: list[Operand]) -> None:
        for t, a in zip(target, operand, strict=True):
            if isinstance(a, Imm):
                self.emit("MOVLW", k=a.value)
                self.emit("XORLW", k=0xFF)
                self.store(t)
            else:
                self.emit("COMF", a, self.result(t, a))
                self.finish(t, a)
