"""What `drive` and `calibrate` print, ask for and pass on, in this process and without a robot."""

from __future__ import annotations

import io
import json
import math
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import typer

from servogen import job as job_package
from servogen.cli import drive_line, drive_on_command, show
from servogen.drive import controller, on_command, request, serial_link, session, sweep
from servogen.drive.session import Summary
from servogen.drive.steering import Rates
from servogen.engines.inputs.commands import CommandLine
from servogen.errors import Diagnostic, InputError
from servogen.job import load, loads
from servogen.robot import calibration
from tests.cli.conftest import Run
from tests.cli.stand_ins import stand_in

ROOT = Path(__file__).parents[2]
LAB8 = ROOT / "jobs" / "lab8-exercise.toml"
WHEELS = ROOT / "jobs" / "omni-square.toml"
Text = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def first_command() -> None:
    """Each test is the first command of its process: no warning was given before."""
    show.begin()


SUMMARY = Summary(seconds=12.345, moving_s=4.0, commands=30, rounds=10, slowest_s=0.0375, stopped=True)


class Session:
    """Stands for a drive: keeps what it is given and ends at once."""

    given: dict[str, Any]
    interrupted = False

    def __init__(self, **given: Any) -> None:
        Session.given = given
        self.summary = SUMMARY

    def run(self, motion: Any) -> None:
        Session.given["motion"] = motion
        Session.given["handler"] = signal.getsignal(signal.SIGTERM)
        if Session.interrupted:
            raise KeyboardInterrupt


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What `drive` asks of the library: the session, the line, the controller, the request."""
    seen: dict[str, Any] = {}
    stand_in(monkeypatch, session, "DriveSession", Session)
    monkeypatch.setattr(Session, "interrupted", False)
    real_link, real_controller, real_course = (
        serial_link.SerialLink,
        controller.job_controller,
        request.plan_course,
    )

    def link(opener: Any, speed: int, time: Any, patience: float) -> Any:
        seen["link"] = (speed, patience)
        return real_link(opener, speed, time, patience)

    def controlled(job: Any, *settings: Any) -> Any:
        seen["controller"] = settings
        return real_controller(job, *settings)

    def course(job: Any, wanted: Any) -> Any:
        seen["request"] = wanted
        seen["course"] = real_course(job, wanted)
        return seen["course"]

    stand_in(monkeypatch, serial_link, "SerialLink", link)
    stand_in(monkeypatch, controller, "job_controller", controlled)
    stand_in(monkeypatch, request, "plan_course", course)
    return seen


RANGE = ("--range-us", "500,2500")


def test_a_drive_without_options_has_the_documented_defaults(run: Run, driven: dict[str, Any]) -> None:
    """docs/drive.md: the first pose within 1 s, a lost port is waited for 60 s; the whole motion once."""
    ran = run("drive", LAB8, *RANGE, "--dry-run")
    assert ran.code == 0
    assert driven["controller"] == (None, "500,2500", 0)
    assert driven["link"][1] == 60.0
    wanted = driven["request"]
    assert (wanted.pose, wanted.steer, wanted.seconds, wanted.stop) == (None, False, None, None)
    assert (wanted.single_keys, wanted.rehearsal) == (False, True)
    assert wanted.rates == Rates(None, None)
    assert (Session.given["arrive_s"], Session.given["stop"]) == (1.0, None)
    assert Session.given["motion"] is driven["course"].motion
    head, last = ran.out.splitlines()
    assert head.startswith("lab8-exercise, 9600 baud: a position takes 3.125 ms, a pose of the servo 3.125")
    assert last.endswith("30 positions, 10 poses (2.5 a second, the slowest 37.5 ms)")


def test_the_options_of_a_drive_reach_the_library(run: Run, driven: dict[str, Any]) -> None:
    words = (
        "--pose",
        "2",
        "--seconds",
        3,
        "--stop",
        "neutral",
        "--arrive-s",
        2,
        "--baud",
        1200,
        "--first",
        7,
    )
    ran = run("drive", LAB8, *RANGE, *words, "--patience", 5, "--dry-run", "--json")
    assert (driven["controller"], driven["link"]) == ((1200, "500,2500", 7), (1200, 5.0))
    wanted = driven["request"]
    assert (wanted.pose, wanted.seconds, wanted.stop) == ("2", 3.0, "neutral")
    assert Session.given["arrive_s"] == 2.0
    assert Session.given["stop"] == pytest.approx([math.pi / 2])
    assert json.loads(ran.out)["commands"] == 30
    assert len(ran.out.splitlines()) == 1


@pytest.mark.parametrize(("json_", "lines"), [((), 1), (("--json",), 0)])
def test_a_pose_that_is_kept_is_said_to_be(
    run: Run, driven: dict[str, Any], monkeypatch: pytest.MonkeyPatch, json_: tuple[str, ...], lines: int
) -> None:
    """Only if it would go on without end; not with a time, and not of a whole motion that goes on."""
    stand_in(
        monkeypatch,
        serial_link,
        "port_opener",
        lambda port, speed: lambda: nullcontext(serial_link.NullWire()),
    )
    kept = "the pose is kept until Ctrl-C (or --seconds)"
    pose = ("--pose", "wheel1=90,wheel2=0,wheel3=0")
    common = ("drive", WHEELS, *RANGE, "--port", "any", *json_)
    assert run(*common, *pose).out.count(kept) == lines
    assert math.isinf(driven["course"].seconds)
    assert run(*common, *pose, "--seconds", 1).out.count(kept) == 0
    assert run(*common).out.count(kept) == 0
    assert math.isinf(driven["course"].seconds)


def test_ctrl_c_ends_a_drive_with_130_after_its_summary(run: Run, driven: dict[str, Any]) -> None:
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = [signal.getsignal(number) for number in numbers]
    Session.interrupted = True
    ran = run("drive", LAB8, *RANGE, "--dry-run")
    assert (ran.code, "30 positions" in ran.out) == (130, True)
    assert Session.given["handler"] is signal.default_int_handler
    assert [signal.getsignal(number) for number in numbers] == before


def test_a_drive_needs_a_port_or_a_dry_run(run: Run, driven: dict[str, Any]) -> None:
    ran = run("drive", LAB8, *RANGE)
    assert (ran.code, ran.out) == (2, "")
    assert "no serial port is given" in ran.err
    assert "--port /dev/ttyUSB0, or --dry-run" in ran.err


def test_the_state_is_shown_after_each_command_but_not_as_json(
    run: Run, driven: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: Text
) -> None:
    """On standard error, so that a pipe has the bytes alone."""
    commands: list[str] = []
    changes: list[dict[str, Any]] = []
    made = request.plan_course
    stand_in(monkeypatch, request, "plan_course", lambda *given: replace(made(*given), **changes[-1]))
    for state in ((lambda: "now"), None):
        changes.append({"state": state, "on_command": commands.append})
        for json_ in ((), ("--json",)):
            run("drive", LAB8, *RANGE, "--dry-run", *json_)
            Session.given["on_command"]("left")
            assert capsys.readouterr().err == ("now\n" if state and not json_ else "")
    assert commands == ["left"] * 4


class Wire:
    """Stands for the line of a walk on command."""

    def __init__(self, *given: Any) -> None:
        self.given = given

    def __enter__(self) -> Wire:
        return self

    def __exit__(self, *_: object) -> None:
        pass


class State:
    def __init__(self, direction: str, part: str, text: str) -> None:
        self.direction, self.part, self.words = direction, part, text

    def text(self) -> str:
        return self.words

    def to_json(self) -> dict[str, str]:
        return {"text": self.words}


STATES = (State("a", "", "1"), State("a", "", "2"), State("a", "x", "3"), State("b", "x", "4"))


@pytest.fixture
def walking(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A walk on command that goes through `STATES`; what it is given."""
    seen: dict[str, Any] = {"interrupted": False}

    class Drive:
        sent = 3

        def __init__(self, **given: Any) -> None:
            seen.update(given)

        def run(self, seconds: float) -> None:
            seen["seconds"] = seconds
            for state in STATES:
                seen["tell"](state)
            if seen["interrupted"]:
                raise KeyboardInterrupt

    @contextmanager
    def source(*given: Any) -> Iterator[str]:
        seen["source_of"] = given
        yield "source"

    stand_in(monkeypatch, on_command, "CommandedDrive", Drive)
    stand_in(monkeypatch, on_command, "Twin", lambda job: SimpleNamespace(seconds=1.5))
    stand_in(monkeypatch, on_command, "line_baud", lambda job: 50)
    stand_in(monkeypatch, serial_link, "SerialLink", Wire)
    stand_in(monkeypatch, serial_link, "port_opener", lambda port, rate: (port, rate))
    stand_in(monkeypatch, "servogen.cli.drive_line", "command_source", source)
    return seen


