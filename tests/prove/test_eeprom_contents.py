"""Contents of the EEPROM that are tried on a plain chip."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from servogen.edges import PINS
from servogen.engines.stream.protocol import trim_cycles
from servogen.pic.image import Image
from servogen.prove import eeprom
from servogen.prove.eeprom import TrimSearch
from servogen.simulator import SimulatorOptions
from tests.prove.test_trim_pulses import PERIOD, SCHEDULE

RB0, RB1, RA4 = (PINS.index(pin) for pin in ("RB0", "RB1", "RA4"))
CONTENT = {0: 1, 5: 7, 9: 8}


def search_of(
    monkeypatch: pytest.MonkeyPatch, wrong: Any = None, content: Mapping[int, int] = CONTENT
) -> TrimSearch:
    """A program whose channel 0 has its trim in byte 3; `wrong`: content → cycles by which a fall is off."""

    def changes(machine: Any, begun: int, end: int) -> list[tuple[int, int, int]]:
        content = machine
        trim = trim_cycles(content[3])
        off = wrong(content) if wrong else 0
        edges = []
        frames = [(1000, None), (1000, None), (1200, 1500), (None, None)]
        for number in range(200):
            one, two = frames[number if number < 4 else 2 + number % 2]
            start = 500 + number * PERIOD
            if one:
                edges += [(start, RB0, 1), (start + one + trim + off, RB0, 0)]
            if two:
                edges += [(start + 2500, RB1, 1), (start + 2500 + two, RB1, 0)]
        return sorted(edge for edge in edges if edge[0] < end)

    monkeypatch.setattr(eeprom, "machine_of", lambda schedule, image, board: image.eeprom)
    monkeypatch.setattr(eeprom, "pin_changes", changes)
    return TrimSearch(Image({}, eeprom=dict(content)), SCHEDULE, SimulatorOptions(), {RA4: 1})


def test_the_byte_of_a_trim_is_found_and_every_value_of_it_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    assert search_of(monkeypatch).search({}) is None
    one = search_of(monkeypatch, wrong=lambda content: 2 * (content[3] == 0x41))
    found = one.search({})
    assert found is not None
    # 0x41 is a trim of 65 cycles: the fall of a pulse of 1000 cycles that begins in cycle 500.
    assert found.message == "the fall of RB0 is missing if byte 3 is 0x41 in the EEPROM"
    assert found.cycle == 500 + 1000 + 65 and found.eeprom == {3: 0x41}
    assert found.levels == (("RA4", ((0, 1),)),)
    early = search_of(monkeypatch, wrong=lambda content: -2 * (content[3] == 0x41 and content[60] == 9))
    assert early.search({}) is None
    found = early.search({3: 0x41, 60: 9})
    assert found is not None and found.cycle == 500 + 1000 + 65 - 2
    assert found.message == (
        "the fall of RB0 is not the schedule's if byte 3 is 0x41, byte 60 is 0x09 in the EEPROM"
    )


def test_bytes_behind_the_trims_matter_only_if_the_program_plays_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert search_of(monkeypatch).erased() is None
    wrong = search_of(monkeypatch, wrong=lambda content: 3 * (content[9] == 0xFF))
    found = wrong.erased()
    assert found is not None
    assert found.message == (
        "the EEPROM holds more than trims: with bytes 5 to 9 erased the fall of RB0 is missing"
    )
    assert (found.cycle, found.eeprom) == (1500, {})
    # Nothing is behind the trims of two channels.
    assert search_of(monkeypatch, lambda content: 3, {0: 1, 1: 5, 9: 0xFF}).erased() is None
    assert search_of(monkeypatch, lambda content: 3, {2: 5}).erased() is not None
