"""The check whether observed edges are the scheduled ones: two streams of edges in, a verdict out."""

from servogen.verify.capture.check import verify_capture
from servogen.verify.capture.text import capture_lines
from servogen.verify.capture.verdict import CapturedChannel, CaptureVerdict, Mismatch, Tolerances
from servogen.verify.compare import GLITCH, verify, whole_motion
from servogen.verify.measure.measure import measure
from servogen.verify.measure.measurement import Measurement, PinMeasurement
from servogen.verify.measure.text import measurement_lines
from servogen.verify.sampling import Sampling, sampling
from servogen.verify.start import channel_pins, find_start
from servogen.verify.text import verdict_lines
from servogen.verify.verdict import (
    ChannelVerdict,
    Difference,
    Overlap,
    Span,
    StrayPin,
    Verdict,
    Worst,
)

__all__ = [
    "GLITCH",
    "CaptureVerdict",
    "CapturedChannel",
    "ChannelVerdict",
    "Difference",
    "Measurement",
    "Mismatch",
    "Overlap",
    "PinMeasurement",
    "Sampling",
    "Span",
    "StrayPin",
    "Tolerances",
    "Verdict",
    "Worst",
    "capture_lines",
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
