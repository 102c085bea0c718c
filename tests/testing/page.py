"""The examples of docs/testing-firmware.md, on the simulated chip and on the rig.

    python -m tests.testing.page

runs the tests of all ten on both and prints what passed and what was skipped, with the reason. Exit code 1 if
any fails.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.bench.conftest import ROOT, Bench, running

PAGE = (ROOT / "docs" / "testing-firmware.md").read_text()
PROGRAMS = {
    name: f"// {name}{text}" for name, text in re.findall(r"^```c\n// ([\w.]+)(.*?)^```", PAGE, re.M | re.S)
}
TESTS: dict[str, str] = dict(re.findall(r"^```python\n# (test_[\w.]+)\n(.*?)^```", PAGE, re.M | re.S))
JOB = "lab8-exercise"
"""Whose program is on the rig's chip before."""


def bench_options(bench: Bench) -> tuple[str, ...]:
    """Return the options by which tests program and watch the chip on a rig."""
    return (
        "--servogen-target=bench",
        f"--servogen-port={bench.paths['analyser']}",
        "--servogen-programmer=picpro",
        f"--servogen-programmer-port={bench.paths['programmer']}",
        "--servogen-device=PIC16F84",
    )


def write(folder: Path, programs: dict[str, str], tests: dict[str, str]) -> None:
    for name, text in {**programs, **tests}.items():
        (folder / name).write_text(text)


def main() -> int:
    with tempfile.TemporaryDirectory() as name, running(JOB, "--crystal-ppm", "180") as bench:
        write(Path(name), PROGRAMS, TESTS)
        command = (sys.executable, "-m", "pytest", "-p", "no:xdist", "-v", "-rs", f"--rootdir={name}")
        codes = [
            subprocess.run([*command, *options], cwd=name).returncode
            for options in ((), bench_options(bench))
        ]
    return int(any(codes))


if __name__ == "__main__":
    sys.exit(main())
