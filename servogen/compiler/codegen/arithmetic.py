"""Arithmetic on operands of one to four bytes, low byte first: sums, bitwise operations, shifts by constants,
comparisons.

In: target bytes and the same number of operand bytes. Out: instructions; for a comparison, the result in the
carry. A target may be the left operand itself, in which case the operation is done in place; if it overlaps
in any other way, the caller has inserted a copy.

The middle bytes of an addition apply INCFSZ to the operand plus carry: if that sum is 256, the target byte
must stay unchanged and the carry stay set, which is exactly what skipping the ADDWF does.
"""

from __future__ import annotations

from collections.abc import Sequence

from servogen.compiler.ir.builder import InstructionBuilder
from servogen.compiler.ir.instruction import STATUS, C, Imm, Loc, Operand, Z, exposed

WITH_FILE = {"+": "ADDWF", "-": "SUBWF", "&": "ANDWF", "|": "IORWF", "^": "XORWF"}
"""The instruction that combines W with a byte of memory, by operator; SUBWF subtracts W from the byte."""


def const(operands: list[Operand]) -> int | None:
    """Return the value of the operands if they are all known constants, else None."""
    total = 0
    for number, operand in enumerate(operands):
        if not isinstance(operand, Imm) or not isinstance(operand.value, int):
            return None
        total |= operand.value << 8 * number
    return total


def imms(value: int, size: int) -> list[Operand]:
    """Return a number as constant operand bytes, low byte first."""
    return [Imm(value >> 8 * index & 0xFF) for index in range(size)]


def destination_bit(target: Loc, left: Operand) -> int:
    """Return the destination bit: in place if the target is the left operand, otherwise W."""
    return int(target == left)


def store_result(gen: InstructionBuilder, target: Loc, left: Operand) -> None:
    """Store W, unless the instruction before has left the result in the target itself."""
    if target != left:
        gen.store(target)


def add(gen: InstructionBuilder, target: list[Loc], left: list[Operand], right: list[Operand]) -> None:
    """Emit target = left + right."""
    # a sum commutes: the constant, or the operand that is not the target, goes on the right
    if isinstance(left[0], Imm) or (target == right and target != left):
        left, right = right, left
    constant = const(right)
    if constant is not None and const(left) is None:
        _add_constant(gen, target, left, constant)
        return
    size = len(target)
    for number, (t, a, b) in enumerate(zip(target, left, right, strict=True)):
        last = number == size - 1
        if number == 0:
            _add_first(gen, t, a, b)
        # no carry out of the top byte is needed, so that the operand plus carry may wrap
        elif last and isinstance(b, Imm):
            _carry_last(gen, t, a, b)
        elif isinstance(b, Imm) or isinstance(a, Imm):
            _carry_middle_imm(gen, t, a, b)
        elif t == a:
            # b plus carry of 256 adds nothing and carries again: skipping ADDWF keeps the byte and C as they
            # are
            b = load_twice(gen, b)
            gen.skip_if(C, False)
            gen.emit("INCFSZ", b, 0)
            gen.emit("ADDWF", a, 1)
        elif last:
            gen.load(a)
            gen.skip_if(C, False)
            gen.emit("ADDLW", k=1)
            gen.emit("ADDWF", b, destination_bit(t, b))
            store_result(gen, t, b)
        elif t == b:
            a = load_twice(gen, a)
            gen.skip_if(C, False)
            gen.emit("INCFSZ", a, 0)
            gen.emit("ADDWF", b, 1)
        else:
            gen.move(t, a)
            b = load_twice(gen, b)
            gen.skip_if(C, False)
            gen.emit("INCFSZ", b, 0)
            gen.emit("ADDWF", t, 1)


def load_twice(gen: InstructionBuilder, operand: Operand) -> Loc:
    """Load a byte of memory into W and return a location from which it can be read again."""
    operand = gen.steady(operand)
    assert not isinstance(operand, Imm)
    gen.load(operand)
    return operand


def _add_first(gen: InstructionBuilder, t: Loc, a: Operand, b: Operand) -> None:
    """Add the lowest bytes, with no carry in."""
    if isinstance(a, Imm):
        a, b = b, a
    gen.load(b)
    if isinstance(a, Imm):
        gen.emit("ADDLW", k=a.value)
        gen.store(t)
        return
    gen.emit("ADDWF", a, destination_bit(t, a))
    store_result(gen, t, a)