def walk_job(commands: Any = None) -> Any:
    servos = [SimpleNamespace(name="a"), SimpleNamespace(name="b")]
    return SimpleNamespace(name="six", servos=servos, commands=commands, directions=(), file="six.toml")


def terminal(monkeypatch: pytest.MonkeyPatch, is_one: bool) -> None:
    keys: Any = io.StringIO()
    keys.isatty = lambda: is_one
    monkeypatch.setattr(sys, "stdin", keys)


@pytest.mark.parametrize(
    ("tty", "dry_run", "json_", "out"),
    [
        (False, False, False, "six: a simulated chip; widths of a, b\n1\n3\n4\n1.50 s, 3 commands\n"),
        (True, True, False, "six: a simulated chip; widths of a, b\n1\n3\n4\n1.50 s, 3 commands\n"),
        (True, False, False, "six: a simulated chip; widths of a, b\n\r1\r2\r3\r4\n1.50 s, 3 commands\n"),
        (False, False, True, '{"text": "1"}\n{"text": "3"}\n{"text": "4"}\nEND\n'),
        (True, False, True, '{"text": "1"}\n{"text": "3"}\n{"text": "4"}\nEND\n'),
    ],
)
def test_a_walk_on_command_tells_its_states(
    monkeypatch: pytest.MonkeyPatch,
    capsys: Text,
    walking: dict[str, Any],
    tty: bool,
    dry_run: bool,
    json_: bool,
    out: str,
) -> None:
    """On a terminal every one on one line; else, and as JSON, those of a new direction or part."""
    terminal(monkeypatch, tty)
    drive_on_command.drive_on_command(walk_job(), drive_line.WireOptions(dry_run=dry_run), None, json_)
    end = '{"diagnostics": [], "seconds": 1.5, "commands": 3}'
    assert capsys.readouterr().out == out.replace("END", end)
    assert walking["seconds"] == math.inf
    assert walking["single_keys"] is (tty and not dry_run)
    assert (walking["link"], walking["source"]) == (None, "source")
    assert walking["source_of"][:2] == (True, dry_run)
    assert walking["source_of"][3] == drive_line.WALK_KEYS_HELP


