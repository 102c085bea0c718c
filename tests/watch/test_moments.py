"""A recording and a copying program, moment by moment: what a window's session answers."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from servogen.edges import PINS, UNDRIVEN, EdgeTrace
from servogen.errors import InputError
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.simulator import LevelChange, Recorded, Stimuli
from servogen.units import Clock, Cycles
from servogen.watch import session as session_module
from servogen.watch.differences import ScheduledEdges, differences, differing, first_rise, place_schedule
from servogen.watch.recording import Recording
from servogen.watch.session import MAX_EDGES, LatestPulses, WatchSession
from servogen.watch.subject import Subject
from tests.edges.rows import Row, chunk, rows_of
from tests.simulator.helpers import image
from tests.watch.test_session import answer

MHZ4 = Clock(4_000_000)
RB0, RB1 = PINS.index("RB0"), PINS.index("RB1")


ROWS = [(0, RB0, 0), (10, RB0, 1), (10, RB1, 1), (25, RB0, 0), (40, RB0, 1), (60, RB0, 0), (60, RB1, 0)]


def recording(end: int = 100) -> Recording:
    return Recording(EdgeTrace(MHZ4, (chunk(ROWS[:3]), chunk(ROWS[3:])), Cycles(end)))


def test_a_recording_has_its_edges_by_time_and_its_levels_before_a_moment() -> None:
    shown = recording()
    assert rows_of(shown.edges(10, 40)) == ROWS[1:4]
    assert rows_of(shown.edges(11, 41)) == ROWS[3:5]
    for begin, levels in ((0, (2, 2)), (1, (0, 2)), (10, (0, 2)), (11, (1, 1)), (25, (1, 1)), (26, (0, 1))):
        before = shown.levels_before(begin)
        assert (before[RB0], before[RB1]) == levels
        assert before[:RB0] == (UNDRIVEN,) * RB0
    assert shown.reach == 100
    for cycle, now in ((-1, 0), (7, 7), (100, 100), (101, 100)):
        shown.seek(cycle)
        assert shown.now == now


def test_steps_lead_to_just_after_each_edge_and_back() -> None:
    shown = recording()
    places = [1, 11, 26, 41, 61]
    found = []
    while shown.step_edge(True):
        found.append(int(shown.now))
    assert found == places
    assert shown.now == 61
    back = []
    while shown.step_edge(False):
        back.append(int(shown.now))
    assert back == places[-2::-1]
    for now, forwards, to in (
        (30, True, 61),
        (30, False, 11),
        (11, False, 11),
        (61, True, 61),
        (10, True, 11),
    ):
        shown.seek(now)
        moved = shown.step_edge(forwards, {RB1})
        assert (int(shown.now), moved) == (to, to != now)


def session(rows: list[Row], end: int, **around: Any) -> WatchSession:
    trace = EdgeTrace(MHZ4, (chunk(rows),), Cycles(end))
    return WatchSession(Subject(Path("run.vcd"), MHZ4, trace=trace, **around))


def test_the_latest_pulse_has_its_width_until_it_is_two_frames_old() -> None:
    """A frame is 20 ms where no schedule says how long it is: 40 000 cycles later it is not driven."""
    of = session([(0, RB0, 0), (1000, RB0, 1), (2500, RB0, 0)], 200_000)
    for cycle, width in ((2500, 0), (2501, 1500), (42_500, 1500), (42_501, 0)):
        shown = answer(of, do="seek", cycle=cycle)
        assert shown["widths"][RB0] == width, cycle
        assert shown["held"][RB0] == (1500 if cycle > 2500 else 0)
        assert shown["levels"] == "l" * RB0 + ("1" if cycle <= 2500 else "l") + "l" * (len(PINS) - RB0 - 1)


def test_pulses_are_followed_edge_by_edge() -> None:
    pulses = LatestPulses()
    pulses.add(chunk([(5, RB0, 0), (12, RB0, 1), (13, RB0, 1), (30, RB0, 0), (31, RB0, 2), (40, RB1, 1)]))
    assert (pulses.held[RB0], pulses.levels[RB0], pulses.levels[RB1]) == (18, UNDRIVEN, 1)
    pulses.add(chunk([(50, RB1, 2)]))
    assert pulses.held[RB1] == 10
    assert [pulses.widths(now, 20)[RB0] for now in (50, 51)] == [18, 0]
    assert pulses.widths(51, 20)[RB1] == 10


def test_a_jump_searches_ten_seconds_back_for_the_servos_last_pulse() -> None:
    servo = {"servos": [{"name": "arm", "pin": RB0}], "ends": [], "body": [], "base": None}
    rows = [(0, RB0, 0), (1_000_000, RB0, 1), (1_001_234, RB0, 0)]
    for robot, moments in (
        (servo, ((1_060_001, 1234), (11_000_000, 1234), (11_000_001, 0))),
        (None, ((1_060_000, 1234), (1_060_001, 0))),  # without a servo only three frames
    ):
        of = session(rows, 30_000_000, robot=robot)
        for cycle, held in moments:
            assert answer(of, do="seek", cycle=cycle)["held"][RB0] == held, cycle


def test_a_recording_runs_at_its_speed_to_its_end() -> None:
    of = session(ROWS, 100_000)
    answer(of, do="run", running=True, speed=0.01)
    (shown,) = of.tick(0.05)  # 0.05 s at a hundredth of a million cycles a second
    assert (shown["cycle"], shown["running"]) == (500, True)
    assert "speed" not in shown
    (late,) = of.tick(5.0)  # of a pause of the server no more than 0.1 s is made up
    assert late["cycle"] == 1500
    assert late["speed"] == 0.01
    answer(of, do="run", speed=1.0)
    (ended,) = of.tick(0.1)
    assert (ended["cycle"], ended["running"], ended["stopped"]) == (
        100_000,
        False,
        "the end of the recording",
    )
    assert list(of.tick(0.1)) == []


def test_another_version_is_shown_at_the_same_moment() -> None:
    of = session(ROWS, 100)
    answer(of, do="seek", cycle=45)
    answer(of, do="run", running=True, speed=2.0)
    other = session([(0, RB0, 0), (5, RB0, 1), (19, RB0, 0), (60, RB1, 1)], 90).subject
    fresh = of.continued(other)
    assert (fresh.subject, fresh.now, fresh.speed, fresh.running) == (other, 45, 2.0, True)
    assert fresh.shown()["widths"][RB0] == 14 and fresh.live is None and fresh.bodies is None
    assert of.now == 45 and of.shown()["widths"][RB0] == 15, "the session before is as it was"


def test_bodies_that_cannot_be_followed_are_shown_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    class Bodies:
        def __init__(self, subject: Subject, place: Any) -> None:
            if subject.title == "none":
                raise InputError("no-robot", "this version has no robot")
            self.of = subject, place

        def model(self) -> str:
            return "a model"

        def follow(self) -> Iterator[dict[str, Any]]:
            yield {"is": "bodies"}
            raise InputError("too-fast", "the robot has fallen")

    monkeypatch.setattr(session_module, "LiveBodies", Bodies)
    of = session(ROWS, 100)
    assert answer(of, do="bodies", on=True) == {"is": "bodies-model", "model": "a model"}
    bodies: Any = of.bodies
    assert bodies.of == (of.subject, of.place) and of.model()["bodies"] == "a model"
    answer(of, do="bodies", on=True)
    assert of.bodies is bodies, "they are followed already"
    # Another version has its own, if it has any.
    fresh = of.continued(session(ROWS, 90).subject)
    follower: Any = fresh.bodies
    assert follower.of == (fresh.subject, fresh.place)
    without = session(ROWS, 90, title="none")
    assert of.continued(without.subject).bodies is None
    refused = answer(without, do="bodies", on=True)
    assert (refused["model"], without.bodies) == (None, None) and "has no robot" in refused["text"]
    first, last = of.tick(0.1)
    assert first == {"is": "bodies"} and (last["is"], last["model"]) == ("bodies-model", None)
    assert "the robot has fallen" in last["text"] and of.bodies is None and list(of.tick(0.1)) == []
    assert list(fresh.handle({"do": "bodies", "on": False})) == [] and fresh.bodies is None


def test_parts_of_a_cycle_add_up() -> None:
    of = session(ROWS, 100_000)
    answer(of, do="run", speed=0.0000125)  # 1.25 cycles in 0.1 s
    cycles = [next(iter(of.tick(0.1)))["cycle"] for _ in range(8)]
    assert cycles == [1, 2, 3, 5, 6, 7, 8, 10]


@pytest.mark.parametrize(
    ("asked", "speed"), [(0, 1e-5), (1e-5, 1e-5), (2, 2.0), (1001, 1000.0), (None, None)]
)
def test_the_speed_is_bounded(asked: float | None, speed: float | None) -> None:
    of = session(ROWS, 100_000)
    assert answer(of, do="run", running=False, speed=asked)["speed"] == speed
    assert not of.running
    assert answer(of, do="run")["running"]


def test_waves_are_at_most_four_seconds_and_as_many_edges_as_fit() -> None:
    of = session(ROWS, 9_000_000)
    found = answer(of, do="waves", begin=-5, end=9_000_000)
    assert (found["begin"], found["end"], found["seen"]) == (0, 4_000_000, 4_000_000)
    assert found["pulses"] == [10, 15, RB0, 0, 50, RB1, 30, 20, RB0]
    assert found["floating"] == [0, RB0 * 4, 10, RB1 * 4 + 1]
    assert (found["before"][RB0], found["inputs"], found["wanted"], found["differing"]) == (2, [], [], [])
    later = answer(of, do="waves", begin=26, end=20)
    assert (later["begin"], later["end"], later["floating"]) == (26, 27, [])
    assert later["pulses"] == [-1, 2, RB1], "it was high before the window, and still is at its end"
    assert (later["before"][RB0], later["before"][RB1]) == (0, 1)
    beyond = answer(of, do="waves", begin=9_000_010, end=9_000_020)
    assert (beyond["seen"], beyond["pulses"]) == (9_000_000, [])
    many = session([(n, RB0, n % 2) for n in range(MAX_EDGES + 5)], 100_000)
    cut = answer(many, do="waves", begin=0, end=50_000)["pulses"]
    assert len(cut) == 3 * (MAX_EDGES // 2) and cut[-2] == 50_000 - (MAX_EDGES - 1)


def test_wrong_requests_are_answered_and_change_nothing() -> None:
    of = session(ROWS, 100_000)
    for request, text in (
        ({"do": "dance"}, "unknown request 'dance'"),
        ({}, "unknown request 'None'"),
        ({"do": "seek"}, "the request 'seek' is wrong: 'cycle'"),
        ({"do": "seek", "cycle": "x"}, "the request 'seek' is wrong: invalid literal"),
        ({"do": "step", "what": "mile"}, "'mile' is not a step"),
        ({"do": "step", "what": "instruction"}, "a recording has edges and frames, but no instructions"),
        ({"do": "explain", "pin": "RB0"}, "a recording has no inputs"),
        ({"do": "serial", "pin": "RA1", "baud": 49, "bytes": []}, "49 baud: allowed are 50 to 115200"),
        (
            {"do": "serial", "pin": "RA1", "baud": 115_201, "bytes": []},
            "115201 baud: allowed are 50 to 115200",
        ),
        ({"do": "pin", "pin": "RA0", "level": 3}, "level 3 is neither 0, 1 nor 2 (let go)"),
        ({"do": "servo", "servo": 0, "position": 1}, "only a job with [stream] takes positions"),
        (
            {"do": "walk", "way": "ahead"},
            "only a job with [walk] commands or [motion.commands] on a line takes directions",
        ),
    ):
        found = answer(of, **request)
        assert found["is"] == "problem"
        assert found["text"].startswith(text), request
    assert (of.now, of.running) == (0, False)
    assert answer(of, do="step", what="edge", count=1)["cycle"] == 1
    assert answer(of, do="step", what="edge", pin=RB1)["cycle"] == 11
    assert answer(of, do="step", what="edge", count=-1, pin=RB1)["stopped"] == "no edge before this one"


COPY = " bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\nl movf PORTA, w\n movwf PORTB\n goto l\n"


def copying() -> WatchSession:
    return WatchSession(Subject(Path("copy.hex"), MHZ4, image=image(COPY)))


def inputs(of: WatchSession, end: int) -> list[Row]:
    answer(of, do="seek", cycle=end)
    found, cycle = [], 0
    packed = answer(of, do="waves", begin=0, end=end)["inputs"]
    for way, edge in zip(packed[::2], packed[1::2], strict=True):
        cycle += way
        found.append((cycle, edge >> 2, edge & 3))
    return found


def test_a_pin_is_held_from_the_next_cycle_on_until_it_is_let_go() -> None:
    of = copying()
    answer(of, do="seek", cycle=50)
    begin = of.now
    for level in (1, 0, 2):
        assert answer(of, do="pin", pin="RA1", level=level)["chip"]["outside"][1] == level
    assert {cycle for cycle, *_ in inputs(of, 100)} == {begin + 1}
    assert inputs(of, 100)[-1] == (begin + 1, 1, 2)


@pytest.mark.parametrize(("baud", "bit"), [(50, 20_000), (115_200, 1e6 / 115_200)])
def test_bytes_are_sent_from_the_next_cycle_on_one_after_the_other(baud: int, bit: float) -> None:
    of = copying()
    for byte in (0x00, 0xFF):
        shown = answer(of, do="serial", pin="RA1", baud=baud, bytes=[byte])
        assert shown["cycle"] == 0 and "chip" not in shown, "what the chip has in it is the same as before"
    found = [(cycle, level) for cycle, pin, level in inputs(of, round(35 * bit)) if pin == 1]
    assert found[0] == (1, 1), "a line that nothing drove idles high, for the time of a byte"
    falls = [cycle for cycle, level in found if level == 0]
    rises = [cycle for cycle, level in found if level == 1 and cycle > falls[0]]
    assert falls[0] == pytest.approx(1 + 10 * bit, abs=1)
    # Nine low bits, the stop bit, and the next start bit a cycle or two after it.
    assert rises[0] - falls[0] == pytest.approx(9 * bit, abs=1)
    assert falls[1] - falls[0] == pytest.approx(10 * bit, abs=3)
    assert falls[1] - falls[0] >= int(10 * bit)
    assert rises[1] - falls[1] == pytest.approx(bit, abs=1)


def test_bytes_wait_for_less_than_ten_seconds() -> None:
    """Ten bits at 50 baud take 0.2 s: with the time before them, 48 bytes take 9.8 s, and 49 take 10 s."""
    for length, begin in ((48, 9_800_002), (49, 87)):
        of = copying()
        answer(of, do="serial", pin="RA1", baud=50, bytes=[0] * length)
        answer(of, do="serial", pin="RA2", baud=115_200, bytes=[0])
        assert of.chip is not None
        fall = next(change.cycle for change in of.chip.inputs if (change.pin, change.level) == (2, 0))
        assert fall == pytest.approx(begin, abs=1)


def test_at_full_speed_frames_are_run_for_30_ms(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a clock that goes 5 ms further at each look: five frames, of 20 ms."""
    of = copying()
    looks = count()
    answer(of, do="run", speed=None)
    monkeypatch.setattr(session_module.time, "monotonic", lambda: next(looks) * 0.005)
    (shown,) = of.tick(0.05)
    assert shown["cycle"] in (100_000, 100_001)


