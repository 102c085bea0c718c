"""Proves every program under a folder of firmware for all inputs, and checks each proof's certificate.

Run by `make prove`: `python tools/prove_firmware.py firmware build/certificates [JOB ...]`, and by
`make certificates` with certificates/ as their folder. It writes a certificate for each program, checks
it with the independent checker, and prints a table. Exit code 1 if a program is not proven or a certificate
is refused.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from servogen.build.certificates import certificate_file
from servogen.checker import Refused, check_certificate, read_certificate
from servogen.pic.image import read_hex
from servogen.programs import read_schedule, read_source
from servogen.prove import certificate, prove_for_all

HEADINGS = ("program", "answer", "states", "runs", "certificate", "held", "checked")


def row(program: Path, output: Path) -> tuple[tuple[str, ...], bool]:
    """Return a program's row of the table, and whether it is proven with a valid certificate."""
    schedule_file = program.parent / "schedule.json"
    schedule, text = read_schedule(schedule_file), schedule_file.read_bytes()
    image = read_hex(read_source(program), str(program)).image
    proof = prove_for_all(image, schedule)
    name = f"{program.parent.name}/{program.name}"
    if not proof.proven:
        shown = proof.counterexample
        why = f"counterexample: {shown.message}" if shown else f"not decided: {proof.reason}"
        return (name, why, str(proof.states), str(proof.runs), "", "", ""), False
    packed = certificate(proof, image, schedule, text)
    file = certificate_file(output, program.parent.name, program.name)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(packed)
    claim = read_certificate(packed, str(file))
    held = ", ".join(f"{pin} at {level}" for pin, level in claim.held.items())
    cells = (name, "proven", str(proof.states), str(proof.runs), f"{len(packed)} bytes", held)
    try:
        check_certificate(claim, image, text, str(schedule_file))
    except Refused as refused:
        return (*cells, f"refused: {refused}"), False
    return (*cells, "valid"), True


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
