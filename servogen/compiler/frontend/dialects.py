"""The three dialects as data: type names, predefined macros, headers and names of the chip.

Source of the names: PIC16F84A DS35007 table 2-1 through `pic.device`; the spellings that XC8's headers,
BoostC's and SDCC's add to them are listed here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from servogen.compiler.ast.types import (
    BIT,
    BOOL,
    C2C_INT,
    C2C_SIGNED,
    S8,
    S16,
    S24,
    S32,
    U8,
    U16,
    U24,
    U32,
    CType,
    FloatType,
    IntType,
)
from servogen.pic.device import CONFIG_ADDRESS, Device, Register, register_bits, registers

C2C, XC8, SDCC = "c2c", "xc8", "sdcc"
DIALECTS = (C2C, XC8, SDCC)
NAMES: Mapping[str, str] = {C2C: "C2C", XC8: "XC8", SDCC: "SDCC"}
"""What each is called in messages."""

BUILTIN_TYPES: Mapping[str, CType] = {"bit": BIT, "__bit": BIT, "bool": BOOL, "_Bool": BOOL}
"""Type names that need no header."""

STDINT: Mapping[str, CType] = {
    "int8_t": S8,
    "uint8_t": U8,
    "int16_t": S16,
    "uint16_t": U16,
    "int24_t": S24,
    "uint24_t": U24,
    "int32_t": S32,
    "uint32_t": U32,
}
_STDINT_MORE: Mapping[str, CType] = {
    **{f"int_least{bits}_t": kind for bits, kind in ((8, S8), (16, S16), (32, S32))},
    **{f"uint_least{bits}_t": kind for bits, kind in ((8, U8), (16, U16), (32, U32))},
    **{f"int_fast{bits}_t": kind for bits, kind in ((8, S8), (16, S16), (32, S32))},
    **{f"uint_fast{bits}_t": kind for bits, kind in ((8, U8), (16, U16), (32, U32))},
    "__int24": S24,
    "__uint24": U24,
    "intmax_t": S32,
    "uintmax_t": U32,
    "intptr_t": S16,
    "uintptr_t": U16,
    "size_t": U16,
    "ptrdiff_t": S16,
}


WIDE_TYPES = frozenset(["int64_t", "uint64_t", "int_least64_t", "uint_least64_t"])
"""Types of <stdint.h> that this compiler does not have."""


@cache
def type_names() -> frozenset[str]:
    """Return every name that the parser must take for a type."""
    fields = {f"{name}bits_t" for name in registers()}
    return frozenset(named_types()) | fields | WIDE_TYPES


@cache
def named_types() -> Mapping[str, CType]:
    """Return every predefined type name that a header or the compiler provides."""
    return {**BUILTIN_TYPES, **STDINT, **_STDINT_MORE}


_SPELLINGS: Mapping[tuple[str, ...], tuple[IntType, IntType]] = {
    # sorted words without signed and unsigned: (signed, unsigned)
    ("char",): (S8, U8),
    ("short",): (S16, U16),
    ("int", "short"): (S16, U16),
    ("int",): (S16, U16),
    (): (S16, U16),
    ("long", "short"): (S24, U24),
    ("int", "long", "short"): (S24, U24),
    ("long",): (S32, U32),
    ("int", "long"): (S32, U32),
}
_SPELLINGS_C2C: Mapping[tuple[str, ...], tuple[IntType, IntType]] = {
    **_SPELLINGS,
    **dict.fromkeys(
        (("short",), ("int", "short"), ("int",), (), ("long",), ("int", "long")), (C2C_SIGNED, C2C_INT)
    ),
}


def int_type(words: tuple[str, ...], dialect: str) -> IntType | None:
    """Return the type of `unsigned short long` and the like; None if the words do not form a type."""
    if words == ("_Bool",):
        return BOOL
    rest = list(words)
    signs = [word for word in rest if word in ("signed", "unsigned")]
    base = tuple(sorted(word for word in rest if word not in ("signed", "unsigned")))
    table = _SPELLINGS_C2C if dialect == C2C else _SPELLINGS
    if len(signs) > 1 or base not in table or (not base and not signs):
        return None
    signed, unsigned = table[base]
    if signs:
        return signed if signs[0] == "signed" else unsigned
    return unsigned if base == ("char",) or (dialect == C2C and signed.bytes == 2) else signed


_STDINT_LIMITS = """
#define INT8_MIN (-128)
#define INT8_MAX 127
#define UINT8_MAX 255
#define INT16_MIN (-32767-1)
#define INT16_MAX 32767
#define UINT16_MAX 65535U
#define INT32_MIN (-2147483647L-1)
#define INT32_MAX 2147483647L
#define UINT32_MAX 4294967295UL
#define INT8_C(v) v
#define UINT8_C(v) v
#define INT16_C(v) v
#define UINT16_C(v) v##U
#define INT32_C(v) v##L
#define UINT32_C(v) v##UL
"""
_LIMITS = """
#define CHAR_BIT 8
#define SCHAR_MIN (-128)
#define SCHAR_MAX 127
#define UCHAR_MAX 255
#define CHAR_MIN 0
#define CHAR_MAX 255
#define SHRT_MIN (-32767-1)
#define SHRT_MAX 32767
#define USHRT_MAX 65535U
#define INT_MIN (-32767-1)
#define INT_MAX 32767
#define UINT_MAX 65535U
#define LONG_MIN (-2147483647L-1)
#define LONG_MAX 2147483647L
#define ULONG_MAX 4294967295UL
"""
_INTTYPES = _STDINT_LIMITS + "".join(
    f'#define PRI{kind}{bits} "{size}{kind}"\n'
    for kind in "diuxXo"
    for bits, size in ((8, "hh"), (16, ""), (32, "l"))
)
_STDBOOL = "#define true 1\n#define false 0\n#define __bool_true_false_are_defined 1\n"
_STDDEF = "#define NULL 0\n#define offsetof(type, member) ((size_t)&((type *)0)->member)\n"

_CONFIG_NAMES = {
    # legacy XC8 and Hi-Tech masks for __CONFIG(): DS35007 register 6-1
    "FOSC_LP": 0x3FFC,
    "FOSC_XT": 0x3FFD,
    "FOSC_HS": 0x3FFE,
    "FOSC_EXTRC": 0x3FFF,
    "WDTE_ON": 0x3FFF,
    "WDTE_OFF": 0x3FFB,
    "PWRTE_ON": 0x3FF7,
    "PWRTE_OFF": 0x3FFF,
    "CP_OFF": 0x3FFF,
    "CP_ON": 0x000F,
    "LP": 0x3FFC,
    "XT": 0x3FFD,
    "HS": 0x3FFE,
    "RC": 0x3FFF,
    "WDTEN": 0x3FFF,
    "WDTDIS": 0x3FFB,
    "PWRTEN": 0x3FF7,
    "PWRTDIS": 0x3FFF,
    "UNPROTECT": 0x3FFF,
    "PROTECT": 0x000F,
    "_XT_OSC": 0x3FFD,
    "_HS_OSC": 0x3FFE,
    "_LP_OSC": 0x3FFC,
    "_RC_OSC": 0x3FFF,
    "_WDT_ON": 0x3FFF,
    "_WDT_OFF": 0x3FFB,
    "_PWRTE_ON": 0x3FF7,
    "_PWRTE_OFF": 0x3FFF,
    "_CP_OFF": 0x3FFF,
    "_CP_ON": 0x000F,
}


def config_names() -> Mapping[str, int]:
    """Return the names that `__CONFIG(…)` and the assembler's `__config` accept, as masks to be ANDed."""
    return _CONFIG_NAMES


