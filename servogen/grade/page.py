"""A grade as one page of Markdown for the student: the verdict, why, and what was measured.

Names and reasons contain what strangers wrote: they are escaped, so that they add no heading, link or tag.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from urllib.parse import quote

from servogen.grade.display import markdown, shown_name
from servogen.grade.judge import Grade, Row
from servogen.grade.lab import Lab
from servogen.grade.points import CheckState, max_total, number, outcomes, total


def page(lab: Lab, student: str, grade: Grade, film: str = "", command: str = "") -> str:
    """Return the page, the same for the same grade; `student` names the program, `film` its film's file.

    `command` is the command line that opens the program in a browser at the moment of the film.
    """
    return "\n".join(_lines(lab, student, grade, film, command)) + "\n"


def _lines(lab: Lab, student: str, grade: Grade, film: str, command: str) -> Iterator[str]:
    yield f"# {markdown(shown_name(student))}: {'passed' if grade.passed else 'not passed'}"
    if grade.how_long:
        yield from ("", f"{grade.how_long[0].upper()}{grade.how_long[1:]}.")
    yield ""
    yield markdown(f"{lab.title}. {lab.task}")
    results = outcomes(lab, grade)
    yield ""
    yield f"Points: {number(total(results))} of {number(max_total(results))}."
    if grade.reasons:
        yield from ("", "## What is wrong", "")
        for reason in grade.reasons:
            yield from _item(reason)
    if film:
        yield from (
            "",
            f"[The film of it]({quote(film)}): the servos, the pulses and the source line at the moment.",
        )
    if command:
        yield from ("", "Step through it from that moment, forwards and backwards:", "", *_code(command))
    if grade.remarks:
        yield from ("", "## Good to know", "")
        for remark in grade.remarks:
            yield from _item(remark.sentence)
    yield from ("", "## Points", "", "| check | points |", "|---|---|")
    for outcome in results:
        points = f"{number(outcome.points)} of {number(outcome.max_points)}"
        yield f"| {outcome.title}{NOT_PASSED[outcome.state]} | {points} |"
    if grade.rows:
        yield from ("", "## What was measured", "")
        yield f"Order: {markdown(grade.seen)}"
        yield ""
        yield from _table(grade)
        yield ""
        servos = markdown(", ".join(f"{servo} on {pin}" for servo, pin in grade.pins))
        yield f"Servos: {servos}. {_how_long(grade)}"


NOT_PASSED = {CheckState.PASSED: "", CheckState.FAILED: ": failed", CheckState.NOT_CHECKED: ": not checked"}


def _item(reason: str) -> Iterator[str]:
    """Yield a one-line reason as a sentence, a compiler's message of several lines unchanged."""
    first, *rest = reason.splitlines()
    yield f"- {markdown(first)}"
    if rest:
        yield from ("", *(f"  {line}".rstrip() for line in _code(*rest)))


def _code(*lines: str) -> Iterator[str]:
    """Yield lines as a block of code, whatever backquotes they contain."""
    longest = max((len(run) for line in lines for run in re.findall("`+", line)), default=0)
    fence = "`" * max(3, longest + 1)
    yield from (fence, *lines, fence)


def _table(grade: Grade) -> Iterator[str]:
    yield "| position | visits in order | pulses | angle | period | stays | silent | required pause |"
    yield "|---|---|---|---|---|---|---|---|"
    for row in grade.rows:
        cells = (
            markdown(row.name),
            str(row.visits),
            " and ".join(_range(width, "µs", 0) for width in row.widths_us),
            " and ".join(_range(angle, "°", 1) for angle in row.angles_deg),
            _range(row.periods_ms, "ms", 2),
            _range(row.stays_s, "s", 2),
            _range(row.silent_s, "s", 2),
            _requirement(row),
        )
        yield f"| {' | '.join(cells)} |"


def _range(ends: tuple[float, float] | None, unit: str, digits: int) -> str:
    if ends is None:
        return "–"
    low, high = (f"{end:.{digits}f}" for end in ends)
    space = "" if unit == "°" else " "
    return f"{low}{space}{unit}" if low == high else f"{low} to {high}{space}{unit}"


def _requirement(row: Row) -> str:
    return "–" if row.pause_s is None else f"{row.pause_s:g} s"


def _how_long(grade: Grade) -> str:
    watched = f"Watched for {grade.watched_s:g} s"
    if grade.chips > 1:
        watched += f" on {grade.chips} chips with different RAM, pins, watchdog and EEPROM at power-up"
    if grade.repeats:
        state = "the chip's state repeats" if grade.chips == 1 else "the state of each repeats"
        return f"{watched}; {state}, so this goes on endlessly."
    return f"{watched}."
