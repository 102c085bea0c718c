"""Programs for the tests of the analyses: hand-written ones, and random ones that always end their loops."""

from __future__ import annotations

import random

from servogen.pic.analysis.facts import Facts
from servogen.pic.assembler import Assembly, assemble
from servogen.units import Clock

HEAD = '    list p=16f84, r=dec\n    include "p16f84.inc"\n    __config _WDT_OFF & _XT_OSC\n    org 0\n'
CLOCK = Clock(4_000_000)


def assembled(text: str) -> Assembly:
    """Return a program from its instructions."""
    return assemble(f"{HEAD}{text}\n    end\n")


def facts(text: str) -> Facts:
    """Return the answers about a program."""
    made = assembled(text)
    return Facts(made.image, made.listing, CLOCK)


INTERRUPT = """
    goto main
    org 4
    movwf 0x40
    swapf STATUS, w
    bcf STATUS, 5
    movwf 0x41
    bcf INTCON, 2
{work}
    swapf 0x41, w
    movwf STATUS
    swapf 0x40, f
    swapf 0x40, w
    retfie
"""
"""An interrupt of TMR0 that restores what it uses: ten instructions, eleven cycles, and its work."""


def random_program(seed: int) -> str:
    """Return a program that calls, branches on pins, counts and reads bytes, some of which nobody wrote."""
    rng = random.Random(seed)
    interrupt = rng.random() < 0.5
    labels = iter(range(1000))
    depth = rng.randint(1, 6)

    def piece(level: int, nesting: int) -> list[str]:
        kind = rng.randrange(9)
        label = f"l{next(labels)}"
        byte = rng.randrange(0x0C, 0x14)
        if kind == 0 and level < depth:
            return [f" call f{level + 1}"]
        if kind == 1 and nesting < 2:
            counter = 0x20 + 4 * level + nesting
            body = block(level, nesting + 1, 2)
            turns = rng.randint(1, 5)
            count = [f" decfsz {counter}, f", f" goto {label}"]
            return [f" movlw {turns}", f" movwf {counter}", label, *body, *count]
        if kind == 2:
            return [f" btfsc PORTB, {rng.randrange(8)}", f" goto {label}", *block(level, 2, 2), label]
        if kind == 3:
            return [f" movf {byte}, w"]
        if kind == 4:
            return [f" movlw {rng.randrange(256)}", f" movwf {byte}"]
        if kind == 5:
            return [f" btfss {byte}, {rng.randrange(8)}", f" incf {byte}, f"]
        if kind == 6:
            return [
                f" movlw {rng.randrange(0x0C, 0x14)}",
                " movwf FSR",
                rng.choice([" clrf INDF", " movf INDF, w"]),
            ]
        if kind == 7:
            return [f" movlw {rng.randrange(8)}", f" subwf {byte}, w", " btfsc STATUS, 0", f" goto {label}",
                    f" {rng.choice(['rlf', 'comf'])} {byte}, f", label]  # fmt: skip
        return [" nop"]

    def block(level: int, nesting: int, most: int) -> list[str]:
        return [line for _ in range(rng.randint(1, most)) for line in piece(level, nesting)]

    lines = []
    if interrupt:
        work = "\n".join([" nop"] * rng.randrange(4) + [" incf 0x42, f"])
        lines.append(INTERRUPT.format(work=work))
    lines.append("main")
    lines += [f" movlw {rng.randrange(256)}", f" movwf {rng.randrange(0x0C, 0x14)}"]
    if interrupt:
        lines += [" clrf TMR0", " bsf STATUS, 5", " movlw 0x88", " movwf 0x01", " bcf STATUS, 5",
                  " clrf 0x42", " movlw 0xA0", " movwf INTCON"]  # fmt: skip
    lines += [*block(0, 0, 4), "start", *block(0, 0, 4), "done", *block(0, 0, 2), " goto start"]
    for level in range(1, depth + 1):
        lines += [f"f{level}", *block(level, 0, 3), " return"]
    return "\n".join(lines)
