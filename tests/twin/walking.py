"""Jobs of the six-legged robot for the twin's tests, planned and compiled once each."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from servogen.job import PlannedJob, loads, plan_job
from servogen.kinematics.hexapod import feet
from servogen.motion.gait.quasistatic import rigid_body_path
from servogen.pic.image import Image
from servogen.twin import TwinSettings, TwinVerdict
from servogen.workflows.engines import PlayedJob, planned
from servogen.workflows.twinning import twin_of_image

JOBS = Path(__file__).parent.parent.parent / "jobs"


@dataclass(frozen=True)
class Firmware:
    """A planned job, as its engine plays it, and its program."""

    job: PlannedJob
    found: PlayedJob
    image: Image

    def with_motor(self, **facts: float) -> Firmware:
        """Return the same with other facts of all servos' motors."""
        servos = tuple(
            replace(each, model=replace(each.model, motor=replace(each.model.motor, **facts)))  # type: ignore[arg-type]
            for each in self.job.servos
        )
        found = replace(self.found, job=replace(self.found.job, servos=servos))
        return Firmware(replace(self.job, servos=servos), found, self.image)

    def twin(self, settings: TwinSettings | None = None, **robot: Any) -> TwinVerdict:
        """Return what the robot does; `robot` replaces facts of it."""
        job, found = self.job, self.found
        if robot:
            job = replace(job, robot=replace(job.robot, **robot))  # type: ignore[type-var]
            found = replace(found, job=replace(found.job, robot=job.robot))
        return twin_of_image(job, found.job, found.plan.schedule, self.image, settings or TwinSettings())


@cache
def walking(
    route: str, gait: str = "tripod", height: float = 130, extra: str = "", *, compensate: bool = True
) -> Firmware:
    """Return the firmware of a walk along `route`, the segments of [walk] route."""
    return firmware(text_of(route, gait, height, extra, compensate=compensate))


def text_of(
    route: str, gait: str = "tripod", height: float = 130, extra: str = "", *, compensate: bool = True
) -> str:
    """Return the job of a walk."""
    text = (JOBS / "hexapod-tripod.toml").read_text()
    text = re.sub(r"^body_height_mm = .*\n", "", text, flags=re.M)
    text = re.sub(r"route = .*", f"route = [{route}]\nbody_height_mm = {height:g}", text)
    text = text.replace('gait = "tripod"', f'gait = "{gait}"')
    text = text if compensate else text.replace("[walk]", "[walk]\ncompensate = false")
    text = text.replace("[firmware]", "[firmware]\nsoft_start_s = 0.3")
    return text + extra


@cache
def firmware(text: str) -> Firmware:
    """Return the firmware of a job's text; files that it names are in jobs/."""
    job = plan_job(loads(text, str(JOBS / "test.toml")))
    found = planned(job)
    return Firmware(job, found, found.make(job.firmware.dialect).compilation.image)


AHEAD = "{ forward_mm = 40, cycles = 2 }"
SUPPLIED = "\n[supply]\nvoltage_v = 5.0\nresistance_ohm = 0.1\n"

WALK = "{ forward_mm = 40, cycles = 4 }"
TURN = "{ turn_deg = 20, cycles = 9 }"
CURVE = "{ forward_mm = 30, turn_deg = 10, cycles = 9 }"


@cache
def went_ahead() -> TwinVerdict:
    """Return what a supplied robot does that walks `AHEAD`."""
    return walking(AHEAD, extra=SUPPLIED).twin()


def rigid_end(verdict: TwinVerdict) -> tuple[float, float, float]:
    """Return x, y and yaw to which rigid legs with the joint angles of the physics would take the body."""
    rig, record = verdict.record.rig, verdict.record
    angles = record.angle[record.first :: 4]
    joints = [each.position(angles[:, index]) for index, each in enumerate(rig.bindings)]
    legs = feet(rig.robot, np.stack(joints, axis=1).reshape(len(angles), -1, 2))  # type: ignore[arg-type]
    x, y, yaw = rigid_body_path(legs, (0.0, 0.0)).pose[-1].tolist()
    return x, y, yaw
