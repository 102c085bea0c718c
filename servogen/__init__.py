"""servogen: from a robot's job file to a PIC16F84 HEX whose every servo pulse edge is exact.

`servogen.api` has the four functions for notebooks and short scripts; the packages hold everything else.
"""

__version__ = "0.1.0"

INTERRUPTED, NOBODY_READS = 130, 141
"""The exit codes after Ctrl-C, and after a closed pipe or output; known before anything else is imported."""
