"""What a fingerprint tells apart: everything on which the machine's future depends, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from servogen.simulator import layout as at
from servogen.simulator.fingerprint import fingerprint, unknown_bits
from servogen.simulator.slots import SlotFacts
from tests.simulator.helpers import image
from tests.simulator.helpers import machine as machine_of

VALUES = [row.name for row in at.ROWS if row.register or row.port]
VALUES += ["W", "SLEEPING", "IN_RESET", "PRESCALER", "EE_STEP", "EE_CELL", "EE_BYTE", "RB_OLD", "EXT_MASK",
           "EXT_LEVEL", "DRIVEN", "DRIVEN_HIGH"]  # fmt: skip
"""Registers, latches and steps: what instructions read, or events change."""
MOMENTS = ["IRQ_AT", "T0_TICK", "EE_DONE_AT"]
"""Times at which something will happen, or never."""
NOT_BEFORE = ["T0_AT", "T0_HELD", "AWAKE_AT"]
"""Times until which something stands still; once they are over they say nothing."""
REPORTED = ["DEEPEST", "OVERFLOWS", "UNDERFLOWS", "RESETS_MCLR", "RESETS_MCLR_SLEEP", "RESETS_WDT",
            "WAKES_WDT", "WAKES_INTERRUPT", "INTERRUPTS", "EDGES_TOTAL", "HORIZON", "HERE", "EDGE_COUNT",
            "STIM_NEXT", "TRACE_COUNT", "WARN_COUNT"]  # fmt: skip
"""Counts for reports, and places in buffers."""
WATCHED = "        __config _XT_OSC & _WDT_ON & _PWRTE_OFF\n"


def vector(config: str | None = None) -> np.ndarray:
    chip = machine_of(image(" nop\n" * 100, config) if config else image(" nop\n" * 100))
    chip.run(50)
    return chip.numbers.copy()


def changed(s: np.ndarray, name: str, to: int) -> np.ndarray:
    other = s.copy()
    other[getattr(at, name)] = to
    return other


@pytest.mark.parametrize("name", VALUES)
def test_a_register_counts_with_its_value(name: str) -> None:
    s = vector()
    assert fingerprint(changed(s, name, int(s[getattr(at, name)]) ^ 1)) != fingerprint(s)


@pytest.mark.parametrize("name", REPORTED)
def test_what_is_only_reported_does_not_count(name: str) -> None:
    s = vector()
    other = changed(s, name, int(s[getattr(at, name)]) + 1)
    assert fingerprint(other) == fingerprint(s)
    assert unknown_bits(other) == unknown_bits(s)


@pytest.mark.parametrize("name", MOMENTS)
def test_a_moment_counts_by_its_distance(name: str) -> None:
    """An interrupt that was sampled in the last cycle is still to come."""
    s = vector()
    prints = [fingerprint(changed(s, name, when)) for when in (40, 49, 50, 51, 90, at.NEVER)]
    assert len(set(prints)) == 6
    later = changed(s, "CYCLE", 60)
    assert fingerprint(changed(later, name, 100)) == fingerprint(changed(s, name, 90))
    assert fingerprint(changed(later, name, at.NEVER)) == fingerprint(changed(s, name, at.NEVER))


@pytest.mark.parametrize("name", NOT_BEFORE)
def test_a_time_until_counts_while_it_lies_ahead(name: str) -> None:
    s = vector()
    assert fingerprint(changed(s, name, 3)) == fingerprint(changed(s, name, 50))
    assert fingerprint(changed(s, name, 51)) != fingerprint(changed(s, name, 50))
    assert fingerprint(changed(s, name, 51)) != fingerprint(changed(s, name, 52))


@pytest.mark.parametrize("name", ["WDT_AT"])
def test_the_watchdogs_age_counts_where_it_is_on(name: str) -> None:
    off, on = vector(), vector(WATCHED)
    assert fingerprint(changed(off, name, 3)) == fingerprint(changed(off, name, 4))
    assert fingerprint(changed(on, name, 3)) != fingerprint(changed(on, name, 4))


def test_the_age_of_a_key_to_the_eeprom_counts_up_to_three_cycles() -> None:
    """AAh must come two cycles after 55h, and WR one after that: DS35007 section 3.2."""
    s = vector()
    assert fingerprint(changed(s, "EE_STEP_AT", 48)) == fingerprint(changed(s, "EE_STEP_AT", 49))
    s = changed(s, "EE_STEP", 1)
    prints = [fingerprint(changed(s, "EE_STEP_AT", when)) for when in (40, 46, 47, 48, 49, 50)]
    assert len(set(prints)) == 4
    assert prints[0] == prints[1] == prints[2]


def test_an_overflow_that_was_seen_ahead_counts_in_its_cycle_only() -> None:
    s = vector()
    assert fingerprint(changed(s, "T0_FLAGGED", 50)) != fingerprint(changed(s, "T0_FLAGGED", 49))
    assert fingerprint(changed(s, "T0_FLAGGED", 48)) == fingerprint(changed(s, "T0_FLAGGED", 49))


def test_every_byte_of_ram_and_eeprom_counts() -> None:
    s = vector()
    places = [*range(0x0C, 0x50), *range(at.EEPROM, at.EEPROM + 64)]
    prints = set()
    for place in places:
        other = s.copy()
        other[place] ^= 1
        prints.add(fingerprint(other))
    assert len(prints) == 68 + 64
    assert fingerprint(s) not in prints
    for place in (0x0B, 0x50):  # the slots around the RAM
        other = s.copy()
        other[place] ^= 1
        assert fingerprint(other) == fingerprint(s)
    written = s.copy()
    written[0x20] ^= at.NOT_WRITTEN
    assert fingerprint(written) == fingerprint(s)


def test_the_stack_counts_from_its_top_whatever_the_place_in_the_ring() -> None:
    s = vector()
    s[at.STACK : at.STACK + 8] = range(8)
    turned = changed(s, "SP", 3)
    turned[at.STACK : at.STACK + 8] = np.roll(np.arange(8), 3)
    assert fingerprint(turned) == fingerprint(s)
    assert fingerprint(changed(s, "SP", 1)) != fingerprint(s)


@pytest.mark.parametrize("row", [row for row, _ in at.UNCERTAIN], ids=lambda row: row.name)
def test_which_bits_are_unknown_is_told_apart_without_their_source(row: SlotFacts) -> None:
    s, bit = vector(), row.undefined & -row.undefined or 1
    assert unknown_bits(changed(s, row.unknown_name, bit)) != unknown_bits(changed(s, row.unknown_name, 0))
    if row.is_free:
        sources = [unknown_bits(changed(s, row.unknown_name, bit | source << 8)) for source in (0x20, 0x30)]
        assert sources[0] == sources[1]
    assert fingerprint(changed(s, row.unknown_name, bit)) == fingerprint(s)


def test_unknown_bits_of_ram_and_the_shortest_watchdog_are_told_apart() -> None:
    s = vector(WATCHED)
    for place in (0x0C, 0x4F):
        other = s.copy()
        other[place] |= 0x80 << at.UNKNOWN_SHIFT
        assert unknown_bits(other) != unknown_bits(s)
        assert fingerprint(other) == fingerprint(s)
    for name in ("WDT_CLEARED", "WDT_EARLIEST", "DRIVEN_UNKNOWN"):
        other = changed(s, name, int(s[getattr(at, name)]) + 1)
        assert unknown_bits(other) != unknown_bits(s), name
        assert fingerprint(other) == fingerprint(s)
