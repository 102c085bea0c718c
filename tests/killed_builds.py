"""Builds killed at random moments: the folder must always hold one whole build, and the next cleans up.

    python -m tests.killed_builds --builds 100 [--seed 1]

Two jobs are built in turns into one folder. Each build is killed with SIGKILL: half of them at any moment of
their life, half in the moments in which they write their files. After each, the folder must be, byte for
byte, what an undisturbed build of one of the two jobs makes. Prints what stood after how many kills.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parent.parent
JOBS = (ROOT / "jobs" / "lab9-program.toml", ROOT / "jobs" / "lab8-program.toml")
NOTHING = "nothing"
Files = dict[str, bytes]


def start(job: Path, folder: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "servogen", "build", str(job), "--output", str(folder)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=ROOT)


def contents(folder: Path) -> Files:
    """The files of a folder, by name."""
    return {entry.name: entry.read_bytes() for entry in folder.iterdir()} if folder.exists() else {}


def parts(folder: Path) -> list[Path]:
    return [*folder.parent.glob(".*.part"), *folder.glob(".*.part")]


def wait_until_writing(process: subprocess.Popen[bytes], folder: Path) -> None:
    """Returns as soon as the process has begun to write a new set, or has ended."""
    before = set(parts(folder))
    while process.poll() is None and not set(parts(folder)) - before:
        time.sleep(0.0005)


def undisturbed(job: Path, folder: Path) -> tuple[float, float]:
    """Builds `job`; how many seconds that took, and how many of them it wrote its files."""
    begun = time.monotonic()
    process = start(job, folder)
    wait_until_writing(process, folder)
    writing = time.monotonic()
    assert process.wait() == 0
    return time.monotonic() - begun, time.monotonic() - writing


def run(builds: int, seed: int, report: Callable[[str], None] = print) -> Counter[str]:
    """Kills `builds` builds; how often which job's files stood afterwards. Raises AssertionError."""
    dice = random.Random(seed)
    seen: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        whole: dict[str, Files] = {NOTHING: {}}
        lasts = writes = 0.0
        for job in JOBS:
            times = undisturbed(job, Path(name, job.stem, "out"))
            lasts, writes = max(lasts, times[0]), max(writes, times[1])
            whole[job.stem] = contents(Path(name, job.stem, "out"))
        folder = Path(name, "work", "out")
        for number in range(builds):
            process = start(dice.choice(JOBS), folder)
            if number % 2:
                time.sleep(dice.uniform(0, lasts))
            else:
                wait_until_writing(process, folder)
                time.sleep(dice.uniform(0, writes))
            process.kill()
            process.wait()
            stands = [which for which, files in whole.items() if contents(folder) == files]
            assert stands, f"kill {number}: {sorted(contents(folder))} is not a whole build"
            assert stands != [NOTHING] or set(seen) <= {NOTHING}, f"kill {number}: the folder was emptied"
            seen[stands[0]] += 1
            report(f"kill {number + 1}: {stands[0]}, {len(parts(folder))} parts left")
        assert start(JOBS[0], folder).wait() == 0
        assert contents(folder) == whole[JOBS[0].stem]
        assert not parts(folder), "the build after the kills cleans up"
    return seen


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--builds", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    seen = run(given.builds, given.seed)
    print(f"{given.builds} builds killed: {', '.join(f'{which} {count}' for which, count in seen.items())}")


if __name__ == "__main__":
    main()
