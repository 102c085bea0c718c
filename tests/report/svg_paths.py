"""What the paths of SVG pictures lead through."""

from __future__ import annotations

import re


def numbers(path: str) -> list[float]:
    """Return the numbers of a path."""
    return [float(each) for each in re.findall(r"-?[\d.]+", path)]
