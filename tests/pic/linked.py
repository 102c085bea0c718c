"""Random programs of several relocatable sources: the same words from gpasm with gplink, and from here.

    python -m tests.pic.linked --programs 200
    python -m tests.pic.linked --folder gpsim/regression

With `--folder` it compares every source below it that gpasm, or gpasm with gplink, accepts for one of our
chips. Needs gputils. Exit code 1 if a program differs. What gplink has no room for must be refused here, too.
"""

from __future__ import annotations

import argparse
import random
import re
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from servogen.errors import InputError
from servogen.pic.assembler.assembly import Assembly, AssemblySource, beside, link
from servogen.pic.assembler.state import Include
from servogen.pic.device import RAM_LAST
from servogen.pic.image import Image, from_hex

NAMES = ("MAIN", "PROG", "TABLES", "ISR", "SHARED")


def sources(seed: int) -> list[str]:
    """Return one to four sources, which use each other's names."""
    rng = random.Random(seed)
    count = rng.randint(1, 4)
    functions = {f"f{module}_{number}": module for module in range(count) for number in range(3)}
    bytes_of = {f"v{module}_{number}": module for module in range(count) for number in range(3)}
    return [_source(rng, module, functions, bytes_of) for module in range(count)]


def _source(rng: random.Random, module: int, functions: dict[str, int], variables: dict[str, int]) -> str:
    own_functions = [name for name, owner in functions.items() if owner == module]
    own_variables = [name for name, owner in variables.items() if owner == module]
    foreign = [name for name, owner in (functions | variables).items() if owner != module]
    lines = [
        " list p=16f84a",
        " include <p16f84a.inc>",
        f" global {', '.join(own_functions + own_variables)}",
    ]
    lines += [f" extern {name}" for name in foreign]
    if module == 0:
        lines += [" __config _XT_OSC & _WDT_OFF", "RESET CODE 0", f" goto {own_functions[0]}"]
        if rng.random() < 0.5:
            lines += ["VECTOR CODE 4", *_body(rng, functions, variables), " retfie"]
        if rng.random() < 0.3:
            lines += ["BYTES CODE 0x2100", " de 1, 2, 3"]
    for name in own_variables:
        kind = rng.choice(["udata", "udata_shr", "udata_ovr", "idata"])
        # A section may be opened once: gpasm 1.4 ends at the second time.
        own = rng.random() < 0.6
        lines += [f"{name}_{kind} {kind}" if own else f"S{module % 2}_{name[-1]}_{kind} {kind}"]
        places = f"res {rng.randint(1, rng.choice([6, 6, 30]))}"
        if kind == "idata":
            places = rng.choice([places, 'db 1, "ab", 255', "dw 0x1234, 5", "db 7"])
        lines += [f"{name} {places}"]
    used: set[str] = set()
    for name in own_functions:
        section = rng.choice([each for each in (*NAMES, f"own{name}") if each not in used])
        used.add(section)
        lines += [f"{section} CODE", name, *_body(rng, functions, variables), " return"]
    return "\n".join([*lines, " end", ""])


def _body(rng: random.Random, functions: dict[str, int], variables: dict[str, int]) -> list[str]:
    rows = []
    for _ in range(rng.randint(0, 20)):
        variable, function = rng.choice([*variables]), rng.choice([*functions])
        rows.append(
            rng.choice(
                [
                    f" banksel {variable}",
                    f" incf {variable}, f",
                    f" movf {variable} + {rng.randint(0, 2)}, w",
                    f" bsf {variable}, {rng.randrange(8)}",
                    f" movlw {variable}",
                    f" call {function}",
                    f" goto {function} + 1",
                    f" movlw low({function})",
                    f" movlw high({function} + 3)",
                    " goto $ + 1",
                    " goto $ - 1",
                    " banksel TRISB",
                    " clrf TRISB ^ 0x80",
                    ' dt "ab", 1',
                    " dw 0x1234",
                ]
            )
        )
    return rows


