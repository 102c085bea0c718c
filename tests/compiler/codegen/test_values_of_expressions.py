"""What expressions and loops leave in a variable, worked out by hand from the values in `START`."""

from __future__ import annotations

from servogen.compiler import Options, Source, compile_sources
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine
from servogen.units import Clock

HEAD = """
#include <xc.h>
#include <stdbool.h>
struct pair { unsigned char first, second; };
struct fields { unsigned lo : 3; signed mid : 3; unsigned hi : 2; } f, *pf, many[2];
struct ends { unsigned low : 1; unsigned middle : 6; unsigned high : 1; } *pe;
unsigned char a, b, n, array[4], *p;
signed char s;
unsigned int u, words[2];
int i;
long l;
bool yes;
__bit flag;
struct pair r, *q;
volatile unsigned char k;
unsigned char get(unsigned char x) { return x + 1; }
struct pair make(unsigned char x) { struct pair z; z.first = x; z.second = x + 1; return z; }
unsigned long gather(signed char x, unsigned int y) { l += x; return 0; }
int third(char x, int y, int z) { i = z; return 0; }
int minus(int x, int y) { return x - y; }
void act(void) { n += 7; }
void pass(void) { return act(); }
"""
START = """a = 0x5A; b = 15; n = 0; s = -3; u = 0x1234; i = -300; l = 70000; yes = 0; flag = 0; k = 200;
array[0] = 10; array[1] = 20; array[2] = 30; array[3] = 40; p = &array[1]; r.first = 3; r.second = 4; q = &r;
words[0] = 0x0102; words[1] = 0x0304; f.lo = 5; f.mid = -2; f.hi = 1; pf = &many[1];
pf->lo = 2; pf->hi = 3; pe = (struct ends *)&array[0];"""

