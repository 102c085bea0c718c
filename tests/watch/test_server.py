"""The server of `servogen watch`: who is let in, what is served, windows that keep their places."""

from __future__ import annotations

import asyncio
import gc
import http.client
import json
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("websockets", reason="the extra 'watch' is not installed")

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection

from servogen.errors import InputError
from servogen.pic.image import Image
from servogen.units import Clock
from servogen.watch import server as module
from servogen.watch.server import FILES, MAX_REQUEST_BYTES, MAX_SESSIONS, Room, WatchServer, Window
from servogen.watch.session import WatchSession
from servogen.watch.subject import Setting, Subject, load_subject
from tests.watch.browser import wait
from tests.watch.serving import Running

ROOT = Path(__file__).parent.parent.parent
HEX = ROOT / "firmware" / "lab8-exercise" / "main.hex"


def hex_subject(progress: Callable[[str], None]) -> Subject:
    return load_subject(HEX, Setting())


@pytest.fixture(scope="module")
def running() -> Iterator[Running]:
    served = Running(hex_subject)
    yield served
    served.stop()


def messages(socket: ClientConnection, until: str) -> list[dict[str, Any]]:
    """Every message up to the first of a kind."""
    found = []
    while not found or found[-1]["is"] != until:
        found.append(json.loads(socket.recv(timeout=300)))
    return found


def opened(socket: ClientConnection, name: str = "") -> list[dict[str, Any]]:
    socket.send(json.dumps({"window": name}))
    return messages(socket, "now")


def asked(socket: ClientConnection, kind: str = "now", **request: Any) -> dict[str, Any]:
    socket.send(json.dumps(request))
    return messages(socket, kind)[-1]


def test_the_page_and_its_files_are_served_to_who_has_the_address(running: Running) -> None:
    for name in FILES:
        status, text, headers = running.get(f"/{running.token}/{name}")
        assert status == 200 and text, name
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "script-src 'self'" in policy
        assert "unsafe" not in policy
        assert headers["Referrer-Policy"] == "no-referrer"


@pytest.mark.parametrize(
    ("headers", "what"),
    [
        ({"Origin": "http://evil.example"}, "a foreign origin"),
        ({"Origin": "null"}, "the origin of a file or a sandbox"),
        ({"Host": "evil.example"}, "a foreign host"),
        ({"Host": ""}, "no host"),
        ({"Sec-Fetch-Site": "cross-site"}, "a link on a foreign page"),
        ({"Sec-Fetch-Site": ""}, "neither an origin nor a word of where it comes from"),
    ],
)
def test_a_page_is_refused(running: Running, headers: dict[str, str], what: str) -> None:
    status, text, _ = running.get(f"/{running.token}/", **headers)
    assert status in (400, 403) if what == "no host" else status == 403
    assert "lab8" not in text and "<html" not in text


@pytest.mark.parametrize("token", ["", "x", "favicon.ico", "../"])
def test_a_wrong_token_is_refused_for_the_page(running: Running, token: str) -> None:
    for path in (f"/{token}", f"/{token}/", f"/{token}/app.js", f"/{running.token[:-1]}/"):
        assert running.get(path)[0] == 403


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": None},
        {"Origin": "null"},
        {"Origin": "https://127.0.0.1"},
    ],
)
def test_a_socket_of_a_foreign_or_unknown_origin_is_refused(
    running: Running, headers: dict[str, str | None]
) -> None:
    with pytest.raises(InvalidStatus) as refused, running.socket(**headers):
        pass
    assert refused.value.response.status_code == 403


def test_a_socket_with_a_wrong_token_is_refused(running: Running) -> None:
    for token in ("x", "", running.token[:-1], running.token + "x"):
        with pytest.raises(InvalidStatus) as refused, running.socket(token):
            pass
        assert refused.value.response.status_code == 403


def test_a_socket_with_a_foreign_host_is_refused(running: Running) -> None:
    """The name leads to this machine, as that of a page may that rebinds it; its origin is its own."""
    assert running.handshake(Host="evil.example", Origin="http://evil.example") == 403


@pytest.mark.parametrize(
    "name",
    [
        "../../pyproject.toml",
        "..%2f..%2fpyproject.toml",
        "/etc/passwd",
        "app.js/../../x",
        "main.hex",
        ".",
        "socket",
    ],
)
def test_no_other_file_is_served(running: Running, name: str) -> None:
    status, text, _ = running.get(f"/{running.token}/{name}")
    assert status == 404
    assert "servogen" not in text


def test_the_address_is_this_machine_only(running: Running) -> None:
    assert running.host.startswith("127.0.0.1:")
    assert len(running.token) >= 32


