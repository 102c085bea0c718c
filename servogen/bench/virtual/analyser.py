"""`VirtualAnalyser`: a SUMP analyser that watches the virtual chip's pins.

In: bytes of the client. Out: bytes of the device. It samples as the real ones do: at its rate, into its
memory, from the trigger on, and sends the newest word first. Faults are options.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, field

from servogen.bench.analysers import sump
from servogen.bench.analysers.sump import Command, Key
from servogen.bench.virtual.capture import Capture, armed
from servogen.bench.virtual.chip import VirtualChip

LONGEST_S = 1800
"""A capture that takes longer, of the chip's time, is given up."""


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
    """Bytes of a capture after which it is gone."""


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
    _armed: Capture | None = None
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
        elif self._armed.cycles > LONGEST_S * self.chip.cycles_per_second:
            self._arm(None)

    def _arm(self, capture: Capture | None) -> None:
        self._armed = capture
        self.chip.watched = capture is not None
        self.chip.forget()

    def _obey(self, command: int, value: int) -> None:
        if self.options.garbage and command in (Command.ID, Command.METADATA):
            self.outgoing += self._dice.randbytes(64)
        elif command == Command.RESET:
            self._arm(None)
            self.outgoing.clear()
            self.reset = True
        elif command == Command.ID:
            self.outgoing += sump.IDS[0]
        elif command == Command.METADATA:
            self.outgoing += self._metadata()
        elif command == Command.RUN:
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
