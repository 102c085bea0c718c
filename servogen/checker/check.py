"""Checks a certificate: every run of every chip passes through its states, with the scheduled edges.

In: a program, a schedule's plan, a certificate. Out: what was run, or `Refused`, which says where and why.
The chip is run from power-up, and from each listed state, with all its unknown bits, to the next of the
certificate's cuts, once for each value of every bit on which its course depends. The state there must be
within a listed one, with the same position in the plan. So, by induction, these runs are all runs; every edge
of every pin in them is compared.

A run depends on W and the RAM only by the bytes that it reads before it writes them. So all states that agree
in these, and in everything else, go the same way, and are run as one.
"""

from __future__ import annotations

import hashlib
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cache
from math import ceil

import numpy as np

from servogen.checker import chip, layout
from servogen.checker.certificate import FRAME_NUMBER, PLACE, WIDTH, Certificate, fingerprint
from servogen.checker.plan import AWAITED, OVER, PINS, UNCOMMANDED, Place, Plan, PlanPosition, read_plan
from servogen.checker.wire import LEVELS, WireReads
from servogen.pic.image import Image
from servogen.units import Clock

Ints = chip.Ints
DUE, ORIGIN, COLUMNS = range(WIDTH, WIDTH + 3)
"""Columns beside those of a certificate: the run of equal frames whose edges are due, and the listed state
from which the run began (-1: power-up).
"""
BYTES = [*range(layout.RAM, layout.RAM_END), *(row.slot for row in layout.REGISTERS if row.unknown)]
"""The slots of cells; TMR0's is the last one."""
EXACT = [layout.PC, layout.DEPTH, *(row.slot for row in layout.REGISTERS if not row.unknown), layout.STAGE,
         layout.TIME, FRAME_NUMBER, PLACE, *range(layout.STACK, layout.SLOTS)]  # fmt: skip
"""What must be the same in a state and in the listed one that contains it, besides cells and TMR0's count."""
CHIP, ALWAYS = np.arange(COLUMNS) < layout.SLOTS, np.arange(COLUMNS) <= DUE
ALWAYS[[layout.W, *range(layout.RAM, layout.RAM_END), FRAME_NUMBER, PLACE]] = False
"""The chip's slots; and what every run depends on."""
SAYS_NOTHING = [layout.CYCLE, layout.ASKED, layout.ASKED_BITS, ORIGIN]
"""What has no part in where a run leads to."""
MAX_PERIODS, MAX_CYCLES, MAX_ROWS, ROWS = 500, 3_000_000_000, 20_000, 1000
"""Of a way between two cuts; cycles that are run; ways that wait for it; states that are taken together."""
MAX_RUNS = 500_000
"""From one stop to the next: some minutes."""
PAUSE = 100
"""In this cycle runs stop once, so that those which have forgotten their differences go on as one."""
TLOW_US, THIGH_US = 1.3, 0.6
"""DS20001203, table 1-2: TLOW and TBUF; THIGH, THD:STA, TSU:STA and TSU:STO. TSU:DAT is less than a cycle."""
RC, FASTEST = 3, (200_000, 4_000_000, 20_000_000, 0)
"""Bits of the configuration word, and the largest clocks of LP, XT, HS and RC in Hz (section 6.2)."""
WATCHDOG_US, WATCHDOG_ON = 7_000, 4
"""The shortest period (DS35007 parameter 31) and the bit of the configuration word."""


class Refused(Exception):
    """The certificate does not prove that the edges are the schedule's; the text says where and why."""


class NotCovered(Refused):
    """The program does something that the checker does not cover; the text says what, and where."""

    def __init__(self, what: str, where: str) -> None:
        super().__init__(f"{where}: the checker does not cover: {what}")
        self.what = what


OUTSIDE = (layout.REGISTER, layout.PHASE, layout.SEQUENCE)
"""Reasons to stop that are no fault of the program."""


