"""`rig`: the whole virtual bench around one chip: programmer, analyser, input board and serial line.

In: an image and the properties of the bench. Out: pseudo-terminals, for as long as it is served.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from types import MappingProxyType
from typing import Any

from servogen.bench.inputs.wiring import InputWiring, input_wiring
from servogen.bench.virtual.analyser import AnalyserOptions, VirtualAnalyser
from servogen.bench.virtual.board import BoardOptions, VirtualBoard
from servogen.bench.virtual.chip import SecondChip, VirtualChip
from servogen.bench.virtual.debugger import VirtualDebugger
from servogen.bench.virtual.k150 import ProgrammerOptions, VirtualProgrammer
from servogen.bench.virtual.serial_line import LineReceiver, LineStimulus, SerialLine
from servogen.bench.virtual.terminals import TerminalDevice, Terminals, terminals
from servogen.errors import InputError, did_you_mean
from servogen.pic.image import Image
from servogen.simulator import SimulatorOptions
from servogen.units import Clock

SETTLED_S = Fraction(1, 10)
"""The time that the chip has run when the first client connects."""

FLAGS = {
    "analyser:silent": "silent",
    "analyser:garbage": "garbage",
    "inputs:silent": "silent",
    "inputs:garbage": "garbage",
    "programmer:silent": "silent",
    "programmer:garbage": "garbage",
    "programmer:no-chip": "no_chip",
    "programmer:wrong-config": "wrong_config",
}
NUMBERS = {
    "analyser:stop-after": "stop_after",
    "analyser:unplug-after": "unplug_after",
    "inputs:late": "late_ms",
    "inputs:unplug-after": "unplug_after",
    "programmer:unplug-after": "unplug_after",
    "programmer:wrong-bit-at": "wrong_bit_at",
    "programmer:wrong-eeprom-at": "wrong_eeprom_at",
}
"""Faults by name: those without a value, and those with a number (bytes, milliseconds, or an address)."""


@dataclass(frozen=True, slots=True)
class RigOptions:
    """The properties of the bench."""

    ppm: Fraction = Fraction(0)
    real_time: bool = False
    serial_pin: int = 12
    serial_out: int | None = None
    """The pin on which the chip sends."""
    baud: int = 2400
    inverted: bool = False
    analyser: AnalyserOptions = field(default_factory=AnalyserOptions)
    programmer: ProgrammerOptions = field(default_factory=ProgrammerOptions)
    board: BoardOptions = field(default_factory=BoardOptions)
    inputs: InputWiring = field(default_factory=input_wiring)
    """The wiring of the input board."""


def with_fault(options: RigOptions, text: str) -> RigOptions:
    """Return the same bench with a fault, such as `analyser:silent` or `programmer:wrong-bit-at=0x12`."""
    name, given, number = text.partition("=")
    known = NUMBERS if given else FLAGS
    if name not in known:
        hint = did_you_mean(name, [*FLAGS, *(f"{fault}=N" for fault in NUMBERS)])
        raise InputError("bad-option", f"'{text}' is not a fault of the bench", hint=hint)
    change: dict[str, Any] = {}
    try:
        change[known[name]] = int(number, 0) if given else True
    except ValueError:
        raise InputError("bad-option", f"'{number}' in '{text}' is not a whole number") from None
    if name.startswith("analyser:"):
        return replace(options, analyser=replace(options.analyser, **change))
    if name.startswith("inputs:"):
        return replace(options, board=replace(options.board, **change))
    return replace(options, programmer=replace(options.programmer, **change))


@contextmanager
def rig(
    image: Image,
    clock: Clock,
    board: SimulatorOptions,
    options: RigOptions,
    held: Mapping[int, int] = MappingProxyType({}),
    second: SecondChip | None = None,
    debugger: VirtualDebugger | None = None,
) -> Iterator[Terminals]:
    """Yield the bench with `image` on its chip; `paths` has "programmer", "analyser", "inputs", "serial".

    With a `second` chip there is also "programmer2", and the analyser has the pins of both. `held` has the
    levels at which the board holds pins that the program reads, by the pins' numbers. A `debugger` works as
    long as the bench is served.
    """
    stimulus = LineStimulus(options.serial_pin, options.baud, options.inverted, held)
    chip = VirtualChip(
        image=image,
        clock=clock,
        options=board,
        ppm=options.ppm,
        stimulus=stimulus,
        in_real_time=options.real_time,
        second=second,
        debugger=debugger,
    )
    devices: dict[str, TerminalDevice] = {
        "programmer": VirtualProgrammer(chip, options.programmer),
        "analyser": VirtualAnalyser(chip, options.analyser),
        "inputs": VirtualBoard(chip, options.inputs, options.board),
        "serial": SerialLine(chip, stimulus, _receiver(chip, options)),
    }
    if second is not None:
        devices["programmer2"] = VirtualProgrammer(second, options.programmer)
    chip.run(int(SETTLED_S * chip.cycles_per_second))
    with terminals(devices, debugger) as opened:
        yield opened


def _receiver(chip: VirtualChip, options: RigOptions) -> LineReceiver | None:
    if options.serial_out is None:
        return None
    return LineReceiver(options.serial_out, chip.clock.cycles_per_second / options.baud, options.inverted)
