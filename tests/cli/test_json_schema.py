"""What every command prints with `--json` is what `servogen schema output` describes: units in names."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer

from servogen.cli.app import MODULES, app
from tests.bench.conftest import running
from tests.cli.conftest import ROOT, Run, wrong

LAB8, OUT = ROOT / "jobs" / "lab8-exercise.toml", ROOT / "firmware" / "lab8-exercise"
PROGRAM, SCHEDULE = OUT / "main.hex", OUT / "schedule.json"
PROOF = ROOT / "certificates" / "lab8-exercise" / "main.cert.xz"
CONTRACT = ROOT / "docs" / "examples" / "servo-contract.toml"
LAB_C = ROOT / "tests" / "labs" / "servo.c"

WALK = [
    f"check {LAB8}",
    f"plan {ROOT / 'jobs' / 'scara-pick.toml'}",
    f"plan {ROOT / 'jobs' / 'hexapod-tripod.toml'}",
    f"build {LAB8} -o made",
    f"demo {LAB8} -o all",
    f"report {LAB8} -o a.html",
    f"tune {ROOT / 'jobs' / 'lab9-program.toml'} --hex {ROOT / 'firmware' / 'lab9-program' / 'main.hex'}",
    f"compile {LAB_C} -o c.hex",
    f"simulate {PROGRAM} --cycles 30000 --profile",
    f"verify {PROGRAM} --against {SCHEDULE} --seconds 1",
    f"verify {PROGRAM} --against {SCHEDULE} --forever",
    f"verify {PROGRAM} --contract {CONTRACT} --seconds 3",
    f"measure {PROGRAM} --seconds 3",
    f"prove {PROGRAM}",
    f"prove {PROGRAM} --against {SCHEDULE} --certificate a.proof",
    f"prove {PROGRAM} --contract {CONTRACT}",
    f"check-certificate {PROOF} {PROGRAM} --against {SCHEDULE}",
    f"check-certificate {PROOF} {OUT / 'main.sdcc.hex'} --against {SCHEDULE}",
    "robots",
    "robots scara",
    "robots hexapod",
    "robots omni",
    "servos",
    "servos sg90",
    "fk scara 10 20 30 40",
    "fk hexapod 0 0 0 0 0 0 0 0 0 0 0 0",
    "fk omni 10 20 30",
    "ik scara 300 100 250 0 --all",
    "ik omni 100 0 0",
    "jacobian scara 10 20 30 40",
    "jacobian omni",
    "statics scara 10 20 30 40 --force-n 0 0 -5",
    "transform Ry(30)*Tx(50) 1 2 3",
    "orientation rpy 10 20 30",
    "differential Trans(10,5,0) --translation 1 0 0",
    "equation 3 4 -2.5",
    "mobility scara",
    "gait hexapod",
    "run-program moves.rvm",
    f"grade lab8-exercise {LAB_C} --pages pages",
    "doctor",
    f"drive {LAB8} --range-us 500,2500 --dry-run --seconds 1",
    f"twin {ROOT / 'jobs' / 'hexapod-tripod.toml'} --seconds 0.2",
    f"calibrate {LAB8} --readings seen.csv -o c.toml",
    "import wave.csv -o wave.toml",
]
"""Each command, with what it needs; `beside` has the files."""


@pytest.fixture
def beside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "moves.rvm").write_text("PD 1,0,300,200,-90,90\n10 MO 1\n20 OD 3\n30 ED\nRN 10\n", "utf-8")
    (tmp_path / "wave.csv").write_text("time_s,arm_deg\n0,90\n0.5,90\n1,120\n1.5,120\n", "utf-8")
    (tmp_path / "seen.csv").write_text("width_us,angle_deg\n1000,0\n1500,91\n2000,179\n", "utf-8")


@pytest.mark.parametrize("words", WALK)
@pytest.mark.usefixtures("beside")
def test_what_a_command_prints_is_what_the_schema_says(run: Run, words: str) -> None:
    ran = run(*words.split(), "--json")
    assert (ran.code in (0, 1), wrong(ran.out)) == (True, []), ran.err


@pytest.mark.usefixtures("beside")
def test_a_bench_programs_and_captures_with_units(run: Run) -> None:
    pytest.importorskip("picpro")
    with running("lab8-exercise") as bench:
        assert wrong(json.dumps({"diagnostics": [], **bench.paths})) == []
        flash = ("flash", PROGRAM, "--programmer", "picpro", "--port", bench.paths["programmer"])
        capture = ("capture", "--port", bench.paths["analyser"], "-o", "a.vcd", "--seconds", 0.1)
        for words in ((*flash, "--dry-run"), capture):
            ran = run(*words, "--json")
            assert (ran.code, wrong(ran.out)) == (0, []), ran.err


def test_every_command_with_json_is_walked() -> None:
    with_json = set()
    for name in MODULES:
        group = typer.main.get_command(app)
        _, command, _ = group.resolve_command(typer.Context(group), [name])  # type: ignore[attr-defined]
        if any("--json" in parameter.opts for parameter in command.params):
            with_json.add(name)
    assert with_json == {words.split()[0] for words in WALK} | {"flash", "rig", "capture"}


@pytest.mark.parametrize(
    ("where", "field"),
    [
        (("servos", 0), {"speed": 3}),
        (("servos", 0), {"reach": {"x": 1}}),
        ((), {"angles": [1, 2.5]}),
        ((), {"steps": [{"ends": [{"angle": 1.0}]}]}),
        (("diagnostics",), None),
    ],
)
def test_a_number_without_a_unit_is_found_wherever_it_is(
    run: Run, where: tuple[str | int, ...], field: dict[str, object] | None
) -> None:
    """Right as it is printed; one more field anywhere, or a diagnostic without its code, is not."""
    printed = run("plan", LAB8, "--json").out
    answer = inside = json.loads(printed)
    assert wrong(printed) == []
    for key in where:
        inside = inside[key]
    inside.update(field) if field is not None else inside.append({"severity": "error", "message": "x"})
    (found,) = wrong(json.dumps(answer))
    assert found.startswith(".".join(map(str, (*where, *(field or ())))))


def test_a_unit_in_the_name_is_enough() -> None:
    right = {"speed_deg_s": 3, "feet_m": {"L1": [1.0, 2.0]}, "solutions": [{"q1_deg": 1, "q3_mm": 2.5}]}
    assert wrong(json.dumps({"right": True, "name": "a", **right})) == []
