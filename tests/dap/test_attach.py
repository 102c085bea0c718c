"""`attach`: an editor and the page of `servogen watch` at one chip, over the page's own server."""

from __future__ import annotations

import json
import queue
from collections.abc import Callable, Iterator
from pathlib import Path
from socket import SHUT_RDWR
from threading import Event, Thread
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("websockets", reason="the server is of the extra watch")

from websockets.sync.client import ClientConnection, connect
from websockets.sync.server import ServerConnection, serve
from websockets.typing import Origin

from servogen.cli.page_server import serving
from servogen.dap import DebugSession
from servogen.dap.running_page import RunningPage
from servogen.watch.debugging import Debugging
from servogen.watch.session import WatchSession
from servogen.watch.subject import Setting, load_subject
from tests.watch.serving import Running

SOURCE = """ list p=16f84a
 cblock 0x0C
turns
 endc
start incf turns, f
 movf turns, w
 goto start
 end
"""


class Editor:
    """An adapter in this process, and what it has sent."""

    def __init__(self, url: str) -> None:
        self._came: queue.Queue[dict[str, Any]] = queue.Queue()
        self.adapter = DebugSession(self._came.put, connect=RunningPage)
        self.attached = self.ask("attach", url=url)

    def ask(self, command: str, **arguments: object) -> dict[str, Any]:
        self.adapter.handle({"type": "request", "seq": 1, "command": command, "arguments": arguments})
        return self.until(lambda message: message.get("command") == command)

    def event(self, name: str) -> dict[str, Any]:
        body: dict[str, Any] = self.until(lambda message: message.get("event") == name)["body"]
        return body

    def until(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        while not wanted(message := self._came.get(timeout=300)):
            pass
        return message

    @property
    def cycle(self) -> int:
        frame = self.ask("stackTrace", threadId=1)["body"]["stackFrames"][0]
        return int(frame["name"].split("cycle ")[1].split(",")[0])


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Running]:
    (tmp_path / "main.asm").write_text(SOURCE)
    server = Running(lambda progress: load_subject(tmp_path / "main.asm", Setting(), progress))
    yield server
    if server.running:
        server.stop()


@pytest.fixture
def page(server: Running) -> Iterator[ClientConnection]:
    with server.socket() as page:
        page.send("{}")
        shown(page)
        yield page


def shown(page: ClientConnection) -> dict[str, Any]:
    """The next whole moment that the page shows."""
    while "chip" not in (message := json.loads(page.recv(timeout=300))) or message["is"] != "now":
        pass
    return dict(message)


def test_the_editor_and_the_page_are_at_one_moment_of_one_chip(
    server: Running, page: ClientConnection
) -> None:
    editor = Editor(server.server.url)
    assert editor.attached["success"]
    editor.event("initialized")
    given = {"source": {"path": "main.asm"}, "breakpoints": [{"line": 6, "hitCondition": "3"}]}
    assert editor.ask("setBreakpoints", **given)["body"]["breakpoints"][0]["verified"]
    editor.ask("configurationDone")
    editor.event("stopped")
    editor.ask("continue", threadId=1)
    assert editor.event("stopped")["reason"] == "breakpoint"
    assert editor.ask("evaluate", expression="turns")["body"]["result"] == "3"
    while (moment := shown(page))["running"]:
        pass
    assert moment["cycle"] == editor.cycle == 2 * 4 + 1
    page.send('{"do": "step", "what": "instruction", "count": -2}')
    assert editor.event("stopped")["reason"] == "pause"
    assert editor.cycle == 2 * 4 - 2 == shown(page)["cycle"]
    editor.ask("setVariable", name="turns", value="9", variablesReference=3)
    moment = shown(page)
    assert (moment["chip"]["ram"][:2], moment["intervened"]) == ("09", 6)
    editor.ask("disconnect")
    page.send('{"do": "run"}')
    assert shown(page)["running"], "the program goes on without the editor"


def test_what_the_page_lets_run_the_editor_can_pause_and_a_closed_server_ends_it(
    server: Running, page: ClientConnection
) -> None:
    editor = Editor(server.server.url)
    page.send('{"do": "run"}')
    editor.event("continued")
    editor.ask("pause", threadId=1)
    assert editor.event("stopped")["reason"] == "pause"
    editor.ask("reverseContinue", threadId=1)
    assert editor.event("stopped")["text"] == "power-up"
    while (moment := shown(page))["running"] or moment["cycle"]:
        pass
    editor.ask("reverseContinue", threadId=1)
    assert editor.event("stopped")["reason"] == "entry", "told once"
    assert "another editor" in Editor(server.server.url).attached["message"]
    server.stop()
    editor.event("terminated")


