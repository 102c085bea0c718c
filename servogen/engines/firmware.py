"""`Firmware`: one dialect's C and what the compiler made of it; `ResourceError` where it does not fit."""

from __future__ import annotations

from dataclasses import dataclass, field

from servogen.compiler import Compilation, CompileError, Options, Source, compile_sources
from servogen.engines.sequence.overheads import Overheads
from servogen.engines.timing_budget import TimingBudget
from servogen.errors import Caution, InputError


class ResourceError(InputError):
    """The job's motion is more than its engine can put on the chip: planned, but not built."""


def compiled_to_fit(
    text: str, file: str, options: Options, title: str, engine: str, hint: str
) -> Compilation:
    """What the compiler makes of an engine's C. Raises ResourceError where the chip is too small for it."""
    try:
        return compile_sources([Source(text, file)], options)
    except CompileError as error:
        if not error.too_large:  # a fault of the templates
            raise
        raise ResourceError(
            "does-not-fit", f"{title}: planned, but more than {engine} can hold: {error.message}", hint=hint
        ) from error


@dataclass(frozen=True, slots=True)
class Firmware:
    """One dialect's C file and what the compiler made of it."""

    dialect: str
    file: str
    text: str
    compilation: Compilation
    rooms: tuple[TimingBudget, ...] = ()
    """What the C between the pulses takes at most, of what it has."""
    overrun: int | None = None
    """The address of the byte whose bit 0 says that it took longer, once; None: this engine has none."""
    warnings: tuple[Caution, ...] = ()
    overheads: Overheads = field(default_factory=Overheads)
    """What the sequence engine took off its delays."""
