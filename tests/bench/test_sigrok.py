"""`sigrok-cli` as a client of the virtual analyser, and what is said where it cannot be had."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from fractions import Fraction
from pathlib import Path

import pytest
import serial

from servogen.bench.analysers import sigrok as sigrok_module
from servogen.bench.analysers.sigrok import SigrokLook, c_compiler, capture, modem_lines_library, sigrok_args
from servogen.bench.virtual.analyser import AnalyserOptions, VirtualAnalyser
from servogen.bench.virtual.chip import VirtualChip
from servogen.errors import InputError, Location, ToolError
from servogen.pic.image import Image
from servogen.traces.captures import read_capture
from servogen.traces.channels import parse_rate
from servogen.units import Clock
from tests.bench.conftest import LAB8, Run, Serve
from tests.cli.conftest import wrong

SCHEDULE = LAB8 / "schedule.json"

sigrok = pytest.mark.skipif(
    not (shutil.which("sigrok-cli") and c_compiler()),
    reason="needs sigrok-cli and a C compiler: apt-get install sigrok-cli gcc",
)


def device(image: Image, **options: object) -> dict[str, VirtualAnalyser]:
    chip = VirtualChip(image, Clock(4_000_000), ppm=Fraction(180))
    return {"analyser": VirtualAnalyser(chip, AnalyserOptions(**options))}  # type: ignore[arg-type]


@sigrok
@pytest.mark.parametrize("rle", ["--rle", "--no-rle"])
def test_sigrok_cli_sees_the_same_pulses(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path, rle: str
) -> None:
    port = serve(device(lab8, memory=1 << 18)).paths["analyser"]
    path, seconds = tmp_path / "run.sr", 2 if rle == "--rle" else 0.08
    done = run(
        *("capture", "--sigrok", f"ols:conn={port}", "--wire", "0=RB0", "--seconds", seconds, "-o", path),
        *("--against", SCHEDULE, rle, "--json"),
    )
    assert (done.code, wrong("capture", done.out)) == (0, []), done.err
    done = run("verify", path, "--against", SCHEDULE, "--json", "--partial")
    assert done.code == 0, done.out
    if rle == "--rle":
        assert json.loads(done.out)["crystal_ppm"] == pytest.approx(180, abs=2)


@sigrok
def test_sigrok_cli_itself_finds_the_analyser_with_the_modem_lines(serve: Serve, lab8: Image) -> None:
    port = serve(device(lab8)).paths["analyser"]
    command = ("sigrok-cli", "--driver", f"ols:conn={port}", "--scan")
    with modem_lines_library() as lines:
        environment = {**os.environ, "LD_PRELOAD": str(lines)}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert "servogen virtual analyser" in done.stdout
    assert not lines.exists()


@sigrok
def test_what_was_sent_before_does_not_disturb_sigrok(serve: Serve, lab8: Image) -> None:
    """Garbage from another program has armed the analyser; nobody reads what it sends."""
    terminals = serve(device(lab8))
    with serial.Serial(terminals.paths["analyser"]) as port:
        port.write(b"\x01")
        while not port.in_waiting:
            pass
    command = ("sigrok-cli", "--driver", f"ols:conn={terminals.paths['analyser']}", "--scan")
    with modem_lines_library() as lines:
        environment = {**os.environ, "LD_PRELOAD": str(lines)}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert "servogen virtual analyser" in done.stdout


@sigrok
def test_a_silent_analyser_is_an_error_of_sigrok_too(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path
) -> None:
    port = serve(device(lab8, silent=True)).paths["analyser"]
    done = run("capture", "--sigrok", f"ols:conn={port}", "--wire", "0=RB0", "-o", tmp_path / "run.sr")
    assert done.code == 3
    assert f"sigrok-cli captured nothing with 'ols:conn={port}'" in done.err
    assert not (tmp_path / "run.sr").exists()


def test_without_a_compiler_a_pseudo_terminal_is_refused_with_the_reason(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cli = tmp_path / "sigrok-cli"
    cli.write_text("")
    cli.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    done = run("capture", "--sigrok", "ols:conn=/dev/pts/3", "--wire", "0=RB0", "-o", tmp_path / "run.sr")
    assert done.code == 3
    assert "a pseudo-terminal has no modem lines" in done.err


def tool(folder: Path, name: str, script: str, interpreter: str = "/bin/sh") -> None:
    """Write a stand-in for a tool."""
    path = folder / name
    path.write_text(f"#!{interpreter}\n{script}\n")
    path.chmod(0o755)


ASKS = """\
import array, fcntl, os, sys, termios
assert os.readlink("/sys/class/tty/pts/0") == "../../devices/virtual/tty/pts"
master, slave = os.openpty()
lines = array.array("i", [termios.TIOCM_CTS])
fcntl.ioctl(slave, termios.TIOCMGET, lines)
assert list(lines) == [0]
fcntl.ioctl(slave, termios.TIOCMSET, lines)
open(sys.argv[-1], "w").close()
"""
"""What libserialport does with a pseudo-terminal, in the place of sigrok-cli."""


@pytest.mark.skipif(c_compiler() is None, reason="needs a C compiler: apt-get install gcc")
def test_on_a_pseudo_terminal_sigrok_cli_finds_a_link_and_modem_lines_that_are_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On any other port there is no library, and Linux refuses what the stand-in asks."""
    tool(tmp_path, "sigrok-cli", ASKS, sys.executable)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    channels = (("0", "RB0"),)
    capture(SigrokLook("ols:conn=/dev/pts/7", 1000, 1, channels), tmp_path / "run.sr")
    assert (tmp_path / "run.sr").exists()
    with pytest.raises(ToolError, match="captured nothing with 'ols:conn=/dev/ttyACM0'"):
        capture(SigrokLook("ols:conn=/dev/ttyACM0", 1000, 1, channels), tmp_path / "run.sr")
    assert not (tmp_path / "run.sr").exists()