@dataclass(frozen=True)
class Checked:
    """What was checked: the theorem's quantities and restrictions, as texts, and how much was run."""

    states: int
    """Listed states."""
    frames: int
    cycles: int
    forks: int
    """Ways that were split."""
    over: tuple[str, ...] = ()
    """What the theorem is quantified over."""
    restrictions: tuple[str, ...] = ()
    """The pins for whose held level alone it was checked."""
    silence: int | None = None
    """The cycles from a reset to the first pulse, at least; None where no run comes to one by itself."""


class Checker:
    """Runs the chip from power-up and from the listed states."""

    def __init__(self, image: Image, plan: Plan, certificate: Certificate, any_eeprom: bool = False) -> None:
        levels = {PINS.index(pin): level for pin, level in certificate.held.items()}
        # With a button held the schedule's own frames are claimed, as they follow one another.
        if any(plan.buttons >> pin & 1 for pin in levels):
            plan = replace(plan, buttons=0, inputs=UNCOMMANDED, parts=[])
        self._plan = plan
        self._any_eeprom = any_eeprom
        self._memory = chip.memory_of(
            image, certificate.cuts, any_eeprom, plan.tape.content if plan.tape else b"\0"
        )
        self.board = layout.ChipSurroundings(
            limit=MAX_PERIODS * plan.period,
            period=plan.period,
            channels=plan.channels,
            buttons=plan.buttons,
            held=sum(1 << pin for pin in levels),
            levels=sum(level << pin for pin, level in levels.items()),
            watchdog=watchdog_cycles(image, Clock(plan.clock_hz)),
            longest_write=ceil(plan.write_us / Clock(plan.clock_hz).cycle_us),
            restart=plan.wire.restart if plan.wire else 0,
            pulled=plan.wire.pulled if plan.wire else 0,
        )
        if plan.tape:
            low, high = (ceil(us / Clock(plan.clock_hz).cycle_us) for us in (TLOW_US, THIGH_US))
            pins, size, content = plan.tape
            self.board = self.board._replace(
                bus=pins, size=size, recorded=len(content), low_time=low, high_time=high
            )
        self._following, self._sampled = cache(self._after), cache(self._sample)
        self._due = cache(lambda frame, place: plan.run_of(PlanPosition(frame, self.places[place].memory)))
        self._edge = cache(lambda due, time: bisect_left(plan.edges[due][0], time))
        self._followed: set[bytes] = set()
        self.places: list[Place] = []
        self._numbers: dict[Place, int] = {}
        self._listed: list[tuple[Ints, dict[bytes | None, int]]] = []
        self.states = self.started(self.known(certificate))
        self._frames = self._cycles = self._run = self._runs = self._forks = 0
        self._silence: int | None = None

    def check(self) -> Checked:
        """Run from power-up and from each listed state. Raises Refused."""
        self._follow(self.power_up())
        order = np.argsort(self.states[:, DUE], kind="stable")  # those of one frame go the same way
        changes = np.flatnonzero(np.diff(self.states[order, DUE])) + 1
        for group in np.split(order, changes):
            for first in range(0, len(group), ROWS):
                self._follow(self.states[group[first : first + ROWS]])
        counts = len(order), self._frames, self._cycles, self._forks
        return Checked(*counts, self._over(), silence=self._silence)

    def _over(self) -> tuple[str, ...]:
        """Return what all runs together are about."""
        but = " that is not held" if self.board.held else ""
        over = ["every value of RAM and registers after a reset in any cycle"]
        over += [f"every level of every input{but} in every cycle"]
        over += [f"every watchdog that is not faster than {WATCHDOG_US // 1000} ms"] * bool(
            self.board.watchdog
        )
        over += [f"every EEPROM write of at most {self._plan.write_us // 1000} ms"] * bool(self.writes)
        over += ["every content of the EEPROM"] * (self._any_eeprom or not self.reads)
        tape = self._plan.tape
        if tape:
            digest = hashlib.sha256(tape.content).hexdigest()
            known = f"{len(tape.content)} bytes have SHA-256 {digest[:16]}…"
            over += [f"every state of a tape's EEPROM whose first {known}"]
        return tuple(over)

    @property
    def reads(self) -> bool:
        """Return whether a run has read the EEPROM."""
        return bool(self._memory.eeprom[layout.EEPROM_READ])

    @property
    def writes(self) -> bool:
        """Return whether a run has written to the EEPROM."""
        return bool(self._memory.eeprom[layout.EEPROM_WRITTEN])

    def known(self, certificate: Certificate) -> Ints:
        """Return the listed states with their places numbered, once they can be found. Raises Refused."""
        rows, parts = np.pad(certificate.states, ((0, 0), (0, COLUMNS - WIDTH))), self._plan.parts
        over, awaits = rows[:, FRAME_NUMBER] == OVER.frame, rows[:, FRAME_NUMBER] == AWAITED
        if awaits.any() and not self._plan.wire:
            raise Refused("the schedule has no wire of another chip")
        for place in certificate.places:
            same = [*map(type, place.memory)] == [*map(type, self._plan.inputs.power_up)]
            if not same or (parts and not 0 <= place.memory[0] < len(parts)):
                raise Refused(f"place {place}: the schedule has none such")
        if (rows[:, FRAME_NUMBER] >= self._plan.ends[-1]).any():
            raise Refused("the schedule has fewer frames than the listed states")
        if self._plan.tape:
            self._read_from(rows, self._plan.tape.content)
        numbers = np.array([*map(self.number, certificate.places), 0])
        rows[:, PLACE] = np.where(over, self.number(Place(OVER.memory)), numbers[rows[:, PLACE]])
        rows[:, layout.STAGE] = np.select([over, awaits], [layout.OVER, layout.AWAITS], layout.RUNS)
        rows[over, layout.TIME] = 0
        rows[:, layout.CHOSEN] = layout.UNKNOWN
        rows[:, ORIGIN] = np.arange(len(rows))
        # Among states with the same unknown bits, containment is equality of the known ones: a look-up by
        # key.
        cells = rows[:, BYTES].astype(np.int32)
        shapes: dict[bytes, list[int]] = defaultdict(list)
        for number, shape in enumerate(np.where(cells >> 16, 1 << 16, cells & layout.UNKNOWN)):
            shapes[shape.tobytes()].append(number)
        for text, numbers_of in shapes.items():
            numbers_of.sort(
                key=lambda number: int(rows[number, layout.WRITE_LEFT])
            )  # of equals, the widest one
            shape = np.frombuffer(text, dtype=np.int32)
            self._listed.append(
                (shape, dict(zip(listed_keys(rows[numbers_of], shape), numbers_of, strict=True)))
            )
        return rows

    @staticmethod
    def _read_from(rows: Ints, content: bytes) -> None:
        """Let the EEPROM give, in each state, the byte and bit of the tape that its column says."""
        address, clock = np.divmod(rows[:, layout.POINTER], 9)
        if (address >= len(content)).any():
            raise Refused("the tape has fewer bytes than the listed states")
        byte = np.frombuffer(content, dtype=np.uint8)[address].astype(np.int64)
        low = (clock < 8) & (byte << clock & 0x80 == 0)
        settled = [layout.GIVING, layout.SETTLED, layout.SETTLED]
        rows[:, [layout.TAKES, layout.SCL_AGE, layout.SDA_AGE]] = settled
        rows[:, [layout.CLOCKS, layout.SHIFT, layout.POINTER, layout.PULLS]] = np.stack(
            [clock, byte, address + 1, low], axis=1
        )

    def started(self, rows: Ints) -> Ints:
        """Return listed states as those of a chip that runs on from there."""
        rows = rows.copy()
        # TMR0 counts the edges of RA4, which may have any level at any time.
        rows[rows[:, layout.OPTION] & layout.T0CS != 0, layout.TMR0] = layout.UNKNOWN
        for row in rows:
            row[DUE] = self._due(*row[[FRAME_NUMBER, PLACE]].tolist())
            row[layout.EDGE] = self._edge(*row[[DUE, layout.TIME]].tolist())
        return rows

    def power_up(self) -> Ints:
        s = chip.after_reset(layout.BEFORE, COLUMNS)
        frame, memory = self._plan.start
        s[[FRAME_NUMBER, PLACE, ORIGIN]] = frame, self.number(Place(memory)), -1
        s[DUE] = self._plan.run_of(self._plan.start)
        if self._plan.tape:
            s[[layout.TAKES, layout.POINTER]] = layout.ANYTHING, -1
        return s[None]

    def number(self, place: Place) -> int:
        """Return the number of a place."""
        if place not in self._numbers:
            self._numbers[place] = len(self.places)
            self.places.append(place)
        return self._numbers[place]

    def _follow(self, states: Ints) -> None:
        """Run from each of `states` to the next cuts, on every way. Raises Refused."""
        while len(states):
            stopped, arrived = [], []
            while len(states):
                rows, why, states = self._run_first(states)
                if why == layout.NEW_FRAME:
                    stopped.append(self._next_frame(rows))
                elif why == layout.LAST_EDGE or (
                    why == layout.TOO_LONG and rows[0, layout.CYCLE] < self.board.limit
                ):
                    stopped.append(rows)
                elif why == layout.BUTTON and self._plan.wire:
                    stopped += self._reads(self._new(rows, why), self._plan.wire)
                elif why in (layout.FORK, layout.BUTTON):
                    stopped += self._both(rows, why)
                elif why in (layout.MAY_INTERRUPT, layout.MAY_BE_WRITTEN, layout.SLEEPS):
                    stopped += self._happens(self._new(rows, why), why)
                elif why == layout.CUT:
                    arrived.append(rows)
                else:
                    reason, outside = layout.REASONS[why], why in OUTSIDE
                    raise NotCovered(reason, place_of(rows[0])) if outside else _refused(rows[0], reason)
                if self._run > MAX_CYCLES or self._runs > MAX_RUNS or sum(map(len, stopped)) > MAX_ROWS:
                    raise NotCovered("more cycles, or ways, than are allowed", place_of(rows[0]))
            if arrived:  # before the other ways are followed: of forged states the first one ends the work
                self.compare(np.concatenate(arrived))
            states = np.concatenate([states, *stopped])

    def _run_first(self, states: Ints) -> tuple[Ints, int, Ints]:
        """Run the first state and all that go the same way; return them, why they stopped, and the others."""
        s, used = states[0].copy(), np.zeros(COLUMNS, dtype=np.int64)
        edge_at, edge_out = self._plan.edges[s[DUE]]
        board = self.board if s[layout.CYCLE] >= PAUSE else self.board._replace(limit=PAUSE)
        why = chip.run(s, used, edge_at, edge_out, self._memory, board)
        # The run has read nothing else, so all states that agree in these go the same way.
        decide = np.flatnonzero(ALWAYS | (used & layout.READ != 0))
        alike = (states[:, decide] == states[0, decide]).all(axis=1)
        rows, others = states[alike], states[~alike]
        if states[0, layout.STAGE] == layout.BEFORE and s[layout.STAGE] == layout.RUNS:
            first = int(s[layout.CYCLE] - s[layout.TIME] + edge_at[0])
            self._silence = first if self._silence is None else min(first, self._silence)
        cycles = int(s[layout.CYCLE] - rows[0, layout.CYCLE])
        self._run += cycles
        self._runs += 1
        self._cycles += cycles * len(rows)
        changed = np.flatnonzero(CHIP & (ALWAYS | (used & layout.CHANGED != 0)))
        rows[:, changed] = s[changed]
        return rows, why, others

    def _next_frame(self, rows: Ints) -> Ints:
        """Return the rows in their next frames. Raises Refused where an input was not read."""
        self._frames += len(rows)
        for row in rows:
            following = self._following(*row[[FRAME_NUMBER, PLACE]].tolist())
            if following is None:
                raise _refused(row, "an input was not read in the frame")
            row[[FRAME_NUMBER, PLACE, DUE]] = following
        over = rows[:, FRAME_NUMBER] < 0
        rows[:, layout.TIME] -= self._plan.period
        rows[over, layout.STAGE], rows[over, layout.TIME] = layout.OVER, 0
        rows[:, layout.EDGE] = 0
        return rows

    def _after(self, frame: int, number: int) -> tuple[int, int, int] | None:
        """Return what follows frame and place: both and the run of frames; None if an input was not read."""
        place, inputs = self.places[number], self._plan.inputs
        if self._plan.buttons & ~place.sampled:
            return None
        memory = place.memory if inputs.at_once else inputs.hear(place.memory, place.levels)
        position = self._plan.following(frame, memory)
        return position.frame, self.number(Place(position.memory)), self._plan.run_of(position)

    def _both(self, rows: Ints, why: int) -> list[Ints]:
        """Return the rows with the bit in question 0, and with it 1. Raises Refused if it is read again."""
        self._forks += len(rows)
        slot, bit = rows[0, [layout.ASKED, layout.ASKED_BITS]].tolist()
        pin = bit.bit_length() - 1 + (5 if slot == layout.PORTB else 0)
        both = [rows, rows.copy()]
        for level, its in enumerate(both):
            # A level is given for one instruction only, whereas a bit of a register stays as it was chosen.
            stored = layout.CHOSEN if why == layout.BUTTON else slot
            its[:, stored] = its[:, stored] & ~(bit << 8) | bit * level
            if why == layout.BUTTON and its[0, layout.STAGE] == layout.RUNS:
                its[:, PLACE] = [self._sampled(place, pin, level) for place in its[:, PLACE].tolist()]
                for row in its[its[:, PLACE] < 0]:
                    raise _refused(row, "an input is read again")
        return both

    def _reads(self, rows: Ints, wire: WireReads) -> list[Ints]:
        """Return the rows once the wire is read as 0, and as 1. Raises Refused."""
        self._forks += len(rows)
        ways = [rows, rows.copy()]
        for level, its in enumerate(ways):
            for row in its:
                bit = int(row[layout.ASKED_BITS])
                row[layout.CHOSEN] = row[layout.CHOSEN] & ~(bit << 8) | bit * level
                self._read(row, wire, level)
        return ways

    def _read(self, row: Ints, wire: WireReads, level: int) -> None:
        """Let a chip read the wire at a level. Raises Refused."""
        memory, stage, time = self.places[row[PLACE]].memory, row[layout.STAGE], int(row[layout.TIME])
        if stage == layout.OVER:
            return
        if stage == layout.BEFORE:  # so far since power-up
            if wire.restart and row[layout.RESETS] >= 0:
                raise _refused(row, "the wire is read before the first chip was reset")
            row[[layout.STAGE, layout.RESETS]], time = (layout.AWAITS, 0), int(row[layout.CYCLE])
        try:
            step = wire.looks if stage == layout.RUNS else wire.awaits
            found = step(memory, level, time)
        except (ValueError, IndexError) as error:
            raise _refused(row, str(error)) from None
        if found is None:
            return
        sampled = (found.memory[4] == len(LEVELS) and not wire.early) << wire.pin
        row[PLACE] = self.number(Place(found.memory, 0, sampled))
        if found.restarts:
            row[[layout.STAGE, layout.TIME, layout.EDGE, FRAME_NUMBER]] = layout.AWAITS, 0, 0, AWAITED
            row[DUE] = self._plan.run_of(OVER)
        elif found.begins:
            plan, last_look = self._plan, wire.look + (wire.early or len(LEVELS) - 1)
            due = plan.following(row[FRAME_NUMBER], found.memory) if stage == layout.RUNS else plan.first
            row[[layout.STAGE, layout.EDGE, FRAME_NUMBER]] = layout.RUNS, 0, due.frame
            row[layout.TIME] = last_look - wire.period
            row[DUE] = plan.run_of(due)

    def _new(self, rows: Ints, why: int) -> Ints:
        """Return the rows whose states did not stop yet for this reason: a program that waits for what comes
        by itself need not come to a cut. Before the first pulse, which must come, every state is new.

        A state may stop twice in a row: no interrupt comes, and then SLEEP ends in one of several ways.
        """
        rows = np.unique(rows, axis=0)
        states = rows.copy()
        states[:, [*SAYS_NOTHING, *[layout.AGE] * (not self.board.watchdog)]] = 0
        new = np.ones(len(rows), dtype=bool)
        # The ways of the frames end at cuts, or because they are compared; those that await a wire may turn.
        waits = [layout.BEFORE, layout.RUNS] if why == layout.BUTTON else [layout.BEFORE]
        for number, state in enumerate(states):
            if state[layout.STAGE] not in waits and chip.at_rest(state):
                key = why.to_bytes() + hashlib.sha256(state.tobytes()).digest()
                new[number] = key not in self._followed
                self._followed.add(key)
        return rows[new]

    def _happens(self, rows: Ints, why: int) -> list[Ints]:
        """Return the rows on each of the ways that the chip asks for: it comes now, or not yet."""
        self._forks += len(rows)
        ways = []
        for way in _bits(int(rows[0, layout.ASKED_BITS])) if len(rows) else []:
            its = rows.copy()
            its[:, layout.WAY] = way
            if why == layout.SLEEPS and not way & layout.EVERY_FLAG << layout.IS_NOP:
                self._rest(its)
            if way != layout.ENDLESS:
                ways.append(its)
        return ways

    def _rest(self, rows: Ints) -> None:
        """Let nothing be due any more in rows that sleep. Raises Refused if a pulse is due."""
        for row in rows:
            if row[layout.STAGE] == layout.AWAITS:
                raise _refused(row, "SLEEP while the wire is awaited")
            if row[layout.STAGE] == layout.BEFORE:
                if not self.board.watchdog:
                    raise _refused(row, "SLEEP before the first pulse, and nothing has to end it")
            elif row[layout.STAGE] == layout.RUNS:
                made = row[layout.EDGE] == len(self._plan.edges[row[DUE]][0])
                if not made or not self._plan.silent_after(int(row[FRAME_NUMBER])):
                    raise _refused(row, "SLEEP while pulses are due")
                row[[layout.STAGE, layout.TIME, FRAME_NUMBER, layout.EDGE]] = layout.OVER, 0, OVER.frame, 0
                row[PLACE], row[DUE] = self.number(Place(OVER.memory)), self._plan.run_of(OVER)

    def _sample(self, number: int, pin: int, level: int) -> int:
        """Return the number of the place once a pin was read; -1 if it was read before in this frame."""
        place = self._plan.sample(self.places[number], pin, level)
        return self.number(place) if place else -1

    def compare(self, rows: Ints) -> None:
        """Raise Refused for a row that is within no listed state."""
        missing = np.ones(len(rows), dtype=bool)
        for shape, listed in self._listed:
            numbers = np.array([listed.get(key, -1) if key else -1 for key in listed_keys(rows, shape)])
            # A write that is over earlier is over in as many ways, or fewer; a watchdog that was cleared
            # later times out later.
            ages = [layout.WRITE_LEFT, *[layout.AGE] * bool(self.board.watchdog)]
            later = (rows[:, ages] <= self.states[numbers][:, ages]).all(axis=1)
            missing &= (numbers < 0) | ~later
        for row in rows[missing]:
            raise _refused(row, "the state is within no listed one")


