"""The film of a failed program: which pulses and which lines of its source are kept."""

from __future__ import annotations

import numpy as np
import pytest

from servogen.grade import film
from servogen.grade.film import FilmRow, lines_around, make_film
from servogen.grade.watch import PinPulses, Watched
from servogen.units import Clock


def watched(clock_hz: int = 4_000_000, end: int = 60_000_000, **rises: list[int]) -> Watched:
    """Return pulses of 1500 cycles on pins p0, p1, …"""
    pins = {
        int(name[1:]): PinPulses(np.array(rise, np.int64), np.array(rise, np.int64) + 1500)
        for name, rise in rises.items()
    }
    return Watched(Clock(clock_hz), end, pins, {}, False)


def test_the_pulses_from_five_seconds_before_to_ten_seconds_after_the_moment_are_kept() -> None:
    """At 4 MHz a cycle is a microsecond. A pulse that ends at the end is not whole in it."""
    rises = [24_999_999, 25_000_000, 30_000_000, 39_998_499, 39_998_500]
    found = make_film(watched(p3=rises), (3, 7), 30_000_000, None)
    assert (found.begin_us, found.moment_us, found.end_us) == (25e6, 30e6, 40e6)
    assert found.rows == (
        FilmRow(3, (25_000_000.0, 30_000_000.0, 39_998_499.0), (1500.0,) * 3),
        FilmRow(7, (), ()),
    )
    assert found.source is None


def test_a_film_begins_not_before_reset_and_ends_with_the_watch() -> None:
    found = make_film(watched(end=8_000_000, p0=[0, 7_000_000]), (0,), 2_000_000, None)
    assert (found.begin_us, found.moment_us, found.end_us) == (0, 2e6, 8e6)
    assert found.rows[0].rise_us == (0.0, 7e6)


def test_without_a_moment_it_is_that_of_the_first_pulse_on_the_pins() -> None:
    pulses = watched(p0=[9_000_000], p1=[7_000_000, 8_000_000], p2=[50])
    assert make_film(pulses, (0, 1), None, None).moment_us == 7e6
    assert make_film(pulses, (5,), None, None).moment_us == 0
    assert make_film(pulses, (0, 1), 3, None).moment_us == 3


def test_times_are_in_tenths_of_a_microsecond_of_the_chips_clock() -> None:
    """At 20 MHz a cycle is 0.2 µs, at 3.58 MHz 1.1173 µs."""
    found = make_film(watched(20_000_000, p0=[1001]), (0,), None, None)
    assert found.rows == (FilmRow(0, (200.2,), (300.0,)),)
    assert make_film(watched(3_580_000, p0=[1001]), (0,), None, None).rows == (
        FilmRow(0, (1118.4,), (1676.0,)),
    )


def test_of_many_pulses_the_first_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "MAX_PULSES", 3)
    found = make_film(watched(p0=[2000 * n for n in range(5)]), (0,), None, None)
    assert found.rows[0].rise_us == (0.0, 2000.0, 4000.0)
    assert len(found.rows[0].width_us) == 3


@pytest.mark.parametrize(
    ("line", "first", "last"),
    [(50, 38, 62), (13, 1, 25), (12, 1, 24), (1, 1, 13), (90, 78, 100), (100, 88, 100)],
)
def test_twelve_lines_before_and_after_the_one_that_runs(line: int, first: int, last: int) -> None:
    text = "\n".join(f"line {number}" for number in range(1, 101))
    found = lines_around("main.c", text, line)
    assert (found.file, found.line, found.first) == ("main.c", line, first)
    assert found.lines == tuple(f"line {number}" for number in range(first, last + 1))


def test_long_lines_are_cut() -> None:
    assert lines_around("main.c", "a" * 200 + "\n" + "b" * 201, 1).lines == ("a" * 200, "b" * 200)
