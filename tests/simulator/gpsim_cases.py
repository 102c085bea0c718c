"""Small programs on which gpsim 0.31 differs from the data sheets, and some on which it does not.

Each leaves its answer in RAM from 0x20 on. The expected bytes are worked out by hand from `rule`'s section.
"""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

from servogen.pic.image import Image, to_hex

ANSWER, ANSWER_BYTES = 0x20, 8
WATCHDOG_ON = "        __config _XT_OSC & _WDT_ON & _PWRTE_OFF\n"
WATCHDOG_OFF = "        __config _XT_OSC & _WDT_OFF & _PWRTE_OFF\n"


@dataclass(frozen=True)
class Case:
    """A program, and what RAM holds from 0x20 on after `cycles`; bytes that are not named are 0."""

    name: str
    rule: str
    source: str
    expected: tuple[int, ...]
    cycles: int = 1000
    config: str = WATCHDOG_OFF
    rb4: tuple[tuple[int, int], ...] = ()
    """Levels of RB4 from outside, low at first: (cycle, level)."""
    halts: int = 0
    """How often gpsim stops by itself and is started again."""

    @property
    def answer(self) -> tuple[int, ...]:
        return self.expected + (0,) * (ANSWER_BYTES - len(self.expected))


def option(value: int) -> str:
    """Return four cycles, of which the third writes OPTION_REG."""
    return f" bsf STATUS, RP0\n movlw {value}\n movwf OPTION_REG\n bcf STATUS, RP0\n"


def stored(read: str, count: int) -> str:
    """Return `read` (one cycle) so many times, its result stored in the cycle after it."""
    return "".join(f" {read}\n movwf {ANSWER + n}\n" for n in range(count))


def flag_after(cycles: int, place: int) -> str:
    """Write TMR0 with F0h, and read T0IF so many cycles later."""
    wait = " nop\n" * (cycles - 2)
    read = f" movf INTCON, w\n andlw 4\n movwf {ANSWER + place}\n"
    return f" movlw 0xF0\n movwf TMR0\n bcf INTCON, T0IF\n{wait}{read}"


def timed_out(answer: str, main: str) -> str:
    """Return a program that runs `main` and, after a time-out of the watchdog, `answer`."""
    stand = "rest clrwdt\n goto rest\n"
    return f" btfsc STATUS, NOT_TO\n goto main\n{answer} movwf {ANSWER}\n{stand}main\n{CLEAR}{main}"


CLEAR = "".join(f" clrf {ANSWER + n}\n" for n in range(ANSWER_BYTES))
STANDS = "stand goto stand\n"
INPUTS = " bsf STATUS, RP0\n movlw 0xFF\n movwf TRISB\n bcf STATUS, RP0\n"
PORT_B_READ = f"{INPUTS}{CLEAR} movf PORTB, w\n bcf INTCON, RBIF\n"
SERVED_TWICE = f"""
        goto    main
        org     4
        movf    TMR0, w
        incf    0x27, f
        btfsc   0x27, 0
        movwf   0x20
        btfss   0x27, 0
        movwf   0x21
        btfsc   0x27, 1
        bcf     INTCON, T0IE
        retfie
main
{CLEAR}{option(0x88)}
        clrf    TMR0
        nop
        nop
        nop
        nop
        movlw   0xA4
        movwf   INTCON
{STANDS}"""
BARRED = "".join(
    " movlw 0xF0\n movwf TMR0\n"
    + " nop\n" * (14 + n)
    + f" bcf INTCON, GIE\n movf INTCON, w\n movwf {ANSWER + n}\n"
    + " bcf INTCON, T0IF\n bsf INTCON, GIE\n nop\n nop\n"
    for n in range(8)
)

