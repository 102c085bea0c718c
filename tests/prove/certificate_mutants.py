"""Changed certificates, and certificates of changed programs: the checker must refuse them.

    python -m tests.prove.certificate_mutants --count 500
    python -m tests.prove.certificate_mutants --certificate c.xz --program main.hex --against schedule.json

Each mutant differs in one thing. One that is accepted is counted as equivalent if it can be shown to be: the
changed field says nothing in that state, only the unknown bits changed (a wider state, or a narrower one
that still contains all that comes to it), or the states are the same.
"""

from __future__ import annotations

import argparse
import copy
import random
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from servogen.checker import Refused, check_certificate, read_certificate
from servogen.checker.certificate import CELLS, FREE, NUMBERS, fingerprint
from servogen.errors import InputError
from servogen.pic.image import Image, from_hex
from servogen.pic.isa import decode
from servogen.simulator import Machine, Stimuli
from servogen.simulator.sources import Levels
from servogen.units import Clock
from tests.checker import certify

Data = dict[str, Any]


@dataclass(frozen=True)
class Subject:
    """A program, its schedule, and a certificate of them."""

    image: Image
    schedule: bytes
    data: Data
    forget: Callable[[Any], None] | None = None


def subject() -> Subject:
    """A servo and a button, certified by the tests."""
    image = certify.button_program()
    text = certify.schedule(certify.STOP)
    packed = certify.certify(image, text, [6, max(image.program)])
    return Subject(image, text, certify.unpack(packed))


def verdict(case: Subject, data: Data, image: Image | None = None) -> str:
    """ "" if the checker accepts it, else the reason."""
    try:
        claim = read_certificate(certify.pack(data), "certificate")
        check_certificate(claim, image or case.image, case.schedule, "schedule.json")
    except (Refused, InputError) as error:
        return str(error) or "refused"
    return ""


def values(column: Data, count: int) -> np.ndarray:
    return np.cumsum(column["delta"]) if "delta" in column else np.full(count, column["all"])


def as_column(numbers: np.ndarray) -> Data:
    return {"delta": np.diff(np.concatenate([[0], numbers])).tolist()}


def flipped(case: Subject, rng: random.Random) -> tuple[str, Data, bool]:
    """One bit of one field of one state."""
    data = copy.deepcopy(case.data)
    name = rng.choice([*CELLS, *(name for name in NUMBERS if name in data["columns"])])
    row = rng.randrange(data["count"])
    bits = 17 if name in FREE else 16 if name in CELLS else NUMBERS[name][1].bit_length()
    numbers = values(data["columns"][name], data["count"]).copy()
    before = int(numbers[row])
    numbers[row] = before ^ 1 << rng.randrange(bits)
    data["columns"][name] = as_column(numbers)
    after = int(numbers[row])
    masked = name in CELLS and before & 0x100FF == after & 0x100FF
    return f"{name} of state {row}: {before:#x} -> {after:#x}", data, masked or idle(case, name, row)


def idle(case: Subject, name: str, row: int) -> bool:
    """Whether a field says nothing in a state."""
    field = {
        column: int(values(case.data["columns"][column], case.data["count"])[row])
        for column in ("tmr0", "option", "frame")
    }
    if name == "prescaler":
        return field["tmr0"] >> 8 == 0xFF or field["option"] & 0x08 != 0
    if name == "watchdog_age":
        return case.image.config is not None and case.image.config & 4 == 0
    return field["frame"] < 0 and name in ("place", "time")


def rearranged(case: Subject, rng: random.Random) -> tuple[str, Data, bool]:
    """A state dropped, duplicated, or swapped with another, or only a part of it."""
    data = copy.deepcopy(case.data)
    count = data["count"]
    kind = rng.choice(("drop", "duplicate", "swap", "swap a column"))
    first, second = rng.randrange(count), rng.randrange(count)
    order = list(range(count))
    if kind == "drop":
        del order[first]
    elif kind == "duplicate":
        order.insert(second, first)
    else:
        order[first], order[second] = second, first
    names = [rng.choice(list(data["columns"]))] if kind == "swap a column" else list(data["columns"])
    same = True
    for name in names:
        numbers = values(data["columns"][name], count)
        same &= kind == "swap a column" and numbers[first] == numbers[second]
        data["columns"][name] = as_column(numbers[order])
    data["count"] = len(order)
    unused = len(names) == 1 and idle(case, names[0], first) and idle(case, names[0], second)
    harmless = kind in ("duplicate", "swap") or same or unused
    return f"{kind} {first}, {second} {names[0]}", data, bool(harmless)