def _carry_last(gen: InstructionBuilder, t: Loc, a: Operand, b: Imm) -> None:
    """Add a constant and the carry to the top byte."""
    if isinstance(a, Imm):
        gen.load(a)
        gen.skip_if(C, False)
        gen.emit("ADDLW", k=1)
        if b != Imm(0):
            gen.emit("ADDLW", k=b.value)
        gen.store(t)
    elif b == Imm(0) and t == a:
        gen.skip_if(C, False)
        gen.emit("INCF", a, 1)
    # 255 and a carry add 0 to a byte, 255 alone subtracts 1
    elif b == Imm(0xFF) and t == a:
        gen.skip_if(C, True)
        gen.emit("DECF", a, 1)
    elif isinstance(b.value, int):
        # MOVLW leaves C alone: the skip chooses between the constant and the constant plus carry
        gen.emit("MOVLW", k=b.value)
        gen.skip_if(C, False)
        gen.emit("MOVLW", k=b.value + 1)
        gen.emit("ADDWF", a, destination_bit(t, a))
        store_result(gen, t, a)
    else:
        # only the layout knows the byte of an address: the carry is added to the variable instead
        gen.load(a)
        gen.skip_if(C, False)
        gen.emit("ADDLW", k=1)
        gen.emit("ADDLW", k=b.value)
        gen.store(t)


def _carry_middle_imm(gen: InstructionBuilder, t: Loc, a: Operand, b: Operand) -> None:
    """Add a constant and the carry to a middle byte; the other operand is first copied to the target."""
    if isinstance(a, Imm):
        a, b = b, a
    if isinstance(a, Imm):
        copy = gen.temp()[0]
        gen.move(copy, a)
        a = copy
    assert isinstance(b, Imm)
    gen.move(t, a)
    if b == Imm(0xFF):
        # with a carry 256 is added: the byte stays, and so does C
        gen.emit("MOVLW", k=0xFF)
        gen.skip_if(C, True)
        gen.emit("ADDWF", t, 1)
    elif b == Imm(0):
        # without a carry nothing is added, and C stays 0
        gen.emit("MOVLW", k=1)
        gen.skip_if(C, False)
        gen.emit("ADDWF", t, 1)
    elif isinstance(b.value, int):
        # the constant plus carry is at most 255, so that ADDWF gives the right carry
        gen.emit("MOVLW", k=b.value)
        gen.skip_if(C, False)
        gen.emit("MOVLW", k=b.value + 1)
        gen.emit("ADDWF", t, 1)
    else:
        copy = gen.temp()[0]
        gen.move(copy, b)
        gen.load(copy)
        gen.skip_if(C, False)
        gen.emit("INCFSZ", copy, 0)
        gen.emit("ADDWF", t, 1)


def _add_constant(gen: InstructionBuilder, target: list[Loc], left: list[Operand], value: int) -> None:
    """Emit target = left + value: counting up or down where that is an addition of 1 or -1."""
    size = len(target)
    mask = (1 << 8 * size) - 1
    value &= mask
    start = 0
    # bytes of the constant that are 0 change nothing below the first other one, and give no carry
    while start < size and not value >> 8 * start & 0xFF:
        gen.move(target[start], left[start])
        start += 1
    if start == size:
        return
    t, a = target[start:], left[start:]
    value >>= 8 * start
    ones = (1 << 8 * len(t)) - 1
    if value == 1 and t == a:
        count_up(gen, t)
        return
    if value == ones and t == a:
        _count_down(gen, t)
        return
    bytes_ = imms(value, len(t))
    low = value & 0xFF
    if len(t) == 1 and not isinstance(a[0], Imm) and low in (1, 0xFF):
        # INCF and DECF do not change C, which nobody reads after the top byte
        op = "INCF" if low == 1 else "DECF"
        gen.emit(op, a[0], destination_bit(t[0], a[0]))
        store_result(gen, t[0], a[0])
        return
    for number in range(len(t)):
        if number == 0:
            _add_first(gen, t[0], a[0], bytes_[0])
        elif number == len(t) - 1:
            _carry_last(gen, t[number], a[number], bytes_[number])  # type: ignore[arg-type]
        else:
            _carry_middle_imm(gen, t[number], a[number], bytes_[number])


def count_up(gen: InstructionBuilder, t: list[Loc]) -> None:
    """Emit t = t + 1 in place."""
    for number, byte in enumerate(t):
        # INCF sets Z exactly where the byte wraps to 0, which is its carry
        if number:
            gen.skip_if(Z, False)
        gen.emit("INCF", byte, 1)


