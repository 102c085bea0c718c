"""What main and the interrupt share: neither disturbs the other between any two words, and both fit the
stack.

In: the addresses that main's steps read and write, and those where the interrupt keeps the C's registers.
Out: nothing, or `Fails` with the first place that is used in the wrong step. A pulse is handed over in `mask`
and `next_…` before main clears the request in `due`; a command in `todo` and `value` before the interrupt
makes the request; an answer in the receiver's variables, `rx_bits` last. The times in `response` keep these
steps of both sides from each other. Everything else belongs to one side.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from typing import NamedTuple

from servogen.pic.device import INTERRUPT_VECTOR, RAM_FIRST, RAM_LAST, STACK_LEVELS, registers
from servogen.pic.known_values import word_of
from servogen.pic.wcet import TimedProgram
from servogen.prove.stream.execution import BANK_1, INTCON
from servogen.prove.stream.names import Names

ANSWER_VARIABLES = RX_BYTE, RX_LEFT, RX_BITS = "rx_byte", "rx_left", "rx_bits"
"""The receiver's variables, in which main leaves an answer to the interrupt."""
LOOP_REGISTERS = ("STATUS", "FSR", "PCLATH", "PCL", "INTCON", "EEADR", "EEDATA", "EECON1", "EECON2")
"""The registers that main may write in its loop, beside those of the pin that answers."""


class Fails(Exception):
    """Raised where a lemma does not hold; says what differs, and for which values."""


@dataclass(frozen=True, slots=True)
class Accesses:
    """What main's words read and write, by address."""

    reads: frozenset[int] = frozenset()
    writes: frozenset[int] = frozenset()

    def __or__(self, other: Accesses) -> Accesses:
        return Accesses(self.reads | other.reads, self.writes | other.writes)

    @property
    def places(self) -> frozenset[int]:
        return self.reads | self.writes


class MainAccesses(NamedTuple):
    """The accesses of main's steps."""

    start: Accesses = Accesses()
    """Until interrupts are enabled."""
    idle: Accesses = Accesses()
    """A turn of the loop without a request: an interrupt may take the pulse in any cycle of it."""
    prepare: Accesses = Accesses()
    """From a request until it is cleared."""
    execute: Accesses = Accesses()
    """From there to the loop's beginning."""


def check_sharing(names: Names, main: MainAccesses, context: Set[int]) -> None:
    """Check that main and the interrupt share only what the argument about times covers."""
    interrupt = [word_of(names.words[address]) for address in names.body_addresses()]
    touched = {word.f for word in interrupt if word.has_f and word.f >= RAM_FIRST}
    written = {word.f for word in interrupt if word.writes_f and RAM_FIRST <= word.f <= RAM_LAST}
    pulse = names.addresses("mask", "next_lo", "next_hi", "next_port", "due")
    command, answer = names.addresses("todo", "value"), names.addresses(*ANSWER_VARIABLES)
    shared = pulse | command | answer
    before_clear = main.prepare | main.idle
    after_clear = (main.execute.writes & pulse) | (main.execute.reads & names.addresses("due"))
    loop = before_clear | main.execute
    own_registers = {registers()[name].address for name in LOOP_REGISTERS}
    out = names.streamed.stream.transmit_pin
    own_registers |= {names.port(out), names.port(out) | BANK_1} if out else set()
    rules: tuple[tuple[Set[int], str], ...] = (
        (main.idle.writes & touched, "writes {} without a request"),
        (context & (main.start | loop).places, "uses {}, where the interrupt keeps its registers"),
        (loop.places & written - shared, "uses {}, which the interrupt writes"),
        (loop.writes & touched - shared, "writes {}, which the interrupt uses"),
        (after_clear, "uses {} after the request is cleared"),
        (before_clear.writes & {INTCON}, "masks interrupts beside a command"),
        (before_clear.places & (command | answer), "uses {} before the request is cleared"),
        (loop.writes - own_registers - {*range(RAM_FIRST, RAM_LAST + 1)}, "writes {} in its loop"),
    )
    for places, sentence in rules:
        for place in sorted(places):
            raise Fails(f"main {sentence.format(names.place_name(place))}")


def check_stack(names: Names) -> None:
    """Check that the chip has the return addresses that main and an interrupt in it need together."""
    program = TimedProgram(names.words, ())

    def depth(start: int, left: int) -> int:
        if left < 0:
            raise Fails(f"calls need more than {STACK_LEVELS} return addresses")
        words = map(program.word, program.reached(start))
        called = {word.k for word in words if word.flow == "call"}
        return max((1 + depth(begin, left - 1) for begin in called), default=0)

    main = depth(0, STACK_LEVELS)
    depth(INTERRUPT_VECTOR, STACK_LEVELS - main - 1)
