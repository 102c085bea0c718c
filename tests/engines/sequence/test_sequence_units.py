"""A sequence's delays, edges and words one by one, by hand; the text that every engine's C begins with."""

from __future__ import annotations

from fractions import Fraction
from itertools import islice
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.edges import edge_chunk
from servogen.engines.c_text import AsmLine, PortText, assembly, decimal, header_values, ports_of
from servogen.engines.inputs.buttons import ControlButtons
from servogen.engines.inputs.commands import COMMANDS
from servogen.engines.inputs.serial import Stream
from servogen.engines.registry import ENGINES, engine_named, suitable
from servogen.engines.sequence import tuning
from servogen.engines.sequence.programs import (
    START,
    DelayPath,
    Edge,
    Hold,
    Overheads,
    SilentStep,
)
from servogen.engines.sequence.rendering import NO_COMMENTS, _lines, _step
from servogen.engines.sequence.sequencing import _equal_calls, _split, sequence
from servogen.engines.sequence.tuning import TuningError, _times, edges_to_watch
from servogen.engines.sequence.waits import C2C_MAX, CALLS, RepeatedCall
from servogen.errors import InputError
from servogen.pic.device import device
from servogen.pulse.schedule import Channel, Pulse, PulseSchedule, Run
from servogen.units import Clock, Cycles

CLOCK = Clock(4_000_000)
NONE = Overheads()


def pulse(rise: int, width: int) -> Pulse:
    return Pulse(Cycles(rise), Cycles(width))


def schedule_of(
    lead_in: tuple[Run, ...], loop: tuple[Run, ...], pins: tuple[str, ...] = ("RB0", "RA1")
) -> PulseSchedule:
    channels = tuple(Channel(f"s{n}", pin, "x") for n, pin in enumerate(pins))
    return PulseSchedule(CLOCK, Cycles(20_000), channels, lead_in, loop)


A = (pulse(0, 1000), pulse(2500, 1500))
B = (pulse(0, 1200), None)
OFF = (None, None)


# the program


def test_every_delay_of_a_frame_is_the_way_to_the_next_edge() -> None:
    program = sequence(schedule_of((), (Run(2, A),)), NONE)
    (position,) = program.positions
    # RB0 is bit 0 of port B, RA1 is bit 1 of port A; a write keeps the other pins of its port.
    assert position.frame.edges == (
        Edge(Cycles(0), "B", 1, ((0, 1),), Cycles(1000)),
        Edge(Cycles(1000), "B", 0, ((0, 0),), Cycles(1500)),
        Edge(Cycles(2500), "A", 2, ((1, 1),), Cycles(1500)),
        Edge(Cycles(4000), "A", 0, ((1, 0),), Cycles(0)),
    )
    # 16 000 cycles to the same frame again: all but 64 before the function knows whether it is the last.
    assert (position.number, position.gap, position.again) == (1, 20_000 - 4000 - 64, 64)
    (step,) = program.loop
    assert step == Hold(0, position.frame, position, 2, 1, Cycles(0), Cycles(64))
    assert program.start == 20_000 and program.lead_in == ()


def test_a_frame_that_is_made_twice_is_a_function_and_one_that_is_made_once_is_not() -> None:
    for runs, shared in (
        ((Run(1, A), Run(1, B), Run(1, OFF)), []),
        ((Run(1, A), Run(1, B), Run(1, A)), [A]),
        ((Run(1, A), Run(2, B), Run(1, OFF)), [B]),
        ((Run(1, A), Run(1, B), Run(1, A), Run(3, B)), [A, B]),
    ):
        found = sequence(schedule_of((), runs), NONE)
        assert [position.frame.run.pulses for position in found.positions] == shared
        assert [position.number for position in found.positions] == [1, 2][: len(shared)]


def test_pins_of_a_port_that_are_high_stay_so() -> None:
    frame = (pulse(0, 3000), pulse(100, 500))
    edges = sequence(schedule_of((), (Run(1, frame),), ("RB0", "RB7")), NONE).loop[0].frame.edges  # type: ignore[union-attr]
    assert [(edge.cycle, edge.value) for edge in edges] == [(0, 1), (100, 0x81), (600, 1), (3000, 0)]
    together = (pulse(0, 500), pulse(0, 500))
    edges = sequence(schedule_of((), (Run(1, together),), ("RB0", "RB7")), NONE).loop[0].frame.edges  # type: ignore[union-attr]
    assert [(edge.value, edge.changes) for edge in edges] == [(0x81, ((0, 1), (1, 1))), (0, ((0, 0), (1, 0)))]


