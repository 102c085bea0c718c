"""Compiling and assembling in a process of its own: whatever the source is, it ends within its limits.

In: the work and its limits. Out: what it returns, or an error that names the file and the limit.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from servogen.cli.show import warn
from servogen.errors import InputError, Place, ToolError
from servogen.isolation import COMPILING, LimitExceeded, Limits, ProcessDied, missing_limits, run

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
    hint: str = "servogen compile and servogen assemble take --timeout and --memory-mb",
) -> T:
    """Returns what `work`, which compiles `file`, returns. Raises InputError where it exceeds the limits."""
    _warn_of_missing_limits()
    try:
        return run(work, limits)
    except LimitExceeded as error:
        raise InputError(f"compiling it {error}", Place(str(file)), hint) from error
    except ProcessDied as error:
        raise ToolError(
            f"servogen failed while compiling it: {error}", Place(str(file)), "please report this file"
        ) from error


@cache
def _warn_of_missing_limits() -> None:
    if sentence := missing_limits():
        warn(sentence)
