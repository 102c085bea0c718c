"""A look at the line: what the receiver's subroutines can do, with the exact cycles of each outcome.

In: the words of an interrupt, with the addresses of the subroutines that look. Out: every outcome of each,
and a check that the receiver's time is kept as the engine's template keeps it. What the line shows, and what
was received before, is not known: every test of these goes both ways. A look has two moments:

    sample   a port is read, whose level decides whether a start bit begins, or is the bit's
    stamp    TMR0 is read: the time from which the receiver counts until the next bit is due
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum
from typing import NamedTuple

from servogen.engines.stream.interrupt_code import PORTS, TMR0, InterruptCode, T, TimedState
from servogen.engines.stream.rendering import tick
from servogen.engines.stream.settings import SAMPLE_AFTER, STOP_AFTER
from servogen.engines.stream.streaming import Streaming
from servogen.errors import InputError
from servogen.graph import reached
from servogen.pic.assembler import assemble
from servogen.pic.known_values import RETURNED, ZERO, DecodedWord, Known, word_of

RX_BITS, RX_LEFT = "rx_bits", "rx_left"
RECEIVER_VARIABLES = (T, RX_BITS, RX_LEFT, "rx_last", "rx_byte", "command", "todo", "value")
"""The interrupt's variables that nothing but looks at the line writes."""
BYTE = 10
"""What `rx_bits` is when a start bit was seen: not 0."""
MAX_STATES = 200_000


class Kind(Enum):
    """What a look at the line is; while the chip answers, bits are sent where they would be received."""

    NONE = "no look is known of"
    HUNT = "for a start bit: none there"
    START = "a start bit is seen"
    WAIT = "a bit is not due yet"
    BIT = "a bit is received or sent"
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


def look_outcomes(code: InterruptCode, begin: int, hunt: int) -> tuple[Look, ...]:
    """Return every outcome of the subroutine at `begin`; `hunt` is the word that samples for a start bit."""

    def following(at: _Progress) -> Iterator[_Progress]:
        address, stack, now, kind, sample, stamp = at
        if address == RETURNED:
            return
        word = code.word(address)
        if address == hunt:
            kind, sample = HUNT, now
        elif _reads_timer(word):
            # TMR0 is read in a hunt only if a start bit was seen; in all other looks before the bit is
            # sampled.
            kind, stamp = (START if kind == HUNT else WAIT), now
            sample = sample if kind == START else now + SAMPLE_AFTER[0]
        elif _schedules_next_bit(code.ram, word):
            kind = BIT
        for after in code.successors(TimedState(address, stack, now, {}), word):
            yield _Progress(after.address, after.stack, after.cycle, kind, sample, stamp)

    outcomes = set()
    for count, at in enumerate(reached([_Progress(begin)], following)):
        if count > MAX_STATES:
            raise InterruptChanged("a look at the line does not end")
        if at.address == RETURNED:
            outcomes.add(Look(at.kind, at.now, at.sample, at.stamp))
    return tuple(sorted(outcomes, key=lambda look: (look.kind.name, look.cycles, look.stamp)))


def _reads_timer(word: DecodedWord) -> bool:
    return word.has_f and word.f == TMR0


def _schedules_next_bit(ram: Mapping[str, int], word: DecodedWord) -> bool:
    """Return whether a word adds a bit's time to `rx_left`: it is executed only if a bit is due."""
    return word.name == "ADDWF" and word.writes_f and word.f == ram[RX_LEFT]


class _Sampling(NamedTuple):
    """Within the subroutine that receives a bit."""

    address: int
    stack: tuple[int, ...]
    now: int
    stamp: int
    is_due: bool
    known: frozenset[tuple[int, int]]


def check_sample_times(code: InterruptCode, take: int) -> None:
    """Check how long after its time stamp a bit is sampled by the subroutine at `take`. Raises
    InterruptChanged.
    """
    # `rx_bits` is 1 before the stop bit, whose sample has less time.
    _check_sample_times(code, take, {code.ram[RX_BITS]: 1}, range(SAMPLE_AFTER[0], STOP_AFTER + 1))
    _check_sample_times(code, take, {}, range(SAMPLE_AFTER[0], SAMPLE_AFTER[1] + 1))


def _check_sample_times(code: InterruptCode, take: int, known: Known, allowed: range) -> None:
    tracked = code.ram[RX_BITS], ZERO

    def following(at: _Sampling) -> Iterator[_Sampling]:
        if at.address == RETURNED:
            return
        word = code.word(at.address)
        stamp = at.now if _reads_timer(word) else at.stamp
        is_due = at.is_due or _schedules_next_bit(code.ram, word)
        if is_due and word.tests_bit and word.f in PORTS and at.now - stamp not in allowed:
            raise InterruptChanged(
                f"a bit is sampled {at.now - stamp} cycles after its time stamp, at 0x{at.address:03X}"
            )
        for after in code.successors(TimedState(at.address, at.stack, at.now, dict(at.known)), word):
            remembered = frozenset(item for item in after.known.items() if item[0] in tracked)
            yield _Sampling(after.address, after.stack, after.cycle, stamp, is_due, remembered)

    for _ in reached([_Sampling(take, (), 0, 0, False, frozenset(known.items()))], following):
        pass  # each is checked where it is followed


def check_receiver(
    words: Mapping[int, int], ram: Mapping[str, int], take: int, hunt: int, streamed: Streaming
) -> None:
    """Check that the words that keep the receiver's time are the template's: what is known of a bit's time
    rests on them. Raises InterruptChanged.
    """
    template, labels = _template(ram, streamed)
    own_take, own_hunt = labels["st_take"], labels["st_hunt"]
    due = next(
        address
        for address in range(own_take, own_hunt)
        if _schedules_next_bit(ram, word_of(template[address]))
    )
    # All words until a bit is due, but for the jump to where a broken byte goes on: its target moves.
    clock = [own for own in range(own_take, due + 1) if word_of(template[own]).flow != "jump"]
    pairs = [(own + take - own_take, own) for own in clock]
    pairs += [(own + hunt - own_hunt, own) for own in range(own_hunt + 1, labels["st_break"])]
    for address, own in pairs:
        if words.get(address) != template[own]:
            raise InterruptChanged(f"the receiver's clock is not kept by the word at 0x{address:03X}")
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
