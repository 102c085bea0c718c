"""A cycle-accurate PIC16F84 and PIC16F84A: `Image` (and stimulus) in, `EdgeTrace` and `State` out.

The names are loaded when they are first used: the instruction loop needs numba, which takes its time to import.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from servogen.simulator.machine import Machine, Stimulus
    from servogen.simulator.options import Options
    from servogen.simulator.run import Simulation, simulate
    from servogen.simulator.state import State, Warning

__all__ = ["Machine", "Options", "Simulation", "State", "Stimulus", "Warning", "simulate"]

_HOMES = {
    "Machine": "machine",
    "Options": "options",
    "Simulation": "run",
    "State": "state",
    "Stimulus": "machine",
    "Warning": "state",
    "simulate": "run",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
