"""A run of one chip that shows a stream program's fault: lines are tried on the plain simulator.

In: an image, the numbers of its stream, and what the failure of a lemma names. Out: a `Counterexample`, whose
line, EEPROM and start values make a pulse that no chip of the specification makes, or nothing.

The specification is `chip.Chip`. When within its time a command is executed is open, so the run is compared
with every chip that it allows: after each pulse those remain that would have made it.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from servogen.edges import HIGH, LOW, PINS
from servogen.engines.board import board_of
from servogen.engines.protocol import EngineJob
from servogen.engines.stream.layout import ROUND
from servogen.engines.stream.protocol import (
    BITS,
    FINE_SERVOS,
    MAX_VALUE,
    NO_TRIM,
    SYNC,
    TRIM_ZERO,
    CommandKind,
    group_begins,
    group_goes,
    position_command,
    speed_command,
)
from servogen.engines.stream.settings import UNIT
from servogen.engines.stream.streaming import Streaming
from servogen.pic.device import EEPROM_BYTES
from servogen.pic.image import Image
from servogen.prove.counterexample import Counterexample, pin_changes
from servogen.prove.specification import Edge
from servogen.prove.stream.bits import byte
from servogen.prove.stream.chip import NOTHING, StreamChip
from servogen.pulse.schedule import START_FRAMES
from servogen.simulator import Levels, Machine, SimulatorOptions, Stimuli
from servogen.simulator.layout import GLITCH

PAUSES_S = {CommandKind.TRIM: Fraction(30, 1000), CommandKind.QUERY: Fraction(25, 1000)}
"""The time for which the sender leaves the line idle after a command: docs/firmware.md, "Protocol"."""
MAX_ERROR = 190
"""The sender's maximum error in 1/10 000: less than 2 %, because its edges are rounded to cycles."""
VOID = bytes((SYNC, NOTHING, 0))
"""A command that changes nothing; after it no other one is begun."""
FIRST_LINES, SUSPECTED_LINES, MORE_LINES = 20, 100, 300
"""How many lines are tried before the proof, and where it fails: about what it names, and at random."""
LINE_S = 2
"""The minimum duration of a line."""
MAX_CHIPS = 200
"""The number of chips of the specification that a run is compared with; with more it is not judged."""


@dataclass(frozen=True, slots=True)
class Suspect:
    """Where a lemma fails, as far as the solver names it."""

    chip: StreamChip | None = None
    """The variables, known, for which it fails."""
    second: int | None = None
    third: int | None = None
    """The bytes of the command."""


NOBODY = Suspect()


@dataclass(frozen=True, slots=True)
class Sent:
    """A command on the line; its last stop bit is there in cycles `begins` to `ends`."""

    begins: int
    ends: int
    second: int
    third: int

    def __str__(self) -> str:
        return f"{SYNC:02X} {self.second:02X} {self.third:02X}"


