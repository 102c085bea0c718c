"""Compares what commands answer at two commits: what they print with --json, and their exit codes.

    python tools/answers.py BEFORE [AFTER]

AFTER is HEAD unless it is given. Both run in copies of the jobs, examples, labs and firmware of BEFORE, so
that a difference is one of the program. Prints the values that differ; exit code 1 if there are any.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from contextlib import suppress
from difflib import unified_diff
from pathlib import Path

ROOT = Path(__file__).parent.parent
INPUTS = ("jobs", "firmware", "certificates", "docs/examples", "tests/labs")
JOBS = sorted(path.stem for path in ROOT.glob("jobs/*.toml"))
COMMANDS = (
    *(f"check jobs/{job}.toml" for job in JOBS),
    *(f"plan jobs/{job}.toml" for job in JOBS if "stream" not in job),
    *(f"verify firmware/{job}/main.hex --against firmware/{job}/schedule.json" for job in JOBS[:9:2]),
    *(f"prove firmware/{job}/main.xc8.hex" for job in ("lab8-program", "omni-square", "stream-fast")),
    *(f"build jobs/{job}.toml -o built/{job}" for job in ("lab9-program", "hexapod-tripod", "stream-eight")),
    "prove firmware/lab8-exercise/main.hex --against firmware/lab8-exercise/schedule.json",
    "check docs/examples/two-chips/hexapod-eighteen.toml",
    *("check jobs/none.toml", "verify jobs/lab8-program.toml --pulses", "fk rv-m1 30 40", "servos"),
    *("measure tests/labs/servo.c --seconds 9", "simulate tests/labs/PICIOR.c", "robots", "robots rv-m1"),
    *("compile tests/labs/servo.c -o servo.hex", "compile tests/labs/PICIOR.c -o picior.hex -O0"),
    *("fk rv-m1 30 40 -60 80 -45", "ik scara 346.41016 500 250 --all", "jacobian cylindrical-r2p 30 0 200"),
    *("statics leg 10 0 --force-n 0 0 10", "orientation rpy 30 90 10", "mobility hexapod", "ik omni 0 100 0"),
    *("gait hexapod --gait tripod --stride-mm 40", "gait hexapod --gait ripple --body-height-mm 110"),
    *("transform Rx(30)Tx(-50) 1 2 3", "differential Rx(90) --translation -1 2 3", "equation 1 -1 0"),
    *("drive jobs/rvm1-stream.toml --dry-run --seconds 2", "run-program jobs/rvm1-program.rvm"),
    "report jobs/lab8-program.toml -o report.html",
    "grade lab8-exercise firmware/lab8-exercise/main.hex",
    "check-certificate certificates/lab8-program/main.cert.xz firmware/lab8-program/main.hex "
    "--against firmware/lab8-program/schedule.json",
)
NOT_ASKED = {
    **dict.fromkeys(
        ("flash", "capture", "rig", "calibrate", "doctor"), "its answer depends on what is connected"
    ),
    **dict.fromkeys(("tune", "import"), "its input is made by another program"),
    "demo": "it builds all jobs, which `build` is asked for",
    "twin": "it needs MuJoCo, whose versions differ in the last digits",
}
"""Commands with --json that are not compared, and why."""


def answer(tree: Path, work: Path, command: str) -> list[str]:
    """Return the exit code of a command of the servogen in `tree`, and what it prints, a value in a line."""
    words = (sys.executable, "-P", "-m", "servogen", *command.split(), "--json")
    done = subprocess.run(words, cwd=work, env={**os.environ, "PYTHONPATH": str(tree)}, capture_output=True)
    printed = done.stdout.decode()
    with suppress(ValueError):
        printed = json.dumps(json.loads(printed), indent=1)
    return [f"exit code {done.returncode}", *printed.splitlines()]


def extract(commit: str, folder: Path, *paths: str) -> Path:
    """Put the files of a commit into a new folder, and return it."""
    folder.mkdir()
    archive = subprocess.run(("git", "archive", commit, *paths), cwd=ROOT, check=True, capture_output=True)
    subprocess.run(("tar", "-x", "-C", str(folder)), input=archive.stdout, check=True)
    return folder


def main() -> int:
    commits = (sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "HEAD")
    differing = 0
    with tempfile.TemporaryDirectory() as name:
        places = []
        for side, commit in zip("ab", commits, strict=True):
            tree = extract(commit, Path(name, side))
            places.append((tree, extract(commits[0], Path(name, f"{side}-run"), *INPUTS)))
            compiling = "from servogen.native import parts\nfor part in parts(): part.refresh()"
            subprocess.run((sys.executable, "-c", compiling), cwd=tree, check=True)
        for command in COMMANDS:
            before, after = (answer(*each, command) for each in places)
            differing += before != after
            for line in unified_diff(before, after, "", f"servogen {command}", lineterm="", n=0):
                print(line, flush=True)
    print(f"{len(COMMANDS)} commands at {' and '.join(commits)}: {differing} differ")
    return min(differing, 1)


if __name__ == "__main__":
    raise SystemExit(main())
