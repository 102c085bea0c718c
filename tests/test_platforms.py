"""What works on Windows: commands run in a process without the modules that Windows lacks.

Such a process is Python on Linux that calls itself "nt" once its own modules are loaded; what servogen itself
asks for or imports is what it would be there. docs/platforms.md says the same.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "platforms.md").read_text("utf-8")

WINDOWS = """
import os, sys, json, pathlib, tempfile, subprocess, shutil, ctypes, asyncio, signal, selectors, runpy
import importlib.resources, importlib.metadata, concurrent.futures, multiprocessing
import numpy, pydantic, typer, rich.console, jinja2, serial.tools.list_ports, pcpp, intelhex
for name in ("fcntl", "pty", "resource", "termios", "tty", "pwd", "grp"):
    sys.modules[name] = None
for name in ("SIGHUP", "SIGKILL"):
    delattr(signal, name)
del os.fork, os.openpty, os.geteuid, os.getuid, os.killpg
pathlib.WindowsPath = pathlib.PosixPath
os.name = "nt"
from servogen.cli import main
answers = []
for line in json.loads(sys.argv[1]):
    sys.argv = ["servogen", *line]
    try:
        main()
    except SystemExit as ended:
        answers.append(ended.code or 0)
        print("ENDED", answers[-1], file=sys.stderr, flush=True)
"""


def on_windows(folder: Path, *commands: list[str], text: str = "") -> list[tuple[int, str]]:
    """Return the exit code and the messages of each command."""
    done = subprocess.run(
        [sys.executable, "-c", WINDOWS, json.dumps(commands)],
        cwd=folder,
        input=text,
        capture_output=True,
        text=True,
    )
    parts = done.stderr.split("ENDED ")
    codes = [int(part.split("\n", 1)[0]) for part in parts[1:]]
    messages = [parts[0], *(part.split("\n", 1)[1] for part in parts[1:])]
    assert len(codes) == len(commands), done.stderr
    return list(zip(codes, messages, strict=False))


JOB = str(ROOT / "jobs" / "lab8-exercise.toml")
FOLDER = ROOT / "firmware" / "lab8-exercise"


@pytest.mark.campaign
def test_what_needs_nothing_of_the_system_works(tmp_path: Path) -> None:
    commands = [
        ["check", JOB],
        ["build", JOB, "--output", "made"],
        ["compile", str(FOLDER / "main.xc8.c"), "-o", "x.hex"],
        ["disassemble", "made", "-o", "x.asm"],
        ["assemble", "x.asm", "-o", "y.hex"],
        ["simulate", "made", "--seconds", "0.1"],
        ["verify", "made", "--against", "made/schedule.json"],
        ["fk", "scara", "30", "60", "200", "0"],
        ["plan", str(ROOT / "jobs" / "hexapod-tripod.toml")],
        ["schema", "lab", "-o", "lab.schema.json"],
        ["doctor"],
    ]
    ran = on_windows(tmp_path, *commands)
    assert [(line[0], code, said) for line, (code, said) in zip(commands, ran, strict=True) if code] == []
    for name in ("main.hex", "schedule.json"):
        assert (tmp_path / "made" / name).read_bytes() == (FOLDER / name).read_bytes()
    said = dict(zip((line[0] for line in commands), (said for _, said in ran), strict=True))["compile"]
    assert "cannot limit the memory and the open files of a process" in said and "[no-limits]" in said
    row = next(line for line in PAGE.splitlines() if line.startswith("| limits of other commands"))
    assert row.split("|")[4].strip() == "none"


def test_what_windows_cannot_do_is_refused_with_a_sentence(tmp_path: Path) -> None:
    walk = str(ROOT / "jobs" / "hexapod-command.toml")
    rig, keys = on_windows(tmp_path, ["rig", JOB], ["drive", walk, "--keys"], text="forward\n")
    assert rig[0] == 3 and "needs pseudo-terminals, which this system does not have [tool-missing]" in rig[1]
    assert keys[0] == 3 and "steering needs a terminal or pipe that can be polled" in keys[1]
    for _, said in (rig, keys):
        assert "Traceback" not in said and "defect" not in said


@pytest.mark.parametrize("command", ["rig", "drive --keys"])
def test_the_page_says_what_is_refused(command: str) -> None:
    row = next(line for line in PAGE.splitlines() if line.startswith("| `") and f"`{command}`" in line)
    linux, macos, windows = (cell.strip() for cell in row.split("|")[2:5])
    assert (linux, macos, windows[:3]) == ("yes", "yes", "no:")


POSIX_ONLY = {"fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"}


def unguarded(text: str) -> list[str]:
    """Return the modules of POSIX systems that are imported at the top, whatever the system is: what stands
    below `if os.name` or `try` is indented.
    """
    return [name for name in re.findall(r"^(?:import|from) (\w+)", text, re.M) if name in POSIX_ONLY]


def test_no_module_needs_what_only_posix_systems_have() -> None:
    files = sorted((ROOT / "servogen").rglob("*.py"))
    assert len(files) > 300
    assert {str(file): names for file in files if (names := unguarded(file.read_text("utf-8")))} == {}
    assert unguarded("import os\nimport tty\nif os.name == 'posix':\n    import pty\n") == ["tty"]
