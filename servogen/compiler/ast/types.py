"""The C types of this chip: sizes in bytes, little endian, no padding.

A pointer to RAM is one byte (an FSR value). A pointer to `const` is two: it may point to flash (bit 15
set, the word address below) or to RAM (the address alone), so that one function takes both.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace


@dataclass(frozen=True)
class CType(ABC):
    """A C type with its own qualifiers."""

    const: bool = field(default=False, kw_only=True)
    volatile: bool = field(default=False, kw_only=True)

    @property
    @abstractmethod
    def size(self) -> int:
        """Return the size of an object of the type, in bytes."""

    def plain(self) -> CType:
        """Return the type without its own qualifiers."""
        return replace(self, const=False, volatile=False) if self.const or self.volatile else self

    @property
    def scalar(self) -> bool:
        return isinstance(self, (IntType, FloatType, PointerType))


@dataclass(frozen=True)
class VoidType(CType):
    """`void`."""

    @property
    def size(self) -> int:
        return 1  # as sizeof gives it, so that void pointers count bytes

    def __str__(self) -> str:
        return _quals(self) + "void"


@dataclass(frozen=True)
class IntType(CType):
    """An integer type of one to four bytes, two's complement."""

    name: str
    bytes: int
    signed: bool
    is_bool: bool = False
    """Holds 0 or 1: `_Bool` in a byte, `bit` in a bit."""
    is_bit: bool = False

    @property
    def size(self) -> int:
        return self.bytes

    @property
    def low(self) -> int:
        return -(1 << 8 * self.bytes - 1) if self.signed else 0

    @property
    def high(self) -> int:
        if self.is_bool:
            return 1
        return (1 << 8 * self.bytes - self.signed) - 1

    def wrap(self, value: int) -> int:
        """Return a value converted to this type."""
        if self.is_bool:
            return int(value & 1 if self.is_bit else value != 0)
        value &= (1 << 8 * self.bytes) - 1
        return value - (1 << 8 * self.bytes) if self.signed and value >> 8 * self.bytes - 1 else value

    def __str__(self) -> str:
        return _quals(self) + self.name


@dataclass(frozen=True)
class FloatType(CType):
    """A floating-point type: IEEE 754 binary32 in 4 bytes, or with 15 bits of mantissa in 3."""

    bytes: int

    @property
    def size(self) -> int:
        return self.bytes

    @property
    def bits(self) -> IntType:
        """Return the integer type that holds the bytes of a value."""
        return U32 if self.bytes == U32.bytes else U24

    @property
    def sign_bit(self) -> int:
        return 1 << 8 * self.bytes - 1

    def __str__(self) -> str:
        return _quals(self) + "float"


FLOAT_BIAS = 127
"""What is added to the exponent of a floating-point value."""


@dataclass(frozen=True)
class PointerType(CType):
    """A pointer of one byte into RAM, or of two bytes to where `const` objects lie."""

    target: CType

    @property
    def size(self) -> int:
        return 2 if self.wide else 1

    @property
    def wide(self) -> bool:
        """Return whether the pointer may point to flash."""
        return is_const_object(self.target)

    def __str__(self) -> str:
        if isinstance(self.target, FuncType):
            parameters = ", ".join(map(str, self.target.parameters or ()))
            return f"{self.target.result} (*)({parameters})" + _quals(self)
        return f"{self.target} *{_quals(self)}".rstrip()


@dataclass(frozen=True)
class ArrayType(CType):
    """An array; without a length it is incomplete (ISO C 6.7.6.2)."""

    element: CType
    length: int | None

    @property
    def size(self) -> int:
        return self.element.size * (self.length or 0)

    def __str__(self) -> str:
        dims, inner = "", self
        while isinstance(inner, ArrayType):
            dims += f"[{'' if inner.length is None else inner.length}]"
            inner = inner.element  # type: ignore[assignment]
        return f"{inner}{dims}"


@dataclass(frozen=True, slots=True)
class Member:
    """A member of a structure or union, at an offset in bytes."""

    name: str
    type: CType
    offset: int
    bit: int | None = None
    """The lowest bit of a bit-field, and its width."""
    width: int = 0


@dataclass(eq=False)
class StructLayout:
    """The members of a structure, known once its body has been parsed."""

    tag: str
    union: bool
    members: dict[str, Member] = field(default_factory=dict)
    """By name, those of an unnamed structure inside it among them."""
    parts: list[Member] = field(default_factory=list)
    """As they stand, an unnamed structure whole: what an initialiser goes by."""
    size: int | None = None


@dataclass(frozen=True)
class StructType(CType):
    """A structure or union; its members are in the layout that all its copies share."""

    layout: StructLayout

    @property
    def size(self) -> int:
        return self.layout.size or 0

    def __str__(self) -> str:
        return _quals(self) + ("union " if self.layout.union else "struct ") + self.layout.tag


@dataclass(frozen=True)
class FuncType(CType):
    """The type of a function: its result and its parameters."""

    result: CType
    parameters: tuple[CType, ...] | None
    """None where the declaration gives none: any arguments go."""

    @property
    def size(self) -> int:
        return 1

    def __str__(self) -> str:
        return f"{self.result}({', '.join(map(str, self.parameters or ()))})"


