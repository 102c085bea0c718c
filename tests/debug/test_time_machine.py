"""The time machine: every moment is what a fresh run finds there."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Any

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.debug import time_machine
from servogen.debug.time_machine import TimeMachine
from servogen.edges import PINS, UNDRIVEN
from servogen.pic.device import device
from servogen.pic.listing import Listing, ListingRow
from servogen.simulator import LevelChange, Machine, Periodic, Recorded, Stimuli, trace
from servogen.units import Clock
from tests.campaigns import sampled
from tests.debug.stepping_back import check
from tests.simulator.helpers import CLOCK, image
from tests.simulator.test_exact import rows, seen

BLINK = """
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
frame   bsf     PORTB, 0
        call    wait
        bcf     PORTB, 0
        call    wait
        goto    frame
wait    movlw   200
        movwf   0x20
loop    decfsz  0x20, f
        goto    loop
        return
"""


@pytest.mark.parametrize("seed", sampled(range(5), 2))
def test_stepping_back_equals_a_fresh_run(seed: int) -> None:
    """10 000 steps: `python -m tests.debug.stepping_back`."""
    check(seed, 6)


def test_a_chip_that_sleeps_is_stepped_back_over_its_whole_sleep() -> None:
    machine = TimeMachine(image(" nop\n sleep\n nop\nend_ goto end_\n"), CLOCK)
    machine.seek(5000)
    assert machine.now == 5000 and machine.machine.asleep
    assert machine.step(-1) == 1
    assert machine.now == 1 and not machine.machine.asleep
    assert machine.step(-5) == 1  # there is one instruction only before
    assert machine.now == 0


def test_a_step_forwards_executes_so_many_instructions() -> None:
    machine = TimeMachine(image(BLINK), CLOCK)
    assert machine.step(3) == 3
    assert machine.now == 3
    assert machine.step(2) == 2  # BSF, one cycle; CALL, two
    assert machine.now == 6


def test_edges_are_stepped_to_forwards_and_backwards() -> None:
    """A half is BSF or BCF, CALL, 2 cycles to load, 199 turns of 3, one of 2, RETURN; GOTO adds 2 to one."""
    machine = TimeMachine(image(BLINK), CLOCK)
    stops = []
    while len(stops) < 40:
        assert machine.step_edge(forwards=True)
        stops.append(machine.now)
    made = Machine(image(BLINK), CLOCK).run(stops[-1])
    pin = PINS.index("RB0")
    rises = made.cycle[(made.pin == pin) & (made.level == 1)].tolist()
    assert rises[0] == 3 and rises[1] - rises[0] == 2 * (1 + 2 + 2 + 597 + 2 + 2) + 2
    assert stops[1:3] == [rises[0] + 1, rises[0] + 1 + 606]
    for earlier in reversed(stops[:-1]):
        assert machine.step_edge(forwards=False)
        assert machine.now == earlier
    assert not machine.step_edge(forwards=False)
    assert machine.now == stops[0]


def test_edges_of_one_pin_are_found_beyond_those_of_others() -> None:
    machine = TimeMachine(image(BLINK), CLOCK)
    machine.seek(100_000)
    assert machine.step_edge(forwards=False, pins={PINS.index("RB3")})
    assert machine.now == 2  # TRISB was cleared, which drives RB3 low
    assert not machine.step_edge(forwards=True, pins={PINS.index("RB3")}, limit=10_000)


def test_edges_of_a_window_are_those_of_a_run_from_the_beginning() -> None:
    machine = TimeMachine(image(BLINK), CLOCK)
    machine.seek(200_000)
    here = machine.now
    found = rows(machine.edges(50_000, 60_000))
    every = rows(Machine(image(BLINK), CLOCK).run(60_000))
    assert found == [row for row in every if 50_000 <= row[0] < 60_000]
    assert machine.now == here
    assert machine.levels_before(4)[PINS.index("RB0")] == 1
    assert machine.levels_before(3)[PINS.index("RB0")] == 0
    assert machine.levels_before(0)[PINS.index("RB0")] == 2


C = """\
#pragma CLOCK_FREQ 4000000
int n;
void main(void)
{
    n = 1;
    n = n + 1;
    delay_ms(200);
    while (1) {
        n = n + 2;
        n = n - 1;
    }
}
"""


def compiled() -> TimeMachine:
    done = compile_sources([Source(C, "lines.c")], Options(dialect="c2c", device=device("PIC16F84")))
    return TimeMachine(done.image, Clock(4_000_000), listing=done.listing)


def line(machine: TimeMachine) -> int | None:
    number = int(machine.line_ids[machine.machine.pc])
    return None if number == time_machine.NO_LINE else machine.lines[number][1]


def test_lines_are_stepped_forwards_and_backwards() -> None:
    machine = compiled()
    visited = []
    while len(visited) < 9:
        assert machine.step_line(forwards=True)
        visited.append((line(machine), machine.now))
    lines = [number for number, _ in visited if number is not None]
    assert lines == [5, 6, 7, 9, 10, 8, 9, 10, 8][: len(lines)] or lines[1:] == [5, 6, 7, 9, 10, 8, 9, 10]
    for earlier in reversed(visited[:-1]):
        assert machine.step_line(forwards=False)
        assert (line(machine), machine.now) == earlier


def test_a_run_stops_before_an_address_wherever_it_begins() -> None:
    machine = TimeMachine(image(BLINK), CLOCK)
    rises = [3 + 1214 * n for n in range(60)]
    found = []
    while len(found) < 60:
        assert machine.run(machine.now + 100_000, stops={3})
        found.append(machine.now)
    assert found == rises
    assert not machine.run(machine.now + 1212, stops={3})  # the jump to it comes next


def test_a_run_that_ends_at_an_address_stops_there() -> None:
    machine = TimeMachine(image(BLINK), CLOCK)
    assert machine.run(3, stops={3})


def test_an_input_is_applied_again_and_another_past_makes_another_future() -> None:
    text = " bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\nl movf PORTA, w\n movwf PORTB\n goto l\n"
    machine = TimeMachine(image(text), CLOCK)
    machine.seek(50_000)
    machine.apply([LevelChange(50_001, 0, 1), LevelChange(70_000, 0, 0)])
    machine.seek(100_000)
    later = seen(machine.machine)
    assert [row[0] // 1000 for row in rows(machine.edges(3, 100_000))] == [50, 70]
    machine.seek(10)
    machine.seek(100_000)
    assert seen(machine.machine) == later
    machine.seek(60_000)
    machine.apply([LevelChange(60_001, 0, 0)])
    assert machine.reach == machine.now
    machine.seek(100_000)
    assert [row[0] // 1000 for row in rows(machine.edges(3, 100_000))] == [50, 60]
    machine.seek(20_000)
    machine.apply([LevelChange(20_001, 1, 1)])
    machine.seek(100_000)
    assert [row[0] // 1000 for row in rows(machine.edges(3, 100_000))] == [20]


def test_an_input_in_the_past_or_of_no_pin_is_refused() -> None:
    machine = TimeMachine(image(BLINK), CLOCK)
    machine.seek(101)
    for change in (LevelChange(100, 0, 1), LevelChange(200, 14, 1), LevelChange(200, 0, 3)):
        with pytest.raises(ValueError, match="cannot be applied in cycle 101"):
            machine.apply([change])
    assert machine.inputs == ()


def test_an_input_at_the_current_moment_acts_as_if_it_had_been_known_before() -> None:
    text = " bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\nl movf PORTA, w\n movwf PORTB\n goto l\n"
    for cycle in range(50, 55):
        machine = TimeMachine(image(text), CLOCK)
        machine.seek(cycle)
        change = LevelChange(machine.now, 0, 1)
        machine.apply([change])
        machine.seek(100)
        known = Machine(image(text), CLOCK, stimulus=Stimuli([Recorded([change])]))
        known.run(machine.now)
        assert seen(machine.machine) == seen(known)
        machine.seek(20)
        machine.seek(100)
        assert seen(machine.machine) == seen(known)


def test_changes_that_are_applied_follow_those_of_an_endless_stimulus() -> None:
    """The chip copies port A to port B; the stimulus moves RA0 in pieces of 4096 changes."""
    text = " bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\nl movf PORTA, w\n movwf PORTB\n goto l\n"
    source = Stimuli(
        [Periodic(pin=0, period=CLOCK.cycles_per_second / 40_000, high=CLOCK.cycles_per_second / 80_000)]
    )
    chip = Machine(image(text), CLOCK, stimulus=source)
    chip.run(1000)
    chip.apply([LevelChange(250_000, 1, 1)])
    made = chip.run(300_000)
    assert made.cycle[(made.pin == PINS.index("RB1")) & (made.level == 1)].tolist()[0] - 250_000 in range(8)
    plain = Machine(image(text), CLOCK, stimulus=source)
    plain.run(1000)
    rest = plain.run(300_000)
    ra0 = PINS.index("RB0")
    assert made.cycle[made.pin == ra0].tolist() == rest.cycle[rest.pin == ra0].tolist()


def test_old_snapshots_are_thinned_out_and_every_moment_stays_within_reach(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(time_machine, "MAX_SNAPSHOTS", 40)
    monkeypatch.setattr(time_machine, "RECENT_S", time_machine.SPACING_S * 10)
    machine = TimeMachine(image(BLINK), CLOCK)
    machine.seek(10_000_000)
    assert machine.snapshots <= 40
    fresh = Machine(image(BLINK), CLOCK)
    for moment in (123_456, 5_000_000, 9_876_543):
        machine.seek(moment)
        fresh.run(moment - fresh.cycles)
        assert seen(machine.machine) == seen(fresh)
        assert machine.snapshots <= 40


def test_the_executed_instructions_are_those_of_a_trace() -> None:
    machine = TimeMachine(image(BLINK), CLOCK)
    machine.seek(90_000)
    every = [(row.cycle, row.pc) for row in trace(Machine(image(BLINK), CLOCK), machine.now)]
    before = seen(machine.machine)
    assert [tuple(row) for row in machine.executed(30_000)[:, :2].tolist()] == every[-30_000:]
    assert seen(machine.machine) == before


SHORT = """
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
        movlw   3
        movwf   0x20
