"""`servogen watch` on the command line: bad input, a missing package, and that the server ends with it."""

from __future__ import annotations

import http.client
import re
import signal
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from tests.bench.conftest import Run, run  # noqa: F401 - a fixture

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["missing.hex"], "cannot be read"),
        (["README.md"], "neither the ending of a job"),
        (["jobs/lab8-exercise.toml", "--robot", "/dev/null"], "only a job with [stream]"),
        (["firmware/lab8-exercise/main.hex", "--against", "missing.json"], "cannot be read"),
        (["firmware/lab8-exercise/main.hex", "--port", "99999"], "65535"),
        (
            ["firmware/lab8-exercise/main.hex", "--at-cycle", "18000000001"],
            "less than or equal to 18000000000",
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
    command = [sys.executable, "-m", "servogen", "watch", "firmware/lab8-exercise/main.hex", "--no-browser"]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as served:
        assert served.stdout is not None and served.stderr is not None
        found = re.search(r"main\.hex: (http://127\.0\.0\.1:\d+/\S+/)", served.stdout.readline())
        assert found
        address = urlsplit(found[1])
        connection = http.client.HTTPConnection(address.netloc, timeout=60)
        connection.request("GET", address.path, headers={"Sec-Fetch-Site": "none"})
        assert connection.getresponse().status == 200
        served.send_signal(signal.SIGINT)
        assert served.wait(20) == 0
        assert "Traceback" not in served.stderr.read()
    with pytest.raises(ConnectionRefusedError):
        http.client.HTTPConnection(address.netloc, timeout=60).connect()
