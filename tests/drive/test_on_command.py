"""`servogen drive --keys` of a walk on command: what is sent, what the chip does, the terminal afterwards."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import termios
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, NoReturn

import numpy as np
import pytest

from servogen.bench.virtual.rig import RigOptions
from servogen.cli.drive_line import WireOptions
from servogen.cli.drive_on_command import drive_on_command
from servogen.drive import on_command
from servogen.drive.commands import NEXT, QUIT, STOP, WAIT, commands_of_keys, script, segment_keys
from servogen.drive.on_command import LEAD_IN, STANCE, CommandedDrive, CommandedFrame, Twin
from servogen.drive.serial_link import VirtualTime
from servogen.edges import PINS
from servogen.engines.inputs.buttons import ButtonPin
from servogen.engines.inputs.commands import CommandButton, CommandButtons, Commander, CommandLine, uart_byte
from servogen.engines.player.script import DirectionPlaces
from servogen.errors import InputError
from servogen.job.schema import NOT_SEGMENTS
from servogen.pic.device import RAM_FIRST
from servogen.pulse.schedule import from_json
from servogen.units import Clock, Cycles
from tests.cli.stand_ins import stand_in
from tests.drive.conftest import ROOT, Run, planned
from tests.engines.player.test_direction_buttons import ROBOT, TEXT, TWO

JOB = ROOT / "jobs" / "hexapod-command.toml"
FIRMWARE = ROOT / "firmware" / "hexapod-command"
Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture(scope="module")
def walked() -> list[CommandedFrame]:
    """The states of a walk at which direction or part change, and the last one."""
    states: list[CommandedFrame] = []
    words = script("wait 3\nforward\nwait 2\nleft\nwait 4\nstop\nwait 6\n")
    CommandedDrive(Twin(planned("hexapod-command")), words, VirtualTime().time(), states.append).run(60.0)
    kept = [states[0]]
    for state in states:
        if (state.direction, state.part) != (kept[-1].direction, kept[-1].part):
            kept.append(state)
    return [*kept, states[-1]]


def test_directions_follow_commands_and_each_ends_in_the_stance(walked: list[CommandedFrame]) -> None:
    """Starts, cycles and stops are as long as the schedule has them; a cycle takes 0.96 s, 48 frames."""
    assert [(state.direction, state.part) for state in walked] == [
        ("lead-in", ""),
        ("stance", ""),
        ("forward", "start"),
        ("forward", "cycle"),
        ("forward", "stop"),
        ("left", "start"),
        ("left", "cycle"),
        ("left", "stop"),
        ("stance", ""),
        ("stance", ""),
    ]
    frames = [state.frame for state in walked]
    commands = from_json((FIRMWARE / "schedule.json").read_text(), "schedule.json").commands
    assert commands is not None
    forward, _, left, _ = commands.directions
    assert frames[3] - frames[2] == sum(run.frames for run in forward.start)
    assert (frames[4] - frames[3]) % 48 == 0
    assert frames[5] - frames[4] == sum(run.frames for run in forward.stop)
    assert frames[6] - frames[5] == sum(run.frames for run in left.start)
    assert (frames[7] - frames[6]) % 48 == 0


def test_the_widths_are_those_of_the_schedules_frames(walked: list[CommandedFrame]) -> None:
    schedule = from_json((FIRMWARE / "schedule.json").read_text(), "schedule.json")
    stance = [pulse.width for pulse in schedule.loop[0].pulses if pulse]
    assert list(walked[-1].widths_us.values()) == stance
    assert list(walked[-1].widths_us) == [channel.name for channel in schedule.channels]
    assert (walked[0].frame, walked[0].seconds) == (1, pytest.approx(0.02))


def piped(start: Start, text: str, *arguments: object) -> tuple[int, str, str]:
    """Return exit code, output and errors of `drive` whose standard input is `text`."""
    process = start("drive", JOB, *arguments, stdin=subprocess.PIPE)
    out, err = process.communicate(text, timeout=300)
    return process.returncode, out, err


class Ended(CommandedDrive):
    """A drive that shows three states, two of which are the same direction and part."""

    made: ClassVar[list[Ended]] = []

    def run(self, seconds: float) -> None:
        self.made.append(self)
        for seconds, direction in ((0.0, "forward"), (0.02, "forward"), (0.04, "stance")):
            self.tell(CommandedFrame(seconds, 0, direction, "", {}))


@pytest.mark.parametrize(
    ("terminal", "port", "dry_run", "real"),
    [
        (True, None, False, True),
        (True, None, True, False),
        (True, "/dev/ttyX", True, False),
        (False, None, False, False),
        (False, "/dev/ttyX", False, True),
        (False, "/dev/ttyX", True, False),
    ],
)
def test_time_is_real_for_a_person_or_a_robot_and_only_a_terminals_state_stays_on_its_line(
    terminal: bool,
    port: str | None,
    dry_run: bool,
    real: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    stand_in(monkeypatch, "servogen.drive.on_command", "CommandedDrive", Ended)
    stand_in(monkeypatch, "servogen.drive.on_command", "Twin", lambda job: Robot())
    stand_in(monkeypatch, "servogen.drive.serial_link", "SerialLink", lambda *_: nullcontext(None))
    stand_in(monkeypatch, "servogen.drive.serial_link", "port_opener", lambda *_: None)
    stand_in(monkeypatch, "servogen.cli.drive_line", "command_source", lambda *_: nullcontext(script("")))
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: terminal))
    monkeypatch.setattr(Ended, "made", [])
    job = planned("hexapod-command")
    for as_json in (False, True):
        drive_on_command(job, WireOptions(port=port, dry_run=dry_run), None, as_json)
        drive = Ended.made.pop()
        assert (drive.time.now is time.monotonic) == real
        assert drive.single_keys == (terminal and not dry_run)
        out = capsys.readouterr().out
        if as_json:
            states = [json.loads(line) for line in out.splitlines()[:-1]]
            assert [state["direction"] for state in states] == ["forward", "stance"]
            continue
        _, shown = out.split("\n", 1)
        texts = [
            CommandedFrame(at, 0, each, "", {}).text() for at, each in ((0.0, "forward"), (0.04, "stance"))
        ]
        if terminal and not dry_run:
            every = [texts[0], CommandedFrame(0.02, 0, "forward", "", {}).text(), texts[1]]
            assert shown.startswith("".join(f"\r{text}" for text in every) + "\n")
        else:
            assert shown.splitlines()[:2] == texts


@pytest.mark.campaign
def test_commands_from_a_pipe_drive_the_simulated_chip(start: Start) -> None:
    code, out, err = piped(start, "back\nwait 3\nstop\nwait 3\n", "--keys", "--json")
    assert code == 0, err
    *states, summary = map(json.loads, out.splitlines())
    assert [(state["direction"], state["part"]) for state in states] == [
        ("lead-in", ""),
        *(("back", part) for part in ("start", "cycle", "stop")),
        ("stance", ""),
    ]
    assert summary["commands"] == 2


@pytest.mark.parametrize(
    ("options", "text", "message"),
    [
        ((), "", "walks on command"),
        (("--keys", "--pose", "1"), "", "--pose is for other jobs"),
        (("--keys",), "fly\n", "unknown command 'fly'"),
    ],
)
def test_bad_input_is_a_plain_error(
    run: Run, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], text: str, message: str
) -> None:
    stand_in(monkeypatch, "servogen.drive.on_command", "Twin", lambda job: Robot())
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as pipe:
        pipe.write(text)
    with os.fdopen(reading) as pipe:
        monkeypatch.setattr("sys.stdin", pipe)
        ran = run("drive", JOB, *options)
    assert (ran.code, message in ran.err) == (2, True), ran.err


def test_digits_choose_segments_and_no_segment_has_a_word_of_the_drive() -> None:
    keys = segment_keys(["wave", "bow"])
    assert commands_of_keys(b"2w1 3q", keys) == ["bow", "wave", STOP, QUIT]
    assert {*NOT_SEGMENTS} == {STOP, QUIT, WAIT, NEXT, STANCE, LEAD_IN}


@contextmanager
def terminal() -> Iterator[tuple[int, int]]:
    master, slave = os.openpty()
    try:
        yield master, slave
    finally:
        os.close(master)
        os.close(slave)


def read_until(descriptor: int, wanted: bytes, seconds: float = 300) -> bytes:
    data = b""
    end = time.monotonic() + seconds
    while wanted not in data:
        assert time.monotonic() < end, data
        if select.select([descriptor], (), (), 0.1)[0]:
            data += os.read(descriptor, 4096)
    return data


@pytest.mark.campaign
def test_keys_of_a_terminal_are_sent_to_a_port_and_the_terminal_is_restored(start: Start) -> None:
    """A port at 50 baud, whose bits last a frame: each code twice, and a stop at the end."""
    with terminal() as (master, slave), terminal() as (robot, port):
        tty.setraw(port)
        before = termios.tcgetattr(slave)
        process = start("drive", JOB, "--keys", "-p", os.ttyname(port), stdin=slave)
        read_until(process.stderr.fileno(), b"q ends")
        while termios.tcgetattr(slave) == before:
            time.sleep(0.01)
        os.write(master, b"zw")
        assert read_until(robot, b"\xea\xea") == b"\xea\xea"
        assert termios.tcgetattr(port)[4:6] == [termios.B50, termios.B50]
        os.write(master, b"q")
        assert read_until(robot, b"\x00\x00") == b"\x00\x00"
        _, err = process.communicate(timeout=300)
        assert process.returncode == 0, err
        assert termios.tcgetattr(slave) == before


@pytest.mark.campaign
def test_ctrl_c_ends_the_drive_and_restores_the_terminal(start: Start) -> None:
    with terminal() as (_, slave):
        before = termios.tcgetattr(slave)
        process = start("drive", JOB, "--keys", stdin=slave)
        read_until(process.stdout.fileno(), b"frame")
        assert termios.tcgetattr(slave) != before
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=300)
        assert process.returncode == 130, err
        assert termios.tcgetattr(slave) == before


def test_the_virtual_bench_puts_the_line_on_the_jobs_pin(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[RigOptions] = []

    def opened(image: object, clock: object, board: object, options: RigOptions, *more: object) -> NoReturn:
        asked.append(options)
        raise InputError("bad-option", "enough")

    stand_in(monkeypatch, "servogen.bench.virtual.rig", "rig", opened)
    assert run("rig", JOB, "--hex", FIRMWARE / "main.hex").code == 2
    assert [(PINS[each.serial_pin], each.baud) for each in asked] == [("RA4", 50)]


def test_a_robot_that_buttons_command_takes_no_port(run: Run, tmp_path: Path) -> None:
    (tmp_path / "two.toml").write_text(ROBOT)
    job = tmp_path / "job.toml"
    job.write_text(TEXT.replace("BUTTONS", TWO))
    done = run("drive", job, "--keys", "--port", "/dev/null")
    assert done.code == 2
    assert "--port: the robot is commanded by buttons" in done.err


# ---- a chip by hand -------------------------------------------------------------------------------------


class Chip:
    """A chip whose variables and pins a test sets; it only counts its cycles."""

    def __init__(self, image: object, clock: object, board: object, *, stimulus: object) -> None:
        self.now = 0
        self.listeners: list[Callable[[tuple[np.ndarray, np.ndarray], int], None]] = []
        self.ram = bytearray(68)
        self.machine = SimpleNamespace(state=lambda: self)

    def run(self, cycles: int) -> None:
        self.now += cycles


PLACES = (4, 6, 0, 0, 30, 20, 10, 6, 6, 10, 20, 30)
"""Standing, and a direction that is read backward and forward: where each part begins and ends."""


def twin_of(read: Commander, monkeypatch: pytest.MonkeyPatch) -> Twin:
    """Return a twin of two servos, with frames of 20 ms, whose chip is one by hand."""
    channels = [SimpleNamespace(name=name, pin=pin) for name, pin in (("one", "RB0"), ("two", "RA1"))]
    schedule = SimpleNamespace(period=20_000, channels=channels)
    played = SimpleNamespace(
        chain=DirectionPlaces(read, ("back", "forward"), PLACES, 0, 0),
        plan=SimpleNamespace(schedule=schedule),
    )
    variables = {"begun": RAM_FIRST + 3, "until": RAM_FIRST + 5}
    listing = SimpleNamespace(variable=variables.__getitem__)
    compilation = SimpleNamespace(listing=listing, image=None)
    monkeypatch.setattr(on_command, "play", lambda job: (None, played, None))
    monkeypatch.setattr(on_command, "compiled", lambda *_: SimpleNamespace(compilation=compilation))
    monkeypatch.setattr(on_command, "board_of", lambda schedule: None)
    monkeypatch.setattr(on_command, "VirtualChip", Chip)
    job = SimpleNamespace(
        commands=read,
        inputs=(read,),
        firmware=SimpleNamespace(dialect="c2c"),
        clock=Clock(4_000_000),
        frame=SimpleNamespace(period=SimpleNamespace(cycles=Cycles(20_000))),
    )
    return Twin(job)  # type: ignore[arg-type]


BUTTON = ButtonPin("RA4", 0)


def test_the_one_button_is_pressed_for_every_command_but_a_stop_of_a_robot_that_stands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A press is seen after three frames, and begins in the midst of one: it lasts four, then two free."""
    twin = twin_of(CommandButton(BUTTON), monkeypatch)
    assert twin.directions == ("next",)
    press = [*["next"] * 4, "", ""]
    presses = twin.stimulus.presses  # type: ignore[union-attr]
    for command, pressed in (("stop", 0), ("next", 1), ("stop", 1), ("stop", 0), ("next", 1), ("next", 1)):
        assert twin.command(command) == b""
        assert list(presses) == press * pressed
        presses.clear()