def test_a_compiler_that_fails_says_why_before_sigrok_cli_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tool(tmp_path, "sigrok-cli", ": > run")
    tool(tmp_path, "cc", "echo 'dlfcn.h: no such file' >&2; exit 1")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ToolError, match="the library that adds modem lines cannot be compiled") as refused:
        capture(SigrokLook("ols:conn=/dev/pts/7", 1000, 1, (("0", "RB0"),)), tmp_path / "run.sr")
    assert (refused.value.code, refused.value.first.hint) == ("tool-failed", "dlfcn.h: no such file")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("begun", ['for last; do :; done; : > "$last"', ":"])
def test_sigrok_cli_that_does_not_end_is_ended_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, begun: str
) -> None:
    """A sample at 1 kHz takes 1 ms: it has twice that, and the slack, here of 0.1 s."""
    tool(tmp_path, "sigrok-cli", f"{begun}; exec sleep 60")
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(sigrok_module, "SLACK_S", 0.1)
    with pytest.raises(ToolError, match=r"sigrok-cli did not end within 0\.102 s") as refused:
        capture(SigrokLook("fx2lafw", 1000, 1, (("D0", "RB0"),)), tmp_path / "run.sr")
    assert refused.value.code == "tool-failed"
    assert not (tmp_path / "run.sr").exists()


