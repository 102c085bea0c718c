"""A line sends no faster than its baud rate, and says when its port is gone."""

import os
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from servogen.bench.ports import Port, Unplugged
from servogen.drive.serial_link import SerialLink, VirtualTime, port_opener
from servogen.errors import ToolError
from tests.drive.mini_ssc import Robot


@pytest.mark.parametrize(("baud", "bytes_per_s"), [(300, 30), (2400, 240), (9600, 960)])
def test_bytes_leave_at_the_rate_of_the_line(baud: int, bytes_per_s: int) -> None:
    robot = Robot(baud)
    with SerialLink(robot.open, baud, robot.time(), 0.0) as line:
        ends = [line.send(b"\xff\x00\x10") for _ in range(50)]
        line.drain()
    assert ends == pytest.approx([3 * (number + 1) / bytes_per_s for number in range(50)])
    assert robot.now == pytest.approx(ends[-1])


def test_a_line_that_was_idle_sends_at_once() -> None:
    robot = Robot(2400)
    with SerialLink(robot.open, 2400, robot.time(), 0.0) as line:
        line.send(b"\xff\x00\x10")
        robot.now += 5
        assert line.send(b"\xff\x00\x11") == pytest.approx(5 + 3 / 240)


class Gone:
    """A serial port whose device goes while it drains; that error is no OSError."""

    def write(self, data: bytes) -> int:
        return len(data)

    def flush(self) -> None:
        raise termios.error(5, "Input/output error")


def test_a_port_that_goes_while_it_drains_is_unplugged() -> None:
    with pytest.raises(Unplugged, match="/dev/robot: error: the device disappeared"):
        Port("/dev/robot", Gone()).write(b"\xff")  # type: ignore[arg-type]


def test_whoever_waits_for_a_port_looks_again_and_again_and_not_for_ever() -> None:
    time = VirtualTime()
    looks: list[float] = []

    @contextmanager
    def gone() -> Iterator[Gone]:
        looks.append(time.at)
        if len(looks) > 1:
            raise ToolError("no-port", "there is no such port")
        yield Gone()

    line = SerialLink(gone, 2400, time.time(), 2.0)
    with pytest.raises(ToolError, match="did not come back within 2 s"):
        line.reopen()
    assert looks == [0.0, 0.0, 0.5, 1.0, 1.5, 2.0]


def test_each_new_reason_is_told_once_and_what_was_not_sent_is_not_waited_for() -> None:
    """The port is closed, then missing twice, taken by another program, missing again, and back."""
    time, told, written = VirtualTime(), list[str](), list[bytes]()
    reasons = [None, "missing", "missing", "taken", "missing", None]
    closed: list[float] = []

    @contextmanager
    def opened() -> Iterator[SimpleNamespace]:
        reason = reasons.pop(0)
        if reason:
            raise ToolError("no-such-port", reason)
        try:
            yield SimpleNamespace(write=written.append)
        finally:
            closed.append(time.at)

    with SerialLink(opened, 100, time.time(), 9.0) as line:
        assert line.send(b"a" * 50) == pytest.approx(5.0)
        assert line.reopen(lambda error: told.append(error.message)) == pytest.approx(2.0)
        assert closed == [0.0]
        assert line.send(b"b") == pytest.approx(2.0 + 0.1)
        line.drain()
        assert time.at == pytest.approx(2.1)
    assert told == ["missing", "taken", "missing"]
    assert closed == [0.0, pytest.approx(2.1)]
    assert written == [b"a" * 50, b"b"]


def test_a_port_that_goes_away_while_it_is_opened_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plug that bounces: pyserial passes on the terminal's own error, which is not an OSError."""
    master, slave = os.openpty()
    path, opened = os.ttyname(slave), []
    flush = termios.tcflush

    def bouncing(handle: int, queue: int) -> None:
        opened.append(handle)
        if len(opened) in (2, 3):
            raise termios.error(5, "Input/output error")
        flush(handle, queue)

    monkeypatch.setattr(termios, "tcflush", bouncing)
    clock = VirtualTime()
    try:
        with SerialLink(port_opener(path, 2400), 2400, clock.time(), 10.0) as line:
            assert line.reopen() == pytest.approx(1.0), "two tries in vain, half a second after each"
            line.send(b"\xff\x00\x10")
        assert os.read(master, 10) == b"\xff\x00\x10"
        assert len(opened) == 4
    finally:
        os.close(master)
        os.close(slave)