def _refused(row: Ints, reason: str) -> Refused:
    """Return what is wrong, and where."""
    return Refused(f"{place_of(row)}: {reason}")


def place_of(row: Ints) -> str:
    """Return where a chip is: cycle, state, address, frame, pins."""
    frame = f"frame {row[FRAME_NUMBER]}, cycle {row[layout.TIME]}"
    if row[layout.STAGE] != layout.RUNS:
        frame = {
            layout.BEFORE: "before the first pulse",
            layout.AWAITS: f"awaiting the wire, cycle {row[layout.TIME]}",
        }.get(int(row[layout.STAGE]), "after the last pulse")
    origin = "power-up" if row[ORIGIN] < 0 else f"state {row[ORIGIN]}"
    levels = (row[layout.PORTA] | row[layout.PORTA] >> 8) & 0x1F | (
        row[layout.PORTB] | row[layout.PORTB] >> 8
    ) << 5
    driven = levels & ~(row[layout.TRISA] | row[layout.TRISB] << 5)
    high = " ".join(pin for bit, pin in enumerate(PINS) if driven >> bit & 1) or "none"
    where = f"{row[layout.CYCLE]} cycles after {origin}, at address 0x{row[layout.PC]:03X}, {frame}"
    return f"{where}, high pins: {high}"


