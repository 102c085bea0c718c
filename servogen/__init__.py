"""servogen: from a robot's job file to a PIC16F84 HEX whose every servo pulse edge is exact.

`servogen.api` has the four functions for notebooks and short scripts; the packages hold everything else.
"""

__version__ = "0.1.0"

INTERRUPTED = 130
"""The exit code after Ctrl-C; it is defined here so that it is known before anything else is imported."""
