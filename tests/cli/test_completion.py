"""Shell completion, installed by `--install-completion` and used in the shells themselves."""

from __future__ import annotations

import os
import pty
import re
import select
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

WORDS = {
    "servogen gr": ["grade"],
    "servogen check-": ["check-certificate"],
    "servogen grade --ju": ["--junit"],
    "servogen schema l": ["lab"],
    "servogen nothing-like-it": [],
}
COMPLETIONS = {line: WORDS[line] for line in ("servogen gr", "servogen schema l", "servogen nothing-like-it")}
"""What is completed in the shells whose completion is installed: servogen starts anew for each."""


def environment(home: Path) -> dict[str, str]:
    """A user's environment without settings, in which servogen is on the path."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("XDG_")}
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    return {**kept, "HOME": str(home), "PATH": path, "TERM": "xterm", "ZDOTDIR": str(home)}


class Shell:
    """An interactive shell on a pseudo-terminal."""

    def __init__(self, command: list[str], home: Path) -> None:
        self.master, slave = pty.openpty()
        self.process = subprocess.Popen(
            command,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env={**environment(home), "PS1": "$ "},
            cwd=home,
            start_new_session=True,
        )
        os.close(slave)
        self.seen = ""

    def until(self, pattern: str) -> re.Match[str]:
        """What the shell shows, up to a pattern, which is taken away."""
        end = time.monotonic() + 300
        while (found := re.search(pattern, self.seen)) is None:
            assert time.monotonic() < end, f"{pattern} did not come: {self.seen!r}"
            if select.select([self.master], (), (), 1)[0]:
                self.seen += os.read(self.master, 4096).decode(errors="replace")
        self.seen = self.seen[found.end() :]
        return found

    def type(self, text: str) -> None:
        os.write(self.master, text.encode())

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.master)


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("zsh") is None, reason="zsh is not installed")
def test_zsh_completes_after_install_completion(tmp_path: Path) -> None:
    """Typed in an interactive zsh: the tabulator completes, and the line is printed instead of run.

    The first tabulator of a shell only loads the completion, as README.md says; a line may be typed again
    while it does so.
    """
    (tmp_path / ".zshrc").write_text("PROMPT='> '\nunsetopt zle_bracketed_paste 2>/dev/null\n")
    shell = Shell(["zsh", "-i"], tmp_path)
    try:
        shell.until("> ")
        shell.type("servogen --install-completion; echo installed=$?\n")
        assert shell.until(r"installed=(\d)")[1] == "0"
    finally:
        shell.close()
    shell = Shell(["zsh", "-i"], tmp_path)
    try:
        shell.type("bindkey -s '^X' '\\C-aprint -r -- \"[\\C-e]\"\\n'; echo rea''dy\n")
        shell.until("ready\r?\n")
        shell.type("servogen \t\x15")
        for line, expected in COMPLETIONS.items():
            words = line.split()
            whole = [*words[:-1], *expected] if expected else words
            typed: list[list[str]] = []
            while whole not in typed and len(typed) < 10:
                shell.type(f"{line}\t\x18")
                typed.append(shell.until(r"\n\[(.*?)\]")[1].split())
            assert whole in typed
    finally:
        shell.close()


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("fish") is None, reason="fish is not installed")
def test_fish_completes_after_install_completion(tmp_path: Path) -> None:
    def fish(script: str) -> str:
        return subprocess.run(
            ["fish", "-c", f"{script}\n:"],  # not the last command, in whose place fish would run it
            env=environment(tmp_path),
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        ).stdout

    assert fish(f'complete -C "{next(iter(COMPLETIONS))}"') == "", "nothing is installed yet"
    fish("servogen --install-completion")
    for line, expected in COMPLETIONS.items():
        shown = fish(f'complete -C "{line}"').splitlines()
        assert [entry.split("\t")[0] for entry in shown] == expected


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_completes_commands_options_and_values(tmp_path: Path) -> None:
    """With the script that --show-completion prints, in a shell that finds servogen on its path."""
    script = 'eval "$(servogen --show-completion)"\n'
    for line in WORDS:
        script += f"COMP_WORDS=({line}); COMP_CWORD={len(line.split()) - 1}; COMPREPLY=()\n"
        script += '_servogen_completion servogen; echo "${COMPREPLY[*]}"\n'
    done = subprocess.run(
        ["bash", "--norc", "-c", script], capture_output=True, text=True, env=environment(tmp_path)
    )
    assert done.stdout.splitlines() == [" ".join(expected) for expected in WORDS.values()], done.stderr
