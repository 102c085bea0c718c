"""What a window's session answers: without a server and without a browser."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path
from threading import Event, Timer
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.bench.ports import Unplugged
from servogen.edges import HIGH, LOW, PINS, EdgeTrace, edge_chunk
from servogen.engines.inputs.buttons import ButtonPin
from servogen.engines.inputs.commands import CommandButton
from servogen.errors import InputError
from servogen.pic.image import Image, to_hex
from servogen.plan_error import PlanError, plan_text
from servogen.programs import read_schedule
from servogen.simulator import LevelChange, Recorded, Stimuli
from servogen.traces.captures import capture_writer
from servogen.units import Clock, Cycles
from servogen.watch import editing
from servogen.watch import session as session_module
from servogen.watch.differences import Edge, ScheduledEdges
from servogen.watch.editing import Editor
from servogen.watch.live_line import LiveLine
from servogen.watch.session import MAX_BREAKPOINTS, STEPS, WatchSession, find_repetition
from servogen.watch.subject import Setting, Subject, check, load_subject
from tests.engines.player.command_walks import target
from tests.engines.player.test_direction_buttons import ROBOT, TEXT, TWO
from tests.simulator.helpers import image

ROOT = Path(__file__).parent.parent.parent
LAB8 = ROOT / "firmware" / "lab8-exercise"
RB0 = PINS.index("RB0")


def said(session: WatchSession, **request: Any) -> dict[str, Any]:
    """What is answered at once."""
    return list(session.handle(request))[-1]


def answer(session: WatchSession, **request: Any) -> dict[str, Any]:
    """The answer, which a slow machine gives to a way in several steps."""
    found = said(session, **request)
    return arrived(session) if found["is"] == "going" else found


def arrived(session: WatchSession) -> dict[str, Any]:
    """What is shown at the end of a way."""
    while True:
        message = next(session.tick(0.0))  # and no more: bodies would follow
        if message["is"] != "going":
            return message


def unpacked(packed: list[int], begin: int) -> list[tuple[int, int, int]]:
    found, cycle = [], begin
    for way, edge in zip(packed[::2], packed[1::2], strict=True):
        cycle += way
        found.append((cycle, edge >> 2, edge & 3))
    return found


def edges_made(found: dict[str, Any]) -> list[tuple[int, int, int]]:
    """The edges of the pulses of a window, as far as they are in it."""
    edges, rise, packed = [], found["begin"], found["pulses"]
    for since, width, pin in zip(packed[::3], packed[1::3], packed[2::3], strict=True):
        rise += since
        edges += [(rise, pin, 1), (rise + width, pin, 0)]
    return sorted(edge for edge in edges if found["begin"] <= edge[0] < found["seen"])


@pytest.fixture(scope="module")
def lab8() -> Subject:
    return load_subject(LAB8 / "main.hex", Setting(schedule=read_schedule(LAB8 / "schedule.json")))


def test_widths_are_those_of_the_schedule_in_every_pose(lab8: Subject) -> None:
    """30°, 90° and 120° are 1167, 1500 and 1667 µs, for 2, 5 and 3 s."""
    session = WatchSession(lab8)
    for cycle, width in ((1_000_000, 1167), (4_000_000, 1500), (8_000_000, 1667), (11_000_000, 1167)):
        assert answer(session, do="seek", cycle=cycle)["widths"][RB0] == width


def test_a_servo_without_pulses_stays_where_the_latest_one_has_turned_it(tmp_path: Path) -> None:
    """Pulses of 2000 µs, then 5 s of silence."""
    program = tmp_path / "pause.c"
    program.write_text(
        "#pragma CLOCK_FREQ 4000000\nvoid main(void)\n{\n    char i;\n    trisb = 0;\n    while (1) {\n"
        "        for (i = 0; i < 20; i++) {\n            set_bit(portb, 0);\n            delay_ms(2);\n"
        "            clear_bit(portb, 0);\n            delay_ms(18);\n"
        "        }\n        delay_s(5);\n    }\n}\n"
    )
    session = WatchSession(load_subject(program, Setting(schedule=read_schedule(LAB8 / "schedule.json"))))
    for cycle, driven in ((300_000, True), (600_000, False), (4_000_000, False)):
        shown = answer(session, do="seek", cycle=cycle)
        assert shown["held"][RB0] == pytest.approx(2000, abs=20)
        assert bool(shown["widths"][RB0]) == driven
        answer(session, do="seek", cycle=0)


def test_frames_are_counted_from_the_first_pulse(lab8: Subject) -> None:
    session = WatchSession(lab8)
    (wanted,) = lab8.wanted
    origin = wanted.origin
    assert answer(session, do="step", what="frame", count=1)["cycle"] in range(origin, origin + 3)
    session.handle({})
    assert answer(session, do="step", what="frame", count=10)["cycle"] in range(
        origin + 200_000, origin + 200_003
    )
    answer(session, do="seek", cycle=origin + 205_000)
    assert answer(session, do="step", what="frame", count=-1)["cycle"] in range(
        origin + 200_000, origin + 200_003
    )


def test_waves_hold_the_edges_and_what_the_schedule_asks_for(lab8: Subject) -> None:
    session = WatchSession(lab8)
    answer(session, do="seek", cycle=400_000)
    found = answer(session, do="waves", begin=300_000, end=380_000)
    made = edges_made(found)
    assert made == unpacked(found["wanted"], 300_000) and len(made) == 8
    assert {pin for _, pin, _ in made} == {RB0}
    assert [late - early for (early, *_), (late, *_) in zip(made[::2], made[1::2], strict=True)] == [1167] * 4
    assert found["differing"] == [] and found["seen"] == 380_000
    future = answer(session, do="waves", begin=390_000, end=480_000)
    assert future["seen"] == 400_000
    assert len(future["wanted"]) // 2 > len(edges_made(future))
    assert future["differing"] == [], "what has not happened yet does not differ"


def test_differences_are_shown_where_the_program_is_wrong(tmp_path: Path) -> None:
    text = (LAB8 / "main.c2c.c").read_text().replace("delay_us(", "delay_us(1 + ", 1)
    program = tmp_path / "late.c"
    program.write_text(text)
    subject = load_subject(program, Setting(schedule=read_schedule(LAB8 / "schedule.json")))
    (wanted,) = subject.wanted
    assert subject.first_difference == wanted.origin + 1167
    assert subject.differences[0][0] == subject.first_difference
    session = WatchSession(subject)
    answer(session, do="seek", cycle=60_000)
    first = subject.first_difference
    found = answer(session, do="waves", begin=first - 100, end=first + 100)
    assert unpacked(found["differing"], first - 100) == [(first, RB0, 0), (first + 1, RB0, 0)]


COPY = " bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\nl movf PORTA, w\n movwf PORTB\n goto l\n"


def test_a_pin_is_held_from_outside_and_seen_in_the_waves() -> None:
    session = WatchSession(Subject(Path("copy.hex"), Clock(4_000_000), image=image(COPY)))
    answer(session, do="seek", cycle=1000)
    shown = answer(session, do="pin", pin="RA0", level=1)
    assert shown["chip"]["outside"][0] == 1
    found = answer(session, do="seek", cycle=1100)
    assert found["levels"][0] == "h" and found["levels"][RB0] == "1"
    waves = answer(session, do="waves", begin=900, end=1100)
    ((cycle, pin, level),) = unpacked(waves["inputs"], 900)
    assert (pin, level) == (0, 1) and 1000 < cycle < 1005
    later = answer(session, do="waves", begin=1050, end=1100)
    assert later["inputs"] == [] and later["inputs_before"] == {0: 1}


def test_a_window_has_the_inputs_from_its_beginning_to_before_its_end() -> None:
    """Windows side by side show each recorded input once."""
    recorded = Recorded([LevelChange(cycle, 0, level) for cycle, level in ((500, 1), (700, 0), (900, 1))])
    subject = Subject(Path("copy.hex"), Clock(4_000_000), image=image(COPY), stimuli=Stimuli([recorded]))
    session = WatchSession(subject)
    answer(session, do="seek", cycle=2000)
    shown = [
        unpacked(answer(session, do="waves", begin=begin, end=end)["inputs"], begin)
        for begin, end in ((300, 500), (500, 700), (700, 900), (900, 1100))
    ]
    assert shown == [[], [(500, 0, 1)], [(700, 0, 0)], [(900, 0, 1)]]


def test_the_folder_of_a_build_has_its_clock_and_its_chip() -> None:
    """stream-fast is built for a PIC16F84A with 20 MHz; what the command line names goes first."""
    folder = ROOT / "firmware" / "stream-fast"
    subject = load_subject(folder, Setting())
    assert (subject.options.device, subject.clock) == ("PIC16F84A", Clock(20_000_000))
    named = load_subject(folder, Setting(clock_hz=8_000_000, device="PIC16F84"))
    assert (named.options.device, named.clock) == ("PIC16F84", Clock(8_000_000))


def test_breakpoints_are_added_and_removed_one_by_one(lab8: Subject) -> None:
    """A request names one of them, so that one typed before the last answer came replaces none."""
    session = WatchSession(lab8)
    for text in ("RB0 rise", "0x01F", "RB0 rise"):
        answer(session, do="breakpoint", text=text, on=True)
    assert session.shown()["breakpoints"] == ["0x01F", "RB0 rise"]
    answer(session, do="breakpoint", text="0x01F", on=False)
    assert session.shown()["breakpoints"] == ["RB0 rise"]
    for address in range(MAX_BREAKPOINTS - 1):
        answer(session, do="breakpoint", text=f"0x{address:03X}", on=True)
    assert "remove one first" in answer(session, do="breakpoint", text="RB0 fall", on=True)["text"]


def test_stop_conditions_pause_a_run(lab8: Subject) -> None:
    session = WatchSession(lab8)
    answer(session, do="breakpoint", text="RB0 fall", on=True)
    stopped = []
    for _ in range(2):
        answer(session, do="run", running=True, speed=None)
        while (found := list(session.tick(0.05))[-1])["running"]:
            pass
        stopped.append((found["stopped"], found["cycle"]))
    assert stopped[0][0] == "RB0 fall" and stopped[1] == ("RB0 fall", lab8.wanted[0].origin + 1168)


def test_the_way_to_a_far_moment_is_gone_in_steps_and_ends_at_two_days(
    lab8: Subject, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a clock that goes 50 ms further at each look it is said after a few how far the way is done."""
    session, looks = WatchSession(lab8), itertools.count()
    with monkeypatch.context() as patch:
        patch.setattr(session_module.time, "monotonic", lambda: next(looks) * 0.05)
        there = said(session, do="seek", cycle=10**15)
        opened = WatchSession(replace(lab8, begin=Cycles(10**11))).there()
    assert (opened["is"], opened["cycle"]) == ("going", 10**11), "a moment on the way is not shown"
    assert (there["is"], there["cycle"]) == ("going", 48 * 3600 * 10**6)
    assert 0 < there["share"] < 0.001 and next(looks) < 40
    arrived(session)
    assert session.now - 48 * 3600 * 10**6 in range(3)
    assert answer(session, do="seek", cycle=-5)["cycle"] == 0


