"""Trace, profile and coverage: what a program did, by instruction, line and function."""

from __future__ import annotations

from itertools import pairwise

import pytest

from servogen.pic.assembler import assemble
from servogen.pic.listing import ListedFunction, Listing, ListingRow
from servogen.simulator import Machine, Observation, profile, trace
from tests.simulator.helpers import CLOCK, HEAD, WATCHDOG_OFF, edges, machine

SOURCE = f"""{HEAD}{WATCHDOG_OFF}
        clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
loop    call    pulse
        goto    loop
pulse   bsf     PORTB, 0
        movlw   50
        movwf   0x20
wait    decfsz  0x20, f
        goto    wait
        bcf     PORTB, 0
        return
never   nop
        end
"""
TURN = 2 + 2 + 3 + 50 * 3 - 1 + 1 + 2
"""Cycles of one turn of the loop: CALL, GOTO, and the routine."""


def observed() -> tuple[Machine, Listing]:
    assembly = assemble(SOURCE, "blink.asm")
    functions = (ListedFunction("main", 0, 6), ListedFunction("pulse", 6, 13))
    listing = assembly.listing
    rows = tuple(ListingRow(r.address, r.word, r.assembly, r.cycles, r.file, r.line) for r in listing.rows)
    return Machine(assembly.image, CLOCK), Listing(rows, functions, (), (("blink.asm", SOURCE),))


def test_observing_changes_nothing() -> None:
    watched, _ = observed()
    free, _ = observed()
    chunks = [chunk for chunk, _ in watched.observe(5000, Observation())]
    free_edges = edges(free, 5000)
    assert sum(len(chunk.cycle) for chunk in chunks) == len(free_edges)
    assert watched.state() == free.state()
    assert watched.fingerprint() == free.fingerprint()


def test_a_profile_accounts_for_every_cycle() -> None:
    chip, listing = observed()
    found = profile(chip, 4 + 10 * TURN, listing)
    assert found.cycles == 4 + 10 * TURN
    assert found.idle == 0
    assert sum(spent.cycles for spent in found.words.values()) == found.cycles
    assert found.functions["pulse"].cycles == 10 * (TURN - 4)
    assert found.functions["main"].cycles == 4 + 10 * 4
    line = 1 + SOURCE.splitlines().index("wait    decfsz  0x20, f")
    assert found.lines["blink.asm", line].executions == 500
    assert found.lines["blink.asm", line].cycles == 510


def test_coverage_names_what_was_never_executed() -> None:
    chip, listing = observed()
    found = profile(chip, 1000, listing)
    assert found.unexecuted == (13,)
    assert found.coverage == pytest.approx(13 / 14)
    assert (found.deepest_stack, found.ram_high_water, found.read_unwritten) == (1, 1, ())


def test_cycles_of_no_instruction_are_idle() -> None:
    found = profile(machine(" nop\n sleep\n"), 1000)
    assert (found.idle, found.words[1].cycles) == (998, 1)


def test_a_trace_has_every_instruction_with_its_source_line() -> None:
    chip, listing = observed()
    rows = list(trace(chip, 4 + TURN, listing))
    assert [row.cycle for row in rows[:6]] == [0, 1, 2, 3, 4, 6]
    assert [row.pc for row in rows[:6]] == [0, 1, 2, 3, 4, 6]
    assert len(rows) == 4 + 2 + 5 + 2 * 50 - 1
    assert rows[5].source == "pulse   bsf     PORTB, 0"
    assert rows[7].w == 50
    text = str(rows[5])
    assert "PORTB" in text.upper()
    assert "blink.asm" in text


def test_a_trace_without_a_listing_disassembles() -> None:
    rows = list(trace(machine(" movlw 0x12\n addwf 0x20, f\n btfss STATUS, 2\n goto $\n"), 3))
    assert [row.assembly for row in rows] == ["MOVLW 0x12", "ADDWF 0x20, F", "BTFSS 0x03, 2"]
    assert rows[1].status == 0x18


def test_a_long_trace_is_given_in_pieces_without_a_gap() -> None:
    chip, _ = observed()
    cycles = [row.cycle for row in trace(chip, 60_000)]
    assert len(cycles) > 2 << 14
    assert all(0 < b - a <= 2 for a, b in pairwise(cycles))


def test_breakpoints_hold_while_observing() -> None:
    chip, _ = observed()
    chip.breakpoints = {7}
    for _ in chip.observe(1000, Observation()):
        pass
    assert chip.pc == 7
