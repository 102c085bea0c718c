"""The check that observed edges are the scheduled ones: two streams of edges go in, a verdict comes out."""

from servogen.verify.prove import GLITCH, verify, whole_motion
from servogen.verify.text import verdict_lines
from servogen.verify.verdict import ChannelVerdict, Difference, Overlap, Span, StrayPin, Verdict, Worst

__all__ = [
    "GLITCH",
    "ChannelVerdict",
    "Difference",
    "Overlap",
    "Span",
    "StrayPin",
    "Verdict",
    "Worst",
    "verdict_lines",
    "verify",
    "whole_motion",
]