def _count_down(gen: InstructionBuilder, t: list[Loc]) -> None:
    """Emit t = t - 1 in place."""
    if len(t) == 1:
        gen.emit("DECF", t[0], 1)
        return
    if len(t) == 2 and not exposed(t[0]):
        # DECF gives no borrow: the high byte counts down if the low byte is 0 before it does
        gen.emit("MOVF", t[0], 1)
        gen.skip_if(Z, False)
        gen.emit("DECF", t[1], 1)
        gen.emit("DECF", t[0], 1)
        return
    # W stays 1; the first byte without a borrow leaves C set, and all later SUBWF are skipped
    gen.emit("MOVLW", k=1)
    gen.emit("SUBWF", t[0], 1)
    for byte in t[1:-1]:
        gen.skip_if(C, True)
        gen.emit("SUBWF", byte, 1)
    gen.skip_if(C, True)
    gen.emit("DECF", t[-1], 1)


def subtract(gen: InstructionBuilder, target: list[Loc], left: list[Operand], right: list[Operand]) -> None:
    """Emit target = left - right. On this chip C is the inverted borrow (DS35007 register 2-1)."""
    constant = const(right)
    size = len(target)
    if constant is not None and const(left) is None:
        _add_constant(gen, target, left, -constant)
        return
    # a middle byte of the target is first loaded with the minuend, which would overwrite the subtrahend
    if target == right and size > 2:
        difference: list[Loc] = gen.temp(size)
        subtract(gen, difference, left, right)
        gen.move_all(target, list(difference))
        return
    for number, (t, a, b) in enumerate(zip(target, left, right, strict=True)):
        last = number == size - 1
        if number == 0 or (last and t != a) or (last and isinstance(b, Imm)):
            gen.load(b)
            if number:
                # a borrow adds 1 to the subtrahend; where that wraps, the difference is right and only C is
                # not
                gen.skip_if(C, True)
                gen.emit("ADDLW", k=1)
            if isinstance(a, Imm):
                gen.emit("SUBLW", k=a.value)
                gen.store(t)
            else:
                gen.emit("SUBWF", a, destination_bit(t, a))
                store_result(gen, t, a)
            continue
        if isinstance(b, Imm):
            held_b = gen.temp()[0]
            gen.move(held_b, b)
            b = held_b
        gen.move(t, a)
        # b plus borrow of 256 subtracts nothing and borrows again: skipping SUBWF keeps the byte and C
        b = load_twice(gen, b)
        gen.skip_if(C, True)
        gen.emit("INCFSZ", b, 0)
        gen.emit("SUBWF", t, 1)


def negate(gen: InstructionBuilder, target: list[Loc], operand: list[Operand]) -> None:
    """Emit target = -operand."""
    if len(target) == 1:
        if target == operand:
            # -x is ~x + 1
            gen.emit("COMF", target[0], 1)
            gen.emit("INCF", target[0], 1)
        else:
            # SUBLW computes its literal minus W
            gen.load(operand[0])
            gen.emit("SUBLW", k=0)
            gen.store(target[0])
        return
    complement(gen, target, operand)
    count_up(gen, target)


def complement(gen: InstructionBuilder, target: list[Loc], operand: list[Operand]) -> None:
    """Emit target = ~operand."""
    for t, a in zip(target, operand, strict=True):
        if isinstance(a, Imm):
            gen.emit("MOVLW", k=a.value)
            gen.emit("XORLW", k=0xFF)
            gen.store(t)
        else:
            gen.emit("COMF", a, destination_bit(t, a))
            store_result(gen, t, a)


def bitwise(
    gen: InstructionBuilder, op: str, target: list[Loc], left: list[Operand], right: list[Operand]
) -> None:
    """Emit target = left op right for `&`, `|` or `^`, byte by byte."""
    for t, a, b in zip(target, left, right, strict=True):
        if isinstance(a, Imm) or (t == b and t != a):
            a, b = b, a
        _bitwise_byte(gen, op, t, a, b)


