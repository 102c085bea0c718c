"""`servogen drive` as a process, and a robot behind a pseudo-terminal."""

import fcntl
import os
import subprocess
import sys
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from servogen.job import PlannedJob, load, plan_job
from tests.cli.conftest import Ran, Run, run
from tests.drive.mini_ssc import Decoder

__all__ = ["Ran", "Run", "run"]

ROOT = Path(__file__).parents[2]
START = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "  # ignored in a background job
    "from servogen.cli import main; main()"
)


@cache
def planned(name: str) -> PlannedJob:
    """A job of jobs/, planned once."""
    return plan_job(load(ROOT / "jobs" / f"{name}.toml"))


class Serial:
    """A Mini SSC robot behind a path that stays when the robot is unplugged and plugged in again."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "robot"
        self.decoder = Decoder()
        self.plug()

    def plug(self, taken: bool = False) -> None:
        """Plugs it in; `taken`: another program has the port, until it leaves it."""
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        if taken:
            fcntl.flock(self._slave, fcntl.LOCK_EX)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._slave))
        self._stop, self._ended = os.pipe()
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def leave(self) -> None:
        """The other program leaves the port."""
        fcntl.flock(self._slave, fcntl.LOCK_UN)

    def unplug(self) -> None:
        self.path.unlink()  # first: the terminal's number may be another test's as soon as it is closed
        os.close(self._ended)
        self._thread.join()
        for end in (self._master, self._slave, self._stop):
            os.close(end)

    def _read(self) -> None:
        import select

        while True:
            ready, _, _ = select.select([self._master, self._stop], (), ())
            if self._master in ready:
                for byte in os.read(self._master, 4096):
                    self.decoder.take(byte)
            elif self._stop in ready:
                return

    def wait_for(self, what: Callable[[Decoder], bool], seconds: float = 300.0) -> None:
        """Looks until it is so; the time only bounds a failure."""
        for _ in range(int(seconds / 0.01)):
            if what(self.decoder):
                return
            threading.Event().wait(0.01)
        raise AssertionError(self.decoder)


@pytest.fixture
def serial(tmp_path: Path) -> Iterator[Serial]:
    opened = Serial(tmp_path)
    yield opened
    if opened.path.is_symlink():
        opened.unplug()


@pytest.fixture
def start() -> Iterator[Callable[..., "subprocess.Popen[str]"]]:
    """`start("drive", …)`: the command as a process of its own; ended with the test."""
    with ExitStack() as stack:

        def command(*args: object, **options: Any) -> "subprocess.Popen[str]":
            process = subprocess.Popen(
                [sys.executable, "-c", START, *map(str, args)],
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                cwd=ROOT,
                env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"},
                **options,
            )
            stack.callback(process.communicate)
            stack.callback(process.kill)
            return process

        yield command
