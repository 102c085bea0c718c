"""What every command prints with `--json` is what `servogen schema output` describes: its keys, its units."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import typer

from servogen.cli.app import MODULES, app
from servogen.workflows.output_schema import OUTPUTS, UNITLESS, output_schema
from tests.bench.conftest import running
from tests.cli.conftest import ROOT, Run, wrong
from tests.workflows.test_pair import JOB as PAIR

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
    "fk theta-r --symbolic",
    "fk hexapod 0 0 0 0 0 0 0 0 0 0 0 0",
    "fk omni 10 20 30",
    "ik scara 300 100 250 0 --all",
    "ik omni 100 0 0",
    "jacobian scara 10 20 30 40",
    "jacobian scara 10 20 30 40 --rates 1,2,3,4",
    "jacobian theta-r --symbolic",
    "jacobian omni",
    "transform Ry(30)",
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
    f"import wave.csv --against {LAB8}",
    f"compile {LAB_C} -o c.hex --dump ir",
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
def test_what_a_command_prints_is_what_its_schema_says(run: Run, words: str) -> None:
    ran = run(*words.split(), "--json")
    assert (ran.code in (0, 1), wrong(words.split()[0], ran.out)) == (True, []), ran.err


@pytest.mark.usefixtures("beside")
def test_two_chips_answer_as_the_schema_says(run: Run) -> None:
    Path("pair.toml").write_text(PAIR, "utf-8")
    walk = ("check pair.toml", "plan pair.toml", "build pair.toml -o made", "verify made")
    for words in map(str.split, walk):
        ran = run(*words, "--json")
        assert (ran.code, wrong(words[0], ran.out)) == (0, []), ran.err


@pytest.mark.usefixtures("beside")
def test_a_bench_programs_and_captures_as_the_schema_says(run: Run) -> None:
    pytest.importorskip("picpro")
    with running("lab8-exercise") as bench:
        assert wrong("rig", json.dumps({"diagnostics": [], **bench.paths})) == []
        flash = ("flash", PROGRAM, "--programmer", "picpro", "--port", bench.paths["programmer"])
        capture = ("capture", "--port", bench.paths["analyser"], "-o", "a.vcd", "--seconds", 0.1)
        verify = ("verify", "a.vcd", "--against", SCHEDULE)
        for words in ((*flash, "--dry-run"), capture, verify):
            ran = run(*words, "--json")
            assert (ran.code in (0, 1), wrong(words[0], ran.out)) == (True, []), ran.err


def test_every_command_with_json_has_a_schema_and_is_walked() -> None:
    with_json = set()
    for name in MODULES:
        group = typer.main.get_command(app)
        _, command, _ = group.resolve_command(typer.Context(group), [name])  # type: ignore[attr-defined]
        if any("--json" in parameter.opts for parameter in command.params):
            with_json.add(name)
    assert with_json == set(OUTPUTS)
    assert with_json == {words.split()[0] for words in WALK} | {"flash", "rig", "capture"}


def changed(answer: dict[str, Any], where: tuple[str | int, ...], change: Callable[[Any], object]) -> str:
    """An answer with one place of it changed, as it is printed."""
    answer = inside = json.loads(json.dumps(answer))
    for key in where:
        inside = inside[key]
    change(inside)
    return json.dumps(answer)


@pytest.mark.parametrize("where", [(), ("servos", 0), ("ends", 0, "error"), ("horns", 0)])
def test_a_key_that_is_missing_and_one_that_is_not_known_are_found_wherever_they_are(
    run: Run, where: tuple[str | int, ...]
) -> None:
    """Each key of the object is left out once; the schema names the place and the key."""
    answer = inside = json.loads(run("plan", ROOT / "jobs" / "scara-pick.toml", "--json").out)
    for key in where:
        inside = inside[key]
    place = ".".join(map(str, where))
    for key in inside:
        found = wrong("plan", changed(answer, where, lambda each, key=key: each.pop(key)))
        assert found == [f"{place}: {key!r} is a required property"]
    (found,) = wrong("plan", changed(answer, where, lambda each: each.update(speed=3)))
    assert found.startswith(f"{place}: ") and "'speed' was unexpected" in found


@pytest.mark.parametrize(
    ("command", "where", "key", "value"),
    [
        ("plan", ("servos", 0), "minimum_deg", "90"),
        ("plan", (), "clock_hz", 1.5),
        ("plan", ("diagnostics",), None, {"severity": "error", "message": "x"}),
        ("ik", ("solutions", 0), "elbow", 1.0),
    ],
)
def test_a_wrong_type_a_diagnostic_without_code_and_a_joint_without_unit_are_found(
    run: Run, command: str, where: tuple[str | int, ...], key: str | None, value: object
) -> None:
    words = {"plan": (LAB8,), "ik": ("scara", 300, 100, 250, 0)}[command]
    answer = json.loads(run(command, *words, "--json").out)
    assert wrong(command, json.dumps(answer)) == []

    def change(each: Any) -> None:
        each.append(value) if key is None else each.update({key: value})

    (found,) = wrong(command, changed(answer, where, change))
    assert found.startswith(".".join(map(str, where)))


def test_what_another_command_prints_is_not_accepted(run: Run) -> None:
    printed = run("equation", 3, 4, 5, "--json").out
    assert wrong("equation", printed) == []
    accepted = [command for command in OUTPUTS if wrong(command, printed) == []]
    assert accepted == ["equation"]


def test_a_refusal_is_accepted_of_every_command_and_needs_an_error(run: Run) -> None:
    printed = run("check", "missing.toml", "--json").out
    assert all(wrong(command, printed) == [] for command in OUTPUTS)
    assert wrong("check", json.dumps({"diagnostics": []})) != []


def parts(schema: Any) -> Iterator[dict[str, Any]]:
    """A schema and all that are inside of it."""
    if isinstance(schema, dict):
        yield schema
        yield from (part for each in schema.values() for part in parts(each))
    elif isinstance(schema, list):
        yield from (part for each in schema for part in parts(each))


def test_every_number_has_a_unit_and_every_key_a_meaning() -> None:
    """Of all commands together; a name that is said to have no unit is one of some number."""
    whole, used = output_schema(), set()
    jsonschema.Draft7Validator.check_schema(whole)
    for part in parts(whole["definitions"]):
        for key, field in part.get("properties", {}).items() if "required" in part else ():
            used.add(key)
            assert field["description"].endswith("."), key
            inside = [each for each in parts(field) if each.get("type") in ("number", "integer")]
            assert all("unit" in each for each in inside), key
    assert {name for names in UNITLESS.values() for name in names} - used == set()


def test_the_command_prints_the_schema_of_one_command_or_of_all(run: Run, tmp_path: Path) -> None:
    one = json.loads(run("schema", "output", "equation").out)
    assert one == output_schema("equation")
    assert set(one["definitions"]) == {"equation", "Refusal", "DiagnosticAnswer", "AdviceAnswer", *OF_ADVICE}
    assert json.loads(run("schema", "output").out) == output_schema()
    refused = run("schema", "output", "equatoin")
    assert refused.code == 2 and "did you mean 'equation'?" in refused.err
    refused = run("schema", "job", "plan")
    assert refused.code == 2 and "omit 'plan'" in refused.err


OF_ADVICE = {"ShareAnswer", "UseAnswer", "ProposalAnswer", "SegmentAnswer", "SlotAnswer", "ShortestFrame"}
"""What a refusal may have beside its diagnostics."""


def test_the_unit_is_the_end_of_the_name() -> None:
    answer = output_schema("plan")["definitions"]["ServoFactsAnswer"]["properties"]["peak_speed_deg_s"]
    assert answer["description"] == "Its highest speed on a ramp."
    assert {each.get("unit") for each in answer["anyOf"]} == {"deg_s", None}
