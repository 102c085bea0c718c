"""A file of readings with any contents is read or refused."""

from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.robot.calibration import read_csv

HEAD = "width_us,angle_deg\n"


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("1000,1\r2000,2\n", "is not a CSV file"),
        pytest.param(f"{'9' * 200_000},1\n", "is not a CSV file: field larger", id="a long field"),
        ("nan,1\n", "a reading is two numbers, width_us and angle_deg"),
        ("1000,inf\n", "a reading is two numbers, width_us and angle_deg"),
        ("0,1\n", "0, 1 is not a reading of a servo"),
        pytest.param("1000,1\n" * 1001, "has too many readings", id="1001 readings"),
    ],
)
def test_what_is_not_a_table_of_readings_is_refused(tmp_path: Path, rows: str, says: str) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes((HEAD + rows).encode())
    with pytest.raises(InputError, match=says):
        read_csv(path, speed=False)
