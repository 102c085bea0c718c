"""The web server of `servogen watch`: pages and a socket for each window, on this machine only.

In: rooms, each with what loads its subject, and finished pages of a class. Out: pages at
http://127.0.0.1:PORT/TOKEN/, until the command ends.

Whoever may not see the job is answered 403 before anything of it is read: a request without the token, with
the Host or the Origin of another site (a name that leads here, a page elsewhere), and one that says neither
that it comes from this page nor that a person typed it. What may be asked for is in tables: the files of
`templates/watch/`, by name, in the folder of each room, and the pages; no path reaches the disk.
"""

from __future__ import annotations

import asyncio
import ctypes
import gc
import json
import secrets
import time
from collections.abc import Awaitable, Callable, Coroutine, Iterator, Mapping
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field
from http import HTTPStatus
from threading import Event
from types import MappingProxyType
from typing import Any, Never
from urllib.parse import unquote

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from servogen.debug.time_machine import Repetition
from servogen.errors import InputError, ServogenError
from servogen.report.viewer import viewer_module
from servogen.template_files import template_folder
from servogen.watch.debugging import Debugging
from servogen.watch.editing import Editor
from servogen.watch.live_line import LiveLine
from servogen.watch.session import Message, WatchSession, find_repetition
from servogen.watch.subject import Subject, proven_sentence

LOOPBACK = "127.0.0.1"
PICTURES_PER_S = 15
"""The number of moments a second that a running window is told; in between the page moves its servos."""
MAX_SESSIONS = 16
"""The maximum number of sessions of closed windows that are kept in case they are reloaded."""
MAX_ROOMS = 8
"""The maximum number of a class's programs loaded at a time; those without a window are unloaded first."""
CLOSING_S = 1.0
MAX_REQUEST_BYTES = 2 << 20
"""The maximum size of a request, which may contain the whole text of a job."""
MAX_WAITING = 2 << 20
"""The characters for an editor that may wait until it reads them."""

FILES: Mapping[str, str] = MappingProxyType(
    {
        "": "index.html",
        "colours.css": "colours.css",
        "style.css": "style.css",
        **{
            f"{name}.js": f"{name}.js"
            for name in (
                *("app", "chip", "console", "dom", "editor", "hands", "links", "moment", "plan"),
                *("source", "timeline", "twin", "viewer"),
            )
        },
    }
)
"""The names served in a room's folder, and their files in `templates/watch/`, or `VIEWER`."""

VIEWER = "viewer.js"
"""The module that is joined from several files, as in pages without a server."""

DEBUGGER = "dap"
"""The socket of an editor, in each room's folder."""
SOCKETS = ("socket", DEBUGGER)

TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript"}

Load = Callable[[Callable[[str], None]], Subject]
"""Loads the subject and reports its progress. Raises ServogenError."""

Attach = Callable[[Callable[[Message], None]], Callable[[Message | None], None]]
"""What `Room.attach` is."""


@dataclass(frozen=True, slots=True)
class Page:
    """A finished page: its type, and its text, whose own scripts and styles carry the nonce given."""

    kind: str
    text: Callable[[str], str]


@dataclass(slots=True)
class Window:
    """A session and the socket that shows it, if any does just now."""

    session: WatchSession | None = None
    socket: ServerConnection | None = None
    unwanted: dict[str, Event] = field(default_factory=dict)
    """What ends a check or a build that goes on for this window."""
    debugging: Debugging | None = None
    """The editor that is attached."""
    place: Mapping[str, Any] = field(default_factory=dict)
    """Where its page was on a server that has ended: the cycle and the breakpoints."""

    @property
    def alive(self) -> bool:
        """Return whether simulated time passes in the window."""
        return self.socket is not None or self.debugging is not None

    def end_work(self, *kinds: str) -> None:
        """End the work of some kinds: "check", "save", "build"."""
        for kind in kinds:
            if kind in self.unwanted:
                self.unwanted[kind].set()


