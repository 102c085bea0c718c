"""The typed tree of each kind of expression: conversions, folded constants, offsets in bytes."""

from __future__ import annotations

from functools import cache

import pytest

from servogen.compiler import Options, Source, driver
from servogen.compiler.ast.nodes import (
    AddressOf,
    Assign,
    Binary,
    Builtin,
    Call,
    Cast,
    Choice,
    Comma,
    Deref,
    Expr,
    ExprStmt,
    Logic,
    Num,
    Ref,
    Unary,
    Update,
)
from servogen.compiler.ast.types import ArrayType, CType, IntType, PointerType
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.frontend.assembly import AsmBlock
from servogen.compiler.frontend.dialects import float_type
from servogen.compiler.frontend.settings import PragmaSettings
from servogen.compiler.sema.analyser import Analyser
from servogen.compiler.sema.translation_unit import analyse
from servogen.units import Clock


def name(kind: CType) -> str:
    match kind:
        case PointerType(target=target):
            return f"*{name(target)}"
        case ArrayType(element=element):
            return f"{name(element)}[{kind.length}]"
        case IntType():
            sign = "b" if kind.is_bool else "s" if kind.signed else "u"
            return f"{sign}{1 if kind.is_bit else 8 * kind.size}"
    return {"float": "f", "void": "v"}.get(str(kind.plain()), str(kind.plain()))


def show(expr: Expr) -> str:
    """Return a tree in one line: `:t` is the type of what computes, `(t)` a conversion, `+n` an offset."""
    match expr:
        case Num(value, kind):
            return f"{value}:{name(kind)}"
        case Ref(symbol, offset, index) | AddressOf(Ref(symbol, offset, index)):
            where = symbol.name + (f"+{offset}" if offset else "")
            where += f"[{show(index)}]" if index is not None else ""
            if isinstance(expr, AddressOf):
                return f"&{where}:{name(expr.type)}"
            return where + (f".{expr.bit}/{expr.width}" if expr.width else "")
        case Deref(pointer, offset):
            bits = f".{expr.bit}/{expr.width}" if expr.width else ""
            return f"*{show(pointer)}" + (f"+{offset}" if offset else "") + bits
        case Cast(operand, kind):
            return f"({name(kind)}){show(operand)}"
        case Unary(op, operand, kind):
            return f"{op}{show(operand)}:{name(kind)}"
        case Binary(op, left, right, kind) | Logic(op, left, right, kind):
            return f"({show(left)} {op} {show(right)}):{name(kind)}"
        case Choice(condition, yes, no, kind):
            return f"({show(condition)} ? {show(yes)} : {show(no)}):{name(kind)}"
        case Comma(first, second):
            return f"({show(first)}, {show(second)})"
        case Assign(target, value):
            return f"({show(target)} = {show(value)})"
        case Update(op, target, value, work, post):
            return f"({show(target)} {op}={name(work)} {show(value)}){'post' if post else ''}"
        case Call(function, arguments, kind):
            return f"{function}({', '.join(map(show, arguments))}):{name(kind)}"
        case Builtin(word, arguments, kind):
            return f"{word}({', '.join(map(show, arguments))}):{name(kind)}"
    return type(expr).__name__


FOUR_MHZ = Clock(4_000_000)


def analysed(text: str, dialect: str = "xc8", clock: Clock | None = FOUR_MHZ) -> Analyser:
    """Return the analysis of a program of one file."""
    reporter, options = Reporter(), Options(dialect)
    settings = PragmaSettings(options.device, reporter)
    blocks: list[AsmBlock] = []
    files = [driver.read_source(Source(text, "main.c"), options, reporter, blocks, 0)]
    for pragma in files[0][0].pragmas:
        settings.pragma(pragma)

    def library(name: str) -> tuple[driver.Preprocessed, driver.Rewritten]:
        raise AssertionError(name)

    result = analyse(files, dialect, reporter, blocks, settings, clock, library, float_type(dialect, None))
    assert reporter.errors == 0, reporter.ordered()
    return result