def test_hour_20_of_a_day_is_exact(lab8: Subject) -> None:
    """The schedule is what the plan says, at any time: a loop of 10 s, the first pulse after reset known."""
    session = WatchSession(lab8)
    answer(session, do="seek", cycle=20 * 3600 * 10**6)
    begin = session.now - 70_000
    answer(session, do="step", what="edge", count=-1)
    assert begin < session.now
    waves = answer(session, do="waves", begin=begin, end=begin + 60_000)
    assert 2 * len(edges_made(waves)) == len(waves["wanted"]) > 4 and waves["differing"] == []


def test_what_is_asked_on_the_way_begins_where_it_is(lab8: Subject) -> None:
    session = WatchSession(replace(lab8, schedule=None, wanted=()))  # nothing says that it repeats itself
    there = said(session, do="seek", cycle=10**15)
    assert there["is"] == "going"
    answer(session, do="run", running=True)
    here = session.now
    (shown, *_) = session.tick(0.01)
    assert shown["cycle"] - here == pytest.approx(10_000, abs=3)


def test_the_line_that_called_a_routine_is_where_it_runs(tmp_path: Path) -> None:
    program = tmp_path / "wait.c"
    program.write_text(
        "#pragma CLOCK_FREQ 4000000\nvoid main(void)\n{\n    delay_ms(200);\n    while (1);\n}\n"
    )
    session = WatchSession(load_subject(program, Setting()))
    assert answer(session, do="seek", cycle=100_000)["chip"]["here"] == (str(program), 4)


