"""A cycle-accurate PIC16F84 and PIC16F84A: `Image` (and stimulus) in, `EdgeTrace` and `MachineState` out.

The names are loaded on first use, because the machine needs NumPy, which takes a tenth of a second to import.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from servogen.simulator.devices import OnPins, PinDevice, on_pins
    from servogen.simulator.eeprom24 import EEPROM24
    from servogen.simulator.machine import Machine, Observation, Snapshot, Stimulus
    from servogen.simulator.observe import Profile, Spent, TraceRow, profile, trace
    from servogen.simulator.options import SimulatorOptions
    from servogen.simulator.paired import FirstChip, PairedMachine
    from servogen.simulator.recurrence import NoRepeat, Repeat, find_repeat
    from servogen.simulator.run import Simulation, simulate
    from servogen.simulator.servo_model import ServoLoad, ServoPosition
    from servogen.simulator.sources import BouncingButton, LevelChange, Levels, Periodic, Reset, Serial
    from servogen.simulator.state import MachineState
    from servogen.simulator.stimulus import Recorded, Stimuli, Wired, record
    from servogen.simulator.stimulus_file import load_stimuli, parse_stimuli
    from servogen.simulator.warnings import CHIP_DEPENDENT

_HOMES = {
    "devices": ("OnPins", "PinDevice", "on_pins"),
    "eeprom24": ("EEPROM24",),
    "recurrence": ("NoRepeat", "Repeat", "find_repeat"),
    "machine": ("Machine", "Observation", "Snapshot", "Stimulus"),
    "options": ("SimulatorOptions",),
    "paired": ("FirstChip", "PairedMachine"),
    "observe": ("Profile", "Spent", "TraceRow", "profile", "trace"),
    "run": ("Simulation", "simulate"),
    "servo_model": ("ServoPosition", "ServoLoad"),
    "sources": ("BouncingButton", "LevelChange", "Levels", "Periodic", "Reset", "Serial"),
    "state": ("MachineState",),
    "stimulus": ("Recorded", "Stimuli", "Wired", "record"),
    "stimulus_file": ("load_stimuli", "parse_stimuli"),
    "warnings": ("CHIP_DEPENDENT",),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "CHIP_DEPENDENT",
    "EEPROM24",
    "BouncingButton",
    "FirstChip",
    "LevelChange",
    "Levels",
    "Machine",
    "MachineState",
    "NoRepeat",
    "Observation",
    "OnPins",
    "PairedMachine",
    "Periodic",
    "PinDevice",
    "Profile",
    "Recorded",
    "Repeat",
    "Reset",
    "Serial",
    "ServoLoad",
    "ServoPosition",
    "Simulation",
    "SimulatorOptions",
    "Snapshot",
    "Spent",
    "Stimuli",
    "Stimulus",
    "TraceRow",
    "Wired",
    "find_repeat",
    "load_stimuli",
    "on_pins",
    "parse_stimuli",
    "profile",
    "record",
    "simulate",
    "trace",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
