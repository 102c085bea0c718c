"""The minimum and maximum execution time of each function, with a name for whatever has no bound.

In: the words of a program, and the functions that they come from. Out: `FunctionTimes` by name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from servogen.compiler.emit.layout import CodeLayout
from servogen.compiler.ir.function import Function
from servogen.errors import Location
from servogen.pic.device import INTERRUPT_VECTOR, STACK_LEVELS
from servogen.pic.listing import ListedFunction
from servogen.pic.wcet import TimedProgram, Unbounded


@dataclass(frozen=True, slots=True)
class FunctionTimes:
    """Execution times in cycles; `shortest` is None if the function never returns, `longest` if `unbounded`
    gives the reason.
    """

    shortest: int | None
    longest: int | None
    unbounded: tuple[str, ...] = ()


def function_times(
    layout: CodeLayout, functions: Mapping[str, Function], *, main: Iterable[str], interrupt: Iterable[str]
) -> dict[str, FunctionTimes]:
    """Return the times of the functions that `main` and the `interrupt` reach.

    Values that the interrupt changes are unknown in main; main changes nothing while the interrupt runs.
    """
    words = {word.address: word.value for word in layout.words}
    listed = [ListedFunction(name, start, end) for name, (start, end) in layout.starts.items() if end > start]
    bounds = {
        layout.labels[label]: bound
        for function in functions.values()
        for label, bound in function.bounds.items()
    }
    places = {word.address: word.ins.place for word in layout.words}
    in_interrupt = set(interrupt)
    addresses = {word.ins: word.address for word in layout.words}
    pieces = [
        (addresses[first], addresses[last] + 1)
        for function in functions.values()
        for first, last in function.delays
    ]
    of_interrupt = TimedProgram(words, listed, bounds=bounds, pieces=pieces)
    changing = of_interrupt.changes(INTERRUPT_VECTOR) if in_interrupt else frozenset[int]()
    of_main = TimedProgram(words, listed, changing=changing, bounds=bounds, pieces=pieces)
    reached = set(main) | in_interrupt
    times_by_name: dict[str, FunctionTimes] = {}
    # every function once, which notes the arguments with which the library's routines are called
    for routine in listed:
        if routine.name in reached:
            (of_interrupt if routine.name in in_interrupt else of_main).times(routine.start)
    names = {start: name for name, (start, _) in layout.starts.items()}
    for routine in listed:
        if routine.name in reached:
            program = of_interrupt if routine.name in in_interrupt else of_main
            library = routine.name.startswith("__")
            times = program.times_with_arguments(routine.start) if library else program.times(routine.start)
            why = [
                _name(reason, functions[routine.name], places, names, program) for reason in times.unbounded
            ] or (["stands still at its end"] if times.longest is None else [])
            times_by_name[routine.name] = FunctionTimes(
                times.shortest, times.longest, tuple(dict.fromkeys(why))
            )
    return times_by_name


def _name(
    reason: Unbounded,
    function: Function,
    places: Mapping[int, Location | None],
    names: Mapping[int, str],
    program: TimedProgram,
) -> str:
    """Return a name in terms of the source for what has no bound: "while at line 12"."""
    address = reason.addresses[0]
    match reason.kind:
        case "call":
            return _at_line(
                f"call of {names.get(program.word(address).k, 'a subroutine')}", places.get(address)
            )
        case "stack":
            return _at_line(f"more than {STACK_LEVELS} calls in each other", places.get(address))
        case "loop":
            return _loop(function, reason.addresses, places)
        case "too many states":
            return f"{_loop(function, reason.addresses, places)}, too long to be counted"
    return _at_line("SLEEP" if reason.kind == "sleep" else "a computed jump", places.get(address))


def _at_line(description: str, place: Location | None) -> str:
    return f"{description} at line {place.line}" if place is not None and place.line else description


def _loop(function: Function, addresses: Iterable[int], places: Mapping[int, Location | None]) -> str:
    """Return the source loop that contains these words."""
    if function.waits_for:
        return f"waits for {function.waits_for}"
    all_places = [places.get(address) for address in addresses]
    inside = [(place.line, place.column or 0) for place in all_places if place is not None and place.line]
    if not inside:
        return "a loop"
    around = [loop for loop in function.loops if loop.first <= min(inside) and max(inside) <= loop.last]
    if not around:
        return f"loop at line {min(inside)[0]}"
    inner = max(around, key=lambda loop: loop.first)
    return f"{inner.kind} at line {inner.first[0]}"
