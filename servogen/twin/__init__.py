"""Does the robot do it? The HEX on the simulated chip, its pulses into servos, the servos into bodies.

In: a planned job, its firmware. Out: `TwinVerdict`. MuJoCo is the extra `twin`.
"""

from servogen.twin.ground import Ground
from servogen.twin.mjcf import Variation
from servogen.twin.planned import planned_of
from servogen.twin.run import TwinSettings, simulate
from servogen.twin.verdict import TwinVerdict, verdict_of

__all__ = [
    "Ground",
    "TwinSettings",
    "TwinVerdict",
    "Variation",
    "planned_of",
    "simulate",
    "verdict_of",
]
