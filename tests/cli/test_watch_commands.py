"""What `watch` asks of its server, which does not run here, and the server's own ends."""

from __future__ import annotations

import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.cli import page_server
from servogen.drive import serial_link
from servogen.errors import ToolError
from tests.cli.conftest import Run
from tests.cli.stand_ins import stand_in

pytest.importorskip("websockets", reason="the server of watch is not installed")

from servogen.watch import live_line, server, subject

ROOT = Path(__file__).parents[2]
JOB, STREAM = ROOT / "jobs" / "lab8-exercise.toml", ROOT / "jobs" / "stream-arm.toml"
BUILT = ROOT / "firmware" / "lab8-exercise"


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The room and the server that `watch` opens."""
    seen: dict[str, Any] = {"closed": 0}

    class Room:
        def __init__(self, load: Any, editor: Any, live: Any) -> None:
            seen.update(load=load, editor=editor, live=live)

    class Live:
        def __init__(self, line: Any) -> None:
            seen["line"] = line

        def close(self) -> None:
            seen["closed"] += 1

    @contextmanager
    def port() -> Iterator[str]:
        yield "open"
        seen["left"] = seen["closed"]

    def opener(path: str, baud: int) -> Any:
        seen["port"] = (path, baud)
        return port

    def serve(served: Any, name: str, port: int, browser: bool) -> None:
        seen.update(served=served, name=name, number=port, browser=browser, closed_before=seen["closed"])

    stand_in(monkeypatch, server, "Room", Room)
    stand_in(monkeypatch, server, "WatchServer", lambda rooms: rooms)
    stand_in(monkeypatch, live_line, "LiveLine", Live)
    stand_in(monkeypatch, serial_link, "port_opener", opener)
    stand_in(monkeypatch, "servogen.cli.page_server", "serve_until_ctrl_c", serve)
    stand_in(monkeypatch, subject, "load_subject", lambda file, setting, tell: (file, setting, tell))
    return seen


def test_a_job_is_watched_from_its_beginning_and_can_be_edited(run: Run, watched: dict[str, Any]) -> None:
    ran = run("watch", JOB)
    assert (ran.code, ran.err) == (0, "")
    assert (watched["name"], watched["number"], watched["browser"]) == (JOB.name, 0, True)
    assert list(watched["served"]) == [""]
    assert watched["editor"] is not None
    assert (watched["live"], watched["closed"]) == (None, 0)
    file, setting, tell = watched["load"]("progress")
    assert (file, tell) == (JOB, "progress")
    assert (setting.clock_hz, setting.stimulus, setting.schedule, setting.job) == (None, None, None, None)
    assert (setting.at_cycle, setting.device, setting.options.device) == (0, None, "PIC16F84")


def test_a_program_is_watched_with_its_options_and_not_edited(run: Run, watched: dict[str, Any]) -> None:
    words = ("--at-cycle", 123, "--clock-hz", 4_000_000, "--port", 8001, "--no-browser", "--floating", 1)
    assert run("watch", BUILT / "main.hex", *words).code == 0
    assert (watched["name"], watched["number"], watched["browser"]) == ("main.hex", 8001, False)
    assert watched["editor"] is None
    setting = watched["load"](None)[1]
    assert (setting.at_cycle, setting.clock_hz, setting.options.floating) == (123, 4_000_000, 1)
    assert run("watch", BUILT / "main.hex", "--at-cycle", 864_000_000_000).code == 0  # two days at 20 MHz


SENSOR = """
[[sensor]]
pin = "RB5"
kind = "stall"
above_a = 1

[[sensor]]
pin = "RA1"
kind = "stall"
above_a = 2

