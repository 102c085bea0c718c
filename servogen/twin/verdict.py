"""Planned against simulated: what a run measured, what [expect] asks, and the first cause where it fails.

In: a `Record`, the plan, the job's expectations. Out: `TwinVerdict`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from servogen.errors import Diagnostic
from servogen.job import PlannedJob
from servogen.job.schema import ExpectTable
from servogen.robot.arm_file import MAX_MM
from servogen.twin.causes import Event, brown_out, fall_time, run_events
from servogen.twin.planned import PlannedRoute
from servogen.twin.run import ROUNDING_S, SAMPLE_S, Record

if TYPE_CHECKING:
    from servogen.answers import TwinVerdictAnswer, WayAnswer

Floats = npt.NDArray[np.float64]

TOUCH_N = 0.1
"""The minimum force of a foot that counts as standing."""

REST_S = 0.3
"""The time for which the plan has to rest before a tool counts as arrived."""

REST_M = 1e-6
"""A tool that moves less in a frame is at rest."""

Word = Literal["as expected", "NOT as expected", "not guaranteed", "not judged"]

WALK_SHARE, WALK_DEG = 0.1, 5.0
"""The share of its way by which a walk may miss its end, and the degrees, if its job does not say."""


IN_NAMES = {"mm": "mm", "°": "deg", "N·m": "nm", "A": "a", "s": "s"}
"""Units as names of JSON end with them; what is counted has none of them."""


@dataclass(frozen=True, slots=True)
class ExpectationCheck:
    """One expectation: what was measured, in the unit of its name, what is allowed, since when it fails."""

    name: str
    measured: float | None
    """None: the run does not show it; the expectation then fails."""
    allowed: float
    unit: str
    passed: bool
    seconds: float | None = None

    def to_json(self) -> Any:
        """Return a `TwinCheckAnswer`, whose names end with the unit of this check."""
        unit = IN_NAMES.get(self.unit.split()[0], "count")
        return {
            "name": self.name,
            f"measured_{unit}": self.measured,
            f"allowed_{unit}": self.allowed,
            "passed": self.passed,
            "seconds": self.seconds,
        }

    @property
    def shown(self) -> str:
        """Return what was measured, without its unit."""
        return "-" if self.measured is None else f"{self.measured:z.4g}"

    @property
    def text(self) -> str:
        """Return the check as a sentence."""
        when = "" if self.seconds is None else f" at {self.seconds:.2f} s"
        seen = "not measured" if self.measured is None else f"{self.shown} {self.unit}{when}"
        return f"{self.name}: {seen}, allowed {self.allowed:g} {self.unit}"


@dataclass(frozen=True, slots=True, eq=False)
class TwinVerdict:
    """The comparison of a run with its plan; lengths in metres, angles in radians.

    `asked`, `rigid`, `done`: x, y, yaw at the end, as the job asks, with rigid legs, as simulated.
    """

    record: Record
    planned: PlannedRoute
    checks: tuple[ExpectationCheck, ...]
    events: tuple[Event, ...]
    not_guaranteed_from: float | None
    done: tuple[float, float, float]
    drag: float
    drag_leg: str
    tool_error: float | None
    tool_rest_error: float | None
    warnings: tuple[Diagnostic, ...] = ()
    """The plan's warnings, which are the cause if no event explains a failure."""
    judged: bool = True
    """Whether the job has an [expect]."""
    missed: str = ""
    """By how much the robot misses its plan, in words."""

    @property
    def passed(self) -> bool:
        """Return whether every expectation holds, and the chip's voltage was always in its range."""
        return all(check.passed for check in self.checks) and self.not_guaranteed_from is None

    @property
    def word(self) -> Word:
        """Return the verdict in words."""
        if self.not_guaranteed_from is not None:
            return "not guaranteed"
        if not self.judged:
            return "not judged"
        return "as expected" if self.passed else "NOT as expected"

    @property
    def cause(self) -> Event | None:
        """Return what happened first; None if nothing did."""
        return self.events[0] if self.events else None

    def reasons(self) -> list[str]:
        """Return what fails, and then the first cause, as sentences."""
        failures = [check.text for check in self.checks if not check.passed]
        if not failures and self.not_guaranteed_from is None:
            return []
        if self.cause is not None:
            return [*failures, f"first cause: {self.cause.text}"]
        return [*failures, *(f"the plan warned: {warning.message}" for warning in self.warnings)]

    def to_json(self) -> TwinVerdictAnswer:
        """Return plain values for a JSON file: metres, degrees, seconds, N·m, A, V."""
        record = self.record
        rigid = self.planned.rigid
        return {
            "verdict": self.word,
            "passed": self.passed,
            "missed": self.missed or None,
            "asked": _travel(self.planned.way) if self.planned.way else None,
            "rigid_legs": None if rigid is None else _travel(rigid[-1].tolist()),
            "simulated": _travel(self.done),
            "drag_m": self.drag,
            "drag_leg": self.drag_leg or None,
            "tool_error_m": self.tool_error,
            "tool_rest_error_m": self.tool_rest_error,
            "minimum_height_m": float(record.pose[:, 2].min()) if record.floating else None,
            "torque_nm": {
                servo.name: float(np.abs(record.torque[:, index]).max())
                for index, servo in enumerate(record.rig.servos)
            },
            "current_a": float(record.current.max()),
            "voltage_v": float(record.voltage.min()),
            "charge_as": float(np.mean(record.current) * record.time[-1]),
            "seconds": float(record.time[-1]),
            "motion_s": list(record.motion),
            "not_guaranteed_from_s": self.not_guaranteed_from,
            "checks": [check.to_json() for check in self.checks],
            "events": [event.to_json() for event in self.events],
            "assumptions": [*record.bodies.assumptions, *record.rig.assumptions],
        }


