"""`firmware/` is what the jobs make today, byte for byte.

The edges, listings, VCD files and SDCC's C are not committed: firmware/SHA256SUMS holds their checksums.
"""

import subprocess
from itertools import zip_longest
from pathlib import Path

import pytest

from servogen.engines.firmware import ResourceError
from servogen.job import load, plan_job
from servogen.workflows.job_build import build, write
from tools.firmware_checksums import SUMS, checksum, ignored_names, read_sums, update_sums

ROOT = Path(__file__).parent.parent
FIRMWARE = ROOT / "firmware"
JOBS = sorted((ROOT / "jobs").glob("*.toml"))
IGNORED = ignored_names()
KEPT = sorted(folder.name for folder in FIRMWARE.iterdir() if folder.is_dir())
MAX_LINES = 26_000
EVERY_CHANGE = {
    *("lab8-program", "lab8-exercise", "lab9-program", "lab9-exercise"),
    *("omni-square", "hexapod-command", "hexapod-ripple", "scara-pick", "stream-fast"),
}
"""What `make test` builds, of each engine and kind of motion the quickest; the others are a campaign."""


@pytest.mark.parametrize(
    "job",
    [
        pytest.param(job, marks=() if job.stem in EVERY_CHANGE else pytest.mark.campaign, id=job.stem)
        for job in JOBS
    ],
)
def test_the_kept_firmware_is_what_the_job_makes(job: Path, tmp_path: Path) -> None:
    if job.stem not in KEPT:
        with pytest.raises(
            ResourceError, match=f"{job.stem}: planned, but more than the sequence engine can hold"
        ):
            build(plan_job(load(job)))
        return
    made = build(plan_job(load(job)))
    for program in made.programs:
        assert not program.firmware.compilation.diagnostics
    write(made, tmp_path)
    assert differences(tmp_path, FIRMWARE / job.stem) == [], "run: make firmware"


def test_the_labs_jobs_and_one_of_each_kind_are_kept() -> None:
    assert set(KEPT) >= EVERY_CHANGE


def test_every_job_has_a_checksum_of_each_ignored_file() -> None:
    assert {"edges.csv", "main.lst", "main.sdcc.c", "main.vcd"} == IGNORED
    assert sorted(read_sums(FIRMWARE)) == sorted(f"{job}/{name}" for job in KEPT for name in IGNORED)


def test_the_committed_files_stay_short() -> None:
    """They were 160 509 lines when the edges and listings were among them."""
    files = [path for job in KEPT for path in (FIRMWARE / job).iterdir() if path.name not in IGNORED]
    lines = sum(path.read_bytes().count(b"\n") for path in [*files, FIRMWARE / SUMS])
    assert lines <= MAX_LINES


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """The folder of a job as it is made now, and the same as it is kept, both equal."""
    made, kept = tmp_path / "made", tmp_path / "firmware" / "job"
    for folder in (made, kept):
        folder.mkdir(parents=True)
        (folder / "main.hex").write_text("1\n2\n")
        for name in IGNORED:
            (folder / name).write_text(f"1\n{name}\n3\n")
    update_sums(kept.parent, ["job"])
    assert differences(made, kept) == []
    return made, kept


def test_a_changed_or_missing_or_left_over_file_is_named(folders: tuple[Path, Path]) -> None:
    made, kept = folders
    (made / "main.hex").write_text("1\n3\n")
    (made / "new").write_text("")
    (kept / "old").write_text("")
    assert differences(made, kept) == [
        f"{kept}/main.hex:2: is '2', now '3'",
        f"{kept}/new: is missing",
        f"{kept}/old: is no longer made",
    ]


@pytest.mark.parametrize("name", sorted(IGNORED))
def test_one_changed_byte_in_a_file_that_is_not_committed_is_named(
    folders: tuple[Path, Path], name: str
) -> None:
    made, kept = folders
    (made / name).write_text(f"1\n{name}\n4\n")
    assert differences(made, kept) == [f"{kept}/{name}:3: is '3', now '4'"]
    (kept / name).unlink()
    assert differences(made, kept) == [f"{kept}/{name}: differs from its line in SHA256SUMS"]
    (kept / name).write_text("left from before\n")
    assert differences(made, kept) == [f"{kept}/{name}: differs from its line in SHA256SUMS"]


def test_what_lies_beside_the_committed_files_changes_nothing(folders: tuple[Path, Path]) -> None:
    made, kept = folders
    for name in IGNORED:
        (kept / name).write_text("left from before\n")
    assert differences(made, kept) == []


def test_a_file_without_a_checksum_and_a_checksum_without_a_file_are_named(
    folders: tuple[Path, Path],
) -> None:
    made, kept = folders
    (made / "main.lst").unlink()
    sums = kept.parent / SUMS
    sums.write_text("".join(line for line in sums.read_text().splitlines(True) if "main.vcd" not in line))
    assert differences(made, kept) == [
        f"{kept}/main.lst: is no longer made",
        f"{kept}/main.vcd: has no line in SHA256SUMS",
    ]


def test_the_checksums_of_other_jobs_stay_and_those_of_removed_jobs_go(folders: tuple[Path, Path]) -> None:
    _, kept = folders
    sums = kept.parent / SUMS
    other, gone = ("0" * 64 + f"  {job}/main.lst\n" for job in ("another", "gone"))
    (kept.parent / "another").mkdir()
    own = sums.read_text()
    sums.write_text(own + gone + other)
    update_sums(kept.parent, ["job"])
    assert sums.read_text() == other + own


def test_sha256sum_reads_the_checksums(folders: tuple[Path, Path]) -> None:
    """The second witness of the checksums: the program of the GNU core utilities."""
    _, kept = folders
    check = ["sha256sum", "--check", "--strict", SUMS]
    assert subprocess.run(check, cwd=kept.parent, capture_output=True).returncode == 0
    (kept / "main.lst").write_text("1\nmain.lst\n4\n")
    done = subprocess.run(check, cwd=kept.parent, capture_output=True, text=True)
    assert done.returncode == 1
    assert "job/main.lst: FAILED" in done.stdout


def test_a_job_that_was_not_made_is_refused(folders: tuple[Path, Path]) -> None:
    _, kept = folders
    (kept / "main.lst").unlink()
    with pytest.raises(FileNotFoundError, match=r"job/main\.lst"):
        update_sums(kept.parent, ["job"])


def differences(made: Path, kept: Path) -> list[str]:
    """Returns a line for each file that is missing, left over or different, sorted by file."""
    files = {path.name for folder in (made, kept) if folder.is_dir() for path in folder.iterdir()} - IGNORED
    lines = {name: _difference(made / name, kept / name) for name in files}
    sums = read_sums(kept.parent)
    for name in IGNORED:
        lines[name] = _ignored_difference(made / name, kept / name, sums.get(f"{kept.name}/{name}"))
    return [line for _, line in sorted(lines.items()) if line]


def _ignored_difference(made: Path, kept: Path, expected: str | None) -> str | None:
    """Returns the difference from the checksum, with its line if the file that was summed is still there."""
    if not made.is_file():
        return f"{kept}: is no longer made" if expected else None
    if expected is None:
        return f"{kept}: has no line in {SUMS}"
    if checksum(made) == expected:
        return None
    if kept.is_file() and checksum(kept) == expected:
        return _difference(made, kept)
    return f"{kept}: differs from its line in {SUMS}"


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