def test_before_the_first_line_there_is_no_other_one() -> None:
    of = copying()
    answer(of, do="seek", cycle=100)
    assert answer(of, do="step", what="line", count=-1)["stopped"] == "there is no other line"


def test_at_most_256_bytes_are_sent_at_once() -> None:
    of = copying()
    answer(of, do="serial", pin="RA1", baud=115_200, bytes=[0] * 300)
    falls = [each for each in inputs(of, 30_000) if each[1:] == (1, 0)]
    assert len(falls) == 256


def test_a_window_shows_the_chip_every_half_second_while_it_runs() -> None:
    of = copying()
    answer(of, do="run", speed=0.001)
    whole = ["chip" in next(iter(of.tick(0.09))) for _ in range(7)]
    assert whole == [False, False, False, False, False, True, False]
    shown = answer(of, do="run", running=False)
    assert (shown["running"], shown["inputs"], shown["breakpoints"]) == (False, 0, [])
    assert shown["chip"]["stack"] == []
    assert shown["chip"]["next"]["address"] == shown["chip"]["pc"]
    assert len(shown["chip"]["executed"]) == 8
    assert shown["planned"]


def test_at_most_ten_thousand_instructions_are_stepped_at_once() -> None:
    """The loop of MOVF, MOVWF and GOTO takes four cycles."""
    of = copying()
    begin = answer(of, do="seek", cycle=50_001)["cycle"]
    there = answer(of, do="step", what="instruction", count=20_000)["cycle"]
    assert there - begin == pytest.approx(10_000 * 4 / 3, abs=2)
    assert answer(of, do="step", what="instruction", count=-20_000)["cycle"] == begin
    assert answer(of, do="step", what="instruction")["cycle"] - begin in (1, 2), "one, unless it is said"


