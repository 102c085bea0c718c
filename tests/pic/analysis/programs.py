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


def random_player(seed: int) -> str:
    """Return a program that plays a script from a table: steps, distances to go back by and how often, an
    index from pins, a pointer. In some the script is wrong: an index leads beyond the table.
    """
    rng = random.Random(seed)
    rows, length = rng.randint(4, 12), rng.randint(12, 48)
    script = [rng.randrange(rows) for _ in range(length)]
    for at in range(rng.randint(4, 20), length - 4, 20):
        script[at : at + 3] = [255, rng.randint(4, min(at + 3, 17)), rng.randint(1, 4)]
    if rng.random() < 0.2:
        script[rng.randrange(length)] = rng.randrange(256)
    wrap = rng.choice((" xorwf 0x20, w\n btfsc STATUS, 2\n", " subwf 0x20, w\n btfsc STATUS, 0\n"))
    few = rng.choice((1, 3))
    pieces = [
        f" movf PORTB, w\n andlw {few}\n movwf 0x26\n movf 0x26, w\n movwf 0x27\n movwf 0x28\n movf 0x27, f\n"
        " btfsc STATUS, 2\n goto s1\n decf 0x28, w\n call rows\n movwf 0x2B\ns1\n",
        " movf 0x29, w\n andlw 7\n addlw 0x30\n movwf FSR\n incf INDF, f\n movf 0x33, w\n movwf 0x2C\n",
        f" movlw {rng.randint(1, 30)}\n movwf 0x2A\ns2\n decfsz 0x2A, f\n goto s2\n",
        " incf 0x2D, f\n movlw 3\n andwf 0x2D, w\n btfsc STATUS, 2\n goto s3\n"
        " movlw 3\n andwf 0x2D, w\n call rows\ns3\n",
    ]
    chosen = "".join(piece for piece in pieces if rng.random() < 0.6)
    return (
        "main\n clrf 0x20\n clrf 0x21\n clrf 0x29\n clrf 0x2D\nloop\n call read\n movwf 0x22\n"
        " xorlw 255\n btfss STATUS, 2\n goto step\n"
        " call read\n movwf 0x23\n call read\n movwf 0x22\n"
        " movf 0x21, f\n btfss STATUS, 2\n goto back\n movf 0x22, w\n movwf 0x21\n"
        "back\n decf 0x21, f\n btfsc STATUS, 2\n goto on\n movf 0x23, w\n subwf 0x20, f\n"
        "on\n call read\n movwf 0x22\n"
        f"step\n movf 0x22, w\n call rows\n movwf 0x29\n{chosen} goto loop\n"
        f"rows\n addwf PCL, f\n" + "".join(f" retlw {rng.randrange(256)}\n" for _ in range(rows))
        + f"read\n movlw {length}\n{wrap} clrf 0x20\n incf 0x20, f\n decf 0x20, w\n addwf PCL, f\n"
        + "".join(f" retlw {each}\n" for each in script)
    )  # fmt: skip
