"""Edges of programs in gpsim, a simulator by others: a judge that shares no code with servogen.

gpsim 0.31 is exact for the instructions, pins, EEPROM reads and SLEEP until INT; it is not for a written or
polled TMR0, interrupts and the watchdog (docs/simulator.md, "Differences from gpsim 0.31"). So only programs
that read none of these are run.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Collection, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from servogen.edges import PINS
from servogen.pic.image import Image, to_hex
from servogen.simulator import MachineState

GPSIM_CASES = {"selects in the EEPROM", "resets itself", "any EEPROM, one servo"}
"""Of `attack_programs`: counted cycles, inputs that are polled, the EEPROM read."""
REGISTERS = {1: "TMR0", 3: "STATUS", 4: "FSR", 5: "PORTA", 6: "PORTB", 8: "EEDATA", 9: "EEADR", 11: "INTCON"}
"""In this order: a write of a port sets INTCON's flags."""
SERVO = "RB1"
"""The only output, if no others are named."""
LOGGED = re.compile(r"^0x([0-9A-F]{16}) |Wrote: 0x00([0-9A-F]{2}) to (port[ab]|tris[ab])\(", re.MULTILINE)


def gpsim_levels(
    image: Image,
    start: MachineState,
    changes: Iterable[tuple[int, int, int]],
    end: int,
    servos: Collection[str] = (SERVO,),
) -> list[tuple[int, int]]:
    """Return (cycle, levels of all driven pins) at each change within `end` cycles of a chip that begins with
    the values of `start`, while pins from outside change: (cycle, pin, level).
    """
    # An input without a stimulus would have its latch's level.
    levels = {pin: ["1, 0"] for pin in range(len(PINS)) if PINS[pin] not in servos}
    for cycle, pin, level in changes:
        levels[pin].append(f"{cycle}, {level}")
    stimuli = [
        f"stimulus asynchronous_stimulus\ninitial_state 0\nstart_cycle 0\n{{ {', '.join(each)} }}\n"
        f"name s{pin}\nend\nnode n{pin}\nattach n{pin} s{pin} {_name(pin)}"
        for pin, each in levels.items()
    ]
    latches = {"PORTA": start.registers["LATA"], "PORTB": start.registers["LATB"]}
    named = start.registers | latches | {"STATUS": start.status, "INTCON": 0}
    values = {address: named[name] for address, name in REGISTERS.items()}
    values |= {0x0C + place: value for place, value in enumerate(start.ram)}
    known = [f"reg(0x{address:x}) = {value}" for address, value in values.items()]
    logs = [f"log w {name}" for name in ("porta", "portb", "trisa", "trisb")]
    begin = ["processor p16f84", "load p.hex", *known, f"W = {start.w}"]
    run = ["log on p.log", *logs, f"break c {end}", "run", "log off", "quit"]
    with TemporaryDirectory() as folder:
        (Path(folder) / "p.hex").write_text(to_hex(image))
        (Path(folder) / "p.stc").write_text("\n".join([*begin, *stimuli, *run, ""]))
        subprocess.run(
            ["gpsim", "-i", "-c", "p.stc"],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=60,
            check=True,
        )
        return _driven((Path(folder) / "p.log").read_text(), latches)


def _name(pin: int) -> str:
    return f"porta{pin}" if pin < 5 else f"portb{pin - 5}"


def _driven(log: str, latches: dict[str, int]) -> list[tuple[int, int]]:
    held = {"porta": latches["PORTA"], "portb": latches["PORTB"], "trisa": 0x1F, "trisb": 0xFF}
    now, found = 0, [(0, 0)]
    for cycle, value, name in LOGGED.findall(log):
        if cycle:
            now = int(cycle, 16)
            continue
        held[name] = int(value, 16)
        out = held["porta"] & ~held["trisa"] & 0x0F | (held["portb"] & ~held["trisb"]) << 5
        if out != found[-1][1]:
            found.append((now, out))
    return found[1:]
