"""What the specification expects of the pins and reads from the inputs, by a second, slower formulation."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import pytest

from servogen.edges import PINS
from servogen.prove.commands import ButtonCommands, OneButton, SerialCodes, WalkCommands, reader_of
from servogen.prove.specification import BEFORE, IN_FRAME, OVER, Edge, Specification, SpecState, Violation
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import (
    ButtonRule,
    Channel,
    CodeLine,
    CommandRule,
    DirectionButtons,
    DirectionRuns,
    Input,
    Pulse,
    Run,
    StepButton,
)
from servogen.units import Clock, Cycles

# a line with codes


def trailing(text: str, level: str) -> int:
    return len(text) - len(text.rstrip(level))


# buttons for directions


def last_equal(seen: Sequence[int], frames: int) -> bool:
    return len(seen) >= frames and len(set(seen[-frames:])) == 1


@pytest.mark.parametrize("enough", [1, 2, 3])
@pytest.mark.parametrize("levels", [(0, 0), (1, 0)])
def test_a_button_alone_commands_its_direction_after_some_frames(
    enough: int, levels: tuple[int, int]
) -> None:
    pins = (PINS.index("RA0"), PINS.index("RB7"))
    reader = ButtonCommands(DirectionButtons(enough), (Input("RA0", levels[0]), Input("RB7", levels[1])))
    assert reader.pins == pins and reader.at_power_up == 0
    for frames in itertools.product(((0, 0), (1, 0), (0, 1), (1, 1)), repeat=5):
        heard = wanted = command = 0
        seen: list[int] = []
        for pressed in frames:
            read = 0
            for number in (1, 0):  # in any order
                level = levels[number] if pressed[number] else 1 - levels[number]
                assert reader.unread(read) == pins[0], "the first that was not read"
                result = reader.sampled(heard, wanted, read, pins[number], level)
                assert result is not None and result[:2] == (heard, wanted)
                read = result[2]
                assert reader.sampled(heard, wanted, read, pins[number], level) is None
            assert reader.unread(read) is None
            heard, wanted = reader.ended(heard, wanted, read)
            seen.append({(1, 0): 1, (0, 1): 2}.get(pressed, 0))
            if last_equal(seen, enough):
                command = seen[-1]
            assert wanted == command, frames


def test_the_button_that_was_not_read_is_named() -> None:
    reader = ButtonCommands(DirectionButtons(3), tuple(Input(f"RB{n}", 0) for n in range(4)))
    pins = [PINS.index(f"RB{n}") for n in range(4)]
    for order in itertools.permutations(range(4)):
        read = 0
        for done, number in enumerate(order):
            left = sorted(order[done:])
            assert reader.unread(read) == pins[left[0]]
            result = reader.sampled(0, 0, read, pins[number], number % 2)
            assert result is not None
            read = result[2]
        # Buttons 0 and 2 were at 0, their level while pressed: two are no direction.
        assert reader.ended(0, 3, read) == (8, 3)
    for number in range(4):
        read = 0
        for each in range(4):
            result = reader.sampled(0, 0, read, pins[each], int(each != number))
            assert result is not None
            read = result[2]
        # For the third frame in a row.
        assert reader.ended(2 * 8 + number + 1, 0, read) == (3 * 8 + number + 1, number + 1)
        assert reader.ended(1 * 8 + number + 1, 0, read) == (2 * 8 + number + 1, 0)


@pytest.mark.parametrize("enough", [1, 2, 3])
@pytest.mark.parametrize("level", [0, 1])
def test_each_press_of_one_button_commands_a_stop_or_the_next_direction(enough: int, level: int) -> None:
    reader = OneButton(StepButton(Input("RA4", level), enough), 3)
    pin = PINS.index("RA4")
    assert reader.pins == (pin,) and reader.at_power_up == 0
    for presses in itertools.product((0, 1), repeat=11):
        heard = wanted = 0
        commands = [1, 0, 2, 0, 3, 0, 1, 0, 2, 0, 3]
        count, run = 0, 0
        for pressed in presses:
            result = reader.sampled(heard, wanted, 0, pin, level if pressed else 1 - level)
            assert result is not None and result[2] == 1
            heard, wanted = reader.ended(*result)
            run = run + 1 if pressed else 0
            count += run == enough
            assert wanted == (commands[count - 1] if count else 0), presses
    assert reader.sampled(heard, wanted, 1, pin, 0) is None
    assert (reader.unread(0), reader.unread(1)) == (pin, None)


# the frames of a walk

CLOCK = Clock(4_000_000)
PERIOD = 20_000
A = (Pulse(Cycles(100), Cycles(1000)), Pulse(Cycles(3000), Cycles(1500)))
B = (Pulse(Cycles(100), Cycles(1200)), None)
NONE = (None, None)
CHANNELS = (Channel("one", "RB0", "x"), Channel("two", "RA1", "x"))
RB0, RA1 = PINS.index("RB0"), PINS.index("RA1")


def schedule_of(
    *loop: tuple[Pulse | None, ...], lead_in: Sequence[tuple[Pulse | None, ...]] = ()
) -> PulseSchedule:
    return PulseSchedule(
        CLOCK,
        Cycles(PERIOD),
        CHANNELS,
        tuple(Run(1, pulses) for pulses in lead_in),
        tuple(Run(1, pulses) for pulses in loop),
    )


def edges_of(pulses: tuple[Pulse | None, ...], begin: int = 0) -> list[Edge]:
    edges = []
    for pin, pulse in zip((RB0, RA1), pulses, strict=True):
        if pulse is not None:
            edges += [(begin + pulse.rise, pin, 1), (begin + pulse.rise + pulse.width, pin, 0)]
    return sorted((int(cycle), pin, level) for cycle, pin, level in edges)


def direction(name: str, selector: str | Input | None, start: int, cycle: int, stop: int) -> DirectionRuns:
    return DirectionRuns(name, selector, (Run(start, A),), (Run(cycle, B),), (Run(1, A), Run(stop - 1, B)))


CODES = CommandRule(
    CodeLine(Input("RA2", 1), 3, 5), (direction("forward", "01", 2, 3, 2), direction("back", "10", 1, 2, 3))
)


def test_each_command_is_read_as_its_rule_says() -> None:
    assert isinstance(reader_of(CODES), SerialCodes)
    buttons = (Input("RA2", 0), Input("RA3", 1))
    directions = tuple(direction(f"d{n}", button, 1, 1, 2) for n, button in enumerate(buttons))
    of_buttons = reader_of(CommandRule(DirectionButtons(3), directions))
    assert isinstance(of_buttons, ButtonCommands) and of_buttons.pins == tuple(
        PINS.index(button.pin) for button in buttons
    )
    stepping = tuple(direction(f"d{n}", None, 1, 1, 2) for n in range(2))
    one = reader_of(CommandRule(StepButton(Input("RA2", 0), 1), stepping))
    assert isinstance(one, OneButton)
    # Two directions: the third press that counts commands the first one again.
    heard = wanted = 0
    commands = []
    for level in (0, 1) * 5:
        heard, wanted, _ = one.sampled(heard, wanted, 0, PINS.index("RA2"), level) or (0, 0, 0)
        commands.append(wanted)
    assert commands == [1, 1, 0, 0, 2, 2, 0, 0, 1, 1]


def test_the_frames_of_a_walk_follow_each_other_as_commanded() -> None:
    """Lead-in: 0, 1; stance: 2. Forward: 3, 4; 5 to 7; 8, 9. Back: 10; 11, 12; 13 to 15."""
    walk = WalkCommands(schedule_of(A, lead_in=(A, B)), CODES)
    followers = {frame: [walk.following(frame, wanted) for wanted in range(3)] for frame in range(16)}
    stance = [2, 3, 10]
    assert followers == {
        0: [1, 1, 1],
        1: stance,
        2: stance,
        3: [4, 4, 4],
        4: [8, 5, 8],
        5: [6, 6, 6],
        6: [7, 7, 7],
        7: [8, 5, 8],
        8: [9, 9, 9],
        9: stance,
        10: [13, 13, 11],
        11: [12, 12, 12],
        12: [13, 13, 11],
        13: [14, 14, 14],
        14: [15, 15, 15],
        15: stance,
    }


def test_a_walk_has_the_frames_of_all_directions_and_reads_its_line() -> None:
    spec = Specification(schedule_of(A, lead_in=(A, B)), None, CODES)
    assert spec.frames == 16 and spec.sampled == {PINS.index("RA2")}
    state = spec.advance(spec.start(), [(100 + cycle, pin, level) for cycle, pin, level in edges_of(A)], 5000)
    # The first pulse rises in cycle 100 of its frame.
    assert (state.phase, state.frame, state.time) == (IN_FRAME, 0, 4900)
    with pytest.raises(Violation) as unread:
        spec.advance(state, [], PERIOD)
    assert unread.value.message == "RA2 is not read in a frame" and not unread.value.certain
    assert unread.value.cycle == PERIOD - 4900
    state = spec.sample(state, PINS.index("RA2"), 1)
    assert state.line_read == 1
    with pytest.raises(Violation) as twice:
        spec.sample(state, PINS.index("RA2"), 1)
    assert twice.value.message == "RA2 is read twice in a frame" and not twice.value.certain
    assert spec.sample(state, PINS.index("RA3"), 1) is state, "another pin is of no interest"
    following = spec.advance(state, [], PERIOD - 4900)
    assert (following.frame, following.time, following.line_read) == (1, 0, 0)
    assert following.heard == state.heard
    # The frames of the directions: forward's start is A, its cycle is B.
    pulses = {3: A, 4: A, 5: B, 7: B, 8: A, 9: B, 10: A, 11: B, 13: A, 14: B, 15: B}
    for frame, right in pulses.items():
        at = SpecState(IN_FRAME, 0, frame)
        spec.advance(at, edges_of(right), PERIOD - 1)
        with pytest.raises(Violation):
            spec.advance(at, edges_of(B if right is A else A), PERIOD - 1)


# frames without inputs


def test_lead_in_comes_once_and_the_loop_repeats() -> None:
    spec = Specification(schedule_of(A, B, lead_in=(B, A, A)), None)
    assert spec.frames == 5
    frames = [B, A, A, *([A, B] * 3)]
    edges = [edge for number, pulses in enumerate(frames) for edge in edges_of(pulses, number * PERIOD)]
    first = edges[0][0]
    moved = [(cycle - first + 7, pin, level) for cycle, pin, level in edges]
    span = len(frames) * PERIOD - first + 7
    state = spec.advance(spec.start(), moved, span)
    assert state == SpecState(IN_FRAME, 0, 3)
    # In any parts: cut at every third edge and once per frame.
    state, begun = spec.start(), 0
    for cut in sorted({cycle + 1 for cycle, _, _ in moved[::3]} | {n * PERIOD for n in range(1, 9)} | {span}):
        part = [(cycle - begun, pin, level) for cycle, pin, level in moved if begun <= cycle < cut]
        state = spec.advance(state, part, cut - begun)
        begun = cut
    assert state == SpecState(IN_FRAME, 0, 3)


def test_the_first_rise_may_come_whenever_but_begins_the_first_frame_with_pulses() -> None:
    spec = Specification(schedule_of(A, lead_in=(NONE, NONE, B)), None)
    start = spec.start()
    assert start == SpecState(BEFORE, 0, 0)
    assert spec.advance(start, [], 10**9) is start
    assert spec.advance(start, [(3, RB0, 0)], 100) is start, "a fall before it begins nothing"
    state = spec.advance(start, [(3, RB0, 0), (50, RB0, 1)], 60)
    assert (state.phase, state.frame, state.time) == (IN_FRAME, 2, 110)
    with pytest.raises(Violation) as other:
        spec.advance(start, [(50, RA1, 1)], 60)
    assert (other.value.message, other.value.cycle) == ("the rise of RA1 is not the schedule's", 50)


@pytest.mark.parametrize(
    ("edges", "message", "cycle"),
    [
        ([], "the rise of RB0 is missing", 100),
        ([(101, RB0, 1), (1100, RB0, 0)], "the rise of RB0 comes 1 cycle late", 100),
        ([(98, RB0, 1), (1100, RB0, 0)], "the rise of RB0 comes 2 cycles early", 100),
        ([(100, RB0, 1)], "the fall of RB0 is missing", 1100),
        ([(100, RB0, 1), (1103, RB0, 0)], "the fall of RB0 comes 3 cycles late", 1100),
        ([(60, RA1, 1), (100, RB0, 1)], "the rise of RA1 is not the schedule's", 60),
        ([(100, RB0, 1), (1100, RB0, 0), (1999, RA1, 1)], "the rise of RA1 is not the schedule's", 1999),
        ([(100, RA1, 1), (100, RB0, 1)], "the rise of RA1 is not the schedule's", 100),
        ([(200, RA1, 1)], "the rise of RB0 is missing", 100),
    ],
)
def test_the_first_wrong_edge_is_named_with_its_cycle(edges: list[Edge], message: str, cycle: int) -> None:
    spec = Specification(schedule_of(A), None)
    for begun in (0, PERIOD):  # in the first frame of a run, or after a whole one
        state = SpecState(IN_FRAME, 0, 0)
        before = edges_of(A) if begun else []
        run = [*before, *((at + begun, pin, level) for at, pin, level in edges)]
        with pytest.raises(Violation) as wrong:
            spec.advance(state, run, begun + 2000)
        assert (wrong.value.message, wrong.value.cycle, wrong.value.certain) == (message, cycle + begun, True)


def test_an_edge_in_the_last_cycle_of_a_run_is_compared_and_the_next_one_is_not() -> None:
    spec = Specification(schedule_of(A), None)
    state = SpecState(IN_FRAME, 0, 0)
    assert spec.advance(state, [], 100).time == 100
    with pytest.raises(Violation):
        spec.advance(state, [], 101)
    assert spec.advance(state, [(100, RB0, 1)], 101).time == 101
    assert spec.advance(replace_time(state, 100), [(0, RB0, 1)], 1).time == 101
    # At its end a frame becomes the next one.
    late = replace_time(state, PERIOD - 1)
    assert spec.advance(late, [], 1) == SpecState(IN_FRAME, 0, 0)
    assert spec.advance(replace_time(state, PERIOD - 2), [], 1).time == PERIOD - 1


def replace_time(state: SpecState, time: int) -> SpecState:
    return state._replace(time=time)


def test_pulses_that_touch_frames_are_compared_in_their_own() -> None:
    """A fall in the first cycle of a frame would belong to it; one in the last cycle belongs before."""
    last = (Pulse(Cycles(100), Cycles(PERIOD - 101)), None)
    spec = Specification(schedule_of(last), None)
    state = SpecState(IN_FRAME, 101, 0)
    after = spec.advance(state, [(PERIOD - 102, RB0, 0), (PERIOD - 1, RB0, 1)], PERIOD)
    assert after.time == 101


def test_the_longest_silence_counts_the_frames_without_pulses_around_the_loop() -> None:
    def silence(*loop: tuple[Pulse | None, ...], lead_in: Sequence[tuple[Pulse | None, ...]] = ()) -> int:
        return Specification(schedule_of(*loop, lead_in=lead_in), None).longest_silence // PERIOD

    assert silence(A) == 1
    assert silence(A, NONE) == 2
    assert silence(A, NONE, NONE, B) == 3
    assert silence(NONE, A, NONE) == 3, "the end of the loop is followed by its beginning"
    assert silence(A, lead_in=(NONE, NONE, NONE)) == 4
    assert silence(NONE, lead_in=(A,)) == 3, "two turns of a loop without pulses"


def test_after_the_last_pulse_nothing_is_expected_and_nothing_allowed() -> None:
    spec = Specification(schedule_of(NONE, lead_in=(A, B)), None)
    over = SpecState(OVER, 0, 2)
    in_last = SpecState(IN_FRAME, 0, 1)
    assert spec.advance(in_last, edges_of(B), PERIOD) == over
    assert spec.advance(over, [], 10**6) is over
    with pytest.raises(Violation) as after:
        spec.advance(over, [(77, RA1, 1)], 100)
    assert (after.value.message, after.value.cycle) == ("the rise of RA1, after the last pulse", 77)
    with pytest.raises(Violation) as after:
        spec.advance(in_last, [*edges_of(B), (PERIOD + 5, RB0, 0)], PERIOD + 6)
    assert (after.value.message, after.value.cycle) == ("the fall of RB0, after the last pulse", PERIOD + 5)
    # Once the last fall has been, it is at rest; not before, and never where the loop has pulses.
    fall = 100 + 1200
    for time, rests in ((fall, False), (fall + 1, True)):
        state = SpecState(IN_FRAME, time, 1)
        assert spec.at_rest(state) == (over if rests else state)
    assert spec.at_rest(SpecState(IN_FRAME, PERIOD - 1, 0)).phase == IN_FRAME, "a frame with pulses comes"
    assert spec.at_rest(SpecState(IN_FRAME, 0, 2)) == over
    assert spec.at_rest(spec.start()) == spec.start() and spec.at_rest(over) is over
    playing = Specification(schedule_of(A), None)
    assert playing.at_rest(SpecState(IN_FRAME, PERIOD - 1, 0)).phase == IN_FRAME


# start and stop buttons


def pressed_frames(
    start: Sequence[int] | None, stop: Sequence[int] | None, off: bool, enough: int, frames: int, loop: int
) -> Iterator[tuple[int, bool]]:
    """The frame of each period and whether it has pulses, from the runs of pressed frames before it."""

    def run(pressed: Sequence[int], until: int) -> int:
        return trailing("".join(map(str, pressed[:until])), "1")

    waiting = enough - 1 if start is not None else 0
    frame, running, on = waiting, start is None, True
    for number in itertools.count(1):
        yield frame, on
        if start is not None and run(start, number) == enough:
            running = on = True
        if stop is not None and run(stop, number) >= enough:
            running = False
            if off:
                on = False
                frame = waiting if start is not None else frame
        if running:
            frame = frame + 1 if frame + 1 < frames else loop


FRAMES = [A, A, B, A, B]
"""With two frames of waiting; the loop is the last two."""


@pytest.mark.parametrize("off", [True, False])
@pytest.mark.parametrize("buttons", ["start", "stop", "both"])
def test_every_press_has_the_effect_that_the_rule_states(buttons: str, off: bool) -> None:
    start = Input("RA2", 0) if buttons != "stop" else None
    stop = Input("RA3", 1) if buttons != "start" else None
    rule = ButtonRule(start, stop, off, 2)
    spec = Specification(schedule_of(*FRAMES[3:], lead_in=FRAMES[:3]), rule)
    assert spec.sampled == {PINS.index(button.pin) for button in (start, stop) if button}
    both = [(0, 0), (1, 0), (0, 1), (1, 1)]
    kinds = {"start": [(0, 0), (1, 0)], "stop": [(0, 0), (0, 1)], "both": both}[buttons]
    begun = spec.start()
    assert (begun.phase, begun.running, begun.on) == (BEFORE, int(start is None), 1)
    assert begun.frame == (1 if start else 0)
    for presses in itertools.product(kinds, repeat=5 if buttons == "both" else 8):
        starts, stops = zip(*presses, strict=True)
        playing = pressed_frames(starts if start else None, stops if stop else None, off, 2, len(FRAMES), 3)
        state = begun._replace(phase=IN_FRAME)
        for (start_pressed, stop_pressed), (frame, on) in zip(presses, playing, strict=False):
            assert not state.is_sampled
            if state.phase == OVER:
                assert not on and start is None
                break
            assert (state.frame, bool(state.on)) == (frame, on), presses
            if start:
                state = spec.sample(state, PINS.index("RA2"), 1 - start_pressed)
            if stop:
                state = spec.sample(state, PINS.index("RA3"), stop_pressed)
            assert state.is_sampled
            state = spec.advance(state, edges_of(FRAMES[frame]) if on else [], PERIOD)


def test_a_button_is_read_once_per_frame_or_at_the_same_level() -> None:
    rule = ButtonRule(Input("RA2", 0), Input("RA3", 1), True, 3)
    spec = Specification(schedule_of(A), rule)
    state = SpecState(IN_FRAME, 5000, 0)
    seen = spec.sample(state, PINS.index("RA2"), 1)
    assert (seen.start_sample, seen.stop_sample) == (1, -1)
    assert spec.sample(seen, PINS.index("RA2"), 1) == seen
    with pytest.raises(Violation) as twice:
        spec.sample(seen, PINS.index("RA2"), 0)
    assert twice.value.message == "RA2 is read twice in a frame, at different levels"
    assert not twice.value.certain
    with pytest.raises(Violation) as unread:
        spec.advance(seen, [], PERIOD - 5000)
    assert (unread.value.message, unread.value.cycle) == ("RA3 is not read in a frame", PERIOD - 5000)
    both = spec.sample(seen, PINS.index("RA3"), 0)
    assert spec.advance(both, [], PERIOD - 5000).time == 0
    before = spec.start()
    assert spec.sample(before, PINS.index("RA2"), 0) is before, "before the first pulse nothing counts"
    assert before.frame == 2, "with a start button the first frame repeats twice"
    held = spec.at_rest(SpecState(IN_FRAME, PERIOD - 1, 0))
    assert held.phase == IN_FRAME


def test_the_state_of_buttons_shows_whether_something_was_read() -> None:
    state = SpecState(IN_FRAME, 0, 0)
    assert not state.is_sampled
    assert state._replace(start_sample=0).is_sampled and state._replace(stop_sample=0).is_sampled
    # A line's level counts at once; what was read of buttons is kept until the frame ends.
    assert not state._replace(line_read=1).is_sampled and state._replace(line_read=2).is_sampled
    assert replace(Violation("x", 5), cycle=6).certain