VALUES = {
    # the low byte of 0x1234, its high byte, bytes exchanged in place
    "n = u;": 0x34, "n = u >> 8;": 0x12, "u = u << 8 | u >> 8; n = u;": 0x12,
    "u = u << 8 | u >> 8; n = u >> 8;": 0x34, "u = (u >> 8) + u; n = u;": 0x46,
    "u = u - (u << 8); n = u >> 8;": 0xDE, "l = l >> 8; n = l;": 0x11, "l = l << 8 | a; n = l >> 16;": 0x11,
    # signed quotients, extended
    "l = i / 2; n = l >> 8;": 0xFF, "l = i / 2; n = l;": 0x6A, "l = s / 2; n = l >> 16;": 0xFF,
    "i = s / 2; n = i;": 0xFF, "i = s % 2; n = i;": 0xFF, "l = i / 7; n = l;": 0xD6,
    "l = i % 7; n = l >> 24;": 0xFF, "l = s * 5; n = l;": 0xF1, "i = s >> 1; n = i >> 8;": 0xFF,
    # an unsigned int is divided by -3 as an unsigned int, 65533
    "u /= s; n = u + 1;": 1, "u %= s; n = u;": 0x34, "u += s; n = u;": 0x31,
    # nothing is left of a product, but its operands are evaluated
    "a = n++ * 0; n += a;": 1, "a = b++ * 256; n = a + b;": 16,
    # comparisons of pointers and with constants on the left
    "n = p > (unsigned char *)3;": 1,
    "n = p >= array; n += p > array; n += p == array + 1; n += p != &array[1];": 3,
    "n = (0x0A & a) == 0x0A; n += (0x05 & a) == 0x05;": 1,
    "n = (a & 0x0A) == 0x0B;": 0,
    # bit 8 of a negative char is its sign; of an unsigned one it is 0
    "n = (s & 0x100) != 0; n += (a & 0x100) != 0;": 1,
    "if (s & 0x8000) n = 2; if (a & 0x8000) n = 3;": 2,
    "if (array) n++; if (&a) n++; if ((unsigned char)p) n++;": 3,
    "if ((bool)u) n++; if ((unsigned char)u) n++; if ((unsigned char)(u << 8)) n = 9;": 2,
    "if (++yes) n++; if (++yes) n++; if (yes == 1) n++;": 3,
    "TRISB = 1; if (--TRISB) n = 1; else n = 2; TRISB = 255;": 2,
    "flag = a; n = flag; flag = b; n += flag;": 1,
    "flag = u == 0x1234; n = flag; flag = !flag; n += 2 * flag;": 1,
    "flag = 1; if (flag == 0) n = 1; if (flag) n += 2; flag ^= 1; if (!flag) n += 4;": 6,
    # counted before or behind the test
    "if (b++) n = b;": 16, "if (n++) n = 9;": 1, "if (!n++) n += 4;": 5, "if (n--) n = 7;": 255,
    "if (!b--) n = 9; else n = b;": 14, "while (b--) n++; n += b;": 14,
    "if (++n) n += 2; if (--n) n += 2; if (!--b) n = 9;": 4,
    "if (k--) n = k; if (!++k) n = 9;": 199,
    # an address of bank 1 is greater than any of RAM
    "p = (unsigned char *)0x86; n = p > array; n += array < p; n += p >= array; n += array >= p;": 3,
    # assignments as values, with effects in their targets
    "array[get(1)] = 9; n = array[2];": 9,
    "words[get(0)] = u; n = words[1] >> 8;": 0x12,
    "words[n] = i; n = words[0];": 0xD4, "words[n] = i; n = words[0] >> 8;": 0xFE,
    "words[n + 1] += 0x100; n = words[1] >> 8;": 4,
    "words[n]++; words[n] ^= 0xFF00; n = words[0] >> 8;": 0xFE,
    "l = words[n]; n = l >> 8;": 1, "i = words[n] - words[1]; n = i >> 8;": 0xFD,
    "words[n] = words[1]; n = words[0] + (words[0] >> 8);": 7,
    "u = get(a) << 8; n = u >> 8;": 0x5B, "i = -get(1); n = i >> 8;": 0xFF, "l = -l; n = l >> 16;": 0xFE,
    "l = ~l; n = l >> 8;": 0xEE, "l += i; n = l; n ^= l >> 16;": 0x45, "l -= s; n = l; n ^= l >> 8;": 0x62,
    "l *= 3; n = l >> 16;": 3, "l /= 7; n = l; n += l >> 8;": 0x37, "l %= 1000; n = l;": 0,
    # what is compared in vain is evaluated all the same
    "if (n++ == 300) n = 9;": 1, "if (n++ != 300) n += 2;": 3,
    "if (n++ > 300) n = 9; if (n++ >= 0) n += 4;": 6,
    "n = (array[0] = 7) + 1;": 8, "n = (u = 0x1FF) >> 8;": 1, "n = (f.lo = 9);": 1, "n = (f.mid = 5);": 0xFD,
    "f.mid = 3; n = f.mid;": 3, "n = f.mid;": 0xFE, "n = f.lo + f.hi;": 6, "f.lo += 4; n = f.lo;": 1,
    # in more bytes than one
    "u = 0xFFFF; u = f.lo; n = u >> 8;": 0, "i = f.mid; n = i >> 8;": 0xFF,
    "l = -1; l = f.lo; n = l >> 8; n |= l >> 16; n |= l >> 24; n += l;": 5,
    "l = f.mid; n = l >> 24;": 0xFF,
    "u = 0xFFFF; u = pf->hi; n = u >> 8; n += u;": 3,
    "i = many[1].mid = 3; n = i >> 8; n += i;": 3,
    "u = 0xFFFF; u = yes; n = u >> 8; u = flag; n += u >> 8;": 0,
    "u = 0x1234; u = eeprom_read(1); n = u >> 8; n += u;": 0xFF,
    "f.hi = 3; n = f.lo; n += f.hi;": 8, "pf->lo = 7; n = pf->lo + pf->hi;": 10,
    "pf->hi = b; n = pf->hi; n += many[1].lo;": 5,
    # a call's result is an argument of the same function: those beside it leave it alone
    "gather(gather(0, 0), 1); n = l;": 0x70, "gather(gather(0, 0), 0x0505); n = l;": 0x70,
    "third(0, 1, third(0, 0, 0)); n = i;": 0,
    "a = 3; gather(a > 2 ? gather(0, 0) : a, a > 2 ? 0x0505 : 1); n = l;": 0x70,
    "n = minus(9, minus(5, 3));": 7, "n = minus(minus(9, 3), minus(5, 3));": 4,
    # an address in more bytes than it has
    "u = 0xFFFF; u = (unsigned int)&array[b & 3]; n = u >> 8;": 0,
    "l = -1; l = (unsigned int)(array + (b & 3)); n = l >> 8;": 0,
    # one bit through a pointer is the lowest bit of what is assigned; array[0] is 0b1010
    "a = 2; pe->low = a; n = array[0];": 0b1010, "a = 1; pe->low = a; n = array[0];": 0b1011,
    "a = 1; pe->high = a; n = array[0];": 0b1000_1010,
    "pe->high = b >> 1; pe->low = a >> 2; n = array[0];": 0b1000_1010,
    "many[n].hi = 2; n = many[0].hi;": 2,
    "many[get(0)].mid = -1; n = many[1].mid;": 0xFF,
    "r = make(20); n = r.first + r.second;": 41, "*q = make(30); n = r.second;": 31,
    "n = make(40).second;": 41, "*p = get(*p); n = array[1];": 21,
    "*p++ = 1; *p-- = 2; n = array[1] + 10 * array[2]; n += p == &array[1];": 22,
    "*p += b; *p ^= 1; *p -= 2; n = *p;": 32, "p[1] <<= 1; n = array[2];": 60, "n = *p++ + *p;": 50,
    "n = p[-1] + 2[p];": 50,
    "a = ((void)b, 4); n = a; (void)a++; n += a;": 9,
    # elements and bit-fields behind an address, changed in place
    "array[n + 2] = array[n + 1] + 5; n = array[2];": 25,
    "array[b & 1] += 255; n = array[1]; array[b & 1] -= 255; n += array[1];": 39,
    "array[b & 1] ^= 1; n = array[1]; array[b & 1] |= 3; n ^= array[1]; array[b & 1] &= 1; n ^= array[1];": 3,
    "array[b & 1] += array[b & 2]; array[b & 1] -= array[0]; n = array[1];": 40,
    "many[n + 1].lo = b; n = many[1].lo + many[1].hi;": 10,
    "pf->mid = s; n = pf->mid; n ^= pf->lo; n += pf->hi;": 2,
    "pe->low ^= 1; pe->high ^= 1; n = array[0];": 0b1000_1011,
    "flag = 1; flag ^= 0; n = flag; flag ^= 1; n += flag; flag ^= 1; n += 2 * flag;": 3,
    "n = b + (bool)(u << 8); n += (bool)s * 2;": 18,
    # values in more bytes than they have
    "l = a ? i : 1; n = l >> 24; u = a ? s : b; n &= u >> 8;": 0xFF,
    "l = i++; n = l >> 24; l = --s; n &= l >> 8;": 0xFF,
    "u = b--; n = u + b; u = k++; n += u - k;": 28,
    # expressions that are statements
    "b && n++; a || n++; !a || (n += 2); !b && (n += 4);": 3,
    "a ? n++ : b++; !a ? (n += 4) : (n += 2); n += b;": 18,
    "array[n++]; &array[n++]; -(n++); ~n++; !n++; (void)(n++ + b++); (n++, b++); n += b;": 24,
    "(void)*p++; n = *p;": 30, "pass(); pass(); n++;": 15, "n = k > 199 ? get(k) : 0;": 201,
    "n = a > b ? s < 0 ? 1 : 2 : 3;": 1,
    "n = !a + !!b + (a && 0) + (0 || b) + (a ? 4 : 0);": 6,
    "n = -s; n += ~s; n += -(-b);": 20, "n = a * b;": 0x46, "u = a * b; n = u >> 8;": 0x05,
    "n = a / 7 + a % 7;": 18,
    "n = a << 1; n += a >> 3; n += 1 << 4;": 0xCF,
    "n = a << (b - 12); n += a >> (b - 13);": 0xE6,
    "i = i >> (b - 13); n = i;": 0xB5,
    "a *= 3; b /= 4; s %= 2; n = a + b + s;": 0x10,
    "a <<= 2; b >>= 1; u >>= 5; n = a ^ b ^ u;": 0xFE,
    "s >>= 1; n = s; s <<= 3; n += s;": 0xEE,
    # loops and the counters that they leave
    "int z; for (z = -5; z < 5; z++) n += z;": 0xFB,
    "unsigned char z; for (z = 0; z < 10; z += 3) n += z;": 18,
    "for (u = 300; (unsigned char)u < 50; u++) n++;": 6,
    "for (i = 0; (unsigned char)i < 5; i++) n += i;": 10,
    "unsigned char z; for (z = 250; z; z++) n++;": 6,
    # a counter that is read behind its loop, also in front of another loop, counts up
    "unsigned char z; for (z = 0; z < 20; z++) n++; n = z; while (b) b--;": 20,
    "unsigned char z; for (z = 0; z < 20; z++) n++; for (; b; b--) n = z;": 20,
    "unsigned char z; for (z = 0; z < 255; z++) n++;": 255,
    "int z; for (z = 0; z < 257; z++) n++;": 1,
    "int z; for (z = 0; z <= 511; z++) n++; n += z >> 8;": 2,
    "unsigned int z; for (z = 1; z != 300; z++) n++; n += z;": 0x57,
    "unsigned int z; for (z = 0; z < 513; z++) a++; n = a;": 0x5B,
    "unsigned char z, y; for (z = 0; z < 4; z++) for (y = z; y < 4; y++) n++;": 10,
    "unsigned char z; for (z = 5; z < 5; z++) n++; for (z = 5; z != 5; z++) n++;": 0,
    "signed char z; for (z = -128; z < 127; z++) n++;": 255,
    "int z; u = 0; for (z = 0; z < 256; z++) u++; n = u >> 8;": 1,
    "long z; for (z = 0; z < 300; z++) n++;": 44,
    "unsigned char z; for (z = 3; z < 8; z++) n += z;": 25,
    "int z; for (z = 0; z < 255; z++) n += z;": 0x81,
    "int z; for (z = 0; z < 256; z++) n += z;": 0x80,
    "int z; u = 0xFFFF; for (z = 0; z < 20; z++) u = z; n = u >> 8; n += u + z;": 39,
    "int z; for (z = 0; z < 20; z++) third(0, 0, z); n = i; n += i >> 8;": 19,
    # what is converted, counted, changed or read elsewhere
    "int z; for (z = -3; (unsigned char)z < 5; z++) n++;": 0,
    "unsigned char z, y = 0; for (z = 0; z < 5; y++) { n++; if (y == 9) break; }": 10,
    "unsigned char z; for (z = 0; z < 20; z++) { n++; z++; }": 10,
    "unsigned char z, *y = &z; for (z = 0; z < 9; z++) { *y += 2; n++; }": 3,
    "struct pair z; for (z.first = 0; z.first < 20; z.first++) n++; n += z.first;": 40,
    "unsigned char z; z = 5; for (; b; b--) { n += z; for (z = 0; z < 3; z++) a++; }": 47,
    # entered in the middle
    "unsigned char z; z = 3; goto in; for (z = 0; z < 5; z++) { in: n++; }": 2,
    "unsigned char z = 7; switch (b - 1) { case 9: for (z = 0; z < 9; z++) { case 14: n++; } }": 2,
    "unsigned char z; for (z = 0; z < 9; z++) switch (z) { case 3: n += 5; break; default: n++; }": 13,
    "unsigned char z; for (z = 0; z < 8; z++) { if (z == 2) continue; if (z == 6) break; n += z; }": 13,
    "unsigned char z = 5; while (z--) n += z;": 10,
    # a test is left out at first only where the statement before it decides it
    "for (a = 0; a; a--) n++; for (a = 3; a; a--) n++; for (a = 0; a > 3; a++) n++;": 3,
    "b = 3; while (a < 5) { n = 9; break; } a = 3; while (b > 3) { n = 9; break; }": 0,
    "r.first = 3; while (r.second == 3) { n = 9; break; } f.lo = 3; while (f.hi == 3) { n = 8; break; }": 0,
    "u = 300; while ((unsigned char)u > 100) { n = 9; break; } u = 0; while (u == 300) { n = 8; break; }": 0,
    "array[n] = 3; while (array[b & 1] == 3) { n = 9; break; } k = 3; while (k == 4) { n = 8; break; }": 0,
    "unsigned char z = 5; do n += z; while (--z); n += z;": 15,
    "switch (u) { case 0x34: n = 1; break; case 0x1234: n = 2; case 7: n += 3; break; default: n = 9; }": 5,
    "switch (s) { case 253: n = 1; break; case -3: n = 2; break; }": 2,
    "switch (b) { case 1: n = 1; default: n += 2; case 3: n += 4; }": 6,
    "switch (i) { case -300: n = 1; break; case 300: n = 2; }": 1,
    "switch (n++) { case 300: n = 9; }": 1,
    "switch (n++) { case 300: n = 9; break; default: n += 2; }": 3,
    "goto there; n = 9; there: n++;": 1,
}  # fmt: skip
PER_PROGRAM = 24


