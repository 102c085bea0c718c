"""An editor at a window's chip: it and the page control the same program, and each sees what the other does.

In: an editor's requests (Debug Adapter Protocol), and what the page has done since. Out: answers and events
for the editor, and what the window shows then.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Never

from servogen.dap import DebugSession, Loaded
from servogen.errors import InputError
from servogen.programs import Program
from servogen.watch.session import Message, WatchSession


def _read_nothing(path: Path, device: str | None) -> Never:
    raise InputError("not-allowed", "launch: a page's debugger has the page's program only")


class Debugging:
    """A debugging session at a window's chip, which the window's clock runs."""

    def __init__(self, session: WatchSession | None, send: Callable[[Message], None]) -> None:
        """Debug what a window shows; where it cannot be debugged, the editor's `attach` is told why."""
        self.session: WatchSession | None = None
        if session is None:
            why = "no page shows a program yet: open the address in a browser first"
        elif session.editor is not None:
            why = "another editor debugs the program of this page"
        else:
            why = "the page shows a recording, which has no chip"

        def refuse(url: str, send: Callable[[Message], None]) -> Never:
            raise InputError("not-allowed", f"attach: {why}")

        self._editor = DebugSession(send, _read_nothing, refuse)
        if session is None or session.editor is not None or session.chip is None:
            return
        subject = session.subject
        assert subject.image is not None
        program = Program(subject.image, subject.listing)
        self._editor.debug(Loaded(subject.path, program, subject.options, subject.stimuli), session.chip)
        self._editor.running, self._editor.stands_at = session.running, session.now
        self.session, session.editor = session, self._editor

    def handle(self, request: Message) -> Message | None:
        """Answer a request; return the window's moment if the request changed it."""
        session, editor = self.session, self._editor
        if session is None or session.chip is None:
            editor.handle(request)
            return None
        on_the_way = session.on_the_way
        if on_the_way:
            session.arrive()
        before = session.now, session.running, session.chip.machine.state(), session.chip.inputs
        editor.handle(request)
        after = session.now, editor.running, session.chip.machine.state(), session.chip.inputs
        if before == after and not on_the_way:
            return None
        return session.moved(running=editor.running)

    def follow(self, shown: WatchSession | None) -> bool:
        """Tell the editor what the page has done; return False where the page shows another program."""
        session = self.session
        if session is None:
            return True
        if shown is not session:
            self._editor.log("the page shows another program: attach again")
            self._editor.event("terminated")
            self.end()
            return False
        editor = self._editor
        if session.on_the_way or editor.goes_back:
            return True
        if session.running and not editor.running:
            editor.continued()
        elif not session.running and (editor.running or session.now != editor.stands_at):
            editor.stopped("breakpoint" if session.stopped else "pause", session.stopped)
        return True

    def end(self) -> None:
        """End the editor's part: from now on only the page acts on the program."""
        if self.session is not None:
            self._editor.stay()
            self.session.editor = None
            self.session = None
