"""Directives for assembler settings: processor, radix, diagnostics, configuration, ID words, the map of
RAM.
"""

from __future__ import annotations

import re

from servogen.errors import InputError, Severity, did_you_mean
from servogen.pic.assembler.expressions import BinaryOperation
from servogen.pic.assembler.messages import SourceError, muted_by
from servogen.pic.assembler.source import Statement
from servogen.pic.assembler.state import Directive, Pass
from servogen.pic.assembler.text import Text
from servogen.pic.device import (
    ASSEMBLED_DEVICES,
    CONFIG_ADDRESS,
    CONFIG_OSCILLATOR_MASK,
    CONFIG_POWER_UP_TIMER_OFF,
    CONFIG_WATCHDOG_ON,
    DEVICES,
    ID_ADDRESS,
    OSCILLATORS,
    PIC16C84,
    device,
)
from servogen.pic.isa import WORD_MASK

RADICES = {"hexadecimal": 16, "decimal": 10, "octal": 8}
"""Any beginning of these words."""


def _radix(state: Pass, statement: Statement) -> None:
    _set_radix(state, statement.rest)


def _set_radix(state: Pass, name: Text) -> None:
    word = name.chars.lower()
    radix = next((radix for known, radix in RADICES.items() if word and known.startswith(word)), None)
    if radix is None:
        raise SourceError(
            "asm-bad-argument", f"'{name.chars}' is not a radix", name.column(0), "known: dec, hex, oct"
        )
    state.radix = radix


def _list(state: Pass, statement: Statement) -> None:
    """Process `list p=16f84, r=dec, …`: processor and radix are used; the rest concerns the printed
    listing.
    """
    for part in statement.rest.split(","):
        key = part.chars.partition("=")[0]
        field = part[len(key) + 1 :].strip()
        if key.strip().lower() in ("p", "pe"):
            _set_processor(state, field, statement)
        elif key.strip().lower() == "r":
            _set_radix(state, field)


def _processor(state: Pass, statement: Statement) -> None:
    _set_processor(state, statement.rest, statement)


def _set_processor(state: Pass, name: Text, statement: Statement) -> None:
    try:
        chosen = device(name.chars, ASSEMBLED_DEVICES)
    except InputError as error:
        raise SourceError("unknown-device", error.message, name.column(0), error.hint) from error
    if state.device is None:
        state.choose(chosen)
    elif chosen != state.device:
        text = f"processor {chosen.name} is overridden by {state.device.name}, which was requested"
        state.report("warning", "asm-processor", text, statement.line, statement.column)


def _errorlevel(state: Pass, statement: Statement) -> None:
    """Process `errorlevel 0|1|2, -302, +302`, which selects the diagnostics that are kept."""
    for part in statement.rest.split(","):
        match = re.fullmatch(r"([-+]?)\s*(\d+)", part.chars)
        if match is None:
            raise SourceError(
                "asm-bad-argument",
                f"'{part.chars}' is not a level or number",
                part.column(0),
                "0, 1, 2, -302 or +302",
            )
        number = int(match[2])
        if number <= 2:
            state.log.level = number
        elif match[1] == "-":
            state.log.muted |= muted_by(number)
        else:
            state.log.muted -= muted_by(number)


def _text_of(statement: Statement) -> str:
    return statement.rest.chars.strip().strip('"')


def _messg(state: Pass, statement: Statement) -> None:
    _say(state, statement, "note", "asm-user-message")


def _error(state: Pass, statement: Statement) -> None:
    _say(state, statement, "error", "asm-user-error")


def _say(state: Pass, statement: Statement, severity: Severity, code: str) -> None:
    if not statement.rest:
        raise SourceError(
            "asm-missing-argument", f"{statement.operation.upper()} needs a string", statement.column
        )
    state.report(severity, code, _text_of(statement), statement.line, statement.column)


def _config(state: Pass, statement: Statement) -> None:
    """Process `__config word`, or `__config 0x2007, word`."""
    fields = state.fields(statement, 1, 2)
    if len(fields) == 2 and state.evaluate(fields[0]) != CONFIG_ADDRESS:
        raise SourceError(
            "asm-argument-range",
            f"the configuration word is at 0x{CONFIG_ADDRESS:04X}",
            statement.rest.column(0),
        )
    state.put(CONFIG_ADDRESS, state.evaluate(fields[-1]), statement)


