"""The law of the prover's chip: n cycles of an abstract state contain n cycles of every chip in it.

    python -m tests.prove.containment --counters
    python -m tests.prove.containment --programs 10000

With `--counters`, for what changes by itself and all 65 536 pairs of a value and its unknown bits. With
`--programs`, for random programs: each runs from a power-up of which nothing is known, and beside it 24
chips with random contents, levels and times. Wherever the abstract chip can go on in several ways, each chip
must be in one of them. The judge is `reference.Chip`, or for all chips but one the plain simulator.
Exit code 1 if a chip is in none.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from servogen.pic.device import CONFIG_OSCILLATOR_MASK, CONFIG_WATCHDOG_ON, OSCILLATORS, RAM_FIRST, RAM_LAST
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.prove.chip import (
    BASE,
    CELL_MASK_SHIFT,
    FIELD,
    AbstractChip,
    AssumedBits,
    ChipState,
    Reason,
    RunOutcome,
    Use,
)
from servogen.prove.forks import Choices, PreparedProgram, before_instruction, ways_of
from servogen.simulator import SimulatorOptions
from servogen.simulator import layout as at
from servogen.simulator.core import loop
from servogen.simulator.layout import EEIE, EEIF, WR
from servogen.simulator.regions import program_code
from servogen.simulator.reset_state import power_up
from tests.simulator.helpers import CLOCK
from tests.simulator.programs import tame_image
from tests.simulator.reference import Chip, number

Vector = npt.NDArray[np.int64]

CHIPS, MOMENTS = 24, 100
EDGES = 1024
WATCHDOG_OFF = 0x3FF1
EXCUSED = 1 << 30
START_UP = 256
"""Cycles of the oscillator after SLEEP."""
PHASES = 4
EEPROM_US = 60
"""The longest write, short beside a program's run."""
RAM = range(RAM_FIRST, RAM_LAST + 1)
COMPARED = {
    "PC": 0x3FF, "STATUS": 0xFF, "W": 0xFF, "FSR": 0xFF, "PCLATH": 0x1F, "OPTION": 0xFF, "SLEEPING": 1,
    "TMR0": 0xFF, "PRESCALER": 0xFF, "EEDATA": 0xFF, "EEADR": 0xFF, "EECON1": 0x1F, "INTCON": 0xFF,
    "PINS": 0x1FFF, "LATCH": 0x1FFF, "TRIS": 0x1FFF, "RB_OLD": at.RB4_TO_7, "DEPTH": 0xF,
}  # fmt: skip
"""What a chip's state is compared in besides its RAM and stack, and the bits of it."""
_BITS = np.array([*COMPARED.values(), *[0xFF] * len(RAM), *[0x1FFF] * 8])
_SLOTS = np.array([*(at.ROW[name].number for name in COMPARED), *RAM])
_NAMES = [*COMPARED, *(f"0x{address:02X}" for address in RAM), *(f"STACK{n}" for n in range(8))]


@dataclass(frozen=True)
class Surroundings:
    """What differs between chips: contents at power-up, (cycle, pin, level) from outside, and times."""

    start: tuple[tuple[str, int], ...]
    levels: list[tuple[int, int, int]]
    eeprom_us: int
    tmr0_phase: int
    watchdog_us: int