loop    bsf     PORTB, 0
        call    sub
        bcf     PORTB, 0
        decfsz  0x20, f
        goto    loop
end_    goto    end_
sub     comf    PORTB, f
        nop
        return
"""
LINES = (1, 1, 2, None, 3, 4, 5, 4, None, 6, 7, 8, None, 8)
"""The source lines of its words; two belong to none."""


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> TimeMachine:
    """A program of 62 cycles up to its last loop, with a snapshot every 7 cycles."""
    monkeypatch.setattr(time_machine, "SPACING_S", Fraction(7, 1_000_000))
    monkeypatch.setattr(time_machine, "LINE_S", Fraction(100, 1_000_000))
    listing = Listing(
        tuple(ListingRow(at, 0, "NOP", "1", "a.c" if line else None, line) for at, line in enumerate(LINES)),
        (),
    )
    return TimeMachine(image(SHORT), CLOCK, listing=listing)


SHORT_TRACE = [(row.cycle, row.pc) for row in trace(Machine(image(SHORT), CLOCK), 70)]
SHORT_EDGES = rows(Machine(image(SHORT), CLOCK).run(70))


def test_any_number_of_steps_from_any_moment_is_that_many_instructions_of_the_trace(
    short: TimeMachine,
) -> None:
    starts = [cycle for cycle, _ in SHORT_TRACE]
    for place in range(len(starts) - 12):
        for count in (0, 1, 2, 11, -1, -2, -7, -1000):
            short.seek(starts[place])
            done, reach = max(count, -place), short.reach
            assert (short.step(count), short.now) == (abs(done), starts[place + done])
            assert short.reach == max(reach, short.now)
        short.seek(starts[place])
        for limit in (1, 5, 1000):
            expected = SHORT_TRACE[max(0, place - limit) : place]
            assert [tuple(row) for row in short.executed(limit)[:, :2].tolist()] == expected[-limit:]


def test_a_moment_is_the_first_beginning_of_an_instruction_that_is_not_before_the_cycle(
    short: TimeMachine,
) -> None:
    starts = [cycle for cycle, _ in SHORT_TRACE]
    for cycle in [*range(60), *range(59, -1, -1), *range(0, 60, 17), -5]:
        short.seek(cycle)
        assert short.now == next(start for start in starts if start >= cycle)
        before = [UNDRIVEN] * len(PINS)
        for made, pin, level in SHORT_EDGES:
            before[pin] = level if made < short.now else before[pin]
        assert short.levels_before(cycle) == short.machine.levels == tuple(before)
        for end in (cycle, cycle + 1, cycle + 20):
            assert rows(short.edges(cycle, end)) == [row for row in SHORT_EDGES if cycle <= row[0] < end]


def test_an_edge_is_stepped_to_from_any_moment(short: TimeMachine) -> None:
    """To the first moment after the next edge, or back to the latest such moment that is before this one."""
    starts = [cycle for cycle, _ in SHORT_TRACE]
    rb0, rb3 = PINS.index("RB0"), PINS.index("RB3")
    for pins in (frozenset[int](), frozenset((rb3,)), frozenset((rb0, rb3)), frozenset((0,))):
        edges = [cycle for cycle, pin, _ in SHORT_EDGES if not pins or pin in pins]
        after = [next(start for start in starts if start > edge) for edge in edges]
        for start in starts[:-5]:
            short.seek(start)
            later = [moment for moment, edge in zip(after, edges, strict=True) if edge >= start]
            assert short.step_edge(forwards=True, pins=pins, limit=70 - start) == bool(later)
            if later:
                assert short.now == later[0]
            short.seek(start)
            earlier = [moment for moment in after if moment < start]
            assert short.step_edge(forwards=False, pins=pins) == bool(earlier)
            assert short.now == (earlier[-1] if earlier else start)


def test_a_line_is_stepped_to_from_any_moment(short: TimeMachine) -> None:
    """Words without a line belong to none; back goes to the beginning of the line that ran last."""
    lines = [(cycle, LINES[address]) for cycle, address in SHORT_TRACE]
    for place, (start, here) in enumerate(lines[:-8]):
        short.seek(start)
        later = [cycle for cycle, line in lines[place + 1 :] if line not in (None, here)]
        assert short.step_line(forwards=True) == bool(later)
        if later:
            assert short.now == later[0]
        short.seek(start)
        target, last = start, None
        for cycle, line in reversed(lines[:place]):
            if line is not None and last not in (None, line):
                break
            if line is not None:
                target, last = cycle, line
        assert short.step_line(forwards=False) == (last is not None)
        assert short.now == target


def test_which_snapshots_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """One each 100 cycles, 40 at most; those older than 1000 cycles are thinned to double their distance
    until 30 are left. GOTO to itself takes two cycles, so that every hundred is reached exactly.
    """
    for name, value in (("SPACING_S", Fraction(1, 10_000)), ("RECENT_S", Fraction(1, 1000))):
        monkeypatch.setattr(time_machine, name, value)
    monkeypatch.setattr(time_machine, "MAX_SNAPSHOTS", 40)
    chip = TimeMachine(image("end_ goto end_\n"), CLOCK)

    def kept_at(*moments: int) -> list[int]:
        for moment in moments:
            chip.seek(moment)
        return chip.kept

    assert kept_at(*range(0, 4000, 100)) == [*range(0, 4000, 100)]
    assert kept_at(4000) == [*range(0, 3000, 200), *range(3000, 4001, 100)]
    assert kept_at(*range(4100, 5401, 100)) == [*range(0, 3000, 200), *range(3000, 5401, 100)]
    assert kept_at(5500) == [*range(0, 4500, 400), *range(4500, 5501, 100)]
    # A long way is gone at the distance of the old ones, up to the last 1000 cycles.
    assert kept_at(9998) == [
        *range(0, 4500, 400), *range(4500, 5501, 100), *range(5900, 9100, 400), *range(9100, 9998, 100)
    ]  # fmt: skip
    assert kept_at(10_000) == [*range(0, 4801, 800), *range(5900, 8301, 800), *range(9100, 10_001, 100)]
    # In the thinned past, all of the 1000 cycles before the moment are kept again.
    assert kept_at(2300)[:12] == [0, 800, *range(1600, 2301, 100), 2400, 3200]


@pytest.mark.parametrize("clock", [CLOCK, Clock(50_000)])
def test_of_too_many_recent_snapshots_older_ones_are_thinned_out(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of the way is recent: 400 snapshots, of which 40 are allowed."""
    for name, value in (("SPACING_S", 100 / clock.cycles_per_second), ("RECENT_S", 10)):
        monkeypatch.setattr(time_machine, name, Fraction(value))
    monkeypatch.setattr(time_machine, "MAX_SNAPSHOTS", 40)
    chip = TimeMachine(image("end_ goto end_\n"), clock)
    chip.seek(40_000)
    assert 20 <= chip.snapshots <= 40
    assert [at for at in chip.kept if at > 39_000] == [*range(39_100, 40_001, 100)]
    chip.seek(10_000)
    assert (chip.now, chip.machine.pc) == (10_000, 0)


