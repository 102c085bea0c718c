"""`servogen run-program`: what it prints, its JSON, its CSV."""

import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from servogen.cli.app import app as commands
from servogen.errors import InputError
from servogen.movemaster import Budget
from tests.cli.stand_ins import stand_in

PROGRAM = "PD 1, 0, 300, 200, -90, 90\n10 MO 1\n20 OD 5\n30 GC\n40 IN\n50 ED\n"


@pytest.fixture
def app() -> typer.Typer:
    return commands


@pytest.fixture
def program(tmp_path: Path) -> str:
    file = tmp_path / "p.rvm"
    file.write_text(PROGRAM, "utf-8")
    return str(file)


def test_each_command_that_takes_time_is_a_row(app: typer.Typer, program: str) -> None:
    shown = CliRunner().invoke(app, ["run-program", program, "--input", "5=3"]).output
    rows = [line.split() for line in shown.splitlines() if line.split()[:1] in (["10"], ["30"], ["40"])]
    assert [(*row[:2], row[-1]) for row in rows] == [
        ("10", "MO", "open"),
        ("30", "GC", "closed"),
        ("40", "IN", "closed"),
    ]
    assert rows[0][-6:-1] == ["0.0", "300.0", "200.0", "-90.0", "90.0"]
    assert "&05" in shown


def test_json_is_in_metres_and_degrees(app: typer.Typer, program: str) -> None:
    answer = json.loads(CliRunner().invoke(app, ["run-program", program, "--input", "5=3", "--json"]).output)
    step = answer["steps"][0]
    assert (step["line"], step["command"]) == (10, "MO 1")
    assert step["position_m"] == pytest.approx([0, 0.3, 0.2])
    assert (step["pitch_deg"], step["roll_deg"]) == pytest.approx((-90, 90))
    assert answer["steps"][-1]["start_s"] + answer["steps"][-1]["duration_s"] == pytest.approx(5)
    assert answer["outputs"][0]["value"] == 5
    assert list(answer["final_joints"]) == [f"q{number}_deg" for number in range(1, 6)]


def test_csv_has_a_row_a_frame_in_degrees(app: typer.Typer, program: str, tmp_path: Path) -> None:
    file = tmp_path / "joints.csv"
    CliRunner().invoke(app, ["run-program", program, "--input", "5=3", "--csv", str(file)])
    head, first, *rest = file.read_text("utf-8").splitlines()
    assert head == "time_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg"
    assert first == "0,90.000000,0.000000,0.000000,0.000000,90.000000"
    assert len(rest) == 250


def test_an_error_has_the_program_s_place(app: typer.Typer, program: str) -> None:
    result = CliRunner().invoke(app, ["run-program", program])
    assert isinstance(result.exception, InputError)
    assert str(result.exception).startswith(f"{program}:5:4: error: program line 40: IN waits for a strobe")


def test_a_program_that_does_not_end_is_stopped(app: typer.Typer, tmp_path: Path) -> None:
    file = tmp_path / "p.rvm"
    file.write_text("10 TI 1\n20 GT 10\n", "utf-8")
    result = CliRunner().invoke(app, ["run-program", str(file), "--max-s", "5"])
    assert "the program would take longer than 5 s" in str(result.exception)


def test_an_endless_program_is_stopped_where_the_page_on_arm_programs_says(
    run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """docs/movemaster.md: after 100 000 commands or an hour of motion."""
    budgets = []

    def stopped(*_: object, budget: Budget, **__: object) -> None:
        budgets.append(budget)
        raise InputError("program", "stopped")

    stand_in(monkeypatch, "servogen.movemaster", "run", stopped)
    (tmp_path / "endless.rvm").write_text("10 GT 10\n")
    assert run("run-program", tmp_path / "endless.rvm").code == 2
    assert run("run-program", tmp_path / "endless.rvm", "--max-commands", 7, "--max-s", 1.5).code == 2
    assert budgets == [Budget(100_000, Fraction(3600)), Budget(7, Fraction(3, 2))]