class Plain:
    """The plain simulator, one chip."""

    def __init__(self, image: Image, around: Surroundings, name: int = 0) -> None:
        options = SimulatorOptions(
            start=around.start,
            eeprom_write_us=around.eeprom_us,
            tmr0_phase=around.tmr0_phase,
            watchdog_us=around.watchdog_us,
        )
        self.name = name
        s = power_up(image, CLOCK, options, tracked=False)
        packed = [cycle << at.PACK_CYCLE | pin << at.PACK_PIN | level for cycle, pin, level in around.levels]
        s[at.STIM_COUNT] = len(packed)
        s[at.EDGE_LIMIT] = EDGES - 64
        none = np.zeros(at.REGION, dtype=np.int64)
        self._shared = (np.array(packed, dtype=np.int64), program_code(image), none)
        self._run = loop(observed=False, tracked=False)
        self._begin(s)

    def _begin(self, s: Vector) -> None:
        self._s, self._edges = s, np.zeros(EDGES, dtype=np.int64)
        pointers = [array.ctypes.data for array in (s, self._edges, *self._shared)]
        state, edges, stimuli, code, none = pointers
        self._arguments = (edges, stimuli, code, code, none, none, none, -1, none, none)
        self._state = state

    def snapshot(self) -> Vector:
        """Return the state."""
        return self._s.copy()

    def at(self, state: Vector, first: bool) -> Plain:
        """Return this chip in a state, or another one like it."""
        if first:
            self._s[:] = state
            return self
        other = copy(self)
        other._begin(state)
        return other

    @property
    def now(self) -> int:
        return int(self._s[at.CYCLE])

    @property
    def asleep(self) -> bool:
        return bool(self._s[at.SLEEPING])

    def advance(self, cycle: int) -> None:
        """Run until `cycle`, or to the end of the instruction that is executed then."""
        self._run(self._state, cycle, *self._arguments)

    def compared(self) -> Vector:
        """Return what is compared."""
        s = self._s
        seen = np.zeros(len(_NAMES), dtype=np.int64)
        seen[: len(_SLOTS)] = s[_SLOTS]
        depth, top = int(s[at.DEPTH]), int(s[at.SP])
        for level in range(depth):
            seen[len(_SLOTS) + level] = s[at.STACK + (top - depth + level) % 8]
        return seen

    def changes(self) -> list[tuple[int, int, int]]:
        """Return the edges since the last call: (cycle, pin, level)."""
        found = self._edges[: self._s[at.EDGE_COUNT]].tolist()
        self._s[at.EDGE_COUNT] = 0
        return [(each >> at.PACK_CYCLE, each >> at.PACK_PIN & 0x3F, each & at.PACK_LEVELS) for each in found]


class Second(Chip):
    """The reference chip, which stops as each cycle has begun."""

    def __init__(self, image: Image, around: Surroundings, begun: bool = True) -> None:
        super().__init__(
            image,
            watchdog_cycles=around.watchdog_us,
            eeprom_cycles=around.eeprom_us,
            tmr0_phase=around.tmr0_phase,
            stimuli=around.levels,
        )
        start = dict(around.start)
        self.w, self.fsr, self.tmr0 = start["w"], start["fsr"], start["tmr0"]
        self.eedata, self.eeadr, self.status = start["eedata"], start["eeadr"], 0x18 | start["flags"]
        self.eecon1, self.intcon = start["wrerr"] << 3, start["rbif"]
        self.latch = [start["latches"] >> pin & 1 for pin in range(13)]
        self.old_b = [0] * 4 + [start["rb-old"] >> pin & 1 for pin in range(4)]
        self.ram = [start[f"0x{address:02X}"] for address in RAM]
        if begun:
            self.begin()

    def advance(self, cycle: int) -> None:
        while self.now < cycle or (self.now < self.busy_until and not self.asleep):
            self.act()
            self.now += 1
            self.begin()

    def compared(self) -> Vector:
        values = {
            "PC": self.pc, "STATUS": self.status, "W": self.w, "FSR": self.fsr, "PCLATH": self.pclath,
            "OPTION": self.option, "SLEEPING": self.asleep, "TMR0": self.tmr0, "PRESCALER": self.prescaler,
            "EEDATA": self.eedata, "EEADR": self.eeadr, "EECON1": self.eecon1, "INTCON": self.intcon,
            "PINS": number(self.pins), "LATCH": number(self.latch), "TRIS": number(self.tris),
            "RB_OLD": number(self.old_b) << 5, "DEPTH": self.depth,
        }  # fmt: skip
        stack = [self.stack[(self.sp - self.depth + level) % 8] for level in range(self.depth)]
        return np.array([*values.values(), *self.ram, *stack, *[0] * (8 - self.depth)])