CONFIG_SETTINGS = {
    "FOSC": (CONFIG_OSCILLATOR_MASK, {**OSCILLATORS, "EXTRC": OSCILLATORS["RC"]}),
    "WDTE": (CONFIG_WATCHDOG_ON, {"ON": CONFIG_WATCHDOG_ON, "OFF": 0}),
    "PWRTE": (CONFIG_POWER_UP_TIMER_OFF, {"ON": 0, "OFF": CONFIG_POWER_UP_TIMER_OFF}),
    "CP": (DEVICES[0].code_protect_mask, {"ON": 0, "OFF": DEVICES[0].code_protect_mask}),
}
"""The settings of CONFIG: their bits, and the values that they take; the same on all `DEVICES`."""


def _config_settings(state: Pass, statement: Statement) -> None:
    """Process `config FOSC=XT, WDTE=OFF, …`; unspecified bits stay erased, that is, 1."""
    if state.device == PIC16C84:  # as in gpasm, which has no names for its settings
        hint = "__config, with the names of p16c84.inc, works"
        raise SourceError("asm-config", "CONFIG does not know the PIC16C84", statement.column, hint)
    for part in statement.rest.split(","):
        name, _, value = (piece.strip(' \t"').upper() for piece in part.chars.partition("="))
        if name not in CONFIG_SETTINGS:
            raise SourceError(
                "asm-config", f"unknown setting '{name}'", part.column(0), did_you_mean(name, CONFIG_SETTINGS)
            )
        mask, values = CONFIG_SETTINGS[name]
        if value not in values:
            raise SourceError(
                "asm-config",
                f"unknown value '{value}' of {name}",
                part.column(0),
                did_you_mean(value, values),
            )
        if name in state.settings:
            raise SourceError("asm-overwrite", f"{name} is set twice", part.column(0))
        state.settings.append(name)
        if not state.first:
            state.memory.change(CONFIG_ADDRESS, mask, values[value])


def _idlocs(state: Pass, statement: Statement) -> None:
    """Place the four hexadecimal digits of one value, one in each ID word."""
    value = state.one(statement)
    if value & ~0xFFFF:
        text = f"0x{value & 0xFFFFFFFF:X} has more than four digits: the last four are used"
        state.report("note", "asm-id-truncated", text, statement.line, statement.column)
    for index, shift in enumerate((12, 8, 4, 0)):
        state.put(ID_ADDRESS + index, value >> shift & 0xF, statement)


def _maxram(state: Pass, statement: Statement) -> None:
    state.ram_last = state.one(statement)
    state.bad_ram.clear()


def _badram(state: Pass, statement: Statement) -> None:
    """Process addresses and ranges `first-last` that are not RAM."""
    for field in state.fields(statement, 1):
        if isinstance(field, BinaryOperation) and field.operator == "-":
            first, last = state.evaluate(field.left), state.evaluate(field.right)
            state.bad_ram.update(range(max(first, 0), min(last, WORD_MASK) + 1))
        else:
            state.bad_ram.add(state.evaluate(field))


def _nothing(state: Pass, statement: Statement) -> None:
    """Ignore a directive about the printed listing, or about memory that the chip has anyway."""


SETTINGS: dict[str, Directive] = {
    "radix": _radix,
    "list": _list,
    "processor": _processor,
    "errorlevel": _errorlevel,
    "messg": _messg,
    "error": _error,
    "__config": _config,
    "__fuses": _config,
    "config": _config_settings,
    "__idlocs": _idlocs,
    "__maxram": _maxram,
    "__badram": _badram,
    **dict.fromkeys(
        (
            "nolist",
            "expand",
            "noexpand",
            "page",
            "space",
            "title",
            "subtitle",
            "subtitl",
            "stitle",
            "__maxrom",
            "__badrom",
            ".direct",  # a command to gpsim
            ".line",  # a line of a compiler's source
        ),
        _nothing,
    ),
}
