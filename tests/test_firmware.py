"""`firmware/` is what the jobs make today, byte for byte."""

from itertools import zip_longest
from pathlib import Path

import pytest

from servogen.job import load
from servogen.pipeline import DoesNotFit, build, write

ROOT = Path(__file__).parent.parent
JOBS = sorted((ROOT / "jobs").glob("*.toml"))
NOT_KEPT = "main.vcd"
"""Large, and nothing that edges.csv does not tell."""
KEPT = sorted(folder.name for folder in (ROOT / "firmware").iterdir())


@pytest.mark.parametrize("job", JOBS, ids=lambda job: job.stem)
def test_the_kept_firmware_is_what_the_job_makes(job: Path, tmp_path: Path) -> None:
    if job.stem not in KEPT:
        with pytest.raises(
            DoesNotFit, match=f"{job.stem}: planned, but more than the sequence engine can hold"
        ):
            build(load(job))
        return
    write(build(load(job)), tmp_path)
    assert differences(tmp_path, ROOT / "firmware" / job.stem) == [], "run: make firmware"


def test_the_labs_jobs_are_kept() -> None:
    assert {"lab8-program", "lab8-exercise", "lab9-program", "lab9-exercise"} <= set(KEPT)


def test_a_changed_or_missing_or_left_over_file_is_named(tmp_path: Path) -> None:
    for folder in ("made", "kept"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "same").write_text("1\n2\n")
        (tmp_path / folder / "other").write_text(f"1\n{folder}\n")
    (tmp_path / "made" / "new").write_text("")
    (tmp_path / "kept" / "old").write_text("")
    new, old, other = sorted(
        line.removeprefix(f"{tmp_path}/kept/") for line in differences(tmp_path / "made", tmp_path / "kept")
    )
    assert new == "new: is missing"
    assert old == "old: is no longer made"
    assert other == "other:2: is 'kept', now 'made'"


def differences(made: Path, kept: Path) -> list[str]:
    """A line for each file that is missing, left over or different; none when both folders are the same."""
    files = [path for folder in (made, kept) if folder.is_dir() for path in folder.iterdir()]
    names = sorted({path.name for path in files} - {NOT_KEPT})
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
