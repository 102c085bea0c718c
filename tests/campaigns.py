"""Which cases of a law every change runs, and which are a campaign."""

from collections.abc import Collection
from typing import Any

import pytest


def sampled(cases: Collection[Any], kept: int = 1) -> list[Any]:
    """The cases; `make test` runs `kept` of them, the first and others evenly behind it, `make check` all.

    A case of several arguments is a tuple.
    """
    every_change = {number * len(cases) // kept for number in range(kept)}
    return [
        pytest.param(
            *(case if isinstance(case, tuple) else (case,)),
            marks=() if number in every_change else pytest.mark.campaign,
        )
        for number, case in enumerate(cases)
    ]
