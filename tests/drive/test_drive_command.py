"""`servogen drive` over a pseudo-terminal: what a robot there hears, whatever ends the drive."""

import json
import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from servogen.cli.drive_command import entry_log
from tests.drive.conftest import ROOT, Run, Serial

JOBS = ROOT / "jobs"
RANGE = ("--range-us", "500,2500")
Start = Callable[..., "subprocess.Popen[str]"]

STREAM = """
[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"
[stream]
fail_safe = "{fail_safe}"
"""


def position(width_us: float) -> int:
    return round((width_us - 500) / 2000 * 254)


def test_a_pose_is_sent_and_left(run: Run, serial: Serial) -> None:
    done = run("drive", JOBS / "lab8-exercise.toml", "-p", serial.path, *RANGE, "--pose", "2")
    assert done.code == 0, done.err
    serial.wait_for(lambda decoder: bool(decoder.moves))
    assert serial.decoder.moves == [(0, position(1500))]
    assert "1 position, 1 pose" in done.out


def test_ctrl_c_stops_the_robot(start: Start, serial: Serial) -> None:
    options = ("--stop", "arm=45", "--baud", 2400)
    process = start("drive", JOBS / "lab8-exercise.toml", "-p", serial.path, *RANGE, *options)
    serial.wait_for(lambda decoder: decoder.positions.get(0) == position(1166.67))
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=300)
    assert process.returncode == 130
    serial.wait_for(lambda decoder: decoder.positions[0] == position(1250))


def test_a_robot_that_is_gone_when_it_is_to_stop_is_said_not_to_be_stopped(
    start: Start, serial: Serial
) -> None:
    process, _ = unplugged(start, serial)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 3 and "the robot was NOT stopped: the line is gone" in said


@pytest.mark.campaign
def test_wheels_stand_when_the_process_is_told_to_end(start: Start, serial: Serial) -> None:
    process = start("drive", JOBS / "omni-square.toml", "-p", serial.path, *RANGE, "--json")
    serial.wait_for(lambda decoder: decoder.positions.get(0, 127) != 127)
    process.send_signal(signal.SIGTERM)
    out, _ = process.communicate(timeout=300)
    serial.wait_for(lambda decoder: decoder.positions == {0: 127, 1: 127, 2: 127})
    *_, stopped, summary = (json.loads(line) for line in out.splitlines())
    assert stopped["event"] == "stopped"
    assert summary["stopped"]


def test_the_bytes_are_shown_in_a_dry_run_only_and_events_on_standard_error(
    capsys: pytest.CaptureFixture[str],
) -> None:
    sent = {"s": 0.02, "bytes": "FF 00 7F", "servo": "arm", "position": 127, "width_us": 1500.0}
    group = {"s": 0.04, "bytes": "FF F1"}
    for dry_run in (True, False):
        log = entry_log(False, dry_run)
        for entry in (
            sent,
            group,
            {"s": 1.0, "event": "lost", "text": "gone"},
            {"s": 2.0, "event": "stopped"},
        ):
            log(entry)
        out, err = capsys.readouterr()
        lines = ["     0.02 s  FF 00 7F  arm 1500.0 µs", "     0.04 s  FF F1  group"]
        assert out.splitlines() == (lines if dry_run else [])
        assert "lost: gone" in err and "stopped" not in err


def test_wheels_are_not_left_turning(run: Run) -> None:
    options = (*RANGE, "--dry-run", "--json", "--pose", "wheel1=100", "--seconds", 1)
    sent = [json.loads(line) for line in run("drive", JOBS / "omni-square.toml", *options).out.splitlines()]
    positions = [(entry["servo"], entry["position"]) for entry in sent if "servo" in entry]
    assert positions[0] == ("wheel1", position(1566.67))
    assert positions[-3:] == [("wheel1", 127), ("wheel2", 127), ("wheel3", 127)]


def test_a_robot_that_is_unplugged_and_plugged_in_again_gets_its_whole_pose(
    start: Start, serial: Serial
) -> None:
    process, _ = unplugged(start, serial)
    serial.decoder.moves.clear()
    serial.plug()
    assert [each["event"] for each in until_back(process)] == []
    serial.wait_for(lambda decoder: {0, 1, 2} <= set(decoder.positions))
    assert [number for number, _ in serial.decoder.moves[:3]] == [0, 1, 2]
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=300)
    assert json.loads(out.splitlines()[-1])["outages"] == 1


@pytest.mark.campaign
def test_a_port_that_another_program_takes_first_is_waited_for_and_the_reason_is_said(
    start: Start, serial: Serial
) -> None:
    """As a modem manager does with every new port: the drive opens it as soon as the other leaves it."""
    _, found = unplugged(start, serial)
    serial.decoder.moves.clear()
    serial.plug(taken=True)
    waiting = next(found)
    assert waiting["event"] == "waiting"
    assert "in use by another program" in waiting["text"]
    assert not serial.decoder.moves
    serial.leave()
    assert next(found)["event"] == "back"
    serial.wait_for(lambda decoder: {0, 1, 2} <= set(decoder.positions))


def events(process: "subprocess.Popen[str]") -> Iterator[dict[str, Any]]:
    """What a drive says of its line, as it says it."""
    assert process.stdout is not None
    entries = (json.loads(line) for line in iter(process.stdout.readline, ""))
    return (entry for entry in entries if "event" in entry)


def unplugged(start: Start, serial: Serial) -> tuple["subprocess.Popen[str]", Iterator[dict[str, Any]]]:
    """A drive that has lost its line after some moves, and what it says from then on."""
    process = start("drive", JOBS / "omni-square.toml", "-p", serial.path, *RANGE, "--json")
    serial.wait_for(lambda decoder: len(decoder.moves) > 5)
    serial.unplug()
    found = events(process)
    assert next(found)["event"] == "lost"
    return process, found


