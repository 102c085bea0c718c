"""python -m tests.compiler.cycles [--sdcc PROGRAM --include FOLDER --library FILE ...]

Records the cycles that the programs take now, and prints them; with SDCC's pic14 compiler, beside what its
code takes on the same simulator. The exit code is 1 where a checksum differs or SDCC's code is faster.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from dataclasses import asdict
from pathlib import Path

from servogen.pic.image import from_hex
from tests.compiler.cycles.measure import RECORD, Measured, measured, ours, programs


def sdcc(program: str, includes: list[str], libraries: list[str], path: Path) -> Measured | None:
    """What SDCC makes of a program; None where it refuses it."""
    with tempfile.TemporaryDirectory() as folder:
        made, output = Path(folder) / "program.o", Path(folder) / "program.hex"
        compiled = [program, "-mpic14", "-p16f84", "--use-non-free", "--opt-code-speed", "-c", str(path)]
        compiled += [*(f"-I{include}" for include in includes), "-o", str(made)]
        for command in (compiled, ["gplink", "-r", "-w", "-o", str(output), str(made), *libraries]):
            done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)
            if done.returncode:
                print(f"{path.stem}: {done.stdout}{done.stderr}")
                return None
        return measured(from_hex(output.read_text(), str(output)))


def main() -> int:
    options = argparse.ArgumentParser(prog="python -m tests.compiler.cycles")
    options.add_argument("--sdcc", help="SDCC with the pic14 port")
    options.add_argument("--include", action="append", default=[])
    options.add_argument("--library", action="append", default=[])
    asked = options.parse_args()
    record, slower, different = {}, [], []
    print(f"{'':16} {'cycles':>7} {'words':>6}   SDCC: cycles  words")
    for path in programs():
        found = ours(path)
        record[path.stem] = asdict(found)
        theirs = sdcc(asked.sdcc, asked.include, asked.library, path) if asked.sdcc else None
        line = f"{path.stem:16} {found.cycles:7} {found.words:6}"
        if theirs is not None:
            line += f"   {theirs.cycles:12} {theirs.words:6}   {found.cycles / theirs.cycles:5.2f}"
            if theirs.checksum != found.checksum:
                different.append(path.stem)
            if theirs.cycles < found.cycles:
                slower.append(path.stem)
        print(line)
    RECORD.write_text(json.dumps(record, indent=4) + "\n")
    if different:
        print(f"another checksum: {', '.join(different)}")
    if slower:
        print(f"slower than SDCC: {', '.join(slower)}")
    return 1 if different or slower else 0


if __name__ == "__main__":
    raise SystemExit(main())