def test_a_way_of_the_page_that_an_editor_ends_is_shown_where_it_ended(tmp_path: Path) -> None:
    (tmp_path / "main.asm").write_text(SOURCE)
    session = WatchSession(load_subject(tmp_path / "main.asm", Setting(), lambda text: None))
    assert [each["is"] for each in session.handle({"do": "seek", "cycle": 10**15})] == ["going"]
    debugging = Debugging(session, lambda message: None)
    asked = {"command": "evaluate", "arguments": {"expression": "turns"}}
    shown = debugging.handle(asked)
    assert shown is not None and (shown["is"], shown["cycle"]) == ("now", session.now)
    assert debugging.handle(asked) is None, "nothing is another than before"


def test_what_breakpoints_print_is_bounded_and_a_page_stays_with_its_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A message in each turn of 4 cycles, at a speed of 1000: the page stops after a tenth of a second."""
    (tmp_path / "main.asm").write_text(SOURCE)
    session = WatchSession(load_subject(tmp_path / "main.asm", Setting(), lambda text: None))
    told: list[dict[str, Any]] = []
    debugging = Debugging(session, told.append)
    given: dict[str, Any] = {"source": {"path": "main.asm"}}
    given["breakpoints"] = [{"line": 6, "logMessage": "turn"}]
    debugging.handle({"command": "setBreakpoints", "arguments": given})
    times = iter([0.0, 1.0])
    monkeypatch.setattr("servogen.watch.session.time", SimpleNamespace(monotonic=lambda: next(times)))
    monkeypatch.setattr("servogen.dap.session.time", SimpleNamespace(monotonic=lambda: 0.5))
    (begun,) = session.handle({"do": "run", "running": True, "speed": 1000})
    list(session.tick(0.1))
    assert 2_000 <= session.now < 2_010
    assert (begun["behind"], session.shown()["behind"]) == (False, True), "the page says that it is slower"
    assert debugging.follow(session)
    debugging.handle({"command": "pause", "arguments": {}})
    lines = [each["body"]["output"] for each in told if each.get("event") == "output"]
    assert lines[:-1] == ["turn\n"] * 200
    assert lines[-1] == "(300 more lines were left out: 200 are printed in a second)\n"
    given["breakpoints"] = [{"line": 6, "logMessage": "x" * 1001}]
    debugging.handle({"command": "setBreakpoints", "arguments": given})
    assert "up to 1000 characters" in json.dumps(told[-1])


def test_an_editor_that_reads_nothing_is_disconnected_and_its_session_ends() -> None:
    sends: queue.Queue[Callable[[dict[str, Any]], None]] = queue.Queue()
    gone = Event()

    def attach(send: Callable[[dict[str, Any]], None]) -> Callable[[object], None]:
        sends.put(send)
        return lambda request: gone.set() if request is None else None

    with serving(attach) as url:
        place = url.removeprefix("http://")
        origin = Origin(f"http://{place.partition('/')[0]}")
        with connect(f"ws://{place}dap", origin=origin, close_timeout=0.1):
            send = sends.get(timeout=300)
            for _ in range(300):
                send({"text": "x" * 200_000})
                if gone.wait(0.001):
                    break
            assert gone.wait(300), "60 MB wait for it"


def test_a_page_whose_server_is_killed_ends_the_session() -> None:
    def killed(socket: ServerConnection) -> None:
        socket.recv()
        socket.socket.shutdown(SHUT_RDWR)

    with serve(killed, "127.0.0.1", 0) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        ended: queue.Queue[dict[str, Any]] = queue.Queue()
        page = RunningPage(f"http://127.0.0.1:{server.socket.getsockname()[1]}/token/", ended.put)
        assert page.send({})
        assert ended.get(timeout=300)["event"] == "terminated"
        assert not page.send({})


def test_nobody_attaches_without_the_address_that_the_person_was_given(
    server: Running, tmp_path: Path
) -> None:
    for url, why in (
        (f"http://{server.host}/wrong/", "403"),
        ("http://example.org:80/token/", "not a page on this machine"),
        ("http://127.0.0.1:x/", "not a page on this machine"),
        (server.server.url, "open the address in a browser first"),
    ):
        editor = Editor(url)
        assert not editor.attached["success"] and why in editor.attached["message"]
    refused = editor.ask("launch", program=str(tmp_path / "main.asm"))
    assert "the page's program only" in refused["message"], "the server reads no other file"
    assert server.handshake(Origin="http://example.org", socket="dap") == 403
