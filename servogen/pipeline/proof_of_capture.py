"""Holds what a logic analyser saw against a schedule.

In: a `PulseSchedule` and a `Capture`. Out: the `CaptureVerdict`.
"""

from __future__ import annotations

from servogen.edge_files.captures import Capture
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.verify import CaptureVerdict, Tolerances, verify_capture


def prove_capture(
    schedule: PulseSchedule, capture: Capture, tolerances: Tolerances | None = None
) -> CaptureVerdict:
    """The verdict on what an analyser saw; a capture that is not whole is never proven."""
    verdict = verify_capture(expected(schedule), capture.trace, tolerances, capture.sample, capture.pieces)
    if capture.missing is not None:
        return verdict.but(f"the capture is not whole: {capture.missing}")
    return verdict
