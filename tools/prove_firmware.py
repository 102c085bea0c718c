"""Proves every program under a folder of firmware for all inputs, and checks each proof's certificate.

Run by `make prove`: `python tools/prove_firmware.py firmware build/certificates [JOB ...]`, and by
`make certificates` with certificates/ as their folder. It has each proof checked by the independent checker,
writes its certificate, and prints a table. Exit code 1 if a program is not proven and checked.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from servogen.pic.image import read_hex
from servogen.programs import read_schedule, read_source
from servogen.workflows.certificates import certificate_file, prove_program

HEADINGS = ("program", "states", "runs", "certificate", "verdict")


def row(program: Path, output: Path) -> tuple[tuple[str, ...], bool]:
    """Return a program's row of the table, and whether it is proven and checked."""
    schedule_file = program.parent / "schedule.json"
    schedule, text = read_schedule(schedule_file), schedule_file.read_bytes()
    image = read_hex(read_source(program), str(program)).image
    verdict, proof, witness = prove_program(image, schedule, text)
    cells = (f"{program.parent.name}/{program.name}", str(proof.states), str(proof.runs))
    if witness is None or witness.checked is None:
        return (*cells, "", verdict.text), False
    file = certificate_file(output, program.parent.name, program.name)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(witness.certificate)
    return (*cells, f"{len(witness.certificate)} bytes", verdict.text), True


def programs(folder: Path, jobs: list[str]) -> Iterator[Path]:
    """Yield the programs of the jobs, or of all."""
    for schedule in sorted(folder.glob("*/schedule.json")):
        if not jobs or schedule.parent.name in jobs:
            yield from sorted(schedule.parent.glob("main*.hex"))


def main(arguments: list[str]) -> int:
    folder, output, jobs = Path(arguments[0]), Path(arguments[1]), arguments[2:]
    every = list(programs(folder, jobs))
    if not every:
        print(f"{folder}: no such job", file=sys.stderr)
        return 2
    print(" | ".join(HEADINGS))
    fine = True
    for program in every:
        cells, good = row(program, output)
        fine &= good
        print(" | ".join(cells), flush=True)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
