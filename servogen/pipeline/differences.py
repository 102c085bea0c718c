"""What differs between a folder of made files and the one that is kept.

In: two folders. Out: a line for each file that is missing, left over or different, with the first difference.
"""

from __future__ import annotations

from itertools import zip_longest
from pathlib import Path


def differences(made: Path, kept: Path) -> list[str]:
    """Lines for people; none when both folders hold the same files."""
    names = sorted({path.name for folder in (made, kept) if folder.is_dir() for path in folder.iterdir()})
    return [line for name in names if (line := _difference(made / name, kept / name))]


def _difference(made: Path, kept: Path) -> str | None:
    if not kept.is_file():
        return f"{kept}: is missing"
    if not made.is_file():
        return f"{kept}: is no longer made"
    if made.read_bytes() == kept.read_bytes():
        return None
    pairs = zip_longest(made.read_text().splitlines(), kept.read_text().splitlines())
    for number, (new, old) in enumerate(pairs, 1):
        if new != old:
            return f"{kept}:{number}: is '{old}', now '{new}'"
    return f"{kept}: differs in its line ends"
