"""The bodies of a watched job: a run of the twin, recorded for the page.

In: a subject with a job whose servos move a robot, and what was done to its pins by hand. Out: a message with
lines through the bodies every 20 ms, the pose of the body, the forces under its feet. The chip of this run is
another one: it hears the same inputs in the same cycles, so that it makes the same pulses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from servogen.errors import InputError
from servogen.simulator import Change, Levels, Stimuli
from servogen.twin import Settings, simulate
from servogen.twin.pictures import body_parts
from servogen.twin.run import SAMPLE_S
from servogen.twin.verdict import TOUCH_N
from servogen.watch.subject import Subject

PICTURE_S = 0.02
AHEAD_S, MAX_S = 20.0, 60.0
"""How far beyond the moment that is shown the run goes, and where it ends at the latest."""


def recorded_twin(subject: Subject, now: int, inputs: Sequence[Change]) -> dict[str, Any]:
    """Return the run of the twin up to some time after the cycle `now`.

    Raises InputError for a subject that moves no robot, ToolError where MuJoCo is missing.
    """
    job, image, schedule = subject.job, subject.image, subject.schedule
    if job is None or image is None or schedule is None:
        raise InputError("nothing-to-show", "only a job has bodies: a program says nothing about a robot")
    seconds = min(MAX_S, float(subject.clock.seconds(now)) + AHEAD_S)
    record = simulate(job, schedule, image, 0, Settings(seconds=seconds), _stimuli(subject, inputs))
    rows = slice(None, None, round(PICTURE_S / SAMPLE_S))
    lines = [
        {"colour": part.colour, "width": part.width, "points": _packed(np.array(part.frames))}
        for part in body_parts(record, rows)
    ]
    x, y, z, yaw = record.pose[rows].T
    legs = [limb.name for limb in record.rig.robot.limbs if limb.mount is not None]
    return {
        "is": "twin",
        "picture_s": PICTURE_S,
        "count": len(x),
        "lines": lines,
        "x": _packed(x),
        "y": _packed(y),
        "height": _packed(z - record.settings.ground.level),
        "yaw": np.round(yaw, 4).tolist(),
        "feet": _packed(record.feet[rows]),
        "force": np.round(record.force[rows], 1).tolist(),
        "touch": TOUCH_N,
        "legs": legs,
        "floating": record.floating,
        "inputs": len(inputs),
        "ground": record.settings.ground.text(),
    }


def _stimuli(subject: Subject, inputs: Sequence[Change]) -> Stimuli:
    """Return what drives the pins: the subject's own sources, and what was done by hand."""
    by_pin: dict[int, list[tuple[int, int]]] = {}
    for change in inputs:
        by_pin.setdefault(change.pin, []).append((change.cycle, change.level))
    own = subject.stimuli.sources if subject.stimuli else ()
    return Stimuli([*own, *(Levels(pin, at) for pin, at in by_pin.items())])


def _packed(metres: np.ndarray[Any, np.dtype[np.float64]]) -> list[Any]:
    """Return lengths in tenths of a millimetre."""
    return list(np.rint(1e4 * metres).astype(int).tolist())
