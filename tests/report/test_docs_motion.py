"""The numbers in docs/motion.md are the ones that the commands give."""

import re
from fractions import Fraction
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.job import load, plan_job
from servogen.kinematics.protocol import Posture
from servogen.motion.gait.phases import gait
from servogen.motion.gait.steps import Segment
from servogen.motion.gait.walk import Walk, walk
from servogen.motion.laws import law
from servogen.pulse.plan import plan
from servogen.report.tracks import end_errors, end_tracks, largest_error
from servogen.units import Clock, Cycles
from tests.motion.robots import hexapod

SIX_LEGGED = ("tripod", "ripple", "wave")

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "motion.md").read_text()


def rows(first_column: str) -> list[list[str]]:
    """The cells of the table whose header begins so."""
    table = TEXT.split(f"| {first_column} |")[1].split("\n\n")[0].splitlines()[2:]
    return [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in table]


@pytest.mark.parametrize("row", rows("job"), ids=lambda row: row[0])
def test_the_error_of_each_job_is_the_one_told(row: list[str]) -> None:
    name, end, worst, rms = row
    job = plan_job(load(ROOT / "jobs" / f"{name}.toml"))
    found = largest_error(end_errors(end_tracks(job, plan(job.trajectory, job.servos, job.frame).schedule)))
    assert found.name == end
    assert worst == f"{1000 * found.worst_m:.3f} mm, frame {found.frame}"
    assert rms == f"{1000 * found.rms_m:.3f} mm"


def test_the_table_of_gaits_is_the_one_that_walks() -> None:
    told = {row[0]: row[1:] for row in rows("gait | duty")}
    assert set(told) == set(SIX_LEGGED)
    for name, (duty, *lifts, flying) in told.items():
        found = gait(name, hexapod())
        assert found.duty == Fraction(duty)
        assert [lift for _, lift in found.lifts] == [Fraction(lift) for lift in lifts]
        assert 6 * found.swing == int(flying)


def test_the_peaks_of_the_laws_are_their_derivatives_greatest_values() -> None:
    told = {row[0]: row for row in rows("law")}
    assert law("quintic").peak(2) == pytest.approx(10 / 3**0.5)
    for name in ("linear", "cubic", "quintic", "trapezoid", "s-curve"):
        assert float(Fraction(told[name][2])) == pytest.approx(law(name).peak(1))
    for name in ("cubic", "trapezoid", "s-curve"):
        assert float(Fraction(told[name][3])) == pytest.approx(law(name).peak(2))


@pytest.mark.parametrize("name", SIX_LEGGED)
def test_the_least_margins_are_the_ones_told(name: str) -> None:
    sentence = TEXT.split("The minimum margins at a stride of 40 mm:")[1].split(" A robot of")[0]
    told = {word: float(value) for word, value in re.findall(r"(\w+) ([\d.]+) mm", sentence)}
    found = robot_walk(name, Segment(forward=0.040))
    assert round(1000 * found.minimum_margin_m, 1) == told[name]


def robot_walk(name: str, segment: Segment) -> Walk:
    found, frames = hexapod(), {"tripod": 20, "ripple": 30, "wave": 60}[name]
    period, clock = Cycles(20_000), Clock(4_000_000)
    return walk(found, gait(name, found), [segment], Posture(), period, clock, frames_per_cycle=frames)


def test_every_picture_is_there_and_its_command_is_stated() -> None:
    for picture in re.findall(r"\(pictures/([\w.-]+)\)", TEXT):
        assert (ROOT / "docs" / "pictures" / picture).is_file()
        assert f"docs/pictures/{picture}" in TEXT or picture == "motion-laws.png"


def test_the_refused_walk_is_refused_so() -> None:
    from servogen.motion.gait.phases import custom

    found = hexapod()
    side = custom("own", 0.5, [0, 0, 0, 0.5, 0.5, 0.5], found)
    shown = TEXT.split("    servogen: error: ")[1].splitlines()[:2]
    with pytest.raises(InputError) as caught:
        walk(
            found,
            side,
            [Segment(forward=0.040)],
            Posture(),
            Cycles(20_000),
            Clock(4_000_000),
            frames_per_cycle=20,
        )
    assert shown == [f"{caught.value.message} [{caught.value.code}]", f"      {caught.value.hint}"]
