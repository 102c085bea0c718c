"""action.yml and Dockerfile: what they run is run, by the shell that runs it there, without a network."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.testing.page import PROGRAMS, TESTS, write

ROOT = Path(__file__).parent.parent
ACTION: dict[str, Any] = yaml.safe_load((ROOT / "action.yml").read_text())
STEPS: list[dict[str, Any]] = ACTION["runs"]["steps"]
PAGE = (ROOT / "docs" / "ci.md").read_text()
LAB8 = ROOT / "firmware" / "lab8-exercise"
PATH = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
INPUT = re.compile(r"\$\{\{ inputs\.([\w-]+) \}\}")


def inputs(**given: str) -> dict[str, str]:
    unknown = {name.replace("_", "-") for name in given} - set(ACTION["inputs"])
    assert not unknown
    defaults = {name: str(each["default"]) for name, each in ACTION["inputs"].items()}
    return defaults | {name.replace("_", "-"): value for name, value in given.items()}


def act(folder: Path, values: Mapping[str, str]) -> tuple[int, str, list[str]]:
    """Run the action's steps as GitHub does, but for those that install: exit code, output, steps run."""
    files = {"GITHUB_STEP_SUMMARY": folder / "summary.md", "RUNNER_TEMP": folder, "GITHUB_ACTION_PATH": ROOT}
    ran, out = [], ""
    for step in STEPS:
        if "uses" in step or step["id"] == "install":
            continue
        condition = re.fullmatch(r"inputs\.([\w-]+) != ''", step.get("if", "inputs.output != ''"))
        assert condition, step["if"]
        if not values[condition[1]]:
            continue
        ran.append(step["id"])
        given = {key: INPUT.sub(lambda found: values[found[1]], text) for key, text in step["env"].items()}
        assert step["shell"] == "bash"
        done = subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],
            cwd=folder,
            env={**os.environ, **given, **{key: str(file) for key, file in files.items()}, "PATH": PATH},
            capture_output=True,
            text=True,
        )
        out += done.stdout + done.stderr
        if done.returncode:
            return done.returncode, out, ran
    return 0, out, ran


def test_the_action_is_composite_and_no_script_contains_an_input() -> None:
    """An input goes through the environment: a file name must not become a command."""
    assert ACTION["runs"]["using"] == "composite"
    assert [step["run"] for step in STEPS if "${{" in step.get("run", "")] == []
    used = {name for step in STEPS for text in step.get("env", {}).values() for name in INPUT.findall(text)}
    used |= {name for step in STEPS for text in step.get("with", {}).values() for name in INPUT.findall(text)}
    assert used == set(ACTION["inputs"])
    assert set(re.findall(r"`([\w-]+)`", "".join(re.findall(r"^\| (`.*?) \|", PAGE, re.M)))) == used


def test_the_step_that_installs_takes_the_tested_versions() -> None:
    (step,) = (each for each in STEPS if each.get("id") == "install")
    (pip,) = (line for line in step["run"].splitlines() if "pip" in line)
    words = shlex.split(pip.replace("$GITHUB_ACTION_PATH", str(ROOT)))
    assert words[:4] == ["python", "-m", "pip", "install"]
    assert Path(words[words.index("-c") + 1]) == ROOT / "constraints.txt"
    folder, extras = words[-1].removesuffix("]").split("[")
    assert Path(folder, "pyproject.toml").is_file()
    assert extras in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (matcher,) = re.findall(r"::add-matcher::\$GITHUB_ACTION_PATH/([\w./-]+)", step["run"])
    (pattern,) = json.loads((ROOT / matcher).read_text())["problemMatcher"][0]["pattern"]
    line = "jobs/my arm.toml:3:1: error: servo[1].pin: unknown pin 'RB9' [unknown-pin]"
    found = re.search(pattern["regexp"], line)
    assert found and [found[pattern[key]] for key in ("file", "line", "column", "severity", "code")] == [
        *("jobs/my arm.toml", "3", "1", "error", "unknown-pin")
    ]


def test_the_action_builds_and_proves_jobs(tmp_path: Path) -> None:
    shutil.copy(ROOT / "jobs" / "lab8-exercise.toml", tmp_path / "arm.toml")
    code, out, ran = act(tmp_path, inputs(jobs="\n  arm.toml\n", output="made"))
    assert (code, ran) == (0, ["inputs", "build"]), out
    assert (tmp_path / "made" / "arm" / "main.hex").read_bytes() == (LAB8 / "main.hex").read_bytes()
    assert "exact" in (tmp_path / "summary.md").read_text()


