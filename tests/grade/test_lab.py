"""A lab's file is checked: what is wrong in it is named with its line."""

import re
from math import radians
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.grade import Check, Grade, load_lab, refused
from servogen.grade.lab import Lab, PointsTable, TaskPosition, names
from servogen.grade.points import CHECK_TITLES, max_total, outcomes, total

LAB = """
title = "A lab"
task = "Left and right."
clock_hz = 4_000_000
watch_s = 10
rounds = 2
[period]
range_ms = [18, 20]
spread_us = 100
[[servo]]
name = "arm"
model = "futaba-s3001"
pin = "RB0"
[[solution]]
positions = [
    { name = "left", angles_deg = { arm = [0, 4] }, pause_s = 1 },
    { name = "right", angles_deg = { arm = [176, 180] }, pause_s = 1 },
]
"""


def test_the_labs_that_come_with_servogen_load() -> None:
    assert names() == ("lab8-exercise", "lab9-exercise")
    assert [position.pause_s for position in load_lab("lab8-exercise").solutions[0].positions] == [2, 5, 3]
    assert len(load_lab("lab9-exercise").solutions) == 2


def test_an_unknown_lab_is_told_which_are_known() -> None:
    with pytest.raises(InputError, match="lab8-exercise"):
        load_lab("lab8-exercize")


