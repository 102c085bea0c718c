"""Random programs that do what programs do: count, wait, call, write ports, use the timer, sleep."""

from __future__ import annotations

import random
from collections.abc import Sequence

from servogen.pic.device import REGISTERS
from servogen.pic.image import Image
from servogen.pic.isa import encode

_BYTE = ("ADDWF", "ANDWF", "COMF", "DECF", "DECFSZ", "INCF", "INCFSZ", "IORWF", "MOVF", "RLF", "RRF", "SUBWF")
_BYTE_OPS = (*_BYTE, "SWAPF", "XORWF")
_LITERAL_OPS = ("ADDLW", "ANDLW", "IORLW", "MOVLW", "SUBLW", "XORLW")
_SFRS = tuple(each.address for each in REGISTERS if each.address < 0x80)
_STORED = sorted((6, *(f for f in _SFRS if f not in (0, 2, 3, 0x0A, 0x0B))))
"""Without those by which any value leads the program astray; PORTB twice, for its edges."""
RAM = (0x0C, 0x0D, 0x20, 0x21, 0x22, 0x4F)


def wild_image(seed: int) -> Image:
    """Any words at all, in all 1024 places."""
    rng = random.Random(seed)
    return Image({a: rng.randrange(0x4000) for a in range(1024)}, rng.randrange(0x4000), {0: seed & 0xFF})


def tame_image(seed: int, first: Sequence[int] = ()) -> Image:
    """A program of pieces, set up so that timers, interrupts, watchdog and loops have something to do.

    It begins with the words `first`.
    """
    rng = random.Random(seed)
    config = 0x3FF0 | rng.randrange(16)
    words: list[int] = []
    words += [encode("GOTO", k=12)] + [encode("NOP")] * 3
    words += _interrupt_routine(rng)
    words += [encode("NOP")] * (12 - len(words))
    words += [*first, *_set_up(rng)]
    main = len(words)
    size = rng.choice((45, 70, 180))  # a short program comes round often: it meets what it did before
    while len(words) < size:
        words += rng.choice(PIECES)(rng, len(words))
    words.append(encode("GOTO", k=main))
    return Image(dict(enumerate(words)), config, {i: rng.randrange(256) for i in range(4)})


def timed_image(seed: int) -> Image:
    """A program that waits for TMR0 to equal a byte, most of the time."""
    rng = random.Random(seed)
    words = [encode("GOTO", k=12), *[encode("NOP")] * 3, *_interrupt_routine(rng)]
    words += [encode("NOP")] * (12 - len(words))
    words += _set_up(rng)
    main = len(words)
    for _ in range(3):
        words += [word for _ in range(rng.randrange(3)) for word in rng.choice(PIECES)(rng, len(words))]
        words += rng.choice(
            ([], [encode("BCF", f=3, b=5)], [encode("BCF", f=3, b=5)], [encode("BSF", f=3, b=5)])
        )
        words += _store(rng, len(words)) if rng.random() < 0.5 else []
        byte, head = rng.choice(RAM), len(words)
        words += rng.choice(([], [], [encode("GOTO", k=head + 4)]))
        head = len(words)
        words += [encode("MOVF", f=1, d=0), encode("XORWF", f=byte, d=0), encode("BTFSS", f=3, b=2)]
        words += [encode("GOTO", k=head), encode("INCF", f=6, d=1), encode("INCF", f=byte, d=1)]
    words.append(encode("GOTO", k=main))
    return Image(dict(enumerate(words)), 0x3FF0 | rng.randrange(16))


def _interrupt_routine(rng: random.Random) -> list[int]:
    clear = [encode("BCF", f=0x0B, b=b) for b in rng.sample((0, 1, 2), 2)]
    other = rng.choice(
        (
            encode("MOVF", f=6, d=0),
            encode("INCF", f=0x20, d=1),
            encode("BSF", f=6, b=1),
            encode("COMF", f=6, d=1),
            encode("ADDWF", f=1, d=1),
        )
    )
    return [encode("BCF", f=3, b=5), *clear, other, encode("MOVF", f=6, d=0), encode("RETFIE")]


def _set_up(rng: random.Random) -> list[int]:
    words = [encode("BSF", f=3, b=5)]
    for register in (5, 6):
        words += [encode("MOVLW", k=rng.randrange(256)), encode("MOVWF", f=register)]
    option = rng.choice((rng.randrange(256), rng.randrange(256) & 0xDF, 0x80 | rng.randrange(4)))
    words += [encode("MOVLW", k=option), encode("MOVWF", f=1), encode("BCF", f=3, b=5)]
    for address in rng.sample(RAM, rng.randrange(len(RAM) + 1)):
        words += [encode("MOVLW", k=rng.randrange(256)), encode("MOVWF", f=address)]
    intcon = rng.choice((0, 0xA0, 0x90, 0x88, 0xF8, 0x28, 0x10, 0x40, 0xC0))
    return [*words, encode("MOVLW", k=intcon), encode("MOVWF", f=0x0B)]


def _any_byte_op(rng: random.Random, here: int) -> list[int]:
    f = rng.choice(_SFRS) if rng.random() < 0.3 else rng.choice(RAM)
    if f == 2:
        return [encode("MOVF", f=2, d=0)]
    return [encode(rng.choice(_BYTE_OPS), f=f, d=rng.randrange(2))]


def literal(rng: random.Random, here: int) -> list[int]:
    return [encode(rng.choice(_LITERAL_OPS), k=rng.randrange(256))]


def _store(rng: random.Random, here: int) -> list[int]:
    f = rng.choice((*_STORED, *RAM))
    return [encode("MOVLW", k=rng.randrange(256)), encode("MOVWF", f=f)]


