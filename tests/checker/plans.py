"""A plan followed frame by frame, as the checker reads it from a schedule."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from servogen.checker.plan import Plan, PlanPosition, StartStop

Ints = npt.NDArray[np.int64]


def start_stop(plan: Plan) -> StartStop:
    """The buttons that start and stop the motion."""
    assert isinstance(plan.inputs, StartStop)
    return plan.inputs


def due(plan: Plan, position: PlanPosition) -> tuple[Ints, Ints]:
    """The edges of the frame at `position`: cycles, and the levels of all pins from each on."""
    return plan.edges[plan.run_of(position)]


def after(plan: Plan, position: PlanPosition, levels: int) -> PlanPosition:
    """The position of the next frame, if the inputs were read as `levels` in this one."""
    return plan.following(position.frame, plan.inputs.hear(position.memory, levels))
