"""`servogen watch` on the command line: bad input, a missing package, and that the server ends with it."""

from __future__ import annotations

import http.client
import json
import os
import re
import select
import signal
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest

if os.name == "posix":
    import tty

from tests.bench.conftest import Run, run  # noqa: F401 - a fixture
from tests.watch.commands import served_by

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["missing.hex"], "cannot be read"),
        (["README.md"], "is not the suffix of a job"),
        (["jobs/lab8-exercise.toml", "--robot", "/dev/null"], "only a job with [stream]"),
        (["firmware/lab8-exercise/main.hex", "--against", "missing.json"], "cannot be read"),
        (["firmware/lab8-exercise/main.hex", "--against", "missing.toml"], "cannot be read"),
        (["jobs/lab8-exercise.toml", "--against", "jobs/lab9-exercise.toml"], "its own schedule"),
        (
            ["jobs/lab8-exercise.toml", "--device", "PIC16F84A"],
            "was built for a PIC16F84, --device is PIC16F84A",
        ),
        (
            ["firmware/lab8-exercise/main.hex", "--against", "jobs/stream-fast.toml", "--device", "PIC16F84"],
            "was built for a PIC16F84A, --device is PIC16F84",
        ),
        (["firmware/lab8-exercise/main.hex", "--port", "99999"], "65535"),
        (
            ["firmware/lab8-exercise/main.hex", "--at-cycle", "864000000001"],
            "less than or equal to 864000000000",
        ),
    ],
)
def test_bad_input_ends_with_2(
    run: Run,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(ROOT)
    done = run("watch", "--no-browser", *arguments)
    assert done.code == 2
    assert message in done.err


def test_without_websockets_it_says_what_to_install(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    monkeypatch.setitem(sys.modules, "servogen.watch.server", None)
    done = run("watch", "--no-browser", ROOT / "firmware" / "lab8-exercise" / "main.hex")
    assert done.code == 3
    assert "servogen[watch]" in done.err


def test_the_server_ends_with_the_command() -> None:
    command = ["watch", "firmware/lab8-exercise/main.hex", "--no-browser"]
    with served_by(*command) as (served, output, errors):
        found = re.search(r"main\.hex: (http://127\.0\.0\.1:\d+/\S+/)", output.readline())
        assert found
        address = urlsplit(found[1])
        connection = http.client.HTTPConnection(address.netloc, timeout=300)
        connection.request("GET", address.path, headers={"Sec-Fetch-Site": "none"})
        assert connection.getresponse().status == 200
        served.send_signal(signal.SIGINT)
        assert served.wait(300) == 0
        assert "Traceback" not in errors.read()


@pytest.mark.campaign
@pytest.mark.skipif(os.name != "posix", reason="there are no pseudo-terminals here")
def test_a_slider_moves_a_robot_at_a_port() -> None:
    """The port is one end of a pseudo-terminal; what a robot would receive is read from the other one."""
    pytest.importorskip("websockets", reason="the extra 'watch' is not installed")
    from websockets.sync.client import connect

    robot, port = os.openpty()
    tty.setraw(port)
    command = ["watch", "jobs/stream-arm.toml", "--no-browser", "--robot", os.ttyname(port)]
    try:
        with served_by(*command) as (served, output, errors):
            found = re.search(r"http://(127\.0\.0\.1:\d+)(/\S+/)", output.readline())
            assert found
            origin = {"Origin": f"http://{found[1]}"}
            with connect(f"ws://{found[1]}{found[2]}socket", additional_headers=origin, proxy=None) as socket:
                socket.send(json.dumps({"window": ""}))
                while json.loads(socket.recv(timeout=300))["is"] != "model":
                    pass
                for servo, position in ((2, 254), (0, 7)):
                    socket.send(json.dumps({"do": "servo", "servo": servo, "position": position}))
                received = b""
                while len(received) < 6:
                    assert select.select([robot], [], [], 60)[0], received
                    received += os.read(robot, 64)
                assert received == bytes([255, 2, 254, 255, 0, 7])
            served.send_signal(signal.SIGINT)
            assert served.wait(300) == 0
            assert "Traceback" not in errors.read()
    finally:
        os.close(robot)
        os.close(port)
