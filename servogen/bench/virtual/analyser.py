"""`VirtualAnalyser`: a SUMP analyser that watches the virtual chip's pins.

In: bytes of the client. Out: bytes of the device. It samples as the real ones do: at its rate, into its
memory, from the trigger on, and sends the newest word first. Faults are options.

    edge at time e                 sample n is taken at time n / rate: it sees what was written before
    ──────┐                        or at that time, so that the edge is seen from ceil(e · rate) on
     ·  · └·──·──·
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from servogen.bench.analysers import sump
from servogen.bench.analysers.sump import CHANNEL_PINS, PAIR_WIRES, Flag, Key, Runs, SumpCommand
from servogen.bench.virtual.chip import VirtualChip

SLICE_S, SHORT_SLICE_S = Fraction(1, 4), Fraction(1, 50)
MAX_SAMPLES = 1 << 20
"""The chip runs for `SLICE_S`, but no more than this many samples, between two reads of the line."""


def armed(settings: Mapping[int, int]) -> VirtualCapture:
    """Return the capture requested by the settings, with the protocol's defaults for missing ones."""
    counts = settings.get(SumpCommand.COUNTS, 0)
    flags = Flag(settings.get(SumpCommand.FLAGS, 0))
    stages = []
    for number in range(sump.STAGES):
        first = sump.STAGES * number
        configuration = settings.get(SumpCommand.TRIGGER_CONFIG + first, 0)
        stages.append(
            (
                settings.get(SumpCommand.TRIGGER_MASK + first, 0),
                settings.get(SumpCommand.TRIGGER_VALUE + first, 0),
            )
        )
        if configuration & sump.TRIGGER_START:
            break
    return VirtualCapture(
        Fraction(sump.BASE_HZ, settings.get(SumpCommand.DIVIDER, 0) + 1),
        4 * ((counts & 0xFFFF) + 1),
        4 * ((counts >> 16) + 1),
        flags,
        tuple(stages),
    )


