"""Devices on the pins: what a chip beside the PIC16F84 must offer to be simulated with it.

In: a `PinDevice` and the pins that it is on (`OnPins`). Out: `Bus`, which the instruction loop calls for
every change of these pins' levels, in the cycle in which it happens; what the devices pull low is seen by the
next reading of the port, and in the edges of these pins, which are those of the wires.

        +5 V
         │ 4.7 kΩ at each line of a device (its pins are open drains: it pulls low, or lets go)
    RA0 ─┴──▶ scl ┐
    RA1 ─┴──▶ sda ┴ device

A device answers levels only: it does nothing of its own accord between two changes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Protocol

import numpy as np

from servogen.edges import NO_EDGES, PINS, EdgeChunk, edge_chunk, join, part
from servogen.errors import Diagnostic, InputError, did_you_mean
from servogen.units import Clock

React = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)
"""The function that the instruction loop calls: (cycle, levels of the pins) → the pins pulled low."""


class Running(Protocol):
    """A device under power. It may never raise an error: the instruction loop cannot pass it on."""

    def react(self, cycle: int, levels: int) -> int:
        """Take the levels of its lines from `cycle` on, bit n being line n, and return those that it pulls
        low.
        """

    def snapshot(self) -> Any:
        """Return its complete state, a value that can be compared, with no reference to what changes."""

    def restore(self, state: Any) -> None: ...

    def relative(self, cycle: int) -> Any:
        """Return all of its state that its later answers depend on, its times counted from `cycle`."""

    def off(self) -> PinDevice:
        """Return what it keeps without power."""

    @property
    def remarks(self) -> Sequence[tuple[int, Diagnostic]]:
        """Return, with its cycle, the first of each way in which its data sheet was not kept."""


class PinDevice(Protocol):
    """A kind of device, as it is before its power is on: a frozen value."""

    @property
    def lines(self) -> tuple[str, ...]:
        """Return the names of its lines."""

    def power_up(self, clock: Clock) -> Running: ...


@dataclass(frozen=True, slots=True)
class OnPins:
    """A device with its lines on pins of the chip, each of which has a resistor to the supply."""

    device: PinDevice
    pins: tuple[int, ...]
    """The pin of each line, its index in `PINS`."""


def on_pins(device: PinDevice, **pins: str) -> OnPins:
    """Return a device on pins, named by its lines: `on_pins(eeprom, scl="RA0", sda="RA1")`.

    Raises InputError for a line or a pin that does not exist, and for two lines on one pin.
    """
    for line in pins:
        if line not in device.lines:
            known = ", ".join(device.lines)
            raise InputError("unknown-name", f"the device has no line '{line}'", hint=f"its lines: {known}")
    missing = [line for line in device.lines if line not in pins]
    if missing:
        raise InputError("missing-key", f"no pin is given for {missing[0]}")
    for line, pin in pins.items():
        if pin.upper() not in PINS:
            raise InputError("unknown-pin", f"{line}: there is no pin '{pin}'", hint=did_you_mean(pin, PINS))
    numbers = tuple(PINS.index(pins[line].upper()) for line in device.lines)
    if len(set(numbers)) < len(numbers):
        raise InputError("pin-in-use", f"two lines are on one pin: {', '.join(pins.values())}")
    return OnPins(device, numbers)


class Bus:
    """All devices of a chip under power; devices may share pins."""

    def __init__(self, devices: Sequence[OnPins], clock: Clock) -> None:
        self.devices = tuple(each.device.power_up(clock) for each in devices)
        self._parts = [
            (running.react, *_translations(each.pins))
            for each, running in zip(devices, self.devices, strict=True)
        ]
        self._callback = React(self._react)
        pins = {pin for each in devices for pin in each.pins}
        self.pins = np.array(sorted(pins), dtype=np.uint8)
        """The pins with devices."""
        high = sum(1 << pin for pin in pins)
        self._told = ~high
        """The levels that the edges taken so far lead to."""
        self.changes = [(0, high)] if pins else []
        """The levels from then on, with the cycles of their edges: a wire is high until it is pulled low."""

    @property
    def address(self) -> int:
        """Return the address of the function to call."""
        return ctypes.cast(self._callback, ctypes.c_void_p).value or 0

    def _react(self, cycle: int, pins: int) -> int:
        at, low = max(0, cycle - 1), 0  # what is written in one cycle is a level from the next one on
        if self.changes and self.changes[-1][0] == at:
            self.changes.pop()  # an answer in the same cycle
        self.changes.append((at, pins))
        for react, to_lines, to_pins in self._parts:
            low |= to_pins[react(cycle, to_lines[pins & to_lines[-1]])]
        return low

    def with_wires(self, edges: EdgeChunk) -> EdgeChunk:
        """Return what the chip did since the last call with the edges of the wires at the devices' pins."""
        if not self.devices:
            return edges
        rows = []
        for cycle, levels in self.changes:
            changed = levels ^ self._told
            rows += [(cycle, pin, levels >> pin & 1) for pin in self.pins.tolist() if changed >> pin & 1]
            self._told = levels
        self.changes = []
        wires = edge_chunk(*zip(*rows, strict=True)) if rows else NO_EDGES
        both = join((part(edges, ~np.isin(edges.pin, self.pins)), wires))
        return part(both, np.argsort(both.cycle, kind="stable"))

    def snapshot(self) -> tuple[Any, ...]:
        """Return the devices' states and the edges not yet taken; nothing where there is no device."""
        states = tuple(device.snapshot() for device in self.devices)
        return (states, self._told, tuple(self.changes)) if states else ()

    def restore(self, state: tuple[Any, ...]) -> None:
        if not self.devices:
            return
        states, self._told, changes = state
        self.changes = list(changes)
        for device, its in zip(self.devices, states, strict=True):
            device.restore(its)

    def relative(self, cycle: int) -> bytes:
        """Return the devices' part of a machine's fingerprint."""
        return repr([device.relative(cycle) for device in self.devices]).encode() if self.devices else b""

    @property
    def remarks(self) -> list[tuple[int, Diagnostic]]:
        return [remark for device in self.devices for remark in device.remarks]


def _translations(pins: tuple[int, ...]) -> tuple[dict[int, int], dict[int, int]]:
    """Return the levels of lines by those of pins, with the mask of the pins at -1, and the pins by lines."""
    to_lines, to_pins = {-1: sum(1 << pin for pin in pins)}, {}
    for levels in product((0, 1), repeat=len(pins)):
        lines = sum(level << line for line, level in enumerate(levels))
        on_pins = sum(level << pin for pin, level in zip(pins, levels, strict=True))
        to_lines[on_pins], to_pins[lines] = lines, on_pins
    return to_lines, to_pins
