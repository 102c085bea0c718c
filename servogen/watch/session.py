"""`WatchSession`: one window's moment in what is watched, and what it does there.

In: a `Subject`, the window's messages, the time that passes. Out: messages for the window: what the chip, its
pins and servos are at the moment, and the edges of the part of the waves that is shown. Nothing here knows of
sockets; every message is a value that JSON can hold.

    window ── {"do": "step", "what": "line", "count": -1} ──▶ handle ──▶ {"is": "now", "cycle": …} ──▶ window
    clock ──▶ tick ──▶ {"is": "now", …} ──▶ window
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import groupby, islice, repeat, takewhile
from math import inf
from types import MappingProxyType
from typing import Any

import numpy as np

from servogen.dap import DebugSession
from servogen.dap.breakpoints import Armed, next_stop, unheard
from servogen.debug.breakpoints import AtEdge, Breakpoint, first_stop, parse_breakpoint
from servogen.debug.pins import explain_pin
from servogen.debug.symbols import current_line, line_at
from servogen.debug.time_machine import Repetition, TimeMachine
from servogen.drive.commands import STOP
from servogen.drive.on_command import REPEATS
from servogen.edges import (
    HIGH,
    NO_EDGES,
    OTHER_PINS,
    PAIR_PINS,
    PINS,
    UNDRIVEN,
    Driven,
    EdgeChunk,
    edge_chunk,
    join,
)
from servogen.engines.inputs.commands import CommandButton, CommandButtons, CommandLine, uart_byte
from servogen.engines.stream.protocol import MAX_VALUE, SYNC
from servogen.errors import Diagnostic, InputError, ServogenError
from servogen.pic.device import EEPROM_BYTES, PACKAGE, RAM_FIRST
from servogen.programs import JOB_SUFFIX
from servogen.pulse.schedule import Pulse, Run
from servogen.pulses import PulseReader, Pulses, joined
from servogen.report.robot_model import robot_model, schedule_model
from servogen.simulator import LevelChange, Machine, Serial
from servogen.simulator.eeprom24 import RunningEEPROM
from servogen.simulator.layout import MCLR_PIN
from servogen.simulator.observe import plain_assembly
from servogen.simulator.sources import STIMULUS_PINS, pin_number
from servogen.watch.differences import Edge, ScheduledEdges, differing
from servogen.watch.listeners import BusListener, Said, SerialListener, byte_clocks
from servogen.watch.live_bodies import LiveBodies
from servogen.watch.live_line import LiveLine
from servogen.watch.motion import motion_runs, pose_begins
from servogen.watch.recording import LatestEdges, Recording
from servogen.watch.subject import Subject
from servogen.workflows.verification import chip_warnings

Message = dict[str, Any]

MAX_WINDOW_S = 4
"""The maximum time range of the waves."""
MAX_CYCLE_S = 48 * 3600
"""The latest moment that can be gone to."""
ANSWER_S = 0.25
"""The time in which a moment is gone to before it is said how far the way there is done."""
WAY_S = 0.2
"""The time for which the server goes on towards a far moment between two looks at other requests."""
FAR_S = 60
"""The simulated time from which on a way waits until it is known what the program does again and again."""
MAX_REPETITION_S = 7200
"""The simulated time in which a program's state has to come back."""
LEARNING_S = Fraction(20)
"""The simulated time of a step while that is looked for: the longer, the less processor time it takes."""
EDGE_S = 10
"""The simulated time in which the next edge is searched."""
MAX_EDGES = 20_000
"""The maximum number of edges in one answer; a range with more is cut."""
SCOPE_SPEED = 0.1
"""The speed above which the waves show whole frames of the past, like a scope triggered by the frame."""
SCOPE_S = 0.25
"""The interval between two such views; more slowly, the edges come with every picture."""
AHEAD = 0.25
"""The part of the waves that is kept free for the future at lower speeds."""
SILENT_FRAMES = 2
"""The number of frames without a pulse after which a servo is not driven."""
HELD_S = (1, 10)
"""How far back pulses are searched for the last position of servos that have none now."""
FRAME_S = Fraction(20, 1000)
"""The assumed frame of a program without a schedule."""
FULL_S = 0.5
"""The interval at which the whole chip is shown while it runs."""
SLICE_S = 0.03
"""The time that the server calculates between two messages at full speed."""
LONGEST_TICK_S = 0.1
"""The maximum time that is made up after a pause of the server."""
PIECE = 2_000
"""The cycles that are run first between two looks at the clock, with breakpoints."""
MAX_SPEED = 1000.0
MIN_SPEED = 1e-5
MAX_SERIAL_BYTES = 256
MAX_BREAKPOINTS = 32
MAX_BREAKPOINT_CHARACTERS = 200
MAX_CHANGES = 50_000
"""The maximum number of a stimulus's changes that are shown in the waves."""
LAST = 8
"""The number of executed instructions that are shown."""