def test_overheads_are_subtracted_from_the_delay_of_their_path() -> None:
    cost = {
        START: 100,
        DelayPath("in", 1, 0): 3,
        DelayPath("in", 1, 2): 5,
        DelayPath("again", 1): 7,
        DelayPath("after", 1): 11,
        DelayPath("after", 0): 13,
    }
    schedule = schedule_of((Run(3, A),), (Run(1, B),))
    program = sequence(schedule, Overheads(cost))
    (position,) = program.positions
    assert program.start == 19_900
    assert [edge.wait for edge in position.frame.edges] == [997, 1500, 1495, 0]
    assert position.again == 64 - 7
    # From the last edge of A to the next frame 16 000 cycles; B's last edge is in cycle 1200.
    assert position.gap == 16_000 - 64
    lead, loop = program.lead_in[0], program.loop[0]
    assert isinstance(lead, Hold) and isinstance(loop, Hold)
    assert lead.after == 64 - 13
    assert loop.after == 20_000 - 1200 - 11 and loop.position is None
    # A step with a frame of its own is another owner than the position of the same number.
    paths = [path for path, _ in islice(program.walk(), 12 + 2 + 1)]
    position_paths = [*(DelayPath("in", 1, edge) for edge in range(3)), DelayPath("again", 1)]
    assert paths[:12] == [START, *position_paths, *position_paths, *position_paths[:3]]
    assert paths[12:] == [DelayPath("after", 0), DelayPath("in", -1, 0), DelayPath("after", 1)]
    # A path that was not measured costs nothing; the mapping of another one does not change it.
    overheads = Overheads(cost)
    cost[START] = 5
    assert overheads.of(START) == 100 and overheads.of(DelayPath("turn", 9)) == 0


def test_a_delay_without_time_is_refused_with_the_cycles_that_are_missing() -> None:
    schedule = schedule_of((), (Run(2, A),))
    for path, most, where in (
        (START, 20_000, "from reset to the first edge"),
        (DelayPath("in", 1, 1), 1500, "after cycle 1000 of a frame"),
        (DelayPath("again", 1), 64, "between frames"),
        (DelayPath("after", 0), 64, "between frames"),
    ):
        assert sequence(schedule, Overheads({path: most}))
        with pytest.raises(InputError) as error:
            sequence(schedule, Overheads({path: most + 2}))
        assert (error.value.code, error.value.message) == (
            "edges-too-close",
            f"two edges are too close {where}: the statements between them take 2 cycles too many",
        )
        assert error.value.hint == "lengthen the period, or give the servos slots that are further apart"
    # The frame's last edge may be 64 cycles before the next frame, and no nearer.
    for width, fits in ((20_000 - 64, True), (20_000 - 63, False)):
        near = schedule_of((), (Run(2, (pulse(0, width), None)),))
        if fits:
            assert sequence(near, NONE).positions[0].gap == 0
        else:
            with pytest.raises(InputError, match="between frames"):
                sequence(near, NONE)


def test_the_last_step_leads_to_the_loop_s_first_one_over_pauses() -> None:
    schedule = schedule_of((Run(1, A),), (Run(3, OFF), Run(1, B), Run(2, OFF)))
    program = sequence(schedule, NONE)
    lead, pause, step, last = (*program.lead_in, *program.loop)
    assert isinstance(lead, Hold) and isinstance(step, Hold)
    assert (pause, last) == (SilentStep(3, Cycles(60_000)), SilentStep(2, Cycles(40_000)))
    # To the next step's first edge without the pauses between; B's way leads to B again.
    assert (lead.after, step.after) == (16_000, 20_000 - 1200)
    edges = [(path.kind, asked) for path, asked in islice(program.walk(), 4 + 4)]
    # The pause of three frames is added to the way after the lead-in, both pauses to the way after B.
    assert edges == [
        ("start", 20_000), ("in", 1000), ("in", 1500), ("in", 1500),
        ("after", 76_000), ("in", 1200), ("after", 20_000 - 1200 + 100_000), ("in", 1200),
    ]  # fmt: skip