def _bitwise_byte(gen: InstructionBuilder, op: str, t: Loc, a: Operand, b: Operand) -> None:
    """Emit one byte of a bitwise operation, by the shortest instruction for its constant."""
    value = b.value if isinstance(b, Imm) and isinstance(b.value, int) else None
    mnemonic = {"&": "AND", "|": "IOR", "^": "XOR"}[op]
    if value is not None and not isinstance(a, Imm):
        if (op, value) in (("&", 0xFF), ("|", 0), ("^", 0)):
            gen.move(t, a)
            return
        if (op, value) in (("&", 0), ("|", 0xFF)):
            # the value of a volatile byte does not matter here, but C wants it read (ISO C 5.1.2.3)
            gen.read_unused([a])
            gen.move(t, Imm(value))
            return
        if (op, value) == ("^", 0xFF):
            gen.emit("COMF", a, destination_bit(t, a))
            store_result(gen, t, a)
            return
        # one bit is set or cleared in one instruction, without W
        if t == a and op == "|" and value.bit_count() == 1:
            gen.emit("BSF", t, b=value.bit_length() - 1)
            return
        if t == a and op == "&" and (value ^ 0xFF).bit_count() == 1:
            gen.emit("BCF", t, b=(value ^ 0xFF).bit_length() - 1)
            return
    if isinstance(b, Imm) and not isinstance(a, Imm) and t != a:
        gen.load(a)
        gen.emit(mnemonic + "LW", k=b.value)
        gen.store(t)
        return
    gen.load(b)
    if isinstance(a, Imm):
        gen.emit(mnemonic + "LW", k=a.value)
        gen.store(t)
    else:
        gen.emit(mnemonic + "WF", a, destination_bit(t, a))
        store_result(gen, t, a)


def shift_left(gen: InstructionBuilder, target: list[Loc], operand: list[Operand], count: int) -> None:
    """Emit target = operand << count: whole bytes by moves, the rest by rotations through C."""
    size = len(target)
    whole, rest = divmod(count, 8)
    # the bytes that are shifted out are read all the same if they are volatile
    gen.read_unused(operand[max(0, size - whole) :])
    if whole >= size:
        gen.move_all(target, imms(0, size))
        return
    sources: list[Operand] = [*imms(0, whole), *operand[: size - whole]]
    live = target[whole:]
    if len(live) == 1 and rest:
        _shift_byte(gen, live[0], sources[whole], rest, left=True)
        gen.move_all(target[:whole], imms(0, whole))
        return
    if rest == 1 and not whole and not any(isinstance(byte, Imm) for byte in operand):
        gen.emit("BCF", STATUS, b=C)
        # the MOVWF between two rotations leaves C alone, so that the bits pass from byte to byte
        for t, a in zip(target, operand, strict=True):
            assert not isinstance(a, Imm)
            gen.emit("RLF", a, destination_bit(t, a))
            store_result(gen, t, a)
        return
    gen.move_all(target, sources)
    for _ in range(rest):
        one_left(gen, live)


def _shift_byte(gen: InstructionBuilder, t: Loc, a: Operand, count: int, *, left: bool) -> None:
    """Shift one byte by 1 to 7 bits, filling with zeros."""
    towards = "RLF" if left else "RRF"
    away = "RRF" if left else "RLF"
    if isinstance(a, Imm):
        copy = gen.temp()[0]
        gen.move(copy, a)
        a = copy
    if count == 7:  # one bit stays: it goes through the carry to the other end
        gen.emit(away, a, 0)
        gen.emit("CLRF", t)
        gen.emit(away, t, 1)
    elif count >= 4:
        # SWAPF rotates by four bits at once; the mask removes those that came round
        gen.emit("SWAPF", a, 0)
        gen.emit("ANDLW", k=0xF0 if left else 0x0F)
        gen.store(t)
        _repeat(gen, towards, t, count - 4)
    elif count == 1:
        gen.emit("BCF", STATUS, b=C)
        gen.emit(towards, a, destination_bit(t, a))
        store_result(gen, t, a)
    else:
        gen.move(t, a)
        _repeat(gen, towards, t, count)


def _repeat(gen: InstructionBuilder, op: str, t: Loc, count: int) -> None:
    """Emit a shift by `count` bits in place."""
    for _ in range(count):
        gen.emit("BCF", STATUS, b=C)
        gen.emit(op, t, 1)


def shift_right(
    gen: InstructionBuilder, target: list[Loc], operand: list[Operand], count: int, *, signed: bool
) -> None:
    """Emit target = operand >> count, filling with zeros or, if `signed`, with the sign."""
    size = len(target)
    # beyond that, every bit of a signed value is its sign
    count = min(count, 8 * size - 1) if signed else count
    whole, rest = divmod(count, 8)
    gen.read_unused(operand[:whole])
    if whole >= size:
        gen.move_all(target, imms(0, size))
        return
    live = size - whole
    if signed and whole:
        operand = [*operand[:-1], gen.steady(operand[-1])]
        sign = sign_byte(gen, operand[-1])
        gen.move_all(target, [*operand[whole:], *[sign] * whole])
    elif live == 1 and rest and not signed:
        _shift_byte(gen, target[0], operand[whole], rest, left=False)
        gen.move_all(target[1:], imms(0, size - 1))
        return
    elif rest == 1 and not whole and not signed and not any(isinstance(byte, Imm) for byte in operand):
        gen.emit("BCF", STATUS, b=C)
        for t, a in zip(reversed(target), reversed(operand), strict=True):
            assert not isinstance(a, Imm)
            gen.emit("RRF", a, destination_bit(t, a))
            store_result(gen, t, a)
        return
    else:
        gen.move_all(target, [*operand[whole:], *imms(0, whole)])
    for _ in range(rest):
        one_right(gen, target[:live], signed=signed)


