"""A fourth engine is a package, a folder of templates and a line in the registry: nothing else changes."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from servogen.engines.registry import ENGINES, engine_named
from tests.campaigns import sampled

ROOT = Path(__file__).parents[2]
TOY = Path(__file__).parent / "toy"
LAST = '        "stream": EngineEntry('
LINE = (
    '        "toy": EngineEntry("servogen.engines.toy.engine", accepts=("a jumper",), '
    'section="servogen.engines.toy.section"),\n'
)

JOB = """
[chip]
device = "PIC16F84"
clock_hz = 4_000_000

[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"

[motion]
repeat = true
poses = [{ arm_deg = 30, hold_s = 1 }]

[frame]
period_us = 20_000

[firmware]
engine = "toy"
"""


@pytest.fixture(scope="module")
def four_engines(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of servogen with the toy's package, its folder of templates and one line more."""
    folder = tmp_path_factory.mktemp("four")
    shutil.copytree(ROOT / "servogen", folder / "servogen")
    shutil.copytree(ROOT / "templates", folder / "templates")
    package, templates = folder / "servogen" / "engines" / "toy", folder / "templates" / "toy"
    package.mkdir()
    templates.mkdir()
    (package / "__init__.py").write_text('"""The toy engine."""\n')
    for module in ("engine.py", "section.py"):
        shutil.copy(TOY / module, package)
    shutil.copy(TOY / "main.c.j2", templates)
    registry = folder / "servogen" / "engines" / "registry.py"
    text = registry.read_text()
    assert text.count(LAST) == 1
    registry.write_text(text.replace(LAST, LINE + LAST))
    return folder


def built(folder: Path, job: str) -> subprocess.CompletedProcess[str]:
    (folder / "toy.toml").write_text(job)
    command = [sys.executable, "-m", "servogen", "build", "toy.toml", "--output", "out"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_its_firmware_is_built_and_proven_in_every_dialect(four_engines: Path) -> None:
    done = built(four_engines, JOB)
    assert done.returncode == 0, done.stdout + done.stderr
    report = (four_engines / "out" / "report.txt").read_text()
    for dialect in ("c2c", "xc8", "sdcc"):
        assert (four_engines / "out" / f"main.{dialect}.c").is_file()
        assert f"main.{dialect}.c" in report
    # 30° of a servo of 1000 µs at 0° and 2000 µs at 180°: 1166.67 µs, 1167 cycles of 1 µs; off for the rest.
    edges = (four_engines / "out" / "edges.csv").read_text().splitlines()[1:]
    cycles = [int(line.split(",")[0]) for line in edges[:3]]
    assert [cycles[1] - cycles[0], cycles[2] - cycles[0]] == [1167, 20_000]


@pytest.mark.campaign
def test_what_it_cannot_play_is_its_own_refusal(four_engines: Path) -> None:
    two = JOB.replace("hold_s = 1 }", "hold_s = 1 }, { arm_deg = 60, hold_s = 1 }")
    done = built(four_engines, two)
    assert done.returncode == 2
    assert "the toy engine holds one servo in one position" in done.stderr


def test_what_it_does_not_read_is_refused_by_the_facts_on_its_line(four_engines: Path) -> None:
    done = built(four_engines, JOB + 'start_pin = "RA4"\n')
    assert done.returncode == 2
    assert "the toy engine does not read buttons" in done.stderr


JUMPER = '[jumper]\npin = "RA4"\n'


@pytest.mark.parametrize("engine", sampled(["toy", "auto"]))
def test_an_input_of_its_own_is_a_table_that_only_it_accepts(four_engines: Path, engine: str) -> None:
    done = built(four_engines, JOB.replace('"toy"', f'"{engine}"') + JUMPER)
    assert done.returncode == 0, done.stdout + done.stderr
    text = (four_engines / "out" / "main.c2c.c").read_text()
    assert "while ((PORTA & 0x10) == 0)" in text
    assert json.loads((four_engines / "out" / "schedule.json").read_text())["inputs"] == [
        {"pin": "RA4", "level": 1}
    ]


def test_another_engine_refuses_the_input(four_engines: Path) -> None:
    done = built(four_engines, JOB.replace('"toy"', '"sequence"') + JUMPER)
    assert done.returncode == 2
    assert "toy.toml:20:1" in done.stderr and "the sequence engine does not read a jumper" in done.stderr
    assert 'write engine = "toy", or omit engine' in done.stderr


@pytest.mark.campaign
def test_its_table_is_checked_as_all_others_are(four_engines: Path) -> None:
    for text, message in (
        ('[jumper]\npin = "RB0"\n', "RB0 is in use: arm"),
        ('[jumper]\npin = "RB9"\n', "unknown pin 'RB9'"),
        ('[jumper]\npins = "RA4"\n', "unknown key 'pins'"),
    ):
        done = built(four_engines, JOB + text)
        assert done.returncode == 2 and message in done.stderr, done.stderr


@pytest.mark.campaign
def test_without_its_line_there_is_no_such_table(tmp_path: Path) -> None:
    (tmp_path / "toy.toml").write_text(JOB.replace('"toy"', '"auto"') + JUMPER)
    command = [sys.executable, "-m", "servogen", "check", str(tmp_path / "toy.toml")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "unknown key 'jumper'" in done.stderr


def test_the_protocol_and_the_firmware_of_engines_know_no_engine() -> None:
    for name in ("protocol", "firmware"):
        text = (ROOT / "servogen" / "engines" / f"{name}.py").read_text()
        assert [engine for engine in ENGINES if f"servogen.engines.{engine}" in text] == []


def test_without_its_line_there_is_no_such_engine(tmp_path: Path) -> None:
    (tmp_path / "toy.toml").write_text(JOB)
    command = [sys.executable, "-m", "servogen", "build", str(tmp_path / "toy.toml"), "--output", "out"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    for name in ("auto", *ENGINES):
        assert name in done.stderr


@pytest.mark.parametrize("name", ENGINES)
def test_each_engine_has_a_package_and_a_folder_of_templates_of_its_name(name: str) -> None:
    assert ENGINES[name].module == f"servogen.engines.{name}.engine"
    assert (ROOT / "templates" / name / "main.c.j2").is_file()
    assert engine_named(name).title