def known(state: ChipState) -> tuple[Vector, Vector]:
    """Return the values of an abstract state and its unknown bits, as `Concrete.compared` orders them."""
    cells = np.array(state.ram, dtype=np.int64)
    stack = [state[f"STACK{level}"] for level in range(8)]
    values = np.array([*(state[name] for name in COMPARED), *(cells & 0xFF).tolist(), *stack])
    masks = [state[f"{name}_UNKNOWN"] if f"{name}_UNKNOWN" in FIELD else 0 for name in COMPARED]
    masks[list(COMPARED).index("SLEEPING")] = state["SLEEPING"]  # it may end at once
    if state["EE_DONE_AT"] != at.NEVER:  # the write may be over at any time
        masks[list(COMPARED).index("EECON1")] |= WR | EEIF
    if state["OPTION"] & at.PSA:  # the watchdog counts it, which is judged by when it times out
        masks[list(COMPARED).index("PRESCALER")] = 0xFF
    return values, np.array([*masks, *(cells >> CELL_MASK_SHIFT).tolist(), *[0] * 8])


def outside(state: ChipState, chip: Vector) -> list[str]:
    """Return where a chip differs from an abstract state, by name."""
    values, unknown = known(state)
    return [_NAMES[place] for place in np.flatnonzero((values ^ chip) & ~unknown & _BITS)]


# Programs -------------------------------------------------------------------------------------------------


def surroundings(rng: random.Random, cycles: int) -> Surroundings:
    byte = (0, 1, 0xFF, rng.randrange(256))
    start = {
        name: rng.choice((*byte, rng.randrange(256))) for name in ("w", "fsr", "tmr0", "eedata", "eeadr")
    }
    start |= {"flags": rng.randrange(8), "wrerr": rng.randrange(2), "rbif": 0, "rb-old": rng.randrange(16)}
    start |= {"latches": rng.randrange(1 << 13)}
    start |= {f"0x{address:02X}": rng.choice((*byte, rng.randrange(256))) for address in RAM}
    levels = [(0, pin, rng.randrange(2)) for pin in range(13)]
    for pin in range(13):
        changes = rng.sample(range(1, cycles), rng.choice((0, 1, 5, 40)))
        levels += [(cycle, pin, rng.randrange(2)) for cycle in sorted(changes)]
    levels.sort(key=lambda level: level[0])
    times = (rng.randint(1, EEPROM_US), rng.randrange(PHASES), rng.randint(7000, 33_000))
    return Surroundings(tuple(start.items()), levels, *times)


@dataclass
class Group:
    """Chips that are all in one abstract state, at their own cycles (a sleep may last differently long)."""

    state: ChipState
    chips: dict[tuple[int, int], Plain]
    """By name and cycle."""
    chosen: Choices = ()
    use: Use | None = None
    wrote: bool = False
    read: bool = False


class End:
    """Where a way leads: an outcome and its state, prepared to be compared with chips."""

    def __init__(self, outcome: RunOutcome, state: ChipState) -> None:
        self.outcome, self.state = outcome, state
        values, unknown = known(state)
        self._care = ~unknown & _BITS
        self._values = values & self._care

    def contains(self, chip: Plain) -> bool:
        """Return whether the chip is one of those that the state stands for."""
        return self.holds(chip.compared())

    def holds(self, compared: Vector) -> bool:
        """Return the same for what is compared of one chip, or of several."""
        return bool((compared & self._care == self._values).all())