def test_a_capture_is_gone_through_by_edges_and_time(tmp_path: Path) -> None:
    """Three pulses of 1500 µs, sampled once a µs."""
    lines = ["$timescale 1 us $end", "$scope module x $end", "$var wire 1 ! RB0 $end"]
    lines += ["$upscope $end", "$enddefinitions $end", "#0", "0!"]
    for pulse in range(3):
        lines += [f"#{5000 + 20_000 * pulse}", "1!", f"#{6500 + 20_000 * pulse}", "0!"]
    file = tmp_path / "run.vcd"
    file.write_text("\n".join([*lines, "#60000", ""]))
    check(file)
    session = WatchSession(load_subject(file, Setting()))
    model = session.model()
    assert not model["runs"] and model["end"] == 60_000
    answer(session, do="step", what="edge", count=1)
    assert answer(session, do="step", what="edge", count=1)["cycle"] == 5001
    shown = answer(session, do="step", what="edge", count=1)
    assert shown["cycle"] == 6501 and shown["widths"][RB0] == 1500
    assert answer(session, do="step", what="edge", count=-1)["cycle"] == 5001
    found = answer(session, do="waves", begin=0, end=30_000)
    assert edges_made(found) == [
        (5000, RB0, 1),
        (6500, RB0, 0),
        (25_000, RB0, 1),
        (26_500, RB0, 0),
    ]
    assert "no instructions" in answer(session, do="step", what="line")["text"]
    assert "no inputs" in answer(session, do="pin", pin="RA0", level=1)["text"]
    answer(session, do="seek", cycle=0)
    answer(session, do="breakpoint", text="RB0 fall", on=True)
    for fall in (6500, 26_500, 46_500):
        answer(session, do="run", running=True, speed=None)
        stopped = list(session.tick(0.1))[-1]
        assert (stopped["stopped"], stopped["cycle"], stopped["running"]) == ("RB0 fall", fall + 1, False)
    answer(session, do="run", running=True, speed=None)
    assert list(session.tick(0.1))[-1]["stopped"] == "the end of the recording"
    for text in ("0x01F", "0x20 == 3", "line 3"):
        refused = answer(session, do="breakpoint", text=text, on=True)
        assert refused["is"] == "problem", text
    refused = answer(session, do="breakpoint", text="0x01F", on=True)
    assert "neither instructions nor memory" in refused["text"]
    assert session.shown()["breakpoints"] == ["RB0 fall"]


RATE = 2_000_000
SAMPLE, SECOND = 5, 10_000_000
"""Steps of the file, which are 0.1 µs: of a sample, and of a second."""
BEGIN = 7_654_321.3
"""The analyser's first sample, in cycles after the first pulse: between two of them."""


