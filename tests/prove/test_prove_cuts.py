"""The choice of cut points and what is dead there, from walks and machines that are given."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from servogen.edges import HIGH, PINS
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.prove import cuts
from servogen.prove.cuts import first_edges, once_a_frame, rising_addresses
from servogen.prove.forks import PreparedProgram
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.units import Clock, Cycles

RB0, RB1, RA4 = (PINS.index(pin) for pin in ("RB0", "RB1", "RA4"))


def pulse(rise: int, width: int) -> Pulse:
    return Pulse(Cycles(rise), Cycles(width))


def schedule(*pulses: Pulse | None, pins: tuple[str, ...] = ("RB0", "RB1", "RA1")) -> PulseSchedule:
    channels = tuple(Channel(pin, pin, "x") for pin in pins[: len(pulses)])
    none = (None,) * len(pulses)
    return PulseSchedule(Clock(4_000_000), Cycles(20_000), channels, (Run(2, none),), (Run(1, pulses),))


class Machine:
    """A chip that runs to the next rise of a pin: to a cycle and an address for each."""

    def __init__(self, *stops: tuple[int, int] | None) -> None:
        self.stops = list(stops)
        self.asked: list[tuple[int, int, int]] = []
        self.pc = 0

    def run_to_edge(self, pin: int, level: int, limit: int) -> int | None:
        self.asked.append((pin, level, int(limit)))
        stop = self.stops.pop(0) if self.stops else None
        if stop is None:
            return None
        self.pc = stop[1]
        return stop[0]


def installed(monkeypatch: pytest.MonkeyPatch, *machines: Any) -> None:
    left = list(machines)
    monkeypatch.setattr(cuts, "machine_of", lambda schedule, image: left.pop(0))


IMAGE = Image({})


def test_the_first_edges_of_frames_are_at_some_addresses(monkeypatch: pytest.MonkeyPatch) -> None:
    one = Machine((700, 0x410), (20_700, 0x11), (40_700, 0x10), None, (99, 0x55))
    installed(monkeypatch, one)
    assert first_edges(IMAGE, schedule(pulse(0, 1000)), 9, 60_000) == (700, {0x10, 0x11})
    # The first pulse has fifty frames, each other one as long as the longest silence.
    assert one.asked == [(RB0, HIGH, 1_000_000), *[(RB0, HIGH, 60_000)] * 3]
    two = Machine((700, 1), (2, 2), (3, 3), (4, 4))
    installed(monkeypatch, two)
    assert first_edges(IMAGE, schedule(pulse(0, 1000)), 2, 60_000) == (700, {1, 2, 3})
    installed(monkeypatch, Machine(None))
    assert first_edges(IMAGE, schedule(pulse(0, 1000)), 2, 60_000) is None
    installed(monkeypatch, Machine((700, 1)))
    assert first_edges(IMAGE, schedule(None), 2, 60_000) is None, "the schedule has no pulse"


def test_pulses_rise_alone_where_no_other_one_is_high(monkeypatch: pytest.MonkeyPatch) -> None:
    def addresses(*pulses: Pulse | None, machines: int) -> tuple[frozenset[int], list[int]]:
        made = [Machine((700, 0x401 + n)) for n in range(machines)]
        installed(monkeypatch, *made)
        found = rising_addresses(IMAGE, schedule(*pulses))
        assert all(len(one.asked) == 1 and one.asked[0][1:] == (HIGH, 1_000_000) for one in made)
        return found, [one.asked[0][0] for one in made]

    # The word before the one that is next, in 1024 words.
    assert addresses(pulse(0, 1000), machines=1) == ({0}, [RB0])
    assert addresses(pulse(0, 1000), pulse(2500, 1000), machines=2) == ({0, 1}, [RB0, RB1])
    # The second one begins while the first is high; the third, as the later of them falls, and a cycle later.
    overlapping = pulse(0, 1000), pulse(900, 600)
    assert addresses(*overlapping, pulse(1500, 9), machines=1) == ({0}, [RB0])
    assert addresses(*overlapping, pulse(1501, 9), machines=2)[1] == [RB0, PINS.index("RA1")]
    # A long pulse covers a shorter one after it.
    assert addresses(pulse(0, 5000), pulse(900, 600), pulse(2000, 9), machines=1)[1] == [RB0]
    assert addresses(pulse(2500, 9), None, pulse(0, 9), machines=2)[1] == [PINS.index("RA1"), RB0]
    installed(monkeypatch, Machine(None))
    assert rising_addresses(IMAGE, schedule(pulse(0, 1000))) == frozenset()
    assert rising_addresses(IMAGE, schedule(None)) == frozenset()


def test_candidates_are_executed_once_in_each_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[int] = []
    spent = {5: 120, 6: 119, 7: 121, 8: 118, 9: 122, 10: 240, 11: 1}
    words = {address: SimpleNamespace(executions=count) for address, count in spent.items()}

    def profiled(machine: Any, cycles: int) -> Any:
        ran.append(int(cycles))
        return SimpleNamespace(words=words)

    monkeypatch.setattr(cuts, "profile", profiled)
    monkeypatch.setattr(
        cuts, "machine_of", lambda *_: SimpleNamespace(run=lambda cycles: ran.append(int(cycles)))
    )
    # From the middle of the first frame on, for 120 frames.
    assert once_a_frame(IMAGE, schedule(pulse(0, 1000)), 700) == [5, 6, 7]
    assert ran == [700 + 10_000, 120 * 20_000]
    words |= {100 + n: SimpleNamespace(executions=120) for n in range(21)}
    assert len(once_a_frame(IMAGE, schedule(pulse(0, 1000)), 700)) == 24
    words |= {200 + n: SimpleNamespace(executions=120) for n in range(76)}
    many = once_a_frame(IMAGE, schedule(pulse(0, 1000)), 700)
    every = sorted([5, 6, 7, *range(100, 121), *range(200, 276)])
    # Evenly chosen, with the first and the last of a hundred.
    assert many == [every[99 * n // 23] for n in range(24)]


def reads_w_first(*words: int, pc: int = 0) -> bool:
    return cuts.needs_w(PreparedProgram(Image(dict(enumerate(words)))), pc)


def test_w_is_needed_where_it_is_read_before_it_is_written() -> None:
    f = 0x20
    for reading in (encode("MOVWF", f=f), encode("ADDLW", k=1), encode("ADDWF", f=f, d=0)):
        assert reads_w_first(reading)
    assert not reads_w_first()
    assert not reads_w_first(encode("MOVLW", k=1)) and not reads_w_first(encode("MOVF", f=f, d=0))
    assert not reads_w_first(encode("CLRW"))
    # MOVF to the file does not write W.
    assert reads_w_first(encode("MOVF", f=f, d=1), encode("MOVWF", f=f))
    assert reads_w_first(encode("NOP"), encode("GOTO", k=3), encode("MOVLW", k=1), encode("MOVWF", f=f))
    assert reads_w_first(encode("CALL", k=2), encode("MOVLW", k=1), encode("MOVWF", f=f))
    assert not reads_w_first(encode("GOTO", k=0)), "a loop"
    assert not reads_w_first(encode("BTFSS", f=f, b=1), encode("MOVWF", f=f)), "more than one way"
    assert not reads_w_first(encode("RETURN"), encode("MOVWF", f=f))
