"""The PIC16F84 C compiler: `compile_sources` compiles C in the C2C, XC8 or SDCC dialect to an image and a
listing.
"""

from servogen.compiler.diagnostics import WORDS_NEEDED
from servogen.compiler.driver import Compilation, compile_sources
from servogen.compiler.options import Options, Source

__all__ = ["WORDS_NEEDED", "Compilation", "Options", "Source", "compile_sources"]
