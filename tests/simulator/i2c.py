"""A program that is a reader and writer of I²C by hand: SCL on RA0, driven, SDA on RA1, pulled low or let go.

`program` makes one from a list of what it does on the bus. `Probe` sees the wires, and `sigrok_words` is what
sigrok's decoder reads in a recording.
"""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from servogen.edges import EdgeTrace
from servogen.errors import Diagnostic
from servogen.pic.image import Image
from servogen.traces import write_edges
from servogen.units import Clock
from tests.simulator.helpers import image

FIRST = 0x20
"""The address of the first byte that is read, or of the first acknowledge that is noted."""
HEAD = """
SCL equ 0
SDA equ 1
byte equ 0x0C
count equ 0x0D
 movlw 1
 movwf PORTA
 bsf STATUS, RP0
 movlw 0x1E
 movwf TRISA
 bcf STATUS, RP0
 movlw 0x20
 movwf FSR
 goto main
down bcf PORTA, SDA
 bsf STATUS, RP0
 bcf TRISA, SDA
 bcf STATUS, RP0
 return
up bsf STATUS, RP0
 bsf TRISA, SDA
 bcf STATUS, RP0
 return
start call up
 bsf PORTA, SCL
 call down
 bcf PORTA, SCL
 return
stop call down
 bsf PORTA, SCL
 call up
 return
send movwf byte
 movlw 8
 movwf count
bit rlf byte, f
 btfss STATUS, C
 call down
 btfsc STATUS, C
 call up
 bsf PORTA, SCL
 nop
 bcf PORTA, SCL
 decfsz count, f
 goto bit
 call up
 bsf PORTA, SCL
 movf PORTA, w
 bcf PORTA, SCL
 andlw 2
 return
note movwf INDF
 incf FSR, f
 return
take movlw 8
 movwf count
 call up
next bsf PORTA, SCL
 bcf STATUS, C
 btfsc PORTA, SDA
 bsf STATUS, C
 rlf byte, f
 bcf PORTA, SCL
 decfsz count, f
 goto next
 movf byte, w
 goto note
yes call down
no bsf PORTA, SCL
 nop
 bcf PORTA, SCL
 return
main
"""


def program(steps: Sequence[str | int]) -> Image:
    """Return a program of these steps: "start", "stop"; a number: it is sent; "note": whether the last one
    was not acknowledged (2, else 0) goes to RAM; "take": a byte goes to RAM; "yes", "no": the acknowledge
    after it; "poll": start and control byte 0xA0 until it is acknowledged.
    """
    lines = []
    for number, step in enumerate(steps):
        if isinstance(step, int):
            lines.append(f" movlw {step}\n call send\n")
        elif step == "poll":
            lines.append(f"p{number} call start\n movlw 0xA0\n call send\n andlw 2\n")
            lines.append(f" btfss STATUS, Z\n goto p{number}\n")
        else:
            lines.append(f" call {step}\n")
    return image(f"{HEAD}{''.join(lines)}end_ goto end_\n")


@dataclass
class Probe:
    """A device that pulls nothing and notes every level of its lines."""

    seen: list[tuple[int, int]] = field(default_factory=list)
    remarks: tuple[tuple[int, Diagnostic], ...] = ()
    lines = ("scl", "sda")

    def power_up(self, clock: Clock) -> Probe:
        return self

    def off(self) -> Probe:
        return self

    def react(self, cycle: int, levels: int) -> int:
        self.seen.append((cycle, levels))
        return 0

    def snapshot(self) -> Any:
        return len(self.seen)

    def restore(self, state: Any) -> None:
        del self.seen[state:]

    def relative(self, cycle: int) -> Any:
        return None


def sigrok_words(edges: EdgeTrace, folder: Path, scl: str = "RA0", sda: str = "RA1") -> list[str]:
    """Return what sigrok reads in the recording of a run."""
    write_edges(edges, folder / "run.vcd")
    decoder = ("-P", f"i2c:scl={scl}:sda={sda}", "-A", "i2c=addr-data")
    command = ("sigrok-cli", "-I", "vcd", "-i", str(folder / "run.vcd"), *decoder)
    said = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    return [line.removeprefix("i2c-1: ") for line in said.stdout.splitlines()]
