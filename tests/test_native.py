"""The parts in C: a library is made from sources and tables, and not run if these have changed since."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from servogen.errors import ToolError
from servogen.native import Native, constants, struct

HEADER = (
    "typedef long long i64;\n" + constants({"SMALL": 5, "LARGE": 1 << 40}) + struct("Pair", {"A": 1, "B": 2})
)
SOURCE = """
#include "layout.h"
const char sources[] = DIGEST;
i64 sum(Pair *p) { return p->a + p->b[0] + p->b[1] + SMALL + LARGE; }
"""


@pytest.fixture
def native(tmp_path: Path) -> Native:
    (tmp_path / "toy.c").write_text(SOURCE)
    return Native(tmp_path, "toy", lambda: HEADER)


def test_a_library_has_the_struct_and_the_constants_of_its_header(native: Native) -> None:
    import ctypes

    native.refresh()
    library = native.load()
    library.sum.restype = ctypes.c_longlong
    assert library.sum((ctypes.c_longlong * 3)(1, 20, 300)) == 321 + 5 + (1 << 40)


@pytest.mark.parametrize("change", ["source", "header file", "table"])
def test_a_library_of_other_sources_is_refused_until_it_is_compiled_again(
    native: Native, change: str
) -> None:
    native.refresh()
    if change == "source":
        (native.folder / "toy.c").write_text(SOURCE.replace("SMALL +", "SMALL -"))
    elif change == "header file":
        (native.folder / "more.h").write_text("/* nothing */")
    else:
        native = Native(native.folder, "toy", lambda: HEADER.replace("5", "6"))
    with pytest.raises(ToolError, match="not compiled from the sources") as caught:
        native.load()
    assert caught.value.code == "not-compiled"
    native.refresh()
    native.load()


def test_a_library_that_is_missing_is_refused(native: Native) -> None:
    with pytest.raises(ToolError, match="not compiled from the sources"):
        native.load()


def test_what_is_current_is_not_compiled_again(native: Native, monkeypatch: pytest.MonkeyPatch) -> None:
    native.refresh()
    monkeypatch.setenv("CC", "no-such-compiler")
    native.refresh()


@pytest.mark.parametrize("compiler", ["no-such-compiler", f"{sys.executable} -c 'import sys; sys.exit(1)'"])
def test_an_installation_without_a_compiler_says_so(
    native: Native, monkeypatch: pytest.MonkeyPatch, compiler: str
) -> None:
    monkeypatch.setenv("CC", compiler)
    with pytest.raises(ToolError, match="compile") as caught:
        native.refresh()
    assert caught.value.code == "no-compiler"
    assert sorted(path.name for path in native.folder.iterdir()) == ["toy.c"]


def test_the_headers_are_made_without_any_library_of_python() -> None:
    """An installation makes them in an environment that has the build back end and nothing else."""
    code = "from servogen.native import parts; print(*(part.digest() for part in parts()))"
    root = Path(__file__).parent.parent
    subprocess.run([sys.executable, "-S", "-c", code], cwd=root, check=True)
