"""The Debug Adapter Protocol's messages: JSON with a header that states its length, and the loop that serves.

In: bytes from an editor. Out: answers and events, each with the next sequence number. The protocol is
described at https://microsoft.github.io/debug-adapter-protocol ("Base Protocol").
"""

from __future__ import annotations

import json
import queue
import threading
from collections.abc import Callable, Mapping
from typing import IO, Any, Protocol

Message = dict[str, Any]

MAX_BYTES = 1 << 24
"""The longest message that is read: an editor's are a few kilobytes."""
MAX_HEADER = 1000


class ProtocolError(Exception):
    """What came is not a message of the protocol."""


def read_message(stream: IO[bytes]) -> Message | None:
    """Return the next message; None at the end of the stream. Raises ProtocolError."""
    length: int | None = None
    while (line := stream.readline(MAX_HEADER)).strip():
        name, _, value = line.partition(b":")
        if name.strip().lower() == b"content-length":
            if not value.strip().isdigit() or int(value) > MAX_BYTES:
                shown = value.strip()[:40]
                raise ProtocolError(f"Content-Length: {shown!r} is not a length up to {MAX_BYTES}")
            length = int(value)
    if not line:
        return None
    if length is None:
        raise ProtocolError("a message has no Content-Length")
    body = stream.read(length)
    if len(body) < length:
        return None
    try:
        message = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise ProtocolError(f"a message is not JSON: {error}") from None
    if not isinstance(message, dict):
        raise ProtocolError("a message is not an object")
    return message


def written(message: Mapping[str, object]) -> bytes:
    """Return a message with its header."""
    body = json.dumps(message).encode()
    return b"Content-Length: %d\r\n\r\n" % len(body) + body


class Messages:
    """Writes numbered messages."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._next = 1

    def send(self, message: Message) -> None:
        self._stream.write(written({"seq": self._next, **message}))
        self._stream.flush()
        self._next += 1


class Session(Protocol):
    """What answers requests, and runs in between."""

    running: bool
    ended: bool

    def handle(self, request: Message) -> None:
        """Answer a request."""

    def run_on(self) -> None:
        """Run a little further; called again and again while `running`."""


def serve(stream: IO[bytes], session: Session, failed: Callable[[str], None]) -> None:
    """Answer requests until the stream or the session ends; between them the chip runs.

    What is not a message ends the session: `failed` is told why.
    """
    waiting: queue.Queue[Message | None] = queue.Queue()

    def reader() -> None:
        try:
            while (message := read_message(stream)) is not None:
                waiting.put(message)
        except (ProtocolError, OSError, ValueError) as error:
            failed(str(error))
        waiting.put(None)

    threading.Thread(target=reader, daemon=True).start()
    while not session.ended:
        try:
            message = waiting.get(block=not session.running)
        except queue.Empty:
            session.run_on()
            continue
        if message is None:
            return
        session.handle(message)