@dataclass(slots=True)
class Sender:
    """A line, written from left to right."""

    streamed: Streaming
    dice: random.Random
    now: Fraction = Fraction(0)
    """The cycle, from reset on."""
    levels: list[tuple[int, int]] = field(default_factory=lambda: [(0, HIGH)])
    sent: list[Sent] = field(default_factory=list)
    _partial: list[int] = field(default_factory=list)
    """The bytes of the command that is being sent."""

    @property
    def bit(self) -> Fraction:
        """Return the length of a bit in cycles."""
        return self.streamed.plan.schedule.clock.cycles_per_second / Fraction(self.streamed.stream.baud)

    @property
    def servos(self) -> int:
        return len(self.streamed.neutral)

    def wait(self, cycles: float | Fraction) -> None:
        """Leave the line as it is for a number of cycles, rounded down."""
        self.now += int(cycles)

    def frames(self, frames: float) -> None:
        """Leave the line as it is for a number of frames."""
        self.wait(frames * self.streamed.layout.period)

    def level(self, level: int) -> None:
        """Set the line to a level from now on."""
        self.levels.append((int(self.now), level))

    def byte(self, value: int, rate: Fraction = Fraction(1), stop: bool = True) -> None:
        """Send a byte whose bits are `rate` as long as they should be; without its stop bit it is broken."""
        bit, start, before = self.bit * rate, self.now, HIGH
        for number, level in enumerate((LOW, *(value >> n & 1 for n in range(8)), int(stop))):
            if level != before:
                self.levels.append((int(start + number * bit), level))
                before = level
        self.now = start + BITS * bit
        if not stop:
            self._partial = []
            self.level(HIGH)
            self.wait(BITS * bit)
            return
        if value == SYNC or not self._partial:
            self._partial = [value] if value == SYNC else []
            return
        self._partial.append(value)
        if len(self._partial) == 3:
            _, second, third = self._partial
            self._partial = []
            self.sent.append(Sent(int(start + (BITS - 1) * bit), int(self.now) + 1, second, third))
            self._pause_after(second)

    def _pause_after(self, second: int) -> None:
        per_second = self.streamed.plan.schedule.clock.cycles_per_second
        for kind, pause in PAUSES_S.items():
            if 0 <= second - kind.value < FINE_SERVOS:
                self.wait(pause * per_second)

    def send(self, data: bytes) -> None:
        """Send bytes at one rate, with pauses here and there."""
        rate = 1 / (1 + Fraction(self.dice.randint(-MAX_ERROR, MAX_ERROR), 10_000))
        for value in data:
            if self.dice.random() < 0.25:
                self.wait(self.dice.random() * 3 * self.bit)
            self.byte(value, rate)

    def noise(self, bits: float) -> None:
        """Make noise that is too short for a command, and void what it may have begun."""
        self.send(VOID)
        end = self.now + int(bits * self.bit)
        level = LOW
        while self.now < end:
            self.level(level)
            level = HIGH - level
            self.wait(self.dice.randint(10, 600))
        self.level(HIGH)
        self.wait(2 * BITS * self.bit)
        self._partial = []
        self.send(VOID)

    def glitch(self) -> None:
        """Make a low level that is too short for a start bit."""
        self.wait(BITS * self.bit)
        self.level(LOW)
        self.wait(self.dice.randint(1, UNIT * self.streamed.first_units))
        self.level(HIGH)
        self.wait(BITS * self.bit)


# sending


def _send_at_random(sender: Sender, suspect: Suspect) -> None:
    """Send one thing at random, perhaps what is suspected."""
    dice, n = sender.dice, sender.dice.randrange(sender.servos)
    kinds: tuple[tuple[float, Callable[[], None]], ...] = (
        (30, lambda: sender.send(position_command(n, _third_byte(dice)))),
        (5, lambda: sender.send(speed_command(n, dice.choice((0, 0, 1, 5, 20, 100, 254))))),
        (4, lambda: _send_group(sender)),
        (2, lambda: sender.send(bytes((SYNC, CommandKind.TRIM.value + n, _third_byte(dice))))),
        (2, lambda: sender.send(bytes((SYNC, CommandKind.QUERY.value, dice.randrange(16))))),
        (3, lambda: sender.send(bytes((SYNC, dice.randrange(SYNC), _third_byte(dice))))),
        (3, lambda: sender.send(bytes(dice.choice((SYNC, n, dice.randrange(256))) for _ in range(5)))),
        (2, lambda: sender.send(position_command(n, _third_byte(dice))[: dice.randint(1, 2)])),
        (2, lambda: _send_broken_command(sender)),
        (2, sender.glitch),
        (1, lambda: sender.noise(dice.random() * 15)),
        (6, lambda: sender.frames(dice.random() * 4)),
        (0.4, lambda: sender.frames(sender.streamed.silence_frames + sender.streamed.soft_frames + 3)),
        (12 if suspect.second is not None else 0, lambda: _send_suspect(sender, suspect)),
    )
    dice.choices([send for _, send in kinds], [weight for weight, _ in kinds])[0]()


def _third_byte(dice: random.Random) -> int:
    return dice.choice((0, 1, 127, MAX_VALUE, *(dice.randint(0, MAX_VALUE) for _ in range(6))))


def _send_group(sender: Sender) -> None:
    dice = sender.dice
    sender.send(group_begins())
    for _ in range(dice.randint(0, sender.servos)):
        sender.send(position_command(dice.randrange(sender.servos), _third_byte(dice)))
    sender.send(group_goes(dice.choice((1, 2, 3, 7, 30, MAX_VALUE))))
    sender.frames(dice.random() * 8)


