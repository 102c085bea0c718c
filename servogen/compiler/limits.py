"""Limits on the size of a program: bounds on the compiler's own time and memory, far above what the chip
holds.

In: nothing. Out: numbers. A program of 1024 words has a few thousand tokens; whatever exceeds these limits
cannot fit, and is rejected there before it costs seconds.
"""

from __future__ import annotations

SOURCE_CHARACTERS = 200_000
"""In one source file, comments included."""
ALL_CHARACTERS = 400_000
"""In all source files, one that is included twice counted twice."""
INCLUDES = 200
"""#include lines that are followed."""
EXPANDED_CHARACTERS = 400_000
"""In the expansions of all macros, intermediate ones included."""
ASSEMBLY_LINES = 3_000
"""In all source files, outside asm("…")."""
TOKENS = 40_000
"""In one source file after preprocessing."""
ERRORS = 50
"""Errors after which the compiler stops."""
DIGITS = 40
"""Of an integer; 32 bits have 32 at most, in binary."""
INSTRUCTIONS = 6_000
"""Made of the source, before optimisation: about six times the chip's program memory."""
