"""docs/your-robot.md: its commands print what it shows."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from tests.cli.conftest import Run

PAGE = (Path(__file__).parents[2] / "docs" / "your-robot.md").read_text("utf-8")
SHOWN = re.findall(r"^    \$ servogen (.+)\n((?:    (?!\$).+\n)+)", PAGE, re.MULTILINE)


@pytest.mark.parametrize(("command", "lines"), SHOWN)
def test_what_the_page_shows_is_what_its_commands_print(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, lines: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    Path("spider.toml").write_text(block, "utf-8")
    if command.startswith("plan"):
        (new,) = re.findall(r"servogen (new my\.toml .+)", PAGE)
        assert run(*new.split()).code == 0
    ran = run(*command.split())
    said = (ran.out + ran.err).splitlines()
    for line in lines.splitlines():
        assert line.strip() in [each.strip() for each in said]


def test_a_path_with_signs_of_toml_is_the_robots_of_the_job(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    name = 'my "spi\\der.toml'
    Path(name).write_text(block, "utf-8")
    assert run("new", "my.toml", "--robot", name, "--servo", "sg90").code == 0
    assert tomllib.loads(Path("my.toml").read_text("utf-8"))["robot"]["name"] == name


def test_the_page_shows_commands() -> None:
    assert len(SHOWN) == 5