HEAD = """
unsigned char a, b, arr[5]; signed char s; int i, x2[3][4]; unsigned int u; long l;
unsigned long w; float f; bit t; unsigned char *p; int *q, *q2; const unsigned char *k; void *vp;
long big[100];
struct in { unsigned char x; int y; };
struct st { unsigned char c; int n; struct in in[2];
unsigned lo : 3; unsigned hi : 2; signed sg : 4; } o, *po, os[3];
union { int i; unsigned char c[2]; } un;
const unsigned char ten = 10; const int table[3] = {1, 2, -3}; const float half = 0.5;
const struct { unsigned w : 9; unsigned r : 7; signed m : 10; } wide[2] = {{300, 5, -2}, {1, 2, 3}};
const unsigned char spot = (unsigned char)&b, spots[2] = {7, (unsigned char)&b}; char *const nowhere = 0;
const int begun[3] = {5}; const unsigned char empty;
enum { RED, GREEN = 5, MIDDLE = 32767, NEXT, LARGE = 40000 }; enum { LOWEST = -32768 };
int g(char m, long n) { return m + n; } void h(void) { } int (*fp)(char, long);
volatile unsigned char v; unsigned char where @ 0x30;
int flags; bit nine @ &flags*8+9; bit eight @ &flags*8+8; bit last @ &flags*8+15;
__eeprom unsigned char ee; __eeprom int ew;
"""

