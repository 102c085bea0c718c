"""A walk on command: every frame is the one that a state machine of its own and the planned angles give."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from servogen.checker.plan import Line, read_plan
from servogen.engines.board import board_of
from servogen.engines.firmware import DIALECTS, ResourceError
from servogen.engines.player import shares
from servogen.engines.player.encoding import Encoded
from servogen.engines.player.engine import play
from servogen.errors import InputError
from servogen.job import loads, plan_job
from servogen.motion.trajectory import Part
from servogen.pic.image import Image
from servogen.prove import prove_for_all
from servogen.pulse.schedule import from_json
from servogen.workflows.engines import planned
from tests.engines.player.command_walks import (
    JOB,
    ROOT,
    Walker,
    image,
    problems,
    random_line,
    target,
    target_of,
)

TEXT = (ROOT / "jobs" / f"{JOB}.toml").read_text()
COMMANDS = 'commands = { forward_mm = 40, turn_deg = 20, pin = "RA4" }'
RETLW, MOVLW = 0x3400, 0x3000
COLUMNS = 6


def commanded(*codes: str, rest: int = 150) -> list[int]:
    return [int(level) for code in codes for level in code + "1" * rest]


def changed(address: int, word: int) -> Image:
    program = image()
    return replace(program, program={**program.program, address: word})


def rows_begin() -> tuple[int, int]:
    """Return the address of the table of rows, and its bytes, by the bytes of the C."""
    text = (ROOT / "firmware" / JOB / "main.c2c.c").read_text()
    table = re.search(r"ROW\[\] = \{(.*?)\n\}", text, re.DOTALL)[1]
    rows = [int(byte) for byte in re.findall(r"\d+", re.sub(r"/\*.*?\*/", "", table))]
    words = image().program
    wanted = [RETLW | byte for byte in rows]
    (begin,) = [at for at in words if [words.get(at + n) for n in range(len(rows))] == wanted]
    return begin, len(rows)


def test_random_levels_walk_as_the_reference_says() -> None:
    assert list(problems(image(), random_line(np.random.default_rng(5), 3000))) == []


def test_the_random_line_has_every_direction_from_every_other() -> None:
    walker, seen = Walker(target()), []
    for level in random_line(np.random.default_rng(1), 60_000):
        seen.append(walker.next()[0] or "stance")
        walker.hear(level)
    changes = {(one, other) for one, other in pairwise(seen) if one != other}
    directions = ("forward", "back", "left", "right")
    assert changes >= {(one, other) for one in directions for other in directions if one != other}
    assert changes >= {(one, "stance") for one in directions} | {("stance", one) for one in directions}


def test_each_pair_of_directions_begins_where_its_frames_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """The steps of the script are those of the lead-in and of the forward directions, one after the other."""
    taken: list[tuple[int, list[Part]]] = []
    right = shares.part_shares

    def noted(encoded: Encoded, parts: list[Part], frames: int, loop: int) -> object:
        # The first step only tells where the second begins.
        taken.append((sum(step.timing.frames for step in encoded.steps[1:]), parts))
        return right(encoded, parts, frames, loop)

    monkeypatch.setattr(shares, "part_shares", noted)
    shares.shares(target().job)
    ((end, parts),) = taken
    assert [part.name for part in parts[-2:]] == ["forward and back", "left and right"]
    ahead, turn = (len(target().directions[name]) for name in ("forward", "left"))
    assert [end - part.begin for part in parts[-2:]] == [ahead + turn, turn]


def test_a_wrong_byte_of_a_pose_is_seen_and_refuted() -> None:
    """The first two rows are the lifts', then follow the neutral lifts and the neutral turns."""
    address = rows_begin()[0] + 3 * COLUMNS
    wrong = changed(address, image().program[address] ^ 1)
    assert "L1-turn" in next(problems(wrong, commanded("1" * 110)))
    proof = prove_for_all(wrong, target().schedule)
    assert not proof.proven
    assert proof.counterexample is not None


