"""A class of programs, graded with films of those that fail: how long it takes, how large the pages are.

    python -m tests.watch.class_films [PROGRAMS]

The programs (default: 200) are those of `tests/grade/programs` for lab 8, each with a comment of its own.
`servogen grade --pages` grades them on all cores; the exit code is 1 where it takes longer than 5 minutes,
where a page is larger than 300 KB, or where a program that ran and failed has no film.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAMS = Path(__file__).parent.parent / "grade" / "programs"
MAX_S, MAX_BYTES = 300.0, 300_000
COMMENTS = {".c": "// {}\n", ".asm": "; {}\n"}


def main() -> int:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    with tempfile.TemporaryDirectory() as folder:
        students, pages = Path(folder) / "class", Path(folder) / "pages"
        _hand_in(students, count)
        begin = time.monotonic()
        command = [sys.executable, "-m", "servogen", "grade", "lab8-exercise", str(students)]
        done = subprocess.run(
            [*command, "--pages", str(pages), "--json"], capture_output=True, text=True, check=False
        )
        seconds = time.monotonic() - begin
        if done.returncode not in (0, 1):
            print(done.stderr)
            return done.returncode
        return _judged(json.loads(done.stdout)["programs"], pages, seconds)


def _hand_in(students: Path, count: int) -> None:
    """Write the programs, a folder each."""
    sources = sorted(PROGRAMS.glob("lab8-*/*"))
    for number in range(count):
        source = sources[number % len(sources)]
        own = students / f"student-{number:04}"
        own.mkdir(parents=True)
        comment = COMMENTS[source.suffix].format(f"student {number}")
        (own / f"main{source.suffix}").write_text(comment + source.read_text())


def _judged(programs: list[dict[str, object]], pages: Path, seconds: float) -> int:
    sizes = {page.name: page.stat().st_size for page in pages.iterdir()}
    films = [name for name in sizes if name.endswith(".html") and name != "index.html"]
    largest = max(sizes, key=sizes.__getitem__)
    ran = [each for each in programs if each["watched_s"] and not each["passed"]]
    without = [
        each["program"] for each in ran if f"{each['page']}".removesuffix(".md") + ".html" not in films
    ]
    passed = sum(bool(each["passed"]) for each in programs)
    print(f"{len(programs)} programs in {seconds:.0f} s on {os.cpu_count()} cores, {passed} passed")
    print(f"{len(films)} films, {len(without)} missing")
    print(f"the largest page: {largest}, {sizes[largest] / 1000:.0f} KB")
    return int(seconds > MAX_S or sizes[largest] > MAX_BYTES or bool(without))


if __name__ == "__main__":
    sys.exit(main())
