"""Standard streams that are closed, full or unread, and Ctrl-C at any moment: an exit code, no traceback."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.campaigns import sampled
from tests.cli.conftest import Run

ROOT = Path(__file__).parents[2]
HEX = ROOT / "firmware" / "lab9-program" / "main.hex"
JOB = str(ROOT / "jobs" / "lab9-program.toml")
GOOD, BAD = ("simulate", str(HEX), "--cycles", "300"), ("simulate", "no such program.hex")


def shell(redirection: str, *args: str) -> subprocess.CompletedProcess[str]:
    """A command of servogen under a shell that redirects its streams."""
    command = shlex.join([sys.executable, "-m", "servogen", *args])
    line = f"{command} {redirection}; exit ${{PIPESTATUS[0]}}"
    return subprocess.run(["bash", "-c", line], capture_output=True, text=True, cwd=ROOT)


@pytest.mark.parametrize(
    ("redirection", "good", "bad"),
    sampled(
        [
            (">&-", 141, 2),
            ("2>&-", 0, 2),
            ("<&-", 0, 2),
            ("<&- >&- 2>&-", 141, 2),
            (">/dev/full", 3, 2),
            ("2>/dev/full", 0, 2),
            ("2>&1 >/dev/null | :", 0, 2),
        ],
        3,
    ),
)
def test_streams_that_cannot_be_used_give_the_documented_exit_code(
    redirection: str, good: int, bad: int
) -> None:
    for args, code in ((GOOD, good), (BAD, bad)):
        ran = shell(redirection, *args)
        assert ran.returncode == code, (args, ran)
        assert "Traceback" not in ran.stderr + ran.stdout
        assert "Exception" not in ran.stderr


def test_a_closed_input_changes_nothing_of_the_output(run: Run) -> None:
    assert shell("<&-", *GOOD).stdout == run(*GOOD).out != ""


def test_a_closed_output_is_not_the_next_file_that_is_opened(run: Run, tmp_path: Path) -> None:
    edges = tmp_path / "edges.csv"
    args = ("simulate", str(HEX), "--cycles", "30000", "--edges", str(edges))
    assert shell(">&- 2>&-", *args).returncode == 141
    assert run(*args[:-1], tmp_path / "right.csv").code == 0
    assert edges.read_bytes() == (tmp_path / "right.csv").read_bytes()


SIMULATE = ("simulate", str(HEX), "--cycles", "300", "--trace")


@pytest.mark.campaign
def test_a_trace_goes_through_a_pipe_after_what_was_printed(run: Run, tmp_path: Path) -> None:
    assert run(*SIMULATE, tmp_path / "trace.txt").code == 0
    wanted = (tmp_path / "trace.txt").read_text()
    assert wanted.count("\n") > 100
    for name in ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"):
        ran = shell("| cat", *SIMULATE, name)
        assert ran.returncode == 0, ran.stderr
        assert ran.stdout.startswith(wanted)


def test_a_trace_to_an_output_that_is_a_file_keeps_what_is_in_it(run: Run, tmp_path: Path) -> None:
    assert run(*SIMULATE, tmp_path / "trace.txt").code == 0
    both = tmp_path / "both.txt"
    both.write_text("before\n")
    ran = shell(f">> {shlex.quote(str(both))}", *SIMULATE, "/dev/stdout")
    assert ran.returncode == 0, ran.stderr
    text = both.read_text()
    assert text.startswith("before\n" + (tmp_path / "trace.txt").read_text())
    assert "300 cycles" in text


def test_a_trace_whose_reader_goes_away_ends_the_command(tmp_path: Path) -> None:
    ran = shell("| head -1", "simulate", str(HEX), "--cycles", "300000", "--trace", "/dev/stdout")
    assert (ran.returncode, ran.stderr) == (141, "")
    assert ran.stdout.count("\n") == 1


INTERRUPTS = """
import os, signal, sys
class AtImport:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
            signal.signal(signal.SIGUSR1, signal.SIG_DFL)  # a function call, in which Python sees the signal
sys.meta_path.insert(0, AtImport())
signal.signal(signal.SIGINT, signal.{handler})
sys.argv = ["servogen", *{args!r}]
from servogen.__main__ import main
main()
"""


@pytest.mark.parametrize(
    "module", sampled(["servogen.cli", "typer", "servogen.errors", "servogen.job", "numpy"], 2)
)
def test_ctrl_c_while_modules_are_imported_ends_the_process_quietly(module: str) -> None:
    code = INTERRUPTS.format(module=module, handler="default_int_handler", args=("check", JOB))
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert (ran.returncode, ran.stdout, ran.stderr) == (130, "", "")


def test_a_background_job_goes_on_ignoring_ctrl_c() -> None:
    code = INTERRUPTS.format(module="typer", handler="SIG_IGN", args=GOOD)
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert ran.returncode == 0, ran.stderr


def test_the_installed_command_is_the_one_that_handles_ctrl_c() -> None:
    scripts = (ROOT / "pyproject.toml").read_text().partition("[project.scripts]\n")[2].splitlines()
    assert scripts[0] == 'servogen = "servogen.__main__:main"'


@pytest.mark.campaign
@pytest.mark.skipif(os.geteuid() == 0 and not Path("/proc/self/fd").exists(), reason="needs /proc")
def test_names_that_are_not_utf_8_are_read_written_and_named(tmp_path: Path) -> None:
    folder = os.fsencode(tmp_path) + b"/\xff\xfe"
    Path(os.fsdecode(folder)).mkdir()
    job = folder + b"/\xe9.toml"
    Path(os.fsdecode(job)).write_text((ROOT / "jobs" / "lab9-program.toml").read_text())
    base = [sys.executable.encode(), b"-m", b"servogen"]
    ascii_only = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    for locale, builds in (({}, True), ({"LC_ALL": "C"}, False), (ascii_only, True)):
        environment = os.environ | locale
        out = folder + b"/out"
        if builds:
            built = subprocess.run([*base, b"build", job, b"-o", out], capture_output=True, env=environment)
            assert (built.returncode, built.stderr) == (0, b"")
        listed = folder + b"/a.lst"
        source = folder + b"/out/main.c2c.c"
        source = source if Path(os.fsdecode(source)).exists() else folder + b"/out/main.c"
        command = [*base, b"compile", source, b"-o", folder + b"/a.hex", b"--listing", listed]
        compiled = subprocess.run(command, capture_output=True, env=environment)
        assert compiled.returncode == 0, compiled.stderr
        missing = subprocess.run([*base, b"compile", folder + b"/\xfc"], capture_output=True, env=environment)
        assert missing.returncode == 2 and b"Traceback" not in missing.stderr
