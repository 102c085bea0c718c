"""Arithmetic on operands of one to four bytes, byte by byte, low byte first.

In: target bytes and operand bytes of the same number. Out: instructions. A target may be the left operand
itself (then the operation happens in place); where it overlaps otherwise the caller has put a copy in
between.

The middle bytes of an addition use INCFSZ on the operand with the carry: when operand + carry is 256 the
byte stays as it is and the carry stays set, so that skipping the ADDWF is exactly right.
"""

from __future__ import annotations

from servogen.compiler.emitter import Emitter
from servogen.compiler.machine import STATUS, C, Imm, Loc, Operand, Z


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


class Arithmetic(Emitter):
    """Adds byte-wise operations."""

    def result(self, target: Loc, left: Operand) -> int:
        """The destination bit: in place when the target is the left operand."""
        return int(target == left)

    def finish(self, target: Loc, left: Operand) -> None:
        if target != left:
            self.store(target)

    # addition and subtraction

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
                self.load(b)
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
                self.load(a)
                self.skip_if(C, False)
                self.emit("INCFSZ", a, 0)
                self.emit("ADDWF", b, 1)
            else:
                self.move(t, a)
                self.load(b)
                self.skip_if(C, False)
                self.emit("INCFSZ", b, 0)
                self.emit("ADDWF", t, 1)

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
        if len(t) == 2:
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
            self.load(b)
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

    # bitwise

    def bitwise(self, op: str, target: list[Loc], left: list[Operand], right: list[Operand]) -> None:
        for t, a, b in zip(target, left, right, strict=True):
            if isinstance(a, Imm) or (t == b and t != a):
                a, b = b, a
            self._bitwise_byte(op, t, a, b)

    def _bitwise_byte(self, op: str, t: Loc, a: Operand, b: Operand) -> None:
        value = b.value if isinstance(b, Imm) and isinstance(b.value, int) else None
        mnemonic = {"&": "AND", "|": "IOR", "^": "XOR"}[op]
        if value is not None and not isinstance(a, Imm):
            if (op, value) in (("&", 0xFF), ("|", 0), ("^", 0)):
                self.move(t, a)
                return
            if (op, value) in (("&", 0), ("|", 0xFF)):
                self.move(t, Imm(value))
                return
            if (op, value) == ("^", 0xFF):
                self.emit("COMF", a, self.result(t, a))
                self.finish(t, a)
                return
            if t == a and op == "|" and value.bit_count() == 1:
                self.emit("BSF", t, b=value.bit_length() - 1)
                return
            if t == a and op == "&" and (value ^ 0xFF).bit_count() == 1:
                self.emit("BCF", t, b=(value ^ 0xFF).bit_length() - 1)
                return
        self.load(b)
        if isinstance(a, Imm):
            self.emit(mnemonic + "LW", k=a.value)
            self.store(t)
        elif isinstance(b, Imm) and t != a:
            self.code.ins.pop()
            self.load(a)
            self.emit(mnemonic + "LW", k=b.value)
            self.store(t)
        else:
            self.emit(mnemonic + "WF", a, self.result(t, a))
            self.finish(t, a)

    # shifts by constants

    def shift_left(self, target: list[Loc], operand: list[Operand], count: int) -> None:
        size = len(target)
        whole, rest = divmod(count, 8)
        if whole >= size:
            self.move_all(target, imms(0, size))
            return
        sources: list[Operand] = [*imms(0, whole), *operand[: size - whole]]
        live = target[whole:]
        if len(live) == 1 and rest:
            self._shift_byte_left(live[0], sources[whole], rest)
            self.move_all(target[:whole], imms(0, whole))
            return
        if rest == 1 and not whole and not any(isinstance(each, Imm) for each in operand):
            self.emit("BCF", STATUS, b=C)
            for t, a in zip(target, operand, strict=True):
                assert not isinstance(a, Imm)
                self.emit("RLF", a, self.result(t, a))
                self.finish(t, a)
            return
        self.move_all(target, sources)
        for _ in range(rest):
            self.emit("BCF", STATUS, b=C)
            for each in live:
                self.emit("RLF", each, 1)

    def _shift_byte_left(self, t: Loc, a: Operand, count: int) -> None:
        if isinstance(a, Imm):
            held = self.temp()[0]
            self.move(held, a)
            a = held
        if count == 7:
            self.emit("RRF", a, 0)
            self.emit("CLRF", t)
            self.emit("RRF", t, 1)
        elif count >= 4:
            self.emit("SWAPF", a, 0)
            self.emit("ANDLW", k=0xF0)
            self.store(t)
            self._repeat("RLF", t, count - 4)
        elif count == 1:
            self.emit("BCF", STATUS, b=C)
            self.emit("RLF", a, self.result(t, a))
            self.finish(t, a)
        else:
            self.move(t, a)
            self._repeat("RLF", t, count)

    def _repeat(self, op: str, t: Loc, count: int) -> None:
        for _ in range(count):
            self.emit("BCF", STATUS, b=C)
            self.emit(op, t, 1)

    def shift_right(self, target: list[Loc], operand: list[Operand], count: int, *, signed: bool) -> None:
        size = len(target)
        count = min(count, 8 * size - 1) if signed else count
        whole, rest = divmod(count, 8)
        if whole >= size:
            self.move_all(target, imms(0, size))
            return
        live = size - whole
        if signed and whole:
            sign = self.sign_byte(operand[-1])
            self.move_all(target, [*operand[whole:], *[sign] * whole])
        elif live == 1 and rest and not signed:
            self._shift_byte_right(target[0], operand[whole], rest)
            self.move_all(target[1:], imms(0, size - 1))
            return
        elif rest == 1 and not whole and not signed and not any(isinstance(each, Imm) for each in operand):
            self.emit("BCF", STATUS, b=C)
            for t, a in zip(reversed(target), reversed(operand), strict=True):
                assert not isinstance(a, Imm)
                self.emit("RRF", a, self.result(t, a))
                self.finish(t, a)
            return
        else:
            self.move_all(target, [*operand[whole:], *imms(0, whole)])
        for _ in range(rest):
            self.one_right(target[:live], signed=signed)

    def _shift_byte_right(self, t: Loc, a: Operand, count: int) -> None:
        if isinstance(a, Imm):
            held = self.temp()[0]
            self.move(held, a)
            a = held
        if count == 7:
            self.emit("RLF", a, 0)
            self.emit("CLRF", t)
            self.emit("RLF", t, 1)
        elif count >= 4:
            self.emit("SWAPF", a, 0)
            self.emit("ANDLW", k=0x0F)
            self.store(t)
            self._repeat("RRF", t, count - 4)
        elif count == 1:
            self.emit("BCF", STATUS, b=C)
            self.emit("RRF", a, self.result(t, a))
            self.finish(t, a)
        else:
            self.move(t, a)
            self._repeat("RRF", t, count)

    def one_right(self, target: list[Loc], *, signed: bool) -> None:
        if signed:
            self.emit("RLF", target[-1], 0)  # the sign into C
        else:
            self.emit("BCF", STATUS, b=C)
        for each in reversed(target):
            self.emit("RRF", each, 1)

    def one_left(self, target: list[Loc]) -> None:
        self.emit("BCF", STATUS, b=C)
        for each in target:
            self.emit("RLF", each, 1)

    def sign_byte(self, top: Operand) -> Operand:
        """0x00 or 0xFF by the sign of a byte."""
        if isinstance(top, Imm):
            return Imm(0xFF if isinstance(top.value, int) and top.value & 0x80 else 0)
        held = self.temp()[0]
        self.emit("CLRF", held)
        self.skip_if(7, False, top)
        self.emit("COMF", held, 1)
        return held

    # comparisons: the flag that says so, and the value it has when true

    def compare_less(self, left: list[Operand], right: list[Operand]) -> None:
        """C = not (left < right), unsigned."""
        constant = const(right)
        start = 0
        if constant is not None:
            while start < len(right) - 1 and right[start] == Imm(0):
                start += 1
        for number in range(start, len(left)):
            a, b = left[number], right[number]
            first = number == start
            if first:
                self.load(b)
            elif isinstance(b, Imm) and isinstance(b.value, int) and not isinstance(a, Imm):
                self.emit("MOVLW", k=b.value)
                if b.value == 0xFF:
                    self.skip_if(C, False)
                    self.emit("SUBWF", a, 0)
                    continue
                self.skip_if(C, True)
                self.emit("MOVLW", k=b.value + 1)
            else:
                if isinstance(b, Imm):
                    held = self.temp()[0]
                    self.move(held, b)
                    b = held
                self.load(b)
                self.skip_if(C, True)
                self.emit("INCFSZ", b, 0)
            if isinstance(a, Imm):
                self.emit("SUBLW", k=a.value)
            else:
                self.emit("SUBWF", a, 0)

    def biased(self, operands: list[Operand]) -> list[Operand]:
        """Operands whose unsigned order is the signed order: the top bit turned over."""
        top = operands[-1]
        if isinstance(top, Imm) and isinstance(top.value, int):
            return [*operands[:-1], Imm(top.value ^ 0x80)]
        held = self.temp()[0]
        self.load(top)
        self.emit("XORLW", k=0x80)
        self.store(held)
        return [*operands[:-1], held]