class Room:
    """What is watched, once it is loaded, and the windows that show it."""

    def __init__(self, load: Load, editor: Editor | None = None, live: LiveLine | None = None) -> None:
        self._load = load
        self._editor = editor
        self._live = live
        self._subject: Subject | None = None
        self._status: Message = {"is": "status", "text": "starting"}
        self._theorem: Message = {"is": "theorem", "text": ""}
        self._repetition: Repetition | None = None
        self._learning = False
        self._forgotten = 0
        """The number of windows whose memory the system does not have back yet."""
        self.windows: dict[str, Window] = {}
        self._tasks: set[asyncio.Future[None]] = set()
        self._editing = asyncio.Lock()
        self.loading: asyncio.Task[None] | None = None
        self.used = 0.0
        """The time at which a window was last opened."""

    @property
    def started(self) -> bool:
        return self.loading is not None

    @property
    def watched(self) -> bool:
        """Return whether a window is open."""
        return any(window.alive for window in self.windows.values())

    @property
    def busy(self) -> bool:
        """Return whether something is still being sent or edited."""
        return bool(self._tasks)

    def start(self) -> None:
        """Begin to load the subject."""
        if self.loading is None:
            self.loading = asyncio.create_task(self._load_subject())

    def stop(self) -> None:
        """Forget the subject and the windows; the room can be started again."""
        if self.loading is not None:
            self.loading.cancel()
        for window in self.windows.values():
            window.end_work("check", "save", "build")
        self.loading, self._subject, self.windows = None, None, {}

    def refuse(self, window: ServerConnection, text: str) -> None:
        """Say why nothing is shown."""
        self._send(Window(None, window), {"is": "status", "failed": True, "text": text})

    async def _load_subject(self) -> None:
        """Load the subject in a thread, so that the page can say what is being done."""
        loop = asyncio.get_running_loop()

        def progress(text: str) -> None:
            loop.call_soon_threadsafe(self.say, {"is": "status", "text": text})

        try:
            subject = await asyncio.to_thread(self._load, progress)
        except ServogenError as error:
            self.say({"is": "status", "failed": True, "text": str(error)})
            return
        except Exception as error:  # a defect: the page reports it, and the server continues
            self.say({"is": "status", "failed": True, "text": f"a defect of servogen: {error!r}"})
            return
        self._show(subject)

    async def _find_theorem(self, subject: Subject) -> None:
        """Find out, while the subject is shown, what is proven of it."""
        text = await asyncio.to_thread(proven_sentence, subject)
        if text and subject is self._subject:
            self._theorem = {"is": "theorem", "text": text}
            for window in self.windows.values():
                self._send(window, self._theorem)

    async def _learn(self, subject: Subject) -> None:
        """Find out, while the subject is shown, what it does again and again."""
        repetition = await asyncio.to_thread(find_repetition, subject)
        if subject is self._subject:
            self._repetition, self._learning = repetition, False
            for window in self.windows.values():
                if window.session is not None and window.session.subject is subject:
                    window.session.knows(repetition)

    def _show(self, subject: Subject) -> None:
        """Show another subject in every window, at the moment where each is."""
        self._subject, self._repetition, self._learning = subject, None, True
        self._theorem = {"is": "theorem", "text": ""}
        self.say({"is": "status", "text": ""})
        for window in self.windows.values():
            self._present(window, self._session(window.session, subject, window.place))
        self._begin(self._find_theorem(subject))
        self._begin(self._learn(subject))

    def _session(
        self, before: WatchSession | None, subject: Subject, place: Mapping[str, Any]
    ) -> WatchSession:
        """Return a session of the subject at the moment of another one, at a place, or at its own first."""
        if before is not None:
            return self._showing(before, subject, before.subject.shown)
        session = WatchSession(subject, self._live, self._repetition, learning=self._learning)
        if place.get("cycle"):
            session.come_back(place)
        return session

    def _showing(self, before: WatchSession, subject: Subject, chip: int) -> WatchSession:
        """Return a session of one chip of the subject at the moment of another one.

        What the program does again and again is known only with the subject's own first chip shown.
        """
        shown = subject.showing(chip)
        if shown is subject:
            return before.continued(subject, self._repetition, learning=self._learning)
        return before.continued(shown)

    def _turn(self, window: Window, session: WatchSession, chip: object) -> None:
        """Show the chip of that number, from 1 on, in a window."""
        if self._subject is None or self._subject.pair is None or chip not in (1, 2):
            self._send(window, {"is": "problem", "text": f"there is no chip {str(chip)[:40]}"})
            return
        self._present(window, self._showing(session, self._subject, 0 if chip == 1 else 1))

    def _present(self, window: Window, session: WatchSession) -> None:
        """Show a session in a window: what stays the same, then its moment or how far the way to it is."""
        window.session = session
        self._send(window, session.model())
        self._send(window, session.there())

    def say(self, message: Message) -> None:
        self._status = message
        for window in self.windows.values():
            self._send(window, message)

    def _send(self, window: Window, message: Message) -> None:
        """Send without waiting: a window that does not read its messages misses some."""
        socket = window.socket
        if socket is not None and socket.transport.get_write_buffer_size() < MAX_REQUEST_BYTES:
            self._begin(_sent(socket, json.dumps(message, separators=(",", ":"))))

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        """Have something done while other requests are answered."""
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def tick(self, elapsed: float) -> None:
        """Let the simulated time of every running window pass."""
        for window in list(self.windows.values()):
            if window.session is not None and window.alive:
                self._answer(window, _guard(window.session, lambda s: s.tick(elapsed)))

    def _answer(self, window: Window, messages: Iterator[Message]) -> None:
        for message in messages:
            self._send(window, message)
        if window.debugging is not None and not window.debugging.follow(window.session):
            window.debugging = None

    def attach(self, send: Callable[[Message], None]) -> Callable[[Message | None], None]:
        """Let an editor debug the program of the window that was opened last.

        Return what takes its requests, None where it has gone; `send` takes what answers them.
        """
        opened = (each for each in reversed(self.windows.values()) if each.socket is not None)
        window = next(opened, Window())
        debugging = Debugging(window.session, send)
        if debugging.session is not None:
            window.debugging = debugging

        def take(request: Message | None) -> None:
            if request is not None:
                message = debugging.handle(request)
                if message is not None:
                    self._send(window, message)
                return
            debugging.end()
            if window.debugging is debugging:
                window.debugging = None

        return take

    async def debug(self, socket: ServerConnection) -> None:
        """Serve an editor until it or the program ends; one that does not read is disconnected."""
        loop = asyncio.get_running_loop()
        waiting = 0

        async def sent(text: str) -> None:
            nonlocal waiting
            if waiting > MAX_WAITING:
                socket.transport.abort()  # a close would wait, too
            waiting += len(text)
            await _sent(socket, text)
            waiting -= len(text)

        def send(message: Message) -> None:
            loop.call_soon_threadsafe(self._begin, sent(json.dumps(message)))

        take = self.attach(send)
        try:
            async for text in socket:
                await asyncio.sleep(0)
                take(dict(_request(text)))
        except ConnectionClosed:
            pass
        finally:
            take(None)

    async def serve(self, socket: ServerConnection) -> None:
        """Serve one window until it is closed. Its session stays, for when it is loaded again."""
        window = None
        try:
            async for text in socket:
                await asyncio.sleep(0)  # one request of each window in turn, however many have come
                message = _request(text)
                if window is None:
                    window = self._open_window(str(message.get("window", ""))[:64], socket, message)
                    continue
                if message.get("do") == "stop":
                    window.end_work("save", "build")
                elif message.get("do") in ("check", "save", "build", "record", "pose"):
                    self._begin(self.edit(window, message))  # a stop must not wait for a build
                elif window.session is not None and message.get("do") == "chip":
                    self._turn(window, window.session, message.get("number"))
                elif window.session is not None:
                    self._answer(window, _guard(window.session, lambda s: s.handle(message)))  # noqa: B023
        except ConnectionClosed:
            pass
        finally:
            if window is not None and window.socket is socket:
                window.socket = None
                window.end_work("check")
                self._forget()

    def _open_window(
        self, name: str, socket: ServerConnection, place: Mapping[str, Any] = MappingProxyType({})
    ) -> Window:
        """Return the window of that name as it was; a new one where none is, or where it is open already.

        A window of a server that has ended comes back at its `place`, also where nothing is loaded yet.
        """
        window = self.windows.get(name)
        if window is None or window.socket is not None:
            before, place = (None, place) if window is None else (window.session, {})
            window = Window(place=place)
            if self._subject is not None:
                window.session = self._session(before, self._subject, place)
            name = secrets.token_urlsafe(12)
        self.windows[name] = self.windows.pop(name, window)  # the last one opened is the last one
        window.socket = socket
        self._forget()
        self._send(window, {"is": "window", "name": name})
        self._send(window, self._status)
        if self._editor is not None:
            self._send(window, self._editor.opened())
        if window.session is not None:
            self._present(window, window.session)
            self._send(window, self._theorem)
        return window

    def _forget(self) -> None:
        closed = [name for name, window in self.windows.items() if not window.alive]
        gone = closed[: max(0, len(self.windows) - MAX_SESSIONS)]
        for name in gone:
            del self.windows[name]
        self._forgotten += len(gone)
        if self._forgotten >= MAX_SESSIONS:
            self._forgotten = 0
            _return_memory()

    async def edit(self, window: Window, message: Mapping[str, Any]) -> None:
        """Check, save, extend or build the job, in a thread. A check ends the one before it."""
        if self._editor is None:
            self._send(window, {"is": "problem", "text": "only a job file can be changed here"})
            return
        kind, stop = str(message.get("do")), Event()
        writes = kind in ("save", "build")
        if not writes and kind in window.unwanted:
            window.unwanted[kind].set()
        if writes and kind in window.unwanted:
            return  # it is being done
        window.unwanted[kind] = stop
        try:
            # Of those that write, one at a time: each goes on from the file that the one before has left.
            async with self._editing if writes else nullcontext():
                answer, subject = await asyncio.to_thread(self._editor.handle, message, stop)
        except Exception as error:
            text = f"a defect of servogen: {error!r}"
            answer, subject = {"is": "problem", "text": text, "about": kind}, None
        finally:
            if window.unwanted.get(kind) is stop:
                del window.unwanted[kind]
        if kind == "check" and stop.is_set():
            return  # a newer text is being checked
        self._send(window, answer | {"number": message.get("number")})
        if answer.get("saved") or answer["is"] == "built":  # the other windows see the same file
            for other in self.windows.values():
                if other is not window:
                    self._send(other, self._editor.opened())
        if subject is not None:
            self._show(subject)


