"""How the hexapod with eighteen servos on two chips moves in its physics: ahead, aside, around, and tilted.

python -m tests.twin.eighteen

Each motion is the example's with another [walk]: it is planned, both chips' programs are compiled, and they
run in one time. Exit code 1 unless each ends within 4 % of its way and 5° of its heading, and none falls.
"""

from __future__ import annotations

import sys
from pathlib import Path

from servogen.job import loads, plan_job
from servogen.workflows.twinning import twin_of

JOB = Path(__file__).parents[2] / "docs" / "examples" / "two-chips" / "hexapod-eighteen.toml"
ROUTE = "route = [{ forward_mm = 40, cycles = 4 }]"
MOTIONS = {
    "walks": ROUTE,
    "crabs": "route = [{ left_mm = 30, cycles = 4 }]",
    "turns": "route = [{ turn_deg = 15, cycles = 4 }]",
    "walks, tilted by 4° to its right and its front": "body_tilt_deg = [4, 4]\n"
    "route = [{ forward_mm = 30, cycles = 4 }]",
}
WAY, TURN_DEG = 0.04, 5.0


def main() -> int:
    wrong = 0
    for name, walk in MOTIONS.items():
        verdict = twin_of(plan_job(loads(JOB.read_text().replace(ROUTE, walk), str(JOB))))
        planned, done = verdict.planned, verdict.to_json()["simulated"]
        assert planned.way is not None
        off = [check.measured for check in verdict.checks if check.name in ("robot", "turn")]
        turn = off[-1]
        length = planned.length or 0.0
        near = not length or abs(complex(*verdict.done[:2]) - complex(*planned.way[:2])) <= WAY * length
        fine = near and turn is not None and turn <= TURN_DEG and verdict.passed
        wrong += not fine
        print(f"{name}: {'' if fine else 'NOT '}as planned; {verdict.missed}; {done}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