class Follower:
    """Follows one program on the abstract chip and on the chips in it."""

    def __init__(self, image: Image, seed: int, cycles: int = 2500, chips: int = CHIPS) -> None:
        self._rng = random.Random(seed)
        # An interrupt of an unknown TMR0 has 256 ways.
        self.program = PreparedProgram(image, tells_timers=seed % 20 == 0)
        options = SimulatorOptions(eeprom_write_us=EEPROM_US)
        self.abstract = AbstractChip(image, CLOCK, options, write_us=EEPROM_US)
        program = self.program
        self.stops = program.port_reads() | program.option_writes() | program.sleeps | program.eeprom_accesses
        self.cycles = cycles
        every = [surroundings(self._rng, cycles) for _ in range(chips)]
        self._start_up = START_UP if image.chip_config & CONFIG_OSCILLATOR_MASK != OSCILLATORS["RC"] else 0
        self.chips = [Plain(image, around, name) for name, around in enumerate(every)]
        self._copies = Counter(range(chips))
        """How many states each chip may be in: what tells them apart may show later only."""
        self._second = Second(image, every[0])
        self._seen: dict[int, Vector] = {}
        """What the first chip was, by cycle."""
        self.counts: Counter[str] = Counter()
        self.wrong: list[str] = []

    def follow(self) -> None:
        """Follow all ways in which there are chips; then compare the first chip with the reference."""
        groups = [Group(self.abstract.power_on(), {(chip.name, 0): chip for chip in self.chips})]
        for _ in range(MOMENTS):
            limit, following = self._rng.choice((1, 2, 7, 30, 60)), dict[object, Group]()
            for group in groups:
                for one in self._step(group, limit):
                    # Chips that come to the same state by other ways, or at other times, go on together.
                    same = following.setdefault((one.state, one.use, one.wrote, one.read), one)
                    same.chips.update(one.chips)
                if self.wrong:
                    return
            groups = [*following.values()]
        for cycle, seen in sorted(self._seen.items()):
            self._second.advance(cycle)
            differs = [_NAMES[place] for place in np.flatnonzero((self._second.compared() ^ seen) & _BITS)]
            if self._second.now != cycle or differs:
                self.wrong.append(f"cycle {cycle}: the simulator and the reference chip differ: {differs}")
                return

    def _ways(self, group: Group) -> list[Choices] | None:
        """Return the ways from a state as `prove.explore` takes them."""
        state = group.state
        if state["SLEEPING"]:
            intcon = state["INTCON"]
            flags = [1 << bit for bit in range(3) if (intcon >> 3 & state["INTCON_UNKNOWN"]) >> bit & 1]
            ways: list[Choices] = [(AssumedBits("INTCON", flag, flag),) for flag in flags]
            ways += [(AssumedBits("WATCHDOG", 0, 0),)] if self.abstract.watchdog else []
            done = intcon & EEIE and state["EE_DONE_AT"] != at.NEVER
            return [*ways, (AssumedBits("EE_DONE", 0, 0),)] if done else ways
        before: list[Choices] = [group.chosen]
        if not group.chosen and state["PC"] & 0x3FF in self.stops:
            group.read = group.read or self.program.reads_eeprom(state)
            before = before_instruction(self.program, state, frozenset(), PHASES)
        if group.use is None:
            return before
        every: list[Choices] = []
        for chosen in before:
            ways_on = ways_of(self.program, state, group.use, chosen)
            if ways_on is None:
                return None
            every += ways_on
        return every

    def _outcomes(self, group: Group, limit: int) -> tuple[list[RunOutcome], bool]:
        """Return what the ways from a state lead to, and whether every way could be followed."""
        points, found, refused, tries = [group], [], False, 0
        while points:
            point = points.pop()
            ways = self._ways(point)
            tries += 1
            if ways is None or tries > 300:
                return found, True
            for choices in ways:
                outcome = self.abstract.run(group.state, self.stops, limit, choices)
                if outcome.reason is Reason.USE and outcome.cycles == 0:
                    points.append(replace(point, chosen=choices, use=outcome.use))
                elif outcome.reason is Reason.WARNING:
                    refused = True
                else:
                    found.append(outcome)
            group.read = group.read or point.read
        return found, refused

    def _step(self, group: Group, limit: int) -> Iterator[Group]:
        """Yield the groups into which one goes on; note chips that are in none of the states."""
        outcomes, refused = self._outcomes(group, limit)
        outcomes.sort(key=lambda outcome: outcome.cycles)
        ends = [End(outcome, outcome.state(group.state)) for outcome in outcomes]
        kept: list[dict[tuple[int, int], Plain]] = [{} for _ in ends]
        for chip in group.chips.values():
            places = self._places(chip, group.state, ends)
            for place, there in places:
                kept[place][there.name, there.now] = there
            if not places and (refused or chip.now > self.cycles - 2 * limit):
                self._excuse("refused" if refused else "ended", [(chip.name, chip.now)])
            self._copies[chip.name] += len(places) - 1
            if places or self._copies[chip.name] > 0:
                continue
            last = [(end.outcome.cycles, outside(end.state, chip.compared())) for end in ends]
            self.wrong.append(f"chip {chip.name}, cycle {chip.now}, from {group.state['PC']:#x}: {last}")
            return
        for end, chips in zip(ends, kept, strict=True):
            wrote = group.wrote or end.state["EE_DONE_AT"] != at.NEVER
            if wrote and (group.read or not self.program.eeprom_accesses):
                self._excuse("refused", chips)
            elif chips:
                self.counts["compared"] += len(chips)
                self.counts["states"] += 1
                yield Group(end.state, chips, (), end.outcome.use, wrote, group.read)

    def _excuse(self, why: str, chips: Iterable[tuple[int, int]]) -> None:
        """Count chips that need be in no state: the prover does not go on there, or the levels end."""
        for name, _ in chips:
            self.counts[why] += self._copies[name] < EXCUSED
            self._copies[name] += EXCUSED

    def _places(self, chip: Plain, before: ChipState, ends: Sequence[End]) -> list[tuple[int, Plain]]:
        """Return the states that a chip comes to, each with the chip there; run the chip to the last of
        them.
        """
        sleeps = before["SLEEPING"]
        while sleeps and chip.asleep and chip.now < self.cycles:
            chip.advance(chip.now + 1)
        if sleeps and chip.asleep:
            self._excuse("ended", [(chip.name, chip.now)])
        start = chip.now - (self._start_up if sleeps else 0)
        # A pin that is driven before its latch is written may glitch before the first pulse (docs/proof.md).
        high, glitches, edges = before["DRIVEN_HIGH"], before["LATCH_UNKNOWN"], []
        found = []
        for place, end in enumerate(ends):
            outcome = end.outcome
            chip.advance(start + outcome.cycles)
            for cycle, pin, level in chip.changes():
                if high >> pin & 1 != (level == 1) and not glitches >> pin & 1:
                    high ^= 1 << pin
                    edges.append((cycle - start, pin, int(level == 1)))
            same = edges == [edge for edge in outcome.edges if not glitches >> edge[1] & 1]
            # What ends a SLEEP in the cycle in which it begins has done so before it can be seen.
            late = self._start_up if end.state["SLEEPING"] and not chip.asleep else 0
            if same and chip.now == start + outcome.cycles + late and end.contains(chip):
                found.append((place, chip.snapshot()))
                if chip.name == 0:
                    self._seen[chip.now] = chip.compared()
        return [(place, chip.at(state, first=n == 0)) for n, (place, state) in enumerate(found)]


