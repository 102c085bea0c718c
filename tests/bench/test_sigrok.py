"""`sigrok-cli` as a client of the virtual analyser, and what is said where it cannot be had."""

import shutil
import subprocess
from pathlib import Path

import pytest

from servogen.bench.sigrok import SigrokLook, command_of
from servogen.bench.virtual.analyser import VirtualAnalyser
from servogen.bench.virtual.chip import VirtualChip
from servogen.pic.image import Image
from servogen.units import Clock
from tests.bench.conftest import LAB8, Run, Serve

SCHEDULE = LAB8 / "schedule.json"

MODEM_LINES = """\
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdarg.h>
#include <sys/ioctl.h>

int ioctl(int file, unsigned long request, ...)
{
    va_list rest;
    va_start(rest, request);
    void *argument = va_arg(rest, void *);
    va_end(rest);
    int (*real)(int, unsigned long, ...) = dlsym(RTLD_NEXT, "ioctl");
    int result = real(file, request, argument);
    if (result < 0 && errno == ENOTTY && request == TIOCMGET)
        return *(int *)argument = 0;
    if (result < 0 && errno == ENOTTY && (request == TIOCMSET || request == TIOCMBIS || request == TIOCMBIC))
        return 0;
    return result;
}
"""
"""libserialport asks for modem lines, which a pseudo-terminal does not have: all are off here."""


@pytest.mark.skipif(
    not (shutil.which("sigrok-cli") and shutil.which("gcc")), reason="needs sigrok-cli and gcc"
)
def test_sigrok_cli_sees_the_same_pulses(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lines.c").write_text(MODEM_LINES)
    subprocess.run(
        ["gcc", "-shared", "-fPIC", "-o", tmp_path / "lines.so", tmp_path / "lines.c", "-ldl"], check=True
    )
    monkeypatch.setenv("LD_PRELOAD", str(tmp_path / "lines.so"))
    port = serve({"analyser": VirtualAnalyser(VirtualChip(lab8, Clock(4_000_000)))}).paths["analyser"]
    # libserialport takes only what is a link below /sys/class/tty, or is reached from there.
    (tmp_path / "port").symlink_to(port)
    driver = f"ols:conn=/dev/../../..{tmp_path / 'port'}"
    path = tmp_path / "run.sr"
    done = run(
        *("capture", "--sigrok", driver, "--wire", "0=RB0", "--seconds", 2, "-o", path),
        *("--against", SCHEDULE),
    )
    assert done.code == 0, done.err
    done = run("verify", path, "--against", SCHEDULE)
    assert done.code == 0, done.out


def test_the_command_names_the_channels_by_their_pins() -> None:
    look = SigrokLook("fx2lafw", 1_000_000, 2_000_000, (("D0", "RB0"), ("D1", "RA2")))
    assert " ".join(command_of(look, Path("run.sr"))) == (
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


@pytest.mark.parametrize("options", [(), ("--wire", "D0=RC0"), ("--wire", "=RB0")])
def test_channels_need_pins(run: Run, tmp_path: Path, options: tuple[str, ...]) -> None:
    done = run("capture", "--sigrok", "fx2lafw", *options, "-o", tmp_path / "run.sr")
    assert done.code == 2


def test_without_an_analyser_that_is_said(run: Run, tmp_path: Path) -> None:
    done = run("capture", "-o", tmp_path / "run.vcd")
    assert done.code == 2
    assert "--port" in done.err
