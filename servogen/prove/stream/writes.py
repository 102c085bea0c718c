"""What the words of a stream's interrupt write, wherever they are executed: its own, and nothing else.

In: the interrupt's words, the addresses of the program's variables. Out: nothing, or `InterruptChanged` with
the first word that writes a port beside an edge or an answer, a variable of the C or of the receiver that is
not its to write, a register's bit that is not, or that leaves bank 0. What an edge, a write of TMR0 and the
clearing of T0IF do depends on their time: `interrupt` checks them.
"""

from __future__ import annotations

from collections.abc import Collection

from servogen.engines.stream.interrupt_code import (
    DUE,
    INTCON,
    PORT,
    PORTS,
    REST,
    TIMING_VARIABLES,
    TMR0,
    InterruptCode,
)
from servogen.engines.stream.streaming import Streaming
from servogen.pic.device import registers
from servogen.pic.isa import encode
from servogen.pic.known_values import FSR, INDF, NOT_FOLLOWED, STATUS, DecodedWord
from servogen.pic.listing import Listing
from servogen.prove.stream.looks import RECEIVER_VARIABLES, InterruptChanged

MASK = "mask"
"""The pin of the pulse that the C prepared."""
OWN_VARIABLES = (*TIMING_VARIABLES, DUE, MASK, PORT)
"""The interrupt's variables that looks at the line leave alone, but for `t`, whose value nothing keeps."""
T0IF = 2


def check_writes(code: InterruptCode, listing: Listing, looking: Collection[int]) -> None:
    """Check the interrupt without its looks at the line, whose addresses are `looking`."""
    own = {code.ram[name] for name in OWN_VARIABLES if name in code.ram}
    for first, name, count in listing.variables:
        if name.endswith("(temporary)"):
            own |= set(range(first, first + count))  # the context, kept by the compiler
    late = [address for address in code.words if _skips_late_pulse(code, address)]
    # Nothing comes to these but from the word before, or over it.
    uninterrupted = {*range(code.edge - 3, code.edge + 1), *late, *(address + 1 for address in late)}
    for address in code.words:
        word = code.word(address)
        if word.name in NOT_FOLLOWED:
            raise InterruptChanged(f"{word.name} at 0x{address:03X} is not followed")
        if word.flow in ("jump", "call") and word.k in uninterrupted:
            raise InterruptChanged(f"the word at 0x{address:03X} jumps to an edge")
        if not word.writes_f or word.f == TMR0 or address in looking or address == code.edge:
            continue  # these are checked where they are executed, looks by `check_look_writes`
        if word.f in (*PORTS, INDF):
            raise InterruptChanged(f"the word at 0x{address:03X} writes a port")
        allowed = {
            INTCON: word.name == "BCF" and word.b == T0IF,
            STATUS: _keeps_bank(code, address, word),
            FSR: word.name == "MOVWF",
            code.ram[DUE]: word.name == "BSF",
            code.ram[MASK]: address in late,
        }.get(word.f, word.f in own or word.name == "MOVF")  # MOVF f,F changes nothing but a flag
        if not allowed:
            raise InterruptChanged(f"the word at 0x{address:03X} writes what is not the interrupt's")


def check_look_writes(code: InterruptCode, looking: Collection[int], streamed: Streaming) -> None:
    """Check that a look at the line writes the receiver's variables and the pin that answers, and that the
    interrupt does not end in it.
    """
    own = {code.ram[name] for name in RECEIVER_VARIABLES}
    pin = streamed.stream.transmit_pin
    transmit = None if pin is None else (registers()[f"PORT{pin[1]}"].address, int(pin[2]))
    for address in sorted(looking):
        word = code.word(address)
        if word.name == "RETFIE":
            raise InterruptChanged(f"a look at the line ends the interrupt at 0x{address:03X}")
        answers = word.changes_bit and (word.f, word.b) == transmit
        keeps = word.f == STATUS and _keeps_bank(code, address, word)
        if word.writes_f and not (answers or keeps or word.f in own):
            raise InterruptChanged(f"a look at the line writes what is not its own, at 0x{address:03X}")


def _keeps_bank(code: InterruptCode, address: int, word: DecodedWord) -> bool:
    """Return whether a write of STATUS leaves bank 0 selected, or returns to the bank of the C at the end."""
    if word.changes_bit:
        return word.b == 0 or word.selects_bank_0
    # MOVWF STATUS, then perhaps SWAPF: W is restored, and no flag changes; then RETFIE.
    following = address + 1
    while following in code.words and code.word(following).name == "SWAPF":
        following += 1
    return word.name == "CLRF" or (word.name == "MOVWF" and code.words.get(following) == encode("RETFIE"))


def _skips_late_pulse(code: InterruptCode, address: int) -> bool:
    """Return whether a word clears the pin only where the C is late, and the overrun bit is set then.

    The word between is the jump over both, which BTFSS skips only while the request is pending.
    """
    return _words(code, address - 2, address + 1) == (
        encode("BTFSS", f=code.ram[DUE], b=1),
        encode("GOTO", k=address + 2),
        encode("CLRF", f=code.ram[MASK]),
        encode("BSF", f=code.ram[DUE], b=0),
    )


def writes_mask_if_rest_is_0(code: InterruptCode) -> bool:
    """Return whether the edge writes `mask` if `rest` is 0, and 0 if not."""
    return _words(code, code.edge - 4, code.edge - 1) == (
        encode("MOVF", f=code.ram[REST], d=1),
        encode("MOVLW", k=0),
        encode("BTFSC", f=STATUS, b=2),
        encode("MOVF", f=code.ram[MASK], d=0),
    )


def _words(code: InterruptCode, first: int, last: int) -> tuple[int | None, ...]:
    return tuple(code.words.get(address) for address in range(first, last + 1))
