"""Own robots: how many of those drawn are planned, and of these built and exact, and how near to their plan.

`python -m tests.engines.player.own_robots --kind hip-lift --robots 100 --seed 1 --built 20` draws robots:
links of 30 to 120 mm, bodies of 80 to 300 mm, hobby servos of 500 to 2500 µs over 120° to 180°, each servo
with its own calibration (±12 µs at both ends), walking four cycles forward and turning by 90°, tripod and
ripple in turn, cycles of 0.6 s to 1.5 s in steps of a frame (so that swings have odd and even numbers of
frames). Every fifth robot has a start button on the pin that is left. Their legs may meet: of interest is
what their pulses are.

With legs of three joints every other robot crawls on four, the others have six. All have two chips, and walk
or turn, for which these have room. A refusal is printed with what it advises.

`--proven 20` also proves that many of those built, in all dialects, for every power-up, input and chip, and
has the proofs checked; of two chips, the pair, too.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from servogen.engines.firmware import DIALECTS
from servogen.errors import ServogenError
from servogen.job import PlannedJob, load, plan_job
from servogen.plan_error import PlanError
from servogen.pulse import PulseSchedule
from servogen.workflows.certificates import prove_program
from servogen.workflows.engines import planned
from servogen.workflows.job_build import BuiltProgram, judge_firmware
from servogen.workflows.pair import PairBuild, build_pair

PINS = (*(f"RB{bit}" for bit in range(8)), *(f"RA{bit}" for bit in range(4)))
LEGS = ("L1", "L2", "L3", "R1", "R2", "R3")
ALL_FOURS = ("L1", "L2", "R1", "R2")
KINDS = {
    "pantograph": (("alpha", "beta"), ("ab", "bc", "cd", "df")),
    "hip-lift": (("hip", "lift"), ("coxa", "femur", "tibia")),
    "coxa-femur-tibia": (("coxa", "femur", "tibia"), ("coxa", "femur", "tibia")),
}
"""The joints and lengths of each kind of leg."""

ROWS = {4: (1, -1), 6: (1, 0, -1)}
"""Where along half of the body's length the legs of a side are."""

SIGN = {"pantograph": 'beta_sign = "{}"\n', "hip-lift": "", "coxa-femur-tibia": ""}

ONE_CHIP = '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
TWO_CHIPS = "".join(f'[{ONE_CHIP.replace("]", "]]", 1)}wire = "{wire}"\n' for wire in ("RB0", "RA1"))
LOOSE_US, TIGHT_US = 20.0, 10.0


@dataclass(frozen=True, slots=True)
class Robot:
    """Files of a job and its robot."""

    number: int
    gait: str
    robot: str
    job: str

    def planned(self, folder: Path) -> PlannedJob:
        """Return the planned job. Raises ServogenError where it cannot walk."""
        (folder / "own.toml").write_text(self.robot)
        path = folder / "job.toml"
        path.write_text(self.job)
        return plan_job(load(path))


