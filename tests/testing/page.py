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
from contextlib import AbstractContextManager
from pathlib import Path

from tests.bench.conftest import ROOT, Bench, running

PAGE = (ROOT / "docs" / "testing-firmware.md").read_text()
PROGRAMS = {
    name: f"// {name}{text}" for name, text in re.findall(r"^```c\n// ([\w.]+)(.*?)^```", PAGE, re.M | re.S)
}
TESTS: dict[str, str] = dict(re.findall(r"^```python\n# (test_[\w.]+)\n(.*?)^```", PAGE, re.M | re.S))
JOB = "lab8-exercise"
"""Whose program is on the rig's chip before."""


ROWS, COLUMNS = ("RB0", "RB1", "RB2", "RB3"), ("RB4", "RB5", "RB6")
INPUTS = (
    *(
        f"{row}-{column}={22 + number}"
        for number, (row, column) in enumerate((row, column) for row in ROWS for column in COLUMNS)
    ),
    *("RA1=TX1", "VDD=17"),
)
"""How the input board is wired, beside the default: the keypad's contacts, a serial line, the supply."""


def bench_options(bench: Bench) -> tuple[str, ...]:
    """Return the options by which tests program and watch the chip on a rig."""
    return (
        "--servogen-target=bench",
        f"--servogen-port={bench.paths['analyser']}",
        f"--servogen-inputs={bench.paths['inputs']}",
        *(f"--servogen-input={text}" for text in INPUTS),
        "--servogen-programmer=picpro",
        f"--servogen-programmer-port={bench.paths['programmer']}",
        "--servogen-device=PIC16F84",
    )


def rig() -> AbstractContextManager[Bench]:
    """A rig whose chip's crystal is 180 ppm too fast."""
    return running(JOB, "--crystal-ppm", "180", *(f"--input={text}" for text in INPUTS))


def write(folder: Path, programs: dict[str, str], tests: dict[str, str]) -> None:
    for name, text in {**programs, **tests}.items():
        (folder / name).write_text(text)


def main() -> int:
    with tempfile.TemporaryDirectory() as name, rig() as bench:
        write(Path(name), PROGRAMS, TESTS)
        command = (sys.executable, "-m", "pytest", "-p", "no:xdist", "-v", "-rs", f"--rootdir={name}")
        codes = [
            subprocess.run([*command, *options], cwd=name).returncode
            for options in ((), bench_options(bench))
        ]
    return int(any(codes))


if __name__ == "__main__":
    sys.exit(main())
