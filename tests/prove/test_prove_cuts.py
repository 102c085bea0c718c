"""The choice of cut points and what is dead there, from walks and machines that are given."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from servogen.edges import HIGH, PINS
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.prove import cuts
from servogen.prove.chip import AssumedBits, ChipState, Reason, RunOutcome, Use
from servogen.prove.cuts import _guesses, _Walk, first_edges, once_a_frame, rising_addresses
from servogen.prove.forks import PreparedProgram
from servogen.prove.generalise import Guess
from servogen.prove.specification import Specification
from servogen.prove.transitions import Transitions
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.simulator import layout
from servogen.units import Clock, Cycles
from tests.prove.chip_states import ram, rest

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


# guesses

NOTHING: frozenset[int] = frozenset()


def transitions_of(run: Any = None) -> Transitions:
    chip: Any = SimpleNamespace(run=run, power_on=lambda: ChipState(ram(), rest(PC=0)))
    return Transitions(chip, 100_000)


def test_what_is_overwritten_before_it_is_read_is_dead() -> None:
    transitions = transitions_of()
    number = transitions.number(rest(PC=9, TMR0=1))
    every = frozenset(range(68))
    # Each frame reads byte 3, writes byte 5 and all others but byte 7.
    walk = _Walk(
        [9] * 8, [frozenset({3})] * 8, [every - {3, 7}] * 8, [(ram(), number)] * 8
    )  # fmt: skip
    guesses = _guesses(transitions, [9], walk)
    assert guesses == {9: Guess(set(every) - {3, 7}, None)}
    # Only the first half counts: after the walk's end everything is live.
    late = _Walk([9, 9], [NOTHING] * 2, [NOTHING] * 2, [(ram(), number)] * 2)
    assert _guesses(transitions, [9], late) == {9: Guess(set(), None)}
    # A cut that the walk has not met in its first half keeps everything.
    assert _guesses(transitions, [9, 12], walk)[12] == Guess(set(), None)
    # Two cuts in turn: what one of them reads is dead only at the other.
    pair = _Walk(
        [9, 12] * 4,
        [frozenset({3}), frozenset({4})] * 4,
        [frozenset({4, 5}), frozenset({3, 5})] * 4,
        [(ram(), number), (ram(), number)] * 4,
    )
    found = _guesses(transitions, [9, 12], pair)
    assert found[9].dead == {4, 5} and found[12].dead == {3, 5}


def test_bytes_that_move_with_the_timer_are_phased() -> None:
    transitions = transitions_of()
    timers = [(11 * n) & 255 for n in range(40)]

    def walk(unknown: int = 0, count: int = 40) -> _Walk:
        states = [
            (
                ram(c1=timer + 5 & 255, c2=n, c3=timer),
                transitions.number(rest(PC=9, TMR0=timer, TMR0_UNKNOWN=unknown)),
            )
            for n, timer in enumerate(timers[:count])
        ]
        return _Walk([9] * count, [frozenset({1, 2})] * count, [frozenset({3})] * count, states)

    # Byte 3 is dead, byte 2 has another speed, and the others do not move.
    assert _guesses(transitions, [9], walk())[9] == Guess({3}, {1})
    assert _guesses(transitions, [9], walk(unknown=1))[9].phased is None
    assert _guesses(transitions, [9], walk(count=16))[9].phased == {1}
    assert _guesses(transitions, [9], walk(count=15))[9].phased is None, "so few phases are kept apart"


# a walk from cut to cut


def walked(run: Any, program: PreparedProgram, count: int, **more: Any) -> _Walk | None:
    transitions = transitions_of(run)
    levels = more.pop("levels", {})
    always = more.pop("always", NOTHING)
    spec = Specification(schedule(pulse(0, 1000)), None)
    begin = cuts._begin(program, transitions, spec, always, levels)
    return cuts._walk(program, transitions, spec, {9}, always, levels, begin, count)


def frame(**more: Any) -> RunOutcome:
    values: dict[str, Any] = {
        "reason": Reason.STOP, "cycles": 20_000, "edges": ((950, RB0, 0), (19_950, RB0, 1)), "read": (3, 4),
        "written": ((4, 7),), "rest": rest(PC=9),
    }  # fmt: skip
    return RunOutcome(**(values | more))


FIRST = frame(cycles=100, edges=((50, RB0, 1),), read=(), written=())
EMPTY = PreparedProgram(Image({}))


def test_a_walk_notes_what_each_part_reads_and_writes() -> None:
    def run(state: ChipState, stops: Any, limit: int, choices: Any) -> RunOutcome:
        return FIRST if state["PC"] == 0 else frame()

    walk = walked(run, EMPTY, 3)
    assert walk is not None
    assert walk.pcs == [9] * 4 and len(walk.states) == 4 and walk.sampled == 0
    assert walk.reads == [{3, 4}] * 3 + [NOTHING] and walk.writes == [{4}] * 3 + [NOTHING]
    assert walk.states[0] == (ram(), 1) and walk.states[1] == (ram(c4=7), 1)
    assert walked(run, EMPTY, 1) is None, "two parts show nothing"


def test_a_walk_ends_where_the_search_will_find_something() -> None:
    for wrong in (
        frame(edges=((951, RB0, 0), (19_950, RB0, 1))),
        frame(reason=Reason.WARNING),
        frame(reason=Reason.LIMIT),
    ):
        turns = iter([FIRST, frame(), frame(read=(1,)), wrong, frame()])

        def run(state: ChipState, stops: Any, limit: int, choices: Any, turns: Any = turns) -> RunOutcome:
            result = next(turns)
            assert isinstance(result, RunOutcome)
            # Each state differs, so that no run is remembered.
            number = 0 if state["PC"] == 0 else state["W"] + 1
            fields = {"PC": 9, "W": number}
            return RunOutcome(
                result.reason, result.cycles, result.edges, result.read, result.written, rest(**fields)
            )

        walk = walked(run, EMPTY, 9)
        assert walk is not None and len(walk.reads) == 3


def test_an_unknown_bit_is_chosen_as_the_schedule_holds_it() -> None:
    """The program tests RA4 at its beginning; held at 1, the way with that level is followed."""
    chosen: list[Any] = []
    program = PreparedProgram(Image({0: encode("BTFSC", f=5, b=4)}))

    def run(state: ChipState, stops: Any, limit: int, choices: Any) -> RunOutcome:
        if state["PC"] == 0:
            chosen.append(choices)
            return FIRST
        return frame()

    def power_on() -> ChipState:
        return ChipState(ram(), rest(PC=0, PINS_UNKNOWN=0x1FFF))

    for level in (0, 1):
        transitions = transitions_of(run)
        transitions.chip.power_on = power_on  # type: ignore[method-assign]
        spec = Specification(schedule(pulse(0, 1000)), None)
        begin = cuts._begin(program, transitions, spec, frozenset({0}), {RA4: level})
        walk = cuts._walk(program, transitions, spec, {9}, frozenset({0}), {RA4: level}, begin, 3)
        assert walk is not None
    assert chosen == [(AssumedBits("PINS", 1 << RA4, level << RA4),) for level in (0, 1)]


def test_what_decides_on_the_way_is_chosen_where_it_decides() -> None:
    """Seven cycles after the cut W decides, whose bit 0 is unknown; then it decides once more, for bit 1."""
    program = PreparedProgram(Image({5: encode("ADDLW", k=1)}))
    one, both = (AssumedBits("W", 1, 0),), (AssumedBits("W", 1, 0), AssumedBits("W", 2, 0))
    use = Use(layout.USE_JUMP, 0, 5)
    unknown = rest(PC=5, W_UNKNOWN=3)
    last = frame(cycles=19_993, edges=((943, RB0, 0), (19_943, RB0, 1)), read=(1,), written=((2, 3),))
    table = {
        (0, ()): FIRST,
        (9, ()): frame(cycles=7, edges=(), reason=Reason.USE, rest=unknown, use=use),
        (5, one): frame(cycles=0, edges=(), reason=Reason.USE, rest=unknown, use=use, read=(), written=()),
        (5, both): last,
    }

    def run(state: ChipState, stops: Any, limit: int, choices: Any) -> RunOutcome:
        return table[state["PC"], choices]

    walk = walked(run, program, 3)
    assert walk is not None and walk.pcs == [9] * 4
    assert walk.reads == [{3, 4, 1}] * 3 + [NOTHING] and walk.writes == [{4, 2}] * 3 + [NOTHING]


def test_what_decides_and_is_not_known_ends_the_walk() -> None:
    def run(state: ChipState, stops: Any, limit: int, choices: Any) -> RunOutcome:
        if state["PC"] == 0:
            return FIRST
        if state["W"] < 2:
            return frame(rest=rest(PC=9, W=state["W"] + 1))
        return frame(cycles=7, edges=(), reason=Reason.USE, rest=rest(PC=5), use=Use(1, 0, 5))

    walk = walked(run, EMPTY, 9)
    assert walk is not None and len(walk.reads) == 3


def test_the_cut_with_the_fewest_live_bytes_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of those that do not need W, and at which no button has been read."""
    every = frozenset(range(68))

    def walk_of(live: int, sampled: int = 0) -> _Walk:
        read = frozenset(range(live))
        return _Walk([9] * 8, [read] * 8, [every - read] * 8, [(ram(), 0)] * 8, sampled)

    walks = {
        9: walk_of(9),
        10: walk_of(3, sampled=5),
        11: walk_of(4),
        12: walk_of(2),
        13: None,
        14: walk_of(4),
    }
    asked: list[tuple[set[int], int]] = []

    def walk(program: Any, transitions: Any, spec: Any, pcs: set[int], *rest: Any) -> Any:
        asked.append((set(pcs), rest[-1]))
        return walks[min(pcs)]

    monkeypatch.setattr(cuts, "_walk", walk)
    monkeypatch.setattr(cuts, "first_edges", lambda *_: (700, {0x33, 0x22}))
    monkeypatch.setattr(cuts, "once_a_frame", lambda *_: [9, 10, 11, 12, 13, 14])
    monkeypatch.setattr(cuts, "needs_w", lambda program, pc: pc == 12)
    transitions = transitions_of()
    transitions.number(rest(PC=9))
    spec = Specification(schedule(pulse(0, 1000)), None)
    with_input = schedule(pulse(0, 1000))
    found = cuts.choose_cuts(EMPTY, transitions, with_input, spec, NOTHING)
    assert found.keys() == {11}
    assert asked == [*(({pc}, 12) for pc in (9, 10, 11, 12, 13, 14)), ({11}, 400)]
    # Without a candidate, the addresses after the first edges.
    monkeypatch.setattr(cuts, "once_a_frame", lambda *_: [13])
    walks[0x22] = None
    assert cuts.choose_cuts(EMPTY, transitions, with_input, spec, NOTHING) == {0x22: Guess(), 0x33: Guess()}
    monkeypatch.setattr(cuts, "first_edges", lambda *_: None)
    assert cuts.choose_cuts(EMPTY, transitions, with_input, spec, NOTHING) == {}


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
