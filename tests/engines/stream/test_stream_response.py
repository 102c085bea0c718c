"""The bound of the stream's C: what it needs and what the interrupts leave it, for every line."""

import random
import re
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.engines.board import board_of
from servogen.engines.firmware import Firmware
from servogen.engines.stream.firmware import compiled
from servogen.engines.stream.response import Response, response
from servogen.job import loads, plan_job
from servogen.pic.device import RAM_FIRST, RAM_LAST
from servogen.pic.isa import encode
from servogen.pic.known_values import word_of
from servogen.pic.listing import Listing
from servogen.simulator import Machine, Observation, Stimuli
from tests.campaigns import sampled
from tests.engines.stream.stream_line import talk
from tests.engines.stream.stream_soak import JOBS, firmware_of, line_of

ROUND = 256


@cache
def made(name: str):  # type: ignore[no-untyped-def]
    return firmware_of(plan_job(loads((JOBS / f"{name}.toml").read_text(), name)))


@cache
def firmware(name: str, dialect: str = "c2c") -> Firmware:
    job = plan_job(loads((JOBS / f"{name}.toml").read_text(), name))
    return compiled(job, made(name).streamed, dialect)


@pytest.mark.parametrize(
    ("supply", "between", "after_command"),
    [
        # prepare 100, execute 50. Every slot with a command: 150 of 150 leave nothing behind.
        (150, 1, 100),
        # one cycle is left behind in every slot: ever more
        (149, 1, None),
        # every other slot: 25 are left behind, 125 of 125 in the next slot
        (125, 2, 125),
        # 248 of 250 in two slots: ever more; in three slots 372 of 350, 26 of them after the first one.
        (124, 2, None),
        (124, 3, 126),
        (99, 9, None),
    ],
)
def test_what_a_command_leaves_undone_is_added_to_the_next_pulse(
    supply: int, between: int, after_command: int | None
) -> None:
    found = Response(100, 50, supply, between, 0)  # type: ignore[arg-type]
    assert found.after_command == after_command


def rows_of(name: str, seconds: float, seed: int) -> tuple[Firmware, list[tuple[int, int]]]:
    """Return a job's firmware and the (cycle, address) rows of a run with a busy line."""
    found, program = made(name), firmware(name)
    line = line_of(found, seed)
    line.dice = random.Random(seed)
    talk(line, seconds)
    plan = found.streamed.plan.schedule
    machine = Machine(program.compilation.image, plan.clock, board_of(plan), Stimuli([line]))
    machine.run(found.first_rise)
    rows = Observation(trace=np.zeros((1 << 16, 4), dtype=np.int64))
    pieces = [piece for _, piece in machine.observe(int(line.now) - machine.cycles, rows)]
    return program, [(int(cycle), int(at)) for cycle, at, *_ in np.concatenate(pieces)[:, :2].tolist()]


def slots_of(listing: Listing, rows: list[tuple[int, int]]) -> list[tuple[int, int | None]]:
    """Return the cycles of C from each request to the next, and to the end of the preparation."""
    due = listing.variable("due")
    words = listing.words
    interrupt = next(each for each in listing.functions if each.name == "interrupt")
    main = next(each for each in listing.functions if each.name == "main")
    request = next(at for at in range(interrupt.start, interrupt.end) if words[at] == 0x1480 | due)
    clear = next(at for at in range(main.start, main.end) if words[at] == 0x0580 | due)
    found: list[tuple[int, int | None]] = []
    spent, prepared, begun = 0, None, False
    for (cycle, at), (after, following) in pairwise(rows):
        inside = interrupt.start <= at < interrupt.end
        if at == request:
            if begun:
                found.append((spent, prepared))
            spent, prepared, begun = 0, None, True
        elif not inside:
            # What passes before the interrupt's first instruction is its latency.
            spent += 1 if following == interrupt.start else after - cycle
            if at == clear:
                prepared = spent
    return found


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["stream-arm", "stream-eight", "stream-fast"])
def test_no_slot_of_a_busy_line_leaves_less_or_needs_more_than_the_bounds(name: str) -> None:
    program, rows = rows_of(name, {"stream-fast": 0.12}.get(name, 0.4), 5)
    found = slots_of(program.compilation.listing, rows)
    one, after_command = program.timing_budgets
    assert len(found) > 40
    assert min(spent for spent, _ in found) >= one.room
    needed = [needed for _, needed in found if needed is not None]
    assert len(needed) == len(found)
    assert one.worst is not None
    if after_command.worst is not None:
        assert max(needed) <= after_command.worst
    # The bounds are not loose: a run comes near to what is left.
    assert min(spent for spent, _ in found) <= 2 * one.room


