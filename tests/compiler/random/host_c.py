"""A program as C for the host's gcc, with the arithmetic of a 16-bit `int` spelled out.

In: a `Program`. Out: functions whose every operation is computed in `int64_t` (nothing overflows there that
is not then cut off: products have at most 64 bits and wrap, with -fwrapv) and brought to its type by a macro
of that type's name. So gcc's own promotions never decide anything: an operation's value is the mathematical
one, taken modulo 2**bits of the type that `typing_rules` gives. Objects in memory have the types of
<stdint.h>; a 24-bit one lies in 32 bits, already cut.
"""

from __future__ import annotations

from tests.compiler.random.expressions import base_of
from tests.compiler.random.printing import STOP, Printer, count_mask
from tests.compiler.random.program import (
    BIT,
    BOOL,
    S16,
    S24,
    U8,
    U24,
    AddressOf,
    Assign,
    Binary,
    Call,
    Cast,
    Choice,
    Comma,
    Deref,
    Divide,
    Element,
    Expr,
    Function,
    Int,
    Logic,
    MemberOf,
    Num,
    Part,
    Place,
    Program,
    SetBit,
    Shift,
    SizeOf,
    Step,
    Struct,
    TestBit,
    Type,
    Unary,
    Update,
    Var,
    Variable,
)
from tests.compiler.random.typing_rules import COMPARISONS, common, dims_of, is_struct, promote, type_of

PRELUDE = """
#include <stdint.h>
#include <stdio.h>
typedef int64_t V;
#define U8(x) ((V)(uint8_t)(x))
#define S8(x) ((V)(int8_t)(x))
#define U16(x) ((V)(uint16_t)(x))
#define S16(x) ((V)(int16_t)(x))
#define U24(x) ((V)((uint64_t)(x) & 0xFFFFFF))
#define S24(x) ((V)((uint64_t)(x) << 40) >> 40)
#define U32(x) ((V)(uint32_t)(x))
#define S32(x) ((V)(int32_t)(x))
#define BOOL(x) ((V)((x) != 0))
#define BIT(x) ((V)((x) & 1))
static uint8_t check0, check1, check2;
static void out(V v) {
    check0 = (uint8_t)(check0 << 1 | check0 >> 7) ^ (uint8_t)v;
    check1 += check0;
    check2 += 1;
}
#define STORES 20000
static struct { int address, value; } stores[STORES];
static int stored;
static void store(int address, uint8_t value) {
    if (stored < STORES) { stores[stored].address = address; stores[stored].value = value; }
    stored++;
}
"""

_MEMORY = {
    **{f"U{bits}": f"uint{bits}_t" for bits in (8, 16, 32)},
    **{f"S{bits}": f"int{bits}_t" for bits in (8, 16, 32)},
    U24.name: "uint32_t",
    S24.name: "int32_t",
    BOOL.name: "uint8_t",
    BIT.name: "uint8_t",
}


