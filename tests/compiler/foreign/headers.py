"""The headers that the runner gives to a suite's programs, and the main that runs them.

Only what stands here is provided; a program that needs more of the C library is refused by the compiler.
The memory at FAILED and DONE holds the result: how a program ended, and that it ended.
"""

from __future__ import annotations

import re

FAILED, DONE = 0x4E, 0x4F
FINISHED = 0xA5
ABORTED = 0xFF
"""What `abort` leaves as the exit status."""

_RESULT = f"""
volatile unsigned char suite_failed __at(0x{FAILED:X});
volatile unsigned char suite_done __at(0x{DONE:X});
"""
_TESTFWK = """
#define NO_VARARGS
#define __data
#define __idata
#define __xdata
#define __pdata
#define __near
#define __far
#define __reentrant
#define __smallc
#define __z88dk_fastcall
#define __z88dk_callee
#define _AUTOMEM
#define _STATMEM
#define ASSERT(condition) ((void)((condition) || (suite_failed = 1)))
#define ASSERTFALSE(condition) ASSERT(!(condition))
#define FAIL() ((void)(suite_failed = 1))
#define FAILM(message) FAIL()
#define LOG(arguments)
#define UNUSED(value) if (value) { }
#define __prints(text)
#define __printd(number)
"""
_STDLIB = f"""
#include <stddef.h>
#define EXIT_SUCCESS 0
#define EXIT_FAILURE 1
void exit(int status) {{ suite_failed = status; suite_done = 0x{FINISHED:X}; while (1); }}
void abort(void) {{ suite_failed = 0x{ABORTED:X}; suite_done = 0x{FINISHED:X}; while (1); }}
int abs(int value) {{ return value < 0 ? -value : value; }}
"""
_ASSERT = "#define assert(condition) ((void)((condition) || (abort(), 0)))\n"
_STDIO = """
#include <stddef.h>
int putchar(int character) { PORTB = character; PORTA = 1; PORTA = 0; return character; }
int puts(const char *text) { while (*text) putchar(*text++); putchar('\\n'); return 0; }
"""
_STRING = """
#include <stddef.h>
size_t strlen(const char *text) { size_t count = 0; while (*text++) count++; return count; }
int strcmp(const char *left, const char *right) {
    while (*left && *left == *right) { left++; right++; }
    return (unsigned char)*left - (unsigned char)*right;
}
int strncmp(const char *left, const char *right, size_t count) {
    while (count && *left && *left == *right) { left++; right++; count--; }
    return count ? (unsigned char)*left - (unsigned char)*right : 0;
}
char *strcpy(char *to, const char *from) { char *at = to; while ((*at++ = *from++)); return to; }
char *strcat(char *to, const char *from) { char *at = to; while (*at) at++; strcpy(at, from); return to; }
void *memcpy(void *to, const void *from, size_t count) {
    char *at = to;
    const char *source = from;
    while (count--) *at++ = *source++;
    return to;
}
void *memset(void *to, int value, size_t count) {
    char *at = to;
    while (count--) *at++ = value;
    return to;
}
int memcmp(const void *left, const void *right, size_t count) {
    const unsigned char *one = left, *other = right;
    for (; count; count--, one++, other++)
        if (*one != *other) return *one - *other;
    return 0;
}
const char *strchr(const char *text, int character) {
    while (*text != (char)character) { if (!*text) return 0; text++; }
    return text;
}
"""

HEADERS = {
    "testfwk.h": _TESTFWK,
    "assert.h": _ASSERT,
    "stdlib.h": _STDLIB,
    "stdio.h": _STDIO,
    "string.h": _STRING,
    "sdcc-lib.h": "",
}
_NEEDS = {"assert.h": "stdlib.h"}


_CHIP = {"sdcc": "#include <pic14/pic16f84a.h>\n", "xc8": "#include <xc.h>\n", "c2c": ""}


def prelude(text: str, dialect: str = "sdcc") -> str:
    """Return what stands before a program: where its result goes, and what the headers that it names hold.

    The compiler has headers of some of these names, which declare no functions and come before any other.
    """
    names = {name for name in HEADERS if re.search(rf'#\s*include\s*[<"]{re.escape(name)}[>"]', text)}
    if re.search(r"\b(abort|exit)\s*\(", text):  # older C calls them without a declaration
        names.add("stdlib.h")
    names |= {_NEEDS[name] for name in names if name in _NEEDS}
    held = "".join(HEADERS[name] for name in sorted(names, reverse=True))
    return f"{_CHIP[dialect]}{_RESULT}{held}"


def harness(calls: str) -> str:
    """Return the main that makes `calls` and says that it came back from them."""
    return f"""
#undef main
void main(void) {{
    PORTA = 0;
    TRISA = 0;
    TRISB = 0;
    suite_failed = 0;
    suite_done = 0;
    {calls}
    suite_done = 0x{FINISHED:X};
    while (1);
}}
"""
