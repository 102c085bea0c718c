"""Does the robot do it? The HEX on the simulated chip, its pulses into servos, the servos into bodies.

In: a planned job, its firmware. Out: `Verdict`. MuJoCo is the extra `twin`.
"""

from servogen.twin.bodies import Bodies, bodies
from servogen.twin.ground import Ground
from servogen.twin.mjcf import Variation
from servogen.twin.planned import planned_of
from servogen.twin.run import Record, Settings, simulate
from servogen.twin.verdict import Verdict, verdict_of

__all__ = [
    "Bodies",
    "Ground",
    "Record",
    "Settings",
    "Variation",
    "Verdict",
    "bodies",
    "planned_of",
    "simulate",
    "verdict_of",
]