ROWS: list[tuple[str, str]] = [
    # literals (ISO C 6.4.4.1 with ints of 16 bits)
    ("0", "0:s16"), ("32767", "32767:s16"), ("32768", "32768:s32"), ("65535", "65535:s32"),
    ("65536", "65536:s32"), ("0x7FFF", "32767:s16"), ("0x8000", "32768:u16"), ("0xFFFF", "65535:u16"),
    ("0x10000", "65536:s32"), ("0177777", "65535:u16"), ("0200000", "65536:s32"),
    ("2147483647", "2147483647:s32"), ("2147483648", "2147483648:u32"), ("0xFFFFFFFF", "4294967295:u32"),
    ("1u", "1:u16"), ("65535u", "65535:u16"), ("65536u", "65536:u32"), ("1L", "1:s32"), ("1UL", "1:u32"),
    ("1LU", "1:u32"), ("'A'", "65:s16"), ("'\\n'", "10:s16"), ("'\\x41'", "65:s16"), ("'\\101'", "65:s16"),
    ("'\\0'", "0:s16"), ("'\\''", "39:s16"), ("RED + 1", "1:s16"), ("GREEN", "5:s16"),
    ("MIDDLE", "32767:s16"), ("NEXT", "32768:u16"), ("LARGE", "40000:u16"), ("LOWEST", "-32768:s16"),
    ("ten", "10:u8"), ("table[2]", "-3:s16"), ("begun[0] + begun[2]", "5:s16"), ("empty", "0:u8"),
    ("spots[0]", "7:u8"),
    # an address is known only when the variables have their places
    ("spots[1]", "spots+1"), ("spot", "spot"), ("nowhere", "nowhere"), ("table[0] + ten", "11:s16"),
    # the arithmetic conversions
    ("a + b", "((s16)a + (s16)b):s16"), ("s * a", "((s16)s * (s16)a):s16"), ("i + a", "(i + (s16)a):s16"),
    ("i - u", "((u16)i - u):u16"), ("u / i", "(u / (u16)i):u16"), ("l + u", "(l + (s32)u):s32"),
    ("i % w", "((u32)i % w):u32"), ("l & w", "((u32)l & w):u32"), ("t | a", "((s16)t.0/1 | (s16)a):s16"),
    ("a << l", "((s16)a << l):s16"), ("l >> a", "(l >> (s16)a):s32"), ("i < 5", "(i < 5:s16):s16"),
    ("a == b", "((s16)a == (s16)b):s16"), ("l != i", "(l != (s32)i):s16"), ("-a", "-(s16)a:s16"),
    ("-u", "-u:u16"), ("~w", "~w:u32"), ("+s", "(s16)s"), ("!a", "!a:s16"), ("!l", "!l:s16"),
    ("a && l", "(a && l):s16"), ("a || 0", "(a || 0:s16):s16"), ("i ? a : l", "(i ? (s32)a : l):s32"),
    ("i ? a : b", "(i ? (s16)a : (s16)b):s16"), ("i ? p : 0", "(i ? p : 0:*u8):*u8"),
    ("i ? 0 : p", "(i ? 0:*u8 : p):*u8"), ("i ? p : k", "(i ? (*u8)p : k):*u8"),
    ("i ? k : p", "(i ? k : (*u8)p):*u8"), ("i ? h() : h()", "(i ? h():v : h():v):v"),
    ("i ? f : 1", "(i ? f : 4161536:f):f"), ("a, i", "(a, i)"),
    # constants
    ("2 + 3 * 4", "14:s16"), ("7 / 2", "3:s16"), ("-7 / 2", "-3:s16"), ("-7 % 2", "-1:s16"), ("~0", "-1:s16"),
    ("-0x8000", "32768:u16"), ("!5", "0:s16"), ("!0", "1:s16"), ("3 < 4", "1:s16"), ("3u > -1", "0:s16"),
    ("0 && i", "0:s16"), ("1 && 2", "1:s16"), ("1 && 0", "0:s16"), ("1 || i", "1:s16"), ("0 || 3", "1:s16"),
    ("0 || 0", "0:s16"), ("1 && i", "(1:s16 && i):s16"), ("i && 0", "(i && 0:s16):s16"),
    ("1 ? a : l", "(s32)a"), ("0 ? a : l", "l"), ("sizeof(int)", "2:u16"), ("sizeof l", "4:u16"),
    ("sizeof arr", "5:u16"), ("sizeof x2[0]", "8:u16"), ("sizeof(struct st)", "11:u16"),
    ("sizeof p", "1:u16"), ("sizeof k", "2:u16"), ("sizeof f", "3:u16"), ('sizeof "abc"', "4:u16"),
    ("(unsigned char)300", "44:u8"), ("(signed char)200", "-56:s8"), ("(long)a", "(s32)a"), ("(int)i", "i"),
    ("(void)i", "(v)i"), ("(char *)0x20", "32:*u8"), ("(char *)-1", "255:*u8"),
    ("(const char *)-1", "65535:*u8"), ("i + 0", "i"), ("i - 0", "i"), ("i | 0", "i"), ("i ^ 0", "i"),
    ("i << 0", "i"), ("i >> 0", "i"), ("i * 1", "i"), ("i / 1", "i"), ("i & 0", "(i & 0:s16):s16"),
    ("i * 0", "(i * 0:s16):s16"), ("i + 1", "(i + 1:s16):s16"), ("i % 1", "(i % 1:s16):s16"),
    ("0 + i", "(0:s16 + i):s16"), ("1 * i", "(1:s16 * i):s16"),
    # elements, members, pointers
    ("arr[0]", "arr"), ("arr[4]", "arr+4"), ("4[arr]", "arr+4"), ("*arr", "arr"), ("*(arr + 2)", "arr+2"),
    ("arr[i]", "arr[(u8)i]"), ("arr[a]", "arr[a]"), ("x2[1][2]", "x2+12"),
    ("x2[2][i]", "x2+16[((u8)i * 2:u8):u8]"), ("x2[i][3]", "x2+6[((u8)i * 8:u8):u8]"),
    ("x2[i][a]", "x2[(((u8)i * 8:u8):u8 + (a * 2:u8):u8):u8]"),
    ("big[i]", "big[((u16)i * 4:u16):u16]"), ("big[2]", "big+8"), ("o.c", "o"), ("o.n", "o+1"),
    ("o.in[1].y", "o+7"), ("o.in[i].y", "o+4[((u8)i * 3:u8):u8]"), ("o.lo", "o+9.0/3"), ("o.hi", "o+9.3/2"),
    ("os[2].n", "os+23"), ("po->n", "*po+1"), ("po->hi", "*po+9.3/2"), ("(*po).n", "*po+1"),
    ("po->in[1].x", "*((*struct in)po + 3:u8):*struct in+3"),
    ("po[2].n", "*po+23"), ("(&o)->n", "o+1"), ("(os + 1)->n", "os+12"), ("un.i", "un"), ("un.c[1]", "un+1"),
    ("wide[1].r", "2:u8"), ("wide[0].w", "(s16)(wide & 511:u16):u16"),
    ("wide[i].m", "(s16)(((wide+2[((u8)i * 4:u8):u8] & 1023:u16):u16 ^ 512:u16):u16 - 512:u16):u16"),
    ("a.3", "a.3/1"),
    ("(*q).9 = (*q).15", "(*q+1.1/1 = *q+1.7/1)"),
    ("i.9", "i+1.1/1"), ("p[3]", "*p+3"), ("q[3]", "*q+6"), ("q[i]", "*(q + ((u8)i * 2:u8):u8):*s16"),
    ("q[-1]", "*q+-2"), ("k[i]", "*(k + (u16)i):*u8"), ("*q", "*q"), ("q + 1", "(q + 2:u8):*s16"),
    ("1 + q", "(q + 2:u8):*s16"), ("q - 1", "(q - 2:u8):*s16"), ("q + i", "(q + ((u8)i * 2:u8):u8):*s16"),
    ("k + 1", "(k + 1:u16):*u8"),
    ("q - q2", "(((s16)(u8)q - (s16)(u8)q2):s16 / 2:s16):s16"),
    ("p - arr", "((s16)(u8)p - (s16)(u8)&arr:*u8):s16"),
    ("k - k", "((s16)(u16)k - (s16)(u16)k):s16"), ("q == q2", "(q == q2):s16"),
    ("p == k", "((*u8)p == k):s16"), ("k == p", "(k == (*u8)p):s16"), ("p == 0", "(p == 0:*u8):s16"),
    ("0 == p", "(0:*u8 == p):s16"), ("arr + 2", "&arr+2:*u8"), ("arr + i", "&arr[(u8)i]:*u8"),
    ("&arr[i] + a", "&arr[((u8)i + a):u8]:*u8"), ("&arr[1] - 1", "&arr:*u8"), ("x2[1] + 1", "&x2+10:*s16"),
    ("&a", "&a:*u8"), ("&o.n", "&o+1:*s16"), ("&po->n", "((*s16)po + 1:u8):*s16"), ("&po->c", "(*u8)po"),
    ("&*q", "(*s16)q"), ("&q[2]", "((*s16)q + 4:u8):*s16"), ("*(char *)&i", "i"),
    ("*(long *)&arr[1]", "arr+1"), ("*(unsigned char *)0x20", "*32:*u8"), ("&table[1]", "&table+2:*s16"),
    ("&ten", "&ten:*u8"),
    # assignments and counts
    ("a = i", "(a = (u8)i)"), ("l = a", "(l = (s32)a)"), ("a = 44", "(a = 44:u8)"),
    ("t = i", "(t.0/1 = (b1)i)"), ("a = b = i", "(a = (b = (u8)i))"), ("o.hi = i", "(o+9.3/2 = (u8)i)"),
    ("*q = a", "(*q = (s16)a)"), ("p = arr", "(p = &arr:*u8)"), ("p = 0", "(p = 0:*u8)"),
    ("vp = q", "(vp = (*v)q)"), ("o = os[1]", "(o = os+11)"), ("o = (struct st)os[1]", "(o = os+11)"),
    ("o = i ? os[1] : *po", "(o = (i ? os+11 : *po):struct st)"),
    ("a += b", "(a +=s16 (s16)b)"), ("a += l", "(a +=s32 l)"), ("i -= u", "(i -=u16 u)"),
    ("a <<= 2", "(a <<=s16 2:s16)"), ("w >>= a", "(w >>=u32 (s16)a)"), ("q += 1", "(q +=u8 2:u8)"),
    ("q -= i", "(q -=u8 ((u8)i * 2:u8):u8)"), ("k += 1", "(k +=u16 1:u16)"), ("++a", "(a +=s16 1:u8)"),
    ("--l", "(l -=s32 1:u8)"), ("a++", "(a +=s16 1:u8)post"), ("q--", "(q -=u8 2:u8)post"),
    ("po++", "(po +=u8 11:u8)post"), ("i = a++", "(i = (s16)(a +=s16 1:u8)post)"),
    ("i = ++a", "(i = (s16)(a +=s16 1:u8))"),
    # calls
    ("g(1, 2)", "g(1:u8, 2:s32):s16"), ("g(i, a)", "g((u8)i, (s32)a):s16"), ("h()", "h():v"),
    ("i = g(a, 5)", "(i = g(a, 5:s32):s16)"),
    ("fp(1, 2)", "__call1(1:u8, 2:s32, (u8)fp):s16"),
    ("(*fp)(a, l)", "__call1(a, l, (u8)fp):s16"),
    ("fp = g", "(fp = 1:*int(unsigned char, long))"),
    # floating point: 24 bits, 1.0 is 0x3F8000
    ("f + 1", "float_add(f, 4161536:f):f"),
    ("i * f", "float_multiply(float_from_integer(i):f, f):f"),
    ("f / l", "float_divide(f, float_from_integer(l):f):f"),
    ("f - a", "float_subtract(f, float_from_integer((u16)a):f):f"),
    ("f < 2", "((float_compare(f, 4194304:f):u8 & 1:u8):u8 != 0:u8):s16"),
    ("f <= 2", "((float_compare(f, 4194304:f):u8 & 3:u8):u8 != 0:u8):s16"),
    ("f > 2", "((float_compare(f, 4194304:f):u8 & 4:u8):u8 != 0:u8):s16"),
    ("f >= 2", "((float_compare(f, 4194304:f):u8 & 6:u8):u8 != 0:u8):s16"),
    ("f == 2", "((float_compare(f, 4194304:f):u8 & 2:u8):u8 != 0:u8):s16"),
    ("f != 2", "((float_compare(f, 4194304:f):u8 & 2:u8):u8 == 0:u8):s16"),
    ("f == 0", "(((u24)f & 8388607:u24):u24 == 0:u24):s16"),
    ("0 != f", "(((u24)f & 8388607:u24):u24 != 0:u24):s16"),
    ("!f", "!(((u24)f & 8388607:u24):u24 != 0:u24):s16:s16"),
    ("-f", "(f)((u24)f ^ 8388608:u24):u24"), ("+f", "f"),
    ("i = f", "(i = (s16)float_to_integer(f):s32)"),
    ("l = f", "(l = float_to_integer(f):s32)"),
    ("t = f", "(t.0/1 = (b1)(((u24)f & 8388607:u24):u24 != 0:u24):s16)"),
    ("f += i", "(f = float_add(f, float_from_integer(i):f):f)"),
    ("i += f", "(i = (s16)float_to_integer(float_add(float_from_integer(i):f, f):f):s32)"),
    ("++f", "(f = float_add(f, 4161536:f):f)"), ("1.0 + 1", "4194304:f"), ("1.0 < 2.0", "1:s16"),
    ("-1.0", "12550144:f"), ("(int)2.9", "2:s16"), ("(int)-2.9", "-2:s16"), ("!0.0", "1:s16"),
    ("half", "4128768:f"),
    # a bit at a fixed address, variables in the EEPROM
    ("nine = 1", "(flags+1.1/1 = 1:b1)"),
    ("eight = last", "(flags+1.0/1 = flags+1.7/1)"),
    ("a = ee", "(a = eeprom_read(0:u8):u8)"),
    ("i = ew", "(i = (s16)((u16)eeprom_read(1:u8):u8 | ((u16)eeprom_read(2:u8):u8 << 8:u8):u16):u16)"),
    # built-in functions of XC8
    ("NOP()", "instruction():v"), ("__delay_us(5)", "delay():v"), ("eeprom_read(i)", "eeprom_read((u8)i):u8"),
    ("eeprom_write(1, i)", "eeprom_write(1:u8, (u8)i):v"),
    ("ei()", "(v)(INTCON.7/1 = 1:b1)"), ("di()", "(v)(INTCON.7/1 = 0:b1)"), ("PORTB", "PORTB"),
    ("RB3 = 1", "(PORTB.3/1 = 1:b1)"), ("PORTBbits.RB3 = a", "(PORTB.3/1 = (b1)a)"),
    ("STATUSbits.RP", "STATUS.5/2"),
    ("OPTION_REGbits.PS = 7", "(OPTION_REG.0/3 = 7:u8)"),
]  # fmt: skip


