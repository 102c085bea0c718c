"""Stepping back n instructions equals a fresh run to that moment.

    python -m tests.debug.stepping_back [STEPS]

goes back STEPS times (default 10 000) by random numbers of instructions, in random programs with timers,
interrupts, EEPROM writes, watchdog, SLEEP and stimuli, and in the committed stream firmware that receives
bytes, each with changes applied live at random moments. The second witness is a chip that runs once from
power-up, with all changes known beforehand and no snapshot. Exit code 1 at the first difference.
"""

from __future__ import annotations

import random
import sys
from fractions import Fraction
from pathlib import Path

from servogen.debug.time_machine import TimeMachine
from servogen.pic.image import Image, read_hex
from servogen.simulator import LevelChange, Machine, Recorded, Serial, SimulatorOptions, Stimuli, trace
from servogen.simulator.sources import pin_number
from tests.simulator.helpers import CLOCK
from tests.simulator.programs import random_stimuli, tame_image, wild_image
from tests.simulator.test_exact import seen

ROOT = Path(__file__).parent.parent.parent
STREAM = ROOT / "firmware" / "stream-arm" / "main.hex"
PER_PROGRAM = 50


class Surroundings:
    """A program, its options and its stimulus."""

    def __init__(self, seed: int) -> None:
        self.serial = seed % 5 == 0
        self.cycles = 300_000 if self.serial else 60_000
        self.image: Image = (
            read_hex(STREAM.read_text(), STREAM.name).image
            if self.serial
            else (wild_image if seed % 5 == 1 else tame_image)(seed)
        )
        self.options = SimulatorOptions(watchdog_us=(18_000, 397, 2400)[seed % 3], eeprom_write_us=50)
        changes = [] if self.serial else random_stimuli(seed, self.cycles - 50)
        self.known = Recorded([LevelChange(*change) for change in changes])

    def time_machine(self) -> TimeMachine:
        return TimeMachine(self.image, CLOCK, self.options, Stimuli([self.known]))

    def fresh(self, live: tuple[LevelChange, ...]) -> Machine:
        return Machine(self.image, CLOCK, self.options, Stimuli([self.known, Recorded(live)]))

    def live(self, rng: random.Random, now: int) -> list[LevelChange]:
        """Return what somebody does just now: sends some bytes, or moves a pin."""
        if self.serial:
            data = bytes([0xFF, rng.randrange(3), rng.randrange(255)])
            sent = Serial(pin_number("RA4"), data, Fraction(2400), start=now + 1)
            return [change for change in sent.changes(CLOCK) if change.cycle > now]
        return [LevelChange(now + rng.randrange(1, 40), rng.randrange(14), rng.choice((1, 1, 0, 2)))]


def check(seed: int, steps: int) -> None:
    """Go back `steps` times in one program. Raises AssertionError at a difference."""
    rng = random.Random(seed)
    around = Surroundings(seed)
    machine = around.time_machine()
    for _ in range(4):  # an input in the past makes another future
        machine.seek(rng.randrange(around.cycles))
        machine.apply(around.live(rng, machine.now))
    machine.seek(around.cycles)
    starts = [row.cycle for row in trace(around.fresh(machine.inputs), around.cycles)]
    arrived = []
    for _ in range(steps):
        place = rng.randrange(len(starts))
        back = (
            rng.randrange(1, place + 1) if rng.random() < 0.3 and place else min(place, rng.randrange(1, 30))
        )
        machine.seek(starts[place])
        assert machine.now == starts[place]
        if back:
            assert machine.step(-back) == back
        assert machine.now == starts[place - back], (seed, place, back)
        arrived.append((machine.now, seen(machine.machine), machine.machine.levels))
    fresh = around.fresh(machine.inputs)
    for cycle, state, levels in sorted(arrived, key=lambda each: each[0]):
        fresh.run(cycle - fresh.cycles)
        assert (seen(fresh), fresh.levels) == (state, levels), (seed, cycle)


def main() -> int:
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    for seed in range(-(-steps // PER_PROGRAM)):
        check(seed, PER_PROGRAM)
    print(f"{steps} steps back in {-(-steps // PER_PROGRAM)} programs: each equals a fresh run")
    return 0


if __name__ == "__main__":
    sys.exit(main())