def _send_broken_command(sender: Sender) -> None:
    data = position_command(sender.dice.randrange(sender.servos), _third_byte(sender.dice))
    broken = sender.dice.randrange(len(data))
    sender.send(data[:broken])
    sender.byte(data[broken] & 0x7F, stop=False)


def _send_suspect(sender: Sender, suspect: Suspect) -> None:
    """Send the command that is suspected, after anything, and show what it did."""
    if suspect.second is None:
        return
    third = suspect.third if suspect.third is not None and sender.dice.random() < 0.5 else None
    sender.wait(sender.dice.randrange(sender.streamed.layout.period))
    sender.send(bytes((SYNC, suspect.second, _third_byte(sender.dice) if third is None else third)))


def _approach_state(sender: Sender, chip: StreamChip) -> None:
    """Bring a chip near some variables: its trims are in its EEPROM already."""
    servos = range(sender.servos)
    goals = {}
    for n in servos:
        trim = chip.trim(n).value or 0
        kept = [(chip.widths[n].value or 0), (chip.goals[n].value or 0)]
        travel = sender.streamed.travels[n]
        width, goal = (
            min(max(value - 1, 0), MAX_VALUE)
            if sender.streamed.coarse
            else travel.nearest(value - (trim - 0x10000 if trim >> 15 else trim))
            for value in kept
        )
        goals[n] = goal
        sender.send(position_command(n, width))
    sender.frames(2 + sender.dice.random())
    in_group = [n for n in servos if chip.group[n].known]
    waiting = [n for n in servos if chip.waiting[n].known]
    for n in servos:
        if n not in in_group and n not in waiting:
            sender.send(speed_command(n, min(chip.speeds[n].value or 0, MAX_VALUE)))
            sender.send(position_command(n, goals[n]))
    if in_group:
        sender.send(group_begins())
        for n in in_group:
            sender.send(position_command(n, goals[n]))
        sender.send(group_goes(min(max(chip.frames_left.value or 0, 1), MAX_VALUE)))
    if waiting or chip.gathering.known:
        sender.send(group_begins())
        for n in waiting:
            sender.send(position_command(n, goals[n]))
    silence = (chip.silence.value or 0) - 2
    if silence > 0 and sender.dice.random() < 0.5:
        sender.frames(silence)


def _move_all(sender: Sender) -> None:
    """Move all servos, at once and as a group: what is wrong in the variables then shows."""
    sender.frames(4 * sender.dice.random())
    for n in range(sender.servos):
        sender.send(position_command(n, _third_byte(sender.dice)))
    sender.frames(2)
    _send_group(sender)
    sender.frames(3)


# trials


@dataclass(frozen=True, slots=True)
class _Trial:
    """A chip and its line."""

    options: SimulatorOptions
    eeprom: dict[int, int] | None
    sender: Sender


