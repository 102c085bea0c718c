"""What a compiled program leaves in a variable."""

from __future__ import annotations

from servogen.compiler import Options, Source, compile_sources
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine
from servogen.units import Clock


def value(text: str, name: str, dialect: str = "xc8", level: str = "speed") -> int:
    """The low byte of a variable, 20 000 cycles after reset."""
    options = Options(dialect=dialect, clock_hz=4_000_000, optimise=level)
    found = compile_sources([Source(text, "main.c")], options)
    machine = Machine(found.image, Clock(4_000_000))
    machine.run(20_000)
    address = next(address for address, each, _ in found.listing.variables if each == name)
    return machine.state().ram[address - RAM_FIRST]
