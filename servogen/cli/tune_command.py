"""`servogen tune`: a sequence job's delays for another compiler."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.files import check_outputs, read_image
from servogen.cli.options import Dialect, JobFile, Json
from servogen.cli.show import as_json, status, table
from servogen.compiler import Source
from servogen.job import load, plan_job
from servogen.outputs import write_text
from servogen.programs import beside_c, dialect_of, included_names, read_source
from servogen.verify import verdict_lines
from servogen.workflows.retarget import tune_to


@dataclass(frozen=True, slots=True)
class CompiledElsewhere:
    """What the other compiler made, and of what."""

    hex_file: Annotated[
        Path, typer.Option("--hex", help="The HEX file that the other compiler made.", show_default=False)
    ]
    c_file: Annotated[
        Path | None,
        typer.Option("--c", help="The C that it was compiled from (default: the file that build writes)."),
    ] = None
    dialect: Annotated[Dialect | None, "The C dialect (default: that of the C, else the job's)."] = None


def tune(
    job: JobFile,
    foreign: CompiledElsewhere,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="The corrected C to write (default: the C's name with the next number)."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Measure the cycles that another compiler adds between a sequence job's edges, and write corrected C.

    Compile that C and run tune again with it as --c. Exit code 0: every edge of the HEX is exact; 1: not yet,
    and the next C has been written.
    """
    loaded = plan_job(load(job))
    text = read_source(foreign.c_file) if foreign.c_file else ""
    spoken = (
        foreign.dialect.value
        if foreign.dialect
        else dialect_of(included_names([(str(foreign.c_file), text)], beside_c))
        if foreign.c_file
        else loaded.firmware.dialect
    )
    with status(f"{loaded.name}: measuring {foreign.hex_file.name}"):
        source = Source(text, str(foreign.c_file)) if foreign.c_file else None
        tuned = tune_to(loaded, read_image(foreign.hex_file), str(foreign.hex_file), spoken, source)
    target = output or _next_c_file(foreign.c_file or foreign.hex_file.parent / f"main.{spoken}.c")
    check_outputs([job, foreign.hex_file, *([foreign.c_file] if foreign.c_file else [])], target)
    if tuned.source:
        write_text(target, tuned.source)
    if json:
        as_json(
            {
                "job": loaded.name,
                "dialect": spoken,
                "next_c": str(target) if tuned.source else None,
                **tuned.to_json(),
            }
        )
    else:
        rows = [(overhead.path, overhead.theirs, overhead.ours) for overhead in tuned.added]
        table("Cycles beside the delays", ("path", foreign.hex_file.name, "servogen"), rows)
        for line in verdict_lines(tuned.verdict):
            print(line)
        if tuned.source:
            print(f"not exact yet: compile {target}, then servogen tune {job} --hex … --c {target}")
        else:
            print(f"{foreign.hex_file}: 0 cycles off")
    raise typer.Exit(0 if tuned.verdict.passed else 1)


def _next_c_file(c_file: Path) -> Path:
    """Return the name after this one: main.xc8.1.c after main.xc8.c, main.xc8.2.c after that."""
    name, _, number = c_file.stem.rpartition(".")
    if name and number.isdecimal():
        return c_file.with_name(f"{name}.{int(number) + 1}.c")
    return c_file.with_name(f"{c_file.stem}.1.c")