def test_nothing_is_said_before_the_window_says_who_it_is(running: Running) -> None:
    with running.socket() as socket, pytest.raises(TimeoutError):
        socket.recv(timeout=0.2)


def test_windows_have_places_of_their_own_and_a_reload_keeps_them(running: Running) -> None:
    with running.socket() as first, running.socket() as second:
        name = opened(first)[0]["name"]
        other = opened(second)[0]["name"]
        assert name != other
        assert asked(first, do="seek", cycle=123_456)["cycle"] in (123_456, 123_457)
        assert asked(second, do="seek", cycle=5000)["cycle"] in (5000, 5001)
        assert asked(first, do="step", what="instruction", count=-1)["cycle"] in range(123_453, 123_457)
    with running.socket() as again:
        found = opened(again, name)
        assert found[0]["name"] == name
        assert found[-1]["cycle"] in range(123_453, 123_457)


def test_a_window_that_is_copied_begins_where_the_other_is(running: Running) -> None:
    with running.socket() as first, running.socket() as copy:
        name = opened(first)[0]["name"]
        here = asked(first, do="seek", cycle=40_000)["cycle"]
        found = opened(copy, name)
        assert found[0]["name"] != name
        assert found[-1]["cycle"] == here
        asked(copy, do="seek", cycle=7)
        assert asked(first, do="run", running=False)["cycle"] == here


def test_it_runs_at_the_chosen_speed_until_it_is_paused(running: Running) -> None:
    with running.socket() as socket:
        opened(socket)
        asked(socket, do="run", running=True, speed=None)
        before = messages(socket, "now")[-1]["cycle"]
        after = messages(socket, "now")[-1]
        assert after["running"] and after["cycle"] > before
        paused = asked(socket, do="run", running=False)
        while paused["running"]:
            paused = messages(socket, "now")[-1]
        with pytest.raises(TimeoutError):
            socket.recv(timeout=0.2)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '"run"',
        "[" * 5000,
        '{"do": "fly"}',
        '{"do": "seek"}',
        '{"do": "seek", "cycle": "x"}',
        '{"do": "step", "what": "__class__"}',
        '{"do": "waves", "begin": -5, "end": 1e400}',
        '{"do": "pin", "pin": "VDD", "level": 1}',
        '{"do": "pin", "pin": "RB0", "level": 7}',
        '{"do": "serial", "pin": "RB0", "baud": 0, "bytes": [1]}',
        '{"do": "serial", "pin": "RB0", "baud": 2400, "bytes": [999]}',
        '{"do": "breakpoint", "text": "__import__(1)", "on": true}',
        '{"do": "save", "text": "x"}',
        '{"do": "build", "text": "x"}',
    ],
)
def test_a_wrong_request_is_answered_and_the_window_goes_on(running: Running, text: str) -> None:
    with running.socket() as socket:
        opened(socket)
        socket.send(text)
        assert messages(socket, "problem")[-1]["text"]
        assert asked(socket, do="seek", cycle=9)["cycle"] in (9, 10)