def test_a_direction_s_button_is_held_until_the_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    twin = twin_of(CommandButtons({"forward": BUTTON, "left": ButtonPin("RA3", 1)}), monkeypatch)
    assert twin.directions == ("forward", "left")
    for command, held in (("left", "left"), ("forward", "forward"), ("stop", "")):
        assert twin.command(command) == b""
        assert twin.stimulus.held == held  # type: ignore[union-attr]
    assert twin.stimulus.buttons == {"forward": (PINS.index("RA4"), 0), "left": (PINS.index("RA3"), 1)}  # type: ignore[union-attr]


def test_a_line_has_every_code_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    twin = twin_of(CommandLine("RA4"), monkeypatch)
    assert twin.directions == ("back", "forward")
    for command, name in (("forward", "forward"), ("back", "back"), ("stop", None)):
        assert twin.command(command) == bytes([uart_byte(name)] * 2)
        assert bytes(twin.stimulus.waiting) == bytes([uart_byte(name)] * 2)  # type: ignore[union-attr]
        twin.stimulus.waiting.clear()  # type: ignore[union-attr]


def test_the_chip_s_variables_say_what_it_does(monkeypatch: pytest.MonkeyPatch) -> None:
    twin = twin_of(CommandLine("RA4"), monkeypatch)
    chip: Any = twin.chip
    for number, (begun, until, direction, part) in enumerate(
        [
            (0, 4, "lead-in", ""),
            (0, 6, "stance", ""),
            (2, 20, "back", "start"),
            (2, 10, "back", "cycle"),
            (2, 6, "back", "stop"),
            (4, 10, "forward", "start"),
            (4, 20, "forward", "cycle"),
            (4, 30, "forward", "stop"),
        ],
        1,
    ):
        chip.ram[3], chip.ram[5] = begun, until
        found = twin.frame()
        assert (found.direction, found.part) == (direction, part)
        assert (found.frame, found.seconds) == (number, pytest.approx(0.02 * number))