def program(seed: int) -> Image:
    """Return a random program whose latches are written before any pin is driven, so that it goes on; often
    also TMR0 is.
    """
    rng = random.Random(seed)
    first = [encode("CLRF", f=5), encode("CLRF", f=6)]
    timer = [encode("MOVLW", k=rng.randrange(256)), encode("MOVWF", f=1)]
    image = tame_image(seed, [*first, *(timer if rng.random() < 0.7 else [])])
    return image if rng.random() < 0.2 else replace(image, config=image.chip_config & ~CONFIG_WATCHDOG_ON)


def programs(count: int, seed: int, seconds: float = np.inf) -> tuple[Counter[str], list[str]]:
    """Return the counts of what was compared, and the chips that are in no state of the abstract one."""
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    began = time.monotonic()
    for number_ in range(seed, seed + count):
        if time.monotonic() - began > seconds:
            break
        follower = Follower(program(number_), number_)
        follower.follow()
        counts += follower.counts
        counts["programs"] += 1
        if follower.wrong:
            wrong.append(f"program {number_}: {follower.wrong[0]}")
            print(wrong[-1], flush=True)
    return counts, wrong


# What changes by itself -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Counting:
    """A register that changes by itself: one byte of it has unknown bits, and some cycles pass.

    The program is `words`, then NOPs; `rest` is known of the state beside what is unknown after power-up.
    """

    name: str
    field: str
    rest: dict[str, int]
    words: tuple[int, ...] = ()
    times: tuple[int, ...] = (2, 5, 40)
    shift: int = 0
    """The number of the byte's lowest bit in `field`."""
    bits: int = 0xFF
    choices: Choices = ()
    held: dict[int, int] | None = None
    levels: tuple[tuple[int, int, int], ...] = ()
    """From outside, which the abstract chip is not told of: (cycle, pin, level)."""

    @property
    def image(self) -> Image:
        words = [*self.words, *[encode("NOP")] * (1023 - len(self.words)), encode("GOTO", k=0)]
        return Image(dict(enumerate(words)), WATCHDOG_OFF)

    def state(self, chip: AbstractChip, value: int, mask: int) -> ChipState:
        """Return the state with this byte and these unknown bits of it."""
        fields = self.rest | {
            self.field: (value & self.bits) << self.shift,
            f"{self.field}_UNKNOWN": (mask & self.bits) << self.shift,
        }
        on = chip.power_on()
        rest = [fields.get(name, old) for name, old in zip(FIELD, on.rest, strict=True)]
        return ChipState(on.ram, tuple(rest))

    def truth(self) -> Vector:
        """Return what the reference chip is at each of `times`, for each value of the byte."""
        rows = []
        for value in range(256):
            fields = self.rest | {self.field: (value & self.bits) << self.shift}
            levels = [*((0, pin, level) for pin, level in (self.held or {}).items()), *self.levels]
            start = dict.fromkeys(("fsr", "eedata", "eeadr", "flags", "wrerr", "rbif", "latches"), 0)
            start |= {"w": fields.get("W", 0), "tmr0": fields.get("TMR0", 0)}
            start |= {"rb-old": fields.get("RB_OLD", 0) >> 9} | {f"0x{address:02X}": 0 for address in RAM}
            chip = Second(self.image, Surroundings(tuple(start.items()), levels, 1, 0, 7000), begun=False)
            chip.option = chip.option_in_force = fields.get("OPTION", 0xFF)
            chip.prescaler = fields.get("PRESCALER", 0)
            tris = fields.get("TRIS", 0x1FFF)
            chip.tris = [tris >> pin & 1 for pin in range(13)]
            chip.begin()
            chip.look(0)
            for time_ in self.times:
                chip.advance(time_)
                rows.append(chip.compared())
        return np.array(rows).reshape(256, len(self.times), -1)


