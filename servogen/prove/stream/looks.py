"""A look at the line: what the words of the receiver can do, and in which cycle each of it is.

In: the words of an interrupt, with the addresses of the subroutines that look. Out: every outcome of each of
them, and a check that the receiver's time is kept as the engine's template keeps it. What the line shows, and
what was received before, is not known: every test of these goes both ways.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum
from typing import NamedTuple

from servogen.engines.stream.rendering import tick
from servogen.engines.stream.response import PORTS, TMR0, Round, RoundMoment, T
from servogen.engines.stream.settings import SAMPLE_AFTER, STOP_AFTER
from servogen.engines.stream.streaming import Streaming
from servogen.errors import InputError
from servogen.graph import reached
from servogen.pic.assembler import assemble
from servogen.pic.device import addresses
from servogen.pic.known_values import RETURNED, ZERO, Known, word_of

(STATUS,) = addresses("STATUS")
RX_BITS, RX_LEFT = "rx_bits", "rx_left"
OF_RECEIVER = (T, RX_BITS, RX_LEFT, "rx_last", "rx_byte", "command", "todo", "value")
"""The interrupt's variables that nothing but looks at the line writes."""
BYTE = 10
"""What `rx_bits` is when a start bit was seen: not 0."""
MAX_STATES = 200_000


class Kind(Enum):
    """What a look at the line is."""

    NONE = "no look is known of"
    HUNT = "for a start bit: none there"
    START = "a start bit is seen"
    WAIT = "a bit is not due yet"
    BIT = "a bit is taken"
    SENT = "an answer's first bit is sent"


NONE, HUNT, START, WAIT, BIT, SENT = Kind


class InterruptChanged(Exception):
    """Raised if the words are not those of an interrupt whose edges are exact; says what does not hold."""


class Look(NamedTuple):
    """An outcome of a look at the line; times in cycles from the subroutine's first word."""

    kind: Kind
    cycles: int
    sample: int
    stamp: int


class _Progress(NamedTuple):
    """Within a look."""

    address: int
    stack: tuple[int, ...] = ()
    now: int = 0
    kind: Kind = NONE
    sample: int = 0
    stamp: int = 0


def looks_of(code: Round, begin: int, hunt: int) -> tuple[Look, ...]:
    """Return every outcome of the subroutine at `begin`; `hunt` looks for a start bit."""

    def following(at: _Progress) -> Iterator[_Progress]:
        address, stack, now, kind, sample, stamp = at
        if address == RETURNED:
            return
        word = word_of(code.words[address])
        if address == hunt:
            kind, sample = HUNT, now
        elif word.has_f and word.f == TMR0:
            kind, stamp = (START if kind == HUNT else WAIT), now
            sample = sample if kind == START else now + SAMPLE_AFTER[0]
        elif _takes(code, address):
            kind = BIT
        for after in code.steps(RoundMoment(address, stack, now, {}), word):
            yield _Progress(after.address, after.stack, after.cycle, kind, sample, stamp)

    outcomes = []
    for count, at in enumerate(reached([_Progress(begin)], following)):
        if count > MAX_STATES:
            raise InterruptChanged("a look at the line does not end")
        if at.address == RETURNED:
            outcomes.append(Look(at.kind, at.now, at.sample, at.stamp))
    return tuple(sorted({*outcomes}, key=lambda look: (look.kind.name, look.cycles, look.stamp)))


def _takes(code: Round, address: int) -> bool:
    """Return whether a word is the one behind which a bit is taken: it makes the time of the next one."""
    word = word_of(code.words[address])
    return word.name == "ADDWF" and word.writes_f and word.f == code.ram[RX_LEFT]


class _Sampling(NamedTuple):
    """Within the subroutine that takes a bit."""

    address: int
    stack: tuple[int, ...]
    now: int
    stamp: int
    taken: bool
    known: frozenset[tuple[int, int]]


def check_samples(code: Round, take: int) -> None:
    """Check how long after its time stamp a bit is sampled; rx_bits is 1 before the stop bit. Raises
    InterruptChanged.
    """
    bits = code.ram[RX_BITS]
    for before, limits in (({bits: 1}, (SAMPLE_AFTER[0], STOP_AFTER)), ({}, SAMPLE_AFTER)):

        def following(
            at: _Sampling,
            limits: tuple[int, int] = limits,  # bound now: the loop goes on
        ) -> Iterator[_Sampling]:
            address, stack, now, stamp, taken, known = at
            if address == RETURNED:
                return
            word = word_of(code.words[address])
            stamp = now if word.has_f and word.f == TMR0 else stamp
            taken |= _takes(code, address)
            after = now - stamp
            if taken and word.tests_bit and word.f in PORTS and not limits[0] <= after <= limits[1]:
                raise InterruptChanged(
                    f"a bit is sampled {after} cycles after its time stamp, at 0x{address:03X}"
                )
            for to in code.steps(RoundMoment(address, stack, now, dict(known)), word):
                remembered = frozenset(item for item in to.known.items() if item[0] in (bits, ZERO))
                yield _Sampling(to.address, to.stack, to.cycle, stamp, taken, remembered)

        begin: Known = before
        for _ in reached([_Sampling(take, (), 0, 0, False, frozenset(begin.items()))], following):
            pass  # each is checked where it is followed


def check_receiver(
    words: Mapping[int, int], ram: Mapping[str, int], take: int, hunt: int, streamed: Streaming
) -> None:
    """Check that the words that keep the receiver's time are the template's: what is known of a bit's time
    rests on them. Raises InterruptChanged.
    """
    template, labels = _template(ram, streamed)
    own_take, own_hunt = labels["st_take"], labels["st_hunt"]
    broken, ends = own_take + 7, own_take + 18
    clock = [(take - own_take, own) for own in range(own_take, ends) if own != broken]
    clock += [(hunt - own_hunt, own) for own in range(own_hunt + 1, labels["st_break"])]
    for moved, own in clock:
        if words.get(own + moved) != template[own]:
            raise InterruptChanged(f"the receiver's clock is not kept by the word at 0x{own + moved:03X}")
    sample = word_of(words[hunt])
    if sample.name != "BTFSC" or sample.f not in PORTS:
        raise InterruptChanged("a start bit is not looked for at a pin")


def _template(ram: Mapping[str, int], streamed: Streaming) -> tuple[Mapping[int, int], Mapping[str, int]]:
    """Return the words and labels of the engine's interrupt, with a program's addresses of its variables."""
    variables = "".join(f"_{name} EQU 0x{place:02X}\n" for name, place in ram.items())
    text = f"    include p16f84a.inc\n    radix dec\n{variables}{tick(streamed)}\n    end\n"
    try:
        found = assemble(text, "tick.asm")
    except InputError:
        raise InterruptChanged("the interrupt's variables are not there") from None
    return found.image.program, dict(found.labels)
