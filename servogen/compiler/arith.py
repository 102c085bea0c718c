"""Bitwise operations, shifts by constants and comparisons, byte by byte.

In: target bytes and operand bytes of the same number. Out: instructions; of a comparison, the carry.
"""

from __future__ import annotations

from servogen.compiler.adding import Adding, const, imms
from servogen.compiler.machine import STATUS, C, Imm, Loc, Operand


class Arithmetic(Adding):
    """Adds bitwise operations, shifts and comparisons."""

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
                self.read_unused([a])
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

    def shift_left(self, target: list[Loc], operand: list[Operand], count: int) -> None:
        size = len(target)
        whole, rest = divmod(count, 8)
        self.read_unused(operand[max(0, size - whole) :])
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
        self.read_unused(operand[:whole])
        if whole >= size:
            self.move_all(target, imms(0, size))
            return
        live = size - whole
        if signed and whole:
            operand = [*operand[:-1], self.steady(operand[-1])]
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
                b = self._load_twice(b)
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