class DebuggerRoom(Room):
    """A room for a chip that runs elsewhere: an editor attaches to it there, a browser gets a sentence."""

    def __init__(self, attach: Attach) -> None:
        super().__init__(_nothing_to_see)
        self._attach = attach

    def attach(self, send: Callable[[Message], None]) -> Callable[[Message | None], None]:
        return self._attach(send)


def _nothing_to_see(progress: Callable[[str], None]) -> Never:
    raise InputError("not-allowed", "here an editor debugs the chip of a bench: docs/editors.md")


class WatchServer:
    """The server's state: its rooms and pages, each by its place below the token."""

    def __init__(self, rooms: Mapping[str, Room], pages: Mapping[str, Page] = MappingProxyType({})) -> None:
        """Serve each room's page in the folder that it is named by; "": right below the token."""
        self.rooms = rooms
        self._pages = pages
        self.token = secrets.token_urlsafe(24)
        self.port = 0

    @property
    def url(self) -> str:
        return f"http://{LOOPBACK}:{self.port}/{self.token}/"

    async def run(self, port: int, ready: Callable[[str], None]) -> None:
        """Serve until it is cancelled; `ready` is called with the page's address."""
        server = await serve(
            self._window,
            LOOPBACK,
            port,
            process_request=self._respond,
            max_size=MAX_REQUEST_BYTES,
            compression=None,  # on this machine it costs more than it saves
            ping_interval=None,  # and a connection ends with its other end, however slow that is
            server_header=None,
        )
        self.port = next(iter(server.sockets)).getsockname()[1]
        ready(self.url)
        if "" in self.rooms:
            self.rooms[""].start()
        try:
            await self.ticking()
        finally:
            for room in self.rooms.values():
                room.stop()
            server.close()
            with suppress(TimeoutError):  # a browser keeps connections open on which it never asks
                await asyncio.wait_for(server.wait_closed(), CLOSING_S)

    async def ticking(
        self,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
    ) -> None:
        last = clock()
        while True:
            await sleep(1 / PICTURES_PER_S)
            now = clock()
            elapsed, last = now - last, now
            for room in self.rooms.values():
                room.tick(elapsed)

    def _respond(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request with a file or a page, with 403, or with None: a socket may be opened."""
        path, _, _ = request.path.partition("?")
        token, _, name = path.removeprefix("/").partition("/")
        socket = request.headers.get("Upgrade", "").lower() == "websocket"
        if not self._may(request.headers, token, socket):
            return _plain(connection, HTTPStatus.FORBIDDEN, "This page is for the one who started it.\n")
        folder, _, file = name.rpartition("/")
        if socket:
            return (
                None
                if file in SOCKETS and folder in self.rooms
                else _plain(connection, HTTPStatus.NOT_FOUND, "There is no such socket.\n")
            )
        page = self._pages.get(unquote(name))
        if page is not None:
            nonce = secrets.token_urlsafe(16)
            return _answer(page.kind, page.text(nonce).encode(), f"'nonce-{nonce}'", f"'nonce-{nonce}'")
        if name in self.rooms and not path.endswith("/"):  # the page's own files are beside it
            moved = _plain(connection, HTTPStatus.PERMANENT_REDIRECT, "")
            moved.headers["Location"] = f"{path}/"
            return moved
        if folder in self.rooms and file in FILES:
            return _file(FILES[file], self.port)
        return _plain(connection, HTTPStatus.NOT_FOUND, "There is no such file.\n")

    def _may(self, headers: Headers, token: str, socket: bool) -> bool:
        """Return whether a request comes from the page itself, or from the person who was given its address.

        A browser states the origin of every socket. Of a page that is typed, and of its own files, it states
        with Sec-Fetch-Site that no other site asked for them.
        """
        hosts = (f"{LOOPBACK}:{self.port}", f"localhost:{self.port}")
        host, origin = headers.get("Host"), headers.get("Origin")
        if host not in hosts or not secrets.compare_digest(token.encode(), self.token.encode()):
            return False
        if origin is not None:
            return origin == f"http://{host}"
        return not socket and headers.get("Sec-Fetch-Site") in ("none", "same-origin")

    async def _window(self, socket: ServerConnection) -> None:
        """Serve one window of a room, which is loaded when the first one is opened, or an editor."""
        assert socket.request is not None
        path, _, _ = socket.request.path.partition("?")
        folder, _, file = path.removeprefix("/").partition("/")[2].rpartition("/")
        room = self.rooms[folder]
        if file == DEBUGGER:
            await room.debug(socket)
            return
        if not room.started and not self.may_start():
            room.refuse(socket, f"{MAX_ROOMS} programs are open: close one of them and load this page again")
            await socket.wait_closed()
            return
        room.used = time.monotonic()
        room.start()
        await room.serve(socket)

    def may_start(self) -> bool:
        """Return whether another room may be loaded; empty the one that was left first, if there is one."""
        started = [room for room in self.rooms.values() if room.started]
        if len(started) < MAX_ROOMS:
            return True
        left = [room for room in started if not room.watched]
        if not left:
            return False
        min(left, key=lambda room: room.used).stop()
        return True


def _guard(session: WatchSession, work: Callable[[WatchSession], Iterator[Message]]) -> Iterator[Message]:
    """Yield a session's messages; if the session fails, report that to the window and pause."""
    try:
        yield from work(session)
    except Exception as error:
        session.running, session.bodies = False, None
        yield {"is": "problem", "text": f"a defect of servogen: {error!r}"}


async def _sent(socket: ServerConnection, text: str) -> None:
    with suppress(ConnectionClosed):
        await socket.send(text)


def _request(text: str | bytes) -> Mapping[str, Any]:
    """Return a window's message; what is not a JSON object is an empty one."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return message if isinstance(message, dict) else {}


def _return_memory() -> None:
    """Give freed memory back to the system, which the C library (glibc) keeps otherwise, in pieces."""
    gc.collect()
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def _plain(connection: ServerConnection, status: HTTPStatus, text: str) -> Response:
    return connection.respond(status, text)


def _file(name: str, port: int) -> Response:
    """Return a file of the watch page, which may open sockets to this server."""
    sockets = " ".join(f"ws://{host}:{port}" for host in (LOOPBACK, "localhost"))
    text = viewer_module() if name == VIEWER else (template_folder() / "watch" / name).read_text("utf-8")
    return _answer(TYPES[name.rpartition(".")[2]], text.encode(), "'self'", "'self'", f"'self' {sockets}")


def _answer(kind: str, body: bytes, scripts: str, styles: str, connections: str = "'none'") -> Response:
    """Return a page or a file. Its policy lets nothing run or load that is not from here."""
    policy = (
        f"default-src 'none'; script-src {scripts}; style-src {styles}; img-src 'self' data:; "
        f"connect-src {connections}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    headers = Headers(
        {
            "Content-Type": f"{kind}; charset=utf-8",
            "Content-Length": str(len(body)),
            "Content-Security-Policy": policy,
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cache-Control": "no-store",
            "Connection": "close",
        }
    )
    return Response(HTTPStatus.OK, "OK", headers, body)
