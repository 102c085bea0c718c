"""Sizes in program words of realistic programs: those beside this module and the lab programs.

In: C files. Out: words by file name and level of optimisation, measured and as recorded in `sizes.json`.

`before.json` holds the words, at -O1, of these programs and of the jobs that the sequence engine builds, in
all three dialects, before the compiler had counting loops, idioms and shared delay loops
(commit 1771599^).
"""

from __future__ import annotations

import json
from pathlib import Path

from servogen.compiler import Options, Source, compile_sources
from servogen.pic.image import from_hex

HERE = Path(__file__).parent
TESTS = HERE.parent.parent
RECORD = HERE / "sizes.json"
BEFORE = HERE / "before.json"
FIRMWARE = TESTS.parent / "firmware"


def programs() -> dict[str, tuple[Path, str]]:
    """Path and dialect by name relative to the tests."""
    found = [(path, path.name[:3]) for path in HERE.glob("*.c")]
    found += [
        (path, dialect) for dialect in ("c2c", "xc8") for path in (TESTS / f"labs_{dialect}").glob("*.c")
    ]
    return {path.relative_to(TESTS).as_posix(): (path, dialect) for path, dialect in sorted(found)}


LEVELS = ("speed", "size")


def words(path: Path, dialect: str, level: str) -> int:
    options = Options(dialect=dialect, clock_hz=4_000_000, optimise=level)
    return compile_sources([Source(path.read_text(), path.name)], options).words


def measured() -> dict[str, dict[str, int]]:
    return {name: {level: words(*row, level) for level in LEVELS} for name, row in programs().items()}


def recorded() -> dict[str, dict[str, int]]:
    return json.loads(RECORD.read_text()) if RECORD.exists() else {}


def before() -> dict[str, int]:
    return json.loads(BEFORE.read_text())


def now() -> dict[str, int]:
    """Words of the programs of `before` now: as recorded, and those of the jobs in firmware/."""
    record = recorded()
    return {
        name: record[name]["speed"] if name in record else from_hex((FIRMWARE / name).read_text(), name).words
        for name in before()
    }