@pytest.mark.campaign
def test_the_action_proves_a_program_for_all_time(tmp_path: Path) -> None:
    values = inputs(program=str(LAB8 / "main.hex"), schedule=str(LAB8 / "schedule.json"))
    code, out, ran = act(tmp_path, values)
    assert (code, ran) == (0, ["inputs", "verify"]), out
    assert "for all time" in (tmp_path / "summary.md").read_text()


def test_a_program_that_is_wrong_fails_the_step_and_the_summary_says_so(tmp_path: Path) -> None:
    wrong = (ROOT / "firmware" / "lab8-program" / "main.hex").resolve()
    values = inputs(program=str(wrong), schedule=str(LAB8 / "schedule.json"), forever="false")
    code, out, _ = act(tmp_path, values)
    assert code == 1
    assert "NOT exact" in (tmp_path / "summary.md").read_text(), out


CI = ROOT / "docs" / "examples" / "ci"
MATCHERS = json.loads((ROOT / ".github" / "problem-matcher.json").read_text())["problemMatcher"]


def annotations(out: str) -> list[tuple[str, int, str]]:
    """Return the file, the line and the message of each annotation that GitHub makes of an output."""
    lines, found = out.splitlines(), []
    for matcher in MATCHERS:
        patterns = matcher["pattern"]
        for first in range(len(lines) - len(patterns) + 1):
            values: dict[str, str] = {}
            for pattern, line in zip(patterns, lines[first:], strict=False):
                match = re.search(pattern["regexp"], line)
                if match is None:
                    break
                values |= {key: match[number] for key, number in pattern.items() if isinstance(number, int)}
            else:
                found.append((values["file"], int(values["line"] or 0), values["message"]))
    return found


def template(folder: Path, old: str = "", new: str = "") -> dict[str, str]:
    """Copy the template with a change in its firmware; return what its workflow gives the action."""
    shutil.copytree(CI, folder, dirs_exist_ok=True)
    source = folder / "dimmer.c"
    assert old in source.read_text()
    source.write_text(source.read_text().replace(old, new))
    workflow = yaml.safe_load((folder / ".github" / "workflows" / "firmware.yml").read_text())
    return inputs(**workflow["jobs"]["timing"]["steps"][1]["with"])


@pytest.mark.campaign
def test_the_template_passes(tmp_path: Path) -> None:
    code, out, ran = act(tmp_path, template(tmp_path))
    assert (code, ran) == (0, ["inputs", "contract", "facts", "tests"]), out
    assert annotations(out) == []
    summary = (tmp_path / "summary.md").read_text()
    assert re.findall("^#### (.*)", summary, re.M) == ["✅ contract", "✅ facts of dimmer.c", "✅ tests"]
    assert 'tests="3"' in (tmp_path / "build" / "junit.xml").read_text()


def test_a_broken_contract_is_annotated_at_its_clause(tmp_path: Path) -> None:
    code, out, ran = act(tmp_path, template(tmp_path, "__delay_us(400)", "__delay_us(600)"))
    assert (code, ran) == (1, ["inputs", "contract"]), out
    clauses = (CI / "contract.toml").read_text().splitlines()
    found = annotations(out)
    assert [(file, clauses[line - 1]) for file, line, _ in found] == [
        ("contract.toml", "[[pulse]]"),
        ("contract.toml", "[[every]]"),
    ]
    assert "❌ contract" in (tmp_path / "summary.md").read_text()