def until_back(process: "subprocess.Popen[str]") -> list[dict[str, Any]]:
    """The events before the port is open again.

    A program of another test may have opened a terminal of the same number just before: the drive waits until
    it is gone, and says so.
    """
    found = []
    for event in events(process):
        if event["event"] == "back":
            break
        found.append(event)
    return [each for each in found if each["event"] != "waiting"]


def test_lines_of_standard_input_steer(start: Start, serial: Serial) -> None:
    process = start(
        *("drive", JOBS / "omni-square.toml", "-p", serial.path, *RANGE, "--keys"), stdin=subprocess.PIPE
    )
    assert process.stdin is not None
    process.stdin.write("forward\n")
    process.stdin.flush()
    serial.wait_for(lambda decoder: decoder.positions.get(0, 127) > 127 > decoder.positions.get(1, 127))
    process.stdin.close()
    process.stdin = None
    process.communicate(timeout=300)
    assert process.returncode == 0
    serial.wait_for(lambda decoder: decoder.positions == {0: 127, 1: 127, 2: 127})


def test_keys_of_a_terminal_steer_and_ones_that_mean_nothing_do_nothing(start: Start, serial: Serial) -> None:
    master, slave = os.openpty()
    try:
        process = start("drive", JOBS / "omni-square.toml", "-p", serial.path, *RANGE, "--keys", stdin=slave)
        serial.wait_for(lambda decoder: bool(decoder.moves))
        os.write(master, b"7z\x1b[A")
        serial.wait_for(lambda decoder: decoder.positions[0] > 127 > decoder.positions[1])
        os.write(master, b"x")
        _, err = process.communicate(timeout=300)
        assert process.returncode == 0, err
    finally:
        os.close(master)
        os.close(slave)


def test_an_arm_program_is_played_live(run: Run) -> None:
    """The program fills a pallet of two by two places: the hand closes four times, from 40° to 110°."""
    done = run("drive", JOBS / "rvm1-stream.toml", "--dry-run", "--json")
    assert done.code == 0, done.err
    sent = [row for row in map(json.loads, done.out.splitlines()) if "servo" in row]
    assert {row["servo"] for row in sent} == {"waist", "shoulder", "elbow", "pitch", "roll", "hand"}
    hand = [row["position"] for row in sent if row["servo"] == "hand"]
    middle = (min(hand) + max(hand)) / 2
    assert sum(before < middle < after for before, after in pairwise(hand)) == 4


def test_a_dry_run_shows_the_bytes_and_needs_no_port(run: Run) -> None:
    done = run("drive", JOBS / "lab8-exercise.toml", *RANGE, "--dry-run", "--json", "--seconds", 3)
    *sent, summary = (json.loads(line) for line in done.out.splitlines())
    assert sent[0] == {
        "s": 0.0031,
        "servo": "arm",
        "number": 0,
        "position": 85,
        "width_us": pytest.approx(1166.67, abs=4),
        "bytes": "ff 00 55",
    }
    assert summary["seconds"] == pytest.approx(3, abs=0.02)


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (("--port", "/dev/not-there", *RANGE), 3, "/dev/not-there: error: there is no such port"),
        (RANGE, 2, "no serial port is given"),
        (("--dry-run",), 2, "the widths of positions 0 and 254"),
        (("--dry-run", *RANGE, "--pose", "8"), 2, "the job has no pose '8'"),
        (("--dry-run", *RANGE, "--pose", "1", "--keys"), 2, "use one of the two"),
        (("--dry-run", *RANGE, "--stop", "off"), 2, "cannot switch pulses off"),
        (("--dry-run", *RANGE, "--stop", "nowhere"), 2, "the job has no pose 'nowhere'"),
    ],
)
def test_what_cannot_be_is_refused(run: Run, options: tuple[object, ...], code: int, says: str) -> None:
    done = run("drive", JOBS / "lab8-exercise.toml", *options)
    assert done.code == code
    assert says in done.err


@pytest.mark.parametrize("fail_safe", ["hold", "neutral", "off"])
def test_a_stream_jobs_line_and_widths_are_its_own(run: Run, tmp_path: Path, fail_safe: str) -> None:
    job = tmp_path / "stream.toml"
    job.write_text(STREAM.format(fail_safe=fail_safe))
    done = run("drive", job, "--dry-run", "--pose", "arm=90", "--seconds", 1, "--stop", "hold")
    assert done.code == 0, done.err
    assert "2400 baud" in done.out
    assert "ff 00 7f  arm 1500.0 µs" in done.out, "its positions 0 and 254 are the servo's limits"
    off = run("drive", job, "--dry-run", "--pose", "arm=90", "--stop", "off")
    assert off.code == (0 if fail_safe == "off" else 2)


def test_a_pose_that_a_fail_safe_keeps_is_left(run: Run, serial: Serial, tmp_path: Path) -> None:
    job = tmp_path / "stream.toml"
    job.write_text(STREAM.format(fail_safe="hold"))
    done = run("drive", job, "-p", serial.path, "--pose", "arm=90", "--arrive-s", 0)
    assert (done.code, "kept until Ctrl-C" in done.out) == (0, False), done.err


@pytest.mark.campaign
def test_a_pose_that_the_fail_safe_would_end_is_kept_and_said_to_be(
    start: Start, serial: Serial, tmp_path: Path
) -> None:
    job = tmp_path / "stream.toml"
    job.write_text(STREAM.format(fail_safe="neutral"))
    process = start("drive", job, "-p", serial.path, "--pose", "arm=90", "--arrive-s", 0)
    serial.wait_for(lambda decoder: len(decoder.moves) > 2)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 130, err
    assert "kept until Ctrl-C" in out
