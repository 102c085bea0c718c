"""The first line of every verdict and every table says how far the pulses are from the plan."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from servogen.traces import read_edges
from servogen.traces.captures import capture_writer
from servogen.units import Clock, Cycles

Run = Callable[..., Any]

ROOT = Path(__file__).parents[2]
TURN = ROOT / "firmware" / "hexapod-turn"
LAB8 = ROOT / "firmware" / "lab8-exercise"
LAB8_DISTANCE = "0.333 µs, 0.06°"


def test_a_walk_that_is_proven_says_how_many_degrees_it_is_off(run: Run) -> None:
    ran = run("verify", TURN / "main.hex", "--against", TURN / "schedule.json")
    assert ran.code == 0
    first = ran.out.splitlines()[0]
    assert first.startswith("exact: ")
    assert first.endswith(
        "0 cycles from the schedule; "
        "the schedule is within 2.126 µs, 0.765°, 0.902 mm at the foot R1 of the plan"
    )


def test_what_is_not_proven_says_it_too_but_not_that_it_is_the_schedule(run: Run) -> None:
    ran = run("verify", LAB8 / "main.hex", "--against", TURN / "schedule.json", "--seconds", 1)
    assert ran.code == 1
    first = ran.out.splitlines()[0]
    assert "of the plan" in first
    assert "0 cycles from the schedule" not in first


def test_the_json_of_a_verdict_has_the_units_in_its_keys(run: Run) -> None:
    ran = run("verify", TURN / "main.hex", "--against", TURN / "schedule.json", "--seconds", 1, "--json")
    assert json.loads(ran.out)["plan_error"] == {
        "width_us": 2.126,
        "angle_deg": 0.765,
        "speed_deg_s": None,
        "end": "foot R1",
        "end_mm": 0.902,
    }


def test_a_schedule_of_somebody_else_has_no_plan_to_compare_with(run: Run, tmp_path: Path) -> None:
    data = json.loads((LAB8 / "schedule.json").read_text())
    del data["plan_error"]
    (tmp_path / "schedule.json").write_text(json.dumps(data))
    ran = run("verify", LAB8 / "main.hex", "--against", tmp_path / "schedule.json")
    assert ran.code == 0
    assert ran.out.splitlines()[0].endswith("; no plan to compare with")
    ran = run("verify", LAB8 / "main.hex", "--against", tmp_path / "schedule.json", "--json")
    assert json.loads(ran.out)["plan_error"] is None


def test_a_proof_for_all_time_says_it_in_its_first_line(run: Run) -> None:
    ran = run("verify", LAB8 / "main.hex", "--against", LAB8 / "schedule.json", "--forever")
    assert LAB8_DISTANCE in ran.out.splitlines()[0]


def test_a_capture_says_it_in_its_first_line(run: Run, lab8: Path) -> None:
    ran = run("verify", lab8 / "edges.csv", "--against", LAB8 / "schedule.json")
    assert LAB8_DISTANCE in ran.out.splitlines()[0]
    page, seen = lab8 / "page.html", lab8 / "seen.vcd"
    trace = read_edges(lab8 / "edges.csv", Clock(4_000_000)).until(Cycles(12_000_000))
    with capture_writer(seen, 1_000_000) as writer:
        for chunk in trace.chunks:
            writer.add(chunk)
        writer.finish(Cycles(12_000_000))
    ran = run("verify", seen, "--against", LAB8 / "schedule.json")
    assert ran.code == 0
    assert LAB8_DISTANCE in ran.out.splitlines()[0]
    ran = run("report", ROOT / "jobs" / "lab8-exercise.toml", "-o", page, "--capture", seen)
    assert LAB8_DISTANCE in ran.out.splitlines()[0]
    html = page.read_text()
    assert (
        f"<p><b>0 cycles from the schedule; the schedule is within {LAB8_DISTANCE} of the plan</b></p>"
        in html
    )
    capture = html.split('id="capture"')[1]
    assert LAB8_DISTANCE in capture


@pytest.mark.campaign
def test_the_tables_and_json_of_build_and_demo_have_it(run: Run, tmp_path: Path) -> None:
    job = ROOT / "jobs" / "lab8-exercise.toml"
    ran = run("build", job, "-o", tmp_path / "one")
    rows = [line for line in ran.out.splitlines() if "0 cycles" in line]
    assert len(rows) == 3
    assert all(LAB8_DISTANCE in row for row in rows)
    for row in rows:  # at its end what is used and what is left of 1024 words and 68 bytes
        words, words_left, ram, ram_left = map(int, row.split()[-4:])
        assert (words + words_left, ram + ram_left) == (1024, 68)
    assert LAB8_DISTANCE in next(line for line in ran.out.splitlines() if line.endswith("report.txt"))
    data = json.loads(run("build", job, "-o", tmp_path / "one", "--json").out)
    assert data["plan_error"]["width_us"] == 0.333
    ran = run("demo", job, "-o", tmp_path / "all")
    assert sum(LAB8_DISTANCE in line for line in ran.out.splitlines()) == 1
    data = json.loads(run("demo", job, "-o", tmp_path / "all", "--json").out)
    assert data["jobs"][0]["plan_error"]["angle_deg"] == 0.06
    assert json.loads(run("check", job, "--json").out)["plan_error"]["angle_deg"] == 0.06