def captured(path: Path, ppm: float, changed: Sequence[Edge], rate: int = RATE, begin: float = BEGIN) -> Path:
    """Write what an analyser sees of edges, in cycles of a chip whose clock is `ppm` too fast."""
    rows = [(0, pin, LOW) for pin in sorted({RB0, *(pin for _, pin, _ in changed)})]
    rows += [
        (ceil((cycle - begin) / (1 + ppm / 1e6) * rate / 1e6), pin, level)
        for cycle, pin, level in changed
        if cycle > begin
    ]
    end = Cycles(rows[-1][0] + rate // 100)
    trace = EdgeTrace(Clock(4 * rate), (edge_chunk(*zip(*rows, strict=True)),), end)
    with capture_writer(path, rate) as writer:
        for chunk in trace.chunks:
            writer.add(chunk)
        writer.finish(end)
    return path


@pytest.mark.parametrize("ppm", [0.0, 140.0])
def test_a_capture_is_held_against_the_schedule_wherever_it_begins(tmp_path: Path, ppm: float) -> None:
    schedule = read_schedule(LAB8 / "schedule.json")
    edges = ScheduledEdges(schedule, 0).edges(0, 20_000_000)
    good = captured(tmp_path / "good.vcd", ppm, edges)
    subject = load_subject(good, Setting(schedule=schedule))
    assert subject.first_difference is None and subject.verdict == "agrees"
    session = WatchSession(subject)
    begin = 3 * SECOND
    found = answer(session, do="waves", begin=begin, end=begin + SECOND)
    asked, made = unpacked(found["wanted"], begin), edges_made(found)
    assert len(asked) == len(made) == 100 and found["differing"] == []
    assert max(abs(one[0] - other[0]) for one, other in zip(asked, made, strict=True)) <= SAMPLE
    origin, period = session.model()["origin"], session.model()["period"]
    scale = 10 / (1 + ppm / 1e6)
    assert period == pytest.approx(20_000 * scale, rel=2e-6)
    assert origin == pytest.approx(-BEGIN * scale, abs=SAMPLE)
    assert answer(session, do="step", what="frame", count=1)["cycle"] == round(origin + 383 * period)


@pytest.fixture(scope="session")
def walk_capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of a walking hexapod whose leg L1 is lifted by pulses that are 100 µs too long."""
    schedule = read_schedule(ROOT / "firmware" / "hexapod-tripod" / "schedule.json")
    lift = next(PINS.index(channel.pin) for channel in schedule.channels if channel.name == "L1-lift")
    first = schedule.lead_in_frames * schedule.period
    edges = ScheduledEdges(schedule, 0).edges(first - 500_000, first + 1_500_000)
    moved = sorted((at + 100 * (pin == lift and level == LOW), pin, level) for at, pin, level in edges)
    file = tmp_path_factory.mktemp("capture") / "walk.vcd"
    return captured(file, 0.0, moved, rate=1_000_000, begin=moved[0][0] - 1000)


def test_a_capture_moves_the_robot_of_the_job_that_it_is_compared_with(walk_capture: Path) -> None:
    session = WatchSession(load_subject(walk_capture, Setting(job=ROOT / "jobs" / "hexapod-tripod.toml")))
    model = session.model()
    assert model["first_difference"] is not None and not model["runs"] and not model["poses"]
    assert [end["name"] for end in model["robot"]["ends"]] == ["L1", "L2", "L3", "R1", "R2", "R3"]
    schedule = read_schedule(ROOT / "firmware" / "hexapod-tripod" / "schedule.json")
    frame = schedule.lead_in_frames + 20
    (wanted,) = session.subject.wanted
    shown = answer(session, do="seek", cycle=wanted.frame_begin(frame + 1))
    for channel, servo, pulse in zip(
        schedule.channels, model["robot"]["servos"], wanted.run_at(frame).pulses, strict=True
    ):
        assert (servo["name"], servo["pin"]) == (channel.name, PINS.index(channel.pin)) and pulse
        longer = 100 * (channel.name == "L1-lift")
        assert shown["widths"][servo["pin"]] * model["cycle_us"] == pytest.approx(pulse.width + longer, abs=1)


def test_edges_in_cycles_are_those_of_a_chip_of_4_mhz_unless_a_clock_is_given(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    file.write_text("cycle,pin,level\n5000,RB0,1\n6500,RB0,0\n")
    for setting, clock in ((Setting(), 4_000_000), (Setting(clock_hz=20_000_000), 20_000_000)):
        subject = load_subject(file, setting)
        assert subject.clock == Clock(clock) and subject.wanted == () and subject.first_difference is None
    schedule = read_schedule(LAB8 / "schedule.json")
    subject = load_subject(file, Setting(schedule=schedule, clock_hz=1_000_000, at_cycle=5500))
    (wanted,) = subject.wanted
    assert (subject.clock, subject.begin, wanted.origin) == (schedule.clock, 5500, 5000)
    # A pulse of 1500 µs instead of 1167 µs.
    assert subject.first_difference == 5000 + 1167
    file.write_text("cycle,pin,level\n5000,RB1,1\n")
    assert load_subject(file, Setting(schedule=schedule)).wanted == (), "no pulse of the schedule's"


def test_a_schedule_alone_moves_the_dials_of_its_servos(tmp_path: Path, lab8: Subject) -> None:
    """A pulse of 1500 µs is 90° for the S3001; an unknown model has no dial."""
    robot = WatchSession(lab8).model()["robot"]
    assert robot["ends"] == [] and [servo["pin"] for servo in robot["servos"]] == [RB0]
    widths, turned = robot["servos"][0]["widths_us"], robot["servos"][0]["angles"]
    assert np.degrees(np.interp(1500, widths, turned)) == pytest.approx(90)
    text = (LAB8 / "schedule.json").read_text()
    (tmp_path / "schedule.json").write_text(text.replace("futaba-s3001", "my-own"))
    subject = load_subject(LAB8 / "main.hex", Setting(schedule=read_schedule(tmp_path / "schedule.json")))
    assert WatchSession(subject).model()["robot"] is None
    assert WatchSession(load_subject(LAB8 / "main.hex", Setting())).model()["robot"] is None


def test_the_first_difference_of_a_capture_is_the_edge_that_is_late(tmp_path: Path) -> None:
    schedule = read_schedule(LAB8 / "schedule.json")
    edges = ScheduledEdges(schedule, 0).edges(0, 20_000_000)
    late = next(index for index, edge in enumerate(edges) if edge[0] > 11_000_000 and edge[2] == LOW)
    edges[late] = (edges[late][0] + 4, *edges[late][1:])
    subject = load_subject(captured(tmp_path / "late.vcd", 140.0, edges), Setting(schedule=schedule))
    assert subject.verdict.startswith("does not agree: first at 3.3")
    assert "a pulse of 1171.16 µs where 1167.00 µs are scheduled" in subject.verdict  # 4 µs, in samples
    session = WatchSession(subject)
    scale = 10 / (1 + 140e-6)
    rise, fall = ((edges[index][0] - BEGIN) * scale for index in (late - 1, late))
    first = subject.first_difference
    assert first == pytest.approx(rise, abs=SAMPLE)
    begin = first - 500_000
    red = unpacked(answer(session, do="waves", begin=begin, end=begin + SECOND)["differing"], begin)
    assert [(pin, level) for _, pin, level in red] == [(RB0, LOW), (RB0, LOW)]
    assert [cycle for cycle, *_ in red] == [pytest.approx(at, abs=SAMPLE) for at in (fall - 40, fall)]


def test_a_window_may_end_between_an_edge_and_its_partner(tmp_path: Path) -> None:
    schedule = read_schedule(LAB8 / "schedule.json")
    edges = ScheduledEdges(schedule, 0).edges(0, 20_000_000)
    session = WatchSession(
        load_subject(captured(tmp_path / "x.vcd", 140.0, edges), Setting(schedule=schedule))
    )
    found = answer(session, do="waves", begin=0, end=SECOND)
    asked, made = unpacked(found["wanted"], 0), edges_made(found)
    apart = [(one[0], other[0]) for one, other in zip(asked, made, strict=True) if one[0] != other[0]]
    assert apart  # the samples do not meet the edges
    for one, other in apart:
        for begin, end in ((max(one, other), SECOND), (0, max(one, other))):
            assert answer(session, do="waves", begin=begin, end=end)["differing"] == []


def test_a_glitch_in_a_capture_is_its_first_difference(tmp_path: Path) -> None:
    schedule = read_schedule(LAB8 / "schedule.json")
    edges = ScheduledEdges(schedule, 0).edges(0, 20_000_000)
    glitch = [(12_345_678, RB0, HIGH), (12_345_681, RB0, LOW)]
    subject = load_subject(
        captured(tmp_path / "glitch.vcd", 0.0, sorted(edges + glitch)), Setting(schedule=schedule)
    )
    assert "1 glitch" in subject.verdict
    assert subject.first_difference == SAMPLE * ceil((12_345_678 - BEGIN) * 2)


def test_a_capture_of_something_else_has_no_schedule_beside_it(tmp_path: Path) -> None:
    schedule = read_schedule(ROOT / "firmware" / "hexapod-tripod" / "schedule.json")
    lone = [(BEGIN + 5000, RB0, HIGH), (BEGIN + 5100, RB0, LOW)]
    subject = load_subject(captured(tmp_path / "x.vcd", 0.0, lone), Setting(schedule=schedule))
    assert subject.verdict.startswith("does not agree: ")
    assert WatchSession(subject).model()["is"] == "model"


class Line:
    """A serial line that takes its time, and fails when it is told to."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.go = threading.Event()
        self.broken = False

    def write(self, data: bytes) -> None:
        self.go.wait(60)
        if self.broken:
            raise Unplugged("port-unplugged", "the port has disappeared")
        self.sent.append(data)


@pytest.fixture(scope="module")
def stream_arm() -> Subject:
    return load_subject(ROOT / "jobs" / "stream-arm.toml", Setting())


def test_a_job_with_a_stream_says_where_its_line_is(stream_arm: Subject) -> None:
    session = WatchSession(stream_arm)
    model = session.model()
    assert model["serial"] == {"pin": "RA4", "baud": 2400, "answers": "RA3"}
    assert (model["poses"], model["has_bodies"], model["walk"], model["inputs"]) == (True, False, None, [])
    assert [servo["name"] for servo in model["robot"]["servos"]] == ["base", "shoulder", "grip"]
    assert answer(session, do="servo", servo=3, position=1)["text"].startswith("there is no servo 3")
    assert answer(session, do="servo", servo=-1, position=1)["text"].startswith("there is no servo -1")
    answer(session, do="servo", servo=0, position=-7)
    assert session.chip is not None
    # FF 00 00, three bytes of which only the first has a bit that is high; 2400 baud.
    falls = [change.cycle for change in session.chip.inputs if change.level == LOW]
    assert [round((fall - falls[0]) * 2400 / 1e6) for fall in falls] == [0, 10, 20]


def test_a_slider_moves_a_real_robot_too_and_leaves_no_queue_behind(stream_arm: Subject) -> None:
    line = Line()
    live = LiveLine(line)
    session = WatchSession(stream_arm, live)
    for position in range(100, 120):
        answer(session, do="servo", servo=1, position=position)
    answer(session, do="servo", servo=2, position=300)
    line.go.set()
    live.close()
    assert line.sent[-2:] == [bytes((255, 1, 119)), bytes((255, 2, 254))]
    assert len(line.sent) <= 3, "what waited was replaced"


def test_a_robot_that_is_unplugged_is_said_in_the_page(stream_arm: Subject) -> None:
    line = Line()
    line.broken = True
    line.go.set()
    live = LiveLine(line)
    live.command(0, b"x")
    live.close()
    session = WatchSession(stream_arm, live)
    texts = [each.get("text", "") for each in session.handle({"do": "servo", "servo": 0, "position": 1})]
    assert any("the port has disappeared" in text for text in texts)


@pytest.mark.parametrize(
    ("name", "text", "code"),
    [
        ("x.txt", "", "unknown-suffix"),
        ("missing.hex", None, "unreadable-file"),
        ("bad.toml", "[chip\n", "toml-syntax"),
        ("bad.toml", "[chip]\ndevice = 3\n", "wrong-type"),
    ],
)
def test_what_cannot_be_watched_is_refused_at_once(
    tmp_path: Path, name: str, text: str | None, code: str
) -> None:
    file = tmp_path / name
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError) as refused:
        check(file)
    assert refused.value.diagnostics[0].code == code