def _travel(travelled: Sequence[float]) -> WayAnswer:
    """Return how far the body went, given in metres and radians, with the units in the keys."""
    forward, left, turn = travelled
    return {"forward_m": forward, "left_m": left, "turn_deg": math.degrees(turn)}


def verdict_of(record: Record, job: PlannedJob, planned: PlannedRoute) -> TwinVerdict:
    """Return the comparison of a run with the plan of its job."""
    first = record.pose[record.first]
    turned = np.exp(-1j * first[3]) * complex(*(record.pose[-1] - first)[:2])
    travelled = (float(turned.real), float(turned.imag), float(record.pose[-1, 3] - first[3]))
    drag, leg, drag_time = _drag(record)
    tool, rest, rest_time = _tool(record, planned)
    off = _off(record, planned, travelled)
    expect = job.expect or _usual(planned)
    checks = _checks(record, expect, off, (drag, leg, drag_time), (rest, rest_time))
    return TwinVerdict(
        record,
        planned,
        tuple(checks),
        run_events(record, job, planned),
        brown_out(record),
        travelled,
        drag,
        leg,
        tool,
        rest,
        job.warnings,
        job.expect is not None,
        _miss_text(off, record, planned, travelled, tool),
    )


def _off(
    record: Record, planned: PlannedRoute, travelled: tuple[float, float, float]
) -> tuple[float, float] | None:
    """Return how far (mm) and by what angle (degrees) the robot ends beside its plan; None without a plan
    that was played to its end.
    """
    if planned.way is None or not _complete(record):
        return None
    x, y, yaw = planned.way
    distance = 1000 * math.hypot(travelled[0] - x, travelled[1] - y)
    return distance, abs(math.degrees(travelled[2] - yaw))


def _complete(record: Record) -> bool:
    return bool(record.motion[1] - record.time[-1] <= 2 * SAMPLE_S)


def _usual(planned: PlannedRoute) -> ExpectTable:
    """Return what is expected where a job does not say: a walk ends near its plan, and nothing falls."""
    if planned.length is None:
        return ExpectTable()
    # On the spot there is no way of which a share could be allowed.
    within_mm = min(1000 * WALK_SHARE * planned.length, MAX_MM) or None
    return ExpectTable(robot_within_mm=within_mm, turn_within_deg=WALK_DEG)


def _miss_text(
    off: tuple[float, float] | None,
    record: Record,
    planned: PlannedRoute,
    travelled: tuple[float, float, float],
    tool: float | None,
) -> str:
    if off is not None:
        share = f" ({0.1 * off[0] / planned.length:.1f} % of its way)" if planned.length else ""
        return f"the robot misses its plan by {off[0]:.1f} mm{share} and {off[1]:.1f}°"
    if planned.rigid is not None and _complete(record):  # an endless walk asks for no end
        x, y, yaw = planned.rigid[-1].tolist()
        length, far = 1000 * math.hypot(x, y), 1000 * math.hypot(travelled[0] - x, travelled[1] - y)
        share = f", whose way is {length:.1f} mm," if length else ""
        turned = abs(math.degrees(travelled[2] - yaw))
        return f"the robot ends {far:.1f} mm beside what rigid legs would do{share} and {turned:.1f}° off"
    return "" if tool is None else f"the tool misses its path by up to {1000 * tool:.2f} mm"


