"""Where gpsim 0.31 differs from the data sheets, the simulator does not: docs/simulator.md has the table.

Where gpsim is installed, a test runs it: the list of differences stays true, and three programs show that the
runner sees agreement too.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from servogen.simulator import SimulatorOptions
from tests.simulator.gpsim_cases import (
    AGREEMENTS,
    ANSWER,
    ANSWER_BYTES,
    DIFFERENCES,
    Case,
    gpsim_answer,
    gpsim_version,
)
from tests.simulator.helpers import image, machine, ram

ROOT = Path(__file__).parents[2]
VERSION = "0.31"


def name_of(case: Case) -> str:
    return case.name


@pytest.mark.parametrize("case", (*DIFFERENCES, *AGREEMENTS), ids=name_of)
def test_the_simulator_does_what_the_data_sheet_says(case: Case) -> None:
    chip = machine(
        image(case.source, case.config), SimulatorOptions(), [(at, "RB4", level) for at, level in case.rb4]
    )
    chip.run(case.cycles)
    assert tuple(ram(chip, ANSWER + n) for n in range(ANSWER_BYTES)) == case.answer


@pytest.mark.skipif(gpsim_version() != VERSION, reason=f"gpsim {VERSION} is not installed")
@pytest.mark.parametrize("case", (*DIFFERENCES, *AGREEMENTS), ids=name_of)
def test_gpsim_does_it_where_the_documentation_says_so_and_only_there(case: Case, tmp_path: Path) -> None:
    found = gpsim_answer(case, image(case.source, case.config), tmp_path)
    assert (found == case.answer) == (case in AGREEMENTS)


def test_the_documentation_has_every_difference() -> None:
    text = (ROOT / "docs" / "simulator.md").read_text()
    table = text.split("## Differences from gpsim 0.31", 1)[1].split("\n## ", 1)[0]
    rows = [line.split("|")[1].strip() for line in table.splitlines() if line.startswith("| ")][1:]
    assert rows == [case.name for case in DIFFERENCES]
