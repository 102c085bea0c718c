"""`servogen rig`: a process of its own, and the other commands as its clients."""

import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from servogen.bench.virtual.rig import RigOptions, with_fault
from servogen.errors import InputError, ToolError
from servogen.simulator.sources import pin_number
from tests.bench.conftest import LAB8, ROOT, Bench, Run, running
from tests.campaigns import sampled
from tests.cli.stand_ins import stand_in

JOB = ROOT / "jobs" / "lab8-exercise.toml"
SCHEDULE = LAB8 / "schedule.json"

Rig = Callable[..., "Bench"]


@pytest.fixture
def bench() -> Iterator[Rig]:
    with ExitStack() as stack:
        yield lambda *options: stack.enter_context(running(JOB.stem, *options))


def judged(run: Run, port: str, path: Path) -> dict[str, object]:
    done = run("capture", "--port", port, "-o", path, "--against", SCHEDULE)
    assert done.code == 0, done.err
    verdict: dict[str, object] = json.loads(run("verify", path, "--against", SCHEDULE, "--json").out)
    return verdict


def test_it_says_in_one_line_where_its_ports_are_and_starts_with_the_job(
    run: Run, bench: Rig, tmp_path: Path
) -> None:
    opened = bench("--crystal-ppm", 180)
    assert set(opened.paths) == {"programmer", "analyser", "inputs", "serial"}
    verdict = judged(run, opened.paths["analyser"], tmp_path / "run.vcd")
    assert verdict["agrees"]
    assert verdict["crystal_ppm"] == pytest.approx(180, abs=2)


def test_the_board_leaves_the_serial_lines_pin_alone(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """The schedule of this job says that RA4, on which it listens, rests at 1: the line is what holds it."""
    held = []

    def opened(
        image: object,
        clock: object,
        board: object,
        options: RigOptions,
        levels: object,
        second: object,
        debugger: object,
    ) -> None:
        held.append((options.serial_pin, levels))
        raise ToolError("stopped", "this is enough")

    stand_in(monkeypatch, "servogen.bench.virtual.rig", "rig", opened)
    command = (
        "rig",
        ROOT / "jobs" / "stream-arm.toml",
        "--hex",
        ROOT / "firmware" / "stream-arm" / "main.hex",
    )
    assert run(*command).code == run(*command, "--serial-pin", "RB7").code == 3
    listening, other = pin_number("RA4"), pin_number("RB7")
    assert held == [(listening, {}), (other, {listening: 1})]


@pytest.mark.parametrize("number", sampled([signal.SIGINT, signal.SIGTERM, signal.SIGHUP]))
def test_it_ends_on_a_signal_and_leaves_nothing_behind(
    bench: Rig, number: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    opened = bench()
    opened.process.send_signal(number)
    assert opened.process.wait(300) == 0
    assert opened.process.stderr is not None
    assert opened.process.stderr.read() == ""
    # Its terminals close with the process; their names may belong to another one by now.
    assert not list(tmp_path.iterdir())


def test_a_fault_that_is_none_is_refused(run: Run) -> None:
    done = run("rig", JOB, "--fault", "analyser:silence")
    assert done.code == 2
    assert "did you mean 'analyser:silent'?" in done.err


@pytest.mark.parametrize(
    ("text", "device", "change"),
    [
        ("analyser:silent", "analyser", {"silent": True}),
        ("analyser:stop-after=7", "analyser", {"stop_after": 7}),
        ("inputs:garbage", "board", {"garbage": True}),
        ("inputs:late=3", "board", {"late_ms": 3}),
        ("programmer:no-chip", "programmer", {"no_chip": True}),
        ("programmer:wrong-bit-at=0x12", "programmer", {"wrong_bit_at": 18}),
    ],
)
def test_a_fault_is_one_property_of_one_device(text: str, device: str, change: dict[str, object]) -> None:
    sound = RigOptions()
    faulty = replace(getattr(sound, device), **change)
    assert faulty != getattr(sound, device)
    assert with_fault(sound, text) == replace(sound, **{device: faulty})


@pytest.mark.parametrize("number", ["", "7x", "1.5"])
def test_a_fault_with_a_number_needs_a_whole_one(number: str) -> None:
    text = f"analyser:stop-after={number}"
    with pytest.raises(InputError, match=rf"'{number}' in '{text}' is not a whole number") as refused:
        with_fault(RigOptions(), text)
    assert refused.value.code == "bad-option"


@pytest.mark.campaign
def test_of_two_processes_on_one_port_the_second_is_refused(run: Run, bench: Rig, tmp_path: Path) -> None:
    port = bench("--real-time").paths["analyser"]
    common = ("capture", "--port", port, "--against", SCHEDULE, "--seconds", "1", "-o")
    first = subprocess.Popen([sys.executable, "-m", "servogen", *common, tmp_path / "1.vcd"])
    while not in_use(port):
        assert first.poll() is None
        time.sleep(0.02)
    first.send_signal(signal.SIGSTOP)  # so that it cannot end before the second begins
    try:
        done = run(*common, tmp_path / "2.vcd")
    finally:
        first.send_signal(signal.SIGCONT)
    assert done.code == 3
    assert f"{port}: error: is in use by another program" in done.err
    assert first.wait() in (0, 3), "the analyser may have given up on it meanwhile"


def in_use(port: str) -> bool:
    """Whether another process holds the port."""
    handle = os.open(port, os.O_RDWR | os.O_NOCTTY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(handle)
    return False


@pytest.mark.campaign
def test_in_real_time_a_capture_takes_as_long_as_it_shows(run: Run, bench: Rig, tmp_path: Path) -> None:
    port = bench("--real-time").paths["analyser"]
    begin = time.monotonic()
    done = run("capture", "--port", port, "-o", tmp_path / "run.vcd", "--against", SCHEDULE, "--seconds", 1)
    assert done.code == 0, done.err
    assert time.monotonic() - begin >= 1
    assert run("verify", tmp_path / "run.vcd", "--against", SCHEDULE, "--partial").code == 0
