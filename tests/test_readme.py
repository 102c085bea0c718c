"""The README says what is there: its table, its commands, its links."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


def test_the_table_of_the_demo_is_the_kept_firmware() -> None:
    cell = r" (\d+) \|"
    rows = re.findall(rf"^\| ([\w-]+) \| \w+ \|{cell * 6} 0 cycles \| ([^|]+) \| proven \|$", README, re.M)
    told = {job: (*map(int, numbers), distance) for job, *numbers, distance in rows}
    kept = {}
    for report in (ROOT / "firmware").glob("*/report.txt"):
        text = report.read_text()
        programs = re.findall(r"^(?:c2c|xc8|sdcc) +\S+ +\S+ +(\d+) +(\d+) +(\d+) of 68", text, re.M)
        words, left, ram = zip(*(map(int, program) for program in programs), strict=True)
        (frames,) = set(re.findall(r"^  proven: .*?, (\d+) frames", text, re.M))
        (distance,) = set(re.findall(r"^  proven: .*within (.+) of the plan$", text, re.M))
        kept[report.parent.name] = (*words, min(left), max(ram), int(frames), distance)
    assert told == kept


def test_every_command_is_told_and_every_command_told_is_there() -> None:
    from servogen.cli.main import COMMANDS

    there = {name for names in COMMANDS.values() for name in names}
    section = README.split("## Commands")[1].split("Every command has")[0]
    first_cells = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    told = {
        word.removeprefix("servogen ").split()[0]
        for cell in first_cells
        for word in re.findall(r"`([^`]+)`", cell)
    }
    assert told == there


def test_every_link_leads_somewhere() -> None:
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")):
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"
