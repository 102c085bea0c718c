"""A snapshot is complete: what follows it is what follows in a fresh run, as often as it is restored."""

from __future__ import annotations

import pytest

from servogen.simulator import Machine, Periodic, SimulatorOptions, Stimuli
from tests.campaigns import sampled
from tests.simulator.helpers import CLOCK, image, machine
from tests.simulator.programs import tame_image, wild_image
from tests.simulator.test_exact import CYCLES, Case, rows, seen

SEEDS = range(60)
BEFORE = 700


def case(seed: int) -> Case:
    return Case(seed, (tame_image if seed % 2 else wild_image)(seed))


@pytest.mark.parametrize("seed", sampled(SEEDS, 20))
def test_a_restored_machine_continues_as_a_fresh_run_does(seed: int) -> None:
    """The cases have interrupts, sleep, watchdog resets, EEPROM writes and stimuli at random moments."""
    fresh = case(seed).machine()
    before, after = rows(fresh.run(BEFORE)), rows(fresh.run(CYCLES))
    chip = case(seed).machine()
    assert rows(chip.run(BEFORE)) == before
    kept = chip.snapshot()
    at_snapshot = seen(chip)
    for _ in range(2):
        assert rows(chip.run(CYCLES)) == after
        assert seen(chip) == seen(fresh)
        chip.restore(kept)
        assert seen(chip) == at_snapshot
    other = case(seed).machine()
    other.run(CYCLES // 2)
    other.restore(kept)
    assert rows(other.run(CYCLES)) == after


def test_the_cases_are_in_the_midst_of_something() -> None:
    """At their snapshots some sleep, some write the EEPROM, some have changes still to come."""
    chips = [case(seed).machine() for seed in SEEDS]
    for chip in chips:
        chip.run(BEFORE)
    states = [chip.state() for chip in chips]
    assert any(state.sleeping for state in states)
    assert any(state.interrupts for state in states)
    assert any(state.resets["watchdog"] for state in states)
    assert any(state.resets["mclr"] for state in states)
    assert any(change[0] > BEFORE for seed in SEEDS for change in case(seed).changes)


def test_a_snapshot_of_an_endless_stimulus_is_not_used_up() -> None:
    source = Periodic(pin=0, period=CLOCK.cycles_per_second / 40_000, high=CLOCK.cycles_per_second / 80_000)
    text = " bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\nl movf PORTA, w\n movwf PORTB\n goto l\n"
    chip = Machine(image(text), CLOCK, stimulus=Stimuli([source]))
    chip.run(1000)
    kept = chip.snapshot()
    first = rows(chip.run(400_000))  # several pieces of changes
    chip.restore(kept)
    assert len(first) > 10_000
    assert rows(chip.run(400_000)) == first


def test_edges_that_were_not_yet_returned_are_part_of_a_snapshot() -> None:
    text = " clrf PORTB\n bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\nl comf PORTB, f\n goto l\n"
    chip = machine(text)
    stream = chip.stream(200_000)
    next(stream)
    kept = chip.snapshot()
    rest = [row for chunk in stream for row in rows(chunk)]
    chip.restore(kept)
    assert rows(chip.run(200_000 - chip.cycles)) == rest


def test_a_snapshot_of_another_image_is_refused() -> None:
    kept = machine(" nop\n").snapshot()
    with pytest.raises(ValueError, match="another image"):
        machine(" sleep\n").restore(kept)


def test_a_tracked_machine_keeps_its_unknown_bits() -> None:
    text = " movf 0x20, w\n clrf 0x21\n movwf 0x21\n btfsc 0x21, 0\n nop\nl goto l\n"
    chip = Machine(image(text), CLOCK, SimulatorOptions(), tracked=True)
    chip.run(2)
    kept, unknown = chip.snapshot(), chip.unknown()
    chip.run(100)
    used = chip.chip_dependent
    assert used
    chip.restore(kept)
    assert chip.unknown() == unknown
    assert not chip.chip_dependent
    chip.run(100)
    assert chip.chip_dependent == used
