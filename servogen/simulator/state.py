"""The state of a machine between two instructions, as a frozen value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from servogen.errors import Diagnostic
from servogen.pic.device import EEPROM_BYTES, RAM_BYTES, RAM_FIRST, RAM_LAST, STACK_LEVELS, registers
from servogen.simulator import layout as at
from servogen.simulator.warnings import subjects
from servogen.units import Cycles

if TYPE_CHECKING:
    from servogen.answers import StateAnswer


@dataclass(frozen=True, slots=True)
class MachineState:
    """The machine's registers and memories, and counts of what has happened since power-up."""

    cycles: Cycles
    pc: int
    w: int
    status: int
    ram: bytes
    """The 68 bytes from 0x0C."""
    registers: Mapping[str, int]
    """Every special function register by name; a port's latch is LATA or LATB, its pins PORTA or PORTB."""
    stack: tuple[int, ...]
    """The eight levels, the top of the stack first."""
    stack_depth: int
    deepest_stack: int
    stack_wraps: int
    """The number of pushes of a ninth level and of pops from an empty stack."""
    eeprom: bytes
    sleeping: bool
    prescaler: int
    """The count of the prescaler, which TMR0 or the watchdog uses."""
    watchdog_at: Cycles | None
    """The cycle in which the watchdog times out unless it is cleared before; None while it is off."""
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
    warnings: tuple[Diagnostic, ...]

    @property
    def ram_high_water(self) -> int:
        """Return the number of RAM bytes ever written."""
        return len(self.ram_written)

    def to_json(self) -> StateAnswer:
        """Return the state without the warnings."""
        return {
            "cycles": self.cycles,
            "pc": self.pc,
            "w": self.w,
            "status": self.status,
            "ram": list(self.ram),
            "registers": dict(self.registers),
            "eeprom": list(self.eeprom),
            "resets": dict(self.resets),
            "stack_wraps": self.stack_wraps,
            "deepest_stack": self.deepest_stack,
            "edges": self.edges,
            "sleeping": self.sleeping,
        }


def state_of(s: npt.NDArray[np.int64], warnings: tuple[Diagnostic, ...]) -> MachineState:
    """Return the state in a vector."""
    ram = s[RAM_FIRST : RAM_LAST + 1]
    top = int(s[at.SP])
    levels = [int(s[at.STACK + (top - 1 - i) % STACK_LEVELS]) for i in range(STACK_LEVELS)]
    return MachineState(
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
        prescaler=int(s[at.PRESCALER]),
        watchdog_at=_watchdog_at(s),
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
        undefined_words=subjects(s, at.WARN_UNDEFINED),
        warnings=warnings,
    )


def read_unwritten(s: npt.NDArray[np.int64]) -> tuple[int, ...]:
    """Return the addresses of RAM bytes that were read before they were first written."""
    return tuple(int(i) for i in np.flatnonzero(s[at.READ_UNWRITTEN : at.READ_UNWRITTEN + at.RAM_SLOTS]))


def _watchdog_at(s: npt.NDArray[np.int64]) -> Cycles | None:
    """Return when the watchdog times out: after one of its periods, or as many as its prescaler counts."""
    if not s[at.WDT_PERIOD]:
        return None
    option = int(s[at.OPTION])
    division = 1 << (option & at.PS) if option & at.PSA else 1
    periods = division - (int(s[at.PRESCALER]) & (division - 1))
    return Cycles(int(s[at.WDT_AT]) + periods * int(s[at.WDT_PERIOD]))


def _registers(s: npt.NDArray[np.int64]) -> dict[str, int]:
    ports = {row.port: int(s[row.number]) for row in at.ROWS if row.port}
    values = {"PCL": int(s[at.PC]) & 0xFF, "EECON2": 0}
    values |= {f"{name}A": value & 0x1F for name, value in ports.items()}
    values |= {f"{name}B": value >> 5 for name, value in ports.items()}
    slots = {row.register: row.number for row in at.ROWS if row.register and row.register not in values}
    return values | {name: int(s[slots[name]]) for name in registers() if name in slots}