def relabelled(case: Subject, rng: random.Random) -> tuple[str, Data, bool]:
    """Another cut, another hash, another clock, other keys."""
    data = copy.deepcopy(case.data)
    kind = rng.choice(("cut", "no cut", "image", "schedule", "clock_hz", "format", "count", "key"))
    if kind == "cut":
        data["cuts"][rng.randrange(len(data["cuts"]))] ^= 1 << rng.randrange(10)
    elif kind == "no cut":
        del data["cuts"][rng.randrange(len(data["cuts"]))]
    elif kind in ("image", "schedule"):
        digit = rng.randrange(64)
        data[kind] = data[kind][:digit] + rng.choice("0123456789abcdef"[:15] + "x") + data[kind][digit + 1 :]
        if data[kind] == case.data[kind]:
            data[kind] = data[kind][:-1]
    elif kind == "key":
        del data[rng.choice([key for key in data if key != "assumptions"])]
    else:
        data[kind] += rng.choice((-1, 1))
    return kind, data, False


def certificate_mutants(case: Subject, rng: random.Random) -> Iterator[tuple[str, Data, bool]]:
    """Endless: what was changed, the certificate, and whether it may still be accepted."""
    while True:
        kind = rng.choices((flipped, rearranged, relabelled), (6, 3, 1))[0]
        yield kind(case, rng)


def program_mutants(case: Subject, rng: random.Random) -> Iterator[tuple[str, Image, Data]]:
    """Endless: one bit of one word of the program changed, the hash corrected."""
    while True:
        address = rng.choice(list(case.image.program))
        word = case.image.program[address] ^ 1 << rng.randrange(14)
        image = replace(case.image, program={**case.image.program, address: word})
        data = {**case.data, "image": fingerprint(image)}
        yield f"0x{address:03X}: {case.image.program[address]:04X} -> {word:04X}", image, data


def run(case: Subject, count: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Counts of mutants refused, equivalent and accepted, and the last ones."""
    rng = random.Random(seed)
    counts: Counter[str] = Counter()
    accepted: list[str] = []
    for _, (what, data, harmless) in zip(range(count), certificate_mutants(case, rng), strict=False):
        reason = verdict(case, data)
        outcome = "refused" if reason else "equivalent" if harmless else "accepted"
        counts[outcome] += 1
        if outcome == "accepted":
            accepted.append(what)
    return counts, accepted


def run_programs(case: Subject, count: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Counts of programs refused, equivalent and accepted; equal decoded words are equivalent."""
    rng = random.Random(seed)
    counts: Counter[str] = Counter()
    accepted: list[str] = []
    for _, (what, image, data) in zip(range(count), program_mutants(case, rng), strict=False):
        reason = verdict(case, data, image)
        outcome = "refused" if reason else "equivalent" if same(case, image, rng) else "accepted"
        counts[outcome] += 1
        if outcome == "accepted":
            accepted.append(what)
    return counts, accepted


def same(case: Subject, image: Image, rng: random.Random) -> bool:
    """Whether two programs mean the same to the decoder, or make the same edges whatever was pressed."""
    changed = [a for a in image.program if image.program[a] != case.image.program[a]]
    meanings = [[decode(each.program[a]) for a in changed] for each in (image, case.image)]
    if meanings[0] == meanings[1]:
        return True
    return all(edges(image, seed) == edges(case.image, seed) for seed in rng.sample(range(1000), 10))


def edges(image: Image, seed: int, cycles: int = 200_000) -> list[list[int]]:
    """The edges of the simulator under random levels at every input."""
    rng = random.Random(seed)
    times = [[rng.randrange(cycles) for _ in range(rng.choice((0, 2, 200)))] for _ in range(13)]
    levels = [Levels(pin, [(at, rng.randrange(2)) for at in sorted(each)]) for pin, each in enumerate(times)]
    found = Machine(image, Clock(4_000_000), stimulus=Stimuli(levels)).run(cycles)
    return [found.cycle.tolist(), found.pin.tolist(), found.level.tolist()]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--certificate", type=Path)
    parser.add_argument("--program", type=Path)
    parser.add_argument("--against", type=Path)
    wanted = parser.parse_args()
    case = subject()
    if wanted.certificate:
        image = from_hex(wanted.program.read_text())
        case = Subject(image, wanted.against.read_bytes(), certify.unpack(wanted.certificate.read_bytes()))
    assert verdict(case, case.data) == "", verdict(case, case.data)
    counts, accepted = run(case, wanted.count, wanted.seed)
    print("certificates:", dict(counts), *accepted, sep="\n  ")
    programs, kept = run_programs(case, wanted.count, wanted.seed)
    print("programs, hash corrected:", dict(programs), *kept, sep="\n  ")
    return int(bool(accepted or kept))


if __name__ == "__main__":
    sys.exit(main())
