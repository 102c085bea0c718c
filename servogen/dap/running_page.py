"""A running page of `servogen watch`, to which an editor attaches: its server debugs its chip.

In: the page's address, and requests. Out: what the server answers, and its events. Needs websockets.
"""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from urllib.parse import urlsplit

from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import connect
from websockets.typing import Origin

from servogen.dap.protocol import MAX_BYTES, Message
from servogen.errors import InputError

HOSTS = ("127.0.0.1", "localhost")
PATIENCE_S = 10
"""The time in seconds within which the page's server, on the same machine, must have answered."""


class RunningPage:
    """The debugger of the window that was opened last at an address."""

    def __init__(self, url: str, send: Callable[[Message], None]) -> None:
        """Connect; `send` takes the messages. Raises InputError where no page of this machine is."""
        hint = "the url that servogen watch prints: http://127.0.0.1:PORT/TOKEN/"
        try:
            parts = urlsplit(url)
            host, port = parts.hostname, parts.port
        except ValueError:
            host, port = None, None
        if host not in HOSTS or port is None or parts.scheme != "http":
            raise InputError("not-allowed", f"attach: '{url}' is not a page on this machine", hint=hint)
        folder = parts.path.rpartition("/")[0]
        self._open = ExitStack()
        try:
            line = socket.create_connection((host, port), PATIENCE_S)
            line.settimeout(None)  # an editor may be silent for longer
            opened = connect(
                f"ws://{host}:{port}{folder}/dap",
                sock=line,
                origin=Origin(f"http://{host}:{port}"),
                max_size=MAX_BYTES,
            )
            self._socket = self._open.enter_context(opened)
        except (OSError, InvalidHandshake) as error:
            raise InputError("not-allowed", f"attach: no page answers there: {error}", hint=hint) from None
        self._send = send
        self._wanted = True
        threading.Thread(target=self._pass_on, daemon=True).start()

    def send(self, request: Message) -> bool:
        """Pass a request on; return False where the page has ended."""
        try:
            self._socket.send(json.dumps(request))
        except ConnectionClosed:
            return False
        return True

    def close(self) -> None:
        """Let the program go on without the editor."""
        self._wanted = False
        self._open.close()

    def _pass_on(self) -> None:
        with suppress(ConnectionClosed):  # a server that was killed says no goodbye
            for text in self._socket:
                self._send(json.loads(text))
        if self._wanted:
            self._send({"type": "event", "event": "terminated", "body": {}})
