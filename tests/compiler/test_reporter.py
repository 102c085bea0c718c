"""Diagnostics as they are collected: their order, the lines that they point to, what is left out."""

from __future__ import annotations

import pytest

from servogen.compiler.diagnostics import Fatal, Reporter, is_own_file
from servogen.errors import InputError, Location
from tests.compiler.cases import every


def reporter(*unwanted: str) -> Reporter:
    made = Reporter(frozenset(unwanted))
    made.add_source("b.c", "first\n  second\n\tthird")
    made.add_source("a.c", "alone")
    return made


def places(made: Reporter) -> list[tuple[str | None, int | None, int | None]]:
    located = [each.location for each in made.ordered()]
    return [(each.file, each.line, each.column) for each in located if each is not None]


def test_diagnostics_are_in_the_order_of_the_files_and_their_lines() -> None:
    made = reporter()
    given = [
        ("x.c", 1, 1), ("a.c", 1, 2), ("b.c", 3, 1), ("b.c", 2, 9), ("b.c", 2, 4), ("a.c", 1, 1), (None,) * 3,
    ]  # fmt: skip
    for at, place in enumerate(given):
        (made.error if at % 2 else made.warn)("c-syntax" if at % 2 else "c-return", "m", Location(*place))  # type: ignore[arg-type]
    assert places(made) == [
        *(("b.c", 2, 4), ("b.c", 2, 9), ("b.c", 3, 1)),
        *(("a.c", 1, 1), ("a.c", 1, 2)),
        *((None, None, None), ("x.c", 1, 1)),
    ]
    assert made.errors == 3


def test_the_same_diagnostic_is_kept_once() -> None:
    made = reporter()
    for column in (1, 1, 2):
        made.warn("c-return", "m", Location("b.c", 1, column))
    assert len(made.ordered()) == 2


@every(
    ("place", "expected"),
    [
        # a directive or a line of assembly is shown at its first word
        (Location("b.c", 1), ("b.c", 1, 1)), (Location("b.c", 2), ("b.c", 2, 3)),
        (Location("b.c", 3), ("b.c", 3, 2)), (Location("b.c", 2, 7), ("b.c", 2, 7)),
        (Location("b.c", 4), ("b.c", 4, None)), (Location("b.c"), ("b.c", None, None)),
        (Location("x.c", 1), ("x.c", 1, None)), (Location(), (None, None, None)),
    ],
)  # fmt: skip
def test_where_a_diagnostic_points(
    place: Location, expected: tuple[str | None, int | None, int | None]
) -> None:
    made = reporter()
    made.error("c-syntax", "m", place)
    assert places(made) == [expected]
    line = {1: "first", 2: "  second", 3: "\tthird"}.get(place.line or 0) if place.file == "b.c" else None
    assert made.source_lines() == ({(place.file, place.line): line} if line else {})


def test_the_lines_of_a_file() -> None:
    made = reporter()
    assert made.lines("b.c") == ["first", "  second", "\tthird"]
    assert made.lines("x.c") == []


def test_warnings_about_the_compilers_own_files_and_unwanted_ones_are_left_out() -> None:
    made = reporter("c-return")
    made.warn("c-return", "m", Location("b.c", 1, 1))
    made.warn("c-shift", "m", Location("<string.h>", 1, 1))
    assert made.ordered() == ()
    made.warn("c-shift", "m", Location("b.c", 1, 1))
    made.error("c-return", "m", Location("<string.h>", 1, 1))
    assert [(each.severity, each.code) for each in made.ordered()] == [
        ("warning", "c-shift"),
        ("error", "c-return"),
    ]
    assert [is_own_file(Location(file)) for file in ("<string.h>", "a<.c", None)] == [True, False, False]


def test_errors_end_a_stage_and_warnings_do_not() -> None:
    made = reporter()
    made.stop_on_error()
    made.warn("c-shift", "m", Location("b.c", 1, 1))
    made.stop_on_error()
    made.details["key"] = 7
    fatal = made.fatal("c-syntax", "what is wrong", Location("b.c", 2, 3), "a hint")
    assert isinstance(fatal, Fatal) and str(fatal) == "what is wrong"
    with pytest.raises(InputError) as caught:
        made.stop_on_error()
    assert [(each.message, each.hint) for each in caught.value.diagnostics] == [
        ("m", None),
        ("what is wrong", "a hint"),
    ]
    assert caught.value.details == {"key": 7}


def test_the_fiftieth_error_is_the_last() -> None:
    made = reporter()
    for at in range(49):
        made.error("c-syntax", f"{at}", Location("b.c", 1, 1))
        made.warn("c-shift", f"{at}", Location("b.c", 1, 1))
    with pytest.raises(InputError) as caught:
        made.error("c-syntax", "49", Location("b.c", 1, 1))
    assert [each.message for each in caught.value.diagnostics if each.severity == "error"] == [
        str(at) for at in range(50)
    ]
