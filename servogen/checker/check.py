"""Checks a certificate: every run of every chip passes through its states, with the scheduled edges.

In: a program, a schedule's plan, a certificate. Out: what was run, or `Refused`, which says where and why.
The chip is run from power-up, and from each listed state, with all its unknown bits, to the next of the
certificate's cuts, once for each value of every bit on which its course depends. The state there must be
within a listed one, with the same position in the plan. So, by induction, these runs are all runs; every edge
of every pin in them is compared.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np

from servogen.checker import chip
from servogen.checker.certificate import Certificate, chip_state, fingerprint
from servogen.checker.plan import OVER, PINS, Plan, Position, read_plan
from servogen.pic.image import Image
from servogen.units import Clock

Ints = chip.Ints
SAME = np.array([chip.PC, chip.DEPTH, chip.OPTION, chip.TRISA, chip.TRISB, chip.EDGE, chip.OUT])
MAX_PERIODS, MAX_FORKS, MAX_CYCLES, MAX_COMPARED = 500, 20_000, 20_000_000_000, 50_000_000
"""Of a way between two cuts, the splits after one state, all cycles, and all comparisons of states."""
RC, FASTEST = 3, (200_000, 4_000_000, 20_000_000, 0)
"""Bits of the configuration word, and the largest clocks of LP, XT, HS and RC in Hz (section 6.2)."""
WATCHDOG_US, WATCHDOG_ON = 7_000, 4
"""The shortest period (DS35007 parameter 31) and the bit of the configuration word."""


class Refused(Exception):
    """The certificate does not prove that the edges are the schedule's; the text says where and why."""


@dataclass(frozen=True)
class Checked:
    """How much was run: listed states, frames, cycles, and ways that were split."""

    states: int
    frames: int
    cycles: int
    forks: int


@dataclass
class Run:
    """The chip in a run, its position in the plan, and the inputs read in this frame; the buttons' levels."""

    state: Ints
    position: Position
    levels: int = 0
    sampled: int = 0