def test_the_widths_of_a_frame_are_the_latest_whole_pulses(monkeypatch: pytest.MonkeyPatch) -> None:
    twin = twin_of(CommandLine("RA4"), monkeypatch)
    chip: Any = twin.chip
    (heard,) = chip.listeners
    one, two = 1 << PINS.index("RB0"), 1 << PINS.index("RA1")

    def widths(*levels: tuple[int, int]) -> dict[str, float]:
        cycles, words = np.array(levels).T
        heard((cycles, words), 0)
        return dict(twin.frame().widths_us)

    assert widths((0, two), (0, 0), (100, one)) == {"one": 0.0, "two": 0.0}
    assert widths((150, one | two), (1600, two)) == {"one": 1500.0, "two": 0.0}
    assert widths((1650, 0), (1700, 0), (2000, one), (2900, 0)) == {"one": 900.0, "two": 1500.0}


class Robot:
    """A twin that records its commands."""

    directions = ("forward", "left")

    def __init__(self) -> None:
        self.commands: list[str] = []
        self.frames = 0

    @property
    def seconds(self) -> float:
        return self.frames * 0.02

    def command(self, command: str) -> bytes:
        self.commands.append(command)
        return command[:1].encode()

    def frame(self) -> CommandedFrame:
        self.frames += 1
        return CommandedFrame(self.seconds, self.frames, "", "", {})


