"""`servogen schema`: the schema accepts the files that are shipped, and refuses what the readers refuse.

Mutations of every shipped file are held against the schema (jsonschema, draft 7) and against the model that
reads the file; where only the schema refuses one, the reader as a whole has to refuse it too.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from pydantic import ValidationError

from servogen import job
from servogen.contract.clauses import ContractFile
from servogen.errors import InputError
from servogen.grade.lab import LabTable, load_lab
from servogen.job.schema import JobTable
from servogen.kinematics import catalogue
from servogen.kinematics.registry import KINDS
from servogen.robot.servo_models import ModelTable, servo_model
from servogen.toml.file import Table
from servogen.workflows.schemas import SCHEMAS
from tests.bench.conftest import Run, run  # noqa: F401 - a fixture
from tests.campaigns import sampled

ROOT = Path(__file__).parents[2]
FOLDERS = {
    "job": ROOT / "jobs",
    "robot": Path(str(files("servogen.robot"))) / "catalogue" / "robots",
    "servo": Path(str(files("servogen.robot"))) / "catalogue" / "servos",
    "lab": Path(str(files("servogen.grade"))) / "labs",
    "contract": ROOT / "docs" / "examples",
}
FILES = [(kind, file) for kind, folder in FOLDERS.items() for file in sorted(folder.glob("*.toml"))]
IDS = [f"{kind}-{file.stem}" for kind, file in FILES]


@cache
def validator(kind: str) -> jsonschema.Draft7Validator:
    schema = SCHEMAS[kind]()
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def test_every_kind_of_file_is_shipped() -> None:
    assert {kind for kind, _ in FILES} == set(SCHEMAS)
    assert len(FILES) >= 16 + 15 + 3 + 2


@pytest.mark.parametrize(("kind", "file"), FILES, ids=IDS)
def test_a_shipped_file_is_accepted(kind: str, file: Path) -> None:
    errors = list(validator(kind).iter_errors(tomllib.loads(file.read_text("utf-8"))))
    assert errors == []


def model_of(kind: str, data: Mapping[str, Any]) -> type[Table]:
    if kind == "robot":
        return KINDS[data.get("kind", "arm")].table
    return {"job": JobTable, "servo": ModelTable, "lab": LabTable, "contract": ContractFile}[kind]


def as_read(value: Any) -> Any:
    """Return a value as the reader passes it to the model: arrays as tuples."""
    if isinstance(value, dict):
        return {key: as_read(each) for key, each in value.items()}
    return tuple(as_read(each) for each in value) if isinstance(value, list) else value


KeyPath = tuple[str, ...]


def mutants(value: Any, seen: set[KeyPath], path: KeyPath = ()) -> Iterator[Any]:
    """Yield copies of a value of TOML with one thing changed: a key, a type, a number, a length.

    A key that is in `seen`, wherever in its array, was changed before, in this file or in another.
    Not a whole number written as 4e6: JSON does not tell it from 4000000, only the reader refuses it.
    """
    new = path not in seen
    seen.add(path)
    if isinstance(value, dict):
        if new:
            yield {**value, "no_such_key": 1}
        for key, each in value.items():
            rest = {name: other for name, other in value.items() if name != key}
            if (*path, key) not in seen:
                yield rest
                yield {**rest, f"{key}_x": each}
            for mutant in mutants(each, seen, (*path, key)):
                yield {**value, key: mutant}
    elif isinstance(value, list):
        if new:
            yield from ([], value[:-1], [*value, *value[-1:]], {"a": 1}, "text")
        for index, each in enumerate(value):
            for mutant in mutants(each, seen, (*path, "[]")):
                yield [*value[:index], mutant, *value[index + 1 :]]
    elif not new:
        return
    elif isinstance(value, bool):
        yield from (1, "true", [value])
    elif isinstance(value, int | float):
        yield from (str(value), True, [value], {"a": value}, -(10**9), -1, 0, 0.5, 10**12)
    elif isinstance(value, str):
        yield from (7, True, [value], {"a": value}, "", "no such")


def reader_refuses(kind: str, data: dict[str, Any], folder: Path) -> bool:
    text = "\n".join(f"{key} = {inline(value)}" for key, value in data.items())
    file = folder / "mutant.toml"
    file.write_text(text, "utf-8")
    assert tomllib.loads(text) == data
    try:
        if kind == "job":
            job.plan_job(job.load(file))
        elif kind == "robot":
            catalogue.robot(str(file))
        elif kind == "servo":
            servo_model(str(file))
        else:
            load_lab(str(file))
    except InputError:
        return True
    return False


def inline(value: Any) -> str:
    """Return a value as TOML on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {inline(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(inline, value))}]"
    return json.dumps(value)


