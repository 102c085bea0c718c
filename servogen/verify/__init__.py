"""The check that observed edges are the scheduled ones: two streams of edges go in, a verdict comes out."""

from servogen.verify.measure_text import measurement_lines
from servogen.verify.measurement import Measurement, PinMeasurement
from servogen.verify.measuring import measure
from servogen.verify.prove import GLITCH, verify, whole_motion
from servogen.verify.text import verdict_lines
from servogen.verify.verdict import ChannelVerdict, Difference, Overlap, Span, StrayPin, Verdict, Worst

__all__ = [
    "GLITCH",
    "ChannelVerdict",
    "Difference",
    "Measurement",
    "Overlap",
    "PinMeasurement",
    "Span",
    "StrayPin",
    "Verdict",
    "Worst",
    "measure",
    "measurement_lines",
    "verdict_lines",
    "verify",
    "whole_motion",
]
