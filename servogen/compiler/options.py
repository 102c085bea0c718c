"""The options of a compilation: sources, dialect, device, optimisation level."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from servogen.pic.device import Device, device

VERIFY_IR = "SERVOGEN_VERIFY_IR"
"""The environment variable that, set to 1, switches `Options.verify_ir` on: the tests set it."""


@dataclass(frozen=True, slots=True)
class Source:
    """One C file: its text and the name that messages use for it."""

    text: str
    file: str = "main.c"


LEVELS = {
    "none": "as the code generator writes it",
    "speed": "fewest cycles, then fewest words; nothing is shared that would take longer",
    "size": "fewest words: equal runs of instructions become subroutines",
}
"""Levels of optimisation."""


@dataclass(frozen=True, slots=True)
class Options:
    """How to compile. `include` maps (name, including file) to (file name, text) or None."""

    dialect: str = "c2c"
    device: Device = field(default_factory=lambda: device("PIC16F84A"))
    faster_device: Device | None = None
    """The chip to take instead where the program's clock is too fast for `device`; None keeps `device`."""
    clock_hz: int | None = None
    optimise: str = "speed"
    """One of `LEVELS`."""
    include: Callable[[str, str], tuple[str, str] | None] | None = None
    defines: Mapping[str, str] = field(default_factory=dict)
    verify_ir: bool = field(default_factory=lambda: os.environ.get(VERIFY_IR) == "1")
    """Whether the intermediate form is checked after every pass."""
    float_bits: int | None = None
    """The size of `float` and `double`: 24 or 32; None for the dialect's."""
    unwanted: frozenset[str] = frozenset()
    """The codes of warnings that are left out."""
    dump_ir: str | None = None
    """The pass after which the intermediate form is kept as text: one of `passes.manager.PASSES`."""
