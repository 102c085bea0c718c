"""What a machine is like between two instructions, as a frozen value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from servogen.pic.device import EEPROM_BYTES, RAM_BYTES, RAM_FIRST, RAM_LAST, STACK_LEVELS
from servogen.simulator import layout as at
from servogen.units import Cycles


@dataclass(frozen=True, slots=True)
class Warning:
    """Something that the program did and that is worth a look."""

    cycle: Cycles
    kind: str
    message: str

    def __str__(self) -> str:
        return f"cycle {self.cycle}: {self.message}"


@dataclass(frozen=True, slots=True)
class State:
    """The machine's registers and memories, and the counts of what happened to it since power-up."""

    cycles: Cycles
    pc: int
    w: int
    status: int
    ram: bytes
    """The 68 bytes from 0x0C."""
    registers: Mapping[str, int]
    """Every special function register by name; ports as latches under LATA and LATB, as pins under PORTA, PORTB."""
    stack: tuple[int, ...]
    """The eight levels, the one that a return takes first."""
    stack_depth: int
    deepest_stack: int
    stack_wraps: int
    """How often a ninth level was pushed or an empty stack popped."""
    eeprom: bytes
    sleeping: bool
    resets: Mapping[str, int]
    """By cause: power_on, mclr, mclr_in_sleep, watchdog."""
    wakes: Mapping[str, int]
    """Ends of SLEEP by cause: watchdog, interrupt."""
    interrupts: int
    edges: int
    ram_written: tuple[int, ...]
    """Addresses of the RAM bytes that were ever written."""
    read_unwritten: tuple[int, ...]
    """Addresses of the RAM bytes that were read before they were ever written."""
    undefined_words: tuple[int, ...]
    """Addresses of executed words that no data sheet defines."""
    warnings: tuple[Warning, ...]

    @property
    def ram_high_water(self) -> int:
        """The number of RAM bytes ever written."""
        return len(self.ram_written)


def state_of(s: npt.NDArray[np.int64], warnings: tuple[Warning, ...]) -> State:
    """The state in a vector."""
    ram = s[RAM_FIRST : RAM_LAST + 1]
    top = int(s[at.SP])
    levels = [int(s[at.STACK + (top - 1 - i) % STACK_LEVELS]) for i in range(STACK_LEVELS)]
    return State(
        cycles=Cycles(int(s[at.CYCLE])),
        pc=int(s[at.PC]),
        w=int(s[at.W]),
        status=int(s[at.STATUS]),
        ram=bytes(int(byte) & 0xFF for byte in ram),
        registers=MappingProxyType(_registers(s)),
        stack=tuple(levels),
        stack_depth=int(s[at.DEPTH]),
        deepest_stack=int(s[at.DEEPEST]),
        stack_wraps=int(s[at.OVERFLOWS] + s[at.UNDERFLOWS]),
        eeprom=bytes(int(byte) for byte in s[at.EEPROM : at.EEPROM + EEPROM_BYTES]),
        sleeping=bool(s[at.SLEEPING]),
        resets=MappingProxyType(
            {
                "power_on": 1,
                "mclr": int(s[at.RESETS_MCLR]),
                "mclr_in_sleep": int(s[at.RESETS_MCLR_SLEEP]),
                "watchdog": int(s[at.RESETS_WDT]),
            }
        ),
        wakes=MappingProxyType({"watchdog": int(s[at.WAKES_WDT]), "interrupt": int(s[at.WAKES_INTERRUPT])}),
        interrupts=int(s[at.INTERRUPTS]),
        edges=int(s[at.EDGES_TOTAL]),
        ram_written=tuple(RAM_FIRST + i for i in range(RAM_BYTES) if not int(ram[i]) & at.NOT_WRITTEN),
        read_unwritten=read_unwritten(s),
        undefined_words=tuple(sorted(subjects(s, at.WARN_UNDEFINED))),
        warnings=warnings,
    )


