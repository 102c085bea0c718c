"""Generalisation of states at cut points: bytes that are overwritten before they are read become unknown, and
so does TMR0's phase.

In: cut points, and a guess of what is dead there. Out: more general states. A guess needs no proof: the
search continues from the general state, so whatever follows holds for all of its chips. If something
general decides after all, `blamed` finds out what, and keeps it from then on.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from servogen.pic.device import RAM_FIRST, masks
from servogen.prove.chip import (
    ALL_UNKNOWN,
    BASE,
    CELL_PHASED,
    FIELD,
    FREE_BYTES,
    TIME_FIELDS,
    UNCERTAIN,
    ChipState,
    Reason,
    Use,
)
from servogen.prove.nodes import Decision, Node
from servogen.prove.transitions import Ram, Transitions, applied
from servogen.simulator import layout
from servogen.simulator.layout import INTF, PS, PSA, RBIF, T0CS, T0IE, T0IF

BYTES = tuple(name for name in FREE_BYTES if name not in TIME_FIELDS)
"""Bytes that only the program changes."""
REGISTERS = (*BYTES, "FLAGS", "TIMER", "PRESCALER", "PIN_FLAGS")
"""What is general beside the RAM, unless it is kept."""
PHASE = "PHASE"
INTE, RBIE = masks("INTE", "RBIE")
FLAGS = 0x07
PATIENCE = 5
"""How often a use at one address is looked into without finding anything to blame."""
MAX_ADDRESSES = 60
"""Addresses at which there was nothing to blame: from then on uses are not what was generalised."""


@dataclass(slots=True)
class Guess:
    """What is general at one cut point."""

    dead: set[int] = field(default_factory=set)
    """Places in the RAM."""
    phased: set[int] | None = None
    """Places in the RAM whose distance from TMR0 counts, not they themselves; None: TMR0 is kept as it is."""
    registers: set[str] = field(default_factory=lambda: set(REGISTERS))

    def drop(self, place: str) -> None:
        """Keep a place as it is from now on."""
        if place == PHASE:
            self.phased = None
        elif place.startswith("0x"):
            self.dead.discard(int(place, 16))
        else:
            self.registers.discard(place)


class Generaliser:
    """Makes the states at cut points general."""

    def __init__(self, transitions: Transitions, guesses: dict[int, Guess]) -> None:
        self.guesses = guesses
        self._transitions = transitions
        self._rests: dict[int, tuple[int, int, int]] = {}
        self._innocent: dict[int, int] = {}

    @property
    def cuts(self) -> dict[int, Guess]:
        """Return the cut points with what is general at each."""
        return self.guesses

    def add_cut(self, pc: int) -> None:
        """Cut at `pc` too, without making anything general there."""
        self.guesses[pc] = Guess(registers=set())

    def keep_all(self) -> None:
        """Keep everything as it is at each cut from now on."""
        for pc in self.guesses:
            self.add_cut(pc)
        self._rests.clear()

    def generalised(self, ram: Ram, rest: int) -> tuple[Ram, int]:
        """Return a state that covers this one."""
        guess = self.guesses[self._transitions.pc(rest)]
        generalised = self._rests.get(rest)
        if generalised is None:
            generalised = self._rests[rest] = self._general_rest(rest, guess)
        general, timer, moved = generalised
        cells = list(ram)
        # If one of these is read after all, it decides nothing, or it stops the run with a use that `blamed`
        # looks into: a wrong guess is found out.
        for place in guess.dead:
            cells[place] = ALL_UNKNOWN
        if moved:
            cells = [(cell - moved & 0xFF) | CELL_PHASED if cell >= CELL_PHASED else cell for cell in cells]
        if timer >= 0 and guess.phased is not None:
            for place in guess.phased:
                if cells[place] <= 0xFF:
                    cells[place] = (cells[place] - timer & 0xFF) | CELL_PHASED
        return tuple(cells), general

    def covering(self, state: ChipState) -> ChipState:
        """Return a state that covers this one."""
        ram, rest = self.generalised(state.ram, self._transitions.number(state.rest))
        return ChipState(ram, self._transitions.rest(rest))

    def _general_rest(self, number: int, guess: Guess) -> tuple[int, int, int]:
        """Return the state beside the RAM; TMR0 if it becomes phased, else -1; TMR0 less φ if it was phased.

        From then on φ is what TMR0 reads at this moment.
        """
        rest = list(self._transitions.rest(number))
        timer = -1

        def put(**fields: int) -> None:
            for name, value in fields.items():
                rest[FIELD[name]] = value

        def get(name: str) -> int:
            return rest[FIELD[name]]

        for name in BYTES:
            if name in guess.registers:
                put(**{name: 0, UNCERTAIN[name].unknown_name: 0xFF})
        if "FLAGS" in guess.registers:
            put(STATUS=get("STATUS") & ~FLAGS, STATUS_UNKNOWN=get("STATUS_UNKNOWN") | FLAGS)
        if "PIN_FLAGS" in guess.registers:
            flags = (0 if get("INTCON") & INTE else INTF) | (0 if get("INTCON") & RBIE else RBIF)
            put(INTCON=get("INTCON") & ~flags, INTCON_UNKNOWN=get("INTCON_UNKNOWN") | flags)
        # Only without its interrupt may the time of an overflow be forgotten: otherwise it decides when
        # the program is interrupted.
        quiet = not get("INTCON") & T0IE
        if "TIMER" in guess.registers and quiet and get("TMR0_UNKNOWN") == 0xFF:
            put(INTCON=get("INTCON") & ~T0IF, INTCON_UNKNOWN=get("INTCON_UNKNOWN") | T0IF)
            put(T0_AT=BASE, T0_HELD=BASE)
            if not get("OPTION") & PSA:
                put(PRESCALER=0, PRESCALER_UNKNOWN=0xFF)
        if "PRESCALER" in guess.registers and not get("OPTION") & PSA:
            idle = -(2 << (get("OPTION") & PS)) & 0xFF  # bits that do not reach TMR0
            put(PRESCALER=get("PRESCALER") & ~idle, PRESCALER_UNKNOWN=get("PRESCALER_UNKNOWN") | idle)
        if guess.phased is not None and quiet and not get("TMR0_UNKNOWN") and not get("OPTION") & T0CS:
            timer = get("TMR0")
            put(TMR0=0, TMR0_UNKNOWN=layout.PHASED, T0_FLAGGED=-1)
        # φ becomes what TMR0 reads now. Everything relative to the old φ is moved by the difference, so
        # that states that differ in the phase only become the same.
        moved = 0
        if get("TMR0_UNKNOWN") == layout.PHASED:
            moved = get("TMR0")
            for name in BYTES:
                if get(UNCERTAIN[name].unknown_name) == layout.PHASED:
                    put(**{name: get(name) - moved & 0xFF})
            put(TMR0=0)
            if quiet:
                put(INTCON=get("INTCON") & ~T0IF, INTCON_UNKNOWN=get("INTCON_UNKNOWN") | T0IF)
        return self._transitions.number(tuple(rest)), timer, moved

    def blamed(self, node: Node, decisions: tuple[Decision, ...], cycle: int, use: Use) -> bool:
        """Return whether something general at `node` decides at `use`, `cycle` cycles later; keep it then."""
        if self._innocent.get(use.address, 0) >= PATIENCE or len(self._innocent) > MAX_ADDRESSES:
            return False
        guess = self.guesses[self._transitions.pc(node.rest)]
        suspects = [*self._suspects(node, guess)]
        # Each alone first. If none alone is to blame, a combination may be: then all are kept.
        guilty = [place for place in suspects if not self._decides(node, [place], decisions, cycle)]
        if not guilty and suspects and not self._decides(node, suspects, decisions, cycle):
            guilty = suspects
        for place in guilty:
            guess.drop(place)
        if guilty:
            self._rests.clear()
        else:
            self._innocent[use.address] = self._innocent.get(use.address, 0) + 1
        return bool(guilty)

    def _suspects(self, node: Node, guess: Guess) -> Iterable[str]:
        for place in sorted(guess.dead):
            if node.raw[0][place] != node.ram[place]:
                yield f"0x{place:02X}"
        yield from sorted(guess.registers)
        if guess.phased is not None:
            yield PHASE

    def _decides(self, node: Node, restored: list[str], decisions: tuple[Decision, ...], cycle: int) -> bool:
        """Return whether an unknown bit decides at `cycle`, or before, if `kept` had not been made
        general.
        """
        ram, rest = self._restored(node, restored)
        transitions = self._transitions
        now = 0
        # The same path again, from the more particular state: if the use does not occur there, it was due to
        # what was generalised.
        pending = {decision.cycle: decision.choices for decision in decisions}
        while now <= cycle:
            outcome = transitions.run(ram, transitions.number(rest), pending.pop(now, ()))
            now += outcome.cycles
            if outcome.reason is Reason.USE and (now == cycle or now not in pending):
                return now <= cycle
            if outcome.reason is Reason.LIMIT or (not outcome.cycles and now not in pending):
                return False
            ram, rest = applied(ram, outcome), outcome.rest
        return False

    def _restored(self, node: Node, restored: list[str]) -> tuple[Ram, tuple[int, ...]]:
        """Return the state at `node` with `kept` as it was before, and with some phase if that is kept."""
        raw_ram, raw_rest = node.raw[0], self._transitions.rest(node.raw[1])
        cells, rest = list(node.ram), list(self._transitions.rest(node.rest))
        for place in restored:
            if place.startswith("0x"):
                cells[int(place, 16)] = raw_ram[int(place, 16)]
            elif place == PHASE:
                cells = [cell & 0xFF if cell >= CELL_PHASED else cell for cell in cells]
                rest[FIELD["TMR0_UNKNOWN"]] = 0
            elif place == "FLAGS":
                for name in ("STATUS", "STATUS_UNKNOWN"):
                    rest[FIELD[name]] = raw_rest[FIELD[name]]
            elif place == "PIN_FLAGS":
                for name in ("INTCON", "INTCON_UNKNOWN"):
                    rest[FIELD[name]] = raw_rest[FIELD[name]]
            elif place not in ("TIMER", "PRESCALER"):
                for name in (place, UNCERTAIN[place].unknown_name):
                    rest[FIELD[name]] = raw_rest[FIELD[name]]
        return tuple(cells), tuple(rest)


def general_cells(guess: Guess) -> frozenset[str]:
    """Return what is general at a cut, by the names of the checker's cells."""
    ram = {f"ram.{RAM_FIRST + place:02x}" for place in guess.dead}
    return frozenset(ram | {name.lower() for name in guess.registers if name not in ("TIMER", "PRESCALER")})


def live_places(
    reads: list[frozenset[int]], writes: list[frozenset[int]], all_places: frozenset[int]
) -> list[frozenset[int]]:
    """Return the places that are live before each of consecutive runs; after the last, all are."""
    live = all_places
    places = []
    for read, written in zip(reversed(reads), reversed(writes), strict=True):
        live = read | (live - written)
        places.append(live)
    return places[::-1]


def follows_timer(cells: list[int], timers: list[int]) -> bool:
    """Return whether a byte changes as TMR0 does: their distance takes few values, the byte itself many."""
    if any(cell > 0xFF for cell in cells):
        return False
    distances = {cell - timer & 0xFF for cell, timer in zip(cells, timers, strict=True)}
    return len(set(cells)) >= 16 and len(distances) * 4 <= len(set(cells))