def test_a_session_has_its_own_suffix_in_whatever_capitals(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tool(tmp_path, "sigrok-cli", 'for last; do :; done; : > "$last"')
    monkeypatch.setenv("PATH", str(tmp_path))
    look = SigrokLook("fx2lafw", 1000, 1, (("D0", "RB0"),))
    capture(look, tmp_path / "run.SR")
    path = tmp_path / "run.vcd"
    with pytest.raises(InputError, match=r"'\.vcd' is not the suffix of a sigrok session") as refused:
        capture(look, path)
    told = refused.value.first
    assert (told.code, told.location, told.hint) == ("unknown-suffix", Location(str(path)), ".sr")
    assert not path.exists()


def test_the_command_names_the_channels_by_their_pins() -> None:
    look = SigrokLook("fx2lafw", 1_000_000, 2_000_000, (("D0", "RB0"), ("D1", "RA2")))
    assert " ".join(sigrok_args(look, Path("run.sr"))) == (
        "sigrok-cli -d fx2lafw --config samplerate=1000000 --channels D0=RB0,D1=RA2 "
        "--samples 2000000 -o run.sr"
    )


def test_without_sigrok_cli_that_is_said(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    done = run("capture", "--sigrok", "fx2lafw", "--wire", "D0=RB0", "-o", tmp_path / "run.sr")
    assert done.code == 3
    assert "sigrok-cli is not installed" in done.err


def test_a_device_that_sigrok_does_not_find_leaves_no_file(run: Run, tmp_path: Path) -> None:
    if not shutil.which("sigrok-cli"):
        pytest.skip("needs sigrok-cli")
    done = run("capture", "--sigrok", "ols:conn=/dev/none", "--wire", "0=RB0", "-o", tmp_path / "run.sr")
    assert done.code == 3
    assert "captured nothing" in done.err
    assert not (tmp_path / "run.sr").exists()


def test_the_hint_is_what_sigrok_cli_said_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last three lines of standard error, or of standard output where there is nothing else."""
    cli = tmp_path / "sigrok-cli"
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    look = SigrokLook("fx2lafw", 1_000_000, 1, (("D0", "RB0"),))
    for script, hint in (
        ("echo busy >&2; exit 1", "busy"),
        ("echo busy; exit 1", "busy"),
        (
            "echo out; echo one >&2; echo two >&2; echo three >&2; echo four >&2; exit 1",
            "two\n  three\n  four",
        ),
        ("exit 0", None),
    ):
        cli.write_text(f"#!/bin/sh\n{script}\n")
        cli.chmod(0o755)
        with pytest.raises(ToolError, match="sigrok-cli captured nothing with 'fx2lafw'") as refused:
            capture(look, tmp_path / "run.sr")
        assert refused.value.diagnostics[0].hint == hint, script


@pytest.mark.parametrize("options", [(), ("--wire", "D0=RC0"), ("--wire", "=RB0")])
def test_channels_need_pins(run: Run, tmp_path: Path, options: tuple[str, ...]) -> None:
    done = run("capture", "--sigrok", "fx2lafw", *options, "-o", tmp_path / "run.sr")
    assert done.code == 2


def test_without_an_analyser_that_is_said(run: Run, tmp_path: Path) -> None:
    done = run("capture", "-o", tmp_path / "run.vcd")
    assert done.code == 2
    assert "--port" in done.err


FAKE = """#!/bin/sh
printf '%s\\n' "$@" > {log}
while [ "$1" != -o ]; do
  case "$1" in
    samplerate=*) rate=${{1#samplerate=}};;
    --samples) samples=$2;;
  esac
  shift
done
exec {python} {writer} "$2" "$rate" "$samples" {memory}
"""

WRITER = """import sys, zipfile
output, rate, samples, memory = sys.argv[1], sys.argv[2], *map(int, sys.argv[3:])
with zipfile.ZipFile(output, "w", zipfile.ZIP_DEFLATED) as archive:
    text = f"[device 1]\\nsamplerate={rate} Hz\\nunitsize=1\\nprobe1=RB0\\n"
    archive.writestr("metadata", text)
    archive.writestr("logic-1-1", bytes(min(samples, memory)))
"""


def fake_sigrok(folder: Path, monkeypatch: pytest.MonkeyPatch, memory: int = 10**9) -> Path:
    """Put a sigrok-cli first in PATH that records zeros, up to `memory` samples; return its log."""
    cli, log, writer = folder / "sigrok-cli", folder / "log", folder / "writer.py"
    writer.write_text(WRITER)
    cli.write_text(FAKE.format(log=log, python=sys.executable, writer=writer, memory=memory))
    cli.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")
    return log


def samples_asked(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *options: object) -> int:
    """How many samples `servogen capture --sigrok` asks sigrok-cli for."""
    log = fake_sigrok(tmp_path, monkeypatch)
    path = tmp_path / "run.sr"
    done = run("capture", "--sigrok", "fx2lafw", "--wire", "D0=RB0", "-o", path, *options)
    assert done.code == 0, done.err
    words = log.read_text().split("\n")
    return int(words[words.index("--samples") + 1])


@pytest.mark.parametrize(("folder", "seconds"), [("lab8-exercise", 10), ("hexapod-turn", 17.38)])
def test_the_length_is_the_schedules(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, seconds: float
) -> None:
    """Lead-in and loop, wherever in the loop it begins, and of a crystal that is 300 ppm slow, too."""
    against = LAB8.parent / folder / "schedule.json"
    asked = samples_asked(run, tmp_path, monkeypatch, "--against", against)
    assert asked >= (seconds * 1.0003 + 0.02) * 1_000_000
    assert asked < (seconds * 1.002 + 0.05) * 1_000_000
    short = samples_asked(run, tmp_path, monkeypatch, "--against", against, "--seconds", 0.5)
    assert 500_000 <= short < 560_000
    assert 1_000_000 <= samples_asked(run, tmp_path, monkeypatch) < 1_060_000


@pytest.mark.parametrize(
    ("memory", "options", "rate", "seconds", "warned"),
    [
        (6_000_000, (), 500_000, 10.05, False),  # 10.05 s at 1 MHz do not fit, at 500 kHz they do
        (1_560_000, (), 100_000, 10.05, False),
        (1_560_000, ("--rate", 1_000_000), 1_000_000, 1.56, True),
        (900_000, (), 1_000_000, 0.9, True),  # not even at 100 kHz, the slowest that shows anything
    ],
)
def test_what_came_back_is_counted_and_the_rate_is_one_at_which_it_fits(
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    memory: int,
    options: tuple[object, ...],
    rate: int,
    seconds: float,
    warned: bool,
) -> None:
    fake_sigrok(tmp_path, monkeypatch, memory)
    done = run(
        *("capture", "--sigrok", "fx2lafw", "--wire", "D0=RB0", "--against", SCHEDULE),
        *("-o", tmp_path / "run.sr", "--json", *options),
    )
    assert done.code == 0
    found = json.loads(done.out)
    assert (found["samples_per_second"], found["wanted_seconds"]) == (rate, 10)
    assert found["seconds"] == pytest.approx(seconds, rel=1e-3)
    assert ("[short-capture]" in done.err) == warned
    if warned:
        assert f"fx2lafw returned {memory} of 100" in done.err


@pytest.mark.parametrize("how", [("--sigrok", "fx2lafw", "--wire", "D0=RB0"), ("--port", "/dev/none")])
def test_a_rate_that_would_prove_nothing_is_refused_before_anything_is_looked_at(
    run: Run, tmp_path: Path, how: tuple[str, ...]
) -> None:
    done = run("capture", *how, "--rate", 50_000, "--against", SCHEDULE, "-o", tmp_path / "run.sr")
    assert done.code == 2
    assert "--rate: sampled every 20 µs (50 kHz), too slow to show anything: at least 100 kHz" in done.err


@pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="needs sigrok-cli")
@pytest.mark.parametrize("rate", ["1000 KHz", "1000000", "1 M", "1.5 MHz", "0,1 MHz", "1e6", "1 M Hz"])
def test_a_session_is_read_or_refused_as_sigrok_cli_does(tmp_path: Path, rate: str) -> None:
    with zipfile.ZipFile(path := tmp_path / "a.sr", "w") as archive:
        archive.writestr("version", "2")
        text = f"[device 1]\ncapturefile=logic-1\ntotal probes=8\nsamplerate={rate}\nprobe1=RB0\nunitsize=1\n"
        archive.writestr("metadata", f"[global]\nsigrok version=0.5.2\n\n{text}")
        archive.writestr("logic-1-1", bytes([0, 1] * 20))
    command = ["sigrok-cli", "-i", str(path), "-O", "csv"]
    shown = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    line = next((line for line in shown.stdout.splitlines() if "Samplerate: " in line), None)
    if line is None:
        with pytest.raises(InputError, match="is not understood"):
            read_capture(path)
    else:
        hertz = parse_rate(line.partition("Samplerate: ")[2], Location("sigrok-cli"))
        assert read_capture(path).trace.clock.cycles_per_second == hertz