@dataclass(slots=True)
class VirtualCapture:
    """One capture; `finished` holds the bytes to send once the memory is full. Counts are words, with RLE
    too.
    """

    rate: Fraction
    read: int
    delay: int
    """The number of the `read` words that follow the trigger; the others precede it."""
    flags: Flag
    stages: tuple[tuple[int, int], ...]
    """(mask, value) of each, in order; the first sample that matches the last one is the trigger."""
    finished: bytes | None = None
    cycles: int = 0
    """The cycles that it has watched."""
    _begin: int | None = None
    """The cycle at which sampling began."""
    _runs: Runs = field(
        default_factory=lambda: Runs(np.zeros(0, dtype=np.uint32), np.zeros(0, dtype=np.int64), 0)
    )
    _stage: int = 0
    _before: sump.Words | None = None
    """The words before the trigger once it has come; `_runs` then begins at the trigger."""

    def watch(self, chip: VirtualChip, glitches_per_s: float, dice: random.Random) -> None:
        """Run the chip for a slice of time and sample it."""
        seconds = min(SHORT_SLICE_S if chip.is_slow else SLICE_S, MAX_SAMPLES / self.rate)
        cycles = chip.due(int(seconds * chip.cycles_per_second) + 1)
        if not cycles:
            return
        self.cycles += cycles
        begin = chip.now if self._begin is None else self._begin
        self._begin = begin
        cycle, levels = chip.look(cycles)
        ratio = (self.rate / chip.cycles_per_second).limit_denominator(10**8)
        # In whole numbers, rounded up: a level is seen at the first sample at or after its change.
        first = -((begin - cycle) * ratio.numerator // ratio.denominator)
        end = -((begin - chip.now) * ratio.numerator // ratio.denominator)
        new = Runs(_channels(levels), np.maximum(first, self._runs.end), end)
        self._add(noisy(new, self._runs.end, glitches_per_s / float(self.rate), dice))
        if self._before is None:
            self._look_for_trigger()
        if self._before is not None:
            words = np.concatenate((self._before, self._words(self._runs)[: self.delay]))
            if len(words) >= len(self._before) + self.delay:
                self.finished = sump.to_bytes(words, self._bits)

    @property
    def _groups(self) -> tuple[int, ...]:
        return tuple(number for number, off in enumerate(sump.GROUP_FLAGS) if not self.flags & off)

    @property
    def _bits(self) -> int:
        return 8 * len(self._groups)

    def _add(self, new: Runs) -> None:
        """Append samples; levels between two samples are never seen."""
        seen = np.append(new.start[1:] > new.start[:-1], new.start[-1] < new.end)
        value = np.concatenate((self._runs.value, new.value[seen]))
        self._runs = sump.merge_runs(value, np.concatenate((self._runs.start, new.start[seen])), new.end)

    def _look_for_trigger(self) -> None:
        runs, index = self._runs, 0
        while self._stage < len(self.stages):
            mask, wanted = self.stages[self._stage]
            matches = np.flatnonzero((runs.value[index:] & mask) == (wanted & mask))
            if not len(matches):
                # Older samples can no longer be read: the words before the trigger are at most `read`.
                self._runs = _from(runs, max(0, len(runs.value) - self.read))
                return
            index += int(matches[0])
            self._stage += 1
        before = Runs(runs.value[:index], runs.start[:index], int(runs.start[index]))
        count = self.read - min(self.read, self.delay)
        words = self._words(before) if index else before.value
        self._before = words[len(words) - min(count, len(words)) :]
        self._runs = _from(runs, index)

    def _words(self, runs: Runs) -> sump.Words:
        value = _enabled_groups(runs.value, self._groups)
        if self.flags & Flag.RLE:
            masked = value & np.uint32(sump.longest_count(self._bits))
            return sump.encode(sump.merge_runs(masked, runs.start, runs.end), self._bits)
        return np.repeat(value, np.diff(np.append(runs.start, runs.end)))


def _from(runs: Runs, index: int) -> Runs:
    return Runs(runs.value[index:], runs.start[index:], runs.end)


def _channels(levels: sump.Words) -> sump.Words:
    """Return the pins' levels as the analyser's channels have them."""
    word = np.zeros(len(levels), dtype=np.uint32)
    for channel, pin in PAIR_WIRES.items():
        word |= (levels >> np.uint32(pin) & np.uint32(1)) << np.uint32(channel)
    beyond = np.uint32(0xFFFF >> len(CHANNEL_PINS) << len(CHANNEL_PINS))
    return word | (levels & beyond)


def _enabled_groups(value: sump.Words, groups: tuple[int, ...]) -> sump.Words:
    """Return the bytes of the groups that are on, without gaps between them."""
    word = np.zeros(len(value), dtype=np.uint32)
    for place, group in enumerate(groups):
        word |= (value >> np.uint32(8 * group) & np.uint32(0xFF)) << np.uint32(8 * place)
    return word


def noisy(runs: Runs, begin: int, per_sample: float, dice: random.Random) -> Runs:
    """Return the same samples with random single errors."""
    if not per_sample:
        return runs
    expected = per_sample * (runs.end - begin)
    number = int(expected) + (dice.random() < expected % 1)
    value, start = runs.value, runs.start
    for sample in dice.sample(range(begin, runs.end - 1), number):
        index = int(np.searchsorted(start, sample, side="right")) - 1
        flipped = value[index] ^ np.uint32(1 << dice.randrange(len(CHANNEL_PINS)))
        # The flipped sample ends its run; what is left of the run begins again after it.
        torn = index + 1 == len(start) or start[index + 1] > sample + 1
        new = [flipped, value[index]] if torn else [flipped]
        value = np.insert(value, index + 1, new).astype(np.uint32)
        start = np.insert(start, index + 1, [sample, sample + 1] if torn else [sample])
    return Runs(value, start, runs.end)


MAX_CAPTURE_S = 1800
"""The chip's time after which a capture is abandoned."""


@dataclass(frozen=True, slots=True)
class AnalyserOptions:
    """The kind of device, and its faults."""

    memory: int = 24 * 1024
    fastest: int = sump.BASE_HZ
    metadata: bool = True
    glitches_per_s: float = 0.0
    """Noise: single wrong samples on random channels."""
    seed: int = 1
    silent: bool = False
    garbage: bool = False
    stop_after: int | None = None
    """Bytes of a capture after which it falls silent."""
    unplug_after: int | None = None
    """Bytes of a capture after which it disappears."""


@dataclass(slots=True)
class VirtualAnalyser:
    chip: VirtualChip
    options: AnalyserOptions = AnalyserOptions()
    outgoing: bytearray = field(default_factory=bytearray)
    gone: bool = False
    """Unplugged as soon as `outgoing` is sent."""
    reset: bool = False
    _command: bytearray = field(default_factory=bytearray)
    _settings: dict[int, int] = field(default_factory=dict)
    _armed: VirtualCapture | None = None
    _dice: random.Random = field(default_factory=random.Random)

    def __post_init__(self) -> None:
        self._dice.seed(self.options.seed)

    @property
    def working(self) -> bool:
        """Return whether `work` has something to do."""
        return self._armed is not None

    def received(self, data: bytes) -> None:
        for byte in data:
            self._command.append(byte)
            if self._command[0] < sump.LONG or len(self._command) == 5:
                command, value = self._command[0], int.from_bytes(self._command[1:], "little")
                self._command.clear()
                if not self.options.silent:
                    self._obey(command, value)

    def work(self) -> None:
        """Run the chip for a slice of time while a capture is armed."""
        if self._armed is None:
            return
        self._armed.watch(self.chip, self.options.glitches_per_s, self._dice)
        if self._armed.finished is not None:
            self._send(self._armed.finished)
            self._arm(None)
        elif self._armed.cycles > MAX_CAPTURE_S * self.chip.cycles_per_second:
            self._arm(None)

    def _arm(self, capture: VirtualCapture | None) -> None:
        self._armed = capture
        self.chip.watched = capture is not None
        self.chip.forget()

    def _obey(self, command: int, value: int) -> None:
        if self.options.garbage and command in (SumpCommand.ID, SumpCommand.METADATA):
            self.outgoing += self._dice.randbytes(64)
        elif command == SumpCommand.RESET:
            self._arm(None)
            self.outgoing.clear()
            self.reset = True
        elif command == SumpCommand.ID:
            self.outgoing += sump.IDS[0]
        elif command == SumpCommand.METADATA:
            self.outgoing += self._metadata()
        elif command == SumpCommand.RUN:
            self._arm(armed(self._settings))
        elif command >= sump.LONG:
            self._settings[command] = value

    def _metadata(self) -> bytes:
        if not self.options.metadata:
            return b""
        numbers: Mapping[Key, int] = {
            Key.CHANNELS_LONG: 16,
            Key.MEMORY: self.options.memory,
            Key.RATE: self.options.fastest,
        }
        texts = bytes([Key.NAME]) + b"servogen virtual analyser\0"
        long = b"".join(bytes([key]) + value.to_bytes(4, "big") for key, value in numbers.items())
        return texts + long + bytes([Key.CHANNELS_SHORT, 16, Key.END])

    def _send(self, data: bytes) -> None:
        stops = [limit for limit in (self.options.stop_after, self.options.unplug_after) if limit is not None]
        self.outgoing += data[: min(stops)] if stops else data
        self.gone = self.options.unplug_after is not None
