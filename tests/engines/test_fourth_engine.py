"""A fourth engine is a package, a folder of templates and a line in the registry: nothing else changes."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from servogen.engines.registry import ENGINES, engine_named
from servogen.errors import InputError
from servogen.job import loads

ROOT = Path(__file__).parents[2]
TOY = Path(__file__).parent / "toy"
BEING_WRITTEN = shutil.ignore_patterns("*.pyc.*", ".compiling-*")
"""What another process of the tests has only for a moment in the folders of the package."""
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
    shutil.copytree(ROOT / "servogen", folder / "servogen", ignore=BEING_WRITTEN)
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


TWO = "hold_s = 1 }, { arm_deg = 60, hold_s = 1 }"
JUMPER = '[jumper]\npin = "RA4"\n'
JOBS = {
    "plain": JOB,
    "two positions": JOB.replace("hold_s = 1 }", TWO),
    "button": JOB + 'start_pin = "RA4"\n',
    "jumper": JOB + JUMPER,
    "jumper of auto": JOB.replace('"toy"', '"auto"') + JUMPER,
    "jumper of sequence": JOB.replace('"toy"', '"sequence"') + JUMPER,
    "servo's pin": JOB + '[jumper]\npin = "RB0"\n',
    "no pin": JOB + '[jumper]\npin = "RB9"\n',
    "no key": JOB + '[jumper]\npins = "RA4"\n',
}
BUILD = """
import contextlib, io, json, pathlib, sys
from servogen.cli import main
said = {}
for path in sorted(pathlib.Path().glob("*.toml")):
    sys.argv = ["servogen", "build", path.name, "--output", path.stem]
    errors = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(errors):
        try:
            main()
        except SystemExit as ended:
            said[path.stem] = [ended.code or 0, errors.getvalue()]
print(json.dumps(said))
"""


@pytest.fixture(scope="module")
def built(four_engines: Path) -> dict[str, tuple[int, str]]:
    """The exit code and the messages of a build of each of JOBS, into a folder of its name."""
    for name, text in JOBS.items():
        (four_engines / f"{name}.toml").write_text(text)
    command = [sys.executable, "-c", BUILD]
    done = subprocess.run(command, cwd=four_engines, stdout=subprocess.PIPE, text=True, check=True)
    return {name: (code, errors) for name, (code, errors) in json.loads(done.stdout).items()}


Built = dict[str, tuple[int, str]]


def test_its_firmware_is_built_in_every_dialect(four_engines: Path, built: Built) -> None:
    assert built["plain"][0] == 0, built["plain"]
    report = (four_engines / "plain" / "report.txt").read_text()
    for dialect in ("c2c", "xc8", "sdcc"):
        assert (four_engines / "plain" / f"main.{dialect}.c").is_file()
        assert f"main.{dialect}.c" in report
    # 30° of a servo of 1000 µs at 0° and 2000 µs at 180°: 1166.67 µs, 1167 cycles of 1 µs; off for the rest.
    edges = (four_engines / "plain" / "edges.csv").read_text().splitlines()[1:]
    cycles = [int(line.split(",")[0]) for line in edges[:3]]
    assert [cycles[1] - cycles[0], cycles[2] - cycles[0]] == [1167, 20_000]


@pytest.mark.parametrize(
    ("job", "messages"),
    [
        ("two positions", ["the toy engine holds one servo in one position"]),
        ("button", ["the toy engine does not read buttons"]),
        (
            "jumper of sequence",
            [
                "jumper of sequence.toml:20:1",
                "the sequence engine does not read a jumper",
                'write engine = "toy", or omit engine',
            ],
        ),
        ("servo's pin", ["RB0 is in use: arm"]),
        ("no pin", ["unknown pin 'RB9'"]),
        ("no key", ["unknown key 'pins'"]),
    ],
)
def test_what_it_or_another_cannot_play_is_refused(built: Built, job: str, messages: list[str]) -> None:
    """By the engine itself, by the facts on its line, by its table, which is checked as all others are."""
    code, errors = built[job]
    assert code == 2 and all(message in errors for message in messages), errors


@pytest.mark.parametrize("job", ["jumper", "jumper of auto"])
def test_an_input_of_its_own_is_a_table_that_only_it_accepts(
    four_engines: Path, built: Built, job: str
) -> None:
    assert built[job][0] == 0, built[job]
    text = (four_engines / job / "main.c2c.c").read_text()
    assert "while ((PORTA & 0x10) == 0)" in text
    assert json.loads((four_engines / job / "schedule.json").read_text())["inputs"] == [
        {"pin": "RA4", "level": 1}
    ]


def test_without_its_line_there_is_no_such_table_and_no_such_engine() -> None:
    with pytest.raises(InputError, match="unknown key 'jumper'"):
        loads(JOB.replace('"toy"', '"auto"') + JUMPER, "toy.toml")
    with pytest.raises(InputError) as refused:
        loads(JOB, "toy.toml")
    assert all(name in str(refused.value) for name in ("auto", *ENGINES))


def test_the_protocol_and_the_firmware_of_engines_know_no_engine() -> None:
    for name in ("protocol", "firmware"):
        text = (ROOT / "servogen" / "engines" / f"{name}.py").read_text()
        assert [engine for engine in ENGINES if f"servogen.engines.{engine}" in text] == []


@pytest.mark.parametrize("name", ENGINES)
def test_each_engine_has_a_package_a_folder_of_templates_and_pages_that_name_it(name: str) -> None:
    assert ENGINES[name].module == f"servogen.engines.{name}.engine"
    assert (ROOT / "templates" / name / "main.c.j2").is_file()
    assert engine_named(name).title
    for page in ("job", "firmware"):
        assert re.search(f'`"?{name}"?`', (ROOT / "docs" / f"{page}.md").read_text()), f"docs/{page}.md"
