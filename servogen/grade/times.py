"""Pauses, travel and periods: what is wrong with the times of right visits, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from servogen.grade.lab import Lab, Position, Way
from servogen.grade.visits import Visit
from servogen.grade.watch import PinPulses, Watched
from servogen.pulse.lint import PERIOD_US
from servogen.units import counted


class Stay(NamedTuple):
    """One visit that is at the position that it should be. Seconds."""

    position: int
    visit: Visit
    stays_s: float
    silent_s: float
    whole: bool
    """Not cut off by the end of the watch."""


def stays(
    watched: Watched,
    pins: Sequence[PinPulses],
    found: Sequence[Visit],
    asked: Sequence[int],
    right: Sequence[int],
) -> list[Stay]:
    """The right ones of the visits `found`."""
    second = float(watched.clock.cycles_per_second)
    made = []
    for index in right:
        visit = found[index]
        silent = min(pin.silence(visit.begin, visit.end) for pin in pins)
        made.append(Stay(asked[index], visit, visit.cycles / second, silent / second, index < len(found) - 1))
    return made


def pause_reasons(lab: Lab, way: Way, found: Sequence[Stay]) -> Iterator[str]:
    """Of each position with a wrong pause, the visit whose pause is most wrong."""
    for number, position in enumerate(way.positions):
        own = [stay for stay in found if stay.position == number and stay.whole]
        if position.pause_s is None or not own:
            continue
        worst = max(own, key=lambda stay: _pause_error(stay, position))
        if _pause_error(worst, position) > lab.pause_tolerance * position.pause_s:
            yield _pause_words(worst, position)


def _pause_error(stay: Stay, position: Position) -> float:
    asked = position.pause_s or 0.0
    return min(abs(stay.stays_s - asked), abs(stay.silent_s - asked))


def _pause_words(stay: Stay, position: Position) -> str:
    asked = f"asked for is a pause of {position.pause_s:g} s"
    if stay.silent_s:
        return f"after {position.name} there are no pulses for {stay.silent_s:.2f} s; {asked}"
    return f"it stays at {position.name}, with pulses, for {stay.stays_s:.2f} s; {asked}"


def travel_reasons(
    lab: Lab,
    watched: Watched,
    pins: Sequence[PinPulses],
    everything: Sequence[Visit],
    found: Sequence[Stay],
    way: Way,
) -> Iterator[str]:
    """Positions that a servo cannot have reached: without pulses it does not move on."""
    before = {after.begin: visit.told[-1].angles for visit, after in pairwise(everything)}
    told: set[tuple[int, int]] = set()
    second = float(watched.clock.cycles_per_second)
    for stay in found:
        for number, (each, pin) in enumerate(zip(lab.servos, pins, strict=True)):
            speed = each.servo.model.speed
            start = before.get(stay.visit.begin)
            if speed is None or start is None or not stay.whole or not each.servo.allows(start[number]):
                continue
            turn = abs(stay.visit.told[-1].angles[number] - start[number])
            needed = turn / speed
            given = stay.stays_s - pin.silence(stay.visit.begin, stay.visit.end) / second
            if given + 2 * pin.period / second < needed and (stay.position, number) not in told:
                told.add((stay.position, number))
                yield (
                    f"the pulses for {way.positions[stay.position].name} last {given:.2f} s: "
                    f"a {each.servo.model.title} needs {needed:.2f} s to get there"
                )


def period_reasons(
    lab: Lab,
    watched: Watched,
    names: Sequence[str],
    pins: Sequence[PinPulses],
    way: Way,
    found: Sequence[Stay],
) -> Iterator[str]:
    """For each pin the period that is farthest outside, and the one that changes most within a position."""
    ms = float(watched.clock.cycle_us) / 1000
    low, high = lab.period_ms
    for name, pin in zip(names, pins, strict=True):
        outside, changing = (0.0, ""), (0.0, "")
        for stay in found:
            periods = pin.periods(stay.visit.begin, stay.visit.end) * ms
            if not len(periods):
                continue
            least, most = float(periods.min()), float(periods.max())
            where = way.positions[stay.position].name
            beyond = max(low - least, most - high)
            if beyond > outside[0]:
                value = most if most - high >= low - least else least
                outside = (beyond, f"the period on {name} at {where} is {value:.2f} ms")
            if most - least > changing[0]:
                drift = (
                    "drifts"
                    if bool(np.all(np.diff(periods) >= 0) or np.all(np.diff(periods) <= 0))
                    else "varies"
                )
                changing = (
                    most - least,
                    f"the period on {name} {drift} at {where}: {least:.3f} to {most:.3f} ms",
                )
        if outside[0] > 0:
            yield f"{outside[1]}; right is {low:g} to {high:g} ms"
        if changing[0] * 1000 > lab.spread_us:
            yield f"{changing[1]}; it may change by {lab.spread_us:g} µs"


def period_remark(watched: Watched, pins: Sequence[PinPulses]) -> str | None:
    """A period that the lab allows, but that is not the recommended one."""
    periods = [float(watched.clock.us(pin.period)) for pin in pins if pin.period]
    least, most = (value / 1000 for value in PERIOD_US)
    for period in periods:
        if not least - 0.5 <= period / 1000 <= most + 0.5:
            return f"the period is {period / 1000:.2f} ms; {least:g} to {most:g} ms are recommended"
    return None


def end_reason(
    lab: Lab, watched: Watched, pins: Sequence[PinPulses], found: Sequence[Visit], way: Way
) -> str | None:
    """Why there are fewer whole rounds than asked for."""
    rounds = max(0, len(found) - 1) // len(way.positions)
    if rounds >= lab.rounds:
        return None
    seconds = float(watched.clock.seconds(watched.end))
    whole = "no whole round" if not rounds else f"only {counted(rounds, 'whole round')}"
    text = f"{whole} in {seconds:g} s, at least {lab.rounds} should be"
    last = max(int(pin.fall[-1]) for pin in pins)
    quiet = float(watched.clock.seconds(watched.end - last))
    longest = max(position.pause_s or 1.0 for position in way.positions)
    if quiet > 2 * longest:
        end = float(watched.clock.seconds(last))
        return f"{text}: the pulses end after {end:.1f} s; it must go on without end"
    if found and float(watched.clock.seconds(found[-1].cycles)) > 2 * longest:
        begin = float(watched.clock.seconds(found[-1].begin))
        return f"{text}: from {begin:.1f} s on it stays where it is; it must go on without end"
    return text