def test_an_editor_writes_its_own_file_only_when_it_is_right(tmp_path: Path) -> None:
    file = tmp_path / "job.toml"
    text = (ROOT / "jobs" / "lab8-exercise.toml").read_text()
    file.write_text(text)
    editor = Editor(file, Setting())
    bad = text.replace("arm_deg = 30", "arm_deg = 400")
    for request in ("check", "save", "build"):
        found, subject = editor.handle({"do": request, "text": bad}, Event())
        assert not found["good"] and subject is None
        assert "400" in found["diagnostics"][0]["message"]
    assert file.read_text() == text
    good = text.replace("arm_deg = 30", "arm_deg = 40")
    found, _ = editor.handle(
        {"do": "save", "text": good, "over": text, "path": str(tmp_path / "other.toml")}, Event()
    )
    assert found["saved"] and file.read_text() == good
    assert [each.name for each in tmp_path.iterdir()] == ["job.toml"]


def test_a_text_that_means_hours_of_motion_is_planned_no_further_than_wanted(tmp_path: Path) -> None:
    """A walk of 4000 steps takes minutes to plan; and nothing is written before it is planned."""
    file = tmp_path / "job.toml"
    text = (ROOT / "jobs" / "hexapod-tripod.toml").read_text()
    file.write_text(text)
    long = text.replace("cycles = 4 }", "cycles = 4000 }")
    for request in ("check", "build"):
        stop = Event()
        Timer(0.3, stop.set).start()
        begin = time.process_time()
        found, subject = Editor(file, Setting()).handle({"do": request, "text": long, "over": text}, stop)
        assert (found, subject) == ({"is": "stopped", "saved": False}, None)
        assert time.process_time() - begin < 5
    assert file.read_text() == text


