"""`servogen schema`: the JSON schemas of the files that users write, for editors."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Annotated

import typer

from servogen.cli.options import Output
from servogen.outputs import write_text
from servogen.workflows.output_schema import output_schema
from servogen.workflows.schemas import SCHEMAS


class FileKind(StrEnum):
    """The files that have a schema, and what commands print."""

    job = "job"
    robot = "robot"
    servo = "servo"
    lab = "lab"
    contract = "contract"
    output = "output"


def schema(
    kind: Annotated[FileKind, typer.Argument(help="The kind of file, or output.", show_default=False)],
    output: Output = None,
) -> None:
    """Print the JSON schema of a kind of file; editors complete and check with it. Or that of all outputs."""
    made = output_schema() if kind is FileKind.output else SCHEMAS[kind]()
    text = json.dumps(made, indent=2) + "\n"
    if output is None:
        print(text, end="")
    else:
        write_text(output, text)
        if kind is not FileKind.output:
            first = f'"#:schema {output}" as the first line of a file, in an editor'
            print(f"{output}: the schema; next: {first}")
