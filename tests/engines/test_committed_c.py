"""The C and the schedule of the committed firmware, planned and rendered without being compiled.

tests/test_firmware.py builds the same jobs; this is what only the engines decide of them.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.engines.parts import part_texts
from servogen.engines.player.engine import play
from servogen.engines.player.rendering import render_player
from servogen.engines.stored_script import in_flash
from servogen.engines.stream.engine import stream
from servogen.engines.stream.rendering import render_stream
from servogen.job import load, plan_job
from servogen.pic.image import read_hex
from servogen.pulse.schedule import from_json

ROOT = Path(__file__).parent.parent.parent
DIALECTS = ("c2c", "xc8")
"""Those whose C is committed."""
WALKS = [f"hexapod-{gait}" for gait in ("command", "ripple", "tripod", "turn", "wave")]


def committed(name: str, file: str) -> str:
    return (ROOT / "firmware" / name / file).read_text()


def planned_schedule(name: str) -> str:
    """The committed schedule without what only the build knows: the error at a foot or the tool."""
    kept = from_json(committed(name, "schedule.json"), name)
    assert kept.plan_error is not None
    return replace(kept, plan_error=replace(kept.plan_error, end=None, end_mm=None)).json_text()


@pytest.mark.parametrize("name", WALKS)
def test_a_player_s_c_is_the_committed_one(name: str) -> None:
    job = plan_job(load(ROOT / "jobs" / f"{name}.toml"))
    _, played, _ = play(job)
    stored = in_flash(played.encoded.script.data)
    for dialect in DIALECTS:
        text = render_player(
            played, stored, job.buttons, dialect, job.device, job.name, parts=part_texts(job)
        )
        assert text == committed(name, f"main.{dialect}.c")
    assert replace(played.plan.schedule, device=job.device.name).json_text() == planned_schedule(name)


@pytest.mark.parametrize("name", ["stream-arm", "stream-eight", "stream-fast"])
def test_a_stream_s_c_is_the_committed_one(name: str) -> None:
    job = plan_job(load(ROOT / "jobs" / f"{name}.toml"))
    streamed = stream(job)[1]
    for dialect in DIALECTS:
        text = render_stream(streamed, dialect, job.device, job.name)
        assert text == committed(name, f"main.{dialect}.c")
    assert replace(streamed.plan.schedule, device=job.device.name).json_text() == planned_schedule(name)


@pytest.mark.parametrize(("name", "word"), [("lab8-exercise", 0x3FF1), ("stream-fast", 0x3FF2)])
def test_the_c_for_c2c_states_the_configuration_word(name: str, word: int) -> None:
    """XT at 4 MHz, HS at 20 MHz, watchdog off, power-up timer on: DS35007 register 6-1; so has the HEX."""
    text = committed(name, "main.c2c.c")
    assert text.count(f"\nasm __config 0x{word:04X}\n") == 1
    assert read_hex(committed(name, "main.hex"), name).image.config == word
    changed = text.replace(f"__config 0x{word:04X}", f"__config 0x{word | 4:04X}")
    assert compile_sources([Source(changed, "main.c2c.c")], Options(dialect="c2c")).image.config == word | 4


@pytest.mark.parametrize("name", ["hexapod-tripod", "stream-arm"])
def test_each_assembly_of_the_c_for_xc8_selects_bank_0_first(name: str) -> None:
    """XC8 may have left bank 1 selected; a block of assembly begins where the line before it is none."""
    lines = committed(name, "main.xc8.c").splitlines()
    assembly = [line.lstrip().startswith(("asm(", "// ")) for line in lines]
    firsts = [
        line
        for line, now, before in zip(lines[1:], assembly[1:], assembly, strict=False)
        if now and not before
    ]
    assert firsts
    assert all(line.startswith('    asm("bcf STATUS, 5");') for line in firsts)


NAMES = sorted(path.parent.name for path in (ROOT / "firmware").glob("*/main.c2c.c"))


@pytest.mark.parametrize("name", NAMES)
def test_each_macro_is_used_and_hides_no_other_name(name: str) -> None:
    """A reader who searches for a name finds one thing."""
    for dialect in DIALECTS:
        code = re.sub(r"/\*.*?\*/|//[^\n]*", "", committed(name, f"main.{dialect}.c"), flags=re.DOTALL)
        macros = re.findall(r"^#define (\w+)", code, flags=re.MULTILINE)
        unused = {macro for macro in macros if len(re.findall(rf"\b{macro}\b", code)) < 2}
        assert unused <= {"_XTAL_FREQ"}  # the name from which XC8's delays take the clock
        declared = re.findall(r"unsigned (?:char|int) ([^;(){}]+)", code)
        names = {each.split("[")[0].strip() for group in declared for each in group.split(",")}
        assert not names & set(macros)


def test_a_walk_s_c_says_feet_angles_and_widths_of_the_same_part() -> None:
    """The lift's joint is at 150° where the foot is highest, in both programs' comments and in the job."""
    text = " ".join(committed("hexapod-tripod", "main.xc8.c").split(" */\n")[0].split())
    part = text.split("segment 1 (forward_mm = 40)")[1].replace(" *", "")
    job = plan_job(load(ROOT / "jobs" / "hexapod-tripod.toml"))
    for end in job.ends:
        feet = end.points(job.trajectory.angles)
        height = f"{1000 * feet[:, 2].min():.4g} to {1000 * feet[:, 2].max():.4g} mm"
        assert f"{end.name} " in part and height in part.split(f" {end.name} ")[1]
        turn = next(servo for servo in job.servos if servo.name == f"{end.name}-turn")
        angles = job.trajectory.angles[:, job.servos.index(turn)]
        widths = [round(turn.width_us(angle)) for angle in (angles.min(), angles.max())]
        assert f"deg: {widths[0]} to {widths[1]} us" in part.split(f"{end.name}-turn ")[1][:60]
