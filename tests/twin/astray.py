"""The twin's verdict: a program that leads an arm astray must not be "as expected".

    python -m tests.twin.astray --mutants 30 --seed 1

One word of the program of jobs/scara-pick.toml is changed. Where the plan rests, the judge compares the
widths of the mutant's pulses with the program's own, and says by elementary geometry how far the tool is from
its place. If that is far beyond [expect], the twin must say so. Exit code 1 if it does not once.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS
from servogen.engines.board import board_of
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.simulator import Machine
from tests.twin.walking import JOBS, Firmware, firmware

Floats = npt.NDArray[np.float64]
ALLOWED_MM, FAR_MM = 8.0, 20.0
"""What [expect] allows of the tool at rest, of which the right program needs 5.3; what counts as astray."""
ARM_MM = (400.0, 300.0)
"""The links of the robot "scara"."""
RATIOS = (0.75, 0.67, math.radians(0.9))
ZEROS = (math.pi / 2, math.pi / 2, 0.0)
"""What the job says of shoulder and elbow, and of the lift for each mm."""
RESTS, LASTS = 15, 10
"""Frames without a change before the plan rests, and for which a servo is led astray then."""
JITTER = 1000
"""Cycles by which a mutant's frame may begin too early."""
ASTRAY = ("NOT as expected", "not guaranteed")


def subject() -> Firmware:
    """The arm that picks; its tool is judged at rest."""
    text = (JOBS / "scara-pick.toml").read_text()
    return firmware(f"{text}\n[expect]\nend_within_mm = {ALLOWED_MM}\n")


def widths(made: Firmware, image: Image) -> Floats:
    """Return the widths in cycles of each frame's pulses after the lead-in, NaN for none."""
    schedule = made.found.plan.schedule
    frames = schedule.lead_in_frames + schedule.loop_frames
    board = board_of(schedule)
    first = PINS.index(schedule.channels[0].pin)
    begun = Machine(made.image, schedule.clock, board).run_to_edge(first, 1, 3 * schedule.period)
    chunk = Machine(image, schedule.clock, board).run((frames + 2) * schedule.period)
    assert begun is not None
    found = np.full((frames, len(schedule.channels)), np.nan)
    for number, channel in enumerate(schedule.channels):
        mine = chunk.pin == PINS.index(channel.pin)
        cycles, level = chunk.cycle[mine], chunk.level[mine]
        rises = np.flatnonzero((level[:-1] == 1) & (level[1:] == 0))
        for rise, fall in zip(cycles[rises].tolist(), cycles[rises + 1].tolist(), strict=True):
            frame = (rise - int(begun) + JITTER) // schedule.period
            if 0 <= frame < frames:
                found[frame, number] = fall - rise
    return found[schedule.lead_in_frames :]


def tool(made: Firmware, wide: Floats, planned: Floats) -> Floats:
    """Return the tool's place in mm: the servos are as linear in the width as in the plan."""
    servos = made.job.trajectory.angles[-len(planned) :]
    lines = [np.polyfit(planned[:, n], servos[:, n], 1) for n in range(3)]
    shaft = np.stack([np.polyval(line, wide[:, n]) for n, line in enumerate(lines)])
    q1, q2, down = (shaft - np.array(ZEROS)[:, None]) / np.array(RATIOS)[:, None]
    upper, lower = ARM_MM
    x = upper * np.cos(q1) + lower * np.cos(q1 + q2)
    y = upper * np.sin(q1) + lower * np.sin(q1 + q2)
    return np.stack([x, y, -down], axis=1)


def astray(made: Firmware, image: Image, planned: Floats) -> bool:
    """Return whether the pulses lead the tool far from its place while the plan rests."""
    off = np.linalg.norm(tool(made, widths(made, image), planned) - tool(made, planned, planned), axis=1)
    still = np.r_[False, (np.diff(planned, axis=0) == 0).all(axis=1)]
    resting = lasting = 0
    for rests, far in zip(still, off > FAR_MM, strict=True):
        resting = resting + 1 if rests else 0
        lasting = lasting + 1 if resting >= RESTS and far else 0
        if lasting >= LASTS:
            return True
    return False


def mutants(image: Image, rng: random.Random) -> Iterator[tuple[str, Image]]:
    """Endless: one bit of one word changed."""
    while True:
        address = rng.choice(list(image.program))
        word = image.program[address] ^ 1 << rng.randrange(14)
        if decode(word) != decode(image.program[address]):
            changed = replace(image, program={**image.program, address: word})
            yield f"0x{address:03X}: {image.program[address]:04X} -> {word:04X}", changed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    wanted = parser.parse_args()
    made, counts, began = subject(), Counter[str](), time.process_time()
    planned = widths(made, made.image)
    assert made.twin().word == "as expected" and not astray(made, made.image, planned)
    for what, image in mutants(made.image, random.Random(wanted.seed)):
        counts["mutants"] += 1
        if astray(made, image, planned):
            word = replace(made, image=image).twin().word
            counts["astray"] += 1
            counts[word] += 1
            print(f"{counts['astray']} of {counts['mutants']}: {what}: {word}", flush=True)
        if counts["astray"] == wanted.mutants:
            break
    print(dict(counts), f"{time.process_time() - began:.0f} s")
    return int(sum(counts[word] for word in ASTRAY) < counts["astray"])


if __name__ == "__main__":
    sys.exit(main())
