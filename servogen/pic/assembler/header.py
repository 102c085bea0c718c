"""The built-in include files of the chips: the names of registers, bits and fuses, and the map of RAM.

In: a file name. Out: its chip, and its text, generated from the facts in `pic.device`; the spellings are
those used in sources.
"""

from __future__ import annotations

from functools import cache

from servogen.pic.device import (
    ASSEMBLED_DEVICES,
    CONFIG_ADDRESS,
    CONFIG_POWER_UP_TIMER_OFF,
    CONFIG_WATCHDOG_ON,
    ID_ADDRESS,
    ID_WORDS,
    OSCILLATORS,
    PIC16C84,
    REGISTERS,
    Device,
)
from servogen.pic.isa import WORD_MASK
from servogen.pic.spelling import bit_spelling

OTHER_NAMES = {"T0IF": "TMR0IF", "T0IE": "TMR0IE"}
"""Second names of bits that sources use."""

OSCILLATOR_NAMES = {
    "LP": ("_LP_OSC", "_FOSC_LP"),
    "XT": ("_XT_OSC", "_FOSC_XT"),
    "HS": ("_HS_OSC", "_FOSC_HS"),
}
OSCILLATOR_NAMES["RC"] = ("_RC_OSC", "_FOSC_EXTRC")

HEADERS = tuple(f"p{device.short_name.lower()}.inc" for device in ASSEMBLED_DEVICES)


def header_device(name: str) -> Device | None:
    """Return the chip of a built-in include file, by the file's name in any case; None for another name."""
    return dict(zip(HEADERS, ASSEMBLED_DEVICES, strict=True)).get(name.lower().replace("pic", "p"))


@cache
def header_text(device: Device) -> str:
    """Return the include file of a chip."""
    values = {"W": 0, "F": 1}
    for register in REGISTERS:
        values[register.name] = register.address
        for bit, name in enumerate(register.bit_names()):
            if name is not None:
                values[bit_spelling(name)] = bit
                if name in OTHER_NAMES:
                    values[OTHER_NAMES[name]] = bit
    values |= _fuses(device)
    values |= {f"_IDLOC{number}": ID_ADDRESS + number for number in range(ID_WORDS)}
    rows = [f"{name:<12} EQU H'{value:04X}'" for name, value in values.items()]
    mismatch = f'  IFNDEF __{device.short_name}\n  MESSG "this header is for {device.name}"\n  ENDIF\n'
    last = device.ram_last
    bad = f"  __MAXRAM H'{0x80 | last:02X}'\n  __BADRAM H'07', H'{last + 1:02X}'-H'7F', H'87'\n"
    return mismatch + "\n".join(rows) + "\n" + bad


PIC_AS_HEADER = "xc.inc"
PIC_AS_NAMES: dict[str, tuple[str, ...]] = {
    "C": ("CARRY",),
    "Z": ("ZERO",),
    "PD": ("nPD",),
    "TO": ("nTO",),
    "RBPU": ("nRBPU",),
}
PIC_AS_NAMES |= {name: (name, other) for name, other in OTHER_NAMES.items()}
"""The bits whose names are others for pic-as."""
OPERATORS = {"and": "&", "or": "|", "xor": "^", "not": "~", "mod": "%", "shl": "<<", "shr": ">>"}
OPERATORS |= {"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}


@cache
def pic_as_header() -> str:
    """Return the include file of pic-as: a bit is a register and a number, its place has a long name."""
    rows = []
    for register in REGISTERS:
        rows.append(f"{register.name} EQU {register.address}")
        for bit, name in enumerate(register.bit_names()):
            if name is None:
                continue
            names = PIC_AS_NAMES.get(name, (name,))
            rows += [f"#define {each} {register.name}, {bit}" for each in names]
            for each in dict.fromkeys((name, *names)):
                row = f"{register.name}_{each}"
                rows += [f"{row}_POSN EQU {bit}", f"{row}_POSITION EQU {bit}", f"{row}_MASK EQU {1 << bit}"]
    for word, sign in OPERATORS.items():
        rows += [f"#define {word} {sign}", f"#define {word.upper()} {sign}"]
    rows += ["#define BANKMASK(address) ((address) & 0x7F)", "#define PAGEMASK(address) (address)"]
    return "\n".join(rows) + "\n"


def _fuses(device: Device) -> dict[str, int]:
    """Return words to be combined with &: each has only its own bits variable, all others are 1."""
    fuses = {"_CONFIG1" if device == PIC16C84 else "_CONFIG": CONFIG_ADDRESS}
    for name, bits in OSCILLATORS.items():
        fuses |= dict.fromkeys(OSCILLATOR_NAMES[name], WORD_MASK & ~0b11 | bits)
    off, on = WORD_MASK & ~CONFIG_WATCHDOG_ON, WORD_MASK
    fuses |= {"_WDT_OFF": off, "_WDTE_OFF": off, "_WDT_ON": on, "_WDTE_ON": on}
    on, off = WORD_MASK & ~CONFIG_POWER_UP_TIMER_OFF, WORD_MASK
    if device.power_up_timer_on_is_1:
        on, off = off, on
    fuses |= {"_PWRTE_ON": on, "_PWRTE_OFF": off}
    return fuses | {"_CP_ON": WORD_MASK & ~device.code_protect_mask, "_CP_OFF": WORD_MASK}