@pytest.mark.parametrize("dialect", sampled(["c2c", "xc8", "sdcc"]))
@pytest.mark.parametrize("name", sampled(["stream-fast", "stream-arm", "stream-eight"]))
def test_every_pulse_is_prepared_in_time_for_every_line(name: str, dialect: str) -> None:
    budgets = firmware(name, dialect).timing_budgets
    assert len(budgets) == 2
    assert all(budget.left is not None and budget.left >= 0 for budget in budgets)


def test_a_cycle_more_of_c_is_a_cycle_more_of_the_bound_and_a_round_more_its_cycles() -> None:
    program = firmware("stream-fast")
    job = plan_job(loads((JOBS / "stream-fast.toml").read_text(), "stream-fast"))
    streamed = made("stream-fast").streamed
    before = response(program.compilation.listing, 43, 6000, 15_000)
    text = program.text.replace("st_up:", "st_up:\n    nop", 1)
    assert text != program.text
    changed = compile_sources([Source(text, "main.c2c.c")], Options(device=job.device))
    after = response(changed.listing, 43, 6000, 15_000)
    assert before.prepare is not None
    assert before.supply is not None
    assert after.prepare == before.prepare + 1
    assert (after.supply, after.execute) == (before.supply, before.execute)
    longer = response(program.compilation.listing, 44, 6000, 15_000)
    assert longer.supply is not None
    plain = longer.supply - before.supply
    # A round without an edge: two interrupts, each of 4 cycles of latency, the context (4 and 5), the longest
    # look (42 with its CALL) and 18 cycles around it; an instruction of 2 cycles delays it by one.
    assert ROUND - 2 * 100 <= plain <= ROUND - 2 * (4 + 9 + 42)
    # With 256 cycles more to go the division's loop makes a turn more: 8 cycles (MOVF to GOTO).
    farther = response(program.compilation.listing, 43, 6256, 15_000)
    assert farther.prepare == before.prepare + 8
    assert replace(farther, prepare=before.prepare) == before
    assert streamed.layout.rounds == 43


def bound_of(before: str, after: str) -> Response:
    built = firmware("stream-arm")
    assert built.text.count(before) == 1
    text = built.text.replace(before, after)
    listing = compile_sources([Source(text, built.file)], Options()).listing
    return response(listing, 13, 1256, 11_412)


def test_a_request_may_come_at_the_beginning_of_a_long_turn_without_one() -> None:
    usual = bound_of("execute();\n        }", "execute();\n        }")
    long = bound_of("execute();\n        }", "execute();\n        } else { asm {\n" + "nop\n" * 50 + "} }")
    assert usual.prepare is not None and long.prepare is not None
    assert 50 <= long.prepare - usual.prepare <= 52


@pytest.mark.campaign
def test_every_way_through_masked_interrupts_counts() -> None:
    end = "bsf     0x08, 1             ; WR\n"
    assert bound_of(end, end).masked == 9
    assert bound_of(end, end + "    nop\n" * 3).masked == 12
    longer = "    btfsc   INTCON, 2\n    goto    $+1\n    nop\n"
    assert bound_of(end, end + longer).masked == 13


def test_the_page_has_the_figures_of_the_jobs() -> None:
    page = (Path(__file__).parents[3] / "docs" / "firmware.md").read_text()
    row = r"^\| `(stream-\w+)` \| (\d+) rounds \| (\d+) \| (\d+) \| \d+ \| (yes|no) \|$"
    found = {job: rest for job, *rest in re.findall(row, page, re.M)}
    assert len(found) == 3
    for job, (rounds, left, pulse, in_time) in found.items():
        one, after_command = firmware(job).timing_budgets
        assert (made(job).streamed.layout.rounds, one.room, one.worst) == (int(rounds), int(left), int(pulse))
        assert ((after_command.left or -1) >= 0) == (in_time == "yes")


def test_where_variables_are_does_not_change_what_the_interrupt_leaves() -> None:
    """Every byte of the RAM is at its mirror image; a cycle more where there was a NOP is seen there, too."""
    listing = firmware("stream-arm").compilation.listing

    def mirrored(address: int) -> int:
        return RAM_FIRST + RAM_LAST - address

    def moved(word: int) -> int:
        decoded = word_of(word)
        in_ram = decoded.has_f and RAM_FIRST <= decoded.f <= RAM_LAST
        return word & ~0x7F | mirrored(decoded.f) if in_ram else word

    elsewhere = replace(
        listing,
        rows=tuple(replace(row, word=moved(row.word)) for row in listing.rows),
        variables=tuple((mirrored(at), name, size) for at, name, size in listing.variables),
    )
    bounds = [response(each, 13, 1000, 5000) for each in (listing, elsewhere)]
    assert bounds[0].supply is not None and bounds[0].supply == bounds[1].supply
    busier = replace(
        elsewhere,
        rows=tuple(
            replace(row, word=encode("GOTO", k=row.address + 1)) if row.word == encode("NOP") else row
            for row in elsewhere.rows
        ),
    )
    slower = response(busier, 13, 1000, 5000).supply
    assert slower is None or slower < bounds[0].supply