def _bits(word: int) -> list[int]:
    """Return the bits of a word."""
    return [1 << bit for bit in range(word.bit_length()) if word >> bit & 1]


def listed_keys(rows: Ints, shape: Ints) -> list[bytes | None]:
    """Return the keys of the listed states that contain each of `rows`, among those whose unknown bits, and
    bytes that move with φ, are as in `shape`; None for a row that none can contain.

    One φ fits all bytes that move if they differ from TMR0 as the listed ones do.
    """
    cells, unknown, moves = rows[:, BYTES].astype(np.int32), shape >> 8 & 0xFF, shape >> 16 == 1
    timer = cells[:, -1:]
    together = (cells >> 8 == timer >> 8) & (timer & layout.UNKNOWN == 0)
    doubt = np.where(cells >> 16, 0xFF, cells >> 8)
    fits = np.where(moves, together, doubt & ~unknown == 0).all(axis=1)
    values = np.where(moves, cells - timer, cells) & 0xFF & ~unknown
    count = rows[:, [layout.PRESCALER]] * (shape[-1] & layout.UNKNOWN == 0)
    keys = np.hstack([rows[:, EXACT], count, values])
    return [key.tobytes() if fit else None for key, fit in zip(keys, fits, strict=True)]


def _restrictions(held: dict[str, int], plan: Plan, allowed: Collection[str]) -> tuple[str, ...]:
    """Return the levels at which the certificate holds pins, and why that is no gap. Raises Refused."""
    texts = []
    for pin, level in held.items():
        if (pin, level) in plan.stated:
            texts.append(f"{pin} held at {level}, the only level that the schedule is about")
        elif pin in allowed:
            texts.append(f"{pin} held at {level}, as was allowed")
        else:
            raise Refused(
                f"it holds {pin} at {level}: the theorem is about every level, unless this is allowed"
            )
    return tuple(texts)


