"""`SeenChip`: a chip on the bench or in a recording, which a test runs, acts upon, and sees from outside.

In: what the test does. Out: the same measurements as of a simulated `Chip`. What a test does is collected
into a run, which is played when the test looks:

    chip.press("RB0", hold_ms=60)      at 0 ms: RB0 = 0; at 60 ms: RB0 = 1
    chip.run_ms(120)                   the run lasts 120 ms
    chip.pin("RB7")                    it is played and captured; RB7 at its end

Between two runs unknown time passes. What shows nothing at the pins skips the test, with the reason.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import combinations
from math import ceil
from typing import NoReturn, Protocol

import pytest

from servogen.bench.inputs.adapter import BoardInput, Close, DrivePin, Send
from servogen.bench.inputs.wiring import MCLR, VDD, Contact, InputWiring
from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeTrace, join
from servogen.errors import InputError
from servogen.pic.image import Image
from servogen.simulator import Periodic, Serial, Stimuli
from servogen.simulator.layout import MCLR_PIN
from servogen.simulator.pin_levels import at_the_pins
from servogen.testing.chip import (
    Chip,
    Keypad,
    check_hold,
    check_time,
    checked_level,
    contact_changes,
    crossings,
)
from servogen.testing.signals import Signals, pin_index
from servogen.testing.targets import (
    BOARD_LATE_MS,
    HOST_LATE_MS,
    Bench,
    BenchRun,
    BenchStart,
    CaptureRequest,
    SeenPins,
    uses_eeprom,
)
from servogen.testing.waves import wave_lines
from servogen.units import Clock
from servogen.verify.measurement import time_words

DATA_BITS = 8
FRAME_BITS = 10
SMALLEST_STEP_MS = 1
"""The resolution of an input board, which plays changes at whole milliseconds."""

_EDGE = re.compile(r"(?P<pin>R[AB]\d)(?:\s+(?P<way>rise|fall))?", re.IGNORECASE)
_PORTS = {"PORTA": 0, "PORTB": 5}
"""The first pin of each port in `PINS`."""


class Player(Protocol):
    """Plays runs: a bench, or recordings of one."""

    @property
    def wiring(self) -> InputWiring | None:
        """Return what can be driven; None: nothing."""

    @property
    def serial_pin(self) -> str | None:
        """Return the pin that a serial adapter sends to."""

    @property
    def late_ms(self) -> int:
        """Return by how much an input may be late."""

    def play(self, segment: BenchRun) -> Sequence[SeenPins]:
        """Return what was seen during a run; nothing where a recording shows it already."""

    def eeprom(self) -> bytes: ...


@dataclass(slots=True)
class _Look:
    """The moment of the last piece that the test examines."""

    piece: int
    ms: float


class SeenChip(Signals):
    """A chip whose pins are driven and seen."""

    def __init__(
        self,
        name: str,
        clock: Clock,
        player: Player,
        image: Image | None = None,
        inputs: Mapping[str, int] | None = None,
        stimuli: Stimuli | None = None,
    ) -> None:
        self.name = name
        self.clock = clock
        self.seen: list[SeenPins] = []
        self._player = player
        self._image = image
        self._levels: dict[str, int | None] = {}
        self._contacts: dict[Contact, bool] = {}
        self._inputs: list[BoardInput] = []
        """The inputs of the run that is being collected, and of later ones."""
        self._length_ms = Fraction(0)
        """The length of the run that is being collected."""
        self._past_ms = Fraction(0)
        """The length of the runs since the last start."""
        self._start = BenchStart.CONTINUE
        self._first = 0
        """The index of the piece that began at the last start."""
        self._look: _Look | None = None
        for pin, level in (inputs or {}).items():
            pin_index(pin)
            self._needs_board(f"inputs={{'{pin}': {level}}}", pin)
            self._levels[pin.upper()] = checked_level(pin, level)
        if stimuli is not None:
            for input_ in stimulus_inputs(stimuli, clock):
                self._check_possible(input_.what)
                if isinstance(input_.what, DrivePin) and input_.at_ms == 0:
                    self._levels[input_.what.name] = input_.what.level
                else:
                    self._inputs.append(input_)
        wiring = player.wiring
        if wiring is not None and MCLR in wiring.pins:
            self._start = BenchStart.RESET

    # Time

    @property
    def ms(self) -> float:
        """Return how long the test has let the chip run since it was started."""
        return float(self._past_ms + self._length_ms)

    @property
    def us(self) -> float:
        return 1000 * self.ms

    @property
    def cycle(self) -> int:
        return int(self.clock.round_us(Fraction(self.us)).cycles)

    def run_s(self, s: float) -> None:
        check_time("s", s, Fraction(1))
        self._run(Fraction(str(s)) * 1000)

    def run_ms(self, ms: float) -> None:
        check_time("ms", ms, Fraction(1, 1000))
        self._run(Fraction(str(ms)))

    def run_us(self, us: float) -> None:
        check_time("us", us, Fraction(1, 1_000_000))
        self._run(Fraction(str(us)) / 1000)

    def run_cycles(self, cycles: int) -> None:
        self._run(self.clock.us(int(cycles)) / 1000)

    def run_until(self, what: str, *, within_ms: float = 1000) -> float:
        """Run until an edge of a pin, as "RB0 rise", and return its time in µs. Fails if it does not come.

        The chip runs on after it: what the test does next happens later.
        """
        __tracebackhide__ = True
        match = _EDGE.fullmatch(what.strip()) if isinstance(what, str) else None
        if match is None:
            self._skip(f"run_until({what!r})", "only edges of pins are seen on a bench")
        pin = pin_index(match["pin"])
        level = {"rise": HIGH, "fall": LOW}.get((match["way"] or "").lower())
        check_time("within_ms", within_ms, Fraction(1, 1000))
        within = within_ms + self._player.late_ms
        look = self._look
        if not self._collected and look is not None:
            edge_ms = self._next_edge(look.piece, pin, level, look.ms, look.ms + within)
            if edge_ms is not None:
                self._look = _Look(look.piece, edge_ms)
                return 1000 * edge_ms
            if look.ms + within <= self._captured_ms(look.piece):
                raise self._failure(what, within_ms)
        begin = float(self._length_ms)
        self._length_ms += Fraction(within)
        self._flush()
        assert self._look is not None
        edge_ms = self._next_edge(self._look.piece, pin, level, begin, begin + within)
        if edge_ms is None:
            raise self._failure(what, within_ms)
        self._look = _Look(self._look.piece, edge_ms)
        return 1000 * edge_ms

    # Acting

    def drive(self, pin: str, level: int | None) -> None:
        self._needs_board("drive", pin)
        self._do(DrivePin(pin.upper(), None if level is None else checked_level(pin, level)))

    def press(
        self,
        pin: str,
        *,
        bounce_ms: float = 0,
        bounces: int = 5,
        hold_ms: float | None = None,
        active: int = LOW,
        seed: int = 1,
    ) -> None:
        self._needs_board("press", pin)
        if hold_ms is not None:
            check_time("hold_ms", hold_ms, Fraction(1, 1000))
            check_time("bounce_ms", bounce_ms, Fraction(1, 1000))
            check_hold(self.clock, hold_ms, bounce_ms)
        self._contact(pin, checked_level(pin, active), bounce_ms, bounces, seed)
        if hold_ms is not None:
            self._contact(pin, 1 - active, bounce_ms, bounces, seed + 1, Fraction(str(hold_ms)))

    def release(
        self, pin: str, *, bounce_ms: float = 0, bounces: int = 5, active: int = LOW, seed: int = 1
    ) -> None:
        self._needs_board("release", pin)
        self._contact(pin, 1 - checked_level(pin, active), bounce_ms, bounces, seed)

    def bounce(self, pin: str, *, ms: float, bounces: int = 5, seed: int = 1) -> None:
        self._needs_board("bounce", pin)
        level = self._levels.get(pin.upper())
        self._contact(pin, self.pin(pin) if level is None else level, ms, bounces, seed)

    def tie(self, *pins: str) -> None:
        for other in pins[1:] or pins:
            self.switch(pins[0], other, True)

    def untie(self, *pins: str) -> None:
        for other in pins[1:] or pins:
            self.switch(pins[0], other, False)

    def switch(
        self, pin: str, other: str, closed: bool, *, bounce_ms: float = 0, bounces: int = 5, seed: int = 1
    ) -> None:
        contact = self._wired_contact(pin, other)
        for ms, level in self._bouncing(HIGH if closed else LOW, bounce_ms, bounces, seed):
            self._do(Close(contact, bool(level)), ms)

    def keypad(self, rows: Sequence[str], columns: Sequence[str], keys: str) -> Keypad:
        crossing = crossings(rows, columns, keys)
        for row, column in crossing.values():
            self._wired_contact(row, column)
        return Keypad(self, crossing)

    def send(
        self,
        pin: str,
        data: bytes | str,
        baud: float,
        *,
        inverted: bool = False,
        baud_error_percent: float = 0,
    ) -> None:
        name = pin.upper()
        pin_index(pin)
        wiring = self._player.wiring
        lines = {} if wiring is None else wiring.lines
        if name not in lines and self._player.serial_pin != name:
            self._skip("send", f"no serial line goes to {name}: --servogen-input={name}=TX1")
        if inverted:
            self._skip("send(inverted=True)", "the board's serial lines idle high")
        rate = round(baud * (1 + baud_error_percent / 100))
        sent = data.encode() if isinstance(data, str) else bytes(data)
        frame_ms = Fraction(1000 * FRAME_BITS, rate)
        self._do(Send(name, sent, rate), ceil(frame_ms))
        self._length_ms += ceil(frame_ms) + ceil(len(sent) * frame_ms)

    def reset(self, *, hold_ms: float = 1) -> None:
        wiring = self._player.wiring
        if wiring is None or MCLR not in wiring.pins:
            self._skip("reset", "MCLR is not wired to an input board")
        check_time("hold_ms", hold_ms, Fraction(1, 1000))
        hold = max(SMALLEST_STEP_MS, ceil(hold_ms))
        self._do(DrivePin(MCLR, LOW))
        self._do(DrivePin(MCLR, HIGH), hold)
        self._length_ms += hold

    def power_cycle(self) -> None:
        wiring = self._player.wiring
        if wiring is None or VDD not in wiring.pins:
            self._skip("power_cycle", "the supply is not wired to an input board: --servogen-input=VDD=17")
        self._flush()
        self._start, self._first, self._look = BenchStart.POWER_UP, len(self.seen), None
        self._past_ms = Fraction(0)

    # Looking

    def pin(self, pin: str) -> int:
        """Return the level at a pin at the end of the run, or where `run_until` found its edge."""
        index = pin_index(pin)
        look = self._record()
        return self._level_at(look.piece, index, look.ms)

    def register(self, name: str) -> int:
        """Return PORTA or PORTB: the levels at the pins."""
        first = _PORTS.get(name.upper())
        if first is None:
            self._skip(f"register('{name}')", "only PORTA and PORTB, the levels at the pins, are seen")
        look = self._record()
        pins = range(first, 5 if first == 0 else len(PINS))
        return sum(self._level_at(look.piece, pin, look.ms) << pin - first for pin in pins)

    @property
    def eeprom(self) -> bytes:
        """Return the EEPROM, read by the programmer; the program then starts again."""
        self._flush()
        contents = self._player.eeprom()
        self._look = None
        return contents

    def pieces(self) -> Sequence[EdgeTrace]:
        self._flush()
        return tuple(seen.trace for seen in self.seen[self._first :])

    @property
    def from_reset(self) -> bool:
        return False

    def chip_clock(self) -> Clock:
        return self.clock

    def seen_pin(self, name: str) -> int:
        index = pin_index(name)
        self._flush()
        for seen in self.seen[self._first :]:
            seen.require(index)
        return index

    def report(self) -> list[str]:
        """Return the waves of the last capture."""
        if not self.seen:
            return ["nothing was captured"]
        last = self.seen[-1].trace
        return wave_lines(at_the_pins(join(last.chunks), ()), int(last.end), last.clock)

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("_") or not hasattr(Chip, name):
            raise AttributeError(f"a chip has no '{name}'")
        self._skip(name, "it is inside the chip, and on the bench only the pins are seen")

    # How it works

    @property
    def _collected(self) -> bool:
        """Return whether inputs have to be played before the test can measure."""
        return bool(self._length_ms) or any(input_.at_ms <= 0 for input_ in self._inputs)

    def _run(self, ms: Fraction) -> None:
        look = self._look
        if (
            look is not None
            and not self._collected
            and not self._inputs
            and look.ms + ms <= self._captured_ms(look.piece)
        ):
            self._look = _Look(look.piece, look.ms + float(ms))  # captured already
            self._past_ms += ms
        else:
            self._length_ms += ms

    def _flush(self) -> None:
        """Play what was collected."""
        if not self._collected:
            return
        length = self._length_ms
        end = ceil(length)
        now = tuple(input_ for input_ in self._inputs if input_.at_ms <= end)
        segment = BenchRun(
            self.clock,
            float(max(length, Fraction(SMALLEST_STEP_MS)) / 1000),
            dict(self._levels),
            dict(self._contacts),
            now,
            self._start,
            self._start is not BenchStart.CONTINUE and (self._image is None or not uses_eeprom(self._image)),
        )
        self._inputs = [
            BoardInput(input_.at_ms - end, input_.what) for input_ in self._inputs if input_.at_ms > end
        ]
        self._length_ms, self._start = Fraction(0), BenchStart.CONTINUE
        more = self._player.play(segment)
        self.seen += more
        for input_ in now:
            match input_.what:
                case DrivePin(name, level):
                    self._levels[name] = level
                case Close(contact, closed):
                    self._contacts[contact] = closed
                case Send(pin):
                    self._levels.pop(pin, None)
        begin = 0.0 if more else float(self._past_ms)
        self._past_ms += length
        if self.seen:
            self._look = _Look(len(self.seen) - 1, begin + float(length))

    def _record(self) -> _Look:
        self._flush()
        if self._look is None:
            self._length_ms += SMALLEST_STEP_MS
            self._flush()
        assert self._look is not None
        return self._look

    def _captured_ms(self, piece: int) -> float:
        trace = self.seen[piece].trace
        return float(trace.clock.us(int(trace.end))) / 1000

    def _changes(self, piece: int, pin: int) -> Iterator[tuple[float, int]]:
        """Yield (ms, level) of a pin, low where nothing drives it. Raises InputError if it was not seen."""
        self.seen[piece].require(pin)
        trace = self.seen[piece].trace
        edges = join(trace.chunks)
        own = edges.pin == pin
        for cycle, level in zip(edges.cycle[own].tolist(), edges.level[own].tolist(), strict=True):
            yield float(trace.clock.us(cycle)) / 1000, LOW if level == UNDRIVEN else level

    def _level_at(self, piece: int, pin: int, ms: float) -> int:
        changes = list(self._changes(piece, pin))
        index = bisect_right(changes, ms, key=lambda change: change[0]) - 1
        return changes[index][1] if index >= 0 else LOW

    def _next_edge(self, piece: int, pin: int, level: int | None, begin: float, end: float) -> float | None:
        before = LOW
        for ms, now in self._changes(piece, pin):
            if begin < ms <= end and now != before and level in (None, now):
                return ms
            before = now
        return None

    def _failure(self, what: str, within_ms: float) -> AssertionError:
        last = self.seen[-1].trace
        end = time_words(int(last.end), last.clock)
        return AssertionError(f"{what}: not within {within_ms:g} ms; the capture ends at {end}")

    def _do(self, action: DrivePin | Close | Send, after_ms: int | Fraction = 0) -> None:
        self._inputs.append(BoardInput(round(self._length_ms + after_ms), action))

    def _bouncing(
        self, level: int, bounce_ms: float, bounces: int, seed: int
    ) -> Iterator[tuple[Fraction, int]]:
        for cycle, now in contact_changes(self.clock, 0, level, bounce_ms, bounces, seed):
            yield self.clock.us(cycle) / 1000, now

    def _contact(
        self,
        pin: str,
        level: int,
        bounce_ms: float,
        bounces: int,
        seed: int,
        after_ms: Fraction = Fraction(0),
    ) -> None:
        for ms, now in self._bouncing(level, bounce_ms, bounces, seed):
            self._do(DrivePin(pin.upper(), now), after_ms + ms)

    def _needs_board(self, feature: str, pin: str) -> None:
        pin_index(pin)
        wiring = self._player.wiring
        if wiring is None:
            self._skip(
                feature, "nothing drives the chip's inputs here: --servogen-inputs=PORT, an input board"
            )
        if pin.upper() not in wiring.pins:
            self._skip(feature, f"{pin.upper()} is not wired to the input board")

    def _wired_contact(self, pin: str, other: str) -> Contact:
        pin_index(pin), pin_index(other)
        contact = frozenset((pin.upper(), other.upper()))
        wiring = self._player.wiring
        if wiring is None or contact not in wiring.contacts:
            names = f"{pin.upper()}-{other.upper()}"
            self._skip("switch", f"the input board has no contact {names}: --servogen-input={names}=22")
        return contact

    def _check_possible(self, action: DrivePin | Close | Send) -> None:
        """Skip the test where what a stimulus does cannot be played."""
        match action:
            case DrivePin(name) if name in PINS:
                self._needs_board("stimulus", name)
            case DrivePin():
                if self._player.wiring is None:
                    self._skip("stimulus", "nothing drives the chip's inputs here")
            case Send(pin):
                wiring = self._player.wiring
                if self._player.serial_pin != pin and (wiring is None or pin not in wiring.lines):
                    self._skip("stimulus", f"no serial line goes to {pin}: --servogen-input={pin}=TX1")

    def _skip(self, feature: str, why: str) -> NoReturn:
        pytest.skip(f"needs the simulated chip: chip.{feature}; {why}")


def stimulus_inputs(stimuli: Stimuli, clock: Clock) -> list[BoardInput]:
    """Return what a stimulus does, at whole milliseconds; skips the test where that is too coarse."""
    inputs = []
    for source in stimuli.sources:
        if isinstance(source, Serial):
            rate = round(source.baud * (1 + source.baud_error))
            if source.inverted:
                pytest.skip("needs the simulated chip: the board's serial lines idle high")
            frame = (1 + DATA_BITS + source.stop_bits) * clock.cycles_per_second / rate + source.gap
            for place, byte in enumerate(source.data):
                ms = round(clock.us(round(source.start + place * frame)) / 1000)
                inputs.append(BoardInput(ms, Send(PINS[source.pin], bytes((byte,)), rate)))
            continue
        if isinstance(source, Periodic):
            pytest.skip("needs the simulated chip: an input board does not make a periodic signal")
        for change in source.changes(clock):
            name = MCLR if change.pin == MCLR_PIN else PINS[change.pin]
            level = None if change.level == UNDRIVEN else change.level
            inputs.append(BoardInput(round(clock.us(change.cycle) / 1000), DrivePin(name, level)))
    return inputs


@dataclass(frozen=True, slots=True)
class BenchPlayer:
    """Plays runs on the chip on the bench."""

    bench: Bench

    @property
    def wiring(self) -> InputWiring | None:
        return None if self.bench.inputs is None else self.bench.inputs.wiring

    @property
    def serial_pin(self) -> str | None:
        return self.bench.inputs.serial_pin if self.bench.inputs and self.bench.inputs.serial else None

    @property
    def late_ms(self) -> int:
        adapter = self.bench.adapter()
        return 0 if adapter is None else BOARD_LATE_MS if adapter.board.scheduler else HOST_LATE_MS

    def play(self, segment: BenchRun) -> Sequence[SeenPins]:
        return [self.bench.play(segment)]

    def eeprom(self) -> bytes:
        if self.bench.programmer is None:
            pytest.skip(
                "needs the simulated chip: chip.eeprom; no programmer reads it: --servogen-programmer"
            )
        return self.bench.eeprom()


def played_once(bench: Bench, request: CaptureRequest, image: Image | None) -> SeenPins:
    """Return what the pins do from reset on while a stimulus is played, for as long as is asked for."""
    chip = SeenChip("", request.clock, BenchPlayer(bench), image, stimuli=request.stimuli)
    chip.run_s(float(request.clock.seconds(request.cycles)))
    chip.pieces()
    return chip.seen[0]


EVERYTHING = InputWiring(
    dict.fromkeys((*PINS, MCLR, VDD), 0),
    {frozenset(pair): 0 for pair in combinations(PINS, 2)},
    dict.fromkeys(PINS, 0),
)
"""The wiring of a replayed chip, on which a test may do everything."""


@dataclass(slots=True)
class ReplayPlayer:
    """Shows recordings, one for each run; a recording of the simulated chip shows all of its runs."""

    recordings: list[SeenPins]
    wiring: InputWiring | None = EVERYTHING
    serial_pin: str | None = None
    late_ms: int = HOST_LATE_MS
    _shown: int = field(default=0)

    def play(self, segment: BenchRun) -> Sequence[SeenPins]:
        if segment.start is BenchStart.POWER_UP and self.recordings[0].capture is None:
            pytest.skip(
                "needs a bench: of the simulated chip only what followed the last power-up is recorded"
            )
        if self._shown and self.recordings[self._shown - 1].capture is None:
            return []
        if self._shown == len(self.recordings):
            raise InputError(
                "unreadable-file", f"there are {self._shown} recordings, and the test has more runs"
            )
        seen = self.recordings[self._shown]
        self._shown += 1
        if seen.capture is not None and seen.capture.missing:
            raise InputError("capture-failed", f"{seen.source} is incomplete: {seen.capture.missing}")
        return [seen]

    def eeprom(self) -> bytes:
        pytest.skip("needs the simulated chip: chip.eeprom; a recording shows only the pins")
