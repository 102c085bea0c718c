"""The hardware stack: eight levels in a ring, which wraps without notice. Compiled. DS35007 section 2.4.1."""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.layout import (
    DEEPEST,
    DEPTH,
    OVERFLOWS,
    SP,
    STACK,
    UNDERFLOWS,
    WARN_STACK_OVERFLOW,
    WARN_STACK_UNDERFLOW,
)
from servogen.simulator.warn import warn

LEVELS = 8


@compiled
def push(s: Vector, address: int) -> None:
    """Push a return address; a ninth overwrites the first."""
    s[STACK + s[SP]] = address
    s[SP] = (s[SP] + 1) & (LEVELS - 1)
    if s[DEPTH] == LEVELS:
        s[OVERFLOWS] += 1
        warn(s, WARN_STACK_OVERFLOW, 0)
    else:
        s[DEPTH] += 1
        s[DEEPEST] = max(s[DEEPEST], s[DEPTH])


@compiled
def pop(s: Vector) -> int:
    """Return the latest return address."""
    s[SP] = (s[SP] - 1) & (LEVELS - 1)
    if s[DEPTH] == 0:
        s[UNDERFLOWS] += 1
        warn(s, WARN_STACK_UNDERFLOW, 0)
    else:
        s[DEPTH] -= 1
    return s[STACK + s[SP]]
