"""`servogen doctor` lists the libraries that servogen needs."""

import json
import tomllib
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]


@pytest.fixture
def requires(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the package's metadata says it requires, as an installer writes it: <3,>=1.26."""
    lines = [*PROJECT["dependencies"], "sympy<2,>=1.12; extra == 'symbolic'"]
    monkeypatch.setattr("servogen.cli.doctor_command.requires", lambda name: lines)
    return lines


def test_each_library_is_listed_with_its_version(run: Run, requires: list[str]) -> None:
    ran = run("doctor", "--json")
    libraries = json.loads(ran.out)["libraries"]
    assert ran.code == 0
    assert len(libraries) == len(requires) - 1
    assert libraries["numpy"] == metadata.version("numpy")
    assert "sympy" not in libraries


def test_a_bound_is_not_part_of_the_name(run: Run, requires: list[str]) -> None:
    requires[:] = ["numpy<3,>=1.26", "tree-sitter~=0.26", "rich", "pyserial!=3.4"]
    libraries = json.loads(run("doctor", "--json").out)["libraries"]
    assert list(libraries) == ["numpy", "tree-sitter", "rich", "pyserial"]


def test_a_missing_library_is_exit_code_3(run: Run, requires: list[str]) -> None:
    requires.append("no-such-library<3,>=1")
    ran = run("doctor")
    assert ran.code == 3
    assert "no-such-library" in ran.out and "missing" in ran.out
