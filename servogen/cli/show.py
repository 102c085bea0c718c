"""How results are shown: tables, JSON, progress. Colour and progress only on a terminal."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from servogen.units import counted

WIDE = 200
"""Columns of a table that goes to a file or a pipe: nothing is wrapped."""


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """A table on standard output; columns whose cells are all numbers stand at the right."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    shown = Table(title=title, box=SIMPLE, title_justify="left")
    for index, column in enumerate(columns):
        numeric = bool(rows) and all(_numeric(row[index]) for row in rows)
        shown.add_column(column, justify="right" if numeric else "left", overflow="fold")
    for row in rows:
        shown.add_row(*(str(cell) for cell in row))
    Console(width=None if sys.stdout.isatty() else WIDE, highlight=False, markup=False).print(shown)


def _numeric(cell: object) -> bool:
    return str(cell).replace(".", "", 1).replace("-", "", 1).strip().isdigit()


def as_json(value: object) -> None:
    """Print one JSON document on standard output, on one line; in ASCII, for every locale."""
    print(json.dumps(_without_negative_zeros(value)))


def _without_negative_zeros(value: object) -> object:
    """Return the value with 0.0 for -0.0, which is the same number and reads as another."""
    match value:
        case float():
            return value + 0.0
        case dict():
            return {key: _without_negative_zeros(each) for key, each in value.items()}
        case list() | tuple():
            return [_without_negative_zeros(each) for each in value]
        case _:
            return value


def warn(text: str) -> None:
    """Print one warning on standard error."""
    print(f"warning: {text}", file=sys.stderr)


def warn_of_all(warnings: Sequence[object]) -> None:
    """Print all warnings behind their number; call it last, so that no table scrolls them away."""
    if not warnings:
        return
    sys.stdout.flush()  # on a terminal both streams go to one screen
    print(f"{counted(len(warnings), 'warning')}:", file=sys.stderr)
    for warning in warnings:
        warn(str(warning))


@contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """A bar on a terminal's standard error; yields a function that takes how much is done."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=total)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def status(text: str) -> Iterator[Callable[[str], None]]:
    """A line on a terminal's standard error that says what is done; yields a function that changes it."""
    if not sys.stderr.isatty():
        yield lambda text: None
        return
    from rich.console import Console

    with Console(stderr=True).status(text) as shown:
        yield shown.update
