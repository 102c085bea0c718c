"""A rendered C file compiled, or the sentence that says that it is more than the chip holds."""

from __future__ import annotations

from servogen.compiler import Compilation, CompileError, Options, Source, compile_sources
from servogen.errors import InputError


class DoesNotFit(InputError):
    """The job's motion is more than its engine can put on the chip: planned, but not built."""


def compiled_to_fit(
    text: str, file: str, options: Options, title: str, engine: str, hint: str
) -> Compilation:
    """What the compiler makes of an engine's C. Raises DoesNotFit where the chip is too small for it."""
    try:
        return compile_sources([Source(text, file)], options)
    except CompileError as error:
        if not error.too_large:  # a fault of the templates
            raise
        raise DoesNotFit(
            f"{title}: planned, but more than {engine} can hold: {error.message}", hint=hint
        ) from error
