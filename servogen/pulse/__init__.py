"""Trajectory -> `PulseSchedule` in integer cycles, its expected edges, and the checks of pulses."""

from servogen.pulse.plan import PulsePlan, plan
from servogen.pulse.quantise import Quantised
from servogen.pulse.schedule import Channel, Pulse, PulseSchedule, Run, from_json
from servogen.pulse.slots import Frame

__all__ = [
    "Channel",
    "Frame",
    "Pulse",
    "PulsePlan",
    "PulseSchedule",
    "Quantised",
    "Run",
    "from_json",
    "plan",
]