@pytest.mark.parametrize(
    ("text", "seconds", "commands", "frames"),
    [
        ("forward\nwait 1\nleft\nwait 1\n", 9.0, ["forward", "left", "stop"], 100),
        ("forward\nwait 1\nstop\nwait 1\n", 9.0, ["forward", "stop"], 100),
        ("forward\nwait 9\n", 0.5, ["forward", "stop"], 25),
        ("wait 0.5\nquit\nforward\n", 9.0, [], 25),
        ("", 9.0, [], 0),
    ],
)
def test_a_drive_sends_what_the_chip_is_told_and_stops_a_robot_that_walks(
    text: str, seconds: float, commands: list[str], frames: int
) -> None:
    robot: Any = Robot()
    sent: list[bytes] = []
    link: Any = SimpleNamespace(send=sent.append, drain=lambda: sent.append(b"drained"))
    states: list[CommandedFrame] = []
    drive = CommandedDrive(robot, script(text), VirtualTime().time(), states.append, link)
    drive.run(seconds)
    assert robot.commands == commands
    assert sent == [*(command[:1].encode() for command in commands), b"drained"]
    assert drive.sent == len(commands)
    assert len(states) == robot.frames == pytest.approx(frames, abs=1)
    with pytest.raises(InputError, match="unknown command 'right'"):
        drive.command("right")
    drive.single_keys = True
    drive.command("right")
    assert drive.sent == len(robot.commands) == len(commands)