def test_instructions_of_the_thinned_past_are_run_again_a_short_way_at_a_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A snapshot each 100 cycles, of older ones than 1000 cycles fewer. Each GOTO takes two cycles."""
    for name, value in (("SPACING_S", Fraction(1, 10_000)), ("RECENT_S", Fraction(1, 1000))):
        monkeypatch.setattr(time_machine, name, value)
    monkeypatch.setattr(time_machine, "MAX_SNAPSHOTS", 40)
    chip = TimeMachine(image("end_ goto end_\n"), CLOCK)
    chip.seek(20_000)
    chip.seek(next(after for before, after in pairwise(chip.kept) if after - before > 200))
    end, observe, begun = int(chip.now), Machine.observe, list[int]()

    def observed(machine: Machine, *given: Any) -> Any:
        begun.append(int(machine.cycles))
        return observe(machine, *given)

    monkeypatch.setattr(Machine, "observe", observed)
    rows = chip.executed(10)[:, :2].tolist()
    assert rows == [[at, 0] for at in range(end - 20, end, 2)]
    assert min(begun) >= end - 200


@pytest.mark.parametrize(("most", "found"), [(2, False), (3000, True)])
def test_the_beginning_of_a_long_line_is_not_looked_for_in_every_snapshot(
    most: int, found: bool, short: TimeMachine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The program stays in its last line, the loop at address 10, and has a snapshot every 7 cycles there."""
    monkeypatch.setattr(time_machine, "BACK_SNAPSHOTS", most)
    begun = next(cycle for cycle, address in SHORT_TRACE if address == 10)
    short.seek(begun + 100)
    assert short.step_line(forwards=False)
    assert (short.now == begun) == found
    assert found or short.now >= begun + 100 - 5 * 7


