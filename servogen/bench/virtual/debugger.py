"""`VirtualDebugger`: an editor at the chip of the bench, which stops it, steps it and takes it back.

In: the requests of an editor (Debug Adapter Protocol), from any thread. Out: answers and events. While the
editor lets the chip run, the bench runs it; while it stands, the bench's time stands, too.
"""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Never

from servogen.bench.virtual.chip import VirtualChip
from servogen.dap import DebugSession, Loaded
from servogen.dap.breakpoints import Armed, next_stop, unheard
from servogen.dap.protocol import Message
from servogen.debug.breakpoints import AtEdge
from servogen.debug.time_machine import TimeMachine
from servogen.edges import PAIR_PINS, EdgeChunk, join
from servogen.errors import InputError
from servogen.programs import Program
from servogen.simulator import LevelChange

SLICE_S = 0.01
"""Seconds of the chip between two looks for a request, while an editor lets it run."""
WAIT_S = 0.01
"""The time in which a request is waited for while the chip stands; the other devices wait, too."""

ANY_EDGE = tuple(Armed(AtEdge("", pin, None)) for pin in range(PAIR_PINS))


class VirtualDebugger:
    """Debugs the chip that it is given to, one editor at a time."""

    def __init__(self, path: Path, program: Program) -> None:
        """Debug with the names and lines of `program`, from the file `path`."""
        self._path = path
        self._program = program
        self._chip: VirtualChip
        self._time: TimeMachine
        self._session: DebugSession | None = None
        self._requests: queue.Queue[tuple[DebugSession, Message | None]] = queue.Queue()

    # The chip's face

    def powered(self, chip: VirtualChip) -> None:
        """Keep the way back to this moment, at which the chip begins anew: the old one's session ends."""
        program = self._program
        listing = program.listing if chip.image.program == program.image.program else None
        self._chip = chip
        self._time = TimeMachine(chip.image, chip.clock, chip.options, listing=listing, machine=chip.machine)
        if self._session is not None:
            self._session.log("the chip begins anew, with what was programmed: attach again")
            self._session.event("terminated")
            self._session = None

    @property
    def stands(self) -> bool:
        """Return whether an editor has stopped the chip."""
        session = self._session
        return session is not None and (not session.running or session.goes_back)

    def run(self, cycles: int, *, to_edge: bool) -> EdgeChunk:
        """Run for `cycles`, to a breakpoint or, if asked to, just after an edge; return the edges."""
        session, chunks = self._session, list[EdgeChunk]()
        armed = [*(session.armed if session is not None else ()), *(ANY_EDGE if to_edge else ())]
        log = session.log if session is not None else unheard
        hit = next_stop(self._time, self._time.now + cycles, armed, log, chunks)
        if session is not None and hit is not None and hit not in ANY_EDGE:
            session.stopped("breakpoint", hit.text)
        return join(chunks)

    def apply(self, changes: Sequence[LevelChange]) -> None:
        """Apply changes from outside; they are repeated when the chip passes this moment again."""
        self._time.apply(changes)

    def edges(self, begin: int, end: int) -> EdgeChunk:
        """Return the edges of the cycles from `begin` to `end`."""
        return self._time.edges(begin, end)

    # The editors' face

    def attach(self, send: Callable[[Message], None]) -> Callable[[Message | None], None]:
        """Return what takes an editor's requests, None where it has gone; `send` takes what answers them."""

        def refuse(url: str, send: Callable[[Message], None]) -> Never:
            raise InputError("not-allowed", "attach: another editor debugs the chip of this bench")

        def read(path: Path, device: str | None) -> Never:
            raise InputError("not-allowed", "launch: a bench's debugger has the program of its chip only")

        session = DebugSession(send, read, refuse)
        return lambda request: self._requests.put((session, request))

    @property
    def working(self) -> bool:
        return self._session is not None or not self._requests.empty()

    def work(self) -> None:
        """Let the chip run if the editor does, and answer a request."""
        session = self._session
        running = session is not None and session.running
        if session is not None and session.goes_back:
            self._chip.led(session.run_on, in_the_past=True)
        elif running:
            self._chip.run(self._chip.due(int(SLICE_S * self._chip.cycles_per_second)))
        try:
            asking, request = self._requests.get(block=not running, timeout=WAIT_S)
        except queue.Empty:
            return
        if request is not None:
            attaches = self._session is None and request.get("command") == "attach"
            if attaches:
                self._debug(asking)
            self._chip.led(lambda: asking.handle(request), in_the_past=asking.goes_back)
            if attaches and self._chip.second is not None:
                asking.log("of the two chips the first is debugged; the second stands and goes back with it")
        if asking is self._session and (request is None or asking.ended):
            self._chip.led(asking.stay, in_the_past=True)
            self._session = None

    def _debug(self, session: DebugSession) -> None:
        """Debug the chip as it is: it stands, unless its time is real time."""
        chip = self._chip
        program = Program(chip.image, self._time.listing)
        session.debug(Loaded(self._path, program, chip.options, None), self._time)
        session.running, session.stands_at = chip.in_real_time, int(self._time.now)
        self._session = session