@pytest.mark.parametrize(("baud", "rate"), [(None, 50), (1200, 1200)])
def test_a_walk_on_a_port_uses_its_line(
    monkeypatch: pytest.MonkeyPatch, capsys: Text, walking: dict[str, Any], baud: int | None, rate: int
) -> None:
    terminal(monkeypatch, False)
    job = walk_job(CommandLine("RA4"))
    drive_on_command.drive_on_command(job, drive_line.WireOptions("/dev/x", baud), 2.5, False)
    assert capsys.readouterr().out.startswith(f"six: /dev/x, {rate} baud; widths of a, b\n")
    assert walking["seconds"] == 2.5
    opener, speed, time, patience = walking["link"].given
    assert (opener, speed, patience) == (("/dev/x", rate), rate, 0)
    assert time is walking["time"]
    drive_on_command.drive_on_command(job, drive_line.WireOptions("/dev/x", baud, dry_run=True), 2.5, False)
    assert walking["link"] is None
    assert "a simulated chip" in capsys.readouterr().out


def test_a_walk_that_is_interrupted_says_how_far_it_was(
    monkeypatch: pytest.MonkeyPatch, capsys: Text, walking: dict[str, Any]
) -> None:
    terminal(monkeypatch, False)
    walking["interrupted"] = True
    with pytest.raises(typer.Exit) as ended:
        drive_on_command.drive_on_command(walk_job(), drive_line.WireOptions(), 0.0, False)
    assert ended.value.exit_code == 130
    assert capsys.readouterr().out.endswith("1.50 s, 3 commands\n")
    assert walking["seconds"] == 0.0


def test_buttons_are_not_commanded_through_a_port(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal(monkeypatch, False)
    with pytest.raises(InputError, match="commanded by buttons, not by codes"):
        drive_on_command.drive_on_command(walk_job(), drive_line.WireOptions("/dev/x"), None, False)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--pose", "1"), "--pose"),
        (("--stop", "off"), "--stop"),
        (("--step-mm", 5), "--step-mm"),
        (("--turn-deg", 5), "--turn-deg"),
        (RANGE, "--range-us"),
    ],
)
def test_options_of_other_drives_are_refused_by_name(
    run: Run, monkeypatch: pytest.MonkeyPatch, words: tuple[object, ...], named: str
) -> None:
    stand_in(monkeypatch, job_package, "load", lambda path: None)
    stand_in(
        monkeypatch, job_package, "plan_job", lambda job: SimpleNamespace(directions=(1,), file="six.toml")
    )
    ran = run("drive", "six.toml", "--keys", *words)
    assert (ran.code, ran.out) == (2, "")
    assert f"{named} is for other jobs" in ran.err


