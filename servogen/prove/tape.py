"""The EEPROM of a tape beside a prover's chip: it may have been left in any state.

In: the levels that the chip gives SCL and SDA. Out: those of SDA that such an EEPROM may answer.

    any state ──a start that it has seen──▶ the model of its data sheet (`simulator.eeprom24`)
        ▲──────a time that is too short, a read without an address, a level that is not known──────╯

In any state SDA may be low or high. It stays as it is while SCL is high, and is low for at most `MOST_LOW`
clocks on end in which the chip lets go of it: an acknowledge, then eight bits that are 0, which the chip
does not acknowledge. That SDA is high is seen by a bit test only. While SCL is low what is read is not
known, so every time up to TAA (900 ns, parameter 13), within which the EEPROM changes SDA, is covered.
"""

from __future__ import annotations

import ctypes
from typing import Any

from servogen.edges import PINS
from servogen.pulse.schedule import TapeRule
from servogen.simulator.devices import React
from servogen.simulator.eeprom24 import EEPROM24, SCL, SDA, Limit, Phase, RunningEEPROM
from servogen.units import Clock

MOST_LOW = 9


class LeftEEPROM(RunningEEPROM):
    """An EEPROM of which is known what follows from the bus; its pin WP is high."""

    def __init__(self, content: bytes, part: str, clock: Clock) -> None:
        super().__init__(EEPROM24(content, part, protected=True), clock)
        self._known = False
        """Whether it is in the one state that the model is in."""
        self._addressed = False
        """Whether its address counter was written since then."""
        self._steady = False
        """Whether SDA was in time before SCL's latest rise."""
        self._seen = -1
        """The level of SDA that was read since then."""
        self._lows = 0
        """The clocks on end in which it was read low."""

    @property
    def left(self) -> tuple[bool, bool, bool, int, int]:
        """What is known of it, beside the state of the model."""
        return self._known, self._addressed, self._steady, self._seen, self._lows

    @left.setter
    def left(self, left: tuple[bool, bool, bool, int, int]) -> None:
        self._known, self._addressed, self._steady, self._seen, self._lows = left

    @property
    def clock(self) -> int | None:
        """Return nine times the address of the byte that it gives, and the clocks of it so far, while SCL is
        low, and has been; None in other states.
        """
        changed = max(self._scl_at, self._sda_at, self._start_at)
        settled = self._known and not self._levels & SCL and changed <= -(self._low + self._free)
        if not settled or self._phase is not Phase.READING or (self._pulls and self._bits == 8):
            return None
        return (self._pointer - 1) % self.size * 9 + self._bits

    def saw(self, level: int) -> bool:
        """Take the level of SDA that the chip reads; return whether an EEPROM may give it."""
        if not (self._steady and self._levels & SCL):
            return True
        if self._seen < 0 and not level:
            self._lows += 1
        possible = level == self._seen or (self._seen < 0 and self._lows <= MOST_LOW)
        self._seen = level
        return possible

    def react(self, cycle: int, levels: int) -> int:
        """Take the levels of the lines, above them those that the chip drives, or drove until now, to an
        unknown one; return the lines pulled low, and above them those whose level is known.
        """
        doubt, levels = levels >> 2, levels & (SCL | SDA)
        changed = levels & ~self._pulls ^ self._levels
        if changed & SCL:
            if not levels & SCL and self._seen != 0:
                self._lows = 0
            self._seen, self._steady = -1, bool(levels & SCL)
        if changed == SCL | SDA:
            self._forget()  # which of both changes it sees first is not certain
        if doubt:
            self._forget()
            self._scl_at = self._sda_at = cycle  # the latest cycle in which they may have changed
        super().react(cycle, levels & ~self._pulls)
        if not levels & SDA:
            self._lows = 0
        if self._phase in (Phase.LOW, Phase.WRITING):
            self._addressed = self._phase is Phase.WRITING and not self._received
        if self._phase is Phase.READING and not self._addressed:
            self._forget()
        if not self._known:
            self._phase, self._bits, self._pulls = Phase.STANDBY, 0, 0
        super().react(cycle, levels & ~self._pulls)  # what it pulls itself is a level, too
        return self._pulls | SDA << 2 if self._known and levels & SCL else 0

    def _started(self, cycle: int) -> None:
        # A device lets SDA rise and fall while SCL is low only: the chip has made this start.
        self._known = self._known or self._seen == 1
        # What becomes of the address counter within a byte the data sheet does not say.
        self._addressed = self._addressed and self._phase is Phase.WRITING and self._bits == 1
        super()._started(cycle)

    def _give(self) -> None:
        if self._bits == 0 and self._pointer >= len(self._device.content):
            self._forget()  # only the bytes of the tape are known
        super()._give()

    def _remark(self, cycle: int, limit: Limit, cycles: int) -> None:
        self._forget()

    def _forget(self) -> None:
        self._known, self._steady, self._seen, self._lows = False, False, -1, 0


class TapeBeside:
    """The EEPROM on the pins of a prover's chip; its states are numbers."""

    def __init__(self, tape: TapeRule, clock: Clock) -> None:
        self._scl, self._sda = PINS.index(tape.scl), PINS.index(tape.sda)
        self.pins = 1 << self._scl | 1 << self._sda
        self._eeprom = LeftEEPROM(tape.content, tape.eeprom, clock)
        self._told, self._answer = self.pins, 0
        self._callback = React(self._react)
        self.address = ctypes.cast(self._callback, ctypes.c_void_p).value or 0
        """The address of the function that the instruction loop calls."""
        self._states: list[Any] = []
        self._numbers: dict[Any, int] = {}
        self._now = 0
        self.number(0)  # the state after any reset is number 0

    def load(self, number: int, now: int) -> tuple[int, int]:
        """Go to a state; return the levels that it was told of, and its answer."""
        state, self._eeprom.left, self._told, self._answer = self._states[number]
        self._eeprom.restore(state)
        self._now = now
        return self._told, self._answer

    def number(self, now: int) -> int:
        """Return the number of the state in a cycle."""
        model = self._eeprom.relative(now - self._now)
        state = model, self._eeprom.left, self._told, self._answer
        number = self._numbers.setdefault(state, len(self._states))
        if number == len(self._states):
            self._states.append(state)
        return number

    def clock(self, number: int) -> int | None:
        """Return where on the tape the EEPROM is in a state: see `LeftEEPROM.clock`."""
        self.load(number, 0)
        return self._eeprom.clock

    def saw(self, pins: int, levels: int) -> bool:
        """Take the levels of pins that the chip reads; return whether they may be such."""
        return not pins >> self._sda & 1 or self._eeprom.saw(levels >> self._sda & 1)

    def _react(self, cycle: int, pins: int) -> int:
        doubt = (self._told | pins) >> len(PINS)
        self._told = pins
        lines = pins >> self._scl & 1 | (pins >> self._sda & 1) << 1
        lines |= (doubt >> self._scl & 1) << 2 | (doubt >> self._sda & 1) << 3
        answer = self._eeprom.react(cycle - self._now, lines)
        self._answer = (answer >> 1 & 1) << self._sda | (answer >> 3 & 1) << self._sda + len(PINS)
        return self._answer
