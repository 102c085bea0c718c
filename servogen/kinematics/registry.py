"""The kinds of robots, by the name that a robot file gives for `kind`: one line for each."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from servogen.kinematics.arm import ARM
from servogen.kinematics.hexapod import HEXAPOD
from servogen.kinematics.omni import OMNI
from servogen.kinematics.protocol import RobotKind

KINDS: Mapping[str, RobotKind] = MappingProxyType(
    {
        kind.name: kind
        for kind in (
            ARM,
            HEXAPOD,
            OMNI,
        )
    }
)