def headers(dialect: str) -> Mapping[str, str]:
    """Return the compiler's own header files by name, but for those of the library."""
    common = {
        "stdint.h": _STDINT_LIMITS,
        "inttypes.h": _INTTYPES,
        "limits.h": _LIMITS,
        "stdbool.h": _STDBOOL,
        "stddef.h": _STDDEF,
    }
    if dialect == XC8:
        xc = _STDINT_LIMITS + _STDBOOL
        own = ("xc.h", "htc.h", "pic.h", "pic16f84a.h", "pic16f84.h", "builtins.h", "language_support.h")
        return {**common, **dict.fromkeys(own, xc), "xc8debug.h": "#define __debug_break() ((void)0)\n"}
    if dialect == SDCC:
        chip = _sdcc_chip()
        files = ("pic16f84", "pic16f84a", "pic14regs", "pic16regs")
        names = [f"{folder}{file}.h" for folder in ("", "pic14/") for file in files]
        return {**common, **dict.fromkeys(names, chip)}
    return {**common, "system.h": "", "boostc.h": "", "p16f84.h": "", "p16f84a.h": ""}


def _sdcc_chip() -> str:
    """Return what SDCC's header defines besides registers and bits: the address of the configuration word and
    its masks.
    """
    masks = {f"_{name.lstrip('_')}": mask for name, mask in _CONFIG_NAMES.items() if "_" in name}
    lines = [f"#define {name} 0x{mask:04X}" for name, mask in masks.items()]
    return "\n".join([*lines, f"#define _CONFIG 0x{CONFIG_ADDRESS:04X}", ""])


