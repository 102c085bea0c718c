"""Compiles the C of an engine, and says why the chip is too small for it."""

from __future__ import annotations

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.engines.firmware import ResourceError
from servogen.errors import InputError

TOO_LARGE = "program-too-large"
"""The compiler's code for a program that the chip cannot hold."""


def compiled_to_fit(
    text: str, file: str, options: Options, title: str, engine: str, hint: str
) -> Compilation:
    """Return the compiled C of an engine. Raises ResourceError if the chip is too small for it."""
    try:
        return compile_sources([Source(text, file)], options)
    except InputError as error:
        if error.code != TOO_LARGE:  # a defect of the templates
            raise
        refusal = ResourceError(
            "does-not-fit", f"{title}: planned, but more than {engine} can hold: {error.message}", hint=hint
        )
        refusal.details = error.details
        raise refusal from error