DIFFERENCES = (
    Case("TMR0 after a write", "DS30430 figure 6-2: NT0 is read in three cycles, then NT0 + 1",
        f"{CLEAR}{option(0x88)} movlw 10\n movwf TMR0\n{stored('movf TMR0, w', 4)}{STANDS}", (10, 10, 12,
        14)),
    Case("T0IF, polled",
        "DS30430 figure 6-4, note 4: F0h + 16 counts from the write's cycle + 3 on, and one cycle ahead: 18",
        CLEAR + option(0x88) + "".join(flag_after(16 + n, n) for n in range(5)) + STANDS, (0, 0, 4, 4, 4)),
    Case("the prescaler when OPTION_REG is written",
        "DS35007 section 5.2: only writes of TMR0 clear it; 7 counts before, then 1:8: 8 at the first read",
        f"{CLEAR}{option(0x83)} clrf TMR0\n" + " nop\n" * 6 + option(0x82) + stored("movf TMR0, w",
        8) + STANDS, (1, 1, 1, 1, 2, 2, 2, 2)),
    Case("the watchdog when OPTION_REG is written", "DS35007 section 6.10.1: CLRWDT and SLEEP clear it",
        timed_out(" movlw 1\n", f"again\n{option(0x88)} goto again\n"), (1, ), 60_000, WATCHDOG_ON),
    Case("STATUS as the destination of INCF, RLF and CLRF",
        "DS35007 section 2.3.1: C, DC and Z are not written, and CLRF leaves 000u u1uu",
        f"{CLEAR} movlw 0\n movwf STATUS\n incf STATUS, f\n movf STATUS, w\n movwf 0x20\n"
        " movlw 2\n movwf STATUS\n rlf STATUS, f\n movf STATUS, w\n bcf STATUS, RP0\n movwf 0x21\n"
        f" movlw 7\n movwf STATUS\n clrf STATUS\n movf STATUS, w\n movwf 0x22\n{STANDS}", (0x18, 0x3A, 0x1F)),
    Case("TMR0 after a watchdog reset", "DS35007 table 6-4: unchanged; 18 000 cycles by 1:256 are 70",
        timed_out(" movf TMR0, w\n", f"{option(0x87)} clrf TMR0\n{STANDS}"), (70, ), 60_000, WATCHDOG_ON,
        halts=1),
    Case("RBIF, cleared while RB4 differs from what was read",
        "DS35007 section 4.2: a mismatch continues to set it",
        PORT_B_READ + " nop\n" * 60 + " bcf INTCON, RBIF\n" + stored("movf INTCON, w", 2) + STANDS, (1, 1),
        rb4=((50, 1), )),
    Case("halt at a watchdog reset", "DS35007 section 6.3: the program starts again", timed_out(" movlw 1\n",
        f"{option(0x88)}{STANDS}"), (1, ), 60_000, WATCHDOG_ON),
    Case("halt at a CALL with a full stack", "DS35007 section 2.4.1: the ninth push writes over the first",
        CLEAR + "".join(f" call n{n}\nn{n}\n" for n in range(9)) + f" movlw 1\n movwf 0x20\n{STANDS}", (1, )),
    Case("RETFIE while a flag is set",
        "DS30430 figure 8-17: three cycles from sample to 0004h: INTCON written in c + 6, 0004h in c + 10, "
        "RETFIE eight cycles later, 0004h again after four more", SERVED_TWICE, (7, 19, 0, 0, 0, 0, 0, 2)),
    Case("BCF GIE in the cycle in which the flag is sampled",
        "DS30430 figure 8-17: 18 cycles after TMR0 is written is too late, RETFIE sets GIE; a cycle before, "
        "T0IF is seen with GIE clear; a cycle after, the interrupt is over",
        f" goto main\n org 4\n bcf INTCON, T0IF\n retfie\nmain\n{CLEAR}{option(0x88)}"
        f" movlw 0xA0\n movwf INTCON\n{BARRED}{STANDS}", (0x20, 0x20, 0x24, 0xA0, 0x20, 0x20, 0x20, 0x20)),
)  # fmt: skip

AGREEMENTS = (
    Case("RBIF after a change", "DS35007 section 4.2", PORT_B_READ + " nop\n" * 60 + stored("movf INTCON, w",
        2) + STANDS, (1, 1), rb4=((50, 1), )),
    Case("the prescaler, let alone",
        "DS35007 section 5.2: reads 12, 14, 16 … cycles after the anchor, by 1:16",
        f"{CLEAR}{option(0x83)} clrf TMR0\n" + " nop\n" * 14 + stored("movf TMR0, w", 8) + STANDS, (0, 0, 1,
        1, 1, 1, 1, 1)),
    Case("a watchdog that is not cleared", "DS35007 section 6.10", timed_out(" movlw 1\n",
        f"{option(0x88)}{STANDS}"), (1, ), 60_000, WATCHDOG_ON, halts=1),
)  # fmt: skip


def gpsim_version() -> str:
    """Return the version of the gpsim that is installed; empty where there is none."""
    try:
        done = subprocess.run(["gpsim", "--version"], capture_output=True, text=True, timeout=60)
    except FileNotFoundError:
        return ""
    found = re.search(r"\d+\.\d+", done.stdout + done.stderr)
    return found[0] if found else ""


def gpsim_answer(case: Case, program: Image, folder: Path) -> tuple[int, ...]:
    """Return the bytes of RAM from 0x20 on after gpsim ran the program."""
    (folder / "p.hex").write_text(to_hex(program))
    stimulus = ""
    if case.rb4:
        levels = ", ".join(f"{cycle}, {level}" for cycle, level in case.rb4)
        stimulus = (
            f"stimulus asynchronous_stimulus\ninitial_state 0\nstart_cycle 0\n{{ {levels} }}\nname s\nend\n"
            "node n\nattach n s portb4\n"
        )
    runs = "run\n" * (1 + case.halts)
    (folder / "p.stc").write_text(
        f"processor p16f84\nload p.hex\nfrequency 4000000\n{stimulus}"
        f"break c {case.cycles}\n{runs}dump r\nquit\n"
    )
    done = subprocess.run(
        ["gpsim", "-i", "-c", "p.stc"],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    row = re.search(r"^0020:((?: +[0-9a-f]{2}){16})", done.stdout, re.MULTILINE)
    assert row is not None, done.stdout
    return tuple(int(byte, 16) for byte in row[1].split()[:ANSWER_BYTES])
