"""The JSON schemas of the files that users write, for editors: jobs, robots, servos, labs and contracts.

In: nothing. Out: a schema of draft 7 for each, the newest that Taplo knows, with the docstrings of classes
and fields as descriptions. It is derived from the models (`Table`) that read the files, so that the two
cannot differ; what several keys mean together is only checked when a file is read.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue, models_json_schema
from pydantic_core import core_schema

from servogen.contract.clauses import ContractFile, PulseTable, SerialTable
from servogen.edges import PINS
from servogen.grade.lab import LabTable
from servogen.job.schema import ChipPairTable, JobTable
from servogen.kinematics import catalogue
from servogen.kinematics.registry import KINDS
from servogen.pic.device import DEVICES
from servogen.robot import servo_models
from servogen.robot.model import Arm
from servogen.robot.servo_models import ModelTable
from servogen.toml.file import Table

DRAFT = "http://json-schema.org/draft-07/schema#"

Schema = dict[str, Any]


def job_schema() -> Schema:
    """Return the schema of a job file; it completes names of the catalogue and allows all others."""
    schema = json_schema([JobTable], "servogen job")
    # One [chip], or two [[chip]], which the reader takes apart before it validates the job.
    tables, pair = schema["definitions"], json_schema([ChipPairTable], "pair")["definitions"]
    chips = tables["JobTable"]["properties"]
    both = {"type": "array", "items": {"$ref": "#/definitions/ChipPairTable"}, "minItems": 2, "maxItems": 2}
    chips["chip"] = {"anyOf": [chips["chip"], both]}
    schema["definitions"] = {**tables, **pair}
    known = {
        ("ChipTable", "device"): tuple(device.name for device in DEVICES),
        ("ChipPairTable", "device"): tuple(device.name for device in DEVICES),
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


def contract_schema() -> Schema:
    """Return the schema of a contract; it completes the names of pins."""
    schema = json_schema([ContractFile], "servogen contract")
    for table in (PulseTable, SerialTable):
        schema["definitions"][table.__name__]["properties"]["pin"] |= {"enum": list(PINS)}
    return schema


SCHEMAS: Mapping[str, Callable[[], Schema]] = MappingProxyType(
    {
        "job": job_schema,
        "robot": robot_schema,
        "servo": servo_schema,
        "lab": lab_schema,
        "contract": contract_schema,
    }
)
"""The kinds of files, and the function that returns the schema of each."""


def json_schema(models: Sequence[type[Table]], title: str) -> Schema:
    """Return the schema of a file that is one of `models`."""
    names, whole = models_json_schema(
        [(model, "validation") for model in models], schema_generator=_Generator, ref_template=_REF
    )
    definitions = {name: _plain(definition) for name, definition in whole["$defs"].items()}
    choices = [names[model, "validation"] for model in models]
    either: Schema = choices[0] if len(choices) == 1 else {"oneOf": choices}
    return {"$schema": DRAFT, "title": title, **either, "definitions": definitions}


_REF = "#/definitions/{model}"


class _Generator(GenerateJsonSchema):
    """Adds the docstrings below fields, which pydantic would only read while the model is made."""

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        schema_of_model = super().model_schema(schema)
        for name, text in field_docstrings(schema["cls"]).items():
            if name in schema_of_model.get("properties", {}):
                schema_of_model["properties"][name].setdefault("description", text)
        return schema_of_model


def field_docstrings(model: type[BaseModel]) -> dict[str, str]:
    """Return the docstrings below the fields of a model and of those that it inherits from."""
    texts: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if not issubclass(base, Table) or base is Table:
            continue
        (definition,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        body = definition.body if isinstance(definition, ast.ClassDef) else []
        for field, below in pairwise(body):
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                match below:
                    case ast.Expr(ast.Constant(str(text))):
                        texts[field.target.id] = inspect.cleandoc(text)
    return texts


def _plain(schema: Any) -> Any:
    """Return a schema without what TOML does not have (null) and as draft 7 spells it; arrays as tuples."""
    if isinstance(schema, list):
        return [_plain(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    plain = {key: _plain(value) for key, value in schema.items()}
    if isinstance(plain.get("title"), str):
        del plain["title"]  # the key again, in other letters
    if plain.get("default", 0) is None or isinstance(plain.get("default"), dict):
        del plain["default"]
    if "prefixItems" in plain:
        plain["items"] = plain.pop("prefixItems")
        plain["additionalItems"] = False
    choices = [choice for choice in plain.get("anyOf", []) if choice != {"type": "null"}]
    if len(choices) == 1:
        del plain["anyOf"]
        plain = {**choices[0], **plain}
    if "$ref" in plain and len(plain) > 1:  # in draft 7 a reference stands alone
        plain["allOf"] = [{"$ref": plain.pop("$ref")}]
    return plain