def test_a_defect_of_a_session_does_not_end_the_server(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    with running.socket() as socket:
        opened(socket)
        with monkeypatch.context() as broken:
            broken.setattr(WatchSession, "run_on", lambda *_: 1 / 0)
            socket.send(json.dumps({"do": "run", "running": True}))
            assert "ZeroDivisionError" in messages(socket, "problem")[-1]["text"]
        assert not asked(socket, do="seek", cycle=9)["running"]


def test_a_program_that_crashes_does_not_end_the_server() -> None:
    """A chip that wraps its stack and executes words that no data sheet defines."""
    wild = Image({address: 0x0001 if address % 3 else 0x2000 for address in range(1024)}, 0x3FFF)
    served = Running(lambda progress: Subject(Path("wild.hex"), Clock(4_000_000), image=wild))
    try:
        with served.socket() as socket:
            opened(socket)
            chip = asked(socket, do="seek", cycle=100_000)["chip"]
            assert chip["warnings"] and chip["deepest"] == 8
    finally:
        served.stop()


def test_a_job_that_cannot_be_loaded_is_said_in_the_page() -> None:
    def fail(progress: Callable[[str], None]) -> Subject:
        raise InputError("does-not-fit", "the motion is too long for the chip")

    served = Running(fail)
    try:
        with served.socket() as socket:
            socket.send(json.dumps({"window": ""}))
            status = messages(socket, "status")[-1]
            while not status.get("failed"):
                status = messages(socket, "status")[-1]
            assert "too long for the chip" in status["text"]
    finally:
        served.stop()


def test_an_old_window_is_forgotten_only_after_many() -> None:
    served = Running(hex_subject)
    try:
        names = []
        for _ in range(20):
            with served.socket() as socket:
                socket.send(json.dumps({"window": ""}))
                names.append(messages(socket, "window")[-1]["name"])
        with served.socket() as socket:
            socket.send(json.dumps({"window": names[-1]}))
            assert messages(socket, "window")[-1]["name"] == names[-1]
        with served.socket() as socket:
            socket.send(json.dumps({"window": names[0]}))
            assert messages(socket, "window")[-1]["name"] != names[0]
    finally:
        served.stop()


def test_a_window_of_a_server_that_has_ended_comes_back_also_before_anything_is_loaded() -> None:
    go = threading.Event()

    def load(progress: Callable[[str], None]) -> Subject:
        assert go.wait(300)
        return hex_subject(progress)

    served = Running(load)
    try:
        with served.socket() as socket:
            place = {"window": "of the other server", "cycle": 123_456, "breakpoints": ["RB0 rise"]}
            socket.send(json.dumps(place))
            assert messages(socket, "status")
            go.set()
            now = messages(socket, "now")[-1]
            assert now["cycle"] in (123_456, 123_457) and now["breakpoints"] == ["RB0 rise"]
    finally:
        go.set()
        served.stop()


@pytest.mark.campaign
def test_two_hundred_windows_leave_nothing_behind() -> None:
    """Each has its chip with snapshots while it is open; afterwards a few are kept that may be reloaded."""
    served = Running(hex_subject)
    try:
        with served.socket() as socket:
            opened(socket)
        before = resident_mb()
        with ExitStack() as sockets:
            for _ in range(200):
                last = sockets.enter_context(served.socket())
                opened(last)
            assert asked(last, do="run", running=True)["running"]
            assert json.loads(last.recv(timeout=300))["cycle"] > 0, "time passes in the last one too"
            assert served.get(f"/{served.token}/")[0] == 200
        room = served.server.rooms[""]
        wait(lambda: len(room.windows) <= MAX_SESSIONS)
        gc.collect()
        assert resident_mb() - before < 60
    finally:
        served.stop()


def resident_mb() -> float:
    """The memory of this process in MB (Linux; elsewhere 0)."""
    memory = Path("/proc/self/statm")
    return int(memory.read_text().split()[1]) * 4096 / 1e6 if memory.exists() else 0.0


def test_what_is_too_large_ends_its_own_connection_only(running: Running) -> None:
    with running.socket() as other, running.socket() as socket:
        opened(other)
        opened(socket)
        socket.send("x" * (MAX_REQUEST_BYTES + 1))
        with pytest.raises(ConnectionClosed) as closed:
            while True:
                socket.recv(timeout=300)
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 1009
        assert asked(other, do="step", what="frame")["is"] == "now"
    with suppress(OSError, http.client.HTTPException):  # it is cut off
        assert running.get(f"/{running.token}/", Cookie="x" * 100_000)[0] >= 400
    assert running.get(f"/{running.token}/")[0] == 200


def test_a_window_that_never_reads_holds_up_nobody(running: Running) -> None:
    """Its messages end in the buffers of its own connection."""
    with running.socket() as lazy, running.socket() as other:
        lazy.close_timeout = 0.1
        opened(lazy)
        opened(other)
        for _ in range(500):
            lazy.send(json.dumps({"do": "waves", "begin": 0, "end": 4_000_000}))
        assert asked(other, "explanation", do="explain", pin="RB0")["lines"]
        room = running.server.rooms[""]
        open_ = [window.socket for window in room.windows.values() if window.socket]
        assert max(each.transport.get_write_buffer_size() for each in open_) < 3 * MAX_REQUEST_BYTES


# Rooms, without a network


class Socket:
    """A window that notes what it is sent; `waiting` bytes of earlier messages are not read yet."""

    def __init__(self, waiting: int = 0) -> None:
        self.sent: list[dict[str, Any]] = []
        self.transport = SimpleNamespace(get_write_buffer_size=lambda: waiting)

    async def send(self, text: str) -> None:
        self.sent.append(json.loads(text))


def room_of(windows: dict[str, Any], load: Any = hex_subject, editor: Any = None) -> Room:
    room = Room(load, editor)
    room.windows = windows
    return room


async def sent(room: Room) -> None:
    """Let a room send everything."""
    while room.busy:
        await asyncio.sleep(0)


def test_time_passes_only_in_windows_that_are_open_and_loaded() -> None:
    async def main() -> None:
        session: Any = SimpleNamespace(tick=lambda elapsed: iter([{"elapsed": elapsed}]))
        seen, empty = Socket(), Socket()
        shown: Any = {"a": Window(session, seen), "b": Window(session), "c": Window(None, empty)}  # type: ignore[arg-type]
        room = room_of(shown)
        assert room.watched and not room_of({"b": shown["b"]}).watched and not room_of({}).watched
        room.tick(0.5)
        await sent(room)
        assert (seen.sent, empty.sent) == ([{"elapsed": 0.5}], [])

    asyncio.run(main())


def test_a_window_that_does_not_read_misses_messages() -> None:
    async def main() -> None:
        for waiting, count in ((MAX_REQUEST_BYTES, 0), (MAX_REQUEST_BYTES - 1, 1)):
            socket: Any = Socket(waiting)
            room = room_of({"a": Window(None, socket)})
            room.say({"is": "status"})
            await sent(room)
            assert len(socket.sent) == count

    asyncio.run(main())


def test_a_defect_while_loading_is_said_and_a_room_can_be_started_again() -> None:
    async def main() -> None:
        def load(progress: Callable[[str], None]) -> Subject:
            raise ZeroDivisionError("x")

        socket: Any = Socket()
        room = room_of({"a": Window(None, socket)}, load)
        assert not room.started
        for _ in range(2):
            room.start()
            assert room.started
        while not socket.sent:
            await asyncio.sleep(0)
        await sent(room)
        text = "a defect of servogen: ZeroDivisionError('x')"
        assert socket.sent == [{"is": "status", "failed": True, "text": text}], "it is loaded once"
        room.stop()
        assert not room.started and not room.watched
        refused: Any = Socket()
        room.refuse(refused, "full")
        await sent(room)
        assert refused.sent == [{"is": "status", "failed": True, "text": "full"}]

    asyncio.run(main())


def test_a_room_that_is_stopped_loads_no_more() -> None:
    async def main() -> None:
        go = threading.Event()

        def load(progress: Callable[[str], None]) -> Subject:
            go.wait(60)
            return hex_subject(progress)

        room = room_of({}, load)
        room.start()
        loading = room.loading
        await asyncio.sleep(0)
        room.stop()
        go.set()
        assert loading is not None
        with pytest.raises(asyncio.CancelledError):
            await loading

    asyncio.run(main())


def started(used: float, *, watched: bool) -> Room:
    """Return a room that is loaded, with or without a window."""
    socket: Any = Socket() if watched else None
    room = room_of({"a": Window(None, socket)})
    loading: Any = SimpleNamespace(cancel=lambda: None)
    room.loading, room.used = loading, used
    return room


def test_the_room_that_was_left_first_makes_place_for_another_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_ROOMS", 2)
    for watched, left in (((False, False), [0]), ((True, False), [0]), ((False, True), [1])):
        rooms = [started(used, watched=each) for used, each in zip((5.0, 3.0), watched, strict=True)]
        server = WatchServer({"0": rooms[0], "1": rooms[1], "2": Room(hex_subject)})
        assert server.may_start()
        assert [number for number, room in enumerate(rooms) if room.started] == left
        assert server.may_start() and len(left) == 1, "now there is a place"
        assert [number for number, room in enumerate(rooms) if room.started] == left
    full = WatchServer({str(used): started(used, watched=True) for used in (3.0, 5.0)})
    assert not full.may_start()


def test_eight_programs_of_a_class_are_loaded_at_a_time() -> None:
    """As docs/grading.md says."""
    rooms = {str(used): started(used, watched=True) for used in range(8)}
    assert not WatchServer(rooms).may_start()
    del rooms["3"]
    assert WatchServer(rooms).may_start()
    assert all(room.started for room in rooms.values())


def test_a_job_that_was_built_is_shown_in_every_window_and_a_defect_is_said() -> None:
    async def main() -> None:
        built = Subject(Path("x.hex"), Clock(4_000_000), image=Image({0: 0x2800}))
        answers: list[Any] = [ZeroDivisionError("x"), ({"is": "checked"}, None), ({"is": "built"}, built)]

        def handle(message: Any, stop: Any) -> Any:
            answer = answers.pop(0)
            if isinstance(answer, Exception):
                raise answer
            return answer

        mine, other = Socket(), Socket()
        windows: Any = {"a": Window(None, mine), "b": Window(None, other)}  # type: ignore[arg-type]
        opened = {"is": "editor", "text": "what was built", "saved": True}
        editor: Any = SimpleNamespace(handle=handle, opened=lambda: opened)
        room = room_of(windows, editor=editor)
        for _ in range(3):
            await room.edit(windows["a"], {"do": "build", "number": 7})
            await sent(room)
        kinds = [message["is"] for message in mine.sent]
        defect = "a defect of servogen: ZeroDivisionError('x')"
        assert mine.sent[0] == {"is": "problem", "text": defect, "about": "build", "number": 7}
        shown = ["status", "model", "now"]
        assert kinds[1:6] == ["checked", "built", *shown]
        assert [message["is"] for message in other.sent[1:4]] == shown
        assert other.sent[0] == opened
        room = room_of(windows)
        await room.edit(windows["b"], {"do": "save"})
        await sent(room)
        assert other.sent[-1] == {"is": "problem", "text": "only a job file can be changed here"}

    asyncio.run(main())


def test_time_passes_as_the_clock_says() -> None:
    ticks: list[float] = []
    moments = iter((10.0, 10.5, 11.25))
    pauses: list[float] = []

    async def sleep(seconds: float) -> None:
        pauses.append(seconds)
        if len(pauses) == 3:
            raise asyncio.CancelledError

    room: Any = SimpleNamespace(tick=ticks.append)
    ticking = WatchServer({"": room}).ticking(lambda: next(moments), sleep)
    with pytest.raises(asyncio.CancelledError):
        ticking.send(None)
    assert ticks == [0.5, 0.75]


def test_a_stop_does_not_wait_for_a_build() -> None:
    """While the editor works, the pins are held and the chip is shown; its answer comes later."""
    gate = threading.Event()

    def handle(message: Any, stop: Any) -> Any:
        assert gate.wait(60)
        return {"is": "checked", "diagnostics": [], "good": False}, None

    editor: Any = SimpleNamespace(
        handle=handle, opened=lambda: {"is": "editor", "name": "x", "text": "", "saved": True}
    )
    served = Running(hex_subject, editor)
    try:
        with served.socket() as socket:
            opened(socket)
            socket.send(json.dumps({"do": "build", "text": "", "over": ""}))
            held = asked(socket, do="pin", pin="RA0", level=1)
            assert held["chip"]["outside"][0] == 1 and not gate.is_set()
            gate.set()
            assert messages(socket, "checked")
    finally:
        gate.set()
        served.stop()


def test_a_newer_text_ends_the_plan_of_the_older_one_and_a_build_can_be_stopped() -> None:
    """The plan of a text that takes forever is not waited for; only the newest text is answered."""
    gate = threading.Event()

    def handle(message: Any, stop: threading.Event) -> Any:
        if message["text"] == "soon":
            assert gate.wait(60)
        if "forever" in message["text"]:
            assert stop.wait(60)
            return {"is": "stopped", "saved": True}, None
        return {"is": "checked", "diagnostics": [], "good": True}, None

    editor: Any = SimpleNamespace(
        handle=handle, opened=lambda: {"is": "editor", "name": "x", "text": "", "saved": True}
    )
    served = Running(hex_subject, editor)
    try:
        with served.socket() as socket:
            opened(socket)
            for number, text in enumerate(("forever", "forever and ever", "short")):
                socket.send(json.dumps({"do": "check", "text": text, "number": number}))
            seen = messages(socket, "checked")
            assert seen[-1]["number"] == 2 and not [each for each in seen if each["is"] == "stopped"]
            socket.send(json.dumps({"do": "build", "text": "forever", "over": ""}))
            socket.send(json.dumps({"do": "check", "text": "short", "number": 3}))
            assert messages(socket, "checked")[-1]["number"] == 3, "no check waits for a build"
            socket.send(json.dumps({"do": "check", "text": "soon", "number": 4}))
            socket.send(json.dumps({"do": "stop"}))
            assert messages(socket, "stopped")[-1]["saved"]
            gate.set()
            assert messages(socket, "checked")[-1]["number"] == 4, "the plan is still wanted"
    finally:
        gate.set()
        served.stop()


def test_it_is_said_what_is_proven_and_a_far_moment_is_near_once_the_repetition_is_known() -> None:
    """Of lab 8 without a certificate beside it; the room tells every session, and those that come later."""
    job = ROOT / "jobs" / "lab8-exercise.toml"
    served = Running(lambda progress: load_subject(job, Setting(), progress))
    try:
        with served.socket() as socket:
            opened(socket)
            while not (text := messages(socket, "theorem")[-1]["text"]):
                pass  # it is not known yet
            assert text.startswith("all runs: ")
            for hour in (20, 47, 3):
                moment = hour * 3600 * 10**6
                socket.send(json.dumps({"do": "seek", "cycle": moment}))
                assert messages(socket, "now")[-1]["cycle"] - moment in range(3)
    finally:
        served.stop()