C2C_HEAD = """
unsigned char a; signed char s; int i; signed int n; unsigned long l; bit t;
"""
C2C_ROWS = [
    # in C2C int and long have 16 bits and no sign
    ("a + 1", "((u16)a + 1:u16):u16"), ("s + s", "((s16)s + (s16)s):s16"), ("i + n", "(i + (u16)n):u16"),
    ("a + s", "((u16)a + (u16)s):u16"), ("l + i", "(l + i):u16"), ("-a", "-(u16)a:u16"),
    ("a < i", "((u16)a < i):s16"), ("!a", "!a:s16"), ("32767", "32767:s16"), ("32768", "32768:u16"),
    ("65535", "65535:u16"), ("65536", "65536:s32"), ("1u", "1:u16"), ("'A'", "65:s16"), ("sizeof i", "2:u16"),
    ("RB3", "3:s16"), ("a & RB3", "((u16)a & 3:u16):u16"), ("!RB3", "!PORTB.3/1:s16"),
    ("RB3 && t", "(PORTB.3/1 && t.0/1):s16"), ("RB3 = 1", "(PORTB.3/1 = 1:b1)"),
    ("RB3 ^= 1", "(PORTB.3/1 ^=u16 1:u16)"), ("a.RB3", "a.3/1"), ("a.7 = 1", "(a.7/1 = 1:b1)"),
    ("i.8", "i+1.0/1"), ("set_bit(a, 3)", "(v)(a.3/1 = 1:b1)"),
    ("clear_bit(PORTB, RB5)", "(v)(PORTB.5/1 = 0:b1)"),
    ("toggle_bit(a, 0)", "(v)(a.0/1 ^=u8 1:u8)"), ("test_bit(i, 12)", "i+1.4/1"),
    ("set_bit(a, i)", "(v)(a |=u8 (1:u8 << i):u8)"),
    ("clear_bit(a, i)", "(v)(a &=u8 ~(1:u8 << i):u8:u8)"),
    ("toggle_bit(i, a)", "(v)(i ^=u16 (1:u16 << a):u16)"),
    ("test_bit(a, i)", "((a & (1:u8 << i):u8):u8 != 0:u8):s16"),
    ("set_tris_a(a)", "(v)(TRISA = a)"), ("set_tris_b(5)", "(v)(TRISB = 5:u8)"),
    ("output_port_a(i)", "(v)(PORTA = (u8)i)"), ("output_port_b(5)", "(v)(PORTB = 5:u8)"),
    ("set_option(5)", "(v)(OPTION_REG = 5:u8)"), ("input_port_a()", "PORTA"), ("input_port_b()", "PORTB"),
    ("output_high_port_a(2)", "(v)(PORTA.2/1 = 1:b1)"),
    ("output_low_port_b(2)", "(v)(PORTB.2/1 = 0:b1)"),
    ("output_high_port_b(7)", "(v)(PORTB.7/1 = 1:b1)"),
    ("output_low_port_a(0)", "(v)(PORTA.0/1 = 0:b1)"),
    ("input_pin_port_a(1)", "PORTA.1/1"), ("input_pin_port_b(1)", "PORTB.1/1"),
    ("enable_interrupt(GIE)", "(v)(INTCON.7/1 = 1:b1)"),
    ("disable_interrupt(T0IE)", "(v)(INTCON.5/1 = 0:b1)"),
    ("nop()", "instruction():v"), ("delay_ms(5)", "delay():v"), ("delay_us(i)", "delay_variable((u8)i):v"),
    ("reset()", "restart():v"), ("eeprom_read(5)", "eeprom_read(5:u8):u8"),
]  # fmt: skip


