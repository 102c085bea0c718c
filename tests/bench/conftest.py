"""The bench in this process: virtual devices on pseudo-terminals, commands run as `servogen` runs them."""

import json
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from servogen.bench.virtual.terminals import TerminalDevice, Terminals, terminals
from servogen.pic.image import Image, from_hex
from servogen.pulse import from_json
from servogen.units import Cycles
from tests.cli.conftest import Ran, Run, run  # noqa: F401 - a fixture
from tests.time_limit import time_limit

ROOT = Path(__file__).parent.parent.parent
START = "from servogen.cli import main; main()"
LAB8 = ROOT / "firmware" / "lab8-exercise"
MOST_S = 300.0
"""What a test with a chip, a programmer or an analyser may take: a broken one may not answer at all."""


@pytest.fixture(autouse=True)
def _ends() -> Iterator[None]:
    """A test and the fixtures after this one fail after MOST_S instead of waiting."""
    with time_limit(MOST_S):
        yield


Serve = Callable[[Mapping[str, TerminalDevice]], Terminals]


@pytest.fixture
def serve() -> Iterator[Serve]:
    """`serve({"analyser": device})`: the device behind a pseudo-terminal until the test ends."""
    with ExitStack() as stack:
        yield lambda devices: stack.enter_context(_served(devices))


@pytest.fixture
def lab8() -> Image:
    return image_of(LAB8 / "main.hex")


def image_of(path: Path) -> Image:
    return from_hex(path.read_text(), str(path))


def shorter_in(folder: Path, frame: int) -> str:
    """The job's schedule (JSON), but for the first servo's pulse in `frame`, which is 2 cycles shorter."""
    schedule = from_json((folder / "schedule.json").read_text(), "schedule.json")
    runs = [replace(each, frames=1) for each in schedule.loop for _ in range(each.frames)]
    inside = frame - schedule.lead_in_frames
    pulse = runs[inside].pulses[0]
    assert pulse is not None
    pulses = (replace(pulse, width=Cycles(pulse.width - 2)), *runs[inside].pulses[1:])
    runs[inside] = replace(runs[inside], pulses=pulses)
    return replace(schedule, loop=tuple(runs)).json_text()


@contextmanager
def _served(devices: Mapping[str, TerminalDevice]) -> Iterator[Terminals]:
    with terminals(devices) as opened, served(opened):
        yield opened


@contextmanager
def served(opened: Terminals) -> Iterator[None]:
    """Open terminals that are served until the block ends."""
    ended = threading.Event()
    # A daemon, so that pytest ends also where a broken device does not come back.
    thread = threading.Thread(target=opened.serve, args=(ended.is_set,), daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


class Bench:
    """A rig that runs."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        assert process.stdout is not None
        self.process = process
        self.paths: dict[str, str] = json.loads(process.stdout.readline())
        assert self.paths.pop("diagnostics") == []


@contextmanager
def running(job: str, *options: object) -> Iterator[Bench]:
    """`servogen rig` with a job of jobs/, in a process of its own."""
    path = ROOT / "jobs" / f"{job}.toml"
    command = [sys.executable, "-c", START, "rig", str(path), "--json", *map(str, options)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT
    ) as process:
        try:
            yield Bench(process)
        finally:
            process.terminate()
