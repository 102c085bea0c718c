"""The checks that a grade consists of, and a fault: what a program does wrong and which checks it fails.

In: nothing. Out: `Check`, one for each row of points in a lab's file, in the order in which they are made.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Check(StrEnum):
    """What is checked; the value is its key in a lab's [points]."""

    RUNS = "runs"
    PULSES = "pulses"
    POSITIONS = "positions"
    ORDER = "order"
    PAUSES = "pauses"
    TRAVEL = "travel"
    PERIOD = "period"
    REPETITION = "repetition"


CHECK_TITLES = {
    Check.RUNS: "compiles and runs",
    Check.PULSES: "every servo gets pulses",
    Check.POSITIONS: "positions",
    Check.ORDER: "order of the positions",
    Check.PAUSES: "pauses",
    Check.TRAVEL: "time to get there",
    Check.PERIOD: "period of the pulses",
    Check.REPETITION: "endless repetition",
}
"""Each check as a student reads it."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that is wrong, as a sentence for a student, and the checks that fail because of it."""

    checks: tuple[Check, ...]
    text: str