def drawn(number: int, chance: random.Random, kind: str = "pantograph") -> Robot:
    """Return the robot of that number."""
    joints, names = KINDS[kind]
    legs = ALL_FOURS if len(joints) == 3 and number % 2 == 0 else LEGS
    rhythm = number // 4 if len(joints) == 3 else number
    gait = "crawl" if legs is ALL_FOURS else ("tripod", "ripple")[rhythm % 2]
    lengths = {name: chance.randint(30, 120) for name in names}
    length, width = chance.randint(80, 300), chance.randint(80, 300)
    travel = chance.randint(120, 180)
    mounts = "\n".join(
        f'    {{ name = "{leg}", x_mm = {x * length / 2:g}, y_mm = {y * width / 2:g}, '
        f"mirrored = {str(y < 0).lower()} }},"
        for leg, (x, y) in zip(legs, ((x, y) for y in (1, -1) for x in ROWS[len(legs)]), strict=True)
    )
    robot = (
        f'name = "own"\nkind = "hexapod"\nleg = "{kind}"\n'
        f"lengths_mm = {{ {', '.join(f'{name} = {length}' for name, length in lengths.items())} }}\n"
        f"mount = [\n{mounts}\n]\n"
    )
    turning = [f"{leg}_{joint}" for leg in legs for joint in joints]
    half = len(turning) // 2
    pins = PINS[:half] * 2 if len(joints) == 3 else PINS[: len(turning)]
    servos = []
    for pin, name in zip(pins, turning, strict=True):
        low, high = (end + chance.uniform(-12, 12) for end in (500, 2500))
        reverse = "reverse = true\n" if name.startswith("R") else ""
        servos.append(
            f'[[servo]]\nname = "{name}"\npin = "{pin}"\nmodel = "futaba-s3001"\njoint = "{name}"\n{reverse}'
            f"travel_deg = [0, {travel}]\nzero_deg = {travel / 2:g}\n"
            f"points = [{{ angle_deg = 0, width_us = {low:.1f} }}, "
            f"{{ angle_deg = {travel}, width_us = {high:.1f} }}]\n"
        )
    rest = lengths["df"] + lengths["bc"] if kind == "pantograph" else lengths["tibia"]
    height = rest * chance.uniform(0.75, 0.97)
    turn = chance.choice((9, 10, 15, 18))
    cycle_s = 0.02 * chance.randint(30, 75)
    button = 'start_pin = "RA4"\n' if number % 5 == 4 and len(joints) == 2 else ""
    limit = LOOSE_US if len(joints) == 2 else TIGHT_US
    route = [
        f"{{ forward_mm = {chance.randint(20, 60)}, cycles = 4 }}",
        f"{{ turn_deg = {turn}, cycles = {90 // turn} }}",
    ]
    if len(joints) == 3:
        route = [route[number // 2 % 2].split(",")[0] + " }"]
    job = (
        f'{ONE_CHIP if len(joints) == 2 else TWO_CHIPS}[robot]\nname = "own.toml"\n'
        f'{"".join(servos)}[walk]\ngait = "{gait}"\ngap_mm = 0\n'
        f"route = [{', '.join(route)}]\nlift_mm = {chance.randint(12, 30)}\n"
        f"body_height_mm = {height:.0f}\ncycle_s = {cycle_s:g}\n"
        f"{SIGN[kind].format(chance.choice(('positive', 'negative')))}"
        f'[frame]\nper_slot = 2\n[firmware]\nengine = "player"\nmax_error_us = {limit}\n{button}'
    )
    return Robot(number, gait, robot, job)


def robots(count: int, seed: int, kind: str = "pantograph") -> list[Robot]:
    """Return so many robots that can be planned; those that cannot walk as asked are drawn again."""
    chance = random.Random(seed)
    found: list[Robot] = []
    with TemporaryDirectory() as folder:
        while len(found) < count:
            robot = drawn(len(found), chance, kind)
            try:
                robot.planned(Path(folder))
            except ServogenError:
                continue
            found.append(robot)
    return found


def planned_of(count: int, seed: int, kind: str) -> list[Robot]:
    """Return those of so many robots that can be planned, and print why the others are refused."""
    chance = random.Random(seed)
    found: list[Robot] = []
    refused: Counter[str] = Counter()
    advised = 0
    with TemporaryDirectory() as folder:
        for number in range(count):
            robot = drawn(number, chance, kind)
            try:
                robot.planned(Path(folder))
            except ServogenError as error:
                refused[error.first.code] += 1
                advised += bool(error.first.hint)
                print(f"{number} {robot.gait}: {str(error).replace(folder, '')}")
            else:
                found.append(robot)
    print(
        f"{kind}: {len(found)} of {count} planned; refused: {dict(refused)}, "
        f"{advised} of {count - len(found)} with advice"
    )
    return found


@dataclass(frozen=True, slots=True)
class Outcome:
    """A robot's programs, those of its first chip first, and how far its pulses are from the plan."""

    chips: tuple[tuple[PulseSchedule, tuple[BuiltProgram, ...]], ...]
    pair: PairBuild | None = None

    @property
    def error(self) -> PlanError:
        """How far the schedules are from the plan, at worst."""
        errors = [schedule.plan_error for schedule, _ in self.chips if schedule.plan_error is not None]
        return max(errors, key=lambda each: each.width_us)

    @property
    def exact(self) -> bool:
        """Return whether every dialect's program is built and exact, and with it the pair."""
        exact = all(
            len(programs) == len(DIALECTS) and all(each.exact for each in programs)
            for _, programs in self.chips
        )
        return exact and (self.pair is None or self.pair.exact)

    @property
    def words(self) -> list[int]:
        """The words of all programs."""
        return [each.firmware.compilation.words for _, programs in self.chips for each in programs]


def outcome(robot: Robot) -> Outcome | str:
    """Return what became of the robot, or why there is nothing. No changes of the job are tried."""
    with TemporaryDirectory() as folder:
        job = robot.planned(Path(folder))
    try:
        if job.chips:
            pair = build_pair(job)
            return Outcome(tuple((chip.plan.schedule, chip.programs) for chip in pair.chips), pair)
        found = planned(job)
        made = [found.make(dialect) for dialect in DIALECTS]
    except ServogenError as error:
        return str(error)
    schedule = found.plan.schedule
    return Outcome(((schedule, tuple(judge_firmware(schedule, each) for each in made)),))


def proven(done: Outcome) -> bool:
    """Print what is proven of a robot's programs, and return whether the checker accepts all of it."""
    begun = time.process_time()
    answers: Iterable[tuple[str, bool]]
    if done.pair is not None:
        answers = [(each.summary(), each.checked) for each in done.pair.proofs().values()]
    else:
        ((schedule, programs),) = done.chips
        text = schedule.json_text().encode()
        verdicts = [prove_program(each.image, schedule, text)[0] for each in programs]
        answers = [(each.text, each.valid) for each in verdicts]
    print(
        f"  {[text for text, _ in answers]}, {time.process_time() - begun:.0f} s of processor time",
        flush=True,
    )
    return all(valid for _, valid in answers)


def main(count: int, seed: int, kind: str, built: int, to_prove: int) -> int:
    """Plan them all, build and prove some of them and print what became of them; 0 where 95 % are tight, all
    are loose, and those to be proven are.
    """
    tight = loose = tried = theorems = 0
    reasons: Counter[str] = Counter()
    drawn_ones = planned_of(count, seed, kind)[:built]
    for robot in drawn_ones:
        done = outcome(robot)
        if isinstance(done, str):
            reasons[robot.gait] += 1
            print(f"{robot.number} {robot.gait}: {done.splitlines()[0]}")
            continue
        print(
            f"{robot.number} {robot.gait}: {done.error.text()}; words {done.words}, "
            f"{'exact' if done.exact else 'NOT EXACT'}",
            flush=True,
        )
        tight += done.exact and done.error.width_us <= TIGHT_US
        loose += done.exact and done.error.width_us <= LOOSE_US
        if tried < to_prove:
            tried, theorems = tried + 1, theorems + proven(done)
    print(
        f"{len(drawn_ones)} built: {tight} exact at {TIGHT_US:g} µs, {loose} at {LOOSE_US:g} µs; "
        f"{dict(reasons)} not; {theorems} of {tried} proven"
    )
    good = loose == len(drawn_ones) and tight >= 0.95 * len(drawn_ones)
    return 0 if good and theorems == tried else 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=list(KINDS), default="pantograph")
    parser.add_argument("--built", type=int, default=200, help="how many of the planned ones are built")
    parser.add_argument("--proven", type=int, default=0, help="how many of those built are proven")
    given = parser.parse_args()
    sys.exit(main(given.robots, given.seed, given.kind, given.built, given.proven))
