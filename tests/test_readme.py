"""The README says what is there: its table, its commands, its links."""

import re
from pathlib import Path

from tools import demo_table

ROOT = Path(__file__).parent.parent
TABLE_PAGE = ROOT / "docs" / "commands.md"
"""The page with the table of the demo."""
README = (ROOT / "README.md").read_text()
COMMANDS_PAGE = TABLE_PAGE.read_text()


def test_the_table_of_the_demo_is_the_kept_firmware() -> None:
    """Every cell of it is what the reports under firmware/ say, as the command beside it prints them."""
    shown = TABLE_PAGE.read_text().partition("\n| job | engine |")
    assert f"| job | engine |{shown[2]}".startswith("\n".join(demo_table.lines()) + "\n\n")
    assert "`python tools/demo_table.py`" in shown[0]


def test_a_row_follows_its_report(tmp_path: Path) -> None:
    """A frame more, an edge a cycle off, a word more: each changes the row."""
    report = (ROOT / "firmware" / "lab8-exercise" / "report.txt").read_text()
    (tmp_path / "report.txt").write_text(report)
    before = demo_table.row(tmp_path / "report.txt")
    assert before[1:5] == ("sequence", "91", "91", "128")
    for old, new, column in (("1500 frames", "1501 frames", 7), ("0 cycles from", "1 cycles from", 8),
                             ("   91     933", "   92     932", 2)):  # fmt: skip
        (tmp_path / "report.txt").write_text(report.replace(old, new))
        after = demo_table.row(tmp_path / "report.txt")
        assert after[column] == str(new.split()[0]) + (" cycles" if column == 8 else "")
        assert before[column] != after[column]


def test_every_command_is_told_and_every_command_told_is_there() -> None:
    from servogen.cli.app import MODULES

    section = COMMANDS_PAGE.partition("# Commands")[2].partition("Every command has")[0]
    first_cells = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    told = {
        word.removeprefix("servogen ").split()[0]
        for cell in first_cells
        for word in re.findall(r"`([^`]+)`", cell)
    }
    assert told == MODULES.keys()


def test_every_link_leads_somewhere() -> None:
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")):
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_the_page_is_short_and_its_commands_are_there() -> None:
    """Under 120 lines, without sizes in megabytes or exit codes; each of four doors has three commands."""
    from servogen.cli.app import MODULES

    assert README.count("\n") < 120
    assert not re.search(r"\d MB\b|[Ee]xit code|completion", README.partition("## More")[0])
    doors = re.findall(r"^\*\*[\w ]+\*\* \(.*\):\n\n((?:    .*\n)+)", README, re.M)
    assert [door.count("\n") for door in doors] == [3, 3, 3, 3]
    assert set(re.findall(r"^    servogen ([\w-]+)", "".join(doors), re.M)) <= MODULES.keys()