class HostC(Printer):
    """Prints one program; every global name starts with `prefix`."""

    def __init__(self, program: Program, prefix: str) -> None:
        super().__init__(program)
        self.prefix = prefix

    def text(self) -> str:
        parts = [self.struct(each) for each in self.program.structs]
        parts += [f"static {self.declaration(each)}" for each in self.program.globals]
        parts.append(f"static void {self.name(STOP)}(void) {{ while (1); }}")
        parts += [self.function(each) for each in self.program.functions]
        return "\n".join(parts) + "\n"

    @property
    def entry(self) -> str:
        return f"{self.prefix}main"

    def function(self, function: Function) -> str:
        parameters = (
            ", ".join(self.declarator(each.type, each.name) for each in function.parameters) or "void"
        )
        result = self.base(function.result) if function.result else "void"
        head = f"static {result} {self.prefix}{function.name}({parameters})"
        return "\n".join(
            [
                head + " {",
                *self.body(function),
                "    return 0;" if isinstance(function.result, Int) else "",
                "}",
            ]
        )

    def base(self, kind: Type) -> str:
        if isinstance(kind, Int):
            return _MEMORY[kind.name]
        assert isinstance(kind, Struct)
        return f"{'union' if kind.union else 'struct'} {self.prefix}{kind.tag}"

    def name(self, variable: Variable) -> str:
        return f"{self.prefix if variable.storage in ('global', 'const', 'never') else ''}{variable.name}"

    def number(self, value: int, kind: Int) -> str:
        return str(kind.wrap(value))

    def case(self, value: int, kind: Int) -> str:
        return str(kind.wrap(value))

    # values

    def converted(self, expr: Expr, kind: Int) -> str:
        return f"{kind.name}({self.expr(expr)})"

    def place(self, expr: Expr) -> str:
        match expr:
            case Var(variable):
                return self.name(variable)
            case Element(array, indices):
                pairs = zip(indices, dims_of(array), strict=True)
                return self.place(array) + "".join(f"[{self.index(each, size)}]" for each, size in pairs)
            case MemberOf(base, member):
                return f"{self.place(base)}.{member.name}"
            case Deref(pointer):
                return f"(*{self.name(pointer)})"
        raise TypeError(expr)

    def index(self, index: Expr, size: int) -> str:
        how = self.reduction(index, size)
        if how == "plain":
            return self.expr(index)
        if how == "mask":
            kind = common(type_of(index, self.dialect), S16, self.dialect)
            return f"({self.converted(index, kind)} & {size - 1})"
        return f"({self.converted(index, U8)} % {size})"

    def expr(self, expr: Expr) -> str:
        """A value of type `int64_t`, in the range of the expression's type."""
        d = self.dialect
        match expr:
            case Num(value):
                return f"(V){value}"
            case Var() | Element() | MemberOf() | Deref():
                return f"(V){self.place(expr)}"
            case Unary("!", operand):
                return f"(V)!({self.expr(operand)})"
            case Unary(op, operand):
                kind = type_of(expr, d)
                return f"{kind.name}({op}{self.converted(operand, kind)})"
            case Binary(op, left, right):
                kind = common(type_of(left, d), type_of(right, d), d)
                pair = f"({self.converted(left, kind)} {op} {self.converted(right, kind)})"
                return f"(V){pair}" if op in COMPARISONS else f"{kind.name}{pair}"
            case Divide(op, left, right):
                kind = type_of(expr, d)
                return f"{kind.name}({self.converted(left, kind)} {op} {self.divisor(right, kind)})"
            case Shift(op, left, right):
                kind = type_of(expr, d)
                return f"{kind.name}({self.converted(left, kind)} {op} {self.count(right, kind)})"
            case Logic(op, left, right):
                return f"(V)(({self.expr(left)}) {op} ({self.expr(right)}))"
            case Choice(condition, yes, no):
                kind = type_of(expr, d)
                return (
                    f"(({self.expr(condition)}) ? {self.converted(yes, kind)} : {self.converted(no, kind)})"
                )
            case Comma(first, second):
                return f"({self.expr(first)}, {self.expr(second)})"
            case Cast(kind, operand):
                return self.converted(operand, kind)
            case SizeOf(kind):
                return f"(V){kind.size}"
            case Assign(target, value):
                return self.store(target, self.converted(value, type_of(target, d)))
            case Update(op, target, value):
                return self.update(op, target, value)
            case Step(op, target, prefix):
                return self.step(op, target, prefix)
            case Call(function, arguments):
                pairs = zip(function.parameters, arguments, strict=True)
                given = ", ".join(self.argument(parameter, each) for parameter, each in pairs)
                whole = "(V)" if isinstance(function.result, Int) else ""
                return f"{whole}{self.prefix}{function.name}({given})"
            case Part(made, member):
                return f"(V){self.expr(made)}.{member.name}"
            case TestBit(target, bit):
                return f"(({self.expr(target)} >> {bit}) & 1)"
        raise TypeError(expr)

    def argument(self, parameter: Variable, expr: Expr) -> str:
        if isinstance(parameter.type, Int):
            return self.converted(expr, parameter.type)
        return self.place(expr) if is_struct(expr) else self.pointer(expr)

    def pointer(self, expr: Expr) -> str:
        match expr:
            case Var(variable):
                return self.name(variable)
            case AddressOf():
                return self.address(expr)
        raise TypeError(expr)

    def divisor(self, right: Expr, kind: Int) -> str:
        if isinstance(right, Num) and kind.wrap(right.value):
            return self.converted(right, kind)
        guarded = common(type_of(right, self.dialect), S16, self.dialect)
        return f"{kind.name}({self.converted(right, guarded)} | 1)"

    def count(self, right: Expr, kind: Int) -> str:
        if isinstance(right, Num) and right.value < kind.bits:
            return self.expr(right)
        guarded = common(type_of(right, self.dialect), S16, self.dialect)
        return f"({self.converted(right, guarded)} & {count_mask(kind)})"

    # changes; `p_` is where, so that its indices are evaluated once

    def where(self, target: Place) -> str:
        place = self.place(target)
        return f"__typeof__({place}) *p_ = &{place}"

    def seen(self, target: Place) -> str:
        """What tells the watcher of the bus that `target` was stored to."""
        variable = base_of(target)
        if variable.watched is None:
            return ""
        start = f"(uint8_t *)&{self.name(variable)}"
        at = f"((uint8_t *)p_ - {start})"
        if isinstance(target, MemberOf) and target.member.width:
            assert isinstance(variable.type, Struct)
            at = str(variable.type.offsets()[variable.type.members.index(target.member)])
        bytes_ = range(type_of(target, self.dialect).size)
        return " ".join(
            f"store({variable.watched + each} + {at}, ({start})[{at} + {each}]);" for each in bytes_
        )

    def copy(self, target: Var, value: str) -> str:
        plain = super().copy(target, value)
        address = target.variable.watched
        if address is None:
            return plain
        size, name = f"sizeof {self.name(target.variable)}", self.name(target.variable)
        each = f"store({address} + i_, ((uint8_t *)&{name})[i_]);"
        return f"{{ {plain} for (unsigned i_ = 0; i_ < {size}; i_++) {each} }}"

    def field(self, target: Place, value: str) -> str:
        """An assignment to a bit-field."""
        return f"({{ {self.place(target)} = {value}; {self.seen(target)} (V){self.place(target)}; }})"

    def store(self, target: Place, value: str) -> str:
        if isinstance(target, MemberOf) and target.member.width:
            return self.field(target, value)
        return f"({{ V v_ = {value}; {self.where(target)}; *p_ = v_; {self.seen(target)} (V)*p_; }})"

    def update(self, op: str, target: Place, value: Expr) -> str:
        kind = type_of(target, self.dialect)
        field = isinstance(target, MemberOf) and target.member.width
        old = f"(V){self.place(target)}" if field else "(V)*p_"
        if op in ("<<", ">>"):
            work = promote(kind, self.dialect)
            right = self.count(value, work)
        else:
            work = common(kind, type_of(value, self.dialect), self.dialect)
            right = self.divisor(value, work) if op in "/%" else self.converted(value, work)
        new = f"{kind.name}({work.name}({work.name}({old}) {op} {right}))"
        if field:
            return self.field(target, new)
        return f"({{ {self.where(target)}; *p_ = {new}; {self.seen(target)} (V)*p_; }})"

    def step(self, op: str, target: Place, prefix: bool) -> str:
        kind = type_of(target, self.dialect)
        if isinstance(target, MemberOf) and target.member.width:
            return self.field(target, f"{kind.name}((V){self.place(target)} {op[0]} 1)")
        value = "(V)*p_" if prefix else "o_"
        new = f"{kind.name}((V)*p_ {op[0]} 1)"
        return f"({{ {self.where(target)}; V o_ = *p_; *p_ = {new}; {self.seen(target)} {value}; }})"

    def out(self, expr: Expr, pad: str) -> str:
        shifts = range(0, 8 * type_of(expr, self.dialect).size, 8)
        return f"{pad}{{ V v_ = {self.expr(expr)}; {' '.join(f'out(v_ >> {each});' for each in shifts)} }}"

    def set_bit(self, stmt: SetBit) -> str:
        kind = type_of(stmt.target, self.dialect)
        name, bit = self.place(stmt.target), 1 << stmt.bit
        new = {"set": f"{name} | {bit}", "clear": f"{name} & ~{bit}", "toggle": f"{name} ^ {bit}"}[stmt.what]
        return f"{{ {self.where(stmt.target)}; {name} = {kind.name}({new}); {self.seen(stmt.target)} }}"

    def move_in(self, pointer: Variable, value: Expr, element: Int) -> str:
        return f"{{ V v_ = {self.converted(value, element)}; *{self.name(pointer)}++ = v_; }}"

    def move_out(self, pointer: Variable, target: Place) -> str:
        kind = type_of(target, self.dialect)
        return f"{self.store(target, f'{kind.name}(*{self.name(pointer)}++)')};"


def batch(programs: list[Program]) -> str:
    """One translation unit that runs them all and prints a line each: three checksum bytes, then the address
    and the value of each watched store."""
    printers = [HostC(each, f"p{number}_") for number, each in enumerate(programs)]
    calls = "".join(
        f"    check0 = check1 = check2 = stored = 0; {each.entry}(); "
        'printf("%d %d %d", check0, check1, check2);\n'
        "    for (int i = 0; i < stored && i < STORES; i++)\n"
        '        printf(" %d %d", stores[i].address, stores[i].value);\n'
        '    puts(""); fflush(stdout);\n'
        for each in printers
    )
    return (
        PRELUDE + "".join(each.text() for each in printers) + f"int main(void) {{\n{calls}    return 0;\n}}\n"
    )