@pytest.mark.parametrize("kind", sampled(FOLDERS, 2))
def test_schema_and_reader_refuse_the_same(kind: str, tmp_path: Path) -> None:
    """Every key of the shipped files is changed once; the file is only read where the model accepts it."""
    refused = count = 0
    seen: dict[type[Table], set[KeyPath]] = {}
    for _, file in (each for each in FILES if each[0] == kind):
        data = tomllib.loads(file.read_text("utf-8"))
        schema, model = validator(kind), model_of(kind, data)
        for mutant in mutants(data, seen.setdefault(model, set())):
            if kind == "robot" and mutant.get("kind") != data.get("kind"):
                continue  # another kind's model
            count += 1
            accepted = schema.is_valid(mutant)
            refused += not accepted
            try:
                model.model_validate(as_read(mutant))
            except ValidationError:
                assert not accepted, mutant
            else:
                assert accepted or reader_refuses(kind, mutant, tmp_path), mutant
    print(kind, count, refused)
    assert count > 90 and refused > count / 3


@pytest.mark.parametrize(
    ("kind", "old", "new", "where"),
    [
        ("job", 'pin = "RB0"', 'pn = "RB0"', "servo"),  # a wrong key
        ("job", 'pin = "RB0"', "pin = 0", "pin"),  # a wrong type
        ("job", 'pin = "RB0"', 'pin = "RB9"', "pin"),  # a value that is not allowed
        ("job", "period_us = 20_000", "period_us = 2_000_000", "period_us"),  # out of range
        ("lab", "rounds = 3", "rounds = 0", "rounds"),
        ("servo", "width_us = 1000", "width_us = 1", "width_us"),
    ],
)
def test_a_named_mistake_is_refused_by_both_at_the_same_key(
    kind: str, old: str, new: str, where: str, tmp_path: Path
) -> None:
    name = {"job": "lab8-exercise", "lab": "lab8-exercise", "servo": "futaba-s3001"}[kind]
    text = (FOLDERS[kind] / f"{name}.toml").read_text("utf-8")
    assert old in text
    data = tomllib.loads(text.replace(old, new, 1))
    paths = [tuple(error.absolute_path) for error in validator(kind).iter_errors(data)]
    assert paths and all(where in path for path in paths)
    assert reader_refuses(kind, data, tmp_path)


def test_docstrings_of_fields_are_descriptions() -> None:
    definitions = SCHEMAS["job"]()["definitions"]
    joint = definitions["ServoTable"]["properties"]["joint"]
    assert (
        joint["description"]
        == "The joint of [robot] that the servo turns; the joint is at 0 when the servo is at `zero_deg`."
    )
    assert "enum" in definitions["ServoTable"]["properties"]["model"]["anyOf"][0]
    assert not [each for each in definitions.values() if "description" not in each]


def test_the_command_prints_and_writes_the_schema(run: Run, tmp_path: Path) -> None:  # noqa: F811
    printed = run("schema", "lab")
    assert (printed.code, json.loads(printed.out)) == (0, SCHEMAS["lab"]())
    assert run("schema", "lab", "-o", tmp_path / "lab.schema.json").code == 0
    assert (tmp_path / "lab.schema.json").read_text() == printed.out
    refused = run("schema", "hex")
    assert refused.code == 2 and "'job', 'robot', 'servo', 'lab'" in refused.err


def test_a_file_that_names_its_schema_is_read(tmp_path: Path) -> None:
    text = (ROOT / "jobs" / "lab8-exercise.toml").read_text("utf-8")
    assert job.loads(f"#:schema ./job.schema.json\n{text}", "a.toml").servos


def test_the_file_of_the_documentation_names_its_schema_and_is_right() -> None:
    page = (ROOT / "docs" / "editors.md").read_text("utf-8")
    (text,) = re.findall(r"^```toml\n(.*?)^```", page, re.M | re.S)
    assert text.startswith("#:schema ./job.schema.json\n")
    assert validator("job").is_valid(tomllib.loads(text)) and job.loads(text, "arm.toml").servos


TAPLO = shutil.which("taplo", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")


@pytest.mark.skipif(TAPLO is None, reason="Taplo, the TOML tools of editors, is not installed")
def test_taplo_checks_a_file_against_the_schema_that_it_names(tmp_path: Path) -> None:
    (tmp_path / "job.schema.json").write_text(json.dumps(SCHEMAS["job"]()))
    text = (ROOT / "jobs" / "lab8-exercise.toml").read_text("utf-8")
    for name, body in (("right", text), ("wrong", text.replace("clock_hz", "clok_hz"))):
        (tmp_path / f"{name}.toml").write_text(f"#:schema ./job.schema.json\n{body}", "utf-8")
        done = subprocess.run(
            [str(TAPLO), "lint", f"{name}.toml"], cwd=tmp_path, capture_output=True, text=True
        )
        assert (done.returncode == 0) == (name == "right"), done.stderr
    assert "clok_hz" in done.stderr


def test_two_chips_are_a_job_for_the_schema_too() -> None:
    """Their example is accepted; without its wire a chip is not."""
    file = ROOT / "docs/examples/two-chips/hexapod-eighteen.toml"
    data = tomllib.loads(file.read_text())
    assert list(validator("job").iter_errors(data)) == [] and len(job.load(file).chips) == 2
    del data["chip"][1]["wire"]
    assert list(validator("job").iter_errors(data)) != []
