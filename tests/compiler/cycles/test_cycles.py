"""The compiler's code may get faster, never slower.

The recorded checksums are those that the same programs show when SDCC compiles them: `python -m
tests.compiler.cycles --sdcc …` compares both.
"""

from pathlib import Path

import pytest

from tests.compiler.cycles.measure import ours, programs, recorded


@pytest.mark.parametrize("path", programs(), ids=lambda path: path.stem)
def test_no_program_gets_slower(path: Path) -> None:
    record, found = recorded()[path.stem], ours(path)
    assert found.checksum == record.checksum
    assert found.cycles <= record.cycles


def test_what_is_recorded_exists() -> None:
    assert sorted(recorded()) == [path.stem for path in programs()]