def one_right(gen: InstructionBuilder, target: list[Loc], *, signed: bool) -> None:
    """Emit a shift by one bit to the right in place; the lowest bit goes to C."""
    if signed:
        gen.emit("RLF", target[-1], 0)  # the sign into C
    else:
        gen.emit("BCF", STATUS, b=C)
    rotate_right(gen, target)


def one_left(gen: InstructionBuilder, target: list[Loc]) -> None:
    """Emit a shift by one bit to the left in place; the highest bit goes to C."""
    gen.emit("BCF", STATUS, b=C)
    rotate_left(gen, target)


def rotate_right(gen: InstructionBuilder, target: Sequence[Loc]) -> None:
    """Emit a rotation by one bit to the right in place: C enters at the top, the lowest bit goes to C."""
    for byte in reversed(target):
        gen.emit("RRF", byte, 1)


def rotate_left(gen: InstructionBuilder, target: Sequence[Loc]) -> None:
    """Emit a rotation by one bit to the left in place: C enters at the bottom, the highest bit goes to C."""
    for byte in target:
        gen.emit("RLF", byte, 1)


def sign_byte(gen: InstructionBuilder, top: Operand) -> Operand:
    """Return an operand that is 0x00 or 0xFF, depending on the sign of a byte."""
    if isinstance(top, Imm):
        return Imm(0xFF if isinstance(top.value, int) and top.value & 0x80 else 0)
    sign = gen.temp()[0]
    # the complement of 0x00 is 0xFF
    gen.emit("CLRF", sign)
    gen.skip_if(7, False, top)
    gen.emit("COMF", sign, 1)
    return sign


def zero_test(gen: InstructionBuilder, operands: Sequence[Operand]) -> None:
    """Set Z if all bytes are zero."""
    variables = [operand for operand in operands if operand != Imm(0)]
    if not variables:
        gen.emit("MOVLW", k=0)
        gen.emit("IORLW", k=0)
        return
    gen.load(variables[0])
    if isinstance(variables[0], Imm):
        gen.emit("IORLW", k=0)
    for operand in variables[1:]:
        if isinstance(operand, Imm):
            gen.emit("IORLW", k=operand.value)
        else:
            gen.emit("IORWF", operand, 0)


def compare_less(gen: InstructionBuilder, left: list[Operand], right: list[Operand]) -> None:
    """Set C to not (left < right), compared as unsigned."""
    constant = const(right)
    start = 0
    # low bytes of the bound that are 0 give no borrow, whatever is compared with them
    if constant is not None:
        while start < len(right) - 1 and right[start] == Imm(0):
            start += 1
    for number in range(start, len(left)):
        a, b = left[number], right[number]
        first = number == start
        if first:
            gen.load(b)
        elif isinstance(b, Imm) and isinstance(b.value, int) and not isinstance(a, Imm):
            gen.emit("MOVLW", k=b.value)
            # 255 plus borrow is 256: every byte is less, and C, which is 0 already, stays so without SUBWF
            if b.value == 0xFF:
                gen.skip_if(C, False)
                gen.emit("SUBWF", a, 0)
                continue
            gen.skip_if(C, True)
            gen.emit("MOVLW", k=b.value + 1)
        else:
            if isinstance(b, Imm):
                copy = gen.temp()[0]
                gen.move(copy, b)
                b = copy
            # the same holds here: INCFSZ skips the SUBWF where b plus borrow is 256
            b = load_twice(gen, b)
            gen.skip_if(C, True)
            gen.emit("INCFSZ", b, 0)
        if isinstance(a, Imm):
            gen.emit("SUBLW", k=a.value)
        else:
            gen.emit("SUBWF", a, 0)


def biased(gen: InstructionBuilder, operands: list[Operand]) -> list[Operand]:
    """Return operands with the top bit inverted, so that an unsigned comparison gives the signed order."""
    top = operands[-1]
    if isinstance(top, Imm) and isinstance(top.value, int):
        return [*operands[:-1], Imm(top.value ^ 0x80)]
    inverted = gen.temp()[0]
    gen.load(top)
    gen.emit("XORLW", k=0x80)
    gen.store(inverted)
    return [*operands[:-1], inverted]
