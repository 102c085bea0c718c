"""Holds what a logic analyser saw against a schedule.

In: a `PulseSchedule` and a `Capture`. Out: the `CaptureVerdict`.
"""

from __future__ import annotations

from servogen.errors import Location
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.traces.captures import Capture
from servogen.verify import CaptureVerdict, Tolerances, sampling, verify_capture


def prove_capture(
    schedule: PulseSchedule, capture: Capture, tolerances: Tolerances | None = None
) -> CaptureVerdict:
    """Return the verdict on what an analyser saw; a capture that is not whole is never proven.

    Raises InputError where it was, or may have been, sampled too slowly to prove anything.
    """
    trace = capture.trace.stored()
    longest_us = (tolerances or Tolerances()).glitch_us
    sampling(trace, capture.sample).check(longest_us, Location(capture.file))
    verdict = verify_capture(expected(schedule), trace, tolerances, capture.sample, capture.pieces)
    if capture.missing is not None:
        return verdict.but(f"the capture is not whole: {capture.missing}")
    return verdict