[motion]"""


def test_the_sensors_of_a_job_are_said_to_be_open_where_a_chip_runs(
    run: Run, watched: dict[str, Any], tmp_path: Path
) -> None:
    """A capture shows what the chip did, whatever was on its pins."""
    job = tmp_path / "a.toml"
    job.write_text(JOB.read_text().replace("\n[motion]", SENSOR))
    (tmp_path / "a.vcd").write_text("$timescale 1 us $end\n$enddefinitions $end\n#0\n")
    for words in ((job,), (BUILT / "main.hex", "--against", job)):
        ran = run("watch", *words)
        assert ran.code == 0
        assert "note: the job's sensors are not connected to the chip of the page" in ran.err
        assert "which reads RB5, RA1 as open pins [sensors-open]" in ran.err
    assert run("watch", tmp_path / "a.vcd", "--against", job).err == ""


def test_a_program_is_compared_with_a_schedule_or_a_job(run: Run, watched: dict[str, Any]) -> None:
    assert run("watch", BUILT / "main.hex", "--against", BUILT / "schedule.json").code == 0
    setting = watched["load"](None)[1]
    assert (setting.schedule is not None, setting.job) == (True, None)
    assert run("watch", BUILT / "main.hex", "--against", JOB).code == 0
    setting = watched["load"](None)[1]
    assert (setting.schedule, setting.job) == (None, JOB)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((JOB, "--against", BUILT / "schedule.json"), "a job is compared with its own schedule"),
        ((JOB, "--robot", "x"), "only a job with [stream] moves a robot live"),
        ((BUILT / "main.hex", "--robot", "x"), "only a job with [stream] moves a robot live"),
        (
            (BUILT / "main.hex", "--against", STREAM, "--robot", "x"),
            "only a job with [stream] moves a robot live",
        ),
        ((BUILT / "main.hex", "--against", BUILT / "schedule.json", "--device", "PIC16F84A"), "PIC16F84A"),
        ((JOB, "--device", "PIC16F84A"), "PIC16F84A"),
    ],
)
def test_what_does_not_go_together_is_refused(
    run: Run, watched: dict[str, Any], words: tuple[object, ...], message: str
) -> None:
    ran = run("watch", *words)
    assert (ran.code, "served" in watched) == (2, False)
    assert message in ran.err


def test_a_robot_is_moved_while_the_page_is_served_and_then_left(run: Run, watched: dict[str, Any]) -> None:
    """The line is closed before the port is."""
    assert run("watch", STREAM, "--robot", "/dev/x").code == 0
    assert (watched["port"], watched["line"]) == (("/dev/x", 2400), "open")
    assert watched["live"] is not None
    assert (watched["closed_before"], watched["closed"], watched["left"]) == (0, 1, 1)
    watched["closed"] = 0
    assert run("watch", STREAM).code == 0
    assert (watched["live"], watched["closed"]) == (None, 0)


@pytest.mark.parametrize("browser", [True, False])
def test_a_server_prints_its_address_and_perhaps_opens_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], browser: bool
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)

    async def serve(port: int, ready: Any) -> None:
        ready(f"http://localhost:{port}/")
        raise KeyboardInterrupt

    page_server.serve_until_ctrl_c(SimpleNamespace(run=serve), "a.hex", 123, browser)  # type: ignore[arg-type]
    assert capsys.readouterr().out == "a.hex: http://localhost:123/  (Ctrl-C ends)\n"
    assert opened == ["http://localhost:123/"] * browser


@pytest.mark.parametrize("before", [True, False])
def test_what_ends_a_server_of_editors_is_raised(monkeypatch: pytest.MonkeyPatch, before: bool) -> None:
    async def run(self: object, port: int, ready: Any) -> None:
        if not before:
            ready("the address")
        raise LookupError("gone")

    monkeypatch.setattr(server.WatchServer, "run", run)
    begun: list[Any] = []
    with pytest.raises(LookupError, match="gone"), page_server.serving(lambda send: begun.append) as url:
        begun.append(url)
    assert begun == ["the address"] * (not before)


def test_a_port_that_is_in_use_is_an_error_of_the_bench() -> None:
    async def serve(port: int, ready: Any) -> None:
        raise OSError(98, "Address already in use")

    with pytest.raises(ToolError, match="port 123 cannot be opened: Address already in use"):
        page_server.serve_until_ctrl_c(SimpleNamespace(run=serve), "a.hex", 123, True)  # type: ignore[arg-type]
