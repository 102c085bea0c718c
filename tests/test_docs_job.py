"""docs/job.md tells of every key of a job file, with its default; its examples can be planned."""

import re
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from servogen.job import load, plan_job
from servogen.job.schema import JobTable
from servogen.kinematics.catalogue import robot
from servogen.kinematics.forward import fk_position
from servogen.kinematics.hexapod import Hexapod
from servogen.robot.model import Arm
from servogen.robot.servo_models import ModelTable, names

PAGE = (Path(__file__).parent.parent / "docs" / "job.md").read_text()
BLOCKS = dict(re.findall(r"`(\w+\.toml)`[^`]*?(?:(?!```)[\s\S])*?```toml\n(.*?)^```", PAGE, re.M | re.S))

LISTS = ("servo", "sensor")
HEADINGS = {name: f"`[[{name}]]`" if name in LISTS else f"`[{name}]`" for name in JobTable.model_fields}


def rows(heading: str) -> dict[str, str]:
    """Key -> default, as the page tells them; a cell of several keys has one default, or each its own."""
    assert f"| {heading} |" in PAGE, f"docs/job.md has no table of {heading}"
    table = PAGE.split(f"| {heading} |")[1].split("\n\n")[0]
    found: dict[str, str] = {}
    for line in table.splitlines()[2:]:
        keys, default = (cell.strip() for cell in line.split("|")[1:3])
        names = re.findall(r"`(\w+)`", keys)
        each = default.split(", ") if ", " in default else [default] * len(names)
        found |= dict(zip(names, each, strict=True))
    return found


def told(value: Any) -> str:
    """A default as the page writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if value in (None, ""):
        return "–"
    if isinstance(value, str):
        return f'`"{value}"`'
    return "none" if value == () else f"{value:g}"


def defaults(model: type[BaseModel]) -> dict[str, str]:
    fields = model.model_fields.items()
    return {name: "needed" if field.is_required() else told(field.default) for name, field in fields}


def table_of(annotation: Any) -> type[BaseModel]:
    """The model in `X`, `X | None`, `tuple[X, ...]`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(table_of(inner) for inner in get_args(annotation) if inner not in (type(None), ...))


@pytest.mark.parametrize("name", JobTable.model_fields)
def test_every_key_of_a_table_is_told_with_its_default(name: str) -> None:
    expected = defaults(table_of(JobTable.model_fields[name].annotation))
    assert rows(HEADINGS[name]) == expected


def test_every_key_of_a_servo_file_is_told_with_its_default() -> None:
    assert rows("servo file") == defaults(ModelTable)


def test_the_page_names_servo_models_of_the_catalogue() -> None:
    row = next(line for line in PAGE.splitlines() if line.startswith("| `model` |"))
    found = set(re.findall(r"`([\w-]+)`", row.split("|")[3]))
    assert found and found <= set(names())


@pytest.mark.parametrize(
    ("table", "key"), [("motion", "poses"), ("walk", "route"), ("program", "hand"), ("drive", "routines")]
)
def test_the_keys_of_inner_tables_are_told(table: str, key: str) -> None:
    inner = table_of(table_of(JobTable.model_fields[table].annotation).model_fields[key].annotation)
    line = next(
        line for line in PAGE.split(f"| `[{table}]`")[1].splitlines() if line.startswith(f"| `{key}`")
    )
    assert set(inner.model_fields) <= set(re.findall(r"`(\w+)`", line))


def test_a_key_that_is_not_told_is_seen() -> None:
    class New(ModelTable):
        colour: str = "red"

    assert rows("servo file") != defaults(New)


@pytest.fixture
def examples(tmp_path: Path) -> Path:
    for name, text in BLOCKS.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def test_the_arm_of_the_page_can_be_planned(examples: Path) -> None:
    job = plan_job(load(examples / "arm.toml"))
    assert [servo.model.title for servo in job.servos] == ["Micro servo 9 g"] * 3
    assert not job.warnings
    found = robot(str(examples / "arm3.toml"))
    assert isinstance(found, Arm)
    assert fk_position(found, [0.0, 0.0, 0.0])[2] == pytest.approx(
        0.070
    )  # stretched out at the height of its base


def test_the_six_legged_robot_of_the_page_stands_on_both_sides(examples: Path) -> None:
    found = robot(str(examples / "bug.toml"))
    assert isinstance(found, Hexapod)
    assert [(mount.y > 0) != mount.mirrored for mount in found.mounts] == [True] * 6