class WatchSession:
    """A window's own machine: its moment, speed and breakpoints."""

    def __init__(
        self,
        subject: Subject,
        live: LiveLine | None = None,
        repetition: Repetition | None = None,
        *,
        learning: bool = False,
    ) -> None:
        """Begin at the subject's first moment; `live` is the line of a real robot."""
        self.subject = subject
        self.live = live
        self.chip: TimeMachine | None = None
        if subject.image is not None:
            self.chip = TimeMachine(
                subject.image,
                subject.clock,
                subject.options,
                subject.stimuli,
                subject.listing,
                _loop(subject),
                subject.powered(),
            )
            self.chip.repetition = repetition
        self.recording = Recording(subject.trace) if subject.trace is not None else None
        self.running = False
        self.speed: float | None = 1.0
        """Simulated seconds per second; None: as fast as possible."""
        self.bodies: LiveBodies | None = None
        """The physics of the robot; None if the window does not show it."""
        self.breakpoints: list[Breakpoint] = []
        self.editor: DebugSession | None = None
        """The debugger of an editor at the same chip, whose breakpoints stop it, too."""
        self.outside = [UNDRIVEN] * (MCLR_PIN + 1)
        """The level at which the user holds each pin."""
        self._due = 0.0
        self._behind = False
        """Whether breakpoints have made it slower than its speed since the whole chip was shown."""
        self._since_full = 0.0
        self._since_waves = 0.0
        self.stopped = ""
        """The breakpoint, or the reason, for which it stands."""
        self._line_free = 0
        self._period = _period(subject)
        self._sight = (0, 4 * self._period)
        """The window of time that the waves show."""
        self._pulses = self._no_pulses()
        self._servo_pins = _servo_pins(subject)
        self._way: Iterator[None] | None = None
        """The way to a moment that was asked for, while it is being gone."""
        self._goal = 0
        self.learning = learning
        """Whether the server is finding out what the program does again and again; a far way waits for it, as
        two runs of the same would only slow each other down."""
        self.listener: SerialListener | None = None
        """What decodes the bytes on a pin of the chip, while the window listens to one."""
        self._go(subject.begin)

    def _no_pulses(self) -> LatestPulses:
        return LatestPulses(len(PINS) if self.subject.pair is None else PAIR_PINS)

    @property
    def now(self) -> int:
        return int(self.place.now)

    @property
    def place(self) -> TimeMachine | Recording:
        place = self.chip or self.recording
        assert place is not None
        return place

    def model(self) -> Message:
        """Return what does not change while it is watched."""
        subject = self.subject
        schedule, listing, placed = subject.schedule, subject.listing, subject.placed
        robot, servos = _robot(subject), schedule.channels if schedule and not subject.pair else ()
        return {
            "is": "model",
            "name": subject.name,
            "device": subject.options.device,
            "cycle_us": float(subject.clock.cycle_us),
            "cycles_per_second": float(subject.clock.cycles_per_second),
            "pins": list(PINS),
            "names": _pin_names(subject),
            "chip": None if subject.pair is None else 1 + subject.shown,
            "package": [{"number": pin.number, "name": pin.name} for pin in PACKAGE],
            "period": self._frame,
            "runs": self.subject.image is not None,
            "end": int(self.recording.end) if self.recording else None,
            "channels": [{"name": channel.name, "pin": PINS.index(channel.pin)} for channel in servos]
            or [{"name": servo["name"], "pin": servo["pin"]} for servo in (robot or {}).get("servos", ())],
            "schedule": _schedule(subject),
            "schedule_cycle_us": float(schedule.clock.cycle_us) if schedule else None,
            "origin": placed.origin if placed is not None else None,
            "compared": bool(subject.wanted),
            "verdict": subject.verdict,
            "first_difference": subject.first_difference,
            "differences": subject.differences,
            "graded": subject.graded,
            "robot": robot,
            "poses": subject.path.suffix.lower() == JOB_SUFFIX,
            "inputs": job_buttons(subject),
            "serial": _serial(subject),
            "bus": _bus(subject),
            "walk": _walk(subject),
            "marks": [_mark(remark) for remark in subject.remarks if remark.location],
            "motion": motion_runs(subject.stated) if subject.stated else None,
            "motion_begin": _motion_begin(subject),
            "parts": pose_begins(subject.job) if subject.job else [],
            "listening": self.listener.model if self.listener else None,
            "has_bodies": subject.job is not None and subject.job.robot is not None,
            "bodies": self.bodies.model() if self.bodies else None,
            "sources": [{"name": name, "text": text} for name, text in (listing.sources if listing else ())],
            "variables": [
                {"address": address, "name": name, "bytes": size}
                for address, name, size in (listing.variables if listing else ())
            ],
            "ram_first": RAM_FIRST,
            "eeprom_bytes": EEPROM_BYTES,
        }

    def handle(self, message: Mapping[str, Any]) -> Iterator[Message]:
        """Do what the window asks for and yield the answers. A request that is wrong is answered so."""
        action = ACTIONS.get(str(message.get("do")))
        if action is None:
            yield _problem(f"unknown request {str(message.get('do'))[:40]!r}")
            return
        try:
            if message.get("do") not in UNDISTURBING:
                self.arrive()
            yield from action(self, message)
        except ServogenError as error:
            sentences = " ".join(diagnostic.sentence for diagnostic in error.diagnostics)
            yield {**_problem(sentences), "about": message["do"]}
        except (ValueError, TypeError, KeyError, OverflowError) as error:
            yield _problem(f"the request {str(message.get('do'))[:40]!r} is wrong: {error}")

    def tick(self, elapsed_s: float) -> Iterator[Message]:
        """Run for the time that has passed, at the chosen speed, and yield what is to be shown of it.

        The bodies follow, also after a jump or a run that was too fast for them.
        """
        if self._way is not None:
            yield self._proceed(WAY_S)
        elif self.editor is not None and self.editor.goes_back:
            end = time.monotonic() + WAY_S
            while self.editor.goes_back and time.monotonic() < end:
                self.editor.run_on()
            if not self.editor.goes_back:
                yield self.moved(running=False)
        elif self.running:
            self.run_on(min(elapsed_s, LONGEST_TICK_S))
            self._since_full += elapsed_s
            whole = self._since_full >= FULL_S or not self.running
            message = self.shown(whole=whole)
            self._since_waves += elapsed_s
            if not self._as_scope() or self._since_waves >= SCOPE_S or not self.running:
                self._since_waves = 0.0
                self._follow()
                message["waves"] = self._waves(*self._sight)
            yield message
        if self.bodies is not None:
            try:
                yield from self.bodies.follow()
            except ServogenError as error:
                self.bodies = None
                yield _without_bodies(error)

    def run_on(self, elapsed_s: float) -> None:
        if self.recording is not None:
            self._due += elapsed_s * (self.speed or MAX_SPEED) * float(self.subject.clock.cycles_per_second)
            steps, self._due = int(self._due), self._due % 1
            self._run_recording(self.recording, self.now + steps)
            return
        if self.speed is None:
            begin = time.monotonic()
            while self.running and time.monotonic() - begin < SLICE_S:
                self._advance(self._period)
            return
        self._due += elapsed_s * self.speed * float(self.subject.clock.cycles_per_second)
        if self._due >= 1:
            before = self.now
            self._advance(int(self._due))
            if self.running:
                left = self._due - (self.now - before)
                self._behind |= left >= 1
                self._due = min(1.0, left)  # what it is behind is not made up

    def _run_recording(self, recording: Recording, end: int) -> None:
        """Go on in a recording, up to just after an edge that stops it."""
        first = max(1, self.now)  # levels at time 0 are those before the recording
        hit = first_stop(self.breakpoints, recording.edges(first, end))
        recording.seek(end if hit is None else hit[0] + 1)
        self._take(recording.edges(self._latest.end, self.now))
        if hit is not None:
            self._stop(hit[1].text)
        elif self.now >= recording.end:
            self._stop("the end of the recording")

    def _advance(self, cycles: int) -> None:
        assert self.chip is not None
        chunks: list[EdgeChunk] = []
        armed, log = [Armed(each) for each in self.breakpoints], unheard
        if self.editor is not None:
            armed, log = armed + self.editor.armed, self.editor.log
        end = self.now + cycles
        # With breakpoints in short pieces: what is tested at each instruction may be slower than this speed.
        piece, late = (PIECE, time.monotonic() + LONGEST_TICK_S) if armed else (cycles, math.inf)
        hit = next_stop(self.chip, min(end, self.now + piece), armed, log, chunks)
        while hit is None and self.now < end and time.monotonic() < late:
            piece = min(2 * piece, max(PIECE, self._period))
            hit = next_stop(self.chip, min(end, self.now + piece), armed, log, chunks)
        self._take(join(chunks))
        if hit is not None:
            self._stop(hit.text)

    def _stop(self, why: str) -> None:
        self.running = False
        self.stopped = why
        self._due = 0.0

    def _go(self, cycle: int) -> None:
        """Go to a moment: at once if it is near, and otherwise in the following ticks."""
        self._due = 0.0
        self._goal = max(0, min(cycle, int(self.subject.clock.round_seconds(MAX_CYCLE_S))))
        if self.chip is None:
            self.place.seek(self._goal)
            self._look_back()
        else:
            self._way = self.chip.going(self._goal)
            self._proceed(ANSWER_S)

    def _proceed(self, seconds: float) -> Message:
        """Go on to the moment that was asked for; return it, or how much of the way is done."""
        end = time.monotonic() + seconds
        going = {"is": "going", "share": self.now / max(1, self._goal), "cycle": self._goal}
        assert self._way is not None
        far = self._goal - self.now > self.subject.clock.round_seconds(FAR_S)
        if self.learning and far and self.chip is not None and self.chip.touched == inf:
            return going
        for _ in self._way:
            if time.monotonic() >= end:
                return going | {"share": self.now / max(1, self._goal)}
        self.arrive()
        return self.shown()

    @property
    def on_the_way(self) -> bool:
        """Return whether the window is still on its way to a moment that was asked for."""
        return self._way is not None

    def arrive(self) -> None:
        """Stop where the window is on its way to a moment: what is asked for next begins there."""
        if self._way is not None:
            self._way = None
            self._look_back()
        if self.editor is not None and self.editor.goes_back:
            self.editor.stay()
            self._stop("")

    def moved(self, *, running: bool) -> Message:
        """Go on from where an editor has left the chip, and return the moment."""
        self._stop("")
        self.running = running
        if self.bodies is not None:
            self.bodies.forget(self.now)
        self._look_back()
        return self.shown()

    def _take(self, edges: EdgeChunk) -> None:
        """Take the edges that were made up to now."""
        self._pulses.add(edges)
        if self.listener is not None:
            self.listener.add(edges, self.now)
        begin, end = self._sight
        self._latest.add(edges, self.now, end - begin + 2 * self._period)

    def _as_scope(self) -> bool:
        return self.speed is None or self.speed > SCOPE_SPEED

    @property
    def _frame(self) -> float:
        """Return a frame of the schedule where it lies in the trace, whose clock may be another one."""
        placed = self.subject.placed
        return self._period if placed is None else placed.steps * placed.schedule.period

    def _follow(self) -> None:
        """Move the window of the waves so that the moment stays in sight while it runs."""
        begin, end = self._sight
        span = end - begin
        if self._as_scope():
            period = round(self._frame)
            frames = (self.now - end) // period
            begin = max(begin + frames * period, begin % period)
        elif not begin <= self.now <= begin + (1 - AHEAD / 2) * span:
            begin = max(0, round(self.now - (1 - AHEAD) * span))
        self._sight = begin, begin + span

    def _look_back(self) -> None:
        """Determine the pulses after a jump: those just before, or the latest before a silence."""
        self._latest = LatestEdges(self.now, self.place.levels_before(self.now))
        if self.listener is not None:
            self.listener.restart(self._latest.levels_before(self.now))
        frames = (SILENT_FRAMES + 1) * self._period
        for span in (frames, *(int(self.subject.clock.round_seconds(seconds)) for seconds in HELD_S)):
            begin = max(0, self.now - span)
            self._pulses = self._no_pulses()
            self._pulses.add(self.place.edges(begin, self.now))
            if begin == 0 or all(self._pulses.held[pin] for pin in self._servo_pins):
                break

    def shown(self, *, whole: bool = True) -> Message:
        """Return the moment: pins and pulses, and with `whole` everything in the chip."""
        message: Message = {
            "is": "now",
            "cycle": self.now,
            "reach": int(self.place.reach),
            "running": self.running,
            "widths": self._pulses.widths(self.now, SILENT_FRAMES * self._period),
            "levels": self._levels(),
            "planned": self.now < self._first_intervention(),
        }
        if self._first_intervention() < inf:
            message["intervened"] = self._first_intervention()
        if not self.running:
            message["held"] = self._pulses.held
        if self.listener is not None and (received := self.listener.taken()):
            message["received"] = [int(byte.text, 16) for byte in received]
        if whole:
            self._since_full = 0.0
            message |= {
                "speed": self.speed,
                "behind": self._behind and self.running,
                "stopped": self.stopped,
                "breakpoints": [breakpoint.text for breakpoint in self.breakpoints],
            }
            if self.chip is not None:
                message["inputs"] = len(self.chip.inputs)
                message["chip"] = self._chip(self.chip)
            self._behind = False
        return message

    def _levels(self) -> str:
        """Return a letter for each pin: 0 or 1 driven by the chip, l or h read at an input."""
        if self.chip is None:
            return "".join("l1"[level] if level < UNDRIVEN else "l" for level in self._pulses.levels)
        read = self.chip.machine.pins
        return "".join(
            ("lh" if level == UNDRIVEN else "01")[read >> pin & 1]
            for pin, level in enumerate(self.chip.machine.levels)
        )

    def _chip(self, chip: TimeMachine) -> Message:
        state = chip.machine.state()
        rows = [] if self.running else chip.executed(LAST).tolist()
        line = current_line(chip, state)
        return {
            "pc": state.pc,
            "w": state.w,
            "registers": dict(state.registers),
            "ram": state.ram.hex(),
            "written": list(state.ram_written),
            "eeprom": state.eeprom.hex(),
            "stack": list(state.stack[: min(state.stack_depth, 8)]),
            "deepest": state.deepest_stack,
            "asleep": chip.machine.asleep,
            "prescaler": state.prescaler,
            "watchdog_at": state.watchdog_at,
            "interrupts": state.interrupts,
            "resets": dict(state.resets),
            "next": self._instruction(chip, state.pc),
            "here": None if line is None else (line.file, line.line),
            "executed": [
                {"cycle": cycle, "w": w, **self._instruction(chip, address)} for cycle, address, w, _ in rows
            ],
            "warnings": [
                _mark(warning) for warning in chip_warnings(chip.machine, listing=self.subject.listing)
            ],
            "outside": list(self.outside),
        }

    def _instruction(self, chip: TimeMachine, address: int) -> Message:
        address %= len(chip.line_ids)
        listing = self.subject.listing
        text = (
            next((row.assembly for row in listing.rows if row.address == address), None) if listing else None
        )
        line = line_at(chip, address)
        assert self.subject.image is not None
        return {
            "address": address,
            "text": text or plain_assembly(self.subject.image, address),
            "file": line.file if line else None,
            "line": line.line if line else None,
        }

    def _do_run(self, message: Mapping[str, Any]) -> Iterator[Message]:
        speed = message.get("speed", self.speed)
        self.speed = None if speed is None else min(MAX_SPEED, max(MIN_SPEED, float(speed)))
        self.running, self.stopped = bool(message.get("running", True)), ""
        self._since_waves = SCOPE_S  # what is in sight fits the new speed at once
        yield self.shown()

    def _do_step(self, message: Mapping[str, Any]) -> Iterator[Message]:
        count = max(-10_000, min(10_000, int(message.get("count", 1))))
        what = str(message.get("what"))
        if what not in STEPS:
            raise InputError("not-allowed", f"'{what[:40]}' is not a step", hint=", ".join(STEPS))
        self._stop("")
        forwards = count > 0
        if what == "frame":
            self.place.seek(max(0, self._frame_begin(count)))
        elif what == "edge":
            pin = message.get("pin")
            pins = frozenset() if pin is None else frozenset((int(pin),))
            if not self._step_edge(forwards, pins):
                self.stopped = f"no edge within {EDGE_S} s" if forwards else "no edge before this one"
        elif self.chip is None:
            raise InputError("not-allowed", "a recording has edges and frames, but no instructions")
        elif what == "line":
            if not self.chip.step_line(forwards):
                self.stopped = "there is no other line"
        else:
            self.chip.step(count)
        self._look_back()
        yield self.shown()

    def _step_edge(self, forwards: bool, pins: frozenset[int]) -> bool:
        if self.chip is None:
            return self.place.step_edge(forwards, pins)
        return self.chip.step_edge(forwards, pins, int(self.subject.clock.round_seconds(EDGE_S)))

    def _frame_begin(self, count: int) -> int:
        """Return where the frame `count` frames from here begins; backwards, first the one that it is in."""
        near = (placed for placed in self.subject.wanted if placed.end is None or self.now < placed.end)
        wanted = next(near, None) or next(iter(self.subject.wanted), None)
        origin, period = (
            (wanted.origin, wanted.steps * wanted.schedule.period) if wanted else (0, self._period)
        )
        number = round((self.now - origin) // period)
        if count < 0 and self.now > round(origin + number * period):
            number += 1
        return round(origin + (number + count) * period)

    def _do_seek(self, message: Mapping[str, Any]) -> Iterator[Message]:
        self._go(int(message["cycle"]))
        yield self.there()

    def there(self) -> Message:
        """Return the moment; on the way to another one, how much of the way is done."""
        return self.shown() if self._way is None else self._proceed(0)

    def _do_breakpoint(self, message: Mapping[str, Any]) -> Iterator[Message]:
        """Add or remove one breakpoint: a window that sent them all could undo what it has not yet seen."""
        text = str(message["text"]).strip()[:MAX_BREAKPOINT_CHARACTERS]
        others = [breakpoint for breakpoint in self.breakpoints if breakpoint.text != text]
        if message.get("on"):
            added = parse_breakpoint(text, self.subject.listing)
            if self.chip is None and not isinstance(added, AtEdge):
                raise InputError(
                    "not-allowed",
                    "a recording has edges, but neither instructions nor memory",
                    hint="RB0 rise",
                )
            if len(others) == MAX_BREAKPOINTS:
                raise InputError("not-allowed", f"there are {MAX_BREAKPOINTS} breakpoints: remove one first")
            others.append(added)
        self.breakpoints = others
        yield self.shown()

    def _do_waves(self, message: Mapping[str, Any]) -> Iterator[Message]:
        """Answer with the pulses of a window of the past, what the schedule asks for, and how they differ."""
        longest = int(self.subject.clock.round_seconds(MAX_WINDOW_S))
        begin = max(0, int(message["begin"]))
        self._sight = begin, max(begin + 1, min(int(message["end"]), begin + longest))
        yield self._waves(*self._sight)

    def _waves(self, begin: int, end: int) -> Message:
        seen = min(end, int(self.place.reach))
        before = self._levels_before(begin)
        cycle, pin, level = self._edges(begin, seen)
        edges = EdgeChunk(cycle[:MAX_EDGES], pin[:MAX_EDGES], level[:MAX_EDGES])
        asked, alone = self._scheduled_edges(begin, end, seen)
        given = self._outside(begin, seen)
        inside = [edge for edge in given if edge[0] >= begin]
        outside = {edge[1]: edge[2] for edge in given if edge[0] < begin}
        return {
            "is": "waves",
            "begin": begin,
            "end": end,
            "seen": seen,
            "before": list(before),
            "pulses": _pulse_deltas(_pulses_in(before, edges, begin, max(begin, seen)), begin),
            "floating": _edge_deltas(_floating(before, edges), begin),
            "inputs": _edge_deltas(inside, begin),
            "inputs_before": outside,
            "said": self._decoded_lines(begin, seen, (before, edges), (outside, inside)),
            "wanted": _edge_deltas(asked, begin),
            "differing": _edge_deltas(alone, begin),
        }

    def _decoded_lines(
        self,
        begin: int,
        seen: int,
        driven: tuple[tuple[int, ...], EdgeChunk],
        given: tuple[Mapping[int, int], list[Edge]],
    ) -> Mapping[int, Sequence[Said]]:
        """Return what is said in a window on the lines that are decoded, by their pins.

        `driven` and `given` are the levels before and the edges of the chip and from outside.
        """
        levels, edges = driven
        outside = edge_chunk(*zip(*given[1], strict=True)) if given[1] else NO_EDGES
        said: dict[int, Sequence[Said]] = {}
        for line in self._lines(begin):
            hears = np.isin(line.pin, outside.pin) and not np.isin(line.pin, edges.pin)
            before = [given[0].get(pin, HIGH) for pin in range(len(levels))] if hears else levels
            line.restart(before)
            line.add(outside if hears else edges, seen)
            said |= dict.fromkeys(line.pins, ()) | {line.pin: line.taken()}
        return said

    def _lines(self, begin: int) -> Iterator[SerialListener | BusListener]:
        """Yield what decodes each line of the job and the one that the window listens to, from `begin` on."""
        serial, bus = _serial(self.subject), _bus(self.subject)
        bauds = {self.listener.pin: self.listener.baud} if self.listener else {}
        if serial is not None:
            names = filter(None, (serial["pin"], serial["answers"]))
            bauds |= {PINS.index(name): Fraction(serial["baud"]) for name in names}
        yield from (SerialListener(pin, baud, self.subject.clock) for pin, baud in bauds.items())
        if bus is not None:
            reach = min(begin, int(self.place.reach))
            scl, sda = PINS.index(bus["scl"]), PINS.index(bus["sda"])
            clocks = (
                self.chip.at(reach, _clocks)
                if self.chip
                else byte_clocks(self.place.edges(0, reach), scl, sda)
            )
            yield BusListener(scl, sda, clocks)

    def _edges(self, begin: int, end: int) -> EdgeChunk:
        """Return the edges of a window of the past: nothing is run that has not been reached."""
        if begin >= end:
            return join(())
        return (
            self._latest.edges(begin, end) if self._latest.has(begin, end) else self.place.edges(begin, end)
        )

    def _levels_before(self, begin: int) -> tuple[int, ...]:
        begin = min(begin, int(self.place.reach))
        source = self._latest if self._latest.has(begin, begin) else self.place
        return source.levels_before(begin)

    def _first_intervention(self) -> float:
        """Return the cycle from which the pins follow this window's hands, of which no schedule speaks."""
        return self.chip.touched if self.chip is not None else inf

    def _schedules(self) -> tuple[ScheduledEdges, ...]:
        """Return the scheduled edges for comparison, up to the first intervention."""
        end = self._first_intervention()
        return tuple(
            wanted if end == inf else replace(wanted, end=int(end)) for wanted in self.subject.wanted
        )

    def _scheduled_edges(self, begin: int, end: int, seen: int) -> tuple[list[Edge], list[Edge]]:
        """Return the scheduled edges of a window, and the edges up to `seen` that only one side has."""
        asked: list[Edge] = []
        alone: list[Edge] = []
        for wanted in self._schedules():
            first = max(0, begin - wanted.margin)
            last = min(seen + wanted.margin, int(self.place.reach))
            made = _undriven_as_low(self._levels_before(first), self._edges(first, last))
            around = wanted.edges(begin - wanted.margin, end + wanted.margin)
            asked += [edge for edge in around if begin <= edge[0] < end]
            near = [edge for edge in around if edge[0] < seen + wanted.margin]
            alone += differing(wanted, made, begin, seen, near)
        return sorted(asked), sorted(alone)

    def _outside(self, begin: int, end: int) -> list[Edge]:
        """Return the changes from outside before `end`: the last of each pin before `begin`, and the rest."""
        if self.chip is None:
            return []
        stimuli, live = self.subject.stimuli, self.chip.inputs
        known = takewhile(
            lambda change: change.cycle < end,
            stimuli.all_changes(self.subject.clock) if stimuli else iter(()),
        )
        changes = [*islice(known, MAX_CHANGES), *(change for change in live if change.cycle < end)]
        changes.sort(key=lambda change: change.cycle)
        before = {change.pin: change for change in changes if change.cycle < begin}
        shown = (*before.values(), *(change for change in changes if change.cycle >= begin))
        return [(change.cycle, change.pin, change.level) for change in shown]

    def _do_pin(self, message: Mapping[str, Any]) -> Iterator[Message]:
        """Hold a pin (or MCLR) at a level from outside, or release it."""
        pin, level = pin_number(str(message["pin"])), int(message["level"])
        if level not in (0, 1, UNDRIVEN):
            raise InputError("not-allowed", f"level {level} is neither 0, 1 nor 2 (let go)")
        self._apply([LevelChange(self.now + 1, pin, level)])
        self.outside[pin] = level
        yield self.shown()

    def _do_serial(self, message: Mapping[str, Any]) -> Iterator[Message]:
        """Send bytes to the chip, after those that are still on the line."""
        data = bytes(int(byte) for byte in message["bytes"])[:MAX_SERIAL_BYTES]
        baud = Fraction(int(message["baud"]))
        _check_baud(baud)
        self._send(data, str(message["pin"]), baud)
        yield self.shown(whole=False)

    def _do_listen(self, message: Mapping[str, Any]) -> Iterator[Message]:
        """Decode the bytes that the chip sends on a pin from now on; "": on none."""
        name, baud = str(message.get("pin", "")), Fraction(int(message.get("baud", 0)))
        self.listener = None
        if name:
            _check_baud(baud)
            self.listener = SerialListener(pin_number(name), baud, self.subject.clock)
            self.listener.restart(self.place.levels_before(self.now))
        yield from ()

    def _do_walk(self, message: Mapping[str, Any]) -> Iterator[Message]:
        """Send the code of a way, or the one to stop, to the line of a robot that walks on command."""
        job = self.subject.job
        commands = job.commands if job else None
        if job is None or not isinstance(commands, CommandLine):
            raise InputError(
                "not-allowed",
                "only a job with [walk] commands or [motion.commands] on a line takes directions",
            )
        commanded, ways = str(message["way"]), (*(direction.name for direction in job.directions), STOP)
        if commanded not in ways:
            raise InputError("not-allowed", f"'{commanded[:40]}' is not a direction", hint=", ".join(ways))
        code = bytes([uart_byte(None if commanded == STOP else commanded, commands.codes)] * REPEATS)
        self._send(code, commands.pin, self.subject.clock.cycles_per_second / self._period)
        yield self.shown(whole=False)

    def _do_servo(self, message: Mapping[str, Any]) -> Iterator[Message]:
        """Command a position of 0 to 254 to a servo of a stream job."""
        job = self.subject.job
        if job is None or job.stream is None:
            raise InputError("not-allowed", "only a job with [stream] takes positions")
        number = int(message["servo"])
        position = max(0, min(MAX_VALUE, int(message["position"])))
        if not 0 <= number < len(job.servos):
            raise InputError("not-allowed", f"there is no servo {number}")
        command = bytes((SYNC, number, position))
        self._send(command, job.stream.receive_pin, Fraction(job.stream.baud))
        if self.live is not None:
            self.live.command(number, command)
            if self.live.problem:
                yield _problem(f"the robot: {self.live.problem}")
        yield self.shown(whole=False)

    def _send(self, data: bytes, pin: str, baud: Fraction) -> None:
        begin = (
            max(self.now + 1, self._line_free) if self._line_free - self.now < 10_000_000 else self.now + 1
        )
        number, bit = pin_number(pin), self.subject.clock.cycles_per_second / baud
        changes: list[LevelChange] = []
        if self._is_open(number):  # a line idles high; the first start bit comes a byte later
            changes, self.outside[number] = [LevelChange(self.now + 1, number, HIGH)], HIGH
            begin = max(begin, self.now + 1 + int(10 * bit))
        source = Serial(number, data, baud, start=begin)
        changes += [change for change in source.changes(self.subject.clock) if change.cycle > begin - 1]
        bits = 10 * len(data) * bit
        self._line_free = begin + int(bits) + 1
        self._apply(changes)

    def _is_open(self, pin: int) -> bool:
        """Return whether nothing holds a pin from outside, neither the window nor the stimulus."""
        driven = {edge[1] for edge in self._outside(0, self.now + 1) if edge[2] != UNDRIVEN}
        return self.outside[pin] == UNDRIVEN and pin not in driven

    def _apply(self, changes: Sequence[LevelChange]) -> None:
        """Do something to the pins from now on: the future that was known is another one."""
        self._program().apply(changes)
        if self.bodies is not None:
            self.bodies.forget(self.now)

    def _do_bodies(self, message: Mapping[str, Any]) -> Iterator[Message]:
        """Let the physics follow from power-up on, or end it."""
        if not message.get("on"):
            self.bodies = None
            return
        try:
            self.bodies = self.bodies or LiveBodies(self.subject, self.place)
        except ServogenError as error:
            yield _without_bodies(error)
            return
        yield {"is": "bodies-model", "model": self.bodies.model()}

    def _program(self) -> TimeMachine:
        if self.chip is None:
            raise InputError("not-allowed", "a recording has no inputs")
        return self.chip

    def _do_explain(self, message: Mapping[str, Any]) -> Iterator[Message]:
        name, chip = str(message["pin"]), self._program()
        if name in _pin_names(self.subject)[OTHER_PINS:]:
            number, _, pin = name.partition(".")
            said = f"{pin} is on chip {number}: choose that chip to be told why it is as it is"
            yield {"is": "explanation", "pin": _pin_names(self.subject).index(name), "lines": [said]}
            return
        number_on_chip = pin_number(name)
        yield {"is": "explanation", "pin": number_on_chip, "lines": explain_pin(chip, number_on_chip)}

    def come_back(self, place: Mapping[str, Any]) -> None:
        """Restore the place that a window had on a server that has ended, but for what is wrong with it."""
        texts = place.get("breakpoints")
        for text in texts[:MAX_BREAKPOINTS] if isinstance(texts, list) else ():
            deque(self.handle({"do": "breakpoint", "text": text, "on": True}), 0)
        deque(self.handle({"do": "seek", "cycle": place.get("cycle")}), 0)

    def knows(self, repetition: Repetition | None) -> None:
        """Use a loop of states that is known of the program, unless this window has acted on the pins."""
        self.learning = False
        if self.chip is not None and self.chip.touched == inf:
            self.chip.repetition = repetition
            if self._way is not None:
                self._way = self.chip.going(self._goal)

    def continued(
        self, subject: Subject, repetition: Repetition | None = None, *, learning: bool = False
    ) -> WatchSession:
        """Return a session of another version of the subject at the same moment."""
        fresh = WatchSession(subject, self.live, repetition, learning=learning)
        fresh.speed, fresh.running, fresh.listener = self.speed, self.running, self.listener
        fresh._go(self._goal if self._way is not None else self.now)
        if self.bodies is not None:
            with suppress(ServogenError):  # a version without a robot has none
                fresh.bodies = LiveBodies(subject, fresh.place)
        return fresh


class LatestPulses:
    """The level of each pin, and the width of its latest pulse."""

    def __init__(self, pins: int = len(PINS)) -> None:
        self.levels = [UNDRIVEN] * pins
        self.held = [0] * pins
        """The width of the latest pulse of each pin, however old; 0 if none is known."""
        self._fall = [0] * pins
        self._reader = PulseReader()

    def add(self, chunk: EdgeChunk) -> None:
        """Take further edges into account."""
        for pin, level in zip(chunk.pin.tolist(), chunk.level.tolist(), strict=True):
            self.levels[pin] = level
        ended = self._reader(chunk).whole()
        columns = (ended.pin, ended.fall, ended.width)
        for pin, fall, width in zip(*(column.tolist() for column in columns), strict=True):
            self.held[pin], self._fall[pin] = width, fall

    def widths(self, now: int, silence: int) -> list[int]:
        """Return the width of the latest pulse of each pin; 0 where the latest is older than `silence`."""
        return [
            width if width and now - fall <= silence else 0
            for width, fall in zip(self.held, self._fall, strict=True)
        ]


STEPS = ("instruction", "line", "edge", "frame")

ACTIONS: Mapping[str, Callable[[WatchSession, Mapping[str, Any]], Iterator[Message]]] = MappingProxyType(
    {
        "run": WatchSession._do_run,
        "step": WatchSession._do_step,
        "seek": WatchSession._do_seek,
        "breakpoint": WatchSession._do_breakpoint,
        "waves": WatchSession._do_waves,
        "pin": WatchSession._do_pin,
        "serial": WatchSession._do_serial,
        "listen": WatchSession._do_listen,
        "servo": WatchSession._do_servo,
        "walk": WatchSession._do_walk,
        "bodies": WatchSession._do_bodies,
        "explain": WatchSession._do_explain,
    }
)
"""The requests of a window, by name."""

UNDISTURBING = ("waves", "bodies", "listen", "explain")
"""The requests that do not end the way to a moment."""


def _period(subject: Subject) -> int:
    """Return a frame in the subject's own steps: 20 ms where no schedule says how long it is."""
    if subject.schedule is None:
        return int(subject.clock.round_seconds(FRAME_S))
    return int(subject.clock.round_seconds(subject.schedule.clock.seconds(subject.schedule.period)))


def _loop(subject: Subject) -> int | None:
    """Return the cycles of the schedule's loop, after which its program does the same again."""
    schedule = subject.schedule
    if schedule is None or schedule.clock != subject.clock:
        return None
    return int(schedule.loop_frames * schedule.period)


def find_repetition(subject: Subject) -> Repetition | None:
    """Return the loop of states that the subject's program falls into after power-up; None: not known.

    Without it the first jump to a far moment takes a few seconds.
    """
    loop = _loop(subject)
    if subject.image is None or loop is None:
        return None
    chip = TimeMachine(
        *(subject.image, subject.clock, subject.options, subject.stimuli),
        loop=loop,
        machine=subject.powered(),
        stride_s=LEARNING_S,
    )
    for _ in chip.going(int(subject.clock.round_seconds(MAX_CYCLE_S))):
        if chip.repetition is not None or chip.now > subject.clock.round_seconds(MAX_REPETITION_S):
            break
    return chip.repetition


def _mark(warning: Diagnostic) -> Message:
    """Return a warning, and the line of the source at which it stands."""
    place = warning.location
    line = place.line if place else None
    said = f"{warning.message} ({warning.hint})" if warning.hint else warning.message
    return {
        "text": f"{warning.severity}: {said}" if line else warning.sentence,
        "file": place.file if place else None,
        "line": line,
    }


def _check_baud(baud: Fraction) -> None:
    if not 50 <= baud <= 115_200:
        raise InputError("not-allowed", f"{baud} baud: allowed are 50 to 115200")


def _problem(text: str) -> Message:
    return {"is": "problem", "text": text}


def _without_bodies(error: ServogenError) -> Message:
    return {"is": "bodies-model", "model": None, "text": str(error)}


def _edge_deltas(edges: Iterable[Edge], begin: int) -> list[int]:
    """Return edges as differences of cycles and pin * 4 + level, one after the other."""
    packed, last = [], begin
    for cycle, pin, level in islice(edges, MAX_EDGES):
        packed += [cycle - last, pin * 4 + level]
        last = cycle
    return packed


def _pulses_in(before: tuple[int, ...], edges: EdgeChunk, begin: int, end: int) -> Pulses:
    """Return the pulses of a window; one that was high before it rises one cycle before, if there is one."""
    reader = PulseReader(begin - 1)
    if begin:
        high = np.array([pin for pin, level in enumerate(before) if level == HIGH], np.uint8)
        reader(EdgeChunk(np.full(len(high), begin - 1), high, np.full(len(high), HIGH, np.uint8)))
    return joined([reader(edges), reader.cut(end)])


def _pulse_deltas(pulses: Pulses, begin: int) -> list[int]:
    """Return pulses as the time since the rise before, the width and the pin, one after the other."""
    pulses = pulses.take(np.argsort(pulses.rise, kind="stable"))
    columns = (np.diff(pulses.rise, prepend=begin), pulses.width, pulses.pin)
    return np.column_stack(columns).ravel().tolist()


def _floating(before: tuple[int, ...], edges: EdgeChunk) -> Iterator[Edge]:
    """Yield the edges by which a pin begins to float or is driven."""
    levels = list(before)
    for cycle, pin, level in zip(*(column.tolist() for column in edges), strict=True):
        if UNDRIVEN in (level, levels[pin]):
            yield cycle, pin, level
        levels[pin] = level


def _undriven_as_low(before: tuple[int, ...], edges: EdgeChunk) -> EdgeChunk:
    """Return the edges with an undriven pin counted as low, given the levels before them."""
    driven = Driven()
    high = [pin for pin, level in enumerate(before) if level == HIGH]
    begin = int(edges.cycle[0]) if len(edges.cycle) else 0
    start = EdgeChunk(
        np.full(len(high), begin, np.int64), np.array(high, np.uint8), np.ones(len(high), np.uint8)
    )
    driven(start)
    return driven(edges)


def _runs(runs: tuple[Run, ...]) -> list[list[Any]]:
    """Return runs of frames: how many, and the [rise, width] of each channel's pulse."""
    return [
        [run.frames, [[pulse.rise, pulse.width] if pulse else None for pulse in run.pulses]] for run in runs
    ]


def _pin_names(subject: Subject) -> list[str]:
    """Return the name of each pin by its number: those of a chip that is not shown have its number before."""
    names = [*PINS, STIMULUS_PINS[MCLR_PIN]]
    if subject.pair is not None:
        names += [""] * (OTHER_PINS - len(names))
        names += [f"{2 - subject.shown}.{pin}" for pin in PINS]
    return names


def _schedule(subject: Subject) -> Message | None:
    """Return the runs of the schedule; those of two chips joined, with a pulse for each servo of the job."""
    pair, schedule = subject.pair, subject.schedule
    if schedule is None:
        return None
    if pair is None or subject.job is None:
        return {"lead_in": _runs(schedule.lead_in), "loop": _runs(schedule.loop)}
    first, second = pair.schedules
    names = [channel.name for each in pair.schedules for channel in each.channels]
    order = [names.index(servo.name) for servo in subject.job.servos]
    waiting = Run(first.lead_in_frames - second.lead_in_frames, (None,) * len(second.channels))

    def pair_runs(leads: tuple[Run, ...], follows: tuple[Run, ...]) -> list[list[Any]]:
        frames = (
            tuple((*mine, *theirs)[place] for place in order)
            for mine, theirs in zip(_frames(leads), _frames(follows), strict=True)
        )
        return _runs(tuple(Run(len(list(alike)), pulses) for pulses, alike in groupby(frames)))

    return {
        "lead_in": pair_runs(first.lead_in, (waiting, *second.lead_in)),
        "loop": pair_runs(first.loop, second.loop),
    }


def _frames(runs: tuple[Run, ...]) -> Iterator[tuple[Pulse | None, ...]]:
    for run in runs:
        yield from repeat(run.pulses, run.frames)


def _robot(subject: Subject) -> Mapping[str, Any] | None:
    """Return what the pulses move: the robot of the job, or only the servos that the schedule names."""
    if subject.robot is not None:
        return subject.robot
    if subject.job is not None:
        return robot_model(subject.job, subject.shown)
    return None if subject.schedule is None else schedule_model(subject.schedule)


def _motion_begin(subject: Subject) -> int:
    """Return the number of frames that the engine plays before the job's own motion."""
    if subject.job is None or subject.stated is None:
        return 0
    return len(subject.job.trajectory.angles) - len(subject.stated.trajectory.angles)


def _servo_pins(subject: Subject) -> list[int]:
    robot = _robot(subject)
    return [servo["pin"] for servo in robot["servos"]] if robot else []


def job_buttons(subject: Subject) -> list[Message]:
    """Return the buttons of a job: name, pin, and the level at which each is pressed."""
    if subject.job is None:
        return []
    buttons = subject.job.buttons
    named = [("start", buttons.start), ("stop", buttons.stop)]
    if isinstance(subject.job.commands, CommandButtons):
        named += subject.job.commands.buttons.items()
    elif isinstance(subject.job.commands, CommandButton):
        named.append((subject.job.commands.name, subject.job.commands.button))
    return [{"name": name, "pin": button.pin, "pressed": button.level} for name, button in named if button]


def _serial(subject: Subject) -> Message | None:
    """Return the serial line of a job."""
    stream = subject.job.stream if subject.job else None
    if stream is None:
        return None
    return {"pin": stream.receive_pin, "baud": stream.baud, "answers": stream.transmit_pin}


def _bus(subject: Subject) -> Message | None:
    """Return the pins of a job's serial EEPROM."""
    tape = subject.schedule.tape if subject.schedule else None
    return None if tape is None else {"scl": tape.scl, "sda": tape.sda}


def _clocks(machine: Machine) -> int | None:
    """Return the clocks of the byte that is on the bus of a tape; None before a start."""
    return next(device.clocks for device in machine.devices if isinstance(device, RunningEEPROM))


def _walk(subject: Subject) -> Message | None:
    """Return the ways of a robot that walks as codes command."""
    if subject.job is None or not isinstance(subject.job.commands, CommandLine):
        return None
    return {
        "pin": subject.job.commands.pin,
        "ways": [direction.name for direction in subject.job.directions],
        "stop": STOP,
    }
