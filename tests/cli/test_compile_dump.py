"""`servogen compile --dump ir[:PASS]` and `--verify-ir`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.conftest import Ran, Run

SOURCE = "void main(void) { unsigned char n; TRISB = 0; for (n = 8; n; n--) PORTB = n; }\n"

Dump = Callable[..., Ran]


@pytest.fixture
def dump(run: Run, tmp_path: Path) -> Dump:
    """`dump("ir", ...)`: what `compile --dump ir ...` says of a program."""

    def compiled(form: str, *options: str, source: str = SOURCE) -> Ran:
        (tmp_path / "main.c").write_text(source)
        return run("compile", tmp_path / "main.c", "--dialect", "xc8", "--dump", form, *options)

    return compiled


def test_the_last_pass_is_shown_without_a_name(dump: Dump) -> None:
    done = dump("ir", "--verify-ir")
    assert done.code == 0
    assert "main:" in done.out
    assert "DECFSZ" in done.out
    assert re.search(r"^; [\w-]+ saved \d words?$", done.out, re.M)


def test_one_word_is_one_word(dump: Dump) -> None:
    """`return 3` is MOVLW 3 and RETURN, which the peephole pass makes one RETLW."""
    source = "unsigned char f(void) { return 3; }\nvoid main(void) { PORTB = f(); }\n"
    assert "; peephole saved 1 word\n" in dump("ir", source=source).out


def test_each_pass_shows_its_own_work(dump: Dump) -> None:
    """The loop counts down with DECF and a test until branches are simplified."""
    assert "DECFSZ" not in dump("ir:codegen").out
    assert "DECFSZ" in dump("ir:branch-simplify").out


def test_json_holds_the_text_and_what_each_pass_saved(dump: Dump) -> None:
    found = json.loads(dump("ir:delays", "--json").out)
    assert "or skip to" in found["ir"]
    assert sum(found["saved_by_pass"].values()) > 0


def test_an_unknown_pass_or_form_is_refused_with_the_known_ones(dump: Dump, tmp_path: Path) -> None:
    done = dump("ir:peepholes")
    assert done.code == 2
    assert "did you mean 'peephole'?" in done.err
    done = dump("ast")
    assert done.code == 2
    assert "peephole" in done.err
    assert not (tmp_path / "main.hex").exists()