class Checker:
    """Runs the chip from power-up and from the listed states."""

    def __init__(self, image: Image, plan: Plan, certificate: Certificate) -> None:
        if plan.line and PINS[plan.line.pin] in certificate.held:
            plan = replace(plan, line=None)
        self._plan, self._certificate = plan, certificate
        self._code = chip.program_code(image, certificate.cuts)
        self._parameters = np.zeros(chip.PARAMETERS, dtype=np.int64)
        held = certificate.held
        for slot, value in (
            (chip.CHANNELS, plan.channels),
            (chip.BUTTONS, plan.buttons & ~sum(1 << PINS.index(pin) for pin in held)),
            (chip.HELD, sum(1 << PINS.index(pin) for pin in held)),
            (chip.LEVELS, sum(level << PINS.index(pin) for pin, level in held.items())),
            (chip.EEPROM, [image.eeprom.get(cell, 0xFF) for cell in range(64)]),
        ):
            self._parameters[slot : slot + np.size(value)] = value
        if image.config is None or image.config & WATCHDOG_ON:
            self._parameters[chip.WATCHDOG] = int(WATCHDOG_US / Clock(plan.clock_hz).cycle_us)
        self._states: list[Run] = []
        self._at: dict[tuple[object, ...], list[Ints]] = defaultdict(list)
        self._frames = self._cycles = self._forks = self._compared = 0

    def check(self) -> Checked:
        """Run from power-up and from each listed state. Raises Refused."""
        for number in range(self._certificate.count):
            found = chip_state(self._certificate.columns, number, self._plan)
            if found is None:
                raise Refused(f"state {number}: the schedule has no such position, or the chip no such state")
            run = Run(*found)
            if chip.sample(run.state.copy(), 0) != chip.GOES_ON:
                raise Refused(f"state {number}: {chip.REASONS[chip.INTERRUPT]}")
            run.state[chip.WDT_DUE] = chip.NEVER
            chip.plan_time_out(run.state, self._parameters, 0, 0)
            self._states.append(run)
            self._at[self._key(run)].append(run.state)
        self._explore("power-up", Run(self._power_up(), self._plan.first))
        for number, run in enumerate(self._states):
            self._explore(f"state {number}", run)
        return Checked(len(self._states), self._frames, self._cycles, self._forks)

    def _power_up(self) -> Ints:
        """Return the state after any reset: what DS35007 table 6-4 does not define is unknown."""
        s = np.zeros(chip.SLOTS, dtype=np.int64)
        s[chip.BYTES] = chip.UNKNOWN
        s[[chip.PORTA, chip.STATUS]] = 0x1F00  # TO and PD differ between resets
        s[[chip.PCLATH, chip.INTCON, chip.EECON1]] = 0, 0, 0x0800
        s[[chip.OPTION, chip.TRISA, chip.TRISB, chip.FRAME]] = 0xFF, 0x1F, 0xFF, chip.BEFORE
        s[[chip.T0_DUE, chip.IRQ, chip.WDT_DUE, chip.DARK]] = chip.NEVER
        chip.plan_time_out(s, self._parameters, 0, 0)
        return s

    def _explore(self, name: str, start: Run) -> None:
        """Run from `start` to the next cuts, on every way. Raises Refused."""
        runs = [Run(start.state.copy(), start.position, start.levels, start.sampled)]
        forks = self._forks
        while runs:
            run = runs.pop()
            why = self._to_cut(run)
            button = self._button(run) if why == chip.BUTTON else 0
            if why == chip.FORK or (why == chip.BUTTON and not run.sampled & button):
                self._forks += 1
                runs += self._both(run, button)
                reason = "more ways than can be followed" if self._forks - forks > MAX_FORKS else ""
            elif why == chip.CUT and self._covered(run):
                reason = ""
            elif why == chip.CUT:
                reason = "the state is within no listed one"
            elif why == chip.NEW_FRAME:
                reason = "an input was not read in the frame"
            else:
                reason = "an input is read again" if why == chip.BUTTON else chip.REASONS[why]
            if self._cycles > MAX_CYCLES or self._compared > MAX_COMPARED:
                reason = "more cycles, or comparisons of states, than are allowed"
            if reason:
                raise Refused(self._place(name, run, reason))

    def _place(self, name: str, run: Run, reason: str) -> str:
        s = run.state
        frame = "before the first pulse"
        if s[chip.FRAME] != chip.BEFORE:
            frame = f"frame {run.position.frame}, cycle {s[chip.CYCLE] - s[chip.FRAME]}"
        high = " ".join(pin for bit, pin in enumerate(PINS) if chip.pins(s) >> bit & 1) or "none"
        where = f"{s[chip.CYCLE]} cycles after {name}, at address 0x{s[chip.PC]:03X}, {frame}"
        return f"{where}, high pins: {high}: {reason}"

    def _to_cut(self, run: Run) -> int:
        """Run to a cut, a fork or the first thing that is wrong; return why."""
        s, parameters, plan = run.state, self._parameters, self._plan
        began = int(s[chip.CYCLE])
        why = chip.NEW_FRAME
        while why == chip.NEW_FRAME:
            at, out = plan.due(run.position)
            parameters[chip.EDGES] = len(at)
            parameters[chip.PERIOD] = chip.NEVER if run.position == OVER else plan.period
            parameters[chip.LIMIT] = began + MAX_PERIODS * plan.period
            why = chip.run(s, self._code, parameters, at, out)
            if why == chip.NEW_FRAME:
                if self._parameters[chip.BUTTONS] & ~run.sampled:
                    break
                levels = run.levels | int(parameters[chip.LEVELS])
                run.position = plan.after(run.position, levels)
                run.levels = run.sampled = 0
                s[chip.FRAME] += plan.period
                s[chip.EDGE] = 0
                self._frames += 1
        self._cycles += int(s[chip.CYCLE]) - began
        return int(why)

    def _button(self, run: Run) -> int:
        """Return the pin of the button that is read, if this is a frame's sample."""
        if run.state[chip.FRAME] == chip.BEFORE or run.position == OVER:
            return 0
        bits = int(run.state[chip.ASKED_BITS])
        return (bits & -bits) << (5 if run.state[chip.ASKED] == chip.PORTB else 0)

    def _both(self, run: Run, button: int) -> list[Run]:
        """Return the run with the lowest bit in question 0, and with it 1."""
        slot, bits = int(run.state[chip.ASKED]), int(run.state[chip.ASKED_BITS])
        bit = bits & -bits
        both = []
        for value in (0, bit):
            s = run.state.copy()
            if slot in (chip.NOWHERE, chip.PORTA, chip.PORTB):
                s[chip.GIVEN] |= bit
                s[chip.GIVEN_BITS] |= value
            else:
                s[slot] = s[slot] & ~(bit << 8) | value
            position, levels = run.position, run.levels
            if button and self._plan.line:
                position = self._plan.hear(position, self._plan.line, int(value != 0))
            elif value:
                levels |= button
            both.append(Run(s, position, levels, run.sampled | button))
        return both

    def _key(self, run: Run) -> tuple[object, ...]:
        """Return what must be the same in a run's state and in the listed one that contains it."""
        s = run.state
        stack = s[chip.STACK : chip.STACK + s[chip.DEPTH]].tolist()
        frame = int(s[chip.FRAME] - s[chip.CYCLE]) if s[chip.FRAME] != chip.BEFORE else None
        position: tuple[object, ...] = (run.position, run.levels, run.sampled, frame)
        if run.position == OVER:
            position = ()
        return (*s[SAME].tolist(), *stack, _until(s, chip.IRQ), _until(s, chip.DARK), position)

    def _covered(self, run: Run) -> bool:
        """Return whether a listed state contains every chip of the run's."""
        s = run.state.copy()
        chip.settle(s)
        for listed in self._at.get(self._key(run), ()):
            self._compared += 1
            if chip.within(s, listed, chip.BYTES):
                return True
        return False


def _until(s: Ints, slot: int) -> int:
    return int(s[slot] - s[chip.CYCLE]) if s[slot] != chip.NEVER else chip.NEVER


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
