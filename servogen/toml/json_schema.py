"""JSON schemas of TOML files, for editors: a model (`Table`) -> the schema that accepts what it accepts.

In: models, of which a file is any one. Out: a schema of draft 7, the newest that Taplo knows, with the
docstrings of classes and fields as descriptions. It is derived from the model that reads the file, so that
the two cannot differ; what several keys mean together is only checked when the file is read.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue, models_json_schema
from pydantic_core import core_schema

from servogen.toml.file import Table

DRAFT = "http://json-schema.org/draft-07/schema#"

Schema = dict[str, Any]


def json_schema(models: Sequence[type[Table]], title: str) -> Schema:
    """Return the schema of a file that is one of `models`."""
    names, whole = models_json_schema(
        [(model, "validation") for model in models], schema_generator=_Generator, ref_template=_REF
    )
    definitions = {name: _plain(each) for name, each in whole["$defs"].items()}
    choices = [names[model, "validation"] for model in models]
    either: Schema = choices[0] if len(choices) == 1 else {"oneOf": choices}
    return {"$schema": DRAFT, "title": title, **either, "definitions": definitions}


_REF = "#/definitions/{model}"


class _Generator(GenerateJsonSchema):
    """Adds the docstrings below fields, which pydantic would only read while the model is made."""

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        made = super().model_schema(schema)
        for name, text in field_docstrings(schema["cls"]).items():
            if name in made.get("properties", {}):
                made["properties"][name].setdefault("description", text)
        return made


def field_docstrings(model: type[BaseModel]) -> dict[str, str]:
    """Return the docstrings below the fields of a model and of those that it inherits from."""
    found: dict[str, str] = {}
    for each in reversed(model.__mro__):
        if not issubclass(each, Table) or each is Table:
            continue
        (definition,) = ast.parse(textwrap.dedent(inspect.getsource(each))).body
        body = definition.body if isinstance(definition, ast.ClassDef) else []
        for field, below in pairwise(body):
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                match below:
                    case ast.Expr(ast.Constant(str(text))):
                        found[field.target.id] = inspect.cleandoc(text)
    return found


def _plain(schema: Any) -> Any:
    """Return a schema without what TOML does not have (null) and as draft 7 spells it; arrays as tuples."""
    if isinstance(schema, list):
        return [_plain(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    made = {key: _plain(value) for key, value in schema.items()}
    if isinstance(made.get("title"), str):
        del made["title"]  # the key again, in other letters
    if made.get("default", 0) is None or isinstance(made.get("default"), dict):
        del made["default"]
    if "prefixItems" in made:
        made["items"] = made.pop("prefixItems")
        made["additionalItems"] = False
    choices = [each for each in made.get("anyOf", []) if each != {"type": "null"}]
    if len(choices) == 1:
        del made["anyOf"]
        made = {**choices[0], **made}
    if "$ref" in made and len(made) > 1:  # in draft 7 a reference stands alone
        made["allOf"] = [{"$ref": made.pop("$ref")}]
    return made
