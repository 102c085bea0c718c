"""A tracked chip whose states are values: the transformer of the prover.

In: an abstract state, `ChipState`, which stands for every chip that agrees with it in its known bits (and,
with one φ, in its PHASED bytes). Out: what all of these chips do up to the next address of interest, or up
to the first instruction that depends on an unknown bit, with the state there.

Every input pin is unknown in every cycle, whatever pulls it up. Equal states stand for the same chips; data
that only serves reports is not part of them. Times count from now.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, LOW, PINS
from servogen.pic.device import EEPROM_BYTES, RAM_FIRST, RAM_LAST
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.prove.tape import TapeBeside
from servogen.pulse.schedule import TapeRule
from servogen.simulator import layout as at
from servogen.simulator.core import loop
from servogen.simulator.layout import EEIE, PD, PS, PSA, RA4, RB0, RB4_TO_7, TO
from servogen.simulator.options import SimulatorOptions
from servogen.simulator.regions import Code, fast_code, marked_code, program_code
from servogen.simulator.reset_state import POSTSCALER, START, power_up
from servogen.simulator.slots import Future
from servogen.simulator.warnings import CHIP_DEPENDENT, noted, warnings_of
from servogen.units import Clock

Packed = npt.NDArray[np.int64]

BASE = 1 << 40
"""The cycle that stands for now."""
CELL_MASK_SHIFT = 8
CELL_PHASED = 1 << 16
"""The flag of a cell whose byte is PHASED; other cells are value | unknown bits << 8."""
ALL_UNKNOWN = 0xFF << CELL_MASK_SHIFT

_ROWS = tuple(row for row in at.ROWS if row.future not in (Future.NONE, Future.STIMULUS))
_SLOTS = {row.name: row.number for row in _ROWS} | {row.unknown_name: mask for row, mask in at.UNCERTAIN}
_STACK = [at.STACK + level for level in range(8)]
_DRIVEN_FROM = [at.DRIVEN_FROM + 2 * pin for pin in range(len(PINS))]
_REST = np.array([*_SLOTS.values(), *_STACK, *_DRIVEN_FROM])
FIELDS = (*_SLOTS, *(f"STACK{level}" for level in range(8)), *(f"DRIVEN_FROM_{pin}" for pin in PINS))
"""The names of the values that a state has besides its RAM, in the order of `ChipState.rest`."""
FIELD = {name: number for number, name in enumerate(FIELDS)}

UNCERTAIN = MappingProxyType({row.name: row for row, _ in at.UNCERTAIN})
"""What may have unknown bits, by the names of the values; `SlotFacts.unknown_name` names the unknown bits."""
_UNCERTAIN = tuple((row.number, mask, row.bits, row.is_free) for row, mask in at.UNCERTAIN)
FREE_BYTES = tuple(row.name for row in UNCERTAIN.values() if row.is_free)
"""Bytes of which any bit may be unknown, and which may be PHASED."""
MERGED = tuple(row.name for row in UNCERTAIN.values() if row.merged)
"""What may be unknown where chips whose states are taken together differ."""


def _with_unknown(names: Iterable[str]) -> Iterator[str]:
    """Yield the names of values, each followed by that of its unknown bits."""
    for name in names:
        yield name
        if name in UNCERTAIN:
            yield UNCERTAIN[name].unknown_name


TIME_FIELDS = tuple(_with_unknown(row.name for row in _ROWS if row.timed))
"""What time alone changes."""
_LOOSE = (*TIME_FIELDS, *_with_unknown(("INTCON", *MERGED)))
"""What may differ between chips whose states are taken together."""
MAX_LANE_EDGES = 16
_UNTOUCHED = 0x7E << 8
"""A source of unknown bits that nothing else has: EEDATA with it has not been written."""
_RELATIVE, _NOT_BEFORE_NOW, _WATCHDOG = (
    tuple(row.number for row in at.ROWS if row.future is future)
    for future in (Future.MOMENT, Future.UNTIL, Future.SINCE)
)
_RAM = slice(RAM_FIRST, RAM_LAST + 1)
_WATCHDOG_NEVER = 1 << 39
WRITTEN = 0x08
"""The bit of an interrupt in doubt that is for the end of an EEPROM write."""


class Reason(Enum):
    """Why a run ended."""

    STOP = "reached an address of interest"
    USE = "an unknown bit decides"
    WARNING = "chips differ"
    LIMIT = "ran for the whole limit"
    NEVER = "no EEPROM gives the level that was chosen"


@dataclass(frozen=True, slots=True)
class ChipState:
    """An abstract state between two instructions: the cells of the 68 bytes of RAM, and `FIELDS`."""

    ram: tuple[int, ...]
    rest: tuple[int, ...]

    def __getitem__(self, field: str) -> int:
        return self.rest[FIELD[field]]


@dataclass(frozen=True, slots=True)
class AssumedBits:
    """Bits that are assumed for the next instruction: those of `bits` in `field` are `value`.

    INTCON_LATE sets flags in the second cycle of a two-cycle instruction.

    `field` is a name of `UNCERTAIN` or a RAM address as "0x0C". With `steer`, the byte stays unknown: the
    choice only decides which path is taken. Other fields are events: "TMR0_PHASE": TMR0 stands still for
    `value` cycles after a write of OPTION_REG; "EE_DONE": an EEPROM write ends, `value` cycles from now;
    "WATCHDOG": it ends SLEEP now; "TIMER": TMR0 has these bits, and counts on with them.
    """

    field: str
    bits: int
    value: int
    steer: bool = False

    @property
    def register(self) -> str:
        """Return the name in `UNCERTAIN` of the register whose bits these are, if there is one."""
        return "TMR0" if self.field == "TIMER" else self.field


@dataclass(frozen=True, slots=True)
class Use:
    """The instruction at `address` depends on an unknown bit."""

    kind: int
    subject: int
    address: int


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """What all chips of a state do in one run."""

    reason: Reason
    cycles: int
    edges: tuple[tuple[int, int, int], ...]
    """(cycles since the beginning, pin, level): each a change, an undriven pin counting as low, the pin that
    restarts another chip as high while it is pulled low; without the pins of a tape.
    """
    read: tuple[int, ...]
    """Places in the RAM that were read before they were written."""
    written: tuple[tuple[int, int], ...]
    """Places in the RAM that were written, with the cells there at the end."""
    rest: tuple[int, ...]
    use: Use | None = None
    warnings: tuple[str, ...] = ()

    def state(self, before: ChipState) -> ChipState:
        """Return the state at the end of the run that began in `before`."""
        ram = list(before.ram)
        for place, cell in self.written:
            ram[place] = cell
        return ChipState(tuple(ram), self.rest)


@dataclass(frozen=True, slots=True)
class Lanes:
    """What chips did that differ in some known bytes only, one row per chip."""

    cycles: Packed
    fit: npt.NDArray[np.bool_]
    """Which of them reached an address of interest, by which no unknown bit had decided anything."""
    ram: Packed
    """The cell of each place in the RAM, or -1 if it was not written."""
    read: tuple[int, ...]
    """Places in the RAM that any of them read before it was written."""
    edges: dict[tuple[int, int], Packed]
    """By (pin, level): the cycle of the change since the beginning, or -1; where a pin changes twice to the
    same level, `fit` is false.
    """
    rests: dict[tuple[int, ...], npt.NDArray[np.intp]]
    """The rows that end in each state beside the RAM; that state is of the first of these rows, but unknown
    where they differ in W, FSR and the flags.
    """


class AbstractChip:
    """Runs a program from abstract states."""

    def __init__(
        self,
        image: Image,
        clock: Clock,
        options: SimulatorOptions,
        held: Mapping[int, int] | None = None,
        any_watchdog: bool = True,
        write_us: int | None = None,
        any_eeprom: bool = False,
        of_no_interest: int = 0,
        tape: TapeRule | None = None,
        restart: int | None = None,
    ) -> None:
        """Prepare to run `image`.

        `options` describe the board and the chip; values that differ between chips are unknown, except those
        that `options.start` gives at power-up. The pins of `held` always have these levels. With
        `any_watchdog`, the watchdog's period is anywhere in its range instead of that of `options`.
        `write_us` is the maximum time of an EEPROM write, which may end in any cycle; None: exactly the time
        of `options`. With `any_eeprom`, what is read from the EEPROM is unknown.
        The pins `of_no_interest`, as bits, may be driven to levels that differ from chip to chip. A `tape` is
        on its pins, in any state after a reset. The pin `restart` is wired to another chip's MCLR.
        """
        self.image = image
        self.clock = clock
        self._given = options.start
        self._of_no_interest = of_no_interest
        self._restart = restart
        self.tape = TapeBeside(tape, clock) if tape else None
        self.any_write_time = write_us is not None
        if write_us is not None:
            options = replace(options, eeprom_write_us=write_us)
        self._template = self._start(options, held or {}, any_watchdog)
        if any_eeprom:
            self._template[at.EEPROM : at.EEPROM + EEPROM_BYTES] = ALL_UNKNOWN
        self._s = self._template.copy()
        self._plain = program_code(image)
        self._fast = fast_code(self._plain)
        self._memo = np.full(at.MEMO_ROWS * at.MEMO_COLUMNS, at.UNKNOWN, dtype=np.int64)
        self._recording = np.zeros(at.DEEPEST_RECORDING * at.RECORD, dtype=np.int64)
        self.released = 0
        """The pins that were inputs in some run, after the first pulse of any pin, as bits."""
        self._edges = np.zeros(1 << 16, dtype=np.int64)
        self._template[at.EDGE_LIMIT] = len(self._edges) - 4 * len(PINS)
        self._none = np.zeros(0, dtype=np.int64)
        inputs = (self._none, self._plain, self._fast.regions)
        kept = (self._s, self._edges, *inputs, self._memo, self._recording)
        self._pointers = tuple(array.ctypes.data for array in kept)
        """Addresses of the arrays that are never replaced: to ask for them takes as long as a short run."""
        self._marked: dict[Set[int], Code] = {}
        self._run = loop(observed=False, tracked=True)

    def _start(self, options: SimulatorOptions, held: Mapping[int, int], any_watchdog: bool) -> Packed:
        s = power_up(self.image, self.clock, options, tracked=True)
        s[at.ANY_INPUT] = 1
        s[at.EXT_MASK] = sum(1 << pin for pin in held)
        s[at.PINS] = s[at.EXT_LEVEL] = sum(level << pin for pin, level in held.items())
        s[at.PINS_UNKNOWN] = ((1 << len(PINS)) - 1) & ~int(s[at.EXT_MASK])
        s[at.INTCON_UNKNOWN] |= at.T0IF
        s[at.T0_PHASE] = 0
        if self.tape:
            s[at.DEVICE_PINS], s[at.DEVICES] = self.tape.pins, self.tape.address
        if s[at.WDT_PERIOD]:
            if not any_watchdog:
                s[at.WDT_SHORTEST] = s[at.WDT_PERIOD]
                s[at.WDT_EARLIEST] = s[at.CYCLE] + POSTSCALER * s[at.WDT_SHORTEST]
            s[at.WDT_PERIOD] = _WATCHDOG_NEVER  # it must not time out on the chip with the shortest period
        return s

    @property
    def watchdog(self) -> bool:
        """Return whether the configuration word has the watchdog on."""
        return bool(self._template[at.WDT_PERIOD])

    def power_on(self) -> ChipState:
        """Return the state after a power-on reset: values that table 6-4 marks "x" are unknown unless
        given.
        """
        s = self._s
        s[:] = self._template
        if self.tape:
            self.tape.load(0, int(s[at.CYCLE]))
        for name, _ in self._given:
            if name == "ram":
                s[_RAM] &= at.NOT_WRITTEN | 0xFF
            elif name.startswith("0x"):
                s[int(name, 16)] &= at.NOT_WRITTEN | 0xFF
            else:
                row = START[name]
                s[_SLOTS[row.unknown_name]] &= ~row.undefined & row.bits
        differs = int(s[at.PINS] ^ s[at.RB_OLD]) & ~int(s[at.PINS_UNKNOWN] | s[at.RB_OLD_UNKNOWN])
        if differs & RB4_TO_7:
            s[at.INTCON] |= at.RBIF
            s[at.INTCON_UNKNOWN] &= ~at.RBIF
        return self._canonical()

    def after_reset(self, written: Set[int]) -> ChipState:
        """Return the state after any reset: values that table 6-4 marks "x" or "u" are unknown.

        Bytes of RAM that are not in `written` keep the values given at power-up, if any.
        """
        on = self.power_on()
        s = self._s
        s[:] = self._template
        if self.tape:
            self.tape.load(0, int(s[at.CYCLE]))
        s[at.STATUS_UNKNOWN] |= TO | PD  # after another reset than power-on they differ
        cells = self._canonical()
        ram = (
            known if place not in written else general
            for place, (known, general) in enumerate(zip(on.ram, cells.ram, strict=True))
        )
        return ChipState(tuple(ram), cells.rest)

    def run(
        self, state: ChipState, stops: Set[int], limit: int, choices: tuple[AssumedBits, ...] = ()
    ) -> RunOutcome:
        """Run until the next instruction is at one of `stops`, ignoring the first instruction.

        With `choices` at least one instruction is executed, and the choices apply to it only. If an unknown
        bit matters, the run ends before that instruction.
        """
        if not self._go(state, stops, BASE + limit, choices):
            return RunOutcome(Reason.NEVER, 0, (), (), (), state.rest)
        used = self._used()
        if used is not None:
            cycle = int(self._s[at.USE_CYCLE])
            if cycle <= BASE:
                return RunOutcome(Reason.USE, 0, (), (), (), state.rest, used)
            # The first run went on with a value that only some chips have: the state is that before the use.
            self._go(state, stops, cycle, choices)
            if self._used() is not None or self._s[at.CYCLE] != cycle:
                return self._outcome(Reason.WARNING, None, ("an interrupt inside an instruction",))
        warnings = self._warnings(choices)
        if warnings:
            return self._outcome(Reason.WARNING, None, warnings)
        if used is not None:
            return self._outcome(Reason.USE, used, ())
        pending = self._interrupt_in_doubt()
        if pending is not None:
            return self._outcome(Reason.USE, pending, ())
        reason = Reason.LIMIT if self._s[at.CYCLE] >= BASE + limit else Reason.STOP
        return self._outcome(reason, None, ())

    def run_lanes(
        self,
        state: ChipState,
        known: tuple[str | int, ...],
        values: npt.NDArray[np.int64],
        stops: Set[int],
        limit: int,
    ) -> Lanes:
        """Run chips that differ from `state` in the bytes of `known`, a row of `values` for each.

        A byte is a place in the RAM, or "EEDATA". Every chip runs as `run` does without choices; one that
        writes EEDATA, OPTION_REG, TMR0 or enable bits does not fit.
        """
        s = self._load(state)
        slots = [at.EEDATA if place == "EEDATA" else RAM_FIRST + int(place) for place in known]
        s[at.EEDATA_UNKNOWN] = 0 if "EEDATA" in known else int(s[at.EEDATA_UNKNOWN]) | _UNTOUCHED
        start, poked = s.copy(), np.array(slots, dtype=np.intp)
        written = np.array([0 if place == "EEDATA" else at.NOT_WRITTEN for place in known], dtype=np.int64)
        rows = values | written
        key = frozenset(stops)
        if key not in self._marked:
            self._marked[key] = marked_code(self._fast.code, self._plain, key)
        code, end = self._marked[key], BASE + limit
        ends = np.empty((len(rows), len(s)), dtype=np.int64)
        changes = np.zeros((len(rows), MAX_LANE_EDGES), dtype=np.int64)
        arguments = self._arguments(code, end, BASE)
        for number in range(len(rows)):
            s[:] = start
            if len(poked):
                s[poked] = rows[number]
            self._run(*arguments)
            ends[number] = s
            changes[number] = self._edges[:MAX_LANE_EDGES]
        eedata_kept = (ends[:, at.EEDATA_UNKNOWN] == start[at.EEDATA_UNKNOWN]) & (
            ends[:, at.EEDATA] == (rows[:, known.index("EEDATA")] if "EEDATA" in known else start[at.EEDATA])
        )
        return self._lanes(start, ends, changes, eedata_kept & (ends[:, at.CYCLE] < end), key)

    def _lanes(
        self,
        start: Packed,
        ends: Packed,
        changes: Packed,
        fit: npt.NDArray[np.bool_],
        stops: frozenset[int],
    ) -> Lanes:
        fit &= ends[:, at.EDGE_COUNT] <= MAX_LANE_EDGES
        for slot in (at.USE_KIND, at.WARN_COUNT, at.SLEEPING, at.OPTION_WRITES, at.DRIVEN_UNKNOWN):
            fit &= ends[:, slot] == 0
        for slot in (at.INTCON, at.T0_HELD, at.EE_DONE_AT, at.IRQ_AT, at.INTERRUPTS):
            flags = at.T0IF | at.INTF | at.RBIF if slot == at.INTCON else 0
            fit &= (ends[:, slot] ^ start[slot]) & ~flags == 0
        fit &= ends[:, at.INTCON] & at.GIE == 0
        fit &= np.isin(ends[:, at.PC] & 0x3FF, sorted(stops))
        edges = self._lane_edges(ends[:, at.EDGE_COUNT], changes, fit)
        ram = ends[:, _RAM]
        masks = ram >> at.UNKNOWN_SHIFT & 0xFFFF
        phased = masks == at.PHASED
        masks &= 0xFF
        cells = np.where(phased, ram & 0xFF | CELL_PHASED, ram & 0xFF & ~masks | masks << CELL_MASK_SHIFT)
        cells[ram & at.NOT_WRITTEN != 0] = -1
        noted = ends[:, at.READ_UNWRITTEN + RAM_FIRST : at.READ_UNWRITTEN + RAM_LAST + 1]
        read = tuple(np.flatnonzero(noted.any(axis=0)).tolist())
        return Lanes(ends[:, at.CYCLE] - BASE, fit, cells, read, edges, self._lane_rests(ends, fit))

    def _lane_edges(
        self, count: Packed, changes: Packed, fit: npt.NDArray[np.bool_]
    ) -> dict[tuple[int, int], Packed]:
        """Return the edges of every row, as `_changes` does for one; clear `fit` where there are too many."""
        columns: dict[tuple[int, int], Packed] = {}
        high = np.full(len(count), self._high, dtype=np.int64)
        for number in range(int(count.max(initial=0)) if fit.any() else 0):
            if number >= MAX_LANE_EDGES:
                break
            packed = changes[:, number]
            pins = packed >> at.PACK_PIN & 0x3F
            level = (packed & at.PACK_LEVELS == HIGH).astype(np.int64)
            changed = (count > number) & ((high >> pins & 1) != level)
            high = np.where(changed, high ^ (1 << pins), high)
            for pin, now in sorted({*zip(pins[changed].tolist(), level[changed].tolist(), strict=True)}):
                rows = changed & (pins == pin) & (level == now)
                column = columns.setdefault((pin, now), np.full(len(count), -1, dtype=np.int64))
                fit &= ~(rows & (column >= 0))
                column[rows] = (packed[rows] >> at.PACK_CYCLE) - BASE
        return columns

    def _lane_rests(
        self, ends: Packed, fit: npt.NDArray[np.bool_]
    ) -> dict[tuple[int, ...], npt.NDArray[np.intp]]:
        """Return the states beside the RAM, apart from what time alone changes, with their rows."""
        loose = {FIELD[name] for name in _LOOSE}
        firm = _REST[[number for number in range(len(_REST)) if number not in loose]]
        rows = np.flatnonzero(fit)
        if not len(rows):
            return {}
        parts = ends[np.ix_(rows, firm)]
        if (parts == parts[0]).all():
            groups = [rows]
        else:
            _, which = np.unique(parts, axis=0, return_inverse=True)
            groups = [rows[which.ravel() == number] for number in range(int(which.max()) + 1)]
        lanes_of: dict[tuple[int, ...], npt.NDArray[np.intp]] = {}
        for group in groups:
            self._s[:] = ends[group[0]]
            for row, mask in at.UNCERTAIN:
                known, doubt = ends[group, row.number], ends[group, mask]
                if row.merged and ((known != known[0]).any() or (doubt != doubt[0]).any()):
                    differs = np.bitwise_or.reduce(known ^ known[0]) | np.bitwise_or.reduce(doubt)
                    self._s[mask] = int(differs) & row.bits
            rest = self._canonical().rest
            lanes_of[rest] = np.concatenate([lanes_of[rest], group]) if rest in lanes_of else group
        return lanes_of

    def _go(self, state: ChipState, stops: Set[int], end: int, choices: tuple[AssumedBits, ...]) -> bool:
        """Run; return whether the choices are possible."""
        s = self._load(state)
        if choices:
            read = (choice for choice in choices if choice.field == "PINS")
            if self.tape and not all(self.tape.saw(choice.bits, choice.value) for choice in read):
                return False
            earlier = [self._hold(choice) for choice in choices]
            # One instruction, word by word: no wait or region is executed in one step.
            self._call(self._plain, BASE + 1, BASE)
            steered = any(choice.steer for choice in choices)
            if steered or s[at.USE_KIND] == at.USE_INTERRUPT:
                s[at.USE_KIND] = 0  # the way is chosen; an interrupt in doubt is looked at after each step
                # While a use was noted, no doubt in TMR0's flag was: the counters settle again.
                self._call(self._plain, int(s[at.CYCLE]), BASE)
            if s[at.USE_KIND]:
                return True
            for choice, before in reversed([*zip(choices, earlier, strict=True)]):
                self._release(choice, before)
            self._doubt_flags()
        if self._interrupt_in_doubt() is not None:
            return True
        key = frozenset(stops)
        if key not in self._marked:
            self._marked[key] = marked_code(self._fast.code, self._plain, key)
        stopped = choices and (s[at.SLEEPING] or int(s[at.PC]) & 0x3FF in stops)
        if s[at.CYCLE] < end and not stopped:
            self._call(self._marked[key], end, BASE)
        return True

    def _call(self, code: Code, end: int, resume: int) -> None:
        s = self._s
        if self._run(*self._arguments(code, end, resume)) == at.EDGES_FULL:
            # more edges than any schedule has: they are judged first
            s[at.CYCLE] = max(int(s[at.CYCLE]), end)

    def _arguments(self, code: Code, end: int, resume: int) -> tuple[int, ...]:
        """Return the arguments of the loop, which runs up to cycle `end`."""
        state, edges, none, plain, regions, memo, recording = self._pointers
        words = code.ctypes.data
        return (state, end, edges, none, words, plain, regions, memo, recording, resume, none, none)

    def _load(self, state: ChipState) -> Packed:
        s = self._s
        s[:] = self._template
        cells = np.array(state.ram, dtype=np.int64)
        masks = cells >> CELL_MASK_SHIFT & 0xFF
        masks[cells >= CELL_PHASED] = at.PHASED
        s[_RAM] = cells & 0xFF | masks << at.UNKNOWN_SHIFT | at.NOT_WRITTEN
        s[_REST] = state.rest
        if self.tape:
            s[at.DEVICE_TOLD], s[at.DEVICE_ANSWER] = self.tape.load(state["DEVICE_STATE"], BASE)
        self._close_counters()
        s[at.CYCLE] = BASE
        self._high = state["DRIVEN_HIGH"]
        if self._restart is not None:
            pulled = state["DRIVEN"] & ~state["DRIVEN_HIGH"]
            self._high = self._high & ~(1 << self._restart) | pulled & 1 << self._restart
        s[at.READ_UNWRITTEN : at.READ_UNWRITTEN + at.RAM_SLOTS] = 0
        s[at.WARN_COUNT] = s[at.USE_KIND] = s[at.EDGE_COUNT] = s[at.OPTION_WRITES] = 0
        return s

    def _close_counters(self) -> None:
        """Let what is unknown of TMR0 and its prescaler include every bit that a carry can reach: then it
        stays the same while they count.
        """
        s = self._s
        prescaler, timer = int(s[at.PRESCALER_UNKNOWN]), int(s[at.TMR0_UNKNOWN])
        s[at.PRESCALER_UNKNOWN] = prescaler | -(prescaler & -prescaler) & 0xFF
        if prescaler and not s[at.OPTION] & PSA and prescaler & (2 << (int(s[at.OPTION]) & PS)) - 1:
            timer = 0xFF | at.SOURCE_PRESCALER << 8
        s[at.TMR0_UNKNOWN] = timer | -(timer & -timer) & 0xFF

    def _used(self) -> Use | None:
        s = self._s
        if s[at.USE_KIND]:
            return Use(int(s[at.USE_KIND]), int(s[at.USE_SUBJECT]), int(s[at.USE_PLACE]) & 0x3FF)
        if s[at.CYCLE] == BASE:
            pending = self._interrupt_in_doubt()
            if pending is not None:
                s[at.USE_CYCLE] = BASE
            return pending
        return None

    def _interrupt_in_doubt(self) -> Use | None:
        """Return a use if an interrupt may or may not come now, because pins change without an
        instruction.
        """
        intcon = int(self._s[at.INTCON])
        if not intcon & at.GIE or self._s[at.SLEEPING]:
            return None
        doubtful = int(self._s[at.INTCON_UNKNOWN])
        enabled = intcon >> 3 & 7
        if intcon & at.T0IE and self._s[at.TMR0_UNKNOWN]:
            doubtful |= at.T0IF  # it may overflow in any cycle from now on
        written = WRITTEN if intcon & EEIE and self._writing() else 0
        if enabled & intcon & ~doubtful or not (enabled & doubtful or written):
            return None
        return Use(at.USE_INTERRUPT, enabled & doubtful | written, int(self._s[at.PC]) & 0x3FF)

    def _writing(self) -> bool:
        """Return whether an EEPROM write is under way that may end in any cycle."""
        return self.any_write_time and bool(self._s[at.EE_DONE_AT] != at.NEVER)

    def _hold(self, choice: AssumedBits) -> int:
        """Make a choice's bits known and return what `_release` needs."""
        s, before = self._s, 0
        if choice.field == "TMR0_PHASE":
            s[at.T0_PHASE] = choice.value
        elif choice.field == "EE_DONE":
            s[at.EE_DONE_AT] = BASE + choice.value
        elif choice.field == "WATCHDOG":
            self._time_out()
        elif choice.field == "INTCON_LATE":
            s[at.INTCON] &= ~choice.bits
            s[at.INTCON_UNKNOWN] = int(s[at.INTCON_UNKNOWN]) & 0xFF & ~choice.bits
        elif choice.field.startswith("0x"):
            slot = int(choice.field, 16)
            mask = int(s[slot]) >> at.UNKNOWN_SHIFT & 0xFF
            mask_kept = mask if choice.steer else mask & ~choice.bits
            value = int(s[slot]) & 0xFF & ~choice.bits | choice.value & choice.bits
            s[slot] = value | mask_kept << at.UNKNOWN_SHIFT | int(s[slot]) & at.NOT_WRITTEN
        else:
            row = UNCERTAIN[choice.register]
            value_slot, mask_slot = row.number, _SLOTS[row.unknown_name]
            before = int(s[mask_slot]) << 16 | int(s[value_slot]) & 0x1FFF
            s[value_slot] = int(s[value_slot]) & ~choice.bits | choice.value & choice.bits
            if not choice.steer:
                s[mask_slot] = int(s[mask_slot]) & row.bits & ~choice.bits
            intcon = int(s[at.INTCON])
            requested = intcon >> 3 & choice.value & 7
            if choice.field == "INTCON" and requested and intcon & at.GIE:
                s[at.IRQ_AT] = min(int(s[at.IRQ_AT]), BASE)
        return before

    def _time_out(self) -> None:
        """Let the watchdog wake the chip, as `events.watchdog` does."""
        s = self._s
        s[at.STATUS] &= ~(TO | PD)
        s[at.STATUS_UNKNOWN] &= ~(TO | PD)
        s[at.SLEEPING] = 0
        periods = 1
        if s[at.OPTION] & PSA:
            s[at.PRESCALER] = s[at.PRESCALER_UNKNOWN] = 0
            periods = 1 << (int(s[at.OPTION]) & PS)
        s[at.WDT_AT] = s[at.WDT_CLEARED] = BASE
        s[at.WDT_EARLIEST] = BASE + periods * int(s[at.WDT_SHORTEST])
        awake = BASE + int(s[at.START_UP])
        s[at.CYCLE] = s[at.AWAKE_AT] = awake
        s[at.T0_AT] = max(int(s[at.T0_AT]), awake)

    def _release(self, choice: AssumedBits, before: int) -> None:
        """Undo assumptions that applied to one moment only."""
        s = self._s
        if choice.field == "TMR0_PHASE":
            s[at.T0_PHASE] = 0
        elif choice.field == "INTCON_LATE":
            s[at.INTCON] |= choice.bits
            s[at.INTCON_UNKNOWN] &= ~choice.bits
            if s[at.INTCON] & at.GIE:
                s[at.IRQ_AT] = min(int(s[at.IRQ_AT]), BASE + 1)
        elif choice.field == "PINS":
            again = choice.bits & ~(int(s[at.DRIVEN]) & ~(int(s[at.LATCH]) & RA4))
            s[at.PINS_UNKNOWN] |= again
            s[at.PINS] &= ~again
        elif choice.field == "TMR0":
            written = s[at.T0_HELD] > BASE + 2
            if not written and int(s[at.TMR0_UNKNOWN]) == before >> 16 & 0xFF & ~choice.bits:
                s[at.TMR0] = int(s[at.TMR0]) + (before & 0xFF) - _held(before, choice) & 0xFF
                s[at.TMR0_UNKNOWN] = before >> 16

    def _doubt_flags(self) -> None:
        """Note that pins may have set flags in the meantime."""
        s = self._s
        pins = int(s[at.PINS_UNKNOWN])
        known = int(s[at.INTCON]) & ~int(s[at.INTCON_UNKNOWN])
        doubtful = 0
        if pins & RB0:
            doubtful |= at.INTF
        if pins & int(s[at.TRIS]) & RB4_TO_7:
            doubtful |= at.RBIF
        if pins & RA4 and s[at.OPTION] & at.T0CS:
            doubtful |= at.T0IF
            s[at.TMR0_UNKNOWN] = 0xFF
            if not s[at.OPTION] & PSA:
                s[at.PRESCALER_UNKNOWN] = 0xFF
        s[at.INTCON_UNKNOWN] |= doubtful & ~known

    def _warnings(self, choices: tuple[AssumedBits, ...]) -> tuple[str, ...]:
        s = self._s
        warnings: list[str] = []
        if (s[at.WARN_COUNT] or s[at.DRIVEN_UNKNOWN]) and noted(s):
            every = warnings_of(s, self.image, self.clock, self._of_no_interest)
            warnings += [
                warning.message
                for warning in every
                if warning.code in CHIP_DEPENDENT and warning.location is not None and warning.location.cycle
            ]
        if s[at.SLEEPING] and (dark := int(s[at.DRIVEN_UNKNOWN]) & ~self._of_no_interest):
            names = ", ".join(name for pin, name in enumerate(PINS) if dark >> pin & 1)
            warnings.append(f"SLEEP while {names} is driven to a level that is not known")
        expected = sum(choice.field == "TMR0_PHASE" for choice in choices)
        if s[at.OPTION_WRITES] > expected:
            warnings.append("OPTION_REG is written through INDF")
        return tuple(warnings)

    def _outcome(self, reason: Reason, use: Use | None, warnings: tuple[str, ...]) -> RunOutcome:
        s = self._s
        cycles = int(s[at.CYCLE]) - BASE
        edges = self._changes()
        ram = s[_RAM]
        read = np.flatnonzero(s[at.READ_UNWRITTEN + RAM_FIRST : at.READ_UNWRITTEN + RAM_LAST + 1])
        written = np.flatnonzero(ram & at.NOT_WRITTEN == 0)
        deciding = self._operand(use) if use is not None else None
        if deciding is not None and deciding not in written:
            read = np.union1d(read, [deciding])
        state = self._canonical()
        pairs = tuple((int(place), state.ram[place]) for place in written)
        return RunOutcome(reason, cycles, edges, tuple(read.tolist()), pairs, state.rest, use, warnings)

    def _operand(self, use: Use) -> int | None:
        """Return the place in the RAM that the instruction of a use reads; None if it reads another one.

        The run has ended before it, so it is not among what the run has read; with another value there the
        run would go on.
        """
        word = self.image.program.get(use.address)
        decoded = None if word is None else decode(word)
        if decoded is None or "f" not in decoded.instruction.operands:
            return None
        address = (int(self._s[at.FSR]) if decoded.f == 0 else decoded.f) & 0x7F
        return address - RAM_FIRST if RAM_FIRST <= address <= RAM_LAST else None

    def _changes(self) -> tuple[tuple[int, int, int], ...]:
        count = int(self._s[at.EDGE_COUNT])
        high, bus = self._high, self.tape.pins if self.tape else 0
        changes = []
        for packed in self._edges[:count].tolist():
            pin = packed >> at.PACK_PIN & 0x3F
            level = int(packed & at.PACK_LEVELS == (LOW if pin == self._restart else HIGH))
            if bus >> pin & 1:
                continue
            if high >> pin & 1 != level:
                high ^= 1 << pin
                changes.append(((packed >> at.PACK_CYCLE) - BASE, pin, level))
        return tuple(changes)

    def _canonical(self) -> ChipState:
        s = self._s
        now = int(s[at.CYCLE])
        shift = BASE - now
        # Times become relative to now, and what nothing reads any more is cleared: states with the same
        # future are equal, so that a search closes.
        for slot in _RELATIVE:
            if s[slot] != at.NEVER:
                s[slot] += shift
        for slot in _NOT_BEFORE_NOW:
            s[slot] = max(int(s[slot]), now) + shift
        for slot in _WATCHDOG:
            s[slot] = int(s[slot]) + shift if s[at.WDT_PERIOD] else BASE
        s[at.T0_FLAGGED] = BASE if s[at.T0_FLAGGED] == now and not s[at.TMR0_UNKNOWN] else -1
        s[at.EE_STEP_AT] = max(int(s[at.EE_STEP_AT]) + shift, BASE - 3) if s[at.EE_STEP] else 0
        doubtful = int(s[at.DRIVEN_UNKNOWN]) & ~self._of_no_interest
        for pin, slot in enumerate(_DRIVEN_FROM):
            s[slot] = int(s[slot]) + shift if doubtful >> pin & 1 else 0
        s[at.CYCLE] = BASE
        self._doubt_flags()
        for value, mask, bits, free in _UNCERTAIN:
            if not free or s[mask] != at.PHASED:
                s[mask] &= bits
                s[value] &= ~int(s[mask])
        s[at.RB_OLD] &= RB4_TO_7
        s[at.EE_CELL] = s[at.EE_BYTE] = 0  # nobody reads what the program has written
        if self.tape:
            s[at.DEVICE_STATE] = self.tape.number(now)
        self.released |= int(s[at.RELEASED])
        self._canonical_stack()
        return ChipState(self._cells(), tuple(s[_REST].tolist()))

    def _cells(self) -> tuple[int, ...]:
        ram = self._s[_RAM]
        masks = ram >> at.UNKNOWN_SHIFT & 0xFFFF
        phased = masks == at.PHASED
        masks &= 0xFF
        cells = ram & 0xFF & ~masks | masks << CELL_MASK_SHIFT
        if phased.any():
            cells[phased] = ram[phased] & 0xFF | CELL_PHASED
        return tuple(cells.tolist())

    def _canonical_stack(self) -> None:
        """Put the live levels first and forget popped ones."""
        s = self._s
        depth, top = int(s[at.DEPTH]), int(s[at.SP])
        live = [int(s[at.STACK + (top - depth + level) % 8]) for level in range(depth)]
        s[at.STACK : at.STACK + 8] = [*live, *[0] * (8 - depth)]
        s[at.SP] = depth % 8


def _held(before: int, choice: AssumedBits) -> int:
    """Return the byte `before` with the bits of a choice."""
    return before & 0xFF & ~choice.bits | choice.value & choice.bits