REPEATING = """
    bsf STATUS, RP0
    clrf TRISB
    bcf STATUS, RP0
again movlw 0x01
    xorwf PORTB, f
    movlw 198
    movwf 0x20
wait decfsz 0x20, f
    goto wait
    nop
    goto again
"""
"""RB0 changes every 600 cycles; the state comes back after 1200."""
COUNTING = REPEATING.replace("    nop\n", "    incf 0x21, f\n")
"""It also counts to 256: the state comes back after 256 * 600 cycles."""


@pytest.mark.parametrize(("source", "loop"), [(REPEATING, 1200), (COUNTING, 1200), (COUNTING, 153_600)])
def test_a_way_over_whole_repetitions_leads_to_the_same_state(source: str, loop: int) -> None:
    """A program that does not come back after the loop that was said is run, cycle by cycle."""
    fast, slow = TimeMachine(image(source), CLOCK, loop=loop), TimeMachine(image(source), CLOCK)
    for cycle in (3_000_123, 2_000_456, 3_000_789):
        fast.seek(cycle)
        slow.seek(cycle)
        assert (fast.now, fast.machine.state()) == (slow.now, slow.machine.state())
        assert fast.machine.edges_made == slow.machine.edges_made
        assert (
            fast.edges(cycle - 9000, cycle).cycle.tolist() == slow.edges(cycle - 9000, cycle).cycle.tolist()
        )
    assert fast.step_edge(False) and slow.step_edge(False)
    assert fast.now == slow.now
    assert fast.step(-50) == slow.step(-50) == 50
    assert fast.now == slow.now


