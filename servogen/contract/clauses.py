"""A contract's TOML file: what each clause may say, and the observers that it becomes for a clock.

In: the file. Out: a `Contract` of `Clause`s, each with its place in the file; `observers(clock)` turns times
in microseconds into whole cycles. A range in µs holds the whole cycles within it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import ceil, floor
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import Field, WithJsonSchema

from servogen.contract.events import PinEvent, condition, event
from servogen.contract.observers import (
    CountObserver,
    EveryObserver,
    Limits,
    NeverObserver,
    Observer,
    OrderObserver,
    PulseObserver,
    ResponseObserver,
    SerialObserver,
)
from servogen.edges import HIGH, LOW, PINS
from servogen.errors import InputError, Location
from servogen.toml.file import Document, Table, exact, parse, read, validate
from servogen.toml.locations import Key
from servogen.units import Clock

MAX_US = 10**10
"""The longest time that a clause may state: nearly three hours."""
MAX_EVENTS = 64
MAX_TIMES = 1000
"""The most events that a window counts."""
MIN_BIT_CYCLES = 4
"""The shortest bit of a serial line: a level cannot be written, and written back, in fewer."""

Number = int | float


def _range_schema(low: float, high: float, *, above: bool = False) -> WithJsonSchema:
    """Return a range as the schema has it; pydantic leaves out those of numbers of two types."""
    return WithJsonSchema(
        {"type": "number", "exclusiveMinimum" if above else "minimum": low, "maximum": high}
    )


Time = Annotated[Number, Field(ge=0, le=MAX_US), _range_schema(0, MAX_US)]
Percent = Annotated[Number, Field(ge=0, le=100), _range_schema(0, 100)]
Range = Annotated[tuple[Time, ...], Field(min_length=1, max_length=2)]
"""The least and the most; or the least alone."""


class PulseTable(Table):
    """Every whole pulse of a pin."""

    pin: str
    high_us: Range | None = None
    low_us: Range | None = None
    period_us: Range | None = None
    duty_percent: tuple[Percent, Percent] | None = None


class ResponseTable(Table):
    """What must follow an event, or several that come one after the other."""

    when: str | Annotated[tuple[str, ...], Field(min_length=1, max_length=MAX_EVENTS)]
    then: str
    within_us: Range
    held_us: Time = 0


class NeverTable(Table):
    """Levels that pins never have at once for longer than a time."""

    condition: str
    longer_us: Time = 0


class SerialTable(Table):
    """A serial line on which the program sends bytes of 8 bits without parity."""

    pin: str
    baud: Annotated[Number, Field(gt=0, le=10_000_000), _range_schema(0, 10_000_000, above=True)]
    tolerance_percent: Annotated[Number, Field(ge=0, le=5), _range_schema(0, 5)] = 2
    idle: Literal["high", "low"] = "high"
    stop_bits: Annotated[int, Field(ge=1, le=2)] = 1


class OrderTable(Table):
    """Events that come in turn, again and again."""

    events: Annotated[tuple[str, ...], Field(min_length=2, max_length=MAX_EVENTS)]


class CountTable(Table):
    """How often an event comes in every window of a time."""

    event: str
    times: tuple[Annotated[int, Field(ge=0, le=MAX_TIMES)], Annotated[int, Field(ge=0, le=MAX_TIMES)]]
    window_us: Annotated[Number, Field(gt=0, le=MAX_US), _range_schema(0, MAX_US, above=True)]


class EveryTable(Table):
    """When an event comes first after a reset, and then again and again."""

    event: str
    first_us: Range | None = None
    gap_us: Range | None = None


class ContractFile(Table):
    """A contract."""

    clock_hz: Annotated[int, Field(ge=1, le=100_000_000)] | None = None
    pulse: tuple[PulseTable, ...] = ()
    response: tuple[ResponseTable, ...] = ()
    never: tuple[NeverTable, ...] = ()
    serial: tuple[SerialTable, ...] = ()
    order: tuple[OrderTable, ...] = ()
    count: tuple[CountTable, ...] = ()
    every: tuple[EveryTable, ...] = ()


KINDS = ("pulse", "response", "never", "serial", "order", "count", "every")


T = TypeVar("T")
Made = tuple[Observer, str, str]
"""An observer, what its clause says in a line, and what is counted."""


@dataclass(frozen=True, slots=True)
class Clause:
    """One clause: what it says in a line, where it stands, and what watches it."""

    observer: Observer
    text: str
    counted: str
    """What is counted as seen: "pulse", "cause"."""
    place: Location

    @property
    def always(self) -> bool:
        """Return whether it is about a level that a pin has all the time: every run from reset shows it."""
        observer = self.observer
        return isinstance(observer, NeverObserver) and not observer.longer and observer.pins.bit_count() == 1


@dataclass(frozen=True, slots=True)
class Contract:
    """The clauses of a file, in its order."""

    document: Document
    tables: ContractFile

    @property
    def clock_hz(self) -> int | None:
        return self.tables.clock_hz

    def clauses(self, clock: Clock) -> tuple[Clause, ...]:
        """Return the clauses for a chip with that clock. Raises InputError with the place of a wrong one."""
        made = _Reader(self.document, clock).clauses(self.tables)
        return tuple(sorted(made, key=lambda clause: clause.place.line or 0))


def load_contract(path: str | Path) -> Contract:
    """Return the contract in a file. Raises InputError with the place in the file."""
    return _contract(read(path))


def parse_contract(text: str, file: str) -> Contract:
    """Return the contract in a file's text."""
    return _contract(parse(text, file))


