"""`servogen schema`: the JSON schemas of the files that users write, and of what commands print."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Annotated

import typer

from servogen.cli.options import Output
from servogen.errors import InputError, did_you_mean
from servogen.outputs import write_text
from servogen.workflows.output_schema import OUTPUTS, output_schema
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
    command: Annotated[
        str | None,
        typer.Argument(help="With output: the command (default: a definition for each).", show_default=False),
    ] = None,
    output: Output = None,
) -> None:
    """Print the JSON schema of a kind of file, with which editors complete and check, or of what a command
    prints with --json.
    """
    if command is not None and kind is not FileKind.output:
        raise InputError("conflicting-options", f"a {kind} file is no command's: omit '{command}'")
    if command is not None and command not in OUTPUTS:
        hint = did_you_mean(command, OUTPUTS)
        raise InputError("unknown-name", f"'{command}' is no command with --json", hint=hint)
    made = output_schema(command) if kind is FileKind.output else SCHEMAS[kind]()
    text = json.dumps(made, indent=2) + "\n"
    if output is None:
        print(text, end="")
    else:
        write_text(output, text)
        if kind is not FileKind.output:
            first = f'"#:schema {output}" as the first line of a file, in an editor'
            print(f"{output}: the schema; next: {first}")
