"""servogen: from a robot's job file to a PIC16F84 HEX whose every servo pulse edge is exact.

`load`, `build`, `simulate` and `plot` are here for notebooks and short scripts; the packages hold everything
else. They are imported when they are first used, so that `import servogen` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from servogen.build.notebook import build as build
    from servogen.build.notebook import load as load
    from servogen.build.notebook import plot as plot
    from servogen.build.notebook import simulate as simulate

__version__ = "0.1.0"

INTERRUPTED = 130
"""The exit code after Ctrl-C; it is defined here so that it is known before anything else is imported."""

FUNCTIONS = ("load", "build", "simulate", "plot")


def __getattr__(name: str) -> Any:
    """Return one of the functions; `build` is the package of that name, which is called like a function."""
    if name not in FUNCTIONS:
        raise AttributeError(f"module 'servogen' has no attribute '{name}'")
    if name == "build":
        return import_module("servogen.build")
    return getattr(import_module("servogen.build.notebook"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *FUNCTIONS})
