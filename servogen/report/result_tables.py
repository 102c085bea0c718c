"""What was found, for a page: each program's verdict, the capture's, what the functions and memories cost.

In: facts of programs, a capture, a listing. Out: rows of text.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from servogen.edges import PINS, EdgeTrace
from servogen.pic.device import PROGRAM_WORDS, RAM_BYTES
from servogen.pic.listing import ListedFunction, Listing
from servogen.plan_error import plan_words
from servogen.report.text import ProgramFacts
from servogen.verify import CaptureVerdict, capture_lines

FEW = 2
"""Of the reasons why a call has no known end."""


@dataclass(frozen=True, slots=True)
class CaptureFacts:
    """A capture beside the plan: its file's name, its edges, what was found of it."""

    name: str
    trace: EdgeTrace
    verdict: CaptureVerdict


def program_values(program: ProgramFacts) -> dict[str, object]:
    verdict = program.verdict
    late = (
        [] if program.proven or not program.overrun else [f"overrun: {program.overrun.text(verdict.clock)}"]
    )
    return {
        "name": program.hex_file,
        "facts": ", ".join(
            (
                f"{program.dialect}, {program.words} words, {program.ram_bytes} bytes of RAM",
                *(
                    f"the C between {room.between} at most {room.worst} of {room.room} cycles"
                    for room in program.timing_budgets
                ),
            )
        ),
        "proven": program.proven,
        "span": f"{verdict.span.frames} frames, {float(verdict.clock.seconds(verdict.span.compared)):g} s, "
        f"{verdict.span.compared} cycles, on all 13 pins; {plan_words(verdict.plan_error)}",
        "start": None
        if verdict.start is None
        else f"{float(verdict.clock.us(verdict.start)):g} µs after reset",
        "reasons": (*verdict.reasons, *late),
        "rows": [
            (
                channel.name,
                PINS[channel.pin],
                f"{channel.observed} of {channel.scheduled}",
                str(channel.missing),
                str(channel.extra),
                f"{channel.width.error:+d}" if channel.width.error else "0",
                f"{channel.period.error:+d}" if channel.period.error else "0",
                f"{channel.edge.error:+d}" if channel.edge.error else "0",
            )
            for channel in verdict.channels
        ],
    }


def capture_values(capture: CaptureFacts | None) -> dict[str, object] | None:
    if capture is None:
        return None
    verdict = capture.verdict
    return {
        "name": capture.name,
        "badge": "good" if verdict.proven else "open" if verdict.agrees else "bad",
        "word": verdict.word if verdict.agrees else "NOT proven",
        "lines": [line for line in capture_lines(verdict) if not line.startswith("- ")],
        "reasons": verdict.reasons,
        "rows": [
            (
                channel.name,
                PINS[channel.pin],
                f"{channel.captured} of {channel.scheduled}" if channel.connected else "not connected",
                f"{channel.width.worst_us:+z.3f}",
                f"{channel.width.mean_us:+z.3f}",
                "–" if channel.mean_period_us is None else f"{channel.mean_period_us:z.2f}",
                f"{channel.jitter_us:z.3f}",
            )
            for channel in verdict.channels
        ],
    }


def costs(listing: Listing | None) -> Iterator[tuple[str, ...]]:
    """One row a function, the dearest first."""
    functions = listing.functions if listing else ()
    for each in sorted(functions, key=lambda each: (each.start - each.end, each.start)):
        yield (
            _spoken(each.name),
            f"{each.start:04X}",
            str(each.end - each.start),
            str(each.ram_bytes),
            str(each.deepest_calls),
            _cycles(each),
        )


def _spoken(name: str) -> str:
    """A table's name says where in the C it stands: `__table.NAME@file:line:column`."""
    table, _, place = name.removeprefix("__table.").partition("@")
    return f"table {table}, {place.rpartition(':')[0]}" if name.startswith("__table.") else name


def _cycles(listed: ListedFunction) -> str:
    """Of a call: exactly, or from the shortest to the longest way, and what has no known end."""
    least, most = listed.least_cycles, listed.most_cycles
    if least is None:
        return "–" if most is None else f"up to {most}"
    if most is None:
        return f"{least} or more" + (f": {_few(listed.unbounded)}" if listed.unbounded else "")
    return str(least) if least == most else f"{least} to {most}"


def _few(texts: Sequence[str]) -> str:
    more = f" and {len(texts) - FEW} more" if len(texts) > FEW else ""
    return ", ".join(texts[:FEW]) + more


def memory(programs: Sequence[ProgramFacts]) -> tuple[tuple[str, int, int, str], ...]:
    """(what, used, of, per cent) of each memory."""
    if not programs:
        return ()
    own = programs[0]
    used = (("program words", own.words, PROGRAM_WORDS), ("bytes of RAM", own.ram_bytes, RAM_BYTES))
    return tuple((what, part, whole, f"{100 * part / whole:z.1f}") for what, part, whole in used)
