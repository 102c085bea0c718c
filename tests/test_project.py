"""What surrounds the code: package metadata, constraints, generated files, CI, CONTRIBUTING, CHANGELOG."""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from fnmatch import fnmatch
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parent.parent
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT = PYPROJECT["project"]
EXTRAS = PROJECT["optional-dependencies"]
PINS = dict(
    line.split("==")
    for line in (ROOT / "constraints.txt").read_text().splitlines()
    if not line.startswith("#")
)

OPTIONAL_MODULES = (
    "matplotlib",
    "sympy",
    "urdf_parser_py",
    "picpro",
    "distributed",
    "roboticstoolbox",
    "websockets",
)
"""The modules of the extras for users, by the names that Python imports."""


def requirements() -> list[Requirement]:
    return [Requirement(line) for group in (PROJECT["dependencies"], *EXTRAS.values()) for line in group]


@pytest.mark.parametrize("requirement", requirements(), ids=lambda requirement: requirement.name)
def test_constraints_hold_a_version_that_pyproject_allows(requirement: Requirement) -> None:
    assert PINS[canonicalize_name(requirement.name)] in requirement.specifier


def test_an_excluded_version_would_be_seen() -> None:
    assert PINS["numpy"] not in Requirement("numpy<2").specifier


def test_every_folder_of_tests_is_collected(request: pytest.FixtureRequest) -> None:
    """By default pytest skips folders with some names, such as `dist`."""
    skipped = request.config.getini("norecursedirs")
    folders = {
        part for path in (ROOT / "tests").rglob("test_*.py") for part in path.relative_to(ROOT).parts[:-1]
    }
    assert "workflows" in folders
    assert not [folder for folder in sorted(folders) if any(fnmatch(folder, each) for each in skipped)]


def test_libraries_that_only_some_commands_need_are_extras() -> None:
    plain = {Requirement(line).name for line in PROJECT["dependencies"]}
    assert not plain & {"sympy", "matplotlib", "distributed", "picpro", "urdf-parser-py"}
    assert Requirement(EXTRAS["symbolic"][0]).name == "sympy"


COMMANDS = f"""\
import sys
for name in {OPTIONAL_MODULES}:
    sys.modules[name] = None
from servogen.cli import main
for line in (
    ["check", "jobs/lab8-exercise.toml"],
    ["fk", "scara", "30", "60", "200", "0"],
    ["ik", "scara", "346.41016", "500", "250"],
    ["jacobian", "scara", "30", "60", "200", "0"],
    ["plan", "jobs/hexapod-tripod.toml"],
    ["verify", "firmware/lab9-program/main.hex", "--against", "firmware/lab9-program/schedule.json"],
    ["fk", "scara", "--symbolic"],
):
    sys.argv = ["servogen", *line]
    try:
        main()
    except SystemExit as ended:
        print(line[0], ended.code or 0, file=sys.stderr)
"""


def test_the_commands_work_without_any_extra() -> None:
    """Runs in a process of its own, where no extra is imported yet. Only symbols need one: sympy."""
    done = subprocess.run([sys.executable, "-c", COMMANDS], cwd=ROOT, capture_output=True, text=True)
    codes = re.findall(r"^(\w+) (\d)$", done.stderr, re.M)
    plain = [(command, "0") for command in ("check", "fk", "ik", "jacobian", "plan", "verify")]
    assert codes == [*plain, ("fk", "3")], done.stderr


def test_the_metadata_is_complete() -> None:
    assert {"name", "version", "description", "license", "authors", "keywords", "classifiers"} <= set(PROJECT)
    assert PROJECT["dynamic"] == ["readme"] and "custom" in PYPROJECT["tool"]["hatch"]["metadata"]["hooks"]
    text = (ROOT / "LICENSE").read_text()
    assert PROJECT["license"] == "MIT" and text.startswith("MIT License\n")
    assert PROJECT["license-files"] == ["LICENSE"]
    assert PROJECT["authors"][0]["name"] in text


