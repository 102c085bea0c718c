"""The server of `servogen watch` in a thread of the tests."""

from __future__ import annotations

import asyncio
import http.client
import threading
from urllib.parse import urlsplit

from websockets.sync.client import ClientConnection, connect

from servogen.watch.editing import Editor
from servogen.watch.server import Load, Room, WatchServer


class Running:
    """A server in a thread of its own: of one subject, or of what `server` has."""

    def __init__(
        self,
        load: Load | None = None,
        editor: Editor | None = None,
        server: WatchServer | None = None,
        port: int = 0,
        token: str = "",
    ) -> None:
        assert (load is None) != (server is None)
        self.server = server or WatchServer({"": Room(load, editor)} if load else {})
        self.server.token = token or self.server.token
        self._loop = asyncio.new_event_loop()
        ready = threading.Event()
        self._task = self._loop.create_task(self.server.run(port, lambda url: ready.set()))
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        assert ready.wait(300)
        parts = urlsplit(self.server.url)
        self.host, self.token = parts.netloc, parts.path.strip("/")

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._task)
        except asyncio.CancelledError:
            pass
        finally:  # as asyncio.run does
            left = asyncio.all_tasks(self._loop)
            for task in left:
                task.cancel()
            self._loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
            self._loop.close()

    def stop(self) -> None:
        self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(300)
        assert not self._thread.is_alive()

    @property
    def running(self) -> bool:
        return self._thread.is_alive()

    def get(self, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
        """Ask as a browser does that a person gave the address, unless `headers` say otherwise."""
        connection = http.client.HTTPConnection(self.host, timeout=300)
        asked = {"Host": self.host, "Sec-Fetch-Site": "none"} | headers
        connection.putrequest("GET", path, skip_host=True, skip_accept_encoding=True)
        for name, value in asked.items():
            if value:
                connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.read().decode(), dict(answer.getheaders())

    def socket(self, token: str | None = None, room: str = "", **headers: str | None) -> ClientConnection:
        """Open a socket as the page in a room's folder does."""
        asked = {"Origin": f"http://{self.host}"} | headers
        return connect(
            f"ws://{self.host}/{self.token if token is None else token}/{room}socket",
            additional_headers={name: value for name, value in asked.items() if value},
            proxy=None,
            open_timeout=300,
        )

    def handshake(self, room: str = "", socket: str = "socket", **headers: str) -> int:
        """Return the status of the answer to a request for a socket with these headers."""
        status, _, _ = self.get(
            f"/{self.token}/{room}{socket}",
            Sec_Fetch_Site="",
            Upgrade="websocket",
            Connection="Upgrade",
            Sec_WebSocket_Version="13",
            Sec_WebSocket_Key="dGhlIHNhbXBsZSBub25jZQ==",
            **headers,
        )
        return status
