"""Floating-point operations, each as a statement for the chip and as the reference computes it.

In: an operation and how many random operands. Out: a sentence for each result that differs.
`python -m tests.compiler.float_operations` runs any number of them.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain, islice, product

from tests.compiler.float_machine import FloatMachine
from tests.compiler.float_reference import (
    OPERATORS,
    RELATIONS,
    binary,
    canonical,
    edges,
    from_integer,
    operands,
    relation,
    rounded,
    square_root,
    to_integer,
)

Operands = dict[str, int]
Results = dict[str, int | None]


@dataclass(frozen=True)
class Operation:
    """A statement, the operands for it (edges first), and what it must leave in its variables."""

    name: str
    statement: str
    operands: Callable[[int, int], Iterator[Operands]]
    expected: Callable[[Operands, int], Results]


def _pairs(width: int, seed: int) -> Iterator[Operands]:
    for left, right in chain(product(edges(width), repeat=2), operands(width, seed)):
        yield {"x": left, "y": right}


def _single(width: int, seed: int) -> Iterator[Operands]:
    for value in chain(edges(width), (left for left, _ in operands(width, seed))):
        yield {"x": value}


def _arithmetic(op: str) -> Operation:
    return Operation(
        op, f"z = x {op} y;", _pairs, lambda given, width: {"z": binary(op, given["x"], given["y"], width)}
    )


def _relation(op: str) -> Operation:
    return Operation(
        op, f"c = x {op} y;", _pairs, lambda given, width: {"c": relation(op, given["x"], given["y"], width)}
    )


def _all_integers(given: Operands, width: int) -> Results:
    value = to_integer(given["x"], width)
    return {
        "u": value,
        "i": value,
        "s": value & 0xFFFFFF,
        "h": value & 0xFFFF,
        "b": value & 0xFF,
        "c": value & 0xFF,
    }


def _absolute(given: Operands, width: int) -> Results:
    return {"z": canonical(given["x"] & (1 << width - 1) - 1, width)}


def _negated(given: Operands, width: int) -> Results:
    return {"z": canonical(given["x"] ^ 1 << width - 1, width)}


def _rounded(function: str) -> Operation:
    return Operation(
        function,
        f"z = {function}(x);",
        _single,
        lambda given, width: {"z": rounded(function, given["x"], width)},
    )


def _from(name: str, variable: str, bits: int, *, signed: bool) -> Operation:
    def integers(width: int, seed: int) -> Iterator[Operands]:
        chance = random.Random(seed)
        top = 1 << bits - 1
        ends = [0, 1, top - 1, top, top + 1, 2 * top - 1]
        while True:
            short = chance.getrandbits(chance.randrange(1, bits + 1))
            yield {variable: ends.pop(0) if ends else chance.choice((short, 2 * top - 1 - short))}

    def expected(given: Operands, width: int) -> Results:
        value = given[variable]
        return {"z": from_integer(value - (1 << bits) if signed and value >> bits - 1 else value, width)}

    source = variable if name == variable else f"({name}){variable}"
    return Operation(f"from {name}", f"z = {source};", integers, expected)


OPERATIONS = (
    *map(_arithmetic, OPERATORS),
    *map(_relation, RELATIONS),
    Operation("to integers", "u = x; i = x; s = x; h = x; b = x; c = x;", _single, _all_integers),
    Operation("fabs", "z = fabs(x);", _single, _absolute),
    Operation("negation", "z = -x;", _single, _negated),
    Operation("sqrt", "z = sqrt(x);", _single, lambda given, width: {"z": square_root(given["x"], width)}),
    *map(_rounded, ("floor", "ceil")),
    _from("i", "i", 32, signed=True),
    _from("u", "u", 32, signed=False),
    _from("s", "s", 24, signed=True),
    _from("unsigned short long", "s", 24, signed=False),
    _from("h", "h", 16, signed=True),
    _from("uint16_t", "h", 16, signed=False),
    _from("b", "b", 8, signed=True),
    _from("c", "c", 8, signed=False),
)


def mistakes(operation: Operation, width: int, count: int, seed: int) -> Iterator[str]:
    """Yield what differs for all pairs of edges and for `count` other operands."""
    machine = FloatMachine(operation.statement, width)
    edge_count = {_pairs: len(edges(width)) ** 2, _single: len(edges(width))}.get(operation.operands, 6)
    for given in islice(operation.operands(width, seed), edge_count + count):
        machine(**given)
        expected = operation.expected(given, width)
        found = {name: canonical(machine[name], width) if name == "z" else machine[name] for name in expected}
        if found != expected:
            shown = {name: f"0x{value:X}" for name, value in given.items()}
            yield f"{operation.name}, {width} bits: {shown} gave {found}, not {expected}"


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.compiler.float_operations",
        description="Floating-point operations on the simulated chip against IEEE 754.",
    )
    parser.add_argument(
        "--count", type=int, default=20_000, help="random operands of each operation and size"
    )
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    failures = 0
    for width in (24, 32):
        for operation in OPERATIONS:
            started = time.monotonic()
            found = list(mistakes(operation, width, arguments.count, arguments.seed))
            failures += len(found)
            print(*found[:5], sep="\n", end="\n" if found else "")
            seconds = time.monotonic() - started
            print(f"{width} bits, {operation.name}: {len(found)} wrong, {seconds:.0f} s", flush=True)
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
