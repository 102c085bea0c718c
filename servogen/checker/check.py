"""Checks a certificate: every run of every chip passes through its states, with the scheduled edges.

In: a program, a schedule's plan, a certificate. Out: what was run, or `Refused`, which says where and why.
The chip is run from power-up, and from each listed state, with all its unknown bits, to the next of the
certificate's cuts, once for each value of every bit on which its course depends. The state there must be
within a listed one, with the same position in the plan. So, by induction, these runs are all runs; every edge
of every pin in them is compared.

States are the rows of a matrix, beside the numbers of their places in the plan.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from servogen.checker import chip
from servogen.checker.certificate import Certificate, ImpossibleState, chip_states, fingerprint
from servogen.checker.plan import OVER, PINS, Place, Plan, read_plan
from servogen.pic.image import Image
from servogen.units import Clock

Ints = chip.Ints
PLACE, ORIGIN, COLUMNS = range(chip.SLOTS, chip.SLOTS + 3)
"""Columns beside the chip's slots: the number of the place in the plan, and the listed state from which the
run began (-1: power-up).
"""
EXACT = [chip.PC, chip.DEPTH, chip.OPTION, chip.TRISA, chip.TRISB, chip.EDGE, chip.OUT, chip.IRQ, chip.DARK,
         chip.FRAME, PLACE, *range(chip.STACK, chip.STACK + 8)]  # fmt: skip
"""What must be the same in a state and in the listed one that contains it."""
MAX_PERIODS, MAX_FORKS, MAX_CYCLES, MAX_COMPARED = 500, 5_000_000, 3_000_000_000, 50_000_000
"""Of a way between two cuts, all splits, the cycles that are run, and all comparisons of states."""
MAX_ROWS, ROWS = 250_000, 8_000
"""States that wait for their run, and listed states that are taken together."""
RC, FASTEST = 3, (200_000, 4_000_000, 20_000_000, 0)
"""Bits of the configuration word, and the largest clocks of LP, XT, HS and RC in Hz (section 6.2)."""
WATCHDOG_US, WATCHDOG_ON = 7_000, 4
"""The shortest period (DS35007 parameter 31) and the bit of the configuration word."""


class Refused(Exception):
    """The certificate does not prove that the edges are the schedule's; the text says where and why."""


@dataclass(frozen=True)
class Checked:
    """How much was covered: listed states, frames, cycles, and ways that were split."""

    states: int
    frames: int
    cycles: int
    forks: int


