"""`LiveLine`: the sliders' positions on the serial line of a real robot, beside the simulated chip.

In: an open line and commands as they come. Out: of each servo the newest command, as fast as the line takes
them; a slider that is dragged does not leave a queue behind it. What goes wrong is kept for the page.
"""

from __future__ import annotations

import threading

from servogen.drive.serial_link import ByteSink
from servogen.errors import ServogenError


class LiveLine:
    """Sends in a thread of its own until it is closed, or until the line fails."""

    def __init__(self, wire: ByteSink) -> None:
        self._wire = wire
        self._waiting: dict[int, bytes] = {}
        self._changed = threading.Condition()
        self._open = True
        self.problem = ""
        """The reason why sending has ended; empty while the line works."""
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def command(self, servo: int, data: bytes) -> None:
        """Send a servo's command, in place of one that still waits."""
        with self._changed:
            self._waiting[servo] = data
            self._changed.notify()

    def close(self) -> None:
        """Send what waits, and end."""
        with self._changed:
            self._open = False
            self._changed.notify()
        self._thread.join()

    def _send(self) -> None:
        while True:
            with self._changed:
                while self._open and not self._waiting:
                    self._changed.wait()
                if not self._waiting:
                    return
                data = self._waiting.pop(next(iter(self._waiting)))
            try:
                self._wire.write(data)
            except ServogenError as error:
                self.problem = str(error)
                return
