"""Robots whose servos are calibrated at three points: `python -m tests.engines.player.bent [COUNT]`.

Hexapods with random legs, gaits and routes, each servo with its own offset and span, measured at two points,
or at three whose middle one is off the line by up to 20 µs. Prints words and error of each; all of the second
kind fit if those of the first do, within 10 µs.
"""

from __future__ import annotations

import random
import sys
from pathlib import Path

from servogen.errors import ServogenError
from servogen.job import PlannedJob, loads, plan_job
from servogen.workflows.engines import PlayedJob, planned
from servogen.workflows.job_build import judge_firmware

SEED = 777_333
LEGS = ("LF", "LM", "LB", "RF", "RM", "RB")
PINS = [*(f"RB{bit}" for bit in range(8)), *(f"RA{bit}" for bit in range(4))]
BEND_US = 20
TRAVEL = 149


def robot(draw: random.Random) -> tuple[str, float]:
    """Return a hexapod's file, and the height (mm) of its body that leaves its legs room to turn."""
    ab, bc, cd, df = (round(length * draw.uniform(0.9, 1.1), 1) for length in (38, 103, 46, 51))
    ahead, aside = round(draw.uniform(115, 140), 1), round(draw.uniform(50, 60), 1)
    rows = []
    for leg in LEGS:
        x = {"F": ahead, "M": 0, "B": -ahead}[leg[1]]
        y, mirrored = (aside, "") if leg[0] == "L" else (-aside, ", mirrored = true")
        rows.append(f'  {{ name = "{leg}", x_mm = {x}, y_mm = {y}{mirrored} }},\n')
    lengths = f"{{ ab = {ab}, bc = {bc}, cd = {cd}, df = {df} }}"
    head = 'name = "r"\nkind = "hexapod"\nleg = "pantograph"\n'
    text = f"{head}lengths_mm = {lengths}\nmount = [\n{''.join(rows)}]\n"
    return text, round(0.887 * (bc + df), 1)


SERVO = """\
title = "own"
points = [{ angle_deg = 0, width_us = 500 }, { angle_deg = 149, width_us = 2500 }]
speed_deg_s = 500
"""


def job(draw: random.Random, height_mm: float, bends: float | None, count: int = 3) -> str:
    """Return a walk; its servos have two points each, or `count`, those between the ends off by up to
    `bends`.
    """
    gait = draw.choice(("tripod", "tripod", "ripple", "wave"))
    forward, turn = draw.randrange(40, 84), draw.randrange(15, 31)
    lines = ["[chip]", 'device = "PIC16F84A"', "clock_hz = 4_000_000", "[robot]", 'name = "r.toml"']
    for index, pin in enumerate(PINS):
        leg, joint = LEGS[index // 2], ("alpha", "beta")[index % 2]
        low, high = 500 + draw.uniform(-40, 40), 2500 + draw.uniform(-40, 40)
        between = []
        for part in range(1, count - 1):
            share = part / (count - 1)
            off = draw.uniform(-1, 1)
            if bends is not None:
                between.append((share * TRAVEL, low + share * (high - low) + off * bends))
        points = ", ".join(
            f"{{ angle_deg = {angle:g}, width_us = {width:.0f} }}"
            for angle, width in [(0, low), *between, (TRAVEL, high)]
        )
        reverse = "\nreverse = true" if leg[0] == "R" else ""
        lines += [
            "[[servo]]",
            f'name = "{leg}-{joint}"\npin = "{pin}"\nmodel = "s.toml"\njoint = "{leg}_{joint}"',
            f"points = [ {points} ]\nzero_deg = {TRAVEL / 2}{reverse}",
        ]
    lines += [
        f'[walk]\ngait = "{gait}"\nlift_mm = 25\ncycle_s = 1.44\nbody_height_mm = {height_mm}',
        'repeat = false\nend = "hold"',
        f"route = [{{ forward_mm = {forward}, cycles = 4 }}, {{ turn_deg = {turn}, cycles = 3 }}]",
        "[frame]\nperiod_us = 20000\nper_slot = 2\n[firmware]\nmax_error_us = 10",
    ]
    return "\n".join(lines) + "\n"


def made(folder: Path, seed: int, bends: float | None, count: int = 3) -> PlannedJob:
    """Return robot number `seed`, planned. Raises ServogenError if it cannot walk so."""
    draw = random.Random(SEED + seed)
    text, height_mm = robot(draw)
    (folder / "r.toml").write_text(text, encoding="utf-8")
    (folder / "s.toml").write_text(SERVO, encoding="utf-8")
    return plan_job(loads(job(draw, height_mm, bends, count), str(folder / "j.toml")))


def fitted(planned_job: PlannedJob) -> tuple[PlayedJob, int, bool]:
    """Return the job as it is played, the words of its program, and whether its pulses are exact."""
    played = planned(planned_job)
    firmware = played.make("c2c")
    schedule = played.plan.schedule
    return played, firmware.compilation.words, judge_firmware(schedule, firmware).exact


def main(count: int, folder: Path) -> None:
    """Print a line per robot that walks, until there are `count`."""
    fits, seed, found = {"two": 0, "three": 0}, 0, 0
    while found < count:
        seed += 1
        try:
            both = {"two": made(folder, seed, None), "three": made(folder, seed, BEND_US)}
        except ServogenError:
            continue
        found += 1
        cells = []
        for name, one in both.items():
            try:
                played, words, exact = fitted(one)
                error = played.plan.schedule.plan_error_us
                fits[name] += exact and error <= 10
                cells.append(
                    f"{name} points {words:5} words {error:6.2f} µs {'exact' if exact else 'NOT EXACT'}"
                )
            except ServogenError as refused:
                cells.append(f"{name} points refused: {refused.message[:160]}")
        print(f"{seed:3}: " + "; ".join(cells), flush=True)
    print(f"of {count} robots fit with two points {fits['two']}, with three {fits['three']}")


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as place:
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 25, Path(place))
