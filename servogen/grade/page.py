"""A grade as one page of Markdown for the student: the verdict, why, and what was measured."""

from __future__ import annotations

from collections.abc import Iterator

from servogen.grade.grade import Grade, Row
from servogen.grade.lab import Lab


def page(lab: Lab, student: str, grade: Grade) -> str:
    """The page, the same for the same grade."""
    return "\n".join(_lines(lab, student, grade)) + "\n"


def _lines(lab: Lab, student: str, grade: Grade) -> Iterator[str]:
    yield f"# {student}: {'passed' if grade.passed else 'not passed'}"
    yield ""
    yield f"{lab.title}. {lab.task}"
    if grade.reasons:
        yield from ("", "## What is wrong", "")
        for reason in grade.reasons:
            yield from _item(reason)
    if grade.remarks:
        yield from ("", "## Good to know", "")
        yield from (f"- {remark}" for remark in grade.remarks)
    if grade.rows:
        yield from ("", "## What was measured", "")
        yield f"Order: {grade.seen}"
        yield ""
        yield from _table(grade)
        yield ""
        yield f"Servos: {', '.join(f'{servo} on {pin}' for servo, pin in grade.pins)}. {_how_long(grade)}"


def _item(reason: str) -> Iterator[str]:
    """A reason of one line as a sentence, a compiler's message of several as it is."""
    first, *rest = reason.splitlines()
    yield f"- {first}"
    if rest:
        yield from ("", "  ```", *(f"  {line}".rstrip() for line in rest), "  ```")


def _table(grade: Grade) -> Iterator[str]:
    yield "| position | visits | pulses | angle | period | stays | silent | pause asked for |"
    yield "|---|---|---|---|---|---|---|---|"
    for row in grade.rows:
        cells = (
            row.name,
            str(row.visits),
            " and ".join(_range(width, "µs", 0) for width in row.widths_us),
            " and ".join(_range(angle, "°", 1) for angle in row.angles_deg),
            _range(row.periods_ms, "ms", 2),
            _range(row.stays_s, "s", 2),
            _range(row.silent_s, "s", 2),
            _asked(row),
        )
        yield f"| {' | '.join(cells)} |"


def _range(ends: tuple[float, float] | None, unit: str, digits: int) -> str:
    if ends is None:
        return "–"
    low, high = (f"{end:.{digits}f}" for end in ends)
    space = "" if unit == "°" else " "
    return f"{low}{space}{unit}" if low == high else f"{low} to {high}{space}{unit}"


def _asked(row: Row) -> str:
    return "–" if row.pause_s is None else f"{row.pause_s:g} s"


def _how_long(grade: Grade) -> str:
    if grade.for_ever:
        return f"Watched for {grade.watched_s:g} s; the chip's state repeats, so it goes on so for ever."
    return f"Watched for {grade.watched_s:g} s."
