"""Checks whether observed edges are the scheduled ones: two streams of edges in, a verdict out."""

from servogen.verify.capture.check import verify_capture
from servogen.verify.capture.verdict import CaptureVerdict, Tolerances, capture_lines, capture_summary
from servogen.verify.compare import verify, whole_motion
from servogen.verify.measurement import Measurement, PinMeasurement, measure, measurement_lines
from servogen.verify.sampling import Sampling, sampling
from servogen.verify.start import channel_pins, find_start
from servogen.verify.verdict import Verdict, verdict_lines

__all__ = [
    "CaptureVerdict",
    "Measurement",
    "PinMeasurement",
    "Sampling",
    "Tolerances",
    "Verdict",
    "capture_lines",
    "capture_summary",
    "channel_pins",
    "find_start",
    "measure",
    "measurement_lines",
    "sampling",
    "verdict_lines",
    "verify",
    "verify_capture",
    "whole_motion",
]