def test_an_error_without_a_line_is_annotated_and_in_the_summary(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text('[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n')
    code, out, _ = act(tmp_path, inputs(jobs="arm.toml"))
    assert code == 2 and annotations(out) == [("arm.toml", 0, "'servo' is missing")], out
    assert "arm.toml: error: 'servo' is missing" in (tmp_path / "summary.md").read_text()


def test_a_failed_test_is_annotated_at_its_line(tmp_path: Path) -> None:
    """The facts allow both lights: only the tests see that it begins with the wrong one."""
    values = template(tmp_path, "bright = 0", "bright = 1") | {"contract": "", "program": ""}
    code, out, ran = act(tmp_path, values)
    assert (code, ran) == (1, ["inputs", "facts", "tests"]), out
    tests = (CI / "tests" / "test_dimmer.py").read_text().splitlines()
    assert [file for file, *_ in annotations(out)] == ["tests/test_dimmer.py"] * 3
    assert all(tests[line - 1].startswith("    ") for _, line, _ in annotations(out))
    assert all("assert" in message for *_, message in annotations(out))


def test_what_was_never_written_fails_the_step_of_the_facts_and_is_annotated(tmp_path: Path) -> None:
    values = template(tmp_path, "bright = 0, pressed", "bright, pressed") | {"contract": "", "program": ""}
    code, out, ran = act(tmp_path, values)
    assert (code, ran) == (1, ["inputs", "facts"]), out
    assert "❌ facts of dimmer.c" in (tmp_path / "summary.md").read_text()
    source = (tmp_path / "dimmer.c").read_text().splitlines()
    found = annotations(out)
    assert [(file, "bright" in source[line - 1]) for file, line, _ in found] == [("dimmer.c", True)] * 3
    assert all("main.bright" in message for *_, message in found)


@pytest.mark.campaign
def test_the_ten_examples_pass_as_tests_of_the_action(tmp_path: Path) -> None:
    write(tmp_path, PROGRAMS, TESTS)
    code, out, _ = act(tmp_path, inputs(tests=" ".join(TESTS)))
    assert code == 0, out
    assert "failed" not in out and " passed" in out


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"jobs": " \n"},
        {"program": "main.hex"},
        {"contract": "c.toml"},
        {"schedule": "s.json", "tests": "t"},
    ],
)
def test_inputs_that_are_missing_fail_before_anything_is_run(tmp_path: Path, given: dict[str, str]) -> None:
    code, out, ran = act(tmp_path, inputs(**given))
    assert (code, ran) == (2, ["inputs"])
    assert "::error::" in out


def instructions() -> list[tuple[str, str]]:
    """The instructions of the Dockerfile."""
    lines = re.sub(r"^#.*\n", "", (ROOT / "Dockerfile").read_text(), flags=re.M).replace("\\\n", " ")
    return [(line.split(" ", 1)[0], line.split(" ", 1)[1].strip()) for line in lines.splitlines() if line]


def the(name: str) -> list[str]:
    return [rest for each, rest in instructions() if each == name]


def test_the_image_is_of_the_python_that_the_constraints_were_tested_with() -> None:
    tested = re.search(r"Python (\d+\.\d+)", (ROOT / "constraints.txt").read_text())
    assert tested and the("FROM") == [f"python:{tested[1]} AS build", f"python:{tested[1]}-slim"]
    assert ACTION["inputs"]["python-version"]["default"] == tested[1]


def test_the_image_gets_every_file_that_its_package_is_made_of() -> None:
    copies = [each for each in the("COPY") if not each.startswith("--from=build /wheels")]
    copied = {source for each in copies for source in each.split()[:-1]}
    assert [source for source in copied if not (ROOT / source).exists()] == []
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    hatch = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    needed = {"pyproject.toml", "constraints.txt", "README.md", "hatch_build.py"}
    needed |= {*hatch["packages"], *hatch["force-include"], *project["project"]["license-files"]}
    assert needed <= copied
    ignored = {line.split("/")[0] for line in (ROOT / ".dockerignore").read_text().split()}
    assert not ignored & {source.split("/")[0] for source in copied}


def test_the_image_installs_extras_that_exist_with_the_tested_versions() -> None:
    (pip,) = (shlex.split(each) for each in the("RUN") if each.startswith("pip install"))
    assert pip[pip.index("-c") + 1] == "/opt/servogen/constraints.txt"
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert set(pip[-1].partition("[")[2].rstrip("]").split(",")) <= set(extras)


@pytest.mark.campaign
def test_what_the_image_runs_works(tmp_path: Path) -> None:
    """The container with no arguments and with those of the documentation."""
    entry, default = json.loads(the("ENTRYPOINT")[0]), json.loads(the("CMD")[0])
    (documented,) = re.findall(r"^    docker run .* servogen (.*)$", PAGE, re.M)
    shutil.copy(ROOT / "jobs" / "lab8-exercise.toml", tmp_path / "my-arm.toml")
    for command in ([*entry, *default], [*entry, *shlex.split(documented)]):
        done = subprocess.run(
            command, cwd=tmp_path, env={**os.environ, "PATH": PATH}, capture_output=True, text=True
        )
        assert done.returncode == 0 and done.stdout, done.stderr