def test_a_program_whose_loop_has_no_pulse_ends() -> None:
    program = sequence(schedule_of((Run(2, B),), (Run(1, OFF),)), NONE)
    assert [asked for _, asked in program.walk()] == [20_000, 1200, 18_800, 1200]
    (step,) = program.lead_in
    assert isinstance(step, Hold) and step.after == 0, "no edge follows"


@pytest.mark.parametrize(
    ("frames", "calls"),
    [
        (256, (128, 2)),
        (257, (255, 1)),
        (510, (255, 2)),
        (508, (254, 2)),
        (101 * 7, (101, 7)),
        (101 * 101, (101, 101)),
        (100 * 3, (150, 2)),
        (97 * 89, (255, 33)),
        (255 * 255, (255, 255)),
        (255 * 256, (255, 255)),
        (255 * 300 + 1, (255, 255)),
    ],
)
def test_long_runs_are_equal_calls_of_more_than_a_hundred_frames(frames: int, calls: tuple[int, int]) -> None:
    assert _equal_calls(frames) == calls
    best = [
        (size, frames // size) for size in range(101, 256) if frames % size == 0 and frames // size <= 255
    ]
    assert calls == (best[-1] if best else (255, min(frames // 255, 255)))


def test_a_run_is_split_into_parts_that_a_byte_counts() -> None:
    def parts(frames: int, pulses: Any = A) -> list[tuple[int, int]]:
        return [(part.run.frames, part.turns) for part in _split((Run(frames, pulses),))]

    assert parts(1) == [(1, 1)] and parts(255) == [(255, 1)] and parts(256) == [(128, 2)]
    assert parts(257) == [(255, 1), (2, 1)]
    assert parts(255 * 256 + 7) == [(255, 255), (131, 2)]
    assert parts(100_000, OFF) == [(100_000, 1)], "a pause is one delay"


# measuring


def test_the_edges_to_watch_are_the_writes_and_one_of_the_next_turn() -> None:
    same = (pulse(0, 1000), pulse(0, 1000))
    touching = (pulse(0, 1000), pulse(1000, 500))
    for pulses, writes in ((A, 4), (same, 2), (touching, 3), (B, 2)):
        program: Any = SimpleNamespace(schedule=schedule_of((Run(3, pulses),), (Run(5, OFF),)))
        assert edges_to_watch(program) == 3 * writes
        program = SimpleNamespace(schedule=schedule_of((Run(3, pulses),), (Run(5, B),)))
        assert edges_to_watch(program) == 3 * writes + 5 * 2 + 1


def test_edges_in_one_cycle_are_one_write_also_across_chunks() -> None:
    def chunk(*cycles: int) -> Any:
        return edge_chunk(np.array(cycles), np.zeros(len(cycles)), np.ones(len(cycles)))

    chunks = [chunk(5, 5, 9), chunk(), chunk(9, 12), chunk(12), chunk(13, 20)]
    assert _times(chunks, 9) == [5, 9, 12, 13, 20]
    assert _times(chunks, 2) == [5, 9] and _times([], 3) == []
    endless = iter([chunk(1, 2, 3), chunk(4), chunk(5)])
    assert _times(endless, 3) == [1, 2, 3] and len(list(endless)) < 2


class Trace:
    """The times of a program's edges, given."""

    def __init__(self, times: list[int]) -> None:
        self.times = times

    def driven(self) -> list[Any]:
        count = len(self.times)
        return [edge_chunk(np.array(self.times), np.zeros(count), np.ones(count))]


def measured(monkeypatch: pytest.MonkeyPatch, times: list[int], program: Any) -> Overheads:
    monkeypatch.setattr(tuning, "Machine", lambda *_: SimpleNamespace(stream=lambda limit: []))
    monkeypatch.setattr(tuning, "EdgeTrace", lambda *_: Trace(times))
    compilation: Any = SimpleNamespace(image=None)
    return tuning.measure(program, compilation)


def test_what_a_program_takes_beyond_its_delays_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    program = sequence(schedule_of((), (Run(2, B),)), NONE)
    # Start 20 000 + 50, in the frame 1200 + 2, again 18 736 + 64 + 6, and after 18 736 + 64 + 9.
    times = list(np.cumsum([20_050, 1202, 18_806, 1202, 18_809]).tolist())
    found = measured(monkeypatch, times, program)
    assert found == Overheads(
        {START: 50, DelayPath("in", 1, 0): 2, DelayPath("again", 1): 6, DelayPath("after", 0): 9}
    )
    with pytest.raises(TuningError) as error:
        measured(monkeypatch, times[:4], program)
    assert error.value.message == "the program made 4 edges in 240000 cycles, not 5"
    times[3] += 1
    with pytest.raises(TuningError) as error:
        measured(monkeypatch, times, program)
    assert error.value.message == (
        f"at cycle {times[3]} the statements took 3 cycles, before that 2 ({DelayPath('in', 1, 0)})"
    )


@pytest.mark.parametrize(("settles", "rounds"), [(1, 2), (2, 3), (3, None)])
def test_delays_settle_within_three_rounds_or_are_refused(
    settles: int, rounds: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The overheads change in the first `settles` rounds."""
    seen: list[Overheads] = []

    def measure(program: Any, compilation: Any) -> Overheads:
        seen.append(Overheads({START: min(len(seen) + 1, settles)}))
        return seen[-1]

    monkeypatch.setattr(tuning, "measure", measure)
    monkeypatch.setattr(tuning, "render", lambda program, *_: f"start {program.start}")
    monkeypatch.setattr(tuning, "compiled_to_fit", lambda *_: "compiled")
    schedule = schedule_of((), (Run(2, B),))
    if rounds is None:
        with pytest.raises(TuningError) as error:
            tuning.tune(schedule, "xc8", device("PIC16F84"), "t")
        assert error.value.message == ("main.xc8.c: the cycles between the delays did not settle in 3 rounds")
        return
    made = tuning.tune(schedule, "xc8", device("PIC16F84"), "t")
    assert len(seen) == rounds and made.overheads == Overheads({START: settles})
    assert (made.file, made.dialect, made.text) == ("main.xc8.c", "xc8", f"start {20_000 - settles}")


# the C


def test_the_lines_of_a_frame_name_pins_levels_and_widths() -> None:
    schedule = schedule_of((), (Run(1, A),))
    program = sequence(schedule, NONE)
    step = program.loop[0]
    assert isinstance(step, Hold)
    lines = _lines(step.frame, schedule, "xc8")
    assert [(line.write, line.comment, line.calls) for line in lines] == [
        ("PORTB = 0x01;", "s0 high for 1000 us", "_delay(1000);"),
        ("PORTB = 0x00;", "s0 low", "_delay(1500);"),
        ("PORTA = 0x02;", "s1 high for 1500 us", "_delay(1500);"),
        ("PORTA = 0x00;", "s1 low", ""),
    ]
    assert NO_COMMENTS.frame(schedule, step.frame.run) == "s0 1000 us, s1 1500 us"
    touching = schedule_of((), (Run(1, (pulse(0, 1000), pulse(1000, 500))),), ("RB0", "RB1"))
    hold = sequence(touching, NONE).loop[0]
    assert isinstance(hold, Hold)
    assert [line.comment for line in _lines(hold.frame, touching, "xc8")][1] == "s0 low, s1 high for 500 us"


def test_a_step_is_a_call_a_frame_or_a_pause() -> None:
    schedule = schedule_of((), (Run(1000, A), Run(7, OFF), Run(1, B)))
    program = sequence(schedule, NONE)
    call, pause, own = (_step(step, schedule, "xc8", NO_COMMENTS) for step in program.loop)
    assert (call.call, call.turns, call.lines) == ("position_1(250);", 4, ())
    assert call.comment == "s0 1000 us, s1 1500 us, for 20 s"
    assert call.turn == "_delay(64);" and call.after == "_delay(64);"
    assert (pause.call, pause.lines, pause.comment) == ("", (), "0.14 s without pulses")
    assert pause.after == "_delay(140000);"
    assert (own.call, own.turns, len(own.lines), own.comment) == ("", 0, 2, "s0 1200 us")
    once = schedule_of((), (Run(2, A),))
    (single,) = (_step(step, once, "xc8", NO_COMMENTS) for step in sequence(once, NONE).loop)
    assert (single.call, single.turns, single.turn) == ("position_1(2);", 0, "")


# delays


def test_delays_at_the_limits_of_their_arguments() -> None:
    def text(dialect: str, cycles: int, clock: Clock = CLOCK) -> str:
        return " ".join(str(call) for call in CALLS[dialect](Cycles(cycles), clock))

    most = 50_463_240
    assert text("xc8", most) == f"_delay({most});" and text("xc8", most + 1) == f"_delay({most}); _delay(1);"
    assert text("xc8", 2 * most) == f"_delay({most}); _delay({most});"
    # `wait` of templates/sdcc.j2 takes 14, 18, 22 … cycles, up to 249 998; `wait_long` 200 005 or more.
    assert text("sdcc", 13) == " ".join(["nop();"] * 13) and text("sdcc", 14) == "wait(14);"
    assert text("sdcc", 17) == "wait(14); nop(); nop(); nop();" and text("sdcc", 18) == "wait(18);"
    assert text("sdcc", 250_000) == "wait(249998); nop(); nop();"
    assert text("sdcc", 250_001) == "wait_long(1); wait(49994); nop(); nop();"
    assert text("sdcc", 200_000 * 255 + 5 + 14) == "wait_long(255); wait(14);"
    assert text("sdcc", 200_000 * 256 + 5 + 14) == "wait_long(255); wait(200014);"
    assert text("c2c", 255) == "delay_10us(25); delay_us(5);" and text("c2c", 1) == "delay_us(1);"
    assert text("c2c", 255_000_000) == "delay_s(255);" and C2C_MAX == 255
    assert text("c2c", 256_000_000) == "delay_s(255); delay_s(1);"
    # At 1 MHz a cycle is 4 µs: steps of 1 µs are whole cycles in fours.
    slow = Clock(1_000_000)
    assert text("c2c", 1, slow) == "delay_us(4);" and text("c2c", 250, slow) == "delay_ms(1);"
    assert text("c2c", 5, slow) == "delay_10us(2);"


def test_equal_calls_are_one_statement_repeated() -> None:
    assert str(RepeatedCall("nop()", 3)) == "nop(); nop(); nop();" and str(RepeatedCall("x(1)")) == "x(1);"


# what all engines share


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Fraction(0), "0"),
        (Fraction(20), "20"),
        (Fraction(1, 2), "0.5"),
        (Fraction(1, 3), "0.333"),
        (Fraction(2, 3), "0.667"),
        (Fraction(1, 4000), "0"),
        (Fraction(100), "100"),
        (Fraction(-5, 4), "-1.25"),
    ],
)
def test_numbers_have_at_most_three_decimals(value: Fraction, text: str) -> None:
    assert decimal(value) == text


def test_only_the_pins_of_servos_are_outputs() -> None:
    schedule = schedule_of((), (Run(1, A),), ("RB7", "RA4"))
    assert list(ports_of(schedule)) == [PortText("A", "0x0F"), PortText("B", "0x7F")]
    only = schedule_of((), (Run(1, A),), ("RB0", "RB1"))
    assert list(ports_of(only)) == [PortText("B", "0xFC")]
    assert list(ports_of(schedule_of((), (Run(1, A),), ("RA0", "RA3")))) == [PortText("A", "0x16")]


def test_the_header_has_the_chip_its_clock_and_the_period() -> None:
    values = header_values("c2c", "a title", device("PIC16F84"), schedule_of((), (Run(1, A),)))
    ports = values.pop("ports")
    assert isinstance(ports, list) and len(ports) == 2
    assert values == {
        "dialect": "c2c",
        "title": "a title",
        "device": "PIC16F84",
        "clock_hz": 4_000_000,
        "clock_mhz": "4",
        "oscillator": "XT",
        "configuration": "0x3FF1",  # DS35007 register 6-1: XT, no watchdog, power-up timer, no protection
        "period_us": "20000",
    }


def test_assembly_is_code_and_comments() -> None:
    assert list(assembly("    nop   ; wait ; twice\nlabel:\n; alone\n\n")) == [
        AsmLine("    nop   ", "wait ; twice"),
        AsmLine("label:", ""),
        AsmLine("", "alone"),
        AsmLine("", ""),
    ]


def test_engines_read_what_a_job_has() -> None:
    buttons, commands, line = ControlButtons.kind, COMMANDS, Stream.kind
    assert suitable(()) == ("sequence", "player")
    assert suitable([buttons]) == ("player",) == suitable([commands]) == suitable([buttons, commands])
    assert suitable([line]) == ("stream",)
    assert suitable([line, buttons]) == () == suitable([line, commands]) == suitable(["a jumper"])
    assert [engine_named(name).title for name in ENGINES] == [
        "the sequence engine", "the player", "the stream engine", "the tape engine"
    ]  # fmt: skip
