"""The assembler: MPASM's language for the PIC16F84 and PIC16F84A.

The names are loaded on first use: the compiler needs only a line of it, for inline assembly (`instructions`).
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from servogen.pic.assembler.assembly import Assembly, assemble, beside

__all__ = ["Assembly", "assemble", "beside"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module("servogen.pic.assembler.assembly"), name)
