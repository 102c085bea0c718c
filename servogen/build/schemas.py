"""The JSON schemas of the files that users write: jobs, robots, servos and labs.

In: nothing. Out: a schema for each, from the models and tables that read the files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from servogen.grade.lab import LabTable
from servogen.job.schema import JobTable
from servogen.kinematics import catalogue
from servogen.kinematics.registry import KINDS
from servogen.pic.device import DEVICES
from servogen.robot import servo_models
from servogen.robot.model import Arm
from servogen.robot.servo_models import ModelTable
from servogen.toml.json_schema import Schema, json_schema


def job_schema() -> Schema:
    """Return the schema of a job file; it completes names of the catalogue and allows all others."""
    schema = json_schema([JobTable], "servogen job")
    known = {
        ("ChipTable", "device"): tuple(device.name for device in DEVICES),
        ("ServoTable", "model"): servo_models.names(),
        ("RobotTable", "name"): catalogue.names(),
    }
    for (table, key), names in known.items():
        schema["definitions"][table]["properties"][key] |= {
            "anyOf": [{"enum": list(names)}, {"type": "string"}]
        }
    return schema


def robot_schema() -> Schema:
    """Return the schema of a robot file: that of the kind that its key `kind` names; without one, an arm."""
    schema = json_schema([kind.table for kind in KINDS.values()], "servogen robot")
    for name, kind in KINDS.items():
        table = schema["definitions"][kind.table.__name__]
        table["properties"]["kind"] = {"const": name, "type": "string"}
        if name != Arm.kind:
            table["required"] = [*table["required"], "kind"]
    return schema


def servo_schema() -> Schema:
    """Return the schema of a servo file."""
    return json_schema([ModelTable], "servogen servo")


def lab_schema() -> Schema:
    """Return the schema of a lab file."""
    return json_schema([LabTable], "servogen lab")


SCHEMAS: Mapping[str, Callable[[], Schema]] = MappingProxyType(
    {"job": job_schema, "robot": robot_schema, "servo": servo_schema, "lab": lab_schema}
)
"""The kinds of files, and the function that returns the schema of each."""
