"""Breakpoints with conditions, counts and messages, and the way back to the last one.

In: what an editor asks for and what stops the chip. Out: the breakpoint at which it stands.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from servogen.debug.breakpoints import AtCondition, Breakpoint, parse_breakpoint, run_to
from servogen.debug.symbols import variable
from servogen.debug.time_machine import TimeMachine
from servogen.edges import PINS, EdgeChunk
from servogen.errors import InputError
from servogen.inputs import count_in
from servogen.pic.listing import Listing

FIRST_BACK_S = 0.1
"""Seconds that are searched backwards first; then twice as many."""
MAX_MESSAGE = 1000
SLICE_S = 0.005
"""Seconds of the chip between two moments at which a way back may be left."""


@dataclass(slots=True)
class Armed:
    """A breakpoint with what it waits for."""

    breakpoint: Breakpoint
    condition: AtCondition | None = None
    hits: int = 1
    """The number of the first hit that stops."""
    message: str | None = None
    """What is printed instead of a stop; {name} is a variable."""
    listing: Listing | None = None
    count: int = 0

    @property
    def text(self) -> str:
        return self.breakpoint.text

    def holds(self, chip: TimeMachine) -> bool:
        """Return whether its condition is true now."""
        return self.condition is None or self.condition.holds(chip)

    def printed(self, chip: TimeMachine) -> str:
        """Return the message with the values of its variables."""
        return re.sub(r"\{([^{}]+)\}", lambda found: self._value(found[1].strip(), chip), self.message or "")

    def _value(self, name: str, chip: TimeMachine) -> str:
        if name.upper() in PINS:
            return str(chip.machine.pins >> PINS.index(name.upper()) & 1)
        try:
            return str(variable(name, self.listing).number(chip.machine.ram))
        except InputError:
            return f"{{{name}}}"


def armed(breakpoint: Breakpoint, given: Mapping[str, Any], listing: Listing | None) -> Armed:
    """Return a breakpoint with its `condition`, `hitCondition` and `logMessage`. Raises InputError."""
    condition = None
    if given.get("condition"):
        parsed = parse_breakpoint(str(given["condition"]), listing)
        if not isinstance(parsed, AtCondition):
            hint = "a comparison, such as width > 1500"
            raise InputError("bad-breakpoint", f"'{parsed.text}' is not a condition", hint=hint)
        condition = parsed
    hits = count_in(str(given.get("hitCondition") or "1").strip().lstrip(">="))
    if not hits:
        message = f"'{given['hitCondition']}' is not a number of hits"
        raise InputError("bad-breakpoint", message, hint="5, or >= 5")
    printed = str(given["logMessage"]) if given.get("logMessage") else None
    if printed is not None and len(printed) > MAX_MESSAGE:
        raise InputError("bad-breakpoint", f"a message has up to {MAX_MESSAGE} characters")
    return Armed(breakpoint, condition, hits, printed, listing)


def unheard(text: str) -> None:
    """Take a message of a breakpoint where no editor is there to read it."""


def next_stop(
    chip: TimeMachine,
    end: int,
    every: Sequence[Armed],
    log: Callable[[str], None],
    produced: list[EdgeChunk] | None = None,
) -> Armed | None:
    """Run to the first breakpoint that stops, which is returned, or to the first moment not before `end`.

    The edges are appended to `produced`.
    """
    while chip.now < end:
        stopping = None
        for each in _run_to_breakpoint(chip, end, every, produced):
            each.count += 1
            if each.message is not None:
                log(each.printed(chip))
            elif each.count >= each.hits:
                stopping = stopping or each
        if stopping is not None:
            return stopping
    return None


def going_back(chip: TimeMachine, every: Sequence[Armed]) -> Generator[None, None, Armed | None]:
    """Go back to the last moment at which a breakpoint stops, which is returned; to power-up without one.

    Counts of hits are not of the past: there each hit stops. The way may be left after each step.
    """
    here, width = int(chip.now), int(chip.clock.round_seconds(FIRST_BACK_S))
    slice_ = chip.clock.round_seconds(SLICE_S)
    stops = [each for each in every if each.message is None]
    while stops:
        begin = max(0, here - width)
        chip.seek(begin)
        last: tuple[int, Armed] | None = None
        while chip.now < here:
            met = _run_to_breakpoint(chip, min(here, chip.now + slice_), stops)
            if met and chip.now < here:
                last = int(chip.now), met[0]
            yield
        if last is not None:
            chip.seek(last[0])
            return last[1]
        if not begin:
            break
        width *= 2
    chip.seek(0)
    return None


def _run_to_breakpoint(
    chip: TimeMachine, end: int, every: Sequence[Armed], produced: list[EdgeChunk] | None = None
) -> list[Armed]:
    """Run to the first breakpoint, or to `end`; return those there whose conditions hold."""
    there = run_to(chip, end, [each.breakpoint for each in every], chip.machine.image, produced)
    return [each for each in every if each.breakpoint in there and each.holds(chip)]
