"""Wrong programs with forged certificates: the checker must refuse all of them.

    python -m tests.prove.checker_attack --count 500 --seed 1

One word of a program of `attack_programs` is changed. If a plain run under random levels, start values and
times is not the schedule's, the program has no certificate; yet it gets those of the right program and of
other right mutants, with its own digest and with states dropped, repeated, reordered, made wider or narrower,
taken from two certificates, or none, and with other cuts; and all the states that the checker itself comes
to. Exit code 1 if the checker accepts one.
"""

from __future__ import annotations

import argparse
import copy
import random
import sys
import time
from collections import Counter
from dataclasses import replace
from itertools import islice

import numpy as np

from servogen.checker import Refused
from servogen.checker.certificate import CELLS, WRITE_LEFT, fingerprint
from servogen.engines.board import board_of
from servogen.prove import certificate, prove_for_all
from tests.checker import certify
from tests.prove import attack
from tests.prove.attack_programs import TRIMMED, programs
from tests.prove.certificate_mutants import Data, Subject, as_column, flipped, values, verdict

ENVIRONMENTS, FORGED, RIGHT = 6, 3, 8
"""In which a mutant runs; certificates of a wrong one; mutants that may be right, and lend their states."""
MAX_STATES = 200
"""Of a mutant that is to be proven."""


def certified(case: attack.Target, image: attack.Image, max_states: int) -> Data | None:
    """Return the certificate of a program as data; None if it is not proven."""
    proof = prove_for_all(image, case.schedule, options=board_of(case.schedule), max_states=max_states)
    if not proof.proven:
        return None
    return certify.unpack(certificate(proof, image, case.schedule, case.text))


def chosen(data: Data, rows: list[int]) -> Data:
    """Return a certificate of some of its states, in this order."""
    columns = {
        name: as_column(values(column, data["count"])[rows]) for name, column in data["columns"].items()
    }
    return data | {"columns": columns, "count": len(rows)}


def rearranged(data: Data, rng: random.Random) -> Data:
    """Some states dropped, repeated, in another order."""
    rows = list(range(data["count"]))
    return chosen(data, rng.choices(rows, k=rng.randrange(2 * len(rows))) if rows else rows)


def widened(data: Data, rng: random.Random) -> Data:
    """Bits of one field unknown in all states, or known in them."""
    name = rng.choice([name for name, (_, may) in CELLS.items() if may])
    numbers, may = values(data["columns"][name], data["count"]).copy(), CELLS[name][1]
    if rng.random() < 0.7:
        unknown = may & rng.choice((0xFF, rng.randrange(256)))
        numbers = numbers & ~(1 << 16) & ~unknown | (numbers >> 16 & 1) * 0xFF00 & may << 8 | unknown << 8
        numbers &= ~(numbers >> 8 & 0xFF)
    else:
        numbers = np.where(numbers >> 16, numbers, numbers & 0xFF)
    return data | {"columns": data["columns"] | {name: as_column(numbers)}}


def spliced(data: Data, other: Data, rng: random.Random) -> Data:
    """States of two certificates."""
    names = data["columns"].keys() | other["columns"].keys()
    shift, columns = len(data["places"]), {}
    for name in names:
        one, two = (values(each["columns"].get(name, {"all": 0}), each["count"]) for each in (data, other))
        columns[name] = as_column(np.concatenate([one, two + shift * (name == "place")]))
    cuts = rng.choice((data["cuts"], other["cuts"], sorted({*data["cuts"], *other["cuts"]})))
    count = data["count"] + other["count"]
    places = data["places"] + other["places"]
    return data | {"columns": columns, "count": count, "places": places, "cuts": cuts}


def cut(data: Data, rng: random.Random, addresses: list[int]) -> Data:
    """Other cuts: none, all, one more, one less."""
    cuts = data["cuts"]
    kinds = ([], addresses, [*cuts, rng.choice(addresses)], [each for each in cuts if rng.random() < 0.5])
    return data | {"cuts": rng.choice(kinds)}


def forged(case: Subject, lent: list[Data], rng: random.Random) -> tuple[str, Data]:
    """Return a certificate for a wrong program, and how it was made."""
    data, said = copy.deepcopy(rng.choice(lent)), []
    for _ in range(rng.choice((0, 1, 1, 2))):
        kind = rng.choice(("rearranged", "widened", "spliced", "cut", "no states", "one bit"))
        said.append(kind)
        if kind == "one bit" and data["count"]:
            data = flipped(replace(case, data=data), rng)[1]
        elif kind == "no states":
            data = chosen(data, [])
        elif kind == "spliced":
            data = spliced(data, rng.choice(lent), rng)
        elif kind == "cut":
            data = cut(data, rng, list(case.image.program))
        elif data["count"]:
            data = rearranged(data, rng) if kind == "rearranged" else widened(data, rng)
    if WRITE_LEFT in data["columns"] and not data["count"]:
        del data["columns"][WRITE_LEFT]
    return ", ".join(said) or "as it is", data


def own(case: Subject) -> str:
    """Return why a program has no certificate of all states that the checker comes to; "" if it has one."""
    try:
        certify.certify(case.image, case.schedule, case.data["cuts"])
    except Refused as refused:
        return str(refused)
    return ""


def is_wrong(case: attack.Target, image: attack.Image, rng: random.Random) -> bool:
    """Return whether a plain run is not the schedule's, although pulses come."""
    if not attack.observed(case, image, attack.as_verified(case), 3):
        return False
    runs = [attack.as_verified(case), *(attack.random_environment(case, rng) for _ in range(ENVIRONMENTS))]
    return any(not attack.is_right(case, image, around) for around in runs)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    names = [name for name in programs() if name != TRIMMED]
    parser.add_argument("--jobs", nargs="*", choices=names, default=names)
    wanted = parser.parse_args()
    began, counts, accepted = time.process_time(), Counter[str](), list[str]()
    for number, name in enumerate(wanted.jobs):
        case, rng = attack.target(name), random.Random(f"{wanted.seed} {name}")
        near = (image for _, image in islice(attack.mutants(case, rng), RIGHT))
        made = [case.image, *(image for image in near if not is_wrong(case, image, rng))]
        limits = [20_000, *[MAX_STATES] * RIGHT]
        tried = (certified(case, image, limit) for image, limit in zip(made, limits, strict=False))
        lent = [data for data in tried if data is not None]
        assert verdict(Subject(case.image, case.text, lent[0]), lent[0]) == "", name
        for what, image in attack.mutants(case, rng):
            if counts["forged"] >= wanted.count * (number + 1) // len(wanted.jobs):
                break
            if not is_wrong(case, image, rng):
                continue
            counts["wrong programs"] += 1
            subject = Subject(image, case.text, lent[0])
            for turn in range(FORGED + 1):
                how, data = forged(subject, lent, rng)
                if turn == 0:
                    how, reason = "its own states", own(subject)
                else:
                    reason = verdict(subject, data | {"image": fingerprint(image)})
                counts["forged"] += 1
                outside = "the checker does not cover" in reason
                counts["accepted" if not reason else "not covered" if outside else "refused"] += 1
                if not reason:
                    accepted.append(f"{name}, {what}: {how}")
        print(f"{name}: {len(lent)} certificates, {dict(counts)}", flush=True)
    print(*accepted, f"{time.process_time() - began:.0f} s", sep="\n")
    return int(bool(accepted))


if __name__ == "__main__":
    sys.exit(main())