@pytest.mark.parametrize(
    ("old", "new", "message", "line"),
    [
        ('pin = "RB0"', 'pin = "RB8"', "unknown pin 'RB8'", 13),
        ('model = "futaba-s3001"', 'model = "futaba"', "unknown servo model", 12),
        ("arm = [0, 4]", "leg = [0, 4]", "unknown servo 'leg'", 16),
        ("arm = [0, 4]", "arm = [4, 0]", "4° to 0° is not a range", 16),
        (
            "arm = [176, 180]",
            "arm = [176, 190]",
            "176° to 190° is not a range within the servo's 0° to 180°",
            17,
        ),
        ("range_ms = [18, 20]", "range_ms = [20, 18]", "above 0 and below the second", 8),
        ("watch_s = 10", "watch_s = 0", "out of range", 5),
        ("rounds = 2", "round = 2", "unknown key 'round'", 6),
        ('title = "A lab"', 'title = "A lab"\npoints = { pause = 1 }', "unknown key 'pause'", 3),
        ('title = "A lab"', 'title = "A lab"\npoints = { runs = -1 }', "-1 is out of range: at least 0", 3),
        ('title = "A lab"', 'title = "A lab"\npoints = {}', "no points are given", 3),
    ],
)
def test_what_is_wrong_in_a_lab_file_is_named(
    tmp_path: Path, old: str, new: str, message: str, line: int
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(LAB.replace(old, new))
    with pytest.raises(InputError) as caught:
        load_lab(str(path))
    assert message in str(caught.value)
    assert caught.value.location is not None and caught.value.location.line == line


def test_points_for_pauses_need_a_pause(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(LAB.replace(", pause_s = 1", "") + "[points]\nruns = 1\npauses = 2\n")
    with pytest.raises(InputError, match=r"points\.pauses: points for pauses, but no position has a pause_s"):
        load_lab(str(path))
    path.write_text(LAB + "[points]\nruns = 1\npauses = 2\n")
    assert load_lab(str(path)).points == ((Check.RUNS, 1.0), (Check.PAUSES, 2.0))


def test_a_lab_without_points_gives_one_for_a_program_without_fault(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(LAB)
    lab = load_lab(str(path))
    assert (lab.points, lab.points_passed) == ((), 1.0)
    right = outcomes(lab, Grade("mine", ()))
    assert (total(right), max_total(right)) == (1, 1)
    assert total(outcomes(lab, refused("mine", "it does not compile"))) == 0


def test_every_check_has_a_key_in_the_points_and_a_row_in_the_documentation() -> None:
    assert set(PointsTable.model_fields) == {"passed", *Check} and set(CHECK_TITLES) == set(Check)
    page = (Path(__file__).parents[2] / "docs" / "grading.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| ", page.split("## Points")[1].split("## ")[0], re.M)
    assert rows == [*Check, "passed"]


def test_the_lab_of_the_documentation_loads(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "grading.md").read_text("utf-8")
    (block,) = re.findall(r"^```toml\n(.*?)^```", page, re.M | re.S)
    (tmp_path / "my-lab.toml").write_text(block)
    lab = load_lab(str(tmp_path / "my-lab.toml"))
    assert (dict(lab.points), lab.points_passed) == ({"runs": 1, "positions": 3, "pauses": 2}, 4)


def test_a_lab_of_ones_own_is_loaded_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(LAB)
    assert load_lab(str(path)).name == "mine"


def mine(tmp_path: Path, *changes: tuple[str, str]) -> Lab:
    text = LAB
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "mine.toml").write_text(text)
    return load_lab(str(tmp_path / "mine.toml"))


def test_the_values_of_a_lab_are_those_of_its_file_in_radians_and_shares(tmp_path: Path) -> None:
    lab = mine(tmp_path)
    assert (lab.clock.hz, lab.watch_s, lab.rounds) == (4_000_000, 10, 2)
    assert (lab.pause_tolerance, lab.longest_move_s) == (0.05, 0.0)
    assert (lab.period_ms, lab.spread_us) == ((18, 20), 100)
    assert [servo.pins for servo in lab.servos] == [("RB0",)]
    (solution,) = lab.solutions
    assert solution.name == ""
    assert [position.ranges for position in solution.positions] == [
        (pytest.approx((0, radians(4))),),
        (pytest.approx((radians(176), radians(180))),),
    ]
    other = mine(
        tmp_path,
        ("rounds = 2", "rounds = 2\npause_tolerance_percent = 20\nlongest_move_s = 1.5"),
        ('pin = "RB0"', 'pin = "RB0"\nother_pins = ["RA1", "RB7"]'),
    )
    assert (other.pause_tolerance, other.longest_move_s) == (0.2, 1.5)
    assert other.servos[0].pins == ("RB0", "RA1", "RB7")


def test_a_range_may_exceed_the_travel_by_four_degrees(tmp_path: Path) -> None:
    """The cycles of a loop change a width by as much."""
    assert mine(tmp_path, ("[0, 4]", "[-4, 4]"), ("[176, 180]", "[176, 184]"))
    for old, new in (("[0, 4]", "[-4.1, 4]"), ("[176, 180]", "[176, 184.1]"), ("[0, 4]", "[4, 4]")):
        with pytest.raises(InputError, match="is not a range within the servo's 0° to 180°"):
            mine(tmp_path, (old, new))


def test_what_belongs_to_no_servo_or_to_two_is_refused(tmp_path: Path) -> None:
    second = '[[servo]]\nname = "arm"\nmodel = "futaba-s3001"\npin = "RB1"\n[[solution]]'
    with pytest.raises(InputError, match="two servos have the name arm"):
        mine(tmp_path, ("[[solution]]", second))
    with pytest.raises(InputError, match="'leg' is missing"):
        mine(tmp_path, ("[[solution]]", second.replace('"arm"', '"leg"')))
    with pytest.raises(InputError, match=r"other_pins: unknown pin 'RB9'"):
        mine(tmp_path, ('pin = "RB0"', 'pin = "RB0"\nother_pins = ["RB1", "RB9"]'))
    with pytest.raises(InputError, match="above 0 and below the second"):
        mine(tmp_path, ("[18, 20]", "[0, 20]"))
    with pytest.raises(InputError, match="above 0 and below the second"):
        mine(tmp_path, ("[18, 20]", "[20, 20]"))
    assert mine(tmp_path, ("[18, 20]", "[0.5, 20]")).period_ms == (0.5, 20)


def test_a_position_holds_angles_up_to_both_ends_of_each_range() -> None:
    held = TaskPosition("both", ((0.0, 1.0), (2.0, 3.0)), None)
    for angles, right in (
        ((0.0, 2.0), True),
        ((1.0, 3.0), True),
        ((-0.01, 2.5), False),
        ((0.5, 3.01), False),
        ((1.01, 2.5), False),
    ):
        assert held.holds(angles) == right


def test_pauses_are_checked_if_any_position_has_one(tmp_path: Path) -> None:
    assert mine(tmp_path).checks == tuple(Check)
    one = mine(tmp_path, ("[0, 4] }, pause_s = 1", "[0, 4] }"))
    assert one.has_pauses and Check.PAUSES in one.checks
    none = mine(tmp_path, (", pause_s = 1", ""))
    assert not none.has_pauses
    assert none.checks == tuple(check for check in Check if check != "pauses")