@pytest.fixture
def hatch_build(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """hatch_build.py, which is imported by the build backend: only its base classes come from there."""
    metadata = SimpleNamespace(MetadataHookInterface=object)
    builders = SimpleNamespace(BuildHookInterface=object)
    monkeypatch.setitem(sys.modules, "hatchling.metadata.plugin.interface", metadata)
    monkeypatch.setitem(sys.modules, "hatchling.builders.hooks.plugin.interface", builders)
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_link_of_the_page_on_a_package_index_is_absolute(hatch_build: ModuleType) -> None:
    hook = hatch_build.Readme()
    hook.root = str(ROOT)
    metadata: dict[str, Any] = {}
    hook.update(metadata)
    page = metadata["readme"]["text"]
    assert metadata["readme"]["content-type"] == "text/markdown"
    assert re.findall(r"\]\((?!https://|#)[^)]*\)", page) == []
    assert "docs/design.md | the data flow" in page and "](docs/pictures" not in page


def test_only_relative_links_lose_their_targets(hatch_build: ModuleType) -> None:
    page = "# a\n\n![p](b/c.png)\n\n[x](d.md), [y](https://e.org/f.md), [z](#g), [LICENSE](LICENSE)\n"
    made = "# a\n\nx, [y](https://e.org/f.md), [z](#g), LICENSE\n"
    assert hatch_build.index_page(page).startswith(made)


def test_gitattributes_mark_what_is_generated(tmp_path: Path) -> None:
    attributes = attributes_of(
        tmp_path,
        "firmware/lab8-exercise/main.hex",
        "firmware/lab8-exercise/main.c2c.c",
        "firmware/lab8-exercise/report.txt",
        "firmware/SHA256SUMS",
        "constraints.txt",
        "docs/pictures/robots.png",
        "servogen/units.py",
    )
    generated = [name for name, found in attributes.items() if found["linguist-generated"] == "set"]
    assert generated == [
        "firmware/lab8-exercise/main.hex",
        "firmware/lab8-exercise/main.c2c.c",
        "firmware/lab8-exercise/report.txt",
        "firmware/SHA256SUMS",
        "constraints.txt",
    ]
    without_diff = [name for name, found in attributes.items() if found["diff"] == "unset"]
    assert without_diff == [
        "firmware/lab8-exercise/main.hex",
        "firmware/SHA256SUMS",
        "docs/pictures/robots.png",
    ]


def attributes_of(folder: Path, *names: str) -> dict[str, dict[str, str]]:
    """Returns what git makes of .gitattributes, read in a new repository in `folder`."""

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", *arguments], cwd=folder, capture_output=True, text=True, check=True
        ).stdout

    git("init", "--quiet")
    shutil.copy(ROOT / ".gitattributes", folder)
    out = git("check-attr", "linguist-generated", "diff", "--", *names)
    found: dict[str, dict[str, str]] = {name: {} for name in names}
    for line in out.splitlines():
        name, attribute, value = line.split(": ")
        found[name][attribute] = value
    return found


