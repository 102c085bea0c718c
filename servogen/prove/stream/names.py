"""The addresses of a stream program's variables and of the parts of its interrupt, from its listing.

A wrong name cannot make a wrong program proven: the lemmas show what the words do with these places, and
that the pulses come of it, whatever the places are called.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from servogen.engines.stream.interrupt_code import find_edge
from servogen.engines.stream.response import enable_address, main_loop
from servogen.engines.stream.streaming import Streaming
from servogen.pic.device import INTERRUPT_VECTOR, registers
from servogen.pic.isa import encode
from servogen.pic.listing import Listing
from servogen.pic.wcet import TimedProgram
from servogen.prove.stream.execution import EEPROM

SCRATCH = ("n", "x_lo", "x_hi", "sum_lo", "sum_hi")
"""Variables of the C whose values no step leaves to the next."""
T0IF = 2


@dataclass(frozen=True)
class Names:
    """The places of a stream program."""

    listing: Listing
    streamed: Streaming

    @cached_property
    def words(self) -> Mapping[int, int]:
        return self.listing.words

    @cached_property
    def variables(self) -> Mapping[str, tuple[int, int]]:
        """Return the address and the size of each variable that the C names."""
        return {
            name: (address, size)
            for address, name, size in self.listing.variables
            if not name.endswith("(temporary)")
        }

    def at(self, name: str, offset: int = 0) -> int:
        """Return the address of a variable's byte. Raises LookupError."""
        if name not in self.variables:
            raise LookupError(f"no variable is called {name}")
        return self.variables[name][0] + offset

    def addresses(self, *wanted: str) -> set[int]:
        """Return the addresses of those of these variables that the C has."""
        return {self.at(name) for name in wanted if name in self.variables}

    @cached_property
    def place_names(self) -> Mapping[int, str]:
        """Return how messages call each place of `execution` that has a name."""
        place_names = {EEPROM + n: f"byte {n} of the EEPROM" for n in range(self.servos)}
        for name, register in registers().items():
            place_names[register.address] = name
        for name, (address, size) in self.variables.items():
            for offset in range(size):
                place_names[address + offset] = f"{name}[{offset}]" if size > 1 else name
        return place_names

    def place_name(self, place: int) -> str:
        return self.place_names.get(place, f"place 0x{place:02X}")

    @property
    def servos(self) -> int:
        return len(self.streamed.neutral)

    @property
    def pins(self) -> list[str]:
        """Return the servos' pins in the order of their slots."""
        return [channel.pin for channel in self.streamed.plan.schedule.channels]

    @property
    def two_ports(self) -> bool:
        """Return whether there are servos on both ports."""
        return len({pin[1] for pin in self.pins}) > 1

    def group_bit(self, n: int) -> int:
        """Return the bit of a servo among those of a group."""
        return n if self.two_ports else int(self.pins[n][2])

    def port(self, pin: str) -> int:
        """Return the address of a pin's port."""
        return registers()[f"PORT{pin[1]}"].address

    @property
    def line(self) -> tuple[int, int]:
        """Return the port and the bit of the receive pin."""
        pin = self.streamed.stream.receive_pin
        return self.port(pin), int(pin[2])

    @cached_property
    def loop_head(self) -> int:
        """Return where the main loop begins."""
        return main_loop(self.listing).head

    @cached_property
    def after_clear(self) -> int:
        """Return the address after the instruction that clears the request of a pulse."""
        return main_loop(self.listing).clear + 1

    @cached_property
    def after_enable(self) -> int:
        """Return the address after the instruction of main that enables interrupts."""
        return enable_address(self.listing) + 1

    @cached_property
    def interrupt_addresses(self) -> tuple[int, ...]:
        """Return the addresses of the words that an interrupt can execute."""
        return tuple(sorted(TimedProgram(self.words, ()).reached(INTERRUPT_VECTOR)))

    @cached_property
    def body(self) -> int:
        """Return the first address of the interrupt after the compiler's words. Raises LookupError."""
        first = encode("BCF", f=registers()["INTCON"].address, b=T0IF)
        for address in range(INTERRUPT_VECTOR, max(self.words)):
            if self.words.get(address) == first:
                return address
        raise LookupError("the interrupt does not begin with clearing its flag")

    def body_addresses(self) -> list[int]:
        """Return the addresses of the interrupt without the compiler's words before and after it."""
        program = TimedProgram(self.words, ())
        return sorted(program.reached(self.body) - program.reached(self.listing.label("st_out")))

    @cached_property
    def edge(self) -> int:
        """Return the address of the instruction that makes an edge. Raises LookupError."""
        interrupt = {address: self.words[address] for address in self.interrupt_addresses}
        return find_edge(interrupt, self.listing.label("st_exactly"))