def test_frames_are_stepped_from_power_up_where_nothing_is_scheduled() -> None:
    of = copying()
    for now, frames, there in (
        (0, 1, 20_000),
        (20_000, 2, 60_000),
        (70_000, -1, 60_000),
        (60_000, -1, 40_000),
        (70_000, -3, 20_000),
        (70_000, -9, 0),
    ):
        answer(of, do="seek", cycle=now)
        # The instruction in which the moment is is executed to its end.
        assert answer(of, do="step", what="frame", count=frames)["cycle"] - there in (0, 1), (now, frames)


def test_inputs_that_are_recorded_and_given_here_are_shown_in_their_order() -> None:
    recorded = Recorded([LevelChange(cycle, 0, cycle // 100 % 2) for cycle in (100, 400, 700)])
    of = WatchSession(Subject(Path("copy.hex"), MHZ4, image=image(COPY), stimuli=Stimuli([recorded])))
    here = answer(of, do="seek", cycle=200)["cycle"]
    answer(of, do="pin", pin="RA1", level=1)
    found = inputs(of, 1000)
    assert found == [(100, 0, 1), (here + 1, 1, 1), (400, 0, 0), (700, 0, 1)]


def test_instructions_without_a_listing_are_disassembled() -> None:
    of = copying()
    chip = answer(of, do="seek", cycle=50_001)["chip"]
    texts = {each["text"].split()[0].lower() for each in (chip["next"], *chip["executed"])}
    assert texts == {"movf", "movwf", "goto"} and chip["here"] is None
    assert {(each["file"], each["line"]) for each in chip["executed"]} == {(None, None)}
    assert [(each["cycle"], each["address"]) for each in chip["executed"]][-1][0] < of.now


def test_a_breakpoint_is_one_of_two_hundred_characters() -> None:
    of = copying()
    found = answer(of, do="breakpoint", text="  RB0 rise" + " " * 300, on=True)
    assert found["breakpoints"] == ["RB0 rise"]
    assert answer(of, do="breakpoint", text="RB0 rise")["breakpoints"] == [], "without a word it is removed"


def test_a_model_says_what_does_not_change() -> None:
    model = copying().model()
    assert (model["name"], model["device"], model["cycle_us"]) == ("copy.hex", "PIC16F84", 1.0)
    assert (model["cycles_per_second"], model["period"], model["runs"]) == (1e6, 20_000, True)
    assert (model["end"], model["schedule"], model["schedule_cycle_us"], model["origin"]) == (None,) * 4
    assert (model["compared"], model["has_bodies"], model["poses"]) == (False, False, False)
    assert (model["channels"], model["inputs"], model["serial"], model["walk"]) == ([], [], None, None)
    assert (model["ram_first"], model["eeprom_bytes"]) == (0x0C, 64)  # DS35007 figure 2-2
    assert len(model["package"]) == 18
    of = session(ROWS, 77, title="a name", begin=Cycles(30))
    assert (of.model()["name"], of.model()["runs"], of.model()["end"], of.now) == ("a name", False, 77, 30)
    assert session(ROWS, 77).model()["period"] == 20_000


# Differences

PULSES = PulseSchedule(
    clock=MHZ4,
    period=Cycles(100),
    channels=(Channel("arm", "RB0", "futaba-s3001"), Channel("hand", "RB1", "futaba-s3001")),
    lead_in=(Run(2, (None, Pulse(5, 10))),),
    loop=(Run(1, (Pulse(0, 20), None)), Run(2, (Pulse(0, 30), Pulse(30, 10)))),
)


def expected(frames: int) -> list[Row]:
    found = []
    for frame in range(frames):
        begin, place = 100 * frame, (frame - 2) % 3
        if frame < 2:
            pulses = [(RB1, 5, 10)]
        else:
            pulses = [(RB0, 0, 20)] if place == 0 else [(RB0, 0, 30), (RB1, 30, 10)]
        for pin, rise, width in pulses:
            found += [(begin + rise, pin, 1), (begin + rise + width, pin, 0)]
    return sorted(found)


def test_a_schedule_asks_for_its_frames_over_and_over() -> None:
    wanted = ScheduledEdges(PULSES, 1000)
    every = [(cycle + 1000, pin, level) for cycle, pin, level in expected(12)]
    for begin in range(990, 1500, 7):
        for length in (1, 10, 101, 305):
            asked = [edge for edge in every if begin <= edge[0] < begin + length]
            assert wanted.edges(begin, begin + length) == asked
    assert first_rise(PULSES) == 5
    assert [wanted.frame_at(moment) for moment in (999, 1000, 1099, 1100)] == [-1, 0, 0, 1]
    assert wanted.frame_begin(3) == 1300
    part = ScheduledEdges(PULSES, 1000, begin=1215, end=1330)
    assert part.edges(1000, 1500) == [edge for edge in every if 1215 <= edge[0] < 1330]
    scaled = ScheduledEdges(PULSES, 10.5, 2.5, tolerance=1.5)
    assert scaled.edges(0, 3000) == sorted(
        edge
        for edge in ((round(10.5 + 2.5 * at), pin, level) for at, pin, level in expected(14))
        if edge[0] < 3000
    )
    assert scaled.margin == 2


def test_edges_differ_that_only_one_side_has() -> None:
    wanted = ScheduledEdges(PULSES, 0)
    rows = expected(6)
    assert differing(wanted, chunk(rows), 0, 600) == []
    late = [(at + (at == 220), pin, level) for at, pin, level in rows]
    assert differing(wanted, chunk(late), 0, 600) == [(220, RB0, 0), (221, RB0, 0)]
    assert differing(wanted, chunk(late), 221, 600) == [(221, RB0, 0)]
    assert differing(wanted, chunk(late), 0, 221) == [(220, RB0, 0)]
    # Another pin is none of the schedule's, and what comes before frame 0 is not compared.
    other = sorted([*rows, (7, 9, 1)])
    assert differing(wanted, chunk(other), 0, 600) == []
    placed = ScheduledEdges(PULSES, 50)
    early = [(49, RB1, 1), *((at + 50, pin, level) for at, pin, level in rows)]
    assert differing(placed, chunk(early), 0, 600) == []
    assert differing(placed, chunk([(50, RB0, 1), *early[1:]]), 0, 600) == [(50, RB0, 1)]


def test_frames_are_those_of_the_capture_that_a_moment_is_in() -> None:
    """Two captures in one file; behind them the frames of the first one go on."""
    wanted = (ScheduledEdges(PULSES, 10, end=300), ScheduledEdges(PULSES, 1040, end=2000))
    of = session(ROWS, 3000, wanted=wanted, schedule=PULSES)
    for now, frames, there in (
        (50, 1, 110),
        (250, 1, 310),
        (300, 1, 340),
        (1199, 1, 1240),
        (1240, 2, 1440),
        (1199, -1, 1140),
        (1140, -1, 1040),
        (2000, 1, 2010),
        (2500, 1, 2510),
    ):
        answer(of, do="seek", cycle=now)
        assert answer(of, do="step", what="frame", count=frames)["cycle"] == there, (now, frames)


@pytest.mark.parametrize(("by", "alone"), [(-3, 2), (-2, 0), (2, 0), (3, 2)])
def test_an_edge_of_a_capture_may_be_as_far_away_as_its_tolerance(by: int, alone: int) -> None:
    wanted = ScheduledEdges(PULSES, 10, tolerance=2)
    rows = [(at + 10 + by * (at == 220), pin, level) for at, pin, level in expected(6)]
    assert len(differing(wanted, chunk(rows), 0, 600)) == alone


def test_the_first_difference_is_found_however_the_trace_is_cut() -> None:
    rows = [(0, RB1, 0), *((at + 40, pin, level) for at, pin, level in expected(30))]
    for size in (1, 5, 1000):
        pieces = tuple(chunk(rows[first : first + size]) for first in range(0, len(rows), size))
        trace = EdgeTrace(MHZ4, pieces, Cycles(3040))
        wanted = place_schedule(PULSES, trace)
        assert wanted == ScheduledEdges(PULSES, 40)
        assert next(differences(wanted, trace, 3040), None) is None
        for number in (4, 30, len(rows) - 1):
            at, pin, level = rows[number]
            moved = sorted([*rows[:number], (at + 1, pin, level), *rows[number + 1 :]])
            cut = tuple(chunk(moved[first : first + size]) for first in range(0, len(moved), size))
            other = EdgeTrace(MHZ4, cut, Cycles(3041))
            assert next(differences(wanted, other, 3041), None) == at
            assert next(differences(wanted, other, at), None) is None
        short = EdgeTrace(MHZ4, pieces, Cycles(3200))
        assert next(differences(wanted, short, 3200), None) == 3040, "then the pulses stop"
    assert place_schedule(PULSES, EdgeTrace(MHZ4, (chunk([(5, 9, 1)]),), Cycles(100))) is None
    quiet = PulseSchedule(
        clock=MHZ4, period=Cycles(100), channels=PULSES.channels, lead_in=(), loop=(Run(1, (None, None)),)
    )
    assert first_rise(quiet) is None
    assert np.array_equal(ScheduledEdges(quiet, 0).pins, [RB0, RB1])
