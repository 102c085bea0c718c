"""Compiling and assembling in a process of its own: whatever the source is, it ends within its limits.

In: the work and its limits. Out: what it returns, or an error that names the file and the limit.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from servogen import programs
from servogen.cli.show import warn
from servogen.errors import Diagnostic
from servogen.isolation import COMPILING, Limits, missing_limits

T = TypeVar("T")

TimeLimit = Annotated[
    float, typer.Option("--timeout", min=0.1, help="Seconds that it may take; then it is stopped.")
]
MemoryLimit = Annotated[
    int, typer.Option("--memory-mb", min=50, help="Memory that it may use; then it is stopped.")
]


def within_limits(
    work: Callable[[], T],
    file: Path,
    limits: Limits = COMPILING,
    hint: str = programs.LIMITS_HINT,
) -> T:
    """Returns what `work`, which compiles `file`, returns. Raises InputError where it exceeds the limits."""
    warn_of_missing_limits()
    return programs.within_limits(work, file, limits, hint)


@cache
def warn_of_missing_limits() -> None:
    """Warn once where this system has no limits."""
    if sentence := missing_limits():
        warn(Diagnostic("warning", "no-limits", sentence))
