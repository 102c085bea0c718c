"""`servogen schema`: the JSON schemas of the files that users write, for editors."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Annotated

import typer

from servogen.cli.options import Output
from servogen.outputs import write_text
from servogen.workflows.schemas import SCHEMAS


class FileKind(StrEnum):
    """The files that have a schema."""

    job = "job"
    robot = "robot"
    servo = "servo"
    lab = "lab"


def schema(
    kind: Annotated[FileKind, typer.Argument(help="The kind of file.", show_default=False)],
    output: Output = None,
) -> None:
    """Print the JSON schema of a kind of file; editors complete and check with it."""
    text = json.dumps(SCHEMAS[kind](), indent=2) + "\n"
    if output is None:
        print(text, end="")
    else:
        write_text(output, text)
        print(f'{output}: the schema; next: "#:schema {output}" as the first line of a file, in an editor')
