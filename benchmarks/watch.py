"""The time machine of `servogen watch`: how long it takes to reach a moment and to step back.

Run: `python benchmarks/watch.py [SECONDS]`. The committed programs run for SECONDS (default 60) of their own
time; then come random jumps within them and steps back from random moments. The times are the
processor's. Exit code 1 when a demand is missed.
"""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable
from pathlib import Path

from servogen.debug.time_machine import TimeMachine
from servogen.engines.board import board_of, inputs_of
from servogen.programs import read_program, read_schedule

ROOT = Path(__file__).parent.parent
PROGRAMS = ("lab8-exercise", "hexapod-tripod", "stream-arm", "omni-square")
JUMPS, STEPS = 300, 300
SEEK_S, BACK_S, SHARE = 0.050, 0.002, 0.99


def main() -> int:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    met = [_measure(name, seconds) for name in PROGRAMS]
    return 0 if all(met) else 1


def _measure(name: str, seconds: float) -> bool:
    folder = ROOT / "firmware" / name
    schedule = read_schedule(folder / "schedule.json")
    image = read_program(folder / "main.hex").image
    machine = TimeMachine(image, schedule.clock, board_of(schedule), inputs_of(schedule))
    end = schedule.clock.round_seconds(seconds)
    begin = time.process_time()
    machine.seek(end)
    ran = time.process_time() - begin
    dice = random.Random(1)

    def jump() -> None:
        machine.seek(dice.randrange(end))

    def back() -> None:
        machine.step(-1)

    jumps = _times(JUMPS, jump)
    backs = _times(STEPS, back, before=jump)
    seek, step = jumps[int(SHARE * JUMPS) - 1], backs[int(SHARE * STEPS) - 1]
    print(
        f"{name:<16} {seconds:g} s run in {ran:.2f} s, {machine.snapshots} snapshots; "
        f"seek: median {1000 * jumps[JUMPS // 2]:.2f} ms, 99 of 100 within {1000 * seek:.2f} ms; "
        f"one instruction back: median {1000 * backs[STEPS // 2]:.2f} ms, "
        f"99 of 100 within {1000 * step:.2f} ms"
    )
    return seek <= SEEK_S and step <= BACK_S


def _times(count: int, work: Callable[[], None], before: Callable[[], None] = lambda: None) -> list[float]:
    """Return how long each of `count` calls takes, in seconds, sorted."""
    taken = []
    for _ in range(count):
        before()
        begin = time.process_time()
        work()
        taken.append(time.process_time() - begin)
    return sorted(taken)


if __name__ == "__main__":
    sys.exit(main())