def test_a_wrong_byte_of_a_direction_is_seen_only_when_it_is_walked() -> None:
    """The last row is of the turn's stop."""
    begin, count = rows_begin()
    wrong = changed(begin + count - 1, image().program[begin + count - 1] ^ 4)
    assert list(problems(wrong, commanded("1" * 110, "001010", "00000"))) == []
    assert list(problems(wrong, commanded("1" * 110, "011000", "00000"))) != []


def test_one_cycle_too_many_is_seen_and_refuted() -> None:
    """The kernel subtracts its own 32 cycles from a width: with 31 the pulses are a cycle too long."""
    words = image().program
    moves = [at for at, word in words.items() if word == MOVLW | 32 and words.get(at + 1, 0) >> 8 == 0x02]
    wrong = changed(moves[0], MOVLW | 31)
    assert "not Pulse" in next(problems(wrong, [1] * 5))
    assert not prove_for_all(wrong, target().schedule).proven


def test_the_chip_begins_a_direction_in_the_stance_and_ends_it_there() -> None:
    of = target()
    schedule = of.schedule
    assert [direction.name for direction in schedule.commands.directions] == [
        "forward",
        "back",
        "left",
        "right",
    ]
    stance = [pulse.width for pulse in schedule.loop[0].pulses]
    for direction in schedule.commands.directions:
        assert [pulse.width for pulse in direction.start[0].pulses] == stance, direction.name
        last = [pulse.width for pulse in direction.stop[-1].pulses]
        assert 0 < max(abs(one - other) for one, other in zip(last, stance, strict=True)) < 20, direction.name