def test_a_pose_is_recorded_into_a_job_without_a_motion_and_refused_for_a_walk(tmp_path: Path) -> None:
    stream = (ROOT / "jobs" / "stream-arm.toml").read_text()
    editor = Editor(tmp_path / "job.toml", Setting())
    found, _ = editor.handle({"do": "record", "text": stream, "angles": [0.5, 9.0, 1.0]}, Event())
    assert found["text"].startswith(stream.rstrip())
    assert found["text"].endswith(
        "[motion]\nposes = [\n    { base_deg = 28.6, shoulder_deg = 160, grip_deg = 57.3, hold_s = 1 },\n]\n"
    )  # the shoulder's limit is 160°
    walk = (ROOT / "jobs" / "hexapod-tripod.toml").read_text()
    found, _ = editor.handle({"do": "record", "text": walk, "angles": [1.5] * 12}, Event())
    assert "does not move by poses" in found["diagnostics"][0]["message"]
    for angles in ([1.0], [float("nan")] * 3, ["x"] * 3):
        found, _ = editor.handle({"do": "record", "text": stream, "angles": angles}, Event())
        assert found["is"] == "problem"


def frames_of(session: WatchSession, first: int, count: int) -> list[list[int]]:
    """The widths of the servos' pulses in `count` frames from a number on, in cycles."""
    (wanted,) = session.subject.wanted
    pins = [PINS.index(channel.pin) for channel in wanted.schedule.channels]
    found = []
    for frame in range(first + 1, first + 1 + count):
        widths = answer(session, do="seek", cycle=wanted.frame_begin(frame))["widths"]
        found.append([widths[pin] for pin in pins])
    return found