def read_unwritten(s: npt.NDArray[np.int64]) -> tuple[int, ...]:
    """Addresses of the RAM bytes that were read before they were ever written."""
    return tuple(int(i) for i in np.flatnonzero(s[at.READ_UNWRITTEN : at.READ_UNWRITTEN + at.RAM_SLOTS]))


def noted(s: npt.NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """The warnings in a vector: (code, subject, cycle)."""
    pairs = s[at.WARNINGS : at.WARNINGS + 2 * int(s[at.WARN_COUNT])].reshape(-1, 2)
    return [(int(key) >> 16, int(key) & 0xFFFF, int(cycle)) for key, cycle in pairs]


def subjects(s: npt.NDArray[np.int64], code: int) -> set[int]:
    return {subject for noted_code, subject, _ in noted(s) if noted_code == code}


def _registers(s: npt.NDArray[np.int64]) -> dict[str, int]:
    ports = {name: int(s[slot]) for name, slot in (("PORT", at.PINS), ("LAT", at.LATCH), ("TRIS", at.TRIS))}
    split = {f"{name}A": value & 0x1F for name, value in ports.items()}
    split |= {f"{name}B": value >> 5 for name, value in ports.items()}
    plain = {
        "TMR0": at.T0_VALUE,
        "STATUS": at.STATUS,
        "FSR": at.FSR,
        "EEDATA": at.EEDATA,
        "EEADR": at.EEADR,
        "PCLATH": at.PCLATH,
        "INTCON": at.INTCON,
        "OPTION_REG": at.OPTION,
        "EECON1": at.EECON1,
    }
    return {"PCL": int(s[at.PC]) & 0xFF, "EECON2": 0} | split | {k: int(s[v]) for k, v in plain.items()}


def fingerprint(s: npt.NDArray[np.int64]) -> bytes:
    """Everything that the machine's future depends on, the time of day left out: equal means alike for ever.

    Times are counted from now; the stack's ring is turned so that its top is first; what only reports are made
    of is left out. RAM that was never written counts by the value that it happens to have.
    """
    now = int(s[at.CYCLE])
    ram = s[RAM_FIRST : RAM_LAST + 1] & 0xFF
    ring = np.roll(s[at.STACK : at.STACK + STACK_LEVELS], -int(s[at.SP]))
    plain = s[[*_PLAIN]]
    times = [_after(int(s[slot]), now) for slot in _TIMES]
    times.append(max(int(s[at.T0_AT]) - now, 0))
    times.append(int(s[at.T0_FLAGGED] == now))
    times.append(max(int(s[at.T0_HELD]) - now, 0))
    times.append(now - int(s[at.WDT_AT]) if s[at.WDT_PERIOD] else 0)
    if s[at.EE_STEP]:
        times.append(min(now - int(s[at.EE_STEP_AT]), 3))
    parts = (ram, ring, plain, np.array(times, dtype=np.int64), s[at.EEPROM : at.EEPROM + EEPROM_BYTES])
    return b"".join(part.astype(np.int64).tobytes() for part in parts)


_PLAIN = (
    at.PC,
    at.W,
    at.STATUS,
    at.FSR,
    at.PCLATH,
    at.INTCON,
    at.OPTION,
    at.SLEEPING,
    at.IN_RESET,
    at.T0_VALUE,
    at.PRESCALER,
    at.LATCH,
    at.TRIS,
    at.PINS,
    at.RB_OLD,
    at.EXT_MASK,
    at.EXT_LEVEL,
    at.EEDATA,
    at.EEADR,
    at.EECON1,
    at.EE_STEP,
    at.EE_CELL,
    at.EE_BYTE,
)
_TIMES = (at.IRQ_AT, at.T0_TICK, at.EE_DONE_AT)


def _after(when: int, now: int) -> int:
    return -1 if when == at.NEVER else when - now
