"""The tape engine: what is on a tape, that every edge is the plan's, and what a wrong tape leads to."""

from __future__ import annotations

import json
import random
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from servogen.bench.virtual.rig import RigOptions, rig
from servogen.edges import PINS, EdgeTrace
from servogen.engines.board import board_of, machine_of
from servogen.engines.tape.content import FIRST, content, tape_hex
from servogen.errors import InputError
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.simulator import EEPROM24, LevelChange, SimulatorOptions, on_pins
from servogen.traces.captures import read_capture
from servogen.units import Clock, Cycles
from servogen.workflows.capture import capture
from servogen.workflows.verification import judge_capture
from tests.bench.conftest import served
from tests.engines.tape.tape_jobs import (
    frames_of,
    job,
    judged,
    made,
    running,
    tape_of,
    text,
    widths_of,
    with_content,
    without_eeprom,
)
from tests.simulator.i2c import sigrok_words

ERROR_PIN = 'on_error = "{}"\nerror_pin = "RA0"'


def pulse_count(image: Image, schedule: PulseSchedule, frames: int) -> int:
    """The number of rises of RB0 in so many frames."""
    machine = running(image, schedule, 0)
    edges = machine.run(frames * schedule.period)
    return int(((edges.pin == PINS.index("RB0")) & (edges.level == 1)).sum())


def with_byte(data: bytes, at: int, flipped: int) -> bytes:
    return data[:at] + bytes([data[at] ^ flipped]) + data[at + 1 :]


# The format


def random_schedule(rng: random.Random, servos: int) -> PulseSchedule:
    """Frames that hold, step a little, jump, and rest."""
    channels = tuple(Channel(f"s{n}", PINS[n], "any") for n in range(servos))
    widths = [rng.randrange(500, 2500) for _ in range(servos)]
    parts = []
    for _ in range(2):
        runs = []
        for _ in range(rng.randrange(1, 30)):
            reach = rng.choice((0, 1, 127, 128, 129, 900))
            widths = [min(2500, max(500, width + rng.randint(-reach, reach))) for width in widths]
            rest = rng.random() < 0.15 and runs
            pulses = [None if rest else Pulse(Cycles(0), Cycles(width)) for width in widths]
            runs.append(Run(rng.choice((1, 1, 1, 63, 64, 65, 200)), tuple(pulses)))
        parts.append(tuple(runs))
    return PulseSchedule(Clock(4_000_000), Cycles(20_000), channels, *parts)


@pytest.mark.parametrize("seed", range(20))
def test_the_records_are_the_frames(seed: int) -> None:
    rng = random.Random(seed)
    servos = rng.randrange(1, 12)
    schedule = random_schedule(rng, servos)
    order = tuple(rng.sample(range(servos), servos))
    tape = content(schedule, order)
    assert list(frames_of(tape.data, servos)) == widths_of(schedule, order)
    # The loop's first record stands for itself: a jump to it needs no frame before.
    assert tape.data[tape.places[0]] & 0xC0 in (0x40, 0x80)
    before = list(frames_of(tape.data[: tape.places[0]] + b"\xc0", servos))
    assert len(before) == schedule.lead_in_frames


def test_any_other_byte_in_a_record_is_another_sum() -> None:
    tape = tape_of().content
    rng = random.Random(3)
    for _ in range(300):
        at = rng.randrange(FIRST, len(tape.data) - 2)
        wrong = with_byte(tape.data, at, rng.randrange(1, 256))
        with pytest.raises((AssertionError, IndexError)):
            assert list(frames_of(wrong, 3)) == list(frames_of(tape.data, 3))


def test_another_tape_has_another_identity() -> None:
    one, other = tape_of().content, tape_of(tape='eeprom = "24LC64"', hz=10_000_000).content
    assert one.identity != other.identity and one.identity == tuple(one.data[:2])


def test_the_hex_file_holds_the_same_bytes_from_address_0_on() -> None:
    data = tape_of().content.data
    found = {}
    for line in tape_hex(data).split():
        record = bytes.fromhex(line[1:])
        assert sum(record) % 256 == 0
        if record[3] == 0:
            address = record[1] << 8 | record[2]
            found |= {address + n: byte for n, byte in enumerate(record[4:-1])}
    assert bytes(found[n] for n in range(len(found))) == data


# The pulses


@pytest.mark.parametrize(
    ("dialect", "values"),
    [
        ("c2c", {}),
        ("xc8", {"hz": 20_000_000}),
        ("sdcc", {"hz": 10_000_000, "tape": ERROR_PIN.format("hold"), "foot": "RB2"}),
    ],
)
def test_every_edge_is_the_plans_and_the_bus_keeps_the_data_sheet(
    dialect: str, values: dict[str, object]
) -> None:
    played, image = made(dialect, **values)
    verdict = judged(image, played.plan.schedule)
    assert verdict.passed and not verdict.warnings, verdict.reasons
    assert verdict.worst_edge_error == 0
    error = played.plan.schedule.plan_error
    assert (
        error is not None and error.width_us <= float(played.job.clock.cycle_us) / 2 + 1e-3
    )  # rounding alone


@pytest.mark.parametrize("at", ["kind", "width", "sum", "identity", "end", "last sum"])
@pytest.mark.parametrize("on_error", ["release", "hold"])
def test_a_changed_byte_ends_in_the_stated_state_and_is_told(at: str, on_error: str) -> None:
    played, image = made(tape=ERROR_PIN.format(on_error), foot="RB2")
    schedule, data = played.plan.schedule, tape_of(tape=ERROR_PIN.format(on_error), foot="RB2").content.data
    place = {"kind": 2, "width": 4, "sum": 9, "identity": 1, "end": -2, "last sum": -1}[at] % len(data)
    wrong = with_content(schedule, with_byte(data, place, 0x01))
    assert not judged(image, wrong).passed
    machine = running(image, wrong, 120 * schedule.period)
    assert machine.pins & 1  # RA0
    edges = machine.run(20 * schedule.period)
    pulses = int(((edges.pin == PINS.index("RB0")) & (edges.level == 1)).sum())
    begun = at in ("end", "last sum")
    assert pulses == (20 if on_error == "hold" and begun else 0)


