"""A rendered C file compiled, or the sentence that says that it is more than the chip holds."""

from __future__ import annotations

import re

from servogen.compiler import Compilation, CompileError, Options, Source, compile_sources
from servogen.errors import InputError

SHORT_OF_MEMORY = re.compile(r"the program needs \d+ .*, the chip has \d+$")
"""What the compiler says of a program that is right but too large; all else is a fault of the templates."""


class DoesNotFit(InputError):
    """The job's motion is more than its engine can put on the chip: planned, but not built."""


def compiled_to_fit(
    text: str, file: str, options: Options, title: str, engine: str, hint: str
) -> Compilation:
    """What the compiler makes of an engine's C. Raises DoesNotFit where the chip is too small for it."""
    try:
        return compile_sources([Source(text, file)], options)
    except CompileError as error:
        if not SHORT_OF_MEMORY.match(error.message):
            raise
        raise DoesNotFit(
            f"{title}: planned, but more than {engine} can hold: {error.message}", hint=hint
        ) from error
