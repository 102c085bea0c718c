"""Records noteworthy actions of the program in the state vector, each once, with its cycle.

Compiled: called from the instruction loop, but rarely.
"""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled_once
from servogen.simulator.layout import (
    CYCLE,
    HARMLESS_WARNINGS,
    HERE,
    WARN_COUNT,
    WARN_EE_ADDRESS,
    WARN_ERASED,
    WARN_UNDEFINED,
    WARNING_FIELDS,
    WARNING_SLOTS,
    WARNINGS,
    WORD_WARNINGS,
)


@compiled_once
def warn(s: Vector, code: int, subject: int) -> None:
    """Record `code` about `subject` (a pin, an address), unless it is already recorded or there are many of
    its kind.
    """
    warn_of(s, code, subject, s[CYCLE], s[HERE])


@compiled_once
def warn_of(s: Vector, code: int, subject: int, cycle: int, place: int) -> None:
    """Record the same for an instruction at `place`, in an earlier cycle."""
    key = code << 16 | subject
    count = s[WARN_COUNT]
    for i in range(count):
        if s[WARNINGS + WARNING_FIELDS * i] == key:
            return
    room = WARNING_SLOTS
    if code == WARN_ERASED or code == WARN_EE_ADDRESS:  # noqa: SIM109 - compiled
        room = HARMLESS_WARNINGS
    elif code == WARN_UNDEFINED:
        room = WORD_WARNINGS
    if count < room:
        s[WARNINGS + WARNING_FIELDS * count] = key
        s[WARNINGS + WARNING_FIELDS * count + 1] = cycle
        s[WARNINGS + WARNING_FIELDS * count + 2] = place
        s[WARN_COUNT] = count + 1
