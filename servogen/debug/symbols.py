"""Names of the source: variables, routines and lines.

In: a program's `Listing`. Out: addresses in RAM and in the program, and the source line that a chip executes.
"""

from __future__ import annotations

from pathlib import PurePath
from typing import NamedTuple

from servogen.debug.time_machine import NO_LINE, TimeMachine
from servogen.errors import InputError, did_you_mean
from servogen.pic.device import RAM_FIRST, RAM_LAST
from servogen.pic.listing import Listing
from servogen.simulator import MachineState


class Variable(NamedTuple):
    """Bytes of RAM, the lowest first."""

    address: int
    size: int

    def number(self, ram: bytes, *, signed: bool = False) -> int:
        """Return its value in the 68 bytes of RAM."""
        start = self.address - RAM_FIRST
        return int.from_bytes(ram[start : start + self.size], "little", signed=signed)


class ListedLine(NamedTuple):
    file: str
    line: int
    text: str
    """The text of the line; empty if the listing does not contain the source."""

    def __str__(self) -> str:
        return f"{PurePath(self.file).name}:{self.line}: {self.text}".rstrip(": ")


def variable(name: str, listing: Listing | None) -> Variable:
    """Return a variable, or the byte of RAM that an address names. Raises InputError."""
    if name.lower().startswith("0x"):
        address = int(name, 16)
        if not RAM_FIRST <= address <= RAM_LAST:
            raise InputError(
                "out-of-range", f"0x{address:02X} is not in RAM, 0x{RAM_FIRST:02X} to 0x{RAM_LAST:02X}"
            )
        return Variable(address, 1)
    variables = {
        label: Variable(address, size) for address, label, size in (listing.variables if listing else ())
    }
    if name not in variables:
        hint = did_you_mean(name, tuple(variables)) if variables else "this program has no names: 0x20"
        raise InputError("unknown-name", f"there is no variable '{name}'", hint=hint)
    return variables[name]


def routine(name: str, listing: Listing | None) -> int:
    """Return the address at which a function or a label of the assembly begins. Raises InputError."""
    names = {function.name: function.start for function in (listing.functions if listing else ())}
    names |= dict(listing.labels if listing else ())
    if name not in names:
        hint = did_you_mean(name, tuple(names)) if names else "this program has no names: 0x01F"
        raise InputError("unknown-name", f"there is no function or label '{name}'", hint=hint)
    return names[name]


def line_at(chip: TimeMachine, address: int) -> ListedLine | None:
    """Return the source line of an instruction; None where the listing knows of none."""
    number = int(chip.line_ids[address % len(chip.line_ids)])
    if number == NO_LINE:
        return None
    file, line = chip.lines[number]
    sources = dict(chip.listing.sources) if chip.listing else {}
    lines = sources.get(file, "").splitlines()
    return ListedLine(file, line, lines[line - 1].strip() if line <= len(lines) else "")


def current_line(chip: TimeMachine, state: MachineState | None = None) -> ListedLine | None:
    """Return the source line that runs: within a routine of the compiler, the one that called it.

    `state` is the chip's, where it is known.
    """
    state = state or chip.machine.state()
    returns = (address - 1 for address in state.stack[: state.stack_depth])
    lines = (line_at(chip, address) for address in (state.pc, *returns))
    return next((line for line in lines if line is not None), None)