def test_the_schedule_with_commands_is_read_back() -> None:
    text = target().schedule.json_text()
    assert from_json(text, "schedule.json") == target().schedule
    plan = read_plan(text.encode(), "schedule.json")
    assert isinstance(plan.inputs, Line)
    assert plan.inputs.codes == ["01010", "00110", "11000", "11011"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"rest_frames": 3', '"rest_frames": 0', "commands.rest_frames: is not a whole number"),
        ('"pin": "RA4", "rest', '"pin": "RB0", "rest', "commands.pin: RB0 is a servo's"),
        ('"code": "00110"', '"code": "0x110"', "commands.directions[1].code: is not a string of 0 and 1"),
        ('"code": "00110"', '"code": "01010"', "two directions have the same code"),
        ('"name": "back", ', "", "commands.directions[1]: 'name' is missing"),
    ],
)
def test_a_schedule_with_wrong_commands_is_refused(old: str, new: str, message: str) -> None:
    text = target().schedule.json_text()
    assert old in text
    with pytest.raises(InputError) as refused:
        from_json(text.replace(old, new), "schedule.json")
    assert message.split(": ")[-1] in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (COMMANDS, "commands = {}", "the walk has no direction"),
        (COMMANDS, COMMANDS.replace("RA4", "RB0"), "RB0 is in use: L1-turn"),
        (COMMANDS, COMMANDS.replace("RA4", "RC0"), "unknown pin 'RC0'"),
        (COMMANDS, COMMANDS.replace("= 40", "= -40"), "forward_mm"),
        (COMMANDS, f"{COMMANDS}\nroute = [{{ forward_mm = 40 }}]", "a walk on command has no route"),
        (COMMANDS, "", "a walk needs a route"),
        ('engine = "player"', 'engine = "player"\nstop_pin = "RA4"', "has no start_pin and no stop_pin"),
        ('engine = "player"', 'engine = "sequence"', "the sequence engine does not read commands"),
    ],
)
def test_a_job_with_wrong_commands_is_refused(old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(InputError) as refused:
        plan_job(loads(TEXT.replace(old, new), "job.toml"))
    assert message in str(refused.value)
    assert "job.toml:" in str(refused.value)


def test_a_soft_start_of_more_than_256_frames_before_a_walk_on_command_is_refused() -> None:
    """256 frames of 20 ms are 5.12 s."""
    text = TEXT.replace("[firmware]", "[firmware]\nsoft_start_s = 5.14")
    line = text[: text.index("soft_start_s")].count("\n") + 1
    with pytest.raises(InputError) as refused:
        planned(plan_job(loads(text, "job.toml")))
    assert str(refused.value) == (
        f"job.toml:{line}:1: error: firmware.soft_start_s: a soft start of 5.14 s is 257 frames "
        "[out-of-range]\n  before a walk on command it has at most 256 frames, 5.12 s"
    )


def test_a_swing_of_too_many_frames_on_command_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The feet of a tripod are in the air for half a cycle: for 24 frames of 20 ms."""
    job = plan_job(loads(TEXT.replace("[firmware]", "[firmware]\nsoft_start_s = 0.2"), "job.toml"))

    def longest(half: int) -> None:
        for module in ("legs", "commanded"):
            monkeypatch.setattr(f"servogen.engines.player.{module}.LONGEST", half)

    longest(12)
    play(job)
    longest(11)
    with pytest.raises(InputError) as refused:
        play(job)
    assert (refused.value.code, refused.value.message, refused.value.hint) == (
        "engine-unsupported",
        "the player walks on command only if legs that are in the air together lift and land together, "
        "within 22 frames",
        'write gait = "tripod", or a shorter cycle_s',
    )


@pytest.mark.parametrize(
    ("name", "limit", "holds"), [("MAX_BYTES", 55, "55 and 4"), ("LEGS_TIMINGS", 2, "256 and 3")]
)
def test_a_walk_that_exceeds_a_table_is_refused(
    name: str, limit: int, holds: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its 28 steps have two bytes each and four timings."""
    monkeypatch.setattr(f"servogen.engines.player.commanded.{name}", limit + 1)
    job = plan_job(loads(TEXT, "job.toml"))
    planned(job)
    monkeypatch.setattr(f"servogen.engines.player.commanded.{name}", limit)
    with pytest.raises(ResourceError) as refused:
        planned(job)
    assert refused.value.message == (
        f"the walk on command has 56 bytes of steps with 4 timings: the player holds {holds}"
    )


def test_a_walk_forward_and_back_alone_has_two_directions() -> None:
    """Another gait, too: six swings, one after the other, of even numbers of frames."""
    text = TEXT.replace(COMMANDS, "commands = { forward_mm = 40 }").replace('"tripod"', '"ripple"')
    found = planned(plan_job(loads(text, "job.toml")))
    commands = found.plan.schedule.commands
    assert commands is not None
    assert [direction.name for direction in commands.directions] == ["forward", "back"]
    assert found.plan.schedule.plan_error is not None
    assert found.plan.schedule.plan_error.width_us <= 5


@pytest.mark.campaign
def test_ripple_with_four_directions_fits_and_walks_as_the_reference_says() -> None:
    """Twelve servos and four directions in at most 1000 words and 68 bytes, in every dialect."""
    job = plan_job(loads(TEXT.replace('"tripod"', '"ripple"'), "job.toml"))
    found = planned(job)
    made = [found.make(dialect).compilation for dialect in DIALECTS]
    assert max(each.words for each in made) <= 1000
    assert max(each.ram_bytes for each in made) <= 68
    line = [*commanded("1" * 110, "001010", "011011"), *random_line(np.random.default_rng(7), 1500)]
    assert list(problems(made[0].image, line, of=target_of(job, found.plan.schedule))) == []


@pytest.mark.campaign
def test_pins_in_any_order_and_servos_with_distant_widths_need_tables_and_walk_the_same() -> None:
    """Pins that do not follow each other, and base widths with different high bytes, are read from tables."""
    text = TEXT.replace('pin = "RA4"', 'pin = "RA1"').replace('pin = "RA1"\nmodel', 'pin = "RA4"\nmodel')
    text = text.replace('pin = "RB1"', 'pin = "RB5" ').replace('pin = "RB5"\n', 'pin = "RB1"\n')
    text = text.replace('name = "R2-lift"', 'name = "R2-lift"\ntrim_us = 300\nopen_drain = true')
    job = plan_job(loads(text, "job.toml"))
    found = planned(job)
    made = found.make("c2c")
    assert all(f"#define {name} " in made.text for name in ("SLOT_B", "SLOT_OTHER", "BASE_HIGH"))
    line = commanded("1" * 110, "001010", "011011")
    of = target_of(job, found.plan.schedule)
    assert list(problems(made.compilation.image, line, board_of(of.schedule), of)) == []