_OTHER_COMPILERS: Mapping[str, str] = {
    "CCS C": r"^\s*#\s*(?:fuses|use|byte|bit|int_\w+|priority|device)\b|\bPIN_[A-E]\d\b"
    r"|#\s*include\s*[<\"](?:10|12|16|18)F\w+\.h|\boutput_(?:high|low|toggle|[a-e])\s*\(",
    "mikroC": r"\bs?bit\s+\w+\s+at\b|\b(?:PORT|TRIS)[A-E]\.[FB]\d\b|\b(?:R|TRIS)[A-E]\d_bit\b"
    r"|\b(?:V?Delay_(?:ms|us|Cyc)|Lcd_(?:Init|Out|Cmd|Chr)|Sound_(?:Init|Play)|UART1_\w+)\s*\(",
    "Arduino": r"#\s*include\s*[<\"](?:Arduino|Servo)\.h|\bSerial\.\w+\s*\("
    r"|\bvoid\s+setup\s*\(.*\bvoid\s+loop\s*\("
    r"|\b(?:pinMode|digital(?:Write|Read)|analog(?:Write|Read)|delayMicroseconds)\s*\(",
}
_OUR_HEADER = r"^\s*#\s*include\s*[<\"](?:xc|htc|pic\w*|pic14/\w+|system|boostc)\.h"


def other_compiler(line: str) -> str | None:
    """Return the compiler for which a line that cannot be compiled was written, if that is clear."""
    names = (name for name, mark in _OTHER_COMPILERS.items() if re.search(mark, line, re.DOTALL))
    return next(names, None)


def is_ours(text: str) -> bool:
    """Return whether a source includes a header that only the three dialects have."""
    return re.search(_OUR_HEADER, text, re.MULTILINE | re.IGNORECASE) is not None


FLOAT_BITS = (24, 32)
"""The sizes of floating-point types."""


def float_type(dialect: str, bits: int | None = None) -> FloatType:
    """Return the floating-point type of so many bits; without a size, XC8 has 24 (MPLAB XC8 C Compiler User's
    Guide DS52053B, section 5.4.3), the others 32.
    """
    return FloatType((bits or (24 if dialect == XC8 else 32)) // 8)


def macros(dialect: str, device: Device, floating: FloatType) -> Mapping[str, str]:
    """Return the macros that are defined before the first line."""
    part = device.name.removeprefix("PIC")
    defined = {"__SERVOGEN__": "1", f"_{part}": "1", f"__{part}": "1", f"__{part}__": "1"}
    defined |= dict.fromkeys(("__SIZEOF_FLOAT__", "__SIZEOF_DOUBLE__"), str(floating.size))
    if dialect == XC8:
        return {
            **defined,
            "__XC8": "1",
            "__XC8__": "1",
            "__XC": "1",
            "__XC__": "1",
            "_PIC14": "1",
            "__PICC__": "1",
        }
    if dialect == SDCC:
        sdcc = {"__SDCC": "4_2_0", "__SDCC_pic14": "1", f"__SDCC_PIC{part}": "1", f"__PIC{part}_H__": ""}
        return {**defined, **sdcc, "__SDCC_VERSION_MAJOR": "4", "__SDCC_CHAR_UNSIGNED": "1"}
    return {**defined, "_C2C_": "1", "__C2C__": "1", "_BOOSTC": "1"}


REGISTER_ALIASES: Mapping[str, str] = {"OPTION": "OPTION_REG"}
"""Other names of registers; a program's own declarations hide them."""

REGISTER_FIELDS: Mapping[str, Mapping[str, tuple[int, int]]] = {
    # DS35007 registers 2-1 and 2-2: (lowest bit, width)
    "STATUS": {"RP": (5, 2)},
    "OPTION_REG": {"PS": (0, 3)},
}
"""Fields of several bits, as XC8's and SDCC's headers name them."""

_BIT_ALIASES: Mapping[str, str] = {
    "nRBPU": "RBPU",
    "nTO": "TO",
    "nPD": "PD",
    "NOT_RBPU": "RBPU",
    "NOT_TO": "TO",
    "NOT_PD": "PD",
    "TMR0IE": "T0IE",
    "TMR0IF": "T0IF",
    "CARRY": "C",
    "ZERO": "Z",
    "PORTA0": "RA0",
    "PORTA1": "RA1",
    "PORTA2": "RA2",
    "PORTA3": "RA3",
    "PORTA4": "RA4",
    **{f"PORTB{bit}": f"RB{bit}" for bit in range(8)},
}


@dataclass(frozen=True, slots=True)
class ChipBit:
    """A bit of a special function register."""

    register: Register
    bit: int


@cache
def chip_registers() -> Mapping[str, Register]:
    """Return the registers by every spelling: upper case, lower case, aliases."""
    by_name = dict(registers())
    for alias, name in REGISTER_ALIASES.items():
        by_name[alias] = registers()[name]
    return {**by_name, **{name.lower(): register for name, register in by_name.items()}}


@cache
def chip_bits() -> Mapping[str, ChipBit]:
    """Return the bits by name, including XC8's other spellings."""
    by_name = {name: ChipBit(register, bit) for name, (register, bit) in register_bits().items()}
    return {**by_name, **{alias: by_name[name] for alias, name in _BIT_ALIASES.items()}}
