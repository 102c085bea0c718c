"""`servogen compile --dump ir[:PASS]` and `--verify-ir`."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

SOURCE = "void main(void) { unsigned char n; TRISB = 0; for (n = 8; n; n--) PORTB = n; }\n"


def run(tmp_path: Path, *options: str, source: str = SOURCE) -> subprocess.CompletedProcess[str]:
    (tmp_path / "main.c").write_text(source)
    command = [sys.executable, "-m", "servogen", "compile", "main.c", "--dialect", "xc8", *options]
    return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)


def test_the_last_pass_is_shown_without_a_name(tmp_path: Path) -> None:
    done = run(tmp_path, "--dump", "ir", "--verify-ir")
    assert done.returncode == 0
    assert "main:" in done.stdout
    assert "DECFSZ" in done.stdout
    assert re.search(r"^; [\w-]+ saved \d words?$", done.stdout, re.M)


def test_one_word_is_one_word(tmp_path: Path) -> None:
    """`return 3` is MOVLW 3 and RETURN, which the peephole pass makes one RETLW."""
    source = "unsigned char f(void) { return 3; }\nvoid main(void) { PORTB = f(); }\n"
    assert "; peephole saved 1 word\n" in run(tmp_path, "--dump", "ir", source=source).stdout


def test_each_pass_shows_its_own_work(tmp_path: Path) -> None:
    """The loop counts down with DECF and a test until branches are simplified."""
    assert "DECFSZ" not in run(tmp_path, "--dump", "ir:codegen").stdout
    assert "DECFSZ" in run(tmp_path, "--dump", "ir:branch-simplify").stdout


def test_json_holds_the_text_and_what_each_pass_saved(tmp_path: Path) -> None:
    found = json.loads(run(tmp_path, "--dump", "ir:delays", "--json").stdout)
    assert "or skip to" in found["ir"]
    assert sum(found["saved_by_pass"].values()) > 0


def test_an_unknown_pass_or_form_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    done = run(tmp_path, "--dump", "ir:peepholes")
    assert done.returncode == 2
    assert "did you mean 'peephole'?" in done.stderr
    done = run(tmp_path, "--dump", "ast")
    assert done.returncode == 2
    assert "peephole" in done.stderr
    assert not (tmp_path / "main.hex").exists()
