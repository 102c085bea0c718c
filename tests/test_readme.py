"""The README says what is there: its table, its commands, its links."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


def test_the_table_of_the_demo_is_the_kept_firmware() -> None:
    rows = re.findall(
        r"^\| ([\w-]+) \| \w+ \| (c2c|xc8|sdcc) \| (\d+) \| (\d+) \| (\d+) \| (\d+) \| 0 cycles", README, re.M
    )
    told = {(job, dialect): (words, left, ram) for job, dialect, words, left, ram, _ in rows}
    kept = {}
    for report in (ROOT / "firmware").glob("*/report.txt"):
        for dialect, words, left, ram in re.findall(
            r"^(c2c|xc8|sdcc) +\S+ +\S+ +(\d+) +(\d+) +(\d+) of 68", report.read_text(), re.M
        ):
            kept[report.parent.name, dialect] = (words, left, ram)
    assert told == kept


def test_every_command_is_told_and_every_command_told_is_there() -> None:
    from servogen.cli.main import app

    there = {
        command.name or (command.callback.__name__ if command.callback else "")
        for command in app.registered_commands
    }
    section = README.split("## Commands")[1].split("Each has")[0]
    first_cells = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    told = {
        word.removeprefix("servogen ").split()[0]
        for cell in first_cells
        for word in re.findall(r"`([^`]+)`", cell)
    }
    assert told == {name.replace("_", "-") for name in there}


def test_every_link_leads_somewhere() -> None:
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"
