"""Contents of the EEPROM with which a program's pulses are wrong, found by plain runs of the simulator.

In: an image, its schedule. Out: a content and the first edge that is not where the schedule and the trims
want it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from servogen.edges import PINS
from servogen.engines.board import machine_of
from servogen.engines.stream.protocol import NO_TRIM, trim_cycles
from servogen.pic.device import EEPROM_BYTES
from servogen.pic.image import Image
from servogen.prove.counterexample import Counterexample, levels_of, pin_changes
from servogen.prove.specification import Edge
from servogen.prove.tables import VALUES
from servogen.pulse import PulseSchedule
from servogen.simulator import SimulatorOptions

PROBE = 20
"""Cycles, within every trim's range: by so much a probed byte makes pulses longer."""
FILLED_FRAMES = 60
"""Frames that are compared with every byte of the EEPROM at one value."""


class TrimSearch:
    """Runs a program with contents of the EEPROM."""

    def __init__(
        self, image: Image, schedule: PulseSchedule, board: SimulatorOptions, held_levels: Mapping[int, int]
    ) -> None:
        self._image = image
        self._schedule = schedule
        self._board = board
        self._held = held_levels
        runs = (*schedule.lead_in, *schedule.loop)
        self._frames = [run.pulses for run in runs for _ in range(run.frames)]
        self._bytes = {byte: channel for byte in range(EEPROM_BYTES) for channel in self._probed(byte)}

    def search(self, suspect: Mapping[int, int]) -> Counterexample | None:
        """Return the first content with a wrong edge, `suspect` before all others."""
        for content, frames in self._contents(suspect):
            mismatch = self._compared(content, frames)
            if mismatch is not None:
                cycle, message = mismatch
                text = ", ".join(f"byte {byte} is 0x{value:02X}" for byte, value in content.items())
                message = f"{message} if {text} in the EEPROM"
                levels = levels_of((), self._held)
                return Counterexample(message, cycle, self._board, levels, eeprom=dict(content))
        return None

    def erased(self) -> Counterexample | None:
        """Return the first edge that is wrong once the bytes behind those of the trims are erased.

        The file must not hold trims there. The result is None if it holds nothing there, or nothing that the
        program plays.
        """
        first = len(self._schedule.channels)
        beyond = sorted(n for n, value in self._image.eeprom.items() if n >= first and value != NO_TRIM)
        mismatch = self._compared({}, len(self._frames)) if beyond else None
        if mismatch is None:
            return None
        cycle, message = mismatch
        message = f"the EEPROM holds more than trims: with bytes {beyond[0]} to {beyond[-1]} erased {message}"
        return Counterexample(message, cycle, self._board, levels_of((), self._held), eeprom={})

    def _contents(self, suspect: Mapping[int, int]) -> Iterator[tuple[Mapping[int, int], int]]:
        every = len(self._frames)
        yield suspect, every
        for value in range(VALUES):
            yield dict.fromkeys(self._bytes, value), min(every, FILLED_FRAMES)

    def _probed(self, byte: int) -> list[int]:
        """Return the channels whose first pulse a byte of the EEPROM makes longer."""
        first = next((n for n, frame in enumerate(self._frames) if any(frame)), 0)
        # A byte is a servo's trim if changing it alone moves a fall.
        plain, seen = (set(self._seen(content, first + 1)) for content in ({}, {byte: PROBE}))
        moved = {pin for cycle, pin, level in seen - plain if not level}
        return [n for n, channel in enumerate(self._schedule.channels) if PINS.index(channel.pin) in moved]

    def _seen(self, content: Mapping[int, int], frames: int) -> list[Edge]:
        """Return the edges of so many frames, from the first rise on, in cycles since it."""
        edges = self._edges(content, frames)
        begun = next((cycle for cycle, _, level in edges if level), 0)
        end = (frames - 1) * self._schedule.period + self._schedule.period // 2
        return [(cycle - begun, pin, level) for cycle, pin, level in edges if begun <= cycle < begun + end]

    def _edges(self, content: Mapping[int, int], frames: int) -> list[Edge]:
        """Return the edges of a run that is long enough for so many frames, in cycles since power-on."""
        image = replace(self._image, eeprom={**dict.fromkeys(range(EEPROM_BYTES), NO_TRIM), **content})
        machine = machine_of(self._schedule, image, self._board)
        return pin_changes(machine, 0, self._schedule.run_cycles(frames * self._schedule.period))

    def _compared(self, content: Mapping[int, int], frames: int) -> tuple[int, str] | None:
        """Return the cycle since power-on of the first wrong edge, and what is wrong."""
        edges = self._edges(content, frames)
        begun = next((cycle for cycle, _, level in edges if level), 0)
        trims = {channel: trim_cycles(content.get(byte, NO_TRIM)) for byte, channel in self._bytes.items()}
        wanted = sorted(self._wanted(trims, frames))
        offset = begun - wanted[0][0]
        seen = [(cycle - offset, pin, level) for cycle, pin, level in edges if cycle >= begun]
        last = frames * self._schedule.period
        for edge in sorted({*wanted} ^ {edge for edge in seen if edge[0] < last}):
            where = "missing" if edge in wanted else "not the schedule's"
            level = "rise" if edge[2] else "fall"
            return edge[0] + offset, f"the {level} of {PINS[edge[1]]} is {where}"
        return None

    def _wanted(self, trims: Mapping[int, int], frames: int) -> Iterator[Edge]:
        for number, pulses in enumerate(self._frames[:frames]):
            for channel, pulse in enumerate(pulses):
                if pulse is not None:
                    pin = PINS.index(self._schedule.channels[channel].pin)
                    rise = number * self._schedule.period + pulse.rise
                    yield rise, pin, 1
                    yield rise + pulse.width + trims.get(channel, 0), pin, 0