def test_without_an_eeprom_and_with_an_erased_one_there_are_no_pulses() -> None:
    played, image = made()
    schedule = played.plan.schedule
    assert pulse_count(image, schedule, 20) > 10
    for absent in (without_eeprom(schedule), with_content(schedule, b"")):  # SDA stays low; all is FFh
        assert pulse_count(image, absent, 20) == 0
    other = on_pins(EEPROM24(tape_of().content.data, address=1), scl="RA3", sda="RA4")
    machine = machine_of(without_eeprom(schedule), image, SimulatorOptions(devices=(other,)))
    edges = machine.run(20 * schedule.period)
    assert not ((edges.pin == PINS.index("RB0")) & (edges.level == 1)).any()


def test_an_eeprom_that_is_pulled_out_while_it_plays_releases_the_pulses() -> None:
    """The tape's rest reads as FFh, as SDA is high."""
    played, image = made()
    schedule, data = played.plan.schedule, tape_of().content.data
    whole = pulse_count(image, schedule, 60)
    half = with_content(schedule, data[:100])
    seen = pulse_count(image, half, 60)
    assert 0 < seen < whole


@pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")
def test_sigrok_reads_the_tape_from_the_wires(tmp_path: Path) -> None:
    """From the recording of a run: all of it, and over the end back to the loop."""
    played, image = made()
    schedule, tape = played.plan.schedule, tape_of().content
    span = Cycles(100 * schedule.period)
    edges = EdgeTrace(schedule.clock, (machine_of(schedule, image).run(span),), span)
    words = sigrok_words(edges, tmp_path, "RA3", "RA4")
    assert [word for word in words if word.startswith("Data write")] == [
        *("Data write: 00", "Data write: 00"),
        *(f"Data write: {byte:02X}" for _ in range(2) for byte in tape.places[0].to_bytes(2, "big")),
    ]
    read = bytes(int(word.split(": ")[1], 16) for word in words if word.startswith("Data read"))
    looped = tape.data + tape.data[tape.places[0] :] * 2
    assert len(read) > len(tape.data) + 40
    assert read == looped[: len(read)]


def test_a_reset_in_the_midst_of_a_byte_begins_again() -> None:
    """The EEPROM is still giving a byte: it lets go of SDA within nine clocks."""
    played, image = made()
    schedule = played.plan.schedule
    for late in range(0, 1200, 97):
        machine = running(image, schedule, 10 * schedule.period + 5000 + late)
        now = machine.cycles
        machine.apply([LevelChange(now, 13, 0), LevelChange(now + 50, 13, 1)])
        machine.run(3 * schedule.period)
        edges = machine.run(10 * schedule.period)
        assert int(((edges.pin == PINS.index("RB0")) & (edges.level == 1)).sum()) == 10


def test_a_rig_is_captured_for_the_asked_time(tmp_path: Path) -> None:
    """The bus takes more of the analyser's memory than the pulses: it is counted."""
    played, image = made()
    schedule = played.plan.schedule
    with rig(image, schedule.clock, board_of(schedule), RigOptions()) as opened, served(opened):
        seen = capture(tmp_path / "run.vcd", opened.paths["analyser"], schedule, 0.1).seen
    assert seen.missing is None
    verdict = judge_capture(schedule, read_capture(tmp_path / "run.vcd"))
    assert verdict.first_mismatch is None and verdict.frames >= 5


# What is refused, and what is said


def test_check_says_how_long_the_tape_is() -> None:
    played, _ = made()
    (note,) = [note for note in played.job.notes if note.code == "tape-length"]
    data = tape_of().content.data
    schedule = played.plan.schedule
    seconds = (schedule.lead_in_frames + schedule.loop_frames) * 0.02
    assert f"{seconds:.1f} s of motion take {len(data)} bytes of the 24LC256's 32768" in note.message
    assert f"{1024 * seconds / len(data):.2f} s per kilobyte" in note.message


def test_a_motion_that_the_eeprom_does_not_hold_is_refused_with_the_seconds_that_fit() -> None:
    jumps = tuple(
        f"{{ arm_deg = {30 + 20 * (n % 2)}, hand_deg = 30, foot_deg = 30, move_s = 10 }}" for n in range(30)
    )
    with pytest.raises(InputError, match=r"bytes, and a 24LC64 holds 8192, .* s of such motion"):
        made(tape='eeprom = "24LC64"', poses=jumps)


@pytest.mark.parametrize(
    ("tape", "foot", "said"),
    [
        ('scl_pin = "RA0"', "RA0", "RA0 is in use: foot"),
        ('error_pin = "RA1"', "RA0", "RA1 is on the port of foot"),
        ('error_pin = "RA3"', "RB2", "RA3 is in use: SCL"),
    ],
)
def test_pins_that_cannot_be(tape: str, foot: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        job(tape=tape, foot=foot)


def test_the_schedules_file_names_the_pins_and_the_part_and_reads_back() -> None:
    from servogen.pulse import from_json

    schedule = made()[0].plan.schedule
    assert json.loads(schedule.json_text())["tape"] == {"scl": "RA3", "sda": "RA4", "eeprom": "24LC256"}
    read = from_json(schedule.json_text(), "schedule.json")
    assert read == with_content(schedule, b"")
    assert '"tape"' not in replace(schedule, tape=None).json_text()
    assert "[tape]" in text()
