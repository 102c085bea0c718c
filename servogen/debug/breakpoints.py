"""What stops a running program: a source line, an edge, a condition on a variable.

In: text as a person types it, and the program's listing. Out: `Breakpoint`s; `run_to` runs a `TimeMachine` to
the first of them.

    line 12 · main.c:12 · 0x01F     before the line's first instruction, or the one at that address
    show()                          before the first instruction of a function, or after a label
    RB0 · RB0 rise · RB0 fall       after an edge of the pin (`RB0 changes` is `RB0`)
    width > 1500 · 0x20 == 3        after an instruction that makes it true of a variable or a byte of RAM
    width changes                   after an instruction that gives a variable or a byte of RAM another value
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from servogen.debug.symbols import Variable, routine, variable
from servogen.debug.time_machine import TimeMachine
from servogen.edges import HIGH, LOW, PINS, EdgeChunk, join, part
from servogen.errors import InputError, check_known
from servogen.pic.device import PROGRAM_WORDS
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.pic.listing import Listing

INDIRECT = 0
"""The address through which an instruction reaches the byte that FSR points to."""

COMPARISONS: Mapping[str, Callable[[int, int], bool]] = MappingProxyType(
    {
        "==": operator.eq,
        "!=": operator.ne,
        "<=": operator.le,
        ">=": operator.ge,
        "<": operator.lt,
        ">": operator.gt,
    }
)


@dataclass(frozen=True, slots=True)
class AtAddress:
    """Stops before the instructions at these addresses."""

    text: str
    addresses: frozenset[int]


@dataclass(frozen=True, slots=True)
class AtEdge:
    """Stops after an edge of a pin; `level` None: of either direction."""

    text: str
    pin: int
    level: int | None


@dataclass(frozen=True, slots=True)
class AtCondition:
    """Stops after an instruction that makes a comparison of bytes of RAM, the lowest first, come true."""

    text: str
    variable: Variable
    comparison: str
    value: int

    def holds(self, machine: TimeMachine) -> bool:
        return COMPARISONS[self.comparison](self.variable.number(machine.machine.ram), self.value)

    def stops(self, before: int, now: int) -> bool:
        """Return whether it is true of a value `now`, and was not of the one before."""
        compare = COMPARISONS[self.comparison]
        return compare(now, self.value) and not compare(before, self.value)


@dataclass(frozen=True, slots=True)
class AtChange:
    """Stops after an instruction that changes bytes of RAM."""

    text: str
    variable: Variable

    def stops(self, before: int, now: int) -> bool:
        return before != now


Breakpoint = AtAddress | AtEdge | AtCondition | AtChange

_LINE = re.compile(r"(?:line\s+|(?P<file>\S+):)(?P<line>\d{1,6})")
_ADDRESS = re.compile(r"0x(?P<address>[0-9a-f]{1,4})", re.IGNORECASE)
_ROUTINE = re.compile(r"(?P<name>[A-Za-z_]\w{0,60})\s*\(\s*\)")
_EDGE = re.compile(r"(?P<pin>R[AB]\d)(?:\s+(?P<way>rise|fall|changes))?", re.IGNORECASE)
_CONDITION = re.compile(
    r"(?P<name>[A-Za-z_][\w.]{0,60}|0x[0-9A-Fa-f]{1,2})\s*(?P<comparison>==|!=|<=|>=|<|>)\s*(?P<value>0x[0-9A-Fa-f]{1,8}|\d{1,9})"
)
_CHANGE = re.compile(r"(?P<name>[A-Za-z_][\w.]{0,60}|0x[0-9A-Fa-f]{1,2})\s+changes")


def parse_breakpoint(text: str, listing: Listing | None) -> Breakpoint:
    """Return the breakpoint that a text describes. Raises InputError."""
    text = text.strip()
    if match := _LINE.fullmatch(text):
        return _at_line(text, match["file"], int(match["line"]), listing)
    if match := _ADDRESS.fullmatch(text):
        address = int(match["address"], 16)
        if address >= PROGRAM_WORDS:
            raise InputError(
                "out-of-range", f"{text}: the program's addresses end at 0x{PROGRAM_WORDS - 1:03X}"
            )
        return AtAddress(text, frozenset((address,)))
    if match := _ROUTINE.fullmatch(text):
        return AtAddress(text, frozenset((routine(match["name"], listing),)))
    if match := _EDGE.fullmatch(text):
        pin = match["pin"].upper()
        check_known("unknown-pin", pin, PINS, f"there is no pin '{pin}'")
        direction = (match["way"] or "").lower()
        return AtEdge(text, PINS.index(pin), {"rise": HIGH, "fall": LOW}.get(direction))
    if match := _CONDITION.fullmatch(text):
        return AtCondition(
            text, variable(match["name"], listing), match["comparison"], int(match["value"], 0)
        )
    if match := _CHANGE.fullmatch(text):
        return AtChange(text, variable(match["name"], listing))
    raise InputError(
        "bad-breakpoint",
        f"'{text}' is not a breakpoint",
        hint="line 12, 0x01F, show(), RB0 rise, width changes, or a comparison such as width > 1500",
    )


def _at_line(text: str, file: str | None, line: int, listing: Listing | None) -> AtAddress:
    """Return where the code of a line begins, each time that it does: a loop's head may come twice."""
    rows = listing.rows if listing else ()
    first = set()
    before: tuple[str | None, int | None] = (None, None)
    for row in rows:
        mine = row.line == line and (file is None or (row.file or "").endswith(file))
        if mine and (row.file, row.line) != before:
            first.add(row.address)
        before = row.file, row.line
    if not first:
        raise InputError("bad-breakpoint", f"no instruction belongs to {text}")
    return AtAddress(text, frozenset(first))


