"""report.txt tells what the pulses do at the foot or tool."""

from pathlib import Path

import pytest

from servogen.job import load, plan_job
from servogen.pulse.plan import plan
from servogen.report.text import BuildFacts, report_text

JOBS = Path(__file__).parents[2] / "jobs"


def report(name: str) -> str:
    job = plan_job(load(JOBS / f"{name}.toml"))
    return report_text(BuildFacts(job, "engine", plan(job.trajectory, job.servos, job.frame), (), ()))


@pytest.mark.parametrize(
    ("name", "end"),
    [("lab9-exercise", "foot"), ("scara-pick", "tool"), ("hexapod-tripod", "L1"), ("omni-square", "base")],
)
def test_a_robots_report_has_the_error_in_millimetres(name: str, end: str) -> None:
    text = report(name)
    section = text.split("Paths\n-----\n")[1].split("\n\n")[0].splitlines()
    assert section[0].startswith(f"The program's pulses put {end} up to ")
    assert section[1].split() == [
        "end",
        "worst_mm",
        "rms_mm",
        "frame",
        "time_s",
        "jacobian_worst_mm",
        "jacobian_rms_mm",
    ]
    assert section[2].split()[0] == end


def test_servos_without_a_robot_have_no_such_section() -> None:
    assert "Paths" not in report("lab8-exercise")