def dry_run(*arguments: str) -> str:
    """Returns what make would run."""
    done = subprocess.run(
        ["make", "--no-print-directory", "-n", *arguments], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_make_installs_the_tested_versions(tmp_path: Path) -> None:
    (install,) = re.findall(r".*pip install.*", dry_run("check", f"VENV={tmp_path}"))
    assert "-c constraints.txt" in install
    (extras,) = re.findall(r"-e '\.\[([\w,]+)\]'", install)
    assert {*extras.split(",")} == EXTRAS.keys() - {"benchmarks", "docs"}
    assert "-c constraints.txt" in dry_run("bench", f"VENV={tmp_path}").split("[benchmarks]")[0]
    assert (
        " -c " not in dry_run("check", f"VENV={tmp_path}", "CONSTRAINTS=").split("ruff")[0].split("pip")[-1]
    )


def test_new_constraints_are_not_resolved_with_the_old_ones() -> None:
    (install,) = re.findall(r".*pip install.*", dry_run("constraints"))
    assert "-c constraints.txt" not in install
    (extras,) = re.findall(r"-e '\.\[([\w,]+)\]'", install)
    assert {*extras.split(",")} == EXTRAS.keys()


def test_make_check_formats_lints_checks_types_and_tests(tmp_path: Path) -> None:
    (tmp_path / ".installed").touch()
    lines = dry_run("check", f"VENV={tmp_path}").splitlines()
    commands = [
        line.removeprefix(f"{tmp_path}/bin/") for line in lines if line.startswith(f"{tmp_path}/bin/")
    ]
    *formatted, compiled, tested = commands
    assert formatted[-2:] == ["ruff format --check .", "ruff check ."]
    assert compiled.startswith("pytest --collect-only") and f"& {tmp_path}/bin/mypy; status=$?" in compiled
    assert compiled.endswith("exit $status"), "the exit code is that of mypy"
    assert tested == "pytest"


def ci(tmp_path: Path, codes: dict[str, int]) -> tuple[int, list[str]]:
    """Run CI with a make of ours on the path, which writes down how it was called and exits with a code.

    The tools that CI would install stand beside it, so that the test installs nothing.
    """
    cases = "".join(f"{target}) exit {code};;\n" for target, code in codes.items())
    programs = dict.fromkeys(("chromium", "zsh", "fish", "npm", "apt-get"), "")
    for name, lines in {**programs, "make": f'echo "$PWD $*"\ncase "$1" in\n{cases}esac\n'}.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{lines}")
        (tmp_path / name).chmod(0o755)
    done = subprocess.run(
        [ROOT / ".ci" / "run"],
        cwd=tmp_path,
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stdout.splitlines()


def test_ci_makes_the_site_and_runs_make_check(tmp_path: Path) -> None:
    assert ci(tmp_path, {"check": 7}) == (7, [f"{ROOT} docs-tools", f"{ROOT} docs", f"{ROOT} check"])


def test_ci_fails_with_the_site_but_goes_on_without_its_tools(tmp_path: Path) -> None:
    assert ci(tmp_path, {"docs": 2}) == (2, [f"{ROOT} docs-tools", f"{ROOT} docs"])
    code, lines = ci(tmp_path, {"docs-tools": 2})
    assert (code, lines[0], lines[2]) == (0, f"{ROOT} docs-tools", f"{ROOT} check")
    assert lines[1] == "without the documentation site: mkdocs-material cannot be installed"


def test_every_path_and_target_in_contributing_is_there() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text()
    folders = {path.name for path in ROOT.iterdir() if path.is_dir()}
    named = re.findall(r"`([\w./-]+)`", text)
    paths = [
        name for name in named if name.split("/")[0] in folders or name.endswith((".toml", ".txt", ".md"))
    ]
    assert len(paths) > 20
    assert [path for path in paths if not (ROOT / path).exists()] == []
    targets = set(re.findall(r"(?:`|^    )make ([a-z]+)", text, re.M))
    rules = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.M))
    assert {"check", "test", "firmware", "constraints", "bench"} <= targets <= rules


def test_the_page_of_platforms_names_every_extra_for_users() -> None:
    rows = set(re.findall(r"^\| `(\w+)` \| ", (ROOT / "docs" / "platforms.md").read_text(), re.M))
    assert EXTRAS.keys() - {"dev", "benchmarks"} <= rows


def test_the_changelog_has_the_form_of_keep_a_changelog() -> None:
    text = (ROOT / "CHANGELOG.md").read_text()
    assert text.startswith("# Changelog\n")
    assert re.findall(r"^## (.*)$", text, re.M)[0] == "[Unreleased]"
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"^### (.*)$", text, re.M)) <= kinds


def test_constraints_are_written_from_the_environment_that_runs() -> None:
    """pip is the second witness of what is installed."""
    made = subprocess.run(
        [sys.executable, "tools/constraints.py"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    listed = subprocess.run(
        [sys.executable, "-m", "pip", "list", "--format", "json"], capture_output=True, text=True
    )
    pins = dict(line.split("==") for line in made.splitlines() if not line.startswith("#"))
    for package in json.loads(listed.stdout):
        name = canonicalize_name(package["name"])
        assert pins.get(name) == (None if name in {"servogen", "pip", "setuptools"} else package["version"])


def test_the_table_of_modules_in_docs_robots_names_every_module() -> None:
    """Its first column, with `package` (`module`, …) for the modules inside a package."""
    page = (ROOT / "docs" / "robots.md").read_text("utf-8")
    _, _, table = page.partition("| module of `servogen.kinematics` |")
    rows = [line for line in table.split("\n\n")[0].splitlines()[2:] if line.startswith("|")]
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[1])}
    package = ROOT / "servogen" / "kinematics"
    there = {path.stem for path in package.rglob("*.py") if path.stem != "__init__"} | {"inverse"}
    assert named == there