def _counted() -> tuple[Counting, ...]:
    timer, prescaler = {"TMR0_UNKNOWN": 0}, {"PRESCALER_UNKNOWN": 0}
    wrote = (encode("MOVWF", f=1),)
    found = []
    for option in (0x88, 0x80, 0x82, 0x87):
        known_ = {"OPTION": option} | prescaler
        found.append(Counting(f"TMR0 is written, OPTION_REG {option:#x}", "W", known_ | timer, wrote))
        found.append(Counting(f"TMR0 counts, OPTION_REG {option:#x}", "TMR0", known_))
    for option in (0x80, 0x84):
        rest = {"OPTION": option, "TMR0": 0xFE} | timer
        found.append(Counting(f"the prescaler counts, OPTION_REG {option:#x}", "PRESCALER", rest))
    given = {"OPTION": 0x88, "TMR0": 0xFE, "W": 0x82, "W_UNKNOWN": 0} | timer
    phase = (AssumedBits("TMR0_PHASE", 0, 0),)
    reassigned = (encode("OPTION"),)
    found.append(Counting("the prescaler becomes TMR0's", "PRESCALER", given, reassigned, choices=phase))
    levels = {9: 1, 10: 0, 11: 1, 12: 0}
    compares = (encode("NOP"), encode("MOVF", f=6, d=0), encode("BCF", f=0x0B, b=0))
    found.append(Counting("RBIF compares", "RB_OLD", {}, compares, (1, 3, 9), 9, 0x0F, held=levels))
    edges = tuple((cycle, 4, cycle // 2 % 2) for cycle in range(0, 160, 2))
    for option in (0xA8, 0xA0, 0xB2):  # T0CKI may have an edge in any cycle
        known_ = {"OPTION": option} | prescaler
        found.append(Counting(f"TMR0 counts RA4, OPTION_REG {option:#x}", "TMR0", known_, levels=edges))
    known_ = {"OPTION": 0xA0, "TMR0": 0xFE} | timer
    found.append(Counting("the prescaler counts RA4", "PRESCALER", known_, levels=edges))
    return tuple(found)


COUNTED = _counted()


def counters(case: Counting, pairs: Iterable[tuple[int, int]]) -> list[str]:
    """Return the pairs of a value and its unknown bits, and the cycles, after which a chip is missing."""
    chip = AbstractChip(case.image, CLOCK, SimulatorOptions(), held=case.held)
    truth, values = case.truth(), np.arange(256)
    wrong = []
    # The value of an unknown bit is not part of a state: the 65 536 pairs make 3^8 states.
    for value, mask in dict.fromkeys((value & ~mask, mask) for value, mask in pairs):
        state, inside = case.state(chip, value, mask), (values ^ value) & ~mask & case.bits == 0
        for number_, time_ in enumerate(case.times):
            outcome = chip.run(state, frozenset(), time_, case.choices)
            if outcome.reason is Reason.LIMIT:
                end = End(outcome, outcome.state(state))
                if not end.holds(truth[inside, number_]):
                    wrong.append(f"{case.name}: {value:#04x}, unknown {mask:#04x}, {time_} cycles")
            else:
                wrong.append(f"{case.name}: {value:#04x}, unknown {mask:#04x}: {outcome.reason}")
    return wrong


def postscaler(pairs: Sequence[tuple[int, int]]) -> list[str]:
    """Return the pairs of the prescaler with which, given to the watchdog, it times out too early."""
    image = Image({0: encode("OPTION"), **{n: encode("NOP") for n in range(1, 1024)}}, 0x3FF5)
    chip = AbstractChip(image, CLOCK, SimulatorOptions())
    wrong = []
    for scale in (0, 2, 7):
        rest = {"OPTION": 0x87, "W": 0x88 | scale, "W_UNKNOWN": 0}
        case = Counting(
            "the watchdog's postscaler", "PRESCALER", rest, choices=(AssumedBits("TMR0_PHASE", 0, 0),)
        )
        division = 1 << scale
        for value, mask in dict.fromkeys((value & ~mask, mask) for value, mask in pairs):
            outcome = chip.run(case.state(chip, value, mask), frozenset(), 1, case.choices)
            if outcome.reason is Reason.WARNING:
                continue  # it may time out at once
            due = outcome.rest[FIELD["WDT_EARLIEST"]] - BASE + outcome.cycles
            # It has the count that the prescaler had (DS35007 section 6.10), each count one period.
            inside = [one for one in range(256) if (one ^ value) & ~mask & 0xFF == 0]
            counts = [(one + outcome.cycles) % division for one in inside]
            if due > min(division - count for count in counts) * 7000:
                wrong.append(f"{case.name}: {value:#04x}, unknown {mask:#04x}, 1:{division}")
    return wrong


def every_pair(stride: int = 1, first: int = 0) -> Iterator[tuple[int, int]]:
    """Yield pairs of a byte and the mask of its unknown bits, each `stride`-th of the 65 536."""
    for pair in range(first, 1 << 16, stride):
        yield pair >> 8, pair & 0xFF


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--counters", action="store_true")
    parser.add_argument("--programs", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0, help="number of the first program")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no program after these")
    wanted = parser.parse_args()
    wrong: list[str] = []
    if wanted.counters:
        for case in COUNTED:
            wrong += counters(case, every_pair())
            print(f"{case.name}: 65536 pairs, {len(wrong)} wrong so far", flush=True)
        wrong += postscaler([*every_pair()])
        print(f"the watchdog's postscaler: 65536 pairs, {len(wrong)} wrong so far", flush=True)
    if wanted.programs:
        counts, missing = programs(wanted.programs, wanted.seed, wanted.seconds)
        print(dict(counts))
        wrong += missing
    print(*wrong[:20], f"{len(wrong)} wrong", sep="\n")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
