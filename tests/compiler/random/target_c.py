"""A program as C of a dialect, ending with its checksum at fixed addresses of the RAM.

In: a `Program`. Out: source text. The bytes: two running sums at 0x4D and 0x4E, the count at 0x4F, and 0xA5
at 0x4C when main has come to its end.
"""

from __future__ import annotations

from tests.compiler.random.printing import Printer, count_mask
from tests.compiler.random.program import (
    AddressOf,
    Array,
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
    Return,
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
from tests.compiler.random.typing_rules import common, dims_of, promote, type_of

DONE, CHECK = 0x4C, 0x4D
FINISHED = 0xA5

NAMES = {
    "xc8": {
        "U8": "unsigned char",
        "S8": "signed char",
        "U16": "unsigned int",
        "S16": "int",
        "U24": "unsigned short long",
        "S24": "short long",
        "U32": "unsigned long",
        "S32": "long",
        "BOOL": "bool",
        "BIT": "bit",
    },
    "c2c": {
        "U8": "char",
        "S8": "signed char",
        "U16": "int",
        "S16": "signed int",
        "U24": "uint24_t",
        "S24": "int24_t",
        "U32": "uint32_t",
        "S32": "int32_t",
        "BOOL": "bool",
        "BIT": "bit",
    },
}

_CHECKS = """
unsigned char check0 @ 0x4D;
unsigned char check1 @ 0x4E;
unsigned char check2 @ 0x4F;
unsigned char done @ 0x4C;"""
_DECLARED_CHECKS = "extern unsigned char check0, check1, check2, done;"
_OUT = """
void out(unsigned char v) {
    check0 = (unsigned char)(check0 << 1 | check0 >> 7) ^ v;
    check1 += check0;
    check2++;
}
"""
_WIDER = {
    size: f"void out{size}({kind} v) {{ "
    + " ".join(f"out((unsigned char)(v >> {shift}));" for shift in range(0, 8 * size, 8))
    + " }\n"
    for size, kind in ((2, "uint16_t"), (3, "uint24_t"), (4, "uint32_t"))
}

_INTERRUPT = """
const unsigned char beat_steps[4] = {3, 5, 7, 250};
unsigned char beats, beat_table[2], twisted, twists;
uint16_t beat_sum;
unsigned char twist(unsigned char v, uint16_t w) {
    return beat_steps[v & 3] * v + w / 7 % (v | 1);
}
void HANDLER {
    INTCON = INTCON & 0xFB;
CALLED    beats++;
    beat_sum = beat_sum * 3 + twist(beat_table[beats & 1], beat_sum);
    beat_table[beats & 1] = beat_sum >> (beats & 7);
}
"""
_CHEAP = 60
"""Operations of a function that the handler may call beside its own work."""
_HANDLERS = {"xc8": "__interrupt() beat(void)", "c2c": "interrupt(void)"}
_BESIDE = """    twisted = twist(9, 1234);
    for (twists = 200; twists; twists--)
        if (twist(9, 1234) != twisted) check1 ^= 0x55;"""
"""The handler and main use one function; it must give main the same whenever it is interrupted."""
_ARM = "    OPTION_REG = 0xD3; INTCON = 0xA0;"
_STOPS = {
    "xc8": "void stop(void) { for (;;) ; }",
    "c2c": "void stop(void) { while (1) { nop(); } }",
}


class TargetC(Printer):
    """Prints one program."""

    def text(self) -> str:
        """All files, one behind the other."""
        return "\n// next file\n".join(self.files())

    def files(self) -> list[str]:
        """The source files, in the order in which the compiler takes them."""
        program = self.program
        heads = [self.head(each) for each in program.functions[:-1]]
        order = list(program.functions)
        if program.seed % 2:
            order.reverse()
        prototypes = [f"{head};" for head in heads] if program.seed % 2 and self.dialect == "xc8" else []
        bodies = [self.function(each) for each in order]
        helpers = [text for size, text in _WIDER.items() if any(f"out{size}(" in each for each in bodies)]
        top = ["#include <xc.h>" if self.dialect == "xc8" else "", "#include <stdint.h>"]
        data = [_CHECKS, *(self.declaration(each) for each in program.globals)]
        structs = [self.struct(each) for each in program.structs]
        code = [_OUT, *helpers]
        code += [_STOPS[self.dialect]] if any("stop();" in each for each in bodies) else []
        code += [self.interrupt()] if program.interrupt else []
        code += prototypes + bodies
        if program.files == "one":
            return ["\n".join([*top, *structs, *data, *code, ""])]
        declared = [_DECLARED_CHECKS, *(f"{self.extern(each)};" for each in self.shared())]
        if program.files == "extern":
            return ["\n".join([*top, *structs, *declared, *data, *code, ""])]
        definitions = "\n".join([*top, *structs, *declared, *data, ""])
        functions = "\n".join([*top, *structs, *declared, *code, ""])
        return [definitions, functions] if program.files == "first" else [functions, definitions]

    def shared(self) -> list[Variable]:
        """The globals that may be declared `extern`."""
        return [each for each in self.program.globals if each.where != "register"]

    def extern(self, variable: Variable) -> str:
        volatile = "volatile " if variable.where == "volatile" or variable.watched is not None else ""
        const = "const " if variable.storage == "const" else ""
        return f"extern {volatile}{const}{self.declarator(variable.type, variable.name)}"

    def interrupt(self) -> str:
        """The handler; it also calls the functions of the program that only read."""
        called = "".join(
            f"    {each.name}({', '.join('3' for _ in each.parameters)});\n"
            for each in self.program.functions[:-1]
            if not each.writes
            and each.cost < _CHEAP
            and isinstance(each.result, Int)
            and all(isinstance(parameter.type, Int) for parameter in each.parameters)
        )
        return _INTERRUPT.replace("HANDLER", _HANDLERS[self.dialect]).replace("CALLED", called)

    def head(self, function: Function) -> str:
        parameters = (
            ", ".join(self.declarator(each.type, each.name) for each in function.parameters) or "void"
        )
        return f"{self.base(function.result) if function.result else 'void'} {function.name}({parameters})"

    def function(self, function: Function) -> str:
        lines = self.body(function)
        if function is self.program.functions[-1]:
            start = ["    check0 = check1 = check2 = 0;", *([_ARM] if self.program.interrupt else [])]
            for each in self.program.globals:
                if each.where.startswith(("@", "register")):
                    start.append(f"    {each.name}{self.initial(each)};")
                elif each.watched is not None:
                    start += self.clear(each)
            start += ["    done = 0;"]
            start += [_BESIDE] if self.program.interrupt else []
            lines = [*start, *lines, f"    done = 0x{FINISHED:X};", "    while (1);"]
        elif isinstance(function.result, Int) and not (
            function.body and isinstance(function.body[-1], Return)
        ):
            lines.append("    return 0;")
        return "\n".join([self.head(function) + " {", *lines, "}"])

    def base(self, kind: Type) -> str:
        if isinstance(kind, Int):
            return NAMES[self.dialect][kind.name]
        assert isinstance(kind, Struct)
        return f"{'union' if kind.union else 'struct'} {kind.tag}"

    def name(self, variable: Variable) -> str:
        return variable.name

    def declaration(self, variable: Variable) -> str:
        if variable.where == "register":
            return f"// {variable.name} is a register"
        if variable.where == "volatile":
            return f"volatile {super().declaration(variable)}"
        if variable.watched is not None:
            where = variable.where.removeprefix("watched")
            return f"volatile {self.declarator(variable.type, variable.name)}{where};"
        if variable.where.startswith("@"):
            return f"{self.declarator(variable.type, variable.name)} {variable.where};"
        return super().declaration(variable)

    def clear(self, variable: Variable) -> list[str]:
        """A watched variable starts at 0, before the watcher counts."""
        if isinstance(variable.type, Int):
            return [f"    {variable.name} = 0;"]
        assert isinstance(variable.type, Struct)
        found = []
        for member in variable.type.members:
            name = f"{variable.name}.{member.name}"
            if isinstance(member.type, Array):
                found += [f"    {name}[{each}] = 0;" for each in range(member.type.count)]
            else:
                found.append(f"    {name} = 0;")
        return found

    def case(self, value: int, kind: Int) -> str:
        return str(value)

    def number(self, value: int, kind: Int) -> str:
        long = kind.bits > 16 and kind.wrap(value) < 0  # -34337 would be unsigned in C2C
        return f"{kind.wrap(value)}{'L' if long else ''}"

    def converted(self, expr: Expr, kind: Int) -> str:
        return self.expr(expr)

    def place(self, expr: Expr) -> str:
        match expr:
            case Var(variable):
                return variable.name
            case Element(array, indices):
                pairs = zip(indices, dims_of(array), strict=True)
                return self.place(array) + "".join(f"[{self.index(each, size)}]" for each, size in pairs)
            case MemberOf(Deref(pointer), member):
                return f"{pointer.name}->{member.name}"
            case MemberOf(base, member):
                return f"{self.place(base)}.{member.name}"
            case Deref(pointer, indexed):
                return f"{pointer.name}[0]" if indexed else f"(*{pointer.name})"
        raise TypeError(expr)

    def index(self, index: Expr, size: int) -> str:
        how = self.reduction(index, size)
        if how == "plain":
            return self.expr(index)
        if how == "mask":
            return f"{self.expr(index)} & {size - 1}"
        return f"(unsigned char){self.expr(index)} % {size}"

    def expr(self, expr: Expr) -> str:
        match expr:
            case Num():
                return self.literal(expr)
            case Var() | Element() | MemberOf() | Deref():
                return self.place(expr)
            case Unary(op, operand):
                return f"({op}{self.expr(operand)})"
            case Binary(op, left, right) | Logic(op, left, right):
                return f"({self.expr(left)} {op} {self.expr(right)})"
            case Divide(op, left, right):
                return f"({self.expr(left)} {op} {self.divisor(right, type_of(expr, self.dialect))})"
            case Shift(op, left, right):
                return f"({self.expr(left)} {op} {self.count(right, type_of(expr, self.dialect))})"
            case Choice(condition, yes, no):
                return f"({self.expr(condition)} ? {self.expr(yes)} : {self.expr(no)})"
            case Comma(first, second):
                return f"({self.expr(first)}, {self.expr(second)})"
            case Cast(kind, operand):
                return f"(({self.base(kind)}){self.expr(operand)})"
            case SizeOf(kind):
                return f"sizeof({self.base(kind)})"
            case Assign(target, value):
                return f"({self.place(target)} = {self.expr(value)})"
            case Update(op, target, value):
                return self.update(op, target, value)
            case Step(op, target, prefix):
                return f"({op}{self.place(target)})" if prefix else f"({self.place(target)}{op})"
            case Call(function, arguments):
                given = ", ".join(self.argument(each) for each in arguments)
                return f"{function.name}({given})"
            case Part(made, member):
                return f"{self.expr(made)}.{member.name}"
            case TestBit():
                return self.test_bit(expr)
            case AddressOf():
                return self.pointer(expr)
        raise TypeError(expr)

    def literal(self, num: Num) -> str:
        if num.base == 16:
            return f"0x{num.value:X}{num.suffix}"
        if num.base == 2:
            return f"0b{num.value:b}" if self.dialect == "xc8" else f"{num.value:08b}b"
        return f"{num.value}{num.suffix}"

    def argument(self, expr: Expr) -> str:
        return self.pointer(expr) if isinstance(expr, AddressOf) else self.expr(expr)

    def pointer(self, expr: Expr) -> str:
        match expr:
            case Var(variable):
                return variable.name
            case AddressOf():
                return self.address(expr)
        raise TypeError(expr)

    def divisor(self, right: Expr, kind: Int) -> str:
        if isinstance(right, Num) and kind.wrap(right.value):
            return self.expr(right)
        return f"({self.expr(right)} | 1)"

    def count(self, right: Expr, kind: Int) -> str:
        if isinstance(right, Num) and right.value < kind.bits:
            return self.expr(right)
        return f"({self.expr(right)} & {count_mask(kind)})"

    def update(self, op: str, target: Place, value: Expr) -> str:
        kind = type_of(target, self.dialect)
        if op in ("<<", ">>"):
            right = self.count(value, promote(kind, self.dialect))
        elif op in "/%":
            right = self.divisor(value, common(kind, type_of(value, self.dialect), self.dialect))
        else:
            right = self.expr(value)
        return f"({self.place(target)} {op}= {right})"

    def test_bit(self, expr: TestBit) -> str:
        name = self.place(expr.target)
        if self.dialect == "xc8":
            return f"((bit)(({name} >> {expr.bit}) & 1))"
        return f"{name}.{expr.bit}" if expr.bit % 2 and expr.bit < 8 else f"test_bit({name}, {expr.bit})"

    def out(self, expr: Expr, pad: str) -> str:
        size = type_of(expr, self.dialect).size
        return f"{pad}out{size if size > 1 else ''}({self.expr(expr)});"

    def set_bit(self, stmt: SetBit) -> str:
        name = self.place(stmt.target)
        if self.dialect == "c2c":
            return f"{stmt.what}_bit({name}, {stmt.bit});"
        wide = type_of(stmt.target, self.dialect).bits > 16
        one = f"(1{'UL' if wide else 'U'} << {stmt.bit})"
        return {"set": f"{name} |= {one};", "clear": f"{name} &= ~{one};", "toggle": f"{name} ^= {one};"}[
            stmt.what
        ]

    def move_in(self, pointer: Variable, value: Expr, element: Int) -> str:
        return f"*{pointer.name}++ = {self.expr(value)};"

    def move_out(self, pointer: Variable, target: Place) -> str:
        return f"{self.place(target)} = *{pointer.name}++;"
