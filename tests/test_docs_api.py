"""docs/api.md: each block runs as it stands, each name that it tells of is there and documented."""

import re
import shutil
from importlib import import_module
from inspect import getdoc
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "api.md").read_text()
BLOCKS = re.findall(r"^## ([^\n]+)\n(?:(?!^## ).)*?^```python\n(.*?)^```", PAGE, re.M | re.S)


def test_there_is_a_block_for_each_title_that_has_one() -> None:
    assert len(BLOCKS) == PAGE.count("```python") == 7


@pytest.mark.parametrize(("title", "script"), BLOCKS, ids=[title for title, _ in BLOCKS])
def test_a_block_is_a_whole_script(
    title: str, script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(ROOT / "jobs", tmp_path / "jobs")
    monkeypatch.chdir(tmp_path)
    exec(compile(script, f"api.md: {title}", "exec"), {"__name__": "__main__"})


PACKAGES = {
    package: re.findall(r"`(\w+)`", names)
    for packages, names in re.findall(r"^\| (`servogen[^|]*) \| ([^|]*) \|", PAGE, re.M)
    for package in re.findall(r"`([\w.]+)`", packages)
    if "modules" not in names and names.strip() != "modules"
}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_that_is_told_is_there_and_documented(package: str) -> None:
    module = import_module(package)
    for name in PACKAGES[package]:
        assert getdoc(getattr(module, name)), f"{package}.{name}"


@pytest.mark.parametrize(
    "package", sorted(path.parent.name for path in (ROOT / "servogen").glob("*/__init__.py"))
)
def test_every_public_name_of_a_package_is_documented(package: str) -> None:
    module = import_module(f"servogen.{package}")
    for name in getattr(module, "__all__", ()):
        value = getattr(module, name)
        if callable(value):
            assert getdoc(value), f"servogen.{package}.{name}"


def test_the_types_are_shipped() -> None:
    assert (ROOT / "servogen" / "py.typed").is_file()