def left(bodies: list[str], level: str) -> dict[str, int]:
    """The value of n behind each body."""
    found = {}
    for first in range(0, len(bodies), PER_PROGRAM):
        some = bodies[first : first + PER_PROGRAM]
        results = "".join(f"unsigned char r{at};\n" for at in range(len(some)))
        functions = "".join(f"void f{at}(void) {{ {body} }}\n" for at, body in enumerate(some))
        calls = " ".join(f"start(); f{at}(); r{at} = n;" for at in range(len(some)))
        text = f"{HEAD}{results}{functions}void start(void) {{ {START} }}\n"
        text += f"void main(void) {{ {calls} while (1); }}"
        options = Options(dialect="xc8", clock_hz=4_000_000, optimise=level)
        made = compile_sources([Source(text, "main.c")], options)
        machine = Machine(made.image, Clock(4_000_000))
        machine.run(120_000)
        where = {name: address for address, name, _ in made.listing.variables}
        ram = machine.state().ram
        found |= {body: ram[where[f"r{at}"] - RAM_FIRST] for at, body in enumerate(some)}
    return found


def test_what_a_statement_leaves() -> None:
    found = left(list(VALUES), "speed")
    assert found.keys() == VALUES.keys()
    assert {body: value for body, value in found.items() if value != VALUES[body]} == {}
