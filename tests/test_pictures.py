"""The committed pictures are what the commands beside them draw, and what they show has not changed since."""

import importlib.util
import re
import shlex
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from tests.campaigns import sampled
from tests.cli.conftest import Run, run  # noqa: F401 - a fixture
from tools import pictures

ROOT = Path(__file__).parent.parent
COMMANDS = pictures.commands()
QUICK = sorted(COMMANDS.keys() - pictures.SLOW.keys())
MOST_PIXELS = 20
"""Less than one digit."""


def different_pixels(one: Path, other: Path) -> int:
    """The number of pixels that differ visibly; of pictures of two sizes all."""
    first, second = (matplotlib.image.imread(path)[:, :, :3] for path in (one, other))
    return (
        int((np.abs(first - second).max(axis=2) > 0.15).sum()) if first.shape == second.shape else first.size
    )


def draw(run: Run, command: str, folder: Path) -> None:  # noqa: F811
    """Run a command of the documentation in this process, so that it writes to another folder."""
    tool, *words = shlex.split(command)
    if tool == "servogen":
        assert run(*(word.replace("docs/pictures", str(folder)) for word in words)).code == 0
        return
    spec = importlib.util.spec_from_file_location("drawn", ROOT / words[0])
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.HERE = folder
    script.main()


def test_every_picture_has_its_command_beside_it() -> None:
    there = {path.name for path in pictures.FOLDER.iterdir() if path.suffix in pictures.SUFFIXES}
    assert there == COMMANDS.keys()
    assert pictures.SLOW.keys() <= COMMANDS.keys()


@pytest.mark.parametrize("command", sampled(sorted({COMMANDS[name] for name in QUICK}), 2))
def test_a_picture_is_what_its_command_draws(
    run: Run,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    command: str,
) -> None:
    monkeypatch.chdir(ROOT)
    draw(run, command, tmp_path)
    for name in (name for name in QUICK if COMMANDS[name] == command):
        assert different_pixels(tmp_path / name, pictures.FOLDER / name) <= MOST_PIXELS, (
            f"tools/pictures.py {name}"
        )


def test_a_digit_more_or_another_size_is_another_picture(tmp_path: Path) -> None:
    """A digit of 5 by 9 pixels; fewer pixels than that are the edges of letters of another version."""
    kept = pictures.FOLDER / "gait-tripod.png"
    drawn = matplotlib.image.imread(kept)[:, :, :3].copy()
    drawn[10:19, 900:905] = 0
    matplotlib.image.imsave(tmp_path / "digit.png", drawn)
    assert different_pixels(tmp_path / "digit.png", kept) == 45 > MOST_PIXELS
    matplotlib.image.imsave(tmp_path / "size.png", drawn[1:])
    assert different_pixels(tmp_path / "size.png", kept) > MOST_PIXELS


def test_what_a_slow_picture_shows_has_not_changed_since_it_was_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`python tools/pictures.py NAME` makes it again. A changed byte of it, or of what it shows, is told."""
    kept = pictures.SOURCES.read_text()
    assert pictures.sources() == kept
    folder = tmp_path / "docs" / "pictures"
    folder.mkdir(parents=True)
    files = {file for shown in pictures.SLOW.values() for file in shown} | {
        f"docs/pictures/{n}" for n in pictures.SLOW
    }
    for file in files:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_bytes((ROOT / file).read_bytes())
    monkeypatch.setattr(pictures, "ROOT", tmp_path)
    monkeypatch.setattr(pictures, "FOLDER", folder)
    assert pictures.sources() == kept
    for changed in ("docs/pictures/report.png", "firmware/hexapod-command/main.hex"):
        (tmp_path / changed).write_bytes((ROOT / changed).read_bytes() + b"\n")
        differing = [line for line in pictures.sources().splitlines() if line not in kept]
        assert [line.split()[0] for line in differing] == [
            {"docs/pictures/report.png": "report.png"}.get(changed, "walk-on-command.png")
        ]
        (tmp_path / changed).write_bytes((ROOT / changed).read_bytes())


def test_a_command_stands_after_its_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It names the picture's file, or is the script that follows; a browser needs the line before, too."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text(
        "![a](docs/pictures/a.png)\n\n`servogen plot x -o docs/pictures/a.png`\n"
    )
    page = "![b](pictures/b.png)\n`python docs/pictures/b.py`\n![c](pictures/c.png) ![d](pictures/d.png)\n"
    (tmp_path / "docs" / "p.md").write_text(
        page + "```\nservogen report x\nchromium --o=docs/pictures/c.png x\n```\n"
    )
    monkeypatch.setattr(pictures, "ROOT", tmp_path)
    found = pictures.commands()
    assert found.pop("a.png") == "servogen plot x -o docs/pictures/a.png"
    assert found.pop("b.png") == "python docs/pictures/b.py"
    assert re.split("\n", found.pop("c.png")) == ["servogen report x", "chromium --o=docs/pictures/c.png x"]
    assert found == {}
