"""Shows results: tables, JSON, progress; colour and progress only on a terminal."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from servogen.errors import Diagnostic, ServogenError, SourceLines, rendered
from servogen.units import counted

if TYPE_CHECKING:
    from rich.console import Console

SPACE, EDGE = 3, 1
"""The blanks beside each column of a table, and one more at its edge."""
WIDE = 200
"""The width of a table that is written to a file or a pipe, so that nothing is wrapped."""


def table(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], least: Sequence[str] = ()
) -> None:
    """Print a table on standard output; columns of numbers are right-aligned.

    Where not everything fits on a terminal, the columns named in `least` are left out; then cells are wrapped
    between words; then the last columns are left out, too. A line says which; the first column stays.
    """
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else WIDE, highlight=False, markup=False)
    cells = [[str(cell) for cell in row] for row in rows]
    shown, widths = _columns_that_fit(columns, cells, [columns.index(name) for name in least], console.width)
    made = Table(title=title, box=SIMPLE, title_justify="left")
    for index, width in zip(shown, widths, strict=True):
        numeric = bool(cells) and all(_numeric(row[index]) for row in cells)
        made.add_column(columns[index], justify="right" if numeric else "left", overflow="fold", width=width)
    for row in cells:
        made.add_row(*(row[index] for index in shown))
    console.print(made)
    omitted = [name for index, name in enumerate(columns) if index not in shown]
    if omitted:
        where = f"not shown in {console.width} columns: {', '.join(omitted)}"
        print_lines([f"{where}; a wider terminal or {JSON} has them"])


def _columns_that_fit(
    columns: Sequence[str], rows: Sequence[Sequence[str]], least: Sequence[int], width: int
) -> tuple[list[int], list[int]]:
    """Return which columns fit a width without a word being cut, and how wide each is."""
    from rich.cells import cell_len

    texts = [[column, *(row[index] for row in rows)] for index, column in enumerate(columns)]
    words = [max(cell_len(word) for text in each for word in text.split() or [""]) for each in texts]
    whole = [max(cell_len(line) for text in each for line in text.split("\n")) for each in texts]
    shown = list(range(len(columns)))
    for sizes, going in ((whole, least), (words, range(len(columns) - 1, 0, -1))):
        for index in going:
            if sum(sizes[each] + SPACE for each in shown) + EDGE > width and index in shown:
                shown.remove(index)
    left = width - EDGE - sum(words[each] + SPACE for each in shown)
    widths = []
    for index in shown:  # what is left goes to the first columns, which are read first
        more = min(left, whole[index] - words[index])
        left -= max(0, more)
        widths.append(max(words[index], words[index] + more))
    return shown, widths


def _numeric(cell: object) -> bool:
    return str(cell).replace(".", "", 1).replace("-", "", 1).strip().isdigit()


JSON = "--json"

_warned: list[Diagnostic] = []
"""The diagnostics that the command has reported so far."""


def begin() -> None:
    """Forget the diagnostics of an earlier command in this process."""
    _warned.clear()


def wants_json(arguments: Sequence[str]) -> bool:
    """Return whether a command line asks for JSON, even if it is wrong otherwise."""
    options = arguments[: arguments.index("--")] if "--" in arguments else arguments
    return JSON in options


def as_json(value: Mapping[str, object], diagnostics: Iterable[Diagnostic] = ()) -> None:
    """Print one JSON document on standard output, on one line; in ASCII, for every locale.

    Its first key is `diagnostics`: those that the command has reported, then those given here.
    """
    listed = [diagnostic.to_json() for diagnostic in dict.fromkeys((*_warned, *diagnostics))]
    json_line({"diagnostics": listed, **value})


def json_line(value: object) -> None:
    """Print a JSON value alone on one line: an entry of a log."""
    print(json.dumps(_without_negative_zeros(value)))


def _without_negative_zeros(value: object) -> object:
    """Return the value with 0.0 for -0.0, which is the same number and reads as another."""
    match value:
        case float():
            return value + 0.0
        case dict():
            return {key: _without_negative_zeros(item) for key, item in value.items()}
        case list() | tuple():
            return [_without_negative_zeros(item) for item in value]
        case _:
            return value


def warn(diagnostic: Diagnostic) -> None:
    """Print one diagnostic on standard error, and keep it for `as_json`."""
    _warned.append(diagnostic)
    print(diagnostic, file=sys.stderr)


def next_step(command: str, *words: object) -> str:
    """Return the line that ends what a command prints: what to type next."""
    return f"next: servogen {shlex.join([command, *map(str, words)])}"


def print_lines(lines: Iterable[str]) -> None:
    """Print lines of text; on a terminal those that are longer are continued between words, further inside.

    A command stays on one line, so that it can be copied.
    """
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else 0
    for line in lines:
        inside = line[: len(line) - len(line.lstrip())]
        if not width or len(line) <= width or line.lstrip().startswith("servogen "):
            print(line)
        else:
            after = inside + "  "
            print(
                textwrap.fill(
                    line, width, subsequent_indent=after, break_long_words=False, break_on_hyphens=False
                )
            )


def warn_of_all(warnings: Sequence[Diagnostic], lines: SourceLines | None = None) -> None:
    """Print all warnings after their number; call it last, so that no table scrolls them away."""
    if not warnings:
        return
    sys.stdout.flush()  # on a terminal both streams go to one screen
    print(f"{counted(len(warnings), 'warning')}:", file=sys.stderr)
    print(rendered(warnings, lines), file=sys.stderr)


def show_error(error: ServogenError, arguments: Sequence[str]) -> None:
    """Print an error on standard error and, if the command line asks for it, as JSON on standard output."""
    if wants_json(arguments):
        as_json(error.details, error.diagnostics)
    print(error, file=sys.stderr)


@contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a progress bar if standard error is a terminal; yield a function that takes how much is done."""
    if not sys.stderr.isatty():
        yield lambda completed: None
        return
    from rich.progress import Progress

    with Progress(console=_error_console(), transient=True) as bar:
        task = bar.add_task(_as_it_is(label), total=total)
        yield lambda completed: bar.update(task, completed=completed)


@contextmanager
def status(text: str) -> Iterator[Callable[[str], None]]:
    """Show a status line if standard error is a terminal; yield a function that changes it."""
    if not sys.stderr.isatty():
        yield lambda text: None
        return
    with _error_console().status(_as_it_is(text)) as shown:
        yield lambda text: shown.update(_as_it_is(text))


def _error_console() -> Console:
    from rich.console import Console

    return Console(stderr=True)


def _as_it_is(text: str) -> str:
    """Return a text in which rich takes no [name] for its markup."""
    from rich.markup import escape

    return escape(text)
