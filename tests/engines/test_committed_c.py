"""The C and the schedule of the committed firmware, planned and rendered without being compiled.

tests/test_firmware.py builds the same jobs; this is what only the engines decide of them.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from servogen.engines.player.engine import play
from servogen.engines.player.rendering import render_player
from servogen.engines.stored_script import in_flash
from servogen.engines.stream.engine import stream
from servogen.engines.stream.rendering import render_stream
from servogen.job import load, plan_job
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
        text = render_player(played, stored, job.firmware.buttons, dialect, job.device, job.name)
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
