"""A debugger's client of a package (dap-python), which drives `servogen dap` as an editor does."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from dap import Client
from dap.handler import Handler

from servogen.dap import DebugSession, Messages, serve

PATIENCE_S = 300
WAIT = 2000
"""Messages after which an expected one counts as missing."""


class Answers(Handler):  # type: ignore[misc]
    """The package's reader, with the bodies of answers as they came: its types ask for more."""

    def handle_response(self, response: Any) -> Any:
        return Answer(response.command, response.success, response.body)


@dataclass(frozen=True)
class Answer:
    command: str
    success: bool
    body: Any


class Editor:
    """An editor with one debugging session, over pipes."""

    def __init__(self, to: IO[bytes], of: IO[bytes]) -> None:
        self._to, self._from = to, of
        self.client = Client("servogen")
        self.client.handler = Answers(self.client)
        self.seen: list[Any] = []
        self.exchanged: list[dict[str, Any]] = []
        """Every message of both sides, in order."""
        self._rest = b""

    def send(self) -> None:
        data = self.client.send()
        self._note(data)
        self._to.write(data)
        self._to.flush()

    def until(self, kind: str) -> Any:
        """Return the next answer to a command, or the next event of a class."""
        self.send()
        for _ in range(WAIT):
            for place, message in enumerate(self.seen):
                if isinstance(message, Answer) and message.command == kind:
                    del self.seen[: place + 1]
                    assert message.success, message.body
                    return message.body
                if type(message).__name__ == kind:
                    del self.seen[: place + 1]
                    return message
            ready, _, _ = select.select([self._from], [], [], PATIENCE_S)
            assert ready, f"nothing comes for {PATIENCE_S} s: no {kind}"
            data = os.read(self._from.fileno(), 1 << 16)
            assert data, f"it ended without {kind}"
            self._note(data)
            self.seen += [*self.client.receive(data)]
        raise AssertionError(f"no {kind}")

    def ask(self, command: str, arguments: dict[str, Any]) -> Any:
        """Send a request and return the body of its answer."""
        self.client.send_request(command, arguments)
        return self.until(command)

    def go(self, command: str, **more: object) -> Any:
        """Let the chip move; return the event that it stands again."""
        self.ask(command, {"threadId": 1, **more})
        return self.until("StoppedEvent")

    def close(self) -> None:
        """End the session."""
        self.client.disconnect()
        self.until("disconnect")
        self._to.close()

    def _note(self, data: bytes) -> None:
        self._rest += data
        while (head := self._rest.find(b"\r\n\r\n") + 4) > 3:
            end = head + int(self._rest[:head].split(b":")[1])
            if len(self._rest) < end:
                break
            self.exchanged.append(json.loads(self._rest[head:end]))
            self._rest = self._rest[end:]


def in_thread() -> Editor:
    """Return an editor whose adapter is a thread: a process takes seconds to begin."""
    (requests, to), (of, answers) = os.pipe(), os.pipe()
    session = DebugSession(Messages(os.fdopen(answers, "wb")).send)
    thread = threading.Thread(target=serve, args=(os.fdopen(requests, "rb"), session, print), daemon=True)
    thread.start()
    return Editor(os.fdopen(to, "wb"), os.fdopen(of, "rb"))


def in_process(folder: Path) -> tuple[Editor, subprocess.Popen[bytes]]:
    """Return an editor that started `servogen dap` in a folder, and the process."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    process = subprocess.Popen([sys.executable, "-m", "servogen", "dap"], cwd=folder, **pipes)  # type: ignore[call-overload]
    assert process.stdin is not None and process.stdout is not None
    return Editor(process.stdin, process.stdout), process
