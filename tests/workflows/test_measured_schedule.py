"""Schedules from measured edges: what a program without a job is proven against."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from servogen.edges import EdgeTrace, edge_chunk
from servogen.errors import InputError
from servogen.pic.image import to_hex
from servogen.programs import read_program, read_schedule
from servogen.prove import prove_for_all
from servogen.pulse import from_json
from servogen.pulse.schedule import Pulse
from servogen.simulator import SimulatorOptions
from servogen.units import Clock, Cycles
from servogen.workflows.measured_schedule import measured_schedule
from servogen.workflows.signals import unscheduled_edges
from tests.prove.attack import servogen
from tests.prove.replay import is_wrong

ROOT = Path(__file__).parent.parent.parent
STARTS = ROOT / "tests" / "verify" / "start_state"
FIRMWARE = ROOT / "firmware"
CLOCK = Clock(4_000_000)


def edges(*pulses: tuple[int, int, int], end: int) -> EdgeTrace:
    """Return the edges of pulses (pin, rise, width)."""
    rows = sorted(
        (at, pin, level) for pin, rise, width in pulses for at, level in ((rise, 1), (rise + width, 0))
    )
    return EdgeTrace(CLOCK, (edge_chunk(*map(list, zip(*rows, strict=True))),), Cycles(end))


def test_it_is_the_schedule_from_which_the_firmware_was_generated() -> None:
    """Two sweeps of a motion that repeats every 3 s."""
    folder = FIRMWARE / "lab9-program"
    plan = read_schedule(folder / "schedule.json")
    file = folder / "main.hex"
    trace = unscheduled_edges(file, read_program(file), None, None, SimulatorOptions())
    found = measured_schedule(trace, "main.hex", {})
    assert (found.clock, found.period) == (plan.clock, plan.period)
    assert [channel.pin for channel in found.channels] == [channel.pin for channel in plan.channels]
    flat = [[run.pulses for run in part for _ in range(run.frames)] for part in (plan.lead_in, plan.loop)]
    planned = [*flat[0], *(flat[1] * 1000)]
    measured = [run.pulses for run in (*found.lead_in, *found.loop) for _ in range(run.frames)]
    shift = next(pulse.rise for pulse in planned[0] if pulse is not None)
    assert shift == 0
    assert measured == planned[: len(measured)]
    assert found.loop_frames == plan.loop_frames


def test_a_program_is_proven_against_it_and_another_one_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    servogen("measure", STARTS / "good.asm", "--schedule", "measured.json", "--servo", "RB0=futaba-s3001")
    schedule = from_json(Path("measured.json").read_text(), "measured.json")
    assert schedule.channels[0].servo == "futaba-s3001"
    image = read_program(STARTS / "good.asm").image
    assert prove_for_all(image, schedule).proven
    longer = next(a for a, word in image.program.items() if word & 0x3F00 == 0x3000 and word & 0xFF > 20)
    other = replace(image, program={**image.program, longer: image.program[longer] - 1})
    Path("other.hex").write_text(to_hex(other))
    shown = prove_for_all(other, schedule).counterexample
    assert shown is not None
    assert is_wrong(other, schedule, shown)


def test_recorded_edges_give_the_same_schedule(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    servogen("simulate", STARTS / "good.asm", "--seconds", "0.5", "--edges", "capture.csv")
    assert "--against capture.json" in servogen("measure", "capture.csv", "--schedule", "capture.json")
    servogen("measure", STARTS / "good.asm", "--seconds", "0.5", "--schedule", "program.json")
    assert Path("capture.json").read_text() == Path("program.json").read_text()


def test_pauses_are_frames_without_pulses_and_what_repeats_is_the_loop() -> None:
    """Frames of 100 cycles: widths 10, 20, then 30, none, 30, none …"""
    pulses = [(5, 7, 10), (5, 107, 20), *((5, 207 + 200 * n, 30) for n in range(4))]
    found = measured_schedule(edges(*pulses, end=1100), "edges", {})
    assert found.period == 100
    widths = [
        [pulse.width if pulse else None for run in part for pulse in run.pulses * run.frames]
        for part in (found.lead_in, found.loop)
    ]
    assert widths == [[10, 20], [30, None]]


def test_a_pulse_ends_before_the_next_frame_and_what_is_cut_off_is_left_out() -> None:
    """Frames of 100 cycles from 7 on: RB1 is high from 30 to 69 cycles later; the last frame is not whole."""
    pulses = [(5, 7 + 100 * n, 10) for n in range(4)]
    others = [(6, 37 + 100 * n, 69) for n in range(4)]
    found = measured_schedule(edges(*pulses, *others, end=350), "edges", {})
    (loop,) = found.loop
    assert (found.lead_in, loop.frames, found.period) == ((), 1, 100)
    assert [(pulse.rise, pulse.width) for pulse in loop.pulses if pulse] == [(0, 10), (30, 69)]
    assert [channel.servo for channel in found.channels] == ["unknown", "unknown"]
    named = measured_schedule(edges(*pulses, end=407), "edges", {"RB0": "futaba-s3001"}, "PIC16F84A")
    assert (named.channels[0].servo, named.device) == ("futaba-s3001", "PIC16F84A")
    assert [(run.frames, run.pulses[0]) for run in named.loop] == [(1, Pulse(Cycles(0), Cycles(10)))]
    with pytest.raises(InputError, match="RB1 has a pulse at cycle 37 that is not the only one in a frame"):
        measured_schedule(edges(*pulses, (6, 37, 70), end=407), "edges", {})


def test_a_level_that_is_driven_again_is_no_new_pulse_and_an_undriven_pin_is_low() -> None:
    rows = [
        (7 + 100 * n + at, 5, level) for n in range(4) for at, level in ((0, 1), (3, 1), (10, 2), (20, 0))
    ]
    trace = EdgeTrace(CLOCK, (edge_chunk(*zip(*rows, strict=True)),), Cycles(420))
    found = measured_schedule(trace, "edges", {})
    assert [run.pulses[0] for run in found.loop] == [Pulse(Cycles(0), Cycles(10))]
    with pytest.raises(InputError, match="no pin has a pulse"):
        measured_schedule(EdgeTrace(CLOCK, (edge_chunk([3], [5], [0]),), Cycles(420)), "edges", {})


def test_more_frames_than_a_schedule_has_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("servogen.workflows.measured_schedule.MAX_FRAMES", 4)
    pulses = [(5, 7 + 100 * n, 10) for n in range(5)]
    assert measured_schedule(edges(*pulses, end=506), "edges", {}).period == 100
    with pytest.raises(InputError, match="5 frames are too many") as error:
        measured_schedule(edges(*pulses, end=507), "edges", {})
    assert error.value.hint == "--seconds: at most 0.0004", "four frames of 100 cycles"


@pytest.mark.parametrize(
    ("pulses", "message"),
    [
        ([(5, 0, 10), (5, 100, 10), (5, 200, 10), (5, 301, 10)], "RB0 rises 101 cycles after cycle 1200"),
        ([(5, 0, 10), (5, 100, 10), (5, 200, 10), (6, 30, 80)], "RB1 has a pulse at cycle 1030"),
        ([(5, 0, 10), (6, 20, 3), (6, 30, 3), (5, 100, 10), (5, 200, 10)], "RB1 has a pulse at cycle 1030"),
        ([(5, 100 * n, 10 + n) for n in range(5)], "nothing repeats in 5 frames"),
        ([(5, 0, 10)], "one pulse only"),
    ],
)
def test_what_has_no_schedule_is_refused_with_the_reason(
    pulses: list[tuple[int, int, int]], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        later = [(pin, 1000 + rise, width) for pin, rise, width in pulses]
        measured_schedule(edges(*later, end=later[-1][1] + 100), "edges", {})


def test_a_lab_program_whose_frames_differ_has_no_schedule() -> None:
    """The printed servo.c: a step of its motion takes longer than a frame (docs/labs)."""
    file = ROOT / "tests/labs/servo.c"
    with pytest.raises(InputError, match="the frames are not of one length"):
        measured_schedule(
            unscheduled_edges(file, read_program(file), 8.0, None, SimulatorOptions()), "servo.c", {}
        )
