"""The chip settings that the source makes: the clock, the configuration word, the serial port.

In: pragmas, macros, `__CONFIG` values, the options. Out: a `Clock` or none, the configuration word, settings
by name; contradictions are reported.
"""

from __future__ import annotations

import re

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.frontend.assembly import assembler_number
from servogen.compiler.frontend.dialects import config_names
from servogen.compiler.frontend.preprocessor import Pragma
from servogen.errors import Location, did_you_mean
from servogen.pic.device import (
    CONFIG_ADDRESS,
    EEPROM_ADDRESS,
    EEPROM_BYTES,
    ID_ADDRESS,
    ID_WORDS,
    OSCILLATORS,
    Device,
    config_word,
    oscillator_for,
)
from servogen.units import Clock

CODE_PROTECT_MASK = 0x3FF0  # DS35007 section 6.1
_IGNORED = frozenset(
    [
        "warning",
        "switch",
        "inline",
        "regsused",
        "addrqual",
        "message",
        "interrupt_level",
        "printf_check",
        "pack",
        "once",
    ]
)


class PragmaSettings:
    """Collects the settings made by pragmas."""

    def __init__(self, device: Device, reporter: Reporter) -> None:
        self.device = device
        self.reporter = reporter
        self.clock_pragma: tuple[int, Location] | None = None
        self.config: dict[str, tuple[str, Location]] = {}
        self.config_mask: tuple[int, Location] | None = None
        self.serial: dict[str, str] = {}
        self.eeprom: dict[int, int] = {}
        self.ids: dict[int, int] = {}
        """The bytes and words that `#pragma DATA` puts there."""

    def pragma(self, pragma: Pragma) -> None:
        """Read one `#pragma` line."""
        words = pragma.words.split(None, 1)
        name, rest = (words[0], words[1].strip() if len(words) > 1 else "") if words else ("", "")
        match name.upper():
            case "CLOCK_FREQ":
                value = number(rest)
                if value is None or value <= 0:
                    self.reporter.error(
                        "c-clock",
                        f"#pragma CLOCK_FREQ needs a frequency in hertz, not '{rest}'",
                        pragma.place,
                    )
                else:
                    self.clock_pragma = (value, pragma.place)
            case "CONFIG":
                self._config(rest, pragma.place)
            case "RS232_TXPORT" | "RS232_TXPIN" | "RS232_RXPORT" | "RS232_RXPIN" | "RS232_BAUD":
                self.serial[name.upper().removeprefix("RS232_")] = rest
            case "TRUE_RS232":
                self.serial["TRUE"] = rest
            case "DATA":
                self._data(rest, pragma.place)
            case _ if (macro := name.partition("(")[0]) in ("push_macro", "pop_macro"):
                self.reporter.error("c-pragma", f"#pragma {macro} is not supported", pragma.place)
            case _ if name.lower() not in _IGNORED:
                self.reporter.warn("c-pragma", f"unknown #pragma {name}", pragma.place)

    def _config(self, rest: str, place: Location) -> None:
        """Read `#pragma config NAME = VALUE, …`."""
        for item in rest.split(","):
            match = re.fullmatch(r"\s*(\w+)\s*=\s*(\w+)\s*", item)
            if not match:
                self.reporter.error(
                    "c-configuration",
                    f"'{item.strip()}' is not a setting, which is written NAME = VALUE",
                    place,
                )
                continue
            name, value = match[1].upper(), match[2].upper()
            if name not in _VALUES:
                self.reporter.error(
                    "c-configuration",
                    f"unknown configuration setting '{match[1]}'",
                    place,
                    did_you_mean(name, _VALUES),
                )
            elif value not in _VALUES[name]:
                self.reporter.error(
                    "c-configuration",
                    f"'{match[2]}' is not a value of {name}",
                    place,
                    did_you_mean(value, _VALUES[name]),
                )
            elif self.config.get(name, (value,))[0] != value:
                self.reporter.error(
                    "c-configuration", f"{name} is set twice: {self.config[name][0]} and {value}", place
                )
            else:
                self.config[name] = (value, place)

    def _data(self, rest: str, place: Location) -> None:
        """Read BoostC's `#pragma DATA address, value, …`: the configuration word, ID words, the EEPROM."""
        where, _, values = rest.partition(",")
        where = where.strip()
        start = {"_CONFIG": CONFIG_ADDRESS, "_EEPROM": EEPROM_ADDRESS, "_IDLOC0": ID_ADDRESS}.get(
            where.upper(), number(where)
        )
        if start == CONFIG_ADDRESS:
            self.asm_config(values, place)
            return
        for offset, text in enumerate(values.split(",")):
            value, address = assembler_number(text.strip()), (start or 0) + offset
            if value is None or not 0 <= value <= 0xFF:
                self.reporter.error(
                    "c-pragma", f"#pragma DATA: '{text.strip()}' is not a number from 0 to 255", place
                )
            elif EEPROM_ADDRESS <= address < EEPROM_ADDRESS + EEPROM_BYTES:
                self.eeprom[address - EEPROM_ADDRESS] = value
            elif ID_ADDRESS <= address < ID_ADDRESS + ID_WORDS:
                self.ids[address - ID_ADDRESS] = value
            else:
                self.reporter.error(
                    "c-pragma",
                    f"#pragma DATA: no data can be placed at '{where}'",
                    place,
                    hint=f"0x{CONFIG_ADDRESS:X} is the configuration word, the EEPROM begins at "
                    f"0x{EEPROM_ADDRESS:X}, the ID words at 0x{ID_ADDRESS:X}",
                )
                return

    def asm_config(self, text: str, place: Location) -> None:
        """Read `__config` of the assembler: an expression of numbers and masks joined by &."""
        total = 0x3FFF
        for word in text.split("&"):
            name = word.strip().strip("()").strip()
            value = assembler_number(name)
            if value is None:
                value = config_names().get(name.upper())
            if value is None:
                self.reporter.error(
                    "c-configuration",
                    f"'{name}' is not a configuration mask",
                    place,
                    did_you_mean(name.upper(), config_names()),
                )
                return
            total &= value
        self.config_mask = (total, place)

    def clock(self, macros: dict[str, tuple[str, Location]], option_hz: int | None) -> Clock | None:
        """Return the clock. `#pragma CLOCK_FREQ` takes precedence over `_XTAL_FREQ`, `_CLOCK_FREQ` and the
        option, in this order.
        """
        frequencies: list[tuple[str, int, Location]] = []
        if self.clock_pragma is not None:
            frequencies.append(("#pragma CLOCK_FREQ", *self.clock_pragma))
        for name in ("_XTAL_FREQ", "_CLOCK_FREQ"):
            if name in macros:
                text, place = macros[name]
                value = number(text)
                if value is None or value <= 0:
                    self.reporter.error(
                        "c-clock", f"{name} must be a frequency in hertz, not '{text}'", place
                    )
                else:
                    frequencies.append((name, value, place))
        if option_hz is not None:
            frequencies.append(("--clock-hz", option_hz, Location()))
        if not frequencies:
            return None
        first = frequencies[0]
        for name, value, place in frequencies[1:]:
            if value != first[1]:
                self.reporter.error(
                    "c-clock",
                    f"{name} says {value} Hz, {first[0]} says {first[1]} Hz",
                    place if place.file else first[2],
                    hint="one program has one clock: make them agree",
                )
        if first[1] > self.device.max_clock_hz:
            self.reporter.error(
                "c-clock",
                f"{first[1]} Hz is too fast: {self.device.name} runs at up to {self.device.max_clock_hz} Hz",
                first[2],
            )
        return Clock(first[1])

    def config_word(self, clock: Clock | None) -> int:
        """Return the configuration word: as the source sets it, else with the oscillator that suits the
        clock, watchdog off and power-up timer on.
        """
        if self.config_mask is not None:
            return self.config_mask[0]
        chosen = {name: value for name, (value, _) in self.config.items()}
        oscillator = chosen.get("FOSC")
        if oscillator is None:
            oscillator = oscillator_for(clock.hz) if clock is not None else "XT"
        oscillator = {"EXTRC": "RC"}.get(oscillator, oscillator)
        word = config_word(
            oscillator, watchdog=chosen.get("WDTE") == "ON", power_up_timer=chosen.get("PWRTE") != "OFF"
        )
        return word & ~CODE_PROTECT_MASK if chosen.get("CP") == "ON" else word


_VALUES = {
    "FOSC": (*OSCILLATORS, "EXTRC"),
    "WDTE": ("ON", "OFF"),
    "PWRTE": ("ON", "OFF"),
    "CP": ("ON", "OFF"),
}


def number(text: str) -> int | None:
    """Return a number as written in a macro or pragma: suffixes, parentheses and products are allowed."""
    text = text.strip()
    while text.startswith("(") and text.endswith(")"):
        text = text[1:-1].strip()
    if re.fullmatch(r"\d+(\.\d*)?([eE]\+?\d\d?)?[fFlL]?", text) and re.search(r"[.eE]", text):
        floating = float(text.rstrip("fFlL"))  # `20e6`, a clock
        return int(floating) if floating.is_integer() else None
    total = 1
    for part in text.split("*"):
        match = re.fullmatch(r"\(?\s*(0[xX][0-9a-fA-F]+|[0-9][0-9_]*)[uUlL]*\s*\)?", part.strip())
        if not match:
            return None
        total *= int(match[1].replace("_", ""), 16 if match[1][:2].lower() == "0x" else 10)
    return total