@pytest.mark.campaign
def test_a_way_that_is_chosen_is_walked_until_it_is_stopped() -> None:
    of = target()
    session = WatchSession(load_subject(ROOT / "jobs" / "hexapod-command.toml", Setting()))
    model = session.model()
    assert model["walk"] == {"pin": "RA4", "ways": ["forward", "back", "left", "right"], "stop": "stop"}
    lead_in = of.schedule.lead_in_frames
    begin = session.subject.wanted[0].frame_begin(lead_in)
    assert answer(session, do="seek", cycle=begin)["planned"]
    answer(session, do="walk", way="right")
    assert not answer(session, do="seek", cycle=begin + 10)["planned"]
    walked = np.array(frames_of(session, lead_in, 200))
    assert of.schedule.plan_error is not None
    error = of.schedule.plan_error.width_us

    def goes(way: str, at: int) -> bool:
        cycle = of.directions[way][slice(*of.cycle[way])]
        return bool(np.abs(walked[at : at + len(cycle)] - cycle).max() < error)

    start = next(at for at in range(100) if goes("right", at))
    assert goes("right", start + 48), "it goes on"
    assert not any(goes("left", at) or goes("forward", at) for at in range(150))
    now = answer(session, do="walk", way="stop")["cycle"]
    walked = np.array(frames_of(session, (now - int(session.subject.wanted[0].origin)) // 20_000, 150))
    assert np.abs(walked[-20:] - of.stance).max() < error
    waves = answer(session, do="waves", begin=now, end=now + 1_000_000)
    assert waves["differing"] == [] and waves["wanted"] == [] and len(waves["inputs"]) > 0
    before = answer(session, do="waves", begin=begin - 100_000, end=begin)
    assert len(before["wanted"]) == 2 * len(edges_made(before)) > 0
    refused = answer(session, do="walk", way="up")
    assert refused["is"] == "problem" and "'up' is not a direction" in refused["text"]


def test_the_buttons_of_directions_are_pressed_here(tmp_path: Path) -> None:
    """Whatever is pressed, from then on the robot no longer walks as the schedule's loop says."""
    (tmp_path / "two.toml").write_text(ROBOT)
    job = tmp_path / "job.toml"
    job.write_text(TEXT.replace("BUTTONS", TWO))
    session = WatchSession(load_subject(job, Setting()))
    model = session.model()
    assert model["walk"] is None
    assert model["inputs"] == [
        {"name": "back", "pin": "RA0", "pressed": 0},
        {"name": "left", "pin": "RB7", "pressed": 0},
    ]
    stands = frames_of(session, 40, 1)
    answer(session, do="pin", pin="RB7", level=0)
    turns = frames_of(session, 60, 10)
    assert stands[0] not in turns


def test_the_buttons_of_a_job_have_names() -> None:
    def inputs(commands: Any, start: Any = None, stop: Any = None) -> list[tuple[str, str, int]]:
        buttons = SimpleNamespace(start=start, stop=stop)
        subject: Any = SimpleNamespace(job=SimpleNamespace(buttons=buttons, commands=commands))
        return [(each["name"], each["pin"], each["pressed"]) for each in session_module.job_buttons(subject)]

    ra2, rb7 = ButtonPin("RA2", 0), ButtonPin("RB7", 1)
    assert inputs(None) == [] and inputs(None, ra2) == [("start", "RA2", 0)]
    assert inputs(None, ra2, rb7) == [("start", "RA2", 0), ("stop", "RB7", 1)]
    assert inputs(CommandButton(rb7)) == [("walk", "RB7", 1)]


def test_a_robot_that_takes_no_commands_is_sent_none(lab8: Subject) -> None:
    session = WatchSession(lab8)
    assert session.model()["walk"] is None
    assert "only a job with [walk] commands" in answer(session, do="walk", way="forward")["text"]


def test_an_editor_opens_its_file_or_says_why_not(tmp_path: Path) -> None:
    file = tmp_path / "job.toml"
    editor = Editor(file, Setting())
    assert editor.opened()["is"] == "problem" and "job.toml" in editor.opened()["text"]
    file.write_bytes(b"\xff")
    assert editor.opened()["is"] == "problem"
    # A byte order mark is not part of the text.
    file.write_bytes(b"\xef\xbb\xbf[chip]\n")
    assert editor.opened() == {"is": "editor", "name": "job.toml", "text": "[chip]\n", "saved": True}


def test_what_was_built_is_answered_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of several programs the words and the HEX are those of the first, the reasons those of all."""
    text = (ROOT / "jobs" / "lab8-exercise.toml").read_text()
    words = [Image({0: 0x3FFF}), Image({0: 1})]
    programs = [
        SimpleNamespace(
            firmware=SimpleNamespace(compilation=SimpleNamespace(words=90 + n)),
            verdict=SimpleNamespace(reasons=(f"why {n}",)),
            image=image,
        )
        for n, image in enumerate(words)
    ]
    result = SimpleNamespace(
        programs=programs, exact=False, frames=7, job=SimpleNamespace(name="arm"),
        plan=SimpleNamespace(schedule=SimpleNamespace(plan_error=PlanError(0.25))),
        warnings=[SimpleNamespace(sentence="a warning")],
    )  # fmt: skip

    monkeypatch.setattr(editing, "build", lambda job: result)
    monkeypatch.setattr(editing, "job_subject", lambda path, job, setting: (path, job.name, setting))
    file, setting = tmp_path / "job.toml", Setting(clock_hz=1)
    found, subject = Editor(file, setting).handle({"do": "build", "text": text}, Event())
    assert found == {
        "is": "built",
        "distance": plan_text(PlanError(0.25)),
        "exact": False,
        "frames": 7,
        "words": 90,
        "reasons": ["why 0", "why 1"],
        "warnings": ["a warning"],
        "files": {"arm.hex": to_hex(words[0])},
    }
    assert subject == (file, "job", setting)
    assert file.read_text() == text, "it is saved before it is built"


def changed(editor: Editor, text: str, **change: Any) -> dict[str, Any]:
    found, subject = editor.handle({"do": "pose", "text": text, **change}, Event())
    assert subject is None
    return dict(found)


def test_poses_are_changed_in_their_text_and_nothing_else(tmp_path: Path) -> None:
    text = (ROOT / "jobs" / "lab8-exercise.toml").read_text()
    editor = Editor(tmp_path / "job.toml", Setting())
    checked, _ = editor.handle({"do": "check", "text": text}, Event())
    assert [each["hold_s"] for each in checked["poses"]] == [2, 5, 3]
    assert [np.degrees(each["angles"][0]) for each in checked["poses"]] == pytest.approx([30, 90, 120])
    first, second, third = (line for line in text.splitlines(keepends=True) if line.startswith("    {"))
    rows = first + second + third
    assert rows in text
    moved = changed(editor, text, kind="move", index=2, to=0)
    assert moved["text"] == text.replace(rows, third + first + second) and not moved["saved"]
    assert changed(editor, text, kind="remove", index=1)["text"] == text.replace(second, "")
    held = changed(editor, text, kind="time", index=1, key="hold_s", seconds=5.4)
    assert held["text"] == text.replace("hold_s = 5 }", "hold_s = 5.4 }")
    paused = changed(editor, text, kind="time", index=0, key="pause_s", seconds=0.5)
    assert paused["text"] == text.replace("hold_s = 2 }", "hold_s = 2, pause_s = 0.5 }")
    assert changed(editor, paused["text"], kind="time", index=0, key="pause_s", seconds=None)["text"] == text
    # Times have three decimals; the longest one is 100 000 s.
    for seconds, written in (
        (0, "0"), (1.23456, "1.235"), (0.0004, "0"), (99_999.9994, "99999.999"), (100_000, "100000")
    ):  # fmt: skip
        found = changed(editor, text, kind="time", index=1, key="hold_s", seconds=seconds)
        assert found["text"] == text.replace("hold_s = 5 }", f"hold_s = {written} }}")
    assert changed(editor, text, kind="time", index=1, key="hold_s", seconds=100_001)["is"] == "problem"
    turned = changed(editor, text, kind="angles", index=0, angles=[1.0])
    assert turned["text"] == text.replace("arm_deg = 30", "arm_deg = 57.3", 1)
    assert not (tmp_path / "job.toml").exists(), "nothing is saved before it is asked for"


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"kind": "fly", "index": 0},
        {"kind": "move", "index": 0, "to": 3},
        {"kind": "move", "index": -1, "to": 0},
        {"kind": "remove", "index": 9},
        {"kind": "time", "index": 0, "key": "arm_deg", "seconds": 1},
        {"kind": "time", "index": 0, "key": "hold_s", "seconds": -1},
        {"kind": "time", "index": 0, "key": "hold_s", "seconds": float("nan")},
        {"kind": "time", "index": 0, "key": "hold_s", "seconds": "1 }, evil = {"},
        {"kind": "angles", "index": 0, "angles": [1.0, 2.0]},
        {"kind": "angles", "index": 0, "angles": [float("inf")]},
    ],
)
def test_a_wrong_change_of_a_pose_is_answered(tmp_path: Path, change: dict[str, Any]) -> None:
    text = (ROOT / "jobs" / "lab8-exercise.toml").read_text()
    assert changed(Editor(tmp_path / "job.toml", Setting()), text, **change)["is"] == "problem"


def test_poses_of_another_form_are_not_changed(tmp_path: Path) -> None:
    text = (ROOT / "jobs" / "lab8-exercise.toml").read_text()
    begin, end = text.index("poses = ["), text.index("[frame]")
    tables = text[:begin] + "[[motion.poses]]\narm_deg = 30\nhold_s = 2\n\n" + text[end:]
    for found in (
        changed(Editor(tmp_path / "job.toml", Setting()), tables, kind="remove", index=0),
        Editor(tmp_path / "x.toml", Setting()).handle(
            {"do": "record", "text": tables, "angles": [1]}, Event()
        )[0],
    ):
        assert "written as poses = [" in found["diagnostics"][0]["message"]
        assert found["diagnostics"][0]["line"] == text[:begin].count("\n") - 1


def test_a_far_way_waits_while_the_repetition_is_being_found(lab8: Subject) -> None:
    """Hour 20 costs the chip nothing until it is known what the program does again and again."""
    session = WatchSession(lab8, learning=True)
    hour20 = 20 * 3600 * 10**6
    assert said(session, do="seek", cycle=hour20)["is"] == "going"
    (waiting,) = session.tick(0.066)
    assert (waiting["is"], session.now) == ("going", 0)
    session.knows(find_repetition(lab8))
    there = arrived(session)
    assert there["is"] == "now" and there["cycle"] - hour20 in range(3)
    near = WatchSession(lab8, learning=True)
    said(near, do="seek", cycle=30 * 10**6)
    assert near.now > 0, "half a minute is quicker than to wait"
    touched = WatchSession(lab8, learning=True)
    answer(touched, do="pin", pin="RA3", level=1)
    said(touched, do="seek", cycle=hour20)
    list(touched.tick(0.066))
    assert touched.now > 0, "what is known is of a program whose pins nobody has touched"


def test_every_request_is_answered_within_half_a_second() -> None:
    """Of a program without an edge and without a line, after a minute: each search has an end."""
    session = WatchSession(Subject(Path("x.hex"), Clock(4_000_000), image=Image({0: 0x2800})))
    answer(session, do="seek", cycle=60 * 10**6)
    while session.on_the_way:
        list(session.tick(0.066))
    for what, times in itertools.product(STEPS, (-10_000, -1, 1, 10_000)):
        begin = time.process_time()
        answer(session, do="step", what=what, count=times)
        assert time.process_time() - begin < 5, (what, times)  # half a second on a machine of its own
        answer(session, do="seek", cycle=60 * 10**6)
