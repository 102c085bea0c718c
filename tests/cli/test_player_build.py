"""`servogen build` of a player: what is left of words, RAM and time, for people and for machines."""

import json
from pathlib import Path

import pytest

from servogen.cli.show import show_error
from servogen.engines.firmware import DIALECTS
from servogen.errors import InputError
from tests.cli.conftest import Run
from tests.engines.player.player_jobs import built_text, job_text, sweep

SMALL = job_text(5, sweep(5, 0.64), firmware='soft_start_s = 0.16\nstart_pin = "RA4"')


@pytest.mark.campaign
def test_build_says_what_is_left_and_that_the_c_never_came_too_late(run: Run, tmp_path: Path) -> None:
    job = tmp_path / "small.toml"
    job.write_text(SMALL)
    found = run("build", str(job), "-o", str(tmp_path / "out"), "--json")
    assert found.code == 0
    answer = json.loads(found.out)
    for told, program in zip(answer["programs"], built_text(SMALL, *DIALECTS).programs, strict=True):
        made = program.firmware.compilation
        assert told["words"] + told["words_left"] == 1024 and told["words"] == made.words
        assert told["ram_bytes"] + told["ram_left"] == 68
        assert told["overrun_cycle"] is None and told["exact"]
        assert [room["between"] for room in told["c_between_pulses"]] == ["two slots", "two frames"]
        for room in told["c_between_pulses"]:
            assert room["worst_cycles"] + room["left_cycles"] == room["room_cycles"]
    assert {row["pulse"] for row in answer["widths"]} == {"first", "shortest", "longest", "worst"}
    shown = run("build", str(job), "-o", str(tmp_path / "out")).out
    assert shown.count("overrun: never") == len(answer["programs"])
    text = (tmp_path / "out" / "report.txt").read_text()
    assert "with RA4 low from power-up on" in text and "button to ground, 10 kOhm pull-up" in text


def test_a_refusal_has_its_advice_in_the_json_too(capsys: pytest.CaptureFixture[str]) -> None:
    error = InputError("frame-too-short", "too long", hint="by part: …")
    error.details = {"advice": {"motion_bytes": 81, "proposals": []}}
    show_error(error, ["build", "job.toml", "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert answer["advice"] == {"motion_bytes": 81, "proposals": []}
    assert answer["diagnostics"][0]["hint"] == "by part: …"