@dataclass(frozen=True, slots=True)
class CounterexampleSearch:
    """Tries lines on a program."""

    image: Image
    job: EngineJob
    streamed: Streaming
    tell: Callable[[str], None]

    def first(self) -> Counterexample | None:
        """Return what some random lines show: most faults are shown by any."""
        return self._try_lines(range(FIRST_LINES), NOBODY)

    def about(self, suspect: Suspect) -> Counterexample | None:
        """Return what lines show that come near the suspect."""
        return self._try_lines(range(FIRST_LINES, FIRST_LINES + SUSPECTED_LINES + MORE_LINES), suspect)

    def _try_lines(self, seeds: range, suspect: Suspect) -> Counterexample | None:
        for seed in seeds:
            self.tell(f"lines tried: {seed - seeds.start} of {len(seeds)}")
            near = suspect if seed < FIRST_LINES + SUSPECTED_LINES else NOBODY
            counterexample = self._run(self._trial(random.Random(seed), near))
            if counterexample is not None:
                return counterexample
        return None

    def _trial(self, dice: random.Random, suspect: Suspect) -> _Trial:
        streamed, servos = self.streamed, len(self.streamed.neutral)
        board = board_of(streamed.plan.schedule, SimulatorOptions(device=self.job.device.name))
        if dice.random() < 0.3:
            board = replace(board, start_seed=dice.randrange(1 << 16), tmr0_phase=dice.randrange(4))
        eeprom = None
        if suspect.chip is not None:
            eeprom = {n: trim.value or 0 for n, trim in enumerate(suspect.chip.trims)}
        elif dice.random() < 0.5:
            eeprom = {n: dice.choice((NO_TRIM, 0, TRIM_ZERO, dice.randrange(256))) for n in range(servos)}
        sender = Sender(streamed, dice)
        sender.frames(3 + dice.random())
        if suspect.chip is not None:
            _approach_state(sender, suspect.chip)
        if suspect is not NOBODY:
            _send_suspect(sender, suspect)
            _move_all(sender)
        end = sender.now + LINE_S * streamed.plan.schedule.clock.cycles_per_second
        while sender.now < end:
            _send_at_random(sender, suspect)
        _move_all(sender)
        return _Trial(board, eeprom, sender)

    def _run(self, trial: _Trial) -> Counterexample | None:
        """Return what is wrong with a plain run."""
        schedule, sender = self.streamed.plan.schedule, trial.sender
        image = self.image
        if trial.eeprom is not None:
            erased = dict.fromkeys(range(EEPROM_BYTES), NO_TRIM)
            image = replace(image, eeprom={**erased, **trial.eeprom})
        pin = self.streamed.stream.receive_pin
        stimuli = Stimuli([Levels(PINS.index(pin), sender.levels)])
        machine = Machine(image, schedule.clock, trial.options, stimuli)
        end = max(int(sender.now), START_FRAMES * schedule.period)
        edges = pin_changes(machine, 0, end)
        trims = [image.eeprom.get(n, NO_TRIM) for n in range(sender.servos)]
        wrong = wrong_pulse(self.streamed, edges, sender.sent, trims, end)
        if wrong is None:
            return None
        levels = tuple(change for change in sender.levels if change[0] <= wrong.cycle)
        before = [command for command in sender.sent if command.ends <= wrong.cycle]
        after = f" after the command {before[-1]}" if before else ""
        return Counterexample(
            f"{wrong.message}{after}", wrong.cycle, trial.options, ((pin, levels),), eeprom=trial.eeprom
        )


# judging a run


@dataclass(frozen=True, slots=True)
class WrongPulse:
    """The first pulse that no chip of the specification makes."""

    message: str
    cycle: int


