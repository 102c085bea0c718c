"""A debugger's client of a package (dap-python), which drives `servogen dap` as an editor does."""

from __future__ import annotations

import os
import select
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dap import Client
from dap.handler import Handler

PATIENCE_S = 60
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
    """An editor with one debugging session in a process of its own."""

    def __init__(self, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "servogen", "dap"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=folder,
        )
        self.client = Client("servogen")
        self.client.handler = Answers(self.client)
        self.seen: list[Any] = []

    def send(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(self.client.send())
        self._process.stdin.flush()

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
            assert self._process.stdout is not None
            ready, _, _ = select.select([self._process.stdout], [], [], PATIENCE_S)
            assert ready, f"nothing comes for {PATIENCE_S} s: no {kind}"
            data = os.read(self._process.stdout.fileno(), 1 << 16)
            assert data, f"it ended without {kind}: {self._errors()}"
            self.seen += [*self.client.receive(data)]
        raise AssertionError(f"no {kind}")

    def ask(self, command: str, arguments: dict[str, Any]) -> Any:
        """Send a request and return the body of its answer."""
        self.client.send_request(command, arguments)
        return self.until(command)

    def _errors(self) -> str:
        assert self._process.stderr is not None
        return self._process.stderr.read().decode()

    def close(self) -> int:
        """End the session and return the exit code."""
        self.client.disconnect()
        self.until("disconnect")
        assert self._process.stdin is not None
        self._process.stdin.close()
        return self._process.wait(20)