def _contract(document: Document) -> Contract:
    tables = validate(document, ContractFile)
    if not any(getattr(tables, kind) for kind in KINDS):
        raise InputError(
            "empty-contract",
            "says nothing",
            Location(document.file),
            f"write one of: {', '.join(f'[[{kind}]]' for kind in KINDS)}",
        )
    contract = Contract(document, tables)
    contract.clauses(Clock(tables.clock_hz or 4_000_000))  # what is wrong in the file is told when it is read
    return contract


class _Reader:
    def __init__(self, document: Document, clock: Clock) -> None:
        self._document = document
        self._clock = clock

    def clauses(self, tables: ContractFile) -> Iterator[Clause]:
        yield from self._clauses("pulse", tables.pulse, self._pulse)
        yield from self._clauses("response", tables.response, self._response)
        yield from self._clauses("never", tables.never, self._never)
        yield from self._clauses("serial", tables.serial, self._serial)
        yield from self._clauses("order", tables.order, self._order)
        yield from self._clauses("count", tables.count, self._count)
        yield from self._clauses("every", tables.every, self._every)

    def _clauses(self, kind: str, tables: Sequence[T], made: Callable[[T, Key], Made]) -> Iterator[Clause]:
        for number, table in enumerate(tables):
            key = (kind, number)
            yield Clause(*made(table, key), self._document.place(*key))

    def _pulse(self, table: PulseTable, key: Key) -> Made:
        given = {name: getattr(table, f"{name}_us") for name in ("high", "low", "period")}
        if table.duty_percent is not None and table.period_us is None:
            raise self._error(key, "duty_percent", "needs period_us, which says how long a period may be")
        if not any(given.values()):
            raise self._error(key, "pin", "the pulse says nothing", "add high_us, low_us or period_us")
        limits = {
            name: None if value is None else self._cycles(value, (*key, f"{name}_us"))
            for name, value in given.items()
        }
        duty = self._least_and_most(table.duty_percent, (*key, "duty_percent"))
        part = None if duty is None else (exact(duty[0]) / 100, exact(duty[1]) / 100)
        pin = self._pin(table.pin, (*key, "pin"))
        said = [f"{name} {_range(value)} µs" for name, value in given.items() if value is not None]
        said += [] if duty is None else [f"duty {_range(duty)} %"]
        observer = PulseObserver(pin, limits["high"], limits["low"], limits["period"], part)
        return observer, f"pulse of {table.pin}: {', '.join(said)}", "pulse"

    def _response(self, table: ResponseTable, key: Key) -> Made:
        causes = (table.when,) if isinstance(table.when, str) else table.when
        when = [self._event(each, (*key, "when")) for each in causes]
        then = self._event(table.then, (*key, "then"))
        held = ceil(exact(table.held_us) / self._clock.cycle_us)
        observer = ResponseObserver(
            tuple(when), then, self._cycles(table.within_us, (*key, "within_us")), held
        )
        lasting = f" for {_number(table.held_us)} µs" if table.held_us else ""
        text = f"response: {', '.join(map(str, when))}{lasting} → {then} within {_range(table.within_us)} µs"
        return observer, text, "cause"

    def _never(self, table: NeverTable, key: Key) -> Made:
        try:
            levels = condition(table.condition)
        except ValueError as error:
            raise self._error(key, "condition", str(error)) from None
        longer = floor(exact(table.longer_us) / self._clock.cycle_us)
        text = f"never: {levels}" + (
            f" for longer than {_number(table.longer_us)} µs" if table.longer_us else ""
        )
        return NeverObserver(levels, longer), text, "level" if levels.pins.bit_count() == 1 else "change"

    def _serial(self, table: SerialTable, key: Key) -> Made:
        bit = self._clock.cycles_per_second / exact(table.baud)
        if bit < MIN_BIT_CYCLES:
            rate = float(self._clock.cycles_per_second / MIN_BIT_CYCLES)
            message = f"a bit is {float(bit):.3g} cycles long at {self._clock.hz / 1e6:g} MHz"
            raise self._error(key, "baud", message, f"at most {rate:g} baud")
        observer = SerialObserver(
            self._pin(table.pin, (*key, "pin")),
            bit,
            exact(table.tolerance_percent) / 100,
            HIGH if table.idle == "high" else LOW,
            table.stop_bits,
        )
        return (
            observer,
            f"serial line {table.pin}: {_number(table.baud)} baud ± {_number(table.tolerance_percent)} %",
            "byte",
        )

    def _order(self, table: OrderTable, key: Key) -> Made:
        events = tuple(self._event(each, (*key, "events")) for each in table.events)
        for number, each in enumerate(events):
            if events[number - 1] == each:
                raise self._error(key, "events", f"'{each}' stands twice in turn, and no other event between")
        return OrderObserver(events), f"order: {', '.join(map(str, events))}", "event"

    def _count(self, table: CountTable, key: Key) -> Made:
        least, most = self._least_and_most(table.times, (*key, "times")) or (0, 0)
        window = floor(exact(table.window_us) / self._clock.cycle_us)
        if not window:
            raise self._error(key, "window_us", "is shorter than an instruction cycle")
        what = self._event(table.event, (*key, "event"))
        text = f"count: {what} {_range(table.times)} times in {_number(table.window_us)} µs"
        return CountObserver(what, Limits(int(least), int(most)), window), text, "event"

    def _every(self, table: EveryTable, key: Key) -> Made:
        what = self._event(table.event, (*key, "event"))
        if table.first_us is None and table.gap_us is None:
            raise self._error(key, "event", "nothing is said of when it comes", "add first_us or gap_us")
        first = None if table.first_us is None else self._cycles(table.first_us, (*key, "first_us"))
        gap = None if table.gap_us is None else self._cycles(table.gap_us, (*key, "gap_us"))
        said = [] if table.first_us is None else [f"first {_range(table.first_us)} µs after reset"]
        said += [] if table.gap_us is None else [f"then every {_range(table.gap_us)} µs"]
        return EveryObserver(what, first, gap), f"every: {what} {', '.join(said)}", "event"

    def _pin(self, name: str, key: Key) -> int:
        self._document.check_known("unknown-pin", key, name, PINS, f"there is no pin '{name}'")
        return PINS.index(name)

    def _event(self, text: str, key: Key) -> PinEvent:
        try:
            return event(text)
        except ValueError as error:
            raise self._document.error("bad-contract", key, str(error)) from None

    def _least_and_most(self, given: Sequence[Number] | None, key: Key) -> tuple[Number, Number] | None:
        if given is None:
            return None
        least, most = given
        if least > most:
            raise self._document.error(
                "bad-contract", key, f"{_number(least)} is more than {_number(most)}", "[least, most]"
            )
        return least, most

    def _cycles(self, given: Range, key: Key) -> Limits:
        """Return the whole cycles within a range of microseconds."""
        if len(given) == 1:
            return Limits(ceil(exact(given[0]) / self._clock.cycle_us))
        self._least_and_most(given, key)
        least, most = (exact(us) / self._clock.cycle_us for us in given)
        if ceil(least) > floor(most):
            cycle = float(self._clock.cycle_us)
            raise self._document.error(
                "bad-contract",
                key,
                f"no whole number of cycles of {cycle:g} µs lies in {_range(given)} µs",
                "make the range wider",
            )
        return Limits(ceil(least), floor(most))

    def _error(self, key: Key, name: str, message: str, hint: str | None = None) -> InputError:
        return self._document.error("bad-contract", (*key, name), message, hint)


def _number(value: Number) -> str:
    return str(int(value)) if value == int(value) else str(value)


def _range(given: Sequence[Number]) -> str:
    if len(given) == 1:
        return f"at least {_number(given[0])}"
    least, most = given
    return f"{_number(least)}" if least == most else f"{_number(least)} to {_number(most)}"