def wrong_pulse(
    streamed: Streaming, edges: Sequence[Edge], sent: Sequence[Sent], trims: Sequence[int], end: int
) -> WrongPulse | None:
    """Return what is wrong with the edges of a run until cycle `end`, if anything is.

    `trims`: the bytes of the EEPROM. The first pulse's slot is where it is; each other one follows from it.
    """
    out = streamed.stream.transmit_pin
    seen = [edge for edge in edges if out is None or edge[1] != PINS.index(out)]
    begin = _first_rise(seen)
    if begin is None:
        return WrongPulse("no pulse comes", end)
    slot, period = streamed.layout.rounds * ROUND, streamed.layout.period
    if begin > START_FRAMES * period:
        return WrongPulse("the first pulse comes late", begin)
    place = sum(edge[0] < begin for edge in seen)
    first = StreamChip.after_reset(streamed, [byte(trim) for trim in trims])
    first.begin_frame()
    first.prepare(0)
    possible = {_Possible(first, 0, _slot_width(first, 0))}
    for number in range((end - begin) // slot):
        rise = begin + number * slot
        pulse = []
        while place < len(seen) and seen[place][0] < rise + slot:
            pulse.append(seen[place])
            place += 1
        due = [(chip, _due_edges(streamed, number, rise, chip.width)) for chip in possible]
        going = [chip for chip, right in due if right == pulse]
        if not going:
            return _describe_difference(
                streamed, number % streamed.layout.slots, rise, pulse, [right for _, right in due]
            )
        possible = {after for chip in going for after in chip.following(number + 1, rise, slot, sent)}
        if len(possible) > MAX_CHIPS:
            break
    return None


@dataclass(frozen=True, slots=True, eq=False)
class _Possible:
    """A chip of the specification that would have made every pulse so far."""

    chip: StreamChip
    executed: int
    """The number of commands that it has executed."""
    width: int
    """Of the pulse that it has prepared; 0 for none."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Possible) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> tuple[object, ...]:
        chip = self.chip
        numbers = (*chip.widths, *chip.goals, *chip.speeds, *chip.trims, chip.frames_left, chip.silence)
        truths = (*chip.waiting, *chip.group, chip.starting, chip.gathering)
        values = (*(number.value for number in numbers), *(truth.known for truth in truths))
        return (self.executed, self.width, *values)

    def following(self, number: int, rise: int, slot: int, sent: Sequence[Sent]) -> Iterator[_Possible]:
        """Yield what is possible after the preparation of the pulse in slot `number`, and of the commands
        that come then; `rise` is that of the slot before.
        """
        chip, executed = self.chip.copy(), self.executed
        if number % chip.streamed.layout.slots == 0:
            chip.begin_frame()
        if number % chip.streamed.layout.slots < chip.servos:
            chip.prepare(number % chip.streamed.layout.slots)
        width = _slot_width(chip, number)
        # A command is executed after the first request that follows its stop bit. Where the stop bit may end
        # on either side of the request, both outcomes remain possible.
        while executed < len(sent) and sent[executed].begins <= rise + slot:
            if sent[executed].ends + ROUND > rise:
                yield _Possible(chip.copy(), executed, width)
            chip.execute(sent[executed].second, byte(sent[executed].third))
            executed += 1
        yield _Possible(chip, executed, width)


def _slot_width(chip: StreamChip, number: int) -> int:
    """Return the width of a slot's pulse; 0 for none."""
    n = number % chip.streamed.layout.slots
    return (chip.pulse(n).value or 0) if n < chip.servos and chip.widths[n].value else 0


def _due_edges(streamed: Streaming, number: int, rise: int, width: int) -> list[Edge]:
    """Return the edges of a slot."""
    if not width:
        return []
    pin = PINS.index(streamed.plan.schedule.channels[number % streamed.layout.slots].pin)
    return [(rise, pin, HIGH), (rise + width, pin, LOW)]


def _first_rise(edges: Sequence[Edge]) -> int | None:
    """Return the first rise of a pulse to which a servo responds."""
    for number, (cycle, pin, level) in enumerate(edges):
        fall = next((edge[0] for edge in edges[number + 1 :] if edge[1] == pin), None)
        if level and (fall is None or fall - cycle > GLITCH):
            return cycle
    return None


def _describe_difference(
    streamed: Streaming, slot: int, rise: int, pulse: list[Edge], due: Sequence[list[Edge]]
) -> WrongPulse:
    """Return in words what is wrong with the edges of a slot, of which none of `due` is right."""
    longest, cycle = [], -1
    for right in due:
        differing = next(
            (n for n, pair in enumerate(zip(pulse, right, strict=False)) if pair[0] != pair[1]), None
        )
        differing = min(len(pulse), len(right)) if differing is None else differing
        first = min(edges[differing][0] for edges in (pulse, right) if differing < len(edges))
        if first > cycle:
            longest, cycle = right, first
    names = [channel.name for channel in streamed.plan.schedule.channels]
    whose = f"{names[slot]}'s pulse" if slot < len(names) else "a slot without a servo"
    text, wanted = _edges_text(pulse, rise), _edges_text(longest, rise)
    return WrongPulse(f"{whose} at cycle {rise} is {text}, not {wanted}", cycle)


def _edges_text(edges: Sequence[Edge], rise: int) -> str:
    """Return the edges of a slot in words."""
    if not edges:
        return "absent"
    if len(edges) == 2 and edges[0][::2] == (rise, HIGH) and edges[1][1:] == (edges[0][1], LOW):
        return f"{edges[1][0] - rise} cycles on {PINS[edges[0][1]]}"
    shown = [
        f"{PINS[pin]} {'rises' if level else 'falls'} {cycle - rise} later" for cycle, pin, level in edges
    ]
    return ", ".join(shown[:4])