class Checker:
    """Runs the chip from power-up and from the listed states."""

    def __init__(self, image: Image, plan: Plan, certificate: Certificate) -> None:
        held = certificate.held
        if plan.directions and any(plan.buttons >> PINS.index(pin) & 1 for pin in held):
            plan = replace(plan, line=None, pushed=None, directions=None)
        self._plan, self._certificate = plan, certificate
        self._code = chip.program_code(image, certificate.cuts)
        self._parameters = np.zeros(chip.PARAMETERS, dtype=np.int64)
        self._held = sum(level << PINS.index(pin) for pin, level in held.items())
        self._inputs = plan.buttons & ~sum(1 << PINS.index(pin) for pin in held)
        watched = image.config is None or image.config & WATCHDOG_ON
        for slot, value in (
            (chip.LIMIT, MAX_PERIODS * plan.period),
            (chip.PERIOD, plan.period),
            (chip.CHANNELS, plan.channels),
            (chip.BUTTONS, self._inputs),
            (chip.HELD, sum(1 << PINS.index(pin) for pin in held)),
            (chip.LEVELS, self._held),
            (chip.WATCHDOG, int(WATCHDOG_US / Clock(plan.clock_hz).cycle_us) if watched else 0),
            (chip.EEPROM, [image.eeprom.get(cell, 0xFF) for cell in range(64)]),
        ):
            self._parameters[slot : slot + np.size(value)] = value
        self._places: dict[Place, int] = {}
        self._place_of: list[Place] = []
        at, out = (np.concatenate(each) for each in zip(*plan.edges, strict=True))
        self._edges = np.cumsum([0, *(len(each) for each, _ in plan.edges)]), at, out
        self._states = np.zeros((0, COLUMNS), dtype=np.int64)
        self._at: dict[bytes, list[int]] = defaultdict(list)
        self._frames = self._cycles = self._run = self._forks = self._compared = 0

    def check(self) -> Checked:
        """Run from power-up and from each listed state. Raises Refused."""
        try:
            states, places = chip_states(self._certificate, self._plan)
        except ImpossibleState as wrong:
            text = f"state {wrong}: the schedule has no such position, or the chip no such state"
            raise Refused(text) from wrong
        number = chip.complete(states, self._certificate.columns["tmr0_flagged"], self._parameters)
        if number >= 0:
            raise Refused(f"state {number}: {chip.REASONS[chip.INTERRUPT]}")
        self._states = np.pad(states, ((0, 0), (0, COLUMNS - chip.SLOTS)))
        self._states[:, ORIGIN] = np.arange(len(states))
        numbers = [self._number(place) for place in places]
        self._states[:, PLACE] = numbers
        self._states[:, chip.DUE] = [self._plan.run_of(place.position) for place in places]
        for number, key in enumerate(np.ascontiguousarray(self._states[:, EXACT])):
            self._at[key.tobytes()].append(number)
        self._follow(self._power_up())
        order = np.argsort(self._states[:, chip.DUE], kind="stable")  # those of one frame go the same way
        for first in range(0, len(order), ROWS):
            self._follow(self._states[order[first : first + ROWS]])
        return Checked(len(states), self._frames, self._cycles, self._forks)

    def _power_up(self) -> Ints:
        """Return the state after any reset: what DS35007 table 6-4 does not define is unknown."""
        s = np.zeros(COLUMNS, dtype=np.int64)
        s[chip.BYTES] = chip.UNKNOWN
        s[[chip.PORTA, chip.STATUS]] = 0x1F00  # TO and PD differ between resets
        s[[chip.PCLATH, chip.INTCON, chip.EECON1]] = 0, 0, 0x0800
        s[[chip.OPTION, chip.TRISA, chip.TRISB, chip.FRAME]] = 0xFF, 0x1F, 0xFF, chip.BEFORE
        s[[chip.T0_DUE, chip.IRQ, chip.WDT_DUE, chip.DARK]] = chip.NEVER
        chip.plan_time_out(s, self._parameters, 0, 0)
        first = self._plan.first
        s[[PLACE, ORIGIN, chip.DUE]] = self._number(Place(first)), -1, self._plan.run_of(first)
        return s[None]

    def _number(self, place: Place) -> int:
        """Return the number of a place."""
        if place not in self._places:
            self._places[place] = len(self._place_of)
            self._place_of.append(place)
        return self._places[place]

    def _follow(self, states: Ints) -> None:
        """Run from each of `states` to the next cuts, on every way. Raises Refused."""
        waiting = [states.copy()]
        while waiting:
            rows = waiting.pop()
            before, reasons = rows[:, chip.CYCLE].copy(), np.zeros(len(rows), dtype=np.int64)
            self._run += chip.run_all(rows, self._code, self._parameters, *self._edges, reasons)
            self._cycles += int((rows[:, chip.CYCLE] - before).sum())
            for why in np.unique(reasons):
                its = rows[reasons == why]
                if why == chip.NEW_FRAME:
                    waiting.append(self._next_frame(its))
                elif why == chip.LAST_EDGE:
                    waiting.append(its)
                elif why in (chip.FORK, chip.BUTTON):
                    waiting += self._both(its, why)
                elif why == chip.CUT:
                    self._compare(its)
                else:
                    raise self._refused(its[0], chip.REASONS[why])
            if self._run > MAX_CYCLES or self._compared > MAX_COMPARED:
                raise self._refused(rows[0], "more cycles, or comparisons of states, than are allowed")
            if self._forks > MAX_FORKS or sum(map(len, waiting)) > MAX_ROWS:
                raise self._refused(rows[0], "more ways than can be followed")

    def _next_frame(self, rows: Ints) -> Ints:
        """Return the rows in their next frames."""

        def after(place: Place, _: int) -> Place | None:
            if self._inputs & ~place.sampled:
                return None
            return Place(self._plan.after(place.position, place.levels | self._held))

        self._frames += len(rows)
        self._move(rows, np.zeros(len(rows), dtype=np.int64), after, "an input was not read in the frame")
        over = rows[:, PLACE] == self._number(Place(OVER))
        rows[:, chip.FRAME] = np.where(over, chip.NEVER, rows[:, chip.FRAME] + self._plan.period)
        rows[:, chip.EDGE] = 0
        return rows

    def _both(self, rows: Ints, why: int) -> list[Ints]:
        """Return the rows with the lowest bit in question 0, and with it 1."""
        self._forks += len(rows)
        both = [rows, rows.copy()]
        slot, bit = rows[:, chip.ASKED], rows[:, chip.ASKED_BITS] & -rows[:, chip.ASKED_BITS]
        given = np.isin(slot, (chip.NOWHERE, chip.PORTA, chip.PORTB))
        stored = np.flatnonzero(~given), slot[~given]
        pin = np.where(slot == chip.PORTB, bit << 5, bit)
        for level, its in enumerate(both):
            its[given, chip.GIVEN] |= bit[given]
            its[given, chip.GIVEN_BITS] |= bit[given] * level
            its[stored] = its[stored] & ~(bit[~given] << 8) | bit[~given] * level
            if why == chip.BUTTON:
                framed = np.isin(its[:, chip.FRAME], (chip.BEFORE, chip.NEVER), invert=True)
                sample = partial(self._plan.sample, level=level)
                self._move(its, np.where(framed, pin, 0), sample, "an input is read again")
        return both

    def _move(
        self, rows: Ints, pins: Ints, change: Callable[[Place, int], Place | None], reason: str
    ) -> None:
        """Change the rows' places in the plan by the pins that are read. Raises Refused where that fails."""
        keys, which = np.unique(rows[:, PLACE] << len(PINS) | pins, return_inverse=True)
        moved = np.zeros((len(keys), 2), dtype=np.int64)
        for number, key in enumerate(keys.tolist()):
            place = change(self._place_of[key >> len(PINS)], key & (1 << len(PINS)) - 1)
            if place is None:
                raise self._refused(rows[which == number][0], reason)
            moved[number] = self._number(place), self._plan.run_of(place.position)
        rows[:, [PLACE, chip.DUE]] = moved[which]

    def _compare(self, rows: Ints) -> None:
        """Raise Refused for a row that is within no listed state."""
        there = rows.copy()
        for row in there:
            chip.rebase(row)
        for row, inner, key in zip(rows, there, there[:, EXACT].copy(), strict=True):
            for number in self._at.get(key.tobytes(), ()):
                self._compared += 1
                if chip.within(inner, self._states[number], chip.BYTES):
                    break
            else:
                raise self._refused(row, "the state is within no listed one")

    def _refused(self, row: Ints, reason: str) -> Refused:
        """Return what is wrong, and where."""
        frame = "before the first pulse"
        if row[chip.FRAME] != chip.BEFORE:
            number = self._place_of[row[PLACE]].position.frame
            frame = f"frame {number}, cycle {row[chip.CYCLE] - row[chip.FRAME]}"
        if row[chip.FRAME] == chip.NEVER:
            frame = "after the last pulse"
        origin = "power-up" if row[ORIGIN] < 0 else f"state {row[ORIGIN]}"
        high = " ".join(pin for bit, pin in enumerate(PINS) if chip.pins(row) >> bit & 1) or "none"
        where = f"{row[chip.CYCLE]} cycles after {origin}, at address 0x{row[chip.PC]:03X}, {frame}"
        return Refused(f"{where}, high pins: {high}: {reason}")


def check_certificate(certificate: Certificate, image: Image, schedule: bytes, file: str) -> Checked:
    """Return what was run to check the certificate of a program against a schedule, the contents of `file`.

    Raises Refused if the certificate does not prove it, InputError if the file has no schedule.
    """
    plan = read_plan(schedule, file)
    if certificate.image != fingerprint(image):
        raise Refused("the certificate is of another program")
    config = RC if image.config is None else image.config
    if plan.clock_hz > FASTEST[config & RC]:
        raise Refused("the oscillator that the configuration word selects has no exact frequency")
    if certificate.schedule != hashlib.sha256(schedule).hexdigest() or certificate.clock_hz != plan.clock_hz:
        raise Refused("the certificate is of another schedule")
    return Checker(image, plan, certificate).check()