def bit(rng: random.Random, here: int) -> list[int]:
    name = rng.choice(("BCF", "BSF", "BTFSC", "BTFSS"))
    return [encode(name, f=rng.choice((3, 5, 6, 0x0B, *RAM)), b=rng.choice((0, 1, 2, 5, 7)))]


def _delay(rng: random.Random, here: int) -> list[int]:
    a, b = rng.sample(RAM, 2)
    load = [encode("MOVLW", k=rng.choice((1, 2, 7, 50, 255, 0))), encode("MOVWF", f=a)]
    inner = here + 2
    kind = rng.randrange(5)
    if kind == 0:
        return [*load, encode("DECFSZ", f=a, d=1), encode("GOTO", k=inner)]
    if kind == 1:
        return [*load, encode("NOP"), encode("INCFSZ", f=a, d=1), encode("GOTO", k=inner)]
    if kind == 2:  # a nest that shares its head
        loop = [encode("DECFSZ", f=a, d=1), encode("GOTO", k=inner)]
        few = [encode("MOVLW", k=3), encode("MOVWF", f=b)]
        inner += 2
        loop = [encode("DECFSZ", f=a, d=1), encode("GOTO", k=inner)]
        return [*load, *few, *loop, encode("DECFSZ", f=b, d=1), encode("GOTO", k=inner)]
    if kind == 3:  # a nest that loads its inner counter anew
        outer = here + 2
        body = [encode("MOVLW", k=rng.randrange(1, 20)), encode("MOVWF", f=b)]
        body += [encode("DECFSZ", f=b, d=1), encode("GOTO", k=outer + 2)]
        return [*load, *body, encode("DECFSZ", f=a, d=1), encode("GOTO", k=outer)]
    both = [encode("MOVLW", k=2), encode("MOVWF", f=b)]
    return [
        *load,
        *both,
        encode("DECFSZ", f=a, d=1),
        encode("GOTO", k=inner + 5),
        encode("DECFSZ", f=b, d=1),
        encode("GOTO", k=inner + 2),
        encode("NOP"),
    ]


def _wait(rng: random.Random, here: int) -> list[int]:
    """Until something happens, or a counter in an interrupt routine or a watchdog ends it."""
    kind = rng.randrange(8)
    if kind == 0:
        return [encode("BTFSS", f=0x0B, b=2), encode("GOTO", k=here)]
    if kind == 1:
        return [encode("NOP"), encode("BTFSC", f=6, b=rng.randrange(8)), encode("GOTO", k=here)]
    if kind == 2:
        return [encode("BTFSS", f=rng.choice(RAM), b=rng.randrange(8)), encode("GOTO", k=here)]
    if kind == 3 and rng.random() < 0.4:
        clear = [encode("CLRWDT")] if rng.random() < 0.5 else []
        return [*clear, encode("GOTO", k=here)]
    if kind == 4:
        body = rng.choices([encode("CLRWDT"), encode("NOP")], k=rng.randrange(1, 4))
        return [*body, encode("BTFSS", f=rng.choice((0x0B, *RAM)), b=2), encode("GOTO", k=here)]
    return [encode("CLRWDT")]


def sleep(rng: random.Random, here: int) -> list[int]:
    return [encode("SLEEP"), encode("NOP")] if rng.random() < 0.5 else [encode("CLRWDT")]


def eeprom(rng: random.Random, here: int) -> list[int]:
    bank1 = encode("BSF", f=3, b=5)
    write = [encode("MOVLW", k=0x55), encode("MOVWF", f=9), encode("MOVLW", k=0xAA), encode("MOVWF", f=9)]
    if rng.random() < 0.2:
        write.insert(rng.randrange(4), encode("NOP"))
    start = [encode("BSF", f=8, b=2), *write, encode("BSF", f=8, b=1)]
    return [bank1, *start, encode("BSF", f=8, b=0), encode("BCF", f=3, b=5)]


def subroutine(rng: random.Random, here: int) -> list[int]:
    return [
        encode("CALL", k=here + 2),
        encode("GOTO", k=here + 4),
        encode("INCF", f=0x22, d=1),
        encode("RETLW", k=7),
    ]


def _table(rng: random.Random, here: int) -> list[int]:
    jump = [
        encode("MOVLW", k=here >> 8),
        encode("MOVWF", f=0x0A),
        encode("MOVLW", k=1),
        encode("ADDWF", f=2, d=1),
    ]
    return [*jump, encode("NOP"), encode("CLRF", f=0x0A)]


def _indirect(rng: random.Random, here: int) -> list[int]:
    to = rng.choice((*RAM, 0x05, 0x06, 0x8B, 0xA0, 0x81, 0x00, 0x50, 0x07))
    return [
        encode("MOVLW", k=to),
        encode("MOVWF", f=4),
        encode(rng.choice(_BYTE_OPS), f=0, d=rng.randrange(2)),
    ]


PIECES = (
    _any_byte_op,
    _any_byte_op,
    literal,
    _store,
    bit,
    _delay,
    _delay,
    _wait,
    sleep,
    eeprom,
    subroutine,
    _table,
    _indirect,
)


def random_stimuli(seed: int, end: int) -> list[tuple[int, int, int]]:
    """(cycle, pin, level), at random moments, in order; now and then MCLR, always let go."""
    rng = random.Random(seed)
    changes = []
    for _ in range(rng.randrange(40)):
        at = rng.randrange(end)
        pin = rng.choice((4, 4, 5, 5, 9, 10, 11, 12, rng.randrange(13)))
        changes.append((at, pin, rng.randrange(3)))
    if rng.random() < 0.3:
        at = rng.randrange(end)
        changes += [(at, 13, 0), (at + rng.randrange(5), 13, 1)]
    return sorted(changes, key=lambda change: change[0])