@cache
def trees(dialect: str) -> dict[str, str]:
    """Return the tree of the expression in each line of one program."""
    head, rows = {"xc8": (HEAD, ROWS), "c2c": (C2C_HEAD, C2C_ROWS)}[dialect]
    lines = "".join(f"{expr};\n" for expr, _ in rows)
    text = f"{head}void run(void) {{\n{lines}}}\nvoid main(void) {{ run(); }}\n"
    body = analysed(text, dialect).program.functions["run"].body
    assert body is not None
    shown = [show(statement.expr) if isinstance(statement, ExprStmt) else "?" for statement in body.body]
    return dict(zip([expr for expr, _ in rows], shown, strict=True))


@pytest.mark.parametrize(("expr", "expected"), ROWS)
def test_the_tree_of_an_expression(expr: str, expected: str) -> None:
    assert trees("xc8")[expr] == expected


@pytest.mark.parametrize(("expr", "expected"), C2C_ROWS)
def test_the_tree_of_an_expression_of_c2c(expr: str, expected: str) -> None:
    assert trees("c2c")[expr] == expected


def test_what_a_built_in_function_holds_beside_its_arguments() -> None:
    """At 4 MHz a cycle is 1 µs. The watchdog takes 7 ms at least (DS35007 section 9, parameter 31)."""
    text = (
        "const float f = 2.0; void run(void) { __delay_us(f); "
        "__delay_us(5); __delay_ms(2); _delay(7); __delaywdt_us(9); _delaywdt(3); "
        "NOP(); CLRWDT();"
        " SLEEP(); __nop(); }\nvoid main(void) { run(); }"
    )
    assert data(text, "xc8") == [2, 5, 2000, 7, (9, 7000), (3, 7000), "NOP", "CLRWDT", "SLEEP", "NOP"]
    text = (
        "#pragma RS232_TXPORT PORTB\n#pragma RS232_TXPIN 2\n#pragma RS232_RXPORT PORTA\n#pragma "
        "RS232_RXPIN 0x1\n"
        "#pragma RS232_BAUD 9600\n#pragma TRUE_RS232 {}\nchar a; void run(void) {{ delay_us(5); "
        "delay_10us(5); "
        "delay_100us(5); delay_ms(5); delay_s(5); delay_ms(a); clear_wdt(); putchar('x'); getchar(); }}\n"
        "void main(void) {{ run(); }}"
    )
    times = [5, 50, 500, 5000, 5_000_000, 1000, "CLRWDT"]
    for true, inverted in ((1, False), (0, True)):
        # 1 000 000 / 9600 = 104.2 cycles
        assert data(text.format(true), "c2c") == [*times, (6, 2, 104, inverted), (5, 1, 104, inverted)]


@pytest.mark.parametrize(
    ("clock", "shortest"), [(Clock(8_000_000), 14_000), (Clock(1_000_000), 1750), (None, 7000)]
)
def test_a_long_delay_clears_the_watchdog_at_each_clock(clock: Clock | None, shortest: int) -> None:
    """7 ms in cycles of four periods of the clock; one that is not known counts as 4 MHz."""
    text = "void run(void) { _delaywdt(3); }\nvoid main(void) { run(); }"
    assert data(text, "xc8", clock) == [(3, shortest)]


def data(text: str, dialect: str, clock: Clock | None = FOUR_MHZ) -> list[object]:
    body = analysed(text, dialect, clock).program.functions["run"].body
    assert body is not None
    return [
        statement.expr.data
        for statement in body.body
        if isinstance(statement, ExprStmt) and isinstance(statement.expr, Builtin)
    ]
