"""Checks that a program keeps a contract, in every run of every chip: the second witness of such a proof.

In: a program, the text of a contract, the clock, and hints: addresses with what may be forgotten there, and
the pins that the program does not drive. Out: what was run, or `Refused`.

The chip is run from power-up with all its unknown bits, once for each value of every bit on which its course
depends. At a hint's address registers are forgotten: then they have any value, which is more chips, not
fewer. Where a state is as one that was followed, with a watch in no worse state, so is all that follows. When
no other state is left, these runs are all runs. So a hint that is wrong ends in a refusal.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from hashlib import blake2b

import numpy as np

from servogen.checker import chip, layout
from servogen.checker.certificate import RAM
from servogen.checker.check import (
    MAX_CYCLES,
    OUTSIDE,
    Checked,
    NotCovered,
    Refused,
    unfit_clock,
    watchdog_cycles,
)
from servogen.checker.plan import PINS
from servogen.checker.watches import ClauseBroken, ClauseWatch, Numbers, Uncovered, read_watches
from servogen.pic.image import Image
from servogen.units import Clock

Ints = chip.Ints
FORGOTTEN = {**RAM, **{row.name: row.slot for row in layout.REGISTERS if row.may_move}}
"""The cells that a hint may name, beside "flags" and "pin_flags"."""
LONGEST_S = 20
"""Without a stop."""
LONGEST_WRITE_US = 20_000
"""An EEPROM write (DS30430 parameter D122)."""
MAX_STOPS = 100_000
UNCOVERED = (*OUTSIDE, layout.DARK_PIN, layout.TOO_LONG)
ASYNCHRONOUS = (layout.EVERY_FLAG ^ layout.T0IF) * (1 | 1 << layout.IS_NOP)
"""Ways of what may interrupt, but TMR0."""
GONE = [layout.TIME, layout.ASKED, layout.ASKED_BITS]
AGES = [layout.AGE, layout.WRITE_LEFT]
"""A watchdog that was cleared earlier, and a write that is over later, are worse."""


@dataclass(frozen=True, slots=True)
class Hints:
    """What a search found out, none of which is trusted."""

    cuts: Mapping[int, Collection[str]]
    """What may be forgotten at addresses."""
    inputs: int
    """The pins of the contract that the program does not drive, as a word."""


class ContractChecker:
    """Runs the chip from power-up beside one watch after the other."""

    def __init__(self, image: Image, clock: Clock, hints: Hints, any_eeprom: bool = False) -> None:
        self._hints = hints
        self.memory = chip.memory_of(image, frozenset(hints.cuts), any_eeprom)
        self._board = layout.ChipSurroundings(
            **dict.fromkeys(("period", "channels", "buttons", "held", "levels"), 0),
            limit=int(LONGEST_S * clock.cycles_per_second),
            watchdog=watchdog_cycles(image, clock),
            longest_write=int(LONGEST_WRITE_US / clock.cycle_us) + 1,
        )
        self._used, self._none = np.zeros((2, layout.SLOTS), dtype=np.int64)
        self.stops = self.cycles = self.forks = 0

    def follow(self, watch: ClauseWatch) -> None:
        """Follow every chip from power-up on every way. Raises Refused.

        Where the level of an output is not known for too long, again for each level of the latches.
        """
        try:
            self._follow(watch, 0)
        except NotCovered as stopped:
            if stopped.what != layout.REASONS[layout.DARK_PIN]:
                raise
            self._follow(watch, watch.pins)

    def _follow(self, watch: ClauseWatch, told: int) -> None:
        """Follow every chip, those apart whose latches of the pins `told` differ."""
        board = self._board._replace(channels=watch.pins, buttons=watch.asks)
        known: dict[bytes, list[Numbers]] = defaultdict(list)
        todo, driven = [(s, watch.start()) for s in _after_reset(told)], 0
        while todo:
            s, state = todo.pop()
            if not self._is_new(s, *watch.split(state), known):
                continue
            levels, begun = int(s[layout.EDGE]), int(s[layout.CYCLE])
            why = chip.run(s, self._used, self._none[:0], self._none[:0], self.memory, board)
            now, at, driven = int(s[layout.CYCLE]), int(s[layout.TIME]), driven | int(s[layout.DRIVEN])
            self.stops, self.cycles = self.stops + 1, self.cycles + now - begun
            where = f"{watch.text}: at address 0x{int(s[layout.PC]):03X}"
            if driven & self._hints.inputs:
                raise NotCovered(f"{_names(driven & self._hints.inputs)} is driven", where)
            if self.stops > MAX_STOPS or self.cycles > MAX_CYCLES:
                raise NotCovered("more states, or cycles, than are allowed", where)
            try:
                if s[layout.EDGE] != levels:
                    state = watch.change(watch.wait(state, at - begun), levels, int(s[layout.EDGE]))
                    begun = at
                todo += self._ways(s, why, watch, watch.wait(state, now - begun), where)
            except ClauseBroken as breach:
                raise Refused(f"{where}: {breach}") from None
        if watch.pins & ~driven:
            raise Refused(f"{watch.text}: the program never drives {_names(watch.pins & ~driven)}")

    def _is_new(self, s: Ints, kind: Numbers, times: Numbers, known: dict[bytes, list[Numbers]]) -> bool:
        """Note a state; return whether no state that is as bad was noted before."""
        s[GONE] = 0
        if not self._board.watchdog:
            s[layout.AGE] = 0
        same, times = s.copy(), (*s[AGES].tolist(), *times)
        same[AGES] = 0
        key = blake2b(same.tobytes() + repr(kind).encode(), digest_size=16).digest()
        if any(all(map(int.__ge__, its, times)) for its in known[key]):
            return False
        known[key] = [its for its in known[key] if not all(map(int.__le__, its, times))] + [times]
        return True

    def _ways(
        self, s: Ints, why: int, watch: ClauseWatch, state: Numbers, where: str
    ) -> list[tuple[Ints, Numbers]]:
        """Return the states with which it goes on after a stop. Raises Refused, ClauseBroken."""
        s[layout.CYCLE] = 0 if why == layout.CUT else min(s[layout.CYCLE], 1)  # a run that begins with a cut
        if why == layout.CUT:
            self._forget(s)
        if why in (layout.CUT, layout.PIN_CHANGE):
            return [(s, state)]
        self.forks += 1
        slot, bits = s[[layout.ASKED, layout.ASKED_BITS]].tolist()
        if why in (layout.FORK, layout.BUTTON):
            cell = layout.CHOSEN if why == layout.BUTTON else slot
            ways = [s, s.copy()]
            for level, its in enumerate(ways):
                its[cell] = its[cell] & ~(bits << 8) | bits * level
            read = watch.read if why == layout.BUTTON else lambda state, level: state
            return [(its, read(state, level)) for level, its in enumerate(ways)]
        if why not in (layout.MAY_INTERRUPT, layout.MAY_BE_WRITTEN, layout.SLEEPS):
            if why in UNCOVERED:
                raise NotCovered(layout.REASONS[why], where)
            raise Refused(f"{where}: {layout.REASONS[why]}")
        if watch.reads and (why == layout.SLEEPS or (why == layout.MAY_INTERRUPT and bits & ASYNCHRONOUS)):
            raise NotCovered("an input of a program that something other than TMR0 interrupts", where)
        happened = []
        for way in (1 << bit for bit in range(bits.bit_length()) if bits >> bit & 1):
            its = s.copy()
            its[layout.WAY] = way
            sleeps = why == layout.SLEEPS and not way & layout.EVERY_FLAG << layout.IS_NOP
            happened.append((its, watch.rest(state) if sleeps else state))
        return [way for way in happened if way[0][layout.WAY] != layout.ENDLESS]

    def _forget(self, s: Ints) -> None:
        """Forget what the hints name at this address."""
        for name in self._hints.cuts[int(s[layout.PC])]:
            if name == "flags":
                s[layout.STATUS] = s[layout.STATUS] & ~0x7 | 0x700
            elif name == "pin_flags":
                idle = s[layout.TMR0] == layout.UNKNOWN and not s[layout.INTCON] & layout.T0IE
                free = ~(s[layout.INTCON] >> 3) & (layout.INTF | layout.RBIF) | layout.T0IF * idle
                s[layout.INTCON] = s[layout.INTCON] & ~free | free << 8
            else:
                s[FORGOTTEN[name]] = layout.UNKNOWN


def _after_reset(told: int) -> Iterator[Ints]:
    """Yield the chip after a reset, once for each level of the latches of the pins `told`."""
    high = 0
    while True:
        s = chip.after_reset(layout.WATCHES)
        for slot, shift, used in ((layout.PORTA, 0, 0x1F), (layout.PORTB, 5, 0xFF)):
            s[slot] = s[slot] & ~((told >> shift & used) << 8) | high >> shift & used
        yield s
        high = (high - told) & told  # the next of the subsets
        if not high:
            return


def _names(pins: int) -> str:
    return ", ".join(name for pin, name in enumerate(PINS) if pins >> pin & 1)


def check_contract(image: Image, contract: str, clock: Clock, hints: Hints) -> Checked:
    """Return what was run to show that a program keeps a contract. Raises Refused, NotCovered."""
    unfit = unfit_clock(image, clock.hz)
    if unfit:
        raise NotCovered(unfit, "the configuration word")
    try:
        watches = read_watches(contract, Fraction(clock.cycles_per_second), hints.inputs)
    except Uncovered as what:
        raise NotCovered(str(what), "the contract") from None
    except (LookupError, TypeError, ValueError) as error:
        raise NotCovered(f"what it cannot read ({error})", "the contract") from None
    for any_eeprom in (False, True):
        checker = ContractChecker(image, clock, hints, any_eeprom)
        for watch in watches:
            checker.follow(watch)
        if not checker.memory.eeprom[[layout.EEPROM_READ, layout.EEPROM_WRITTEN]].all():
            break  # else what it reads may be what it has written in any run
    return Checked(checker.stops, 0, checker.cycles, checker.forks)