def _quals(kind: CType) -> str:
    return ("const " if kind.const else "") + ("volatile " if kind.volatile else "")


VOID = VoidType()
BOOL = IntType("bool", 1, False, is_bool=True)
BIT = IntType("bit", 1, False, is_bool=True, is_bit=True)
U8 = IntType("unsigned char", 1, False)
S8 = IntType("signed char", 1, True)
U16 = IntType("unsigned int", 2, False)
S16 = IntType("int", 2, True)
U24 = IntType("unsigned short long", 3, False)
S24 = IntType("short long", 3, True)
U32 = IntType("unsigned long", 4, False)
S32 = IntType("long", 4, True)
C2C_INT = IntType("int", 2, False)
C2C_SIGNED = IntType("signed int", 2, True)


def is_const_object(kind: CType) -> bool:
    """Return whether an object of this type lies in flash."""
    while isinstance(kind, ArrayType):
        kind = kind.element
    return kind.const and not kind.volatile


def qualified(kind: CType, *, const: bool, volatile: bool) -> CType:
    """Return a type with qualifiers added; those of an array belong to its elements (ISO C 6.7.3)."""
    if not const and not volatile:
        return kind
    if isinstance(kind, ArrayType):
        return replace(kind, element=qualified(kind.element, const=const, volatile=volatile))
    return replace(kind, const=kind.const or const, volatile=kind.volatile or volatile)


def holds_volatile(kind: CType) -> bool:
    """Return whether an object of this type, or any part of it, is volatile."""
    while isinstance(kind, ArrayType):
        kind = kind.element
    inside = isinstance(kind, StructType) and any(holds_volatile(part.type) for part in kind.layout.parts)
    return kind.volatile or inside


def same(left: CType, right: CType) -> bool:
    """Return whether two types are compatible. Qualifiers of the type itself are ignored; a pointer to const
    is not compatible with another pointer, because it has another size.
    """
    left, right = left.plain(), right.plain()
    if isinstance(left, IntType) and isinstance(right, IntType):
        return (left.bytes, left.signed, left.is_bool) == (right.bytes, right.signed, right.is_bool)
    if isinstance(left, FloatType) and isinstance(right, FloatType):
        return left.bytes == right.bytes
    if isinstance(left, PointerType) and isinstance(right, PointerType):
        return left.wide == right.wide and same(left.target, right.target)
    if isinstance(left, ArrayType) and isinstance(right, ArrayType):
        sizes = None in (left.length, right.length) or left.length == right.length
        return sizes and same(left.element, right.element)
    if isinstance(left, StructType) and isinstance(right, StructType):
        return _same_layout(left.layout, right.layout)
    if isinstance(left, FuncType) and isinstance(right, FuncType):
        if not same(left.result, right.result):
            return False
        if left.parameters is None or right.parameters is None:
            return True
        return len(left.parameters) == len(right.parameters) and all(
            same(one, two) for one, two in zip(left.parameters, right.parameters, strict=True)
        )
    return type(left) is type(right)


def differs_in_const(left: CType, right: CType) -> bool:
    """Return whether two types have a pointer at the same point that leads to const in only one of them."""
    if isinstance(left, PointerType) and isinstance(right, PointerType):
        return left.wide != right.wide or differs_in_const(left.target, right.target)
    if isinstance(left, ArrayType) and isinstance(right, ArrayType):
        return differs_in_const(left.element, right.element)
    if isinstance(left, FuncType) and isinstance(right, FuncType):
        parameters = zip(left.parameters or (), right.parameters or (), strict=False)
        pairs = [(left.result, right.result), *parameters]
        return any(differs_in_const(one, two) for one, two in pairs)
    return False


def _same_layout(left: StructLayout, right: StructLayout) -> bool:
    """Return whether two structures from different files are declared alike (ISO C 6.2.7)."""
    if left is right:
        return True
    if (left.tag, left.union, left.size) != (right.tag, right.union, right.size):
        return False
    return len(left.parts) == len(right.parts) and all(
        (one.name, one.offset, one.bit, one.width) == (two.name, two.offset, two.bit, two.width)
        and (_leads_to_structure(one.type) or same(one.type, two.type))
        for one, two in zip(left.parts, right.parts, strict=True)
    )


def _leads_to_structure(kind: CType) -> bool:
    """Return whether a type is a pointer to a structure, possibly the structure that it is a member of."""
    return isinstance(kind, PointerType) and isinstance(kind.target, StructType)


def promote(kind: IntType, *, c2c: bool) -> IntType:
    """Return the type after integer promotion: a 16-bit int; in C2C, where `int` is unsigned, with the
    signedness of `kind`.
    """
    if kind.bytes > 1:
        return kind
    if c2c:
        return C2C_SIGNED if kind.signed else C2C_INT
    return S16


def common(left: IntType, right: IntType, *, c2c: bool) -> IntType:
    """Return the type in which a binary operator computes (ISO C 6.3.1.8)."""
    left, right = promote(left, c2c=c2c), promote(right, c2c=c2c)
    if left.bytes != right.bytes:
        return left if left.bytes > right.bytes else right
    return right if left.signed and not right.signed else left
