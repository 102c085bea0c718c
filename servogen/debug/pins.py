"""Explains the level of a pin in sentences for beginners.

In: a `TimeMachine` at its moment and a pin. Out: sentences: whether the pin is an output, what the latch
holds, and what the program never did.
"""

from __future__ import annotations

from collections.abc import Iterator

from servogen.debug.time_machine import TimeMachine
from servogen.edges import PINS, UNDRIVEN
from servogen.pic.device import OPEN_DRAIN_PIN
from servogen.pic.isa import decode

PORTS = {"A": (0x05, 0), "B": (0x06, 5)}
"""The address of each port, in bank 1 of its TRIS register, and its first pin in `PINS`."""


def explain_pin(chip: TimeMachine, pin: int) -> list[str]:
    """Return why the pin has its level."""
    return [] if pin >= len(PINS) else list(_sentences(chip, pin))


def _sentences(chip: TimeMachine, pin: int) -> Iterator[str]:
    machine, name = chip.machine, PINS[pin]
    port, bit = name[1], int(name[2])
    registers = machine.state().registers
    latch, read = registers[f"LAT{port}"] >> bit & 1, machine.pins >> pin & 1
    if registers[f"TRIS{port}"] >> bit & 1:
        yield (
            f"{name} is an input: bit {bit} of TRIS{port} is 1, as it is after every reset. "
            f"It reads {read}, and the chip does not drive it."
        )
        if latch:
            yield f"The program has written 1 to {name}: the pin shows it once bit {bit} of TRIS{port} is 0."
        if not _writes_in_bank_1(chip, PORTS[port][0]):
            yield f"This program never writes TRIS{port}: TRIS{port} = 0 would make the whole port outputs."
        return
    yield f"{name} is an output: bit {bit} of TRIS{port} is 0. Its latch holds {latch}."
    if name == OPEN_DRAIN_PIN and machine.levels[pin] == UNDRIVEN:
        yield f"{name} is an open drain: for a 1 it needs a pull-up resistor."


def _writes_in_bank_1(chip: TimeMachine, address: int) -> bool:
    """Return whether the program may write a register of bank 1: by TRIS, with RP0 changed, or through FSR.

    A write through FSR may be to any address; FSR selects its bank.
    """
    decoded = [word for word in map(decode, chip.machine.image.program.values()) if word is not None]
    if any(word.instruction.mnemonic == "TRIS" and word.f == address for word in decoded):
        return True
    status, rp0, through_fsr = 0x03, 5, 0x00
    banked = any(
        word.f == status
        and word.instruction.writes_file(word.d)
        and not word.instruction.tests_bit
        and (word.b == rp0 or not word.instruction.changes_bit)
        for word in decoded
    )
    written = {word.f for word in decoded if word.instruction.writes_file(word.d)}
    return through_fsr in written or (banked and address in written)
