"""The points of a grade: a lab's points and a program's faults -> the outcome of each check.

A check that could not be made gives no points: what does not run has no pauses that could be right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from servogen.grade.judge import Grade
from servogen.grade.lab import Check, Lab

WHOLE = "passed"
"""The key and name of the points for a program without any fault."""

CHECK_TITLES = {
    Check.RUNS: "compiles and runs",
    Check.PULSES: "every servo gets pulses",
    Check.POSITIONS: "positions",
    Check.ORDER: "order of the positions",
    Check.PAUSES: "pauses",
    Check.TRAVEL: "time to get there",
    Check.PERIOD: "period of the pulses",
    Check.REPETITION: "endless repetition",
    Check.CHIPS: "the same on other chips",
}
"""Each check as a student reads it."""


class CheckState(StrEnum):
    """The result of a check."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_CHECKED = "not checked"


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of one check of one program; `text` says why it is not passed."""

    key: str
    title: str
    state: CheckState
    max_points: float
    text: str = ""

    @property
    def points(self) -> float:
        return self.max_points if self.state is CheckState.PASSED else 0.0


def outcomes(lab: Lab, grade: Grade) -> tuple[Outcome, ...]:
    """Return the outcome of each check that the lab makes, then that of all together if it has points."""
    results = [_outcome(lab, grade, check) for check in lab.checks]
    if lab.points_passed:
        state = CheckState.PASSED if grade.passed else CheckState.FAILED
        text = "" if grade.passed else "only for a program without any fault"
        results.append(Outcome(WHOLE, "everything is right", state, lab.points_passed, text))
    return tuple(results)


def headline(text: str) -> str:
    """Return the first line of a reason; where that ends in a colon, with the line that follows it."""
    lines = text.splitlines()
    return " ".join(lines[: 2 if lines[0].endswith(":") else 1])


def _outcome(lab: Lab, grade: Grade, check: Check) -> Outcome:
    points = dict(lab.points).get(check, 0.0)
    texts = [fault.text for fault in grade.faults if check in fault.checks]
    if texts:
        return Outcome(check, CHECK_TITLES[check], CheckState.FAILED, points, "\n".join(texts))
    if check in grade.unchecked:
        because = "; ".join(dict.fromkeys(headline(text) for text in grade.reasons))
        return Outcome(
            check, CHECK_TITLES[check], CheckState.NOT_CHECKED, points, f"could not be checked: {because}"
        )
    return Outcome(check, CHECK_TITLES[check], CheckState.PASSED, points)


def total(results: Sequence[Outcome]) -> float:
    """Return the points that a program gets."""
    return math.fsum(outcome.points for outcome in results)


def max_total(results: Sequence[Outcome]) -> float:
    """Return the points that a program can get."""
    return math.fsum(outcome.max_points for outcome in results)


def number(points: float) -> str:
    """Return points as people write them: 2, 0.5."""
    return f"{points:.10g}"