def by_gplink(texts: Sequence[str], folder: Path) -> Image | None:
    """Return gputils' program; None where gplink refuses it."""
    objects = []
    for number, text in enumerate(texts):
        source = folder / f"m{number}.asm"
        source.write_text(text)
        subprocess.run(["gpasm", "-q", "-c", source.name], cwd=folder, check=True, capture_output=True)
        objects.append(f"m{number}.o")
    linked = subprocess.run(
        ["gplink", "-q", "-r", "-o", "all.hex", *objects], cwd=folder, capture_output=True, text=True
    )
    if linked.returncode or "error" in linked.stdout + linked.stderr:
        return None
    return from_hex((folder / "all.hex").read_text(), "all.hex")


def by_us(texts: Sequence[str]) -> Assembly | None:
    """Return our program; None where a section has no room."""
    try:
        return link([AssemblySource(text, f"m{number}.asm") for number, text in enumerate(texts)])
    except InputError as error:
        if all(each.code in ("asm-no-room", "asm-overwrite") for each in error.diagnostics):
            return None
        raise


def verdict(seed: int) -> str:
    with tempfile.TemporaryDirectory() as folder:
        theirs, ours = by_gplink(sources(seed), Path(folder)), by_us(sources(seed))
    if ours is None:
        return "refused by both" if theirs is None else "refused by one"
    if theirs is None:
        # gplink does not see a free block of one byte at the end of the memory.
        last = any(first + size - 1 == RAM_LAST for first, _, size in ours.listing.variables)
        return "refused by gplink for the last byte" if last else "refused by one"
    return "same" if theirs == ours.image else "different"


CHIP = re.compile(r"\b(?:pic)?16[fc]8[34]a?\b", re.IGNORECASE)


def verdict_of(path: Path) -> str | None:
    """Return how a source of somebody else compares; None where it is not a program for our chips."""
    text = path.read_text(encoding="latin-1")
    if not CHIP.search(text):
        return None
    with tempfile.TemporaryDirectory() as folder:
        hexfile = Path(folder, "it.hex")
        quiet = ["-q", "-w", "2", "-I", str(path.parent)]
        absolute = subprocess.run(["gpasm", *quiet, "-o", str(hexfile), str(path)], capture_output=True)
        if absolute.returncode:
            object_file = str(Path(folder, "it.o"))
            made = subprocess.run(["gpasm", *quiet, "-c", "-o", object_file, str(path)], capture_output=True)
            linked = ["gplink", "-q", "-r", "-o", str(hexfile), object_file]
            if made.returncode or subprocess.run(linked, capture_output=True).returncode:
                return "refused by gputils"
        kind = "relocatable" if absolute.returncode else "absolute"
        try:
            ours = link([AssemblySource(text, str(path), found_by_gpasm(path.parent))]).image
            theirs = from_hex(hexfile.read_text(), str(hexfile))
        except InputError as error:
            return f"{kind}: refused: {error.diagnostics[0].message}"
        return f"{kind}: same" if ours == theirs else f"{kind}: different"


def found_by_gpasm(folder: Path) -> Include:
    """Return a reader of include files of a folder, and of gputils' own macros for gpsim."""
    own, gputils = beside(folder), beside(Path("/usr/share/gputils/header"))
    return lambda name: gputils(name) if name == "coff.inc" else own(name)


def compare(folder: Path) -> int:
    found: Counter[str] = Counter()
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() == ".asm" and (word := verdict_of(path)) is not None:
            found[word] += 1
            if not word.endswith("same"):
                print(f"{path.relative_to(folder)}: {word}")
    print(dict(found))
    return int(any(word.endswith("different") for word in found))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path)
    given = parser.parse_args()
    if given.folder is not None:
        return compare(given.folder)
    found: Counter[str] = Counter()
    for seed in range(given.seed, given.seed + given.programs):
        word = verdict(seed)
        found[word] += 1
        if word in ("different", "refused by one"):
            print(f"seed {seed}: {word}")
    print(dict(found))
    return int(bool(found["different"] or found["refused by one"]))


if __name__ == "__main__":
    sys.exit(main())