def test_commands_come_from_keys_lines_a_script_or_nowhere(
    monkeypatch: pytest.MonkeyPatch, capsys: Text, tmp_path: Path
) -> None:
    from servogen.drive import commands

    keys: Any = io.StringIO("forward\nwait 1\n")
    keys.fileno = lambda: 17
    monkeypatch.setattr(sys, "stdin", keys)
    stand_in(monkeypatch, commands, "script", lambda text: ("script", text))
    stand_in(monkeypatch, commands, "LineCommands", lambda number: ("lines", number))
    stand_in(monkeypatch, commands, "terminal_keys", lambda number, own: nullcontext(("keys", number, own)))
    with drive_line.command_source(False, True) as none:
        assert isinstance(none, commands.NoCommands)
    with drive_line.command_source(True, True) as given:
        assert given == ("script", "forward\nwait 1\n")
    keys.isatty = lambda: False
    with drive_line.command_source(True, False) as given:
        assert given == ("lines", 17)
    assert tuple(capsys.readouterr()) == ("", "")
    keys.isatty = lambda: True
    with drive_line.command_source(True, False) as given:
        assert given == ("keys", 17, commands.KEYS)
    assert tuple(capsys.readouterr()) == ("", f"{drive_line.KEYS_HELP}\n")
    own: Any = {"x": "y"}
    with drive_line.command_source(True, False, own, "own help") as given:
        assert given == ("keys", 17, own)
    assert capsys.readouterr().err == "own help\n"


@pytest.fixture
def servo() -> Any:
    return load(LAB8).servos[0]


@pytest.mark.parametrize(
    ("job", "option", "degrees"),
    [(LAB8, (), 5), (LAB8, ("--tolerance-deg", 0.5), 0.5), (WHEELS, ("--servo", "wheel2"), 20)],
)
def test_a_reading_may_be_five_degrees_off_and_a_wheels_twenty(
    run: Run,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    job: Path,
    option: tuple[object, ...],
    degrees: float,
) -> None:
    """As --help says."""
    asked: list[Any] = []

    def fitted(readings: Any, tolerance: float, continuous: bool) -> Any:
        asked.append((math.degrees(tolerance), continuous))
        raise InputError("bad-readings", "enough")

    stand_in(monkeypatch, calibration, "fit", fitted)
    csv = tmp_path / "seen.csv"
    column = "speed_deg_s" if job == WHEELS else "angle_deg"
    csv.write_text(f"width_us,{column}\n1400,0\n1500,90\n1600,180\n")
    assert run("calibrate", job, "--readings", csv, *option).code == 2
    assert asked == [(pytest.approx(degrees), job == WHEELS)]


def test_a_servo_is_moved_through_the_widths_that_are_asked_for(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Seven of its range unless told otherwise; angles that are given need no port."""
    asked: list[Any] = []
    real = sweep.positions

    def positions(channel: Any, *span: Any) -> Any:
        asked.append(span)
        return real(channel, *span)

    stand_in(monkeypatch, sweep, "positions", positions)
    angles = ",".join(str(30 * number) for number in range(7))
    common = ("calibrate", LAB8, *RANGE, "-o", tmp_path / "a.toml")
    run(*common, "--angles-deg", angles)
    run(*common, "--angles-deg", "1,2,3", "--points", 3, "--from-us", 1100, "--to-us", 1900)
    assert asked == [(None, None, 7), (1100, 1900, 3)]
    without = run(*common)
    assert (without.code, len(asked)) == (2, 2)
    assert "no serial port is given" in without.err
    both = run(*common, "--readings", tmp_path / "no.csv", "--angles-deg", angles)
    assert (both.code, "--readings has the angles already" in both.err) == (2, True)


def test_a_job_that_cannot_use_its_calibration_is_exit_code_1(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    csv = tmp_path / "seen.csv"
    csv.write_text("width_us,angle_deg\n1000,0\n1500,90\n2000,180\n")
    common = ("calibrate", LAB8, "--readings", csv, "-o", tmp_path / "a.toml")
    assert run(*common).code == 0
    refusal = Diagnostic("warning", "out-of-range", "too far")
    stand_in(monkeypatch, sweep, "refusals", lambda *_: (refusal,))
    assert run(*common).code == 1


def test_the_widths_of_a_stream_job_are_its_own() -> None:
    text = LAB8.read_text().split("[motion]")[0] + "[stream]\nbaud = 1200\n"
    speed, found = controller.job_controller(loads(text, "a.toml"), None, None, 0)
    assert (speed, len(found.channels)) == (1200, 1)
