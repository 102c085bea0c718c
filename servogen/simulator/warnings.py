"""Warnings: noteworthy actions of the program, in words.

In: what the instruction loop recorded in the state vector (`warn.h`, `unknown.h`), the configuration word
and the clock. Out: diagnostics with cycle and address, in order of cycles.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS
from servogen.errors import Diagnostic, Location
from servogen.pic.device import (
    CONFIG_ADDRESS,
    CONFIG_OSCILLATOR_MASK,
    LP_MAX_HZ,
    OSCILLATORS,
    RAM_FIRST,
    RAM_LAST,
    REGISTERS,
    XT_MAX_HZ,
)
from servogen.pic.image import Image
from servogen.simulator import layout as at
from servogen.simulator.layout import GLITCH
from servogen.units import Clock

WORDS = {
    at.WARN_DRIVEN_UNWRITTEN: (
        "driven-before-written",
        True,
        "{pins}: an output while its latch holds no known level, and not written low within 10 cycles and "
        "before the first pulse",
    ),
    at.WARN_CONTENTION: ("contention", True, "{pins}: an output, and driven the other way from outside"),
    at.WARN_UNDEFINED: (
        "undefined-word",
        True,
        "the word at {address} is not an instruction of the data sheet; it was executed as NOP",
    ),
    at.WARN_ERASED: (
        "erased-word",
        False,
        "the program ran into the unprogrammed word at {address} (ADDLW 0xFF)",
    ),
    at.WARN_STACK_OVERFLOW: ("stack-overflow", False, "a ninth return address was pushed: the stack wrapped"),
    at.WARN_STACK_UNDERFLOW: (
        "stack-underflow",
        True,
        "a return with an empty stack: where it goes is unknown at power-up",
    ),
    at.WARN_EE_SEQUENCE: (
        "eeprom-sequence",
        False,
        "WR was set without WREN or without the sequence 55h, AAh, WR just before: nothing is written",
    ),
    at.WARN_EE_ADDRESS: ("eeprom-address", False, "EEADR is {address}; the EEPROM ends at 0x03F"),
    at.WARN_WATCHDOG: (
        "watchdog-margin",
        True,
        "the watchdog was not cleared within its shortest period (7 ms of 7 to 33 ms, times the postscaler): "
        "some chips time out here",
    ),
    at.WARN_RELEASED: (
        "released",
        False,
        "{pins}: a pin with pulses, and an input after the first pulse: the chip does not hold it low then",
    ),
    at.WARN_PULLED_UP: (
        "pulled-up",
        True,
        "{pins}: a pin with pulses, and an input with a pull-up after the first pulse: it is high then",
    ),
}
"""Code; whether another chip, or the same one at its next power-up, may do differently; text."""

CHIP_DEPENDENT = frozenset(
    {code for code, differs, _ in WORDS.values() if differs}
    | {"device-timing", "unknown-start", "no-configuration", "oscillator"}
)
"""Warnings of what another chip, or the same one at its next power-up, may do differently."""

_USES = {
    at.USE_SKIP: "a skip depends on it",
    at.USE_JUMP: "a jump by PCL depends on it",
    at.USE_POINTER: "FSR points by it",
    at.USE_OUTPUT: "it is driven out of {pin}",
    at.USE_DIRECTION: "a port's direction depends on it",
    at.USE_BANK: "the bank of registers depends on it",
    at.USE_REGISTER: "it is written to {register}",
    at.USE_EEPROM: "it is written to the EEPROM",
    at.USE_INTERRUPT: "an interrupt depends on it",
    at.USE_WAKE: "the end of SLEEP depends on it",
}
_SOURCES = {row.source: row.source_name for row in at.ROWS if row.source} | {at.SOURCE_PHASE: "TMR0"}


def warnings_of(
    s: npt.NDArray[np.int64],
    image: Image,
    clock: Clock,
    of_no_interest: int = 0,
    remarks: Sequence[tuple[int, Diagnostic]] = (),
) -> tuple[Diagnostic, ...]:
    """Return the warnings in a state vector; pins affected by the same instruction share one warning.

    The level of the pins `of_no_interest`, as bits, may be anything. `remarks` are those of devices.
    """
    places: dict[tuple[int, int, int, int], list[str]] = {}
    for code, subject, cycle, place in noted(s):
        if code == at.WARN_DRIVEN_UNWRITTEN and of_no_interest >> subject & 1:
            continue
        if code in at.OF_A_PIN:
            places.setdefault((code, cycle, place, 0), []).append(PINS[subject])
        else:
            places[code, cycle, place, subject] = []
    dated = [(0, warning) for warning in _oscillator(image, clock)] + list(remarks)
    dated += [(int(s[at.USE_CYCLE]), warning) for warning in _first_use(s)]
    for (code, cycle, place, subject), pins in places.items():
        kind, _, text = WORDS[code]
        message = text.format(pins=", ".join(sorted(pins)), address=f"0x{subject:03X}")
        dated.append((cycle, Diagnostic("warning", kind, message, _at(cycle, place))))
    return tuple(diagnostic for _, diagnostic in sorted(dated, key=lambda dated_warning: dated_warning[0]))


def _at(cycle: int, address: int) -> Location:
    return Location(cycle=cycle, address=address & 0x3FF)


def noted(s: npt.NDArray[np.int64]) -> list[tuple[int, int, int, int]]:
    """Return what a vector has recorded: (code, subject, cycle, address)."""
    end = at.WARNINGS + at.WARNING_FIELDS * int(s[at.WARN_COUNT])
    rows = s[at.WARNINGS : end].reshape(-1, at.WARNING_FIELDS)
    notes = [(int(key) >> 16, int(key) & 0xFFFF, int(cycle), int(place)) for key, cycle, place in rows]
    for pin in range(len(PINS)):
        if not s[at.DRIVEN_UNKNOWN] >> pin & 1:
            continue
        since, place = (int(value) for value in s[at.DRIVEN_FROM + 2 * pin : at.DRIVEN_FROM + 2 * pin + 2])
        late = int(s[at.CYCLE]) - since > GLITCH
        noted_before = any(
            (code, subject) == (at.WARN_DRIVEN_UNWRITTEN, pin) for code, subject, _, _ in notes
        )
        if late and not noted_before:
            notes.append((at.WARN_DRIVEN_UNWRITTEN, pin, since, place))
    return notes


def subjects(s: npt.NDArray[np.int64], code: int) -> tuple[int, ...]:
    """Return the pins or addresses that one kind of warning refers to."""
    return tuple(sorted(subject for noted_code, subject, _, _ in noted(s) if noted_code == code))


def _first_use(s: npt.NDArray[np.int64]) -> list[Diagnostic]:
    kind = int(s[at.USE_KIND])
    if not kind:
        return []
    subject = int(s[at.USE_SUBJECT])
    how = _USES[kind].format(
        pin=PINS[subject] if kind == at.USE_OUTPUT else "",
        register=_register(subject) if kind == at.USE_REGISTER else "",
    )
    message = f"{_source(int(s[at.USE_SOURCE]))}, and {how}"
    where = _at(int(s[at.USE_CYCLE]), int(s[at.USE_PLACE]))
    return [Diagnostic("warning", "unknown-start", message, where)]


def _register(address: int) -> str:
    names = {register.address: register.name for register in REGISTERS}
    return names[address] if address in names else names[address & 0x7F]


def _source(source: int) -> str:
    """Return a text that names what is unknown, and why."""
    if RAM_FIRST <= source <= RAM_LAST:
        return f"RAM 0x{source:02X} was not written since power-up"
    if at.FLOATING_PIN <= source < at.FLOATING_PIN + len(PINS):
        return f"{PINS[source - at.FLOATING_PIN]} is an input that nothing drives"
    if at.UNWRITTEN_LATCH <= source < at.UNWRITTEN_LATCH + len(PINS):
        return f"the latch of {PINS[source - at.UNWRITTEN_LATCH]} holds no known value yet"
    if source == at.SOURCE_RB_CHANGE:
        return "RBIF compares RB4 to RB7 with a reading of port B that was never made, or with a floating pin"
    if source == at.SOURCE_NO_CELL:
        return "EEADR lies beyond the EEPROM's end"
    if source == at.SOURCE_PRESCALER:
        return "the prescaler counted a pin that nothing drives"
    return f"{_SOURCES[source]} has no value at power-up"


CONFIGURED = Location(cycle=0, address=CONFIG_ADDRESS)


def _oscillator(image: Image, clock: Clock) -> list[Diagnostic]:
    """Return a warning if the configuration's oscillator does not suit this clock (DS35007 section 6.2)."""
    if image.config is None:
        text = (
            "the image has no configuration word: as on an erased chip the oscillator is RC and the "
            "watchdog is on"
        )
        return [Diagnostic("warning", "no-configuration", text, CONFIGURED)]
    chosen = image.config & CONFIG_OSCILLATOR_MASK
    name = next(name for name, code in OSCILLATORS.items() if code == chosen)
    limit = {"LP": LP_MAX_HZ, "XT": XT_MAX_HZ}.get(name, clock.hz)
    if name == "RC":
        fault = f"whose frequency is not exactly {clock.hz} Hz"
    elif clock.hz > limit:
        fault = f"which is for at most {limit} Hz, not for {clock.hz} Hz"
    else:
        return []
    text = f"the configuration word chooses the {name} oscillator, {fault}"
    return [Diagnostic("warning", "oscillator", text, CONFIGURED)]
