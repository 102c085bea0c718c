"""A pseudo-terminal that programs of libserialport open as a serial port (sigrok-cli is one).

libserialport (0.1.1, 0.1.2) opens nothing that has no link below /sys/class/tty, and nothing that answers no
TIOCMGET; a pseudo-terminal has neither. In: a C compiler. Out: a library that, loaded before the others
(LD_PRELOAD), answers both for pseudo-terminals: all modem lines are off.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from servogen.errors import ToolError

SOURCE = """\
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
    """Whether `text`, a sigrok driver with its connection, names a pseudo-terminal."""
    return TERMINAL.search(text) is not None


def compiler() -> str | None:
    """The C compiler that makes the library; None where there is none, or another system than Linux."""
    return (shutil.which("cc") or shutil.which("gcc")) if sys.platform == "linux" else None


@contextmanager
def library() -> Iterator[Path]:
    """The library, until the block ends. Raises ToolError where it cannot be made."""
    found = compiler()
    if found is None:
        raise ToolError(
            "a pseudo-terminal has no modem lines, and no C compiler is here to add them", hint="gcc"
        )
    with tempfile.TemporaryDirectory(prefix="servogen-") as folder:
        source, made = Path(folder) / "modem_lines.c", Path(folder) / "modem_lines.so"
        source.write_text(SOURCE, encoding="ascii")
        command = (found, "-shared", "-fPIC", "-O1", "-o", str(made), str(source), "-ldl")
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise ToolError("the library that adds modem lines cannot be made", hint=done.stderr.strip())
        yield made