def test_a_program_is_run_until_its_state_has_come_back() -> None:
    """Ten minutes in steps of a second: of a program that counts to 256 more are needed."""
    steps = {}
    for source in (REPEATING, COUNTING):
        chip = TimeMachine(image(source), CLOCK, loop=1200)
        steps[source] = sum(1 for _ in chip.going(600 * 10**6))
        assert chip.now - 600 * 10**6 in range(3)
    assert steps[REPEATING] < 30 < 100 < steps[COUNTING]


def test_longer_steps_find_the_same_repetition() -> None:
    """A loop of 6 s, after 16 of which the count to 256 is where it was, in six steps each or in one."""
    found = {}
    for stride_s in (1, 20):
        chip = TimeMachine(image(COUNTING), CLOCK, loop=6_000_000, stride_s=Fraction(stride_s))
        steps = sum(chip.repetition is None for _ in chip.going(600 * 10**6))
        assert chip.repetition is not None
        found[stride_s] = (
            steps // 6 if stride_s == 1 else steps,
            chip.repetition.begin,
            chip.repetition.length,
        )
    assert found[1] == found[20] == (17, 6_000_000, 96_000_000)


def test_no_way_goes_over_an_input() -> None:
    """RA0 high sets RB1 in the loop; the change lies in the middle of a long way that is gone again."""
    source = REPEATING.replace("    nop\n", "    btfsc PORTA, 0\n    bsf PORTB, 1\n")
    chips = [TimeMachine(image(source), CLOCK, loop=loop) for loop in (1202, None)]
    for chip in chips:
        chip.seek(5_000_000)
        chip.apply([LevelChange(int(chip.now) + 7, PINS.index("RA0"), 1)])
        chip.seek(9_000_000)
        assert chip.machine.levels[PINS.index("RB1")] == 1
        chip.seek(4_999_999)
        assert chip.machine.levels[PINS.index("RB1")] == 0
        chip.seek(8_765_432)
    assert chips[0].machine.state() == chips[1].machine.state()
