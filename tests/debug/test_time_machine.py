"""The time machine: every moment is what a fresh run finds there."""

from __future__ import annotations

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.debug import time_machine
from servogen.debug.time_machine import TimeMachine
from servogen.edges import PINS
from servogen.pic.device import device
from servogen.simulator import LevelChange, Machine, Periodic, Recorded, Stimuli, trace
from servogen.units import Clock
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


@pytest.mark.parametrize("seed", range(6))
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
