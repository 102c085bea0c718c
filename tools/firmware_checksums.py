"""Writes firmware/SHA256SUMS: a checksum for every generated file that git ignores.

Run by `make firmware`: `python tools/firmware_checksums.py firmware [JOB ...]`. With jobs, the lines of the
others stay as they are. `sha256sum --check SHA256SUMS` inside firmware/ reads the file.

The edges, listings and VCD files are six times as long as all else under firmware/, and follow from it, as
does the C for SDCC, a third spelling of the same program. Their checksums are enough to notice a change;
`make firmware` writes the files themselves to look at.
"""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parent.parent
SUMS = "SHA256SUMS"


def ignored_names() -> frozenset[str]:
    """Return the names of the files in a job's folder that .gitignore keeps out of the repository."""
    lines = (ROOT / ".gitignore").read_text().splitlines()
    return frozenset(line.removeprefix("firmware/*/") for line in lines if line.startswith("firmware/*/"))


def read_sums(folder: Path) -> dict[str, str]:
    """Return file (`job/name`) -> checksum from the folder's SHA256SUMS; empty if there is none."""
    path = folder / SUMS
    if not path.is_file():
        return {}
    sums = {}
    for number, line in enumerate(path.read_text().splitlines(), 1):
        found = re.fullmatch(r"([0-9a-f]{64})  ([^/]+/[^/]+)", line)
        if not found:
            raise ValueError(f"{path}:{number}: '{line}' is not a checksum and a file (job/name)")
        sums[found[2]] = found[1]
    return sums


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def update_sums(folder: Path, jobs: Iterable[str]) -> None:
    """Write SHA256SUMS with new lines for `jobs`, dropping jobs that have no folder any more.

    Raises FileNotFoundError where a job's folder lacks one of the ignored files.
    """
    jobs = set(jobs)
    there = {path.name for path in folder.iterdir() if path.is_dir()}
    kept = {
        file: digest
        for file, digest in read_sums(folder).items()
        if (job := file.split("/")[0]) in there and job not in jobs
    }
    made = {
        f"{job}/{name}": checksum(folder / job / name) for job in jobs & there for name in ignored_names()
    }
    lines = [f"{digest}  {file}\n" for file, digest in sorted((kept | made).items())]
    (folder / SUMS).write_text("".join(lines))


def main() -> int:
    folder, jobs = Path(sys.argv[1]), sys.argv[2:]
    try:
        update_sums(folder, jobs or [path.name for path in folder.iterdir() if path.is_dir()])
    except FileNotFoundError as error:
        print(f"{error.filename}: missing; make firmware writes it", file=sys.stderr)
        return 1
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