def run_to(
    machine: TimeMachine,
    end: int,
    breakpoints: Sequence[Breakpoint],
    image: Image,
    produced: list[EdgeChunk] | None = None,
) -> list[Breakpoint]:
    """Run to the first moment that is not before `end`, or to a breakpoint; return all that stop there.

    The edges are appended to `produced`.
    """
    addresses = {
        address
        for breakpoint in breakpoints
        if isinstance(breakpoint, AtAddress)
        for address in breakpoint.addresses
    }
    edges = [breakpoint for breakpoint in breakpoints if isinstance(breakpoint, AtEdge)]
    conditions = [each for each in breakpoints if isinstance(each, AtCondition | AtChange)]
    writers = writing_addresses(conditions, image)

    def wanted(chunk: EdgeChunk) -> npt.NDArray[np.bool_]:
        marked = np.zeros(len(chunk.pin), dtype=bool)
        for breakpoint in edges:
            marked |= (chunk.pin == breakpoint.pin) & (
                (chunk.level == breakpoint.level) | (breakpoint.level is None)
            )
        return marked

    def met(made: EdgeChunk, changed: Sequence[Breakpoint] = ()) -> list[Breakpoint]:
        """Return what stops after an instruction: the wanted edges of `made` are its own."""
        here = None if machine.machine.asleep else machine.machine.pc
        last = [(pin, level) for _, pin, level in zip(*part(made, wanted(made)), strict=True)]
        return [
            each
            for each in breakpoints
            if each in changed
            or (isinstance(each, AtAddress) and here in each.addresses)
            or (isinstance(each, AtEdge) and any(_is_edge(each, *edge) for edge in last))
        ]

    while machine.now < end:
        # A condition can only become true, and a value only change, where something that it reads is written:
        # those instructions are executed one by one, all others at full speed.
        while machine.machine.pc in writers and not machine.machine.asleep and machine.now < end:
            values = [each.variable.number(machine.machine.ram) for each in conditions]
            chunk = _step(machine)
            if produced is not None:
                produced.append(chunk)
            changed = [
                each
                for each, before in zip(conditions, values, strict=True)
                if each.stops(before, each.variable.number(machine.machine.ram))
            ]
            if found := met(chunk, changed):
                return found
        if machine.now >= end:
            return []
        chunks: list[EdgeChunk] = []
        stop = machine.run(end, stops={*addresses, *writers}, wanted=wanted if edges else None, edges=chunks)
        if produced is not None:
            produced += chunks
        if stop is None:
            return []
        if found := met(join(chunks[-1:])):
            return found
    return []


def first_stop(breakpoints: Sequence[Breakpoint], chunk: EdgeChunk) -> tuple[int, Breakpoint] | None:
    """Return the cycle of the first edge of a recording at which a breakpoint stops, and that breakpoint."""
    edges = [breakpoint for breakpoint in breakpoints if isinstance(breakpoint, AtEdge)]
    for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True) if edges else ():
        for breakpoint in edges:
            if _is_edge(breakpoint, pin, level):
                return cycle, breakpoint
    return None


def _step(machine: TimeMachine) -> EdgeChunk:
    """Execute an instruction and return the edges that it makes."""
    begin, before = machine.now, machine.machine.edges_made
    machine.step(1)
    return join(()) if machine.machine.edges_made == before else machine.edges(begin, machine.now)


def _is_edge(breakpoint: AtEdge, pin: int, level: int) -> bool:
    return breakpoint.pin == pin and breakpoint.level in (None, level)


def writing_addresses(conditions: Sequence[AtCondition | AtChange], image: Image) -> frozenset[int]:
    """Return the addresses of the instructions that may write a byte of one of the conditions."""
    bytes_of = {
        condition.variable.address + offset
        for condition in conditions
        for offset in range(condition.variable.size)
    }
    if not bytes_of:
        return frozenset()
    reached = {*bytes_of, INDIRECT}
    return frozenset(address for address, word in image.program.items() if _written_address(word) in reached)


@cache  # of at most 2^14 words; a way back asks anew every few milliseconds of the chip
def _written_address(word: int) -> int | None:
    """Return the address of the file register that an instruction writes; None: it writes none."""
    decoded = decode(word)
    return decoded.f if decoded is not None and decoded.instruction.writes_file(decoded.d) else None