def unfit_clock(image: Image, clock_hz: int) -> str:
    """Return why a program's configuration word does not go with a clock; empty if it does."""
    config = RC if image.config is None else image.config
    exact = clock_hz <= FASTEST[config & RC]
    return "" if exact else "the oscillator that the configuration word selects has no exact frequency"


def watchdog_cycles(image: Image, clock: Clock) -> int:
    """Return the shortest period of the watchdog; 0 if it is off."""
    watched = image.config is None or image.config & WATCHDOG_ON
    return int(WATCHDOG_US / clock.cycle_us) if watched else 0


def check_certificate(
    certificate: Certificate,
    image: Image,
    schedule: bytes,
    file: str,
    allowed: Collection[str] = (),
    any_eeprom: bool = False,
    tape: bytes = b"",
) -> Checked:
    """Return what was run to check the certificate of a program against a schedule, the contents of `file`,
    and the content of its tape.

    The certificate may hold the pins that are `allowed`, and those at the one level that a schedule without a
    rule for them states. Raises Refused if it does not prove the rest, InputError if there is no schedule.
    """
    plan = read_plan(schedule, file, tape)
    if certificate.image != fingerprint(image):
        raise Refused("the certificate is of another program")
    unfit = unfit_clock(image, plan.clock_hz)
    if unfit:
        raise Refused(unfit)
    if plan.clock_hz > plan.fastest:
        raise Refused("the clock is faster than the chip")
    if certificate.schedule != hashlib.sha256(schedule).hexdigest() or certificate.clock_hz != plan.clock_hz:
        raise Refused("the certificate is of another schedule")
    if certificate.tape != (hashlib.sha256(tape).hexdigest() if plan.tape else ""):
        raise Refused("the certificate is of another tape")
    if plan.tape and any(plan.tape.pins >> PINS.index(pin) & 1 for pin in certificate.held):
        raise Refused("it holds a pin of the tape")
    restrictions = _restrictions(certificate.held, plan, allowed)
    checker = Checker(image, plan, certificate, any_eeprom)
    checked = checker.check()
    if checker.reads and checker.writes and not any_eeprom:  # what it reads is what it has written in any run
        checked = Checker(image, plan, certificate, any_eeprom=True).check()
    return replace(checked, restrictions=restrictions)
