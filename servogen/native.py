"""Parts of servogen in C: compiled when servogen is installed, loaded by ctypes.

In: a folder of C, and the header that is made from tables in Python. Out: a shared library with a plain C
interface, which needs nothing of Python: one suits every version of it. `hatch_build.py` compiles; nothing
is compiled when a command runs. The library holds a digest of what it was made from, so that sources which
have changed since are not run as if they had not.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import runpy
import shlex
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from servogen.errors import ToolError

FLAGS = (
    "-std=c11",
    "-O3",
    "-Wall",
    "-Wextra",
    "-Werror=implicit",
    "-fvisibility=protected",
    "-fPIC",
    "-shared",
)
PARTS = ("simulator/core/__init__.py", "checker/layout.py")
"""The modules that define a part, as NATIVE."""
SMALL = 1 << 31
"""Numbers below are constants of an enum, whose type is int; larger ones are variables of 64 bits."""


@dataclass(frozen=True)
class Native:
    """A library: `NAME.c` in `folder`, which may include the headers there and `layout.h`."""

    folder: Path
    name: str
    layout: Callable[[], str]
    """Returns the text of `layout.h`."""

    @property
    def library(self) -> Path:
        """Return the path of the compiled library; without `lib` it could be a module of Python."""
        return self.folder / f"lib{self.name}.so"

    def digest(self) -> str:
        """Return a digest of everything that the library is made from."""
        digest = hashlib.sha256(repr((FLAGS, self.layout())).encode())
        for path in sorted((*self.folder.glob("*.c"), *self.folder.glob("*.h"))):
            digest.update(path.read_bytes().replace(b"\r", b""))
        return digest.hexdigest()

    def compile(self, library: Path) -> None:
        """Compile the library, with the compiler that $CC names. Raises ToolError."""
        compiler = shlex.split(os.environ.get("CC", "cc"))
        with tempfile.TemporaryDirectory(dir=library.parent, prefix=".compiling-") as name:
            made = Path(name, library.name)
            Path(name, "layout.h").write_text(self.layout(), encoding="utf-8")
            command = (*compiler, *FLAGS, f'-DDIGEST="{self.digest()}"', f"-I{name}", "-o", str(made))
            try:
                run = subprocess.run(
                    (*command, str(self.folder / f"{self.name}.c")), capture_output=True, text=True
                )
            except OSError as error:
                raise ToolError(
                    "no-compiler",
                    f"servogen needs a C compiler: {error}",
                    hint="install gcc or clang, or name one in the environment variable CC",
                ) from None
            if run.returncode:
                raise ToolError(
                    "no-compiler", f"{shlex.join(compiler)} cannot compile {self.name}.c:\n{run.stderr}"
                )
            made.replace(library)  # in one step: a process that has the old one loaded keeps it

    def refresh(self) -> None:
        """Compile the library in its folder unless that is done."""
        if not self._is_current():
            self.compile(self.library)

    def load(self) -> ctypes.CDLL:
        """Return the library. Raises ToolError if it was not made from these sources."""
        if not self._is_current():
            raise ToolError(
                "not-compiled",
                f"{self.library} was not compiled from the sources beside it",
                hint="install servogen again: `pip install -e .` in a checkout",
            )
        return ctypes.CDLL(str(self.library), winmode=0)  # the path is whole: Windows searches nowhere

    def _is_current(self) -> bool:
        try:
            return self.digest().encode() in self.library.read_bytes()
        except OSError:
            return False


def parts() -> list[Native]:
    """Return every part in C.

    Their modules are run without the packages around them, which need NumPy: an installation has only the
    standard library.
    """
    return [runpy.run_path(str(Path(__file__).parent / path))["NATIVE"] for path in PARTS]


def struct(name: str, fields: Mapping[str, int]) -> str:
    """Return the C of a struct of 64-bit integers; a field is an array if it has several."""
    members = (
        f"    i64 {field.lower()}{f'[{length}]' if length > 1 else ''};\n" for field, length in fields.items()
    )
    return f"typedef struct {{\n{''.join(members)}}} {name};\n"


def constants(numbers: Mapping[str, int]) -> str:
    """Return the C of constants."""
    small = "".join(f"    {name} = {number},\n" for name, number in numbers.items() if abs(number) < SMALL)
    large = "".join(
        f"static const i64 {name} = {number};\n" for name, number in numbers.items() if abs(number) >= SMALL
    )
    return f"enum {{\n{small}}};\n{large}"