def _checks(
    record: Record,
    expect: ExpectTable,
    off: tuple[float, float] | None,
    drag: tuple[float, str, float],
    rest: tuple[float | None, float | None],
) -> list[ExpectationCheck]:
    checks: list[ExpectationCheck] = []

    def check(
        name: str, measured: float | None, allowed: float | None, unit: str, at: float | None = None
    ) -> None:
        if allowed is not None:
            passed = measured is not None and bool(measured <= allowed)
            checks.append(ExpectationCheck(name, measured, allowed, unit, passed, None if passed else at))

    if not record.pulsed.any():
        count = len(record.rig.servos)
        checks.append(ExpectationCheck("servos without pulses", count, 0.0, "servos", False, 0.0))
    fallen = fall_time(record)
    if expect.no_fall and record.floating:
        checks.append(
            ExpectationCheck("falls", float(fallen is not None), 0.0, "times", fallen is None, fallen)
        )
    distance, turned = off or (None, None)
    check("robot", distance, expect.robot_within_mm, "mm off")
    check("turn", turned, expect.turn_within_deg, "° off")
    resting = None if rest[0] is None else 1000 * rest[0]
    check("tool at rest", resting, expect.end_within_mm, "mm off", rest[1])
    dragged = 1000 * drag[0] if record.feet.shape[1] else None
    check(f"drag of {drag[1]}" if drag[1] else "drag", dragged, expect.drag_mm, "mm", drag[2])
    torque = np.abs(record.torque)
    row, column = np.unravel_index(int(np.argmax(torque)), torque.shape)
    check(
        f"torque of {record.rig.servos[column].name}",
        float(torque[row, column]),
        expect.torque_nm,
        "N·m",
        float(record.time[row]),
    )
    peak = int(np.argmax(record.current))
    check("current", float(record.current[peak]), expect.current_a, "A", float(record.time[peak]))
    finished = record.motion[1] if _complete(record) else None
    check("time", finished, expect.within_s, "s", finished)
    return checks


def _drag(record: Record) -> tuple[float, str, float]:
    """Return the longest way that a foot slides in one stance of the motion, its leg and the stance's end."""
    part = slice(record.first, None)
    feet, stands = record.feet[part], record.force[part] > TOUCH_N
    worst, leg, when = 0.0, "", 0.0
    names = [limb.name for limb in record.rig.robot.limbs]
    for index in range(feet.shape[1]):
        moves = np.linalg.norm(np.diff(feet[:, index, :2], axis=0), axis=1)
        on = stands[1:, index] & stands[:-1, index]
        total = np.cumsum(np.where(on, moves, 0.0))
        dragged = total - np.maximum.accumulate(np.where(on, 0.0, total))
        last = int(np.argmax(dragged)) if len(dragged) else 0
        if len(dragged) and dragged[last] > worst:
            worst, leg, when = float(dragged[last]), names[index], float(record.time[part][last + 1])
    return worst, leg, when


def _tool(record: Record, planned: PlannedRoute) -> tuple[float | None, float | None, float | None]:
    """Return the tool's greatest distance from its plan, that at rest, and when the latter is."""
    if planned.tool is None or not record.tool.shape[1]:
        return None, None, None
    time = record.time[record.first :] - record.motion[0]
    # A frame's pulse takes effect in the moment in which the frame begins.
    frame = np.floor((time + ROUNDING_S) / planned.frame_s).astype(int).clip(0, len(planned.tool) - 1)
    error = np.linalg.norm(record.tool[record.first :] - planned.tool[frame], axis=1)
    steps = np.linalg.norm(np.diff(planned.tool, axis=0), axis=1) < REST_M
    needed = max(1, round(REST_S / planned.frame_s))
    rests = np.zeros(len(planned.tool), bool)
    run = 0
    for index, still in enumerate(steps.tolist()):
        run = run + 1 if still else 0
        rests[index + 1] = run >= needed
    resting = rests[frame]
    if not resting.any():
        return float(error.max()), None, None
    row_index = int(np.argmax(np.where(resting, error, -1.0)))
    return float(error.max()), float(error[row_index]), float(record.time[record.first + row_index])
