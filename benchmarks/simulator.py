"""The simulator's speed: whole processes beside gpsim's, a day of servo pulses, the compilation.

Run: `python benchmarks/simulator.py`. With gpsim installed (Debian package `gpsim`) each program runs in
both, recording every change of PORTB, and the ratio of the wall times counts, all in this one run.
Exit code 1 when a demand is missed.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from servogen.pic.assembler import assemble
from servogen.pic.image import to_hex
from servogen.simulator.core import NATIVE

ROUNDS = 3
CYCLES_PER_SECOND = 1_000_000  # 4 MHz
COMPILATION_S, DAY_S, VERSION_S, HELP_S = 20.0, 60.0, 0.15, 0.25
ROOT = Path(__file__).parent.parent
LAB_8 = ROOT / "firmware" / "lab8-exercise"

HEAD = """
        list    p=16f84, r=dec
        include <p16f84.inc>
        errorlevel -302
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON
        org     0
"""

DELAYS = """
        clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
frame   bsf     PORTB, 0
        call    one_ms
        bcf     PORTB, 0
        movlw   18
        movwf   0x20
quiet   call    one_ms
        decfsz  0x20, f
        goto    quiet
        goto    frame
one_ms  movlw   4
        movwf   0x21
outer   movlw   82
        movwf   0x22
inner   decfsz  0x22, f
        goto    inner
        decfsz  0x21, f
        goto    outer
        return
        end
"""

INTERRUPTS = """
        goto    start
        org     4
        movwf   0x30
        swapf   STATUS, w
        movwf   0x31
        bcf     INTCON, T0IF
        incf    0x20, f         ; counts overflows of TMR0
        movlw   77
        subwf   0x20, w
        btfss   STATUS, Z
        goto    done
        clrf    0x20
        movlw   1
        xorwf   0x22, f
        movf    0x22, w
        movwf   PORTB
done    swapf   0x31, w
        movwf   STATUS
        swapf   0x30, f
        swapf   0x30, w
        retfie
start   clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        movlw   0x80
        movwf   OPTION_REG
        bcf     STATUS, RP0
        clrf    0x20
        clrf    0x22
        clrf    0x23
        clrf    0x24
        clrf    0x25
        movlw   0xA0
        movwf   INTCON
busy    incf    0x23, f
        movf    0x23, w
        addwf   0x24, f
        rlf     0x24, w
        xorwf   0x25, f
        btfsc   0x25, 3
        decf    0x24, f
        movlw   0x55
        andwf   0x24, w
        iorwf   0x25, f
        goto    busy
        end
"""

STRAIGHT = """
        goto    start
table   addwf   PCL, f
        retlw   1
        retlw   3
        retlw   7
        retlw   2
        retlw   6
        retlw   4
        retlw   5
        retlw   0
work    movlw   0x30
        addwf   0x20, w
        movwf   FSR
        movf    INDF, w
        addwf   0x21, f
        swapf   0x21, w
        xorwf   INDF, f
        rlf     0x21, f
        incf    INDF, f
        return
start   clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
        clrf    0x20
        clrf    0x21
        movlw   0x30
        movwf   FSR
clear   clrf    INDF
        incf    FSR, f
        btfss   FSR, 3
        goto    clear
loop    incf    0x20, f
        movlw   7
        andwf   0x20, f
        call    work
        call    work
        call    work
        call    work
        call    work
        call    work
        call    work
        movf    0x20, w
        call    table
        movwf   PORTB
        movlw   0x5A
        xorwf   0x21, f
        swapf   0x21, f
        comf    0x21, w
        sublw   0x33
        nop
        goto    loop
        end
"""


@dataclass(frozen=True)
class Program:
    """A program, how long it runs, and how many times faster than gpsim it is to be."""

    name: str
    source: str
    seconds: int
    demand: float


PROGRAMS = (
    Program("delay loops", DELAYS, 600, 10.0),
    Program("TMR0 interrupt, busy main loop", INTERRUPTS, 600, 3.0),
    Program("straight code, many edges", STRAIGHT, 60, 2.0),
)


def best_of(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Wall seconds, the best of `rounds`."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def servogen(*arguments: str) -> str:
    """Run the command line as a user does; its output."""
    command = [str(Path(sys.executable).parent / "servogen"), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def gpsim(folder: Path, program: Program) -> None:
    """Run gpsim on program.hex, logging writes of PORTB that it makes."""
    cycles = program.seconds * CYCLES_PER_SECOND
    script = folder / "run.stc"
    lines = (
        "processor p16f84",
        "load program.hex",
        "frequency 4000000",
        "log on program.log",
        "log w portb",
        f"break c {cycles}",
        "run",
        "quit",
    )
    script.write_text("\n".join(lines) + "\n")
    subprocess.run(
        ["gpsim", "-i", "-c", script.name],
        cwd=folder,
        check=True,
        stdin=subprocess.DEVNULL,
        capture_output=True,
    )


def against_gpsim(program: Program) -> bool:
    """Print one program's times; whether its demand is met, which without gpsim cannot be told."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        hex_file = folder / "program.hex"
        hex_file.write_text(to_hex(assemble(HEAD + program.source, "bench.asm").image))
        edges = folder / "edges.csv"
        run = ("simulate", str(hex_file), "--seconds", str(program.seconds), "--edges", str(edges), "--json")
        told = json.loads(servogen(*run))
        ours = best_of(lambda: servogen(*run))
        count = f"{told['edges']} edges"
        head = f"{program.name:<32} {program.seconds:>4} s simulated, {count:>14}: {ours:7.2f} s"
        if shutil.which("gpsim") is None:
            print(f"{head}   (gpsim is not installed)")
            return True
        theirs = best_of(lambda: gpsim(folder, program), 2)
    ratio = theirs / ours
    met = ratio >= program.demand
    print(f"{head}, gpsim {theirs:7.2f} s: {ratio:5.1f} times, demanded {program.demand:g}{missed(met)}")
    return met


def limited(what: str, seconds: float, limit: float) -> bool:
    met = seconds < limit
    print(f"{what:<64} {seconds:7.2f} s, demanded under {limit:g}{missed(met)}")
    return met


def missed(met: bool) -> str:
    return "" if met else "   MISSED"


def compilation() -> float:
    """Seconds in which an installation compiles the instruction loop."""
    with tempfile.TemporaryDirectory() as name:
        return best_of(lambda: NATIVE.compile(Path(name, "libcore.so")), 1)


def a_day() -> float:
    """Seconds to simulate 24 hours of the lab 8 exercise and hold every edge against its schedule."""
    schedule = str(LAB_8 / "schedule.json")
    image = str(LAB_8 / "main.hex")
    return best_of(lambda: servogen("verify", image, "--against", schedule, "--seconds", "86400"), 1)


def main() -> int:
    servogen("--version")
    met = [against_gpsim(program) for program in PROGRAMS]
    met.append(limited("24 h of the lab 8 exercise, every edge checked", a_day(), DAY_S))
    met.append(limited("the instruction loop is compiled", compilation(), COMPILATION_S))
    met.append(limited("servogen --version", best_of(lambda: servogen("--version"), 5), VERSION_S))
    met.append(limited("servogen --help", best_of(lambda: servogen("--help"), 5), HELP_S))
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
