"""A capture by any analyser that sigrok knows, through `sigrok-cli`.

In: sigrok's driver and its channels' pins. Out: a sigrok session (.sr), whose channels are named by the
pins.

libserialport, with which sigrok opens serial ports (0.1.1, 0.1.2), opens nothing that has no link below
/sys/class/tty, and nothing that answers no TIOCMGET; a pseudo-terminal, such as the virtual bench's, has
neither. There, `sigrok-cli` is run with a small C library loaded before the others (LD_PRELOAD), which
answers both: all modem lines are off.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from servogen.errors import InputError, Location, ToolError
from servogen.traces.channels import parse_wires

PROGRAM = "sigrok-cli"
SUFFIX = ".sr"
SLACK_S = 30.0
"""The time in seconds that sigrok-cli has beside the capture itself: to find the analyser, and to write."""


MODEM_LINES_SOURCE = """\
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

static const char CLASS[] = "/sys/class/tty/pts/", TARGET[] = "../../devices/virtual/tty/pts";

static int is_terminal(const char *path, struct stat *found)
{
    if (strncmp(path, CLASS, sizeof CLASS - 1))
        return 0;
    if (found) {
        memset(found, 0, sizeof *found);
        found->st_mode = S_IFLNK | 0777;
    }
    return 1;
}

int lstat(const char *path, struct stat *found)
{
    int (*real)(const char *, struct stat *) = dlsym(RTLD_NEXT, "lstat");
    return is_terminal(path, found) ? 0 : real(path, found);
}

int __lxstat(int version, const char *path, struct stat *found)
{
    int (*real)(int, const char *, struct stat *) = dlsym(RTLD_NEXT, "__lxstat");
    return is_terminal(path, found) ? 0 : real(version, path, found);
}

ssize_t readlink(const char *path, char *target, size_t size)
{
    ssize_t (*real)(const char *, char *, size_t) = dlsym(RTLD_NEXT, "readlink");
    if (!is_terminal(path, 0))
        return real(path, target, size);
    size = size < sizeof TARGET - 1 ? size : sizeof TARGET - 1;
    memcpy(target, TARGET, size);
    return size;
}

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

TERMINAL = re.compile(r"/dev/pts/\d+")


def is_terminal(text: str) -> bool:
    """Return whether `text`, a sigrok driver with its connection, names a pseudo-terminal."""
    return TERMINAL.search(text) is not None


def c_compiler() -> str | None:
    """Return the C compiler that builds the library; None if there is none, or the system is not Linux."""
    return (shutil.which("cc") or shutil.which("gcc")) if sys.platform == "linux" else None


@contextmanager
def modem_lines_library() -> Iterator[Path]:
    """Yield the library, which exists until the block ends. Raises ToolError if it cannot be built."""
    compiler = c_compiler()
    if compiler is None:
        raise ToolError(
            "tool-missing",
            "a pseudo-terminal has no modem lines, and no C compiler is installed to add them",
            hint="install gcc",
        )
    with tempfile.TemporaryDirectory(prefix="servogen-") as folder:
        source, built = Path(folder) / "modem_lines.c", Path(folder) / "modem_lines.so"
        source.write_text(MODEM_LINES_SOURCE, encoding="ascii")
        command = (compiler, "-shared", "-fPIC", "-O1", "-o", str(built), str(source), "-ldl")
        completed = subprocess.run(command, capture_output=True, text=True, check=False)
        if completed.returncode != 0:
            raise ToolError(
                "tool-failed",
                "the library that adds modem lines cannot be compiled",
                hint=completed.stderr.strip(),
            )
        yield built


@dataclass(frozen=True, slots=True)
class SigrokLook:
    """`driver` as for sigrok-cli's -d; `wires` as in ("D0", "RB0")."""

    driver: str
    rate: int
    samples: int
    wires: tuple[tuple[str, str], ...]
    rle: bool = False


def sigrok_wires(texts: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Return channels and pins from texts such as `D0=RB0`. Raises InputError."""
    wired = parse_wires(texts)
    if not wired:
        raise InputError(
            "bad-wiring",
            "sigrok's channels are not assigned to pins",
            hint="assign them, such as --wire D0=RB0",
        )
    return tuple(wired.items())


def sigrok_args(look: SigrokLook, output: Path) -> tuple[str, ...]:
    """Return the command to run."""
    config = f"samplerate={look.rate}" + (":rle=on" if look.rle else "")
    channels = ",".join(f"{channel}={pin}" for channel, pin in look.wires)
    return (
        *(PROGRAM, "-d", look.driver, "--config", config, "--channels", channels),
        *("--samples", str(look.samples), "-o", str(output)),
    )


def capture(look: SigrokLook, output: Path) -> None:
    """Write the session. Raises ToolError."""
    if output.suffix.lower() != SUFFIX:
        raise InputError(
            "unknown-suffix",
            f"'{output.suffix}' is not the suffix of a sigrok session",
            Location(str(output)),
            SUFFIX,
        )
    if shutil.which(PROGRAM) is None:
        raise ToolError(
            "tool-missing", f"{PROGRAM} is not installed", hint="https://sigrok.org/wiki/Sigrok-cli"
        )
    output.unlink(missing_ok=True)
    if is_terminal(look.driver):
        with modem_lines_library() as lines:
            _captured(look, output, {**os.environ, "LD_PRELOAD": str(lines)})
    else:
        _captured(look, output, dict(os.environ))


def _captured(look: SigrokLook, output: Path, environment: Mapping[str, str]) -> None:
    seconds = look.samples / look.rate
    try:
        completed = subprocess.run(
            sigrok_args(look, output),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=2 * seconds + SLACK_S,
            check=False,
            env=environment,
        )
    except subprocess.TimeoutExpired as error:
        output.unlink(missing_ok=True)
        raise ToolError("tool-failed", f"{PROGRAM} did not end within {error.timeout:g} s") from None
    output_text = "\n  ".join((completed.stderr or completed.stdout).strip().splitlines()[-3:])
    if completed.returncode != 0 or not output.exists():
        output.unlink(missing_ok=True)
        raise ToolError(
            "capture-failed", f"{PROGRAM} captured nothing with '{look.driver}'", hint=output_text or None
        )
