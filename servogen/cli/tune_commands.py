"""`servogen tune`: C whose pulses are exact under the compiler that made a HEX."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.files import keep_apart, read_image
from servogen.cli.options import Dialect, Json
from servogen.cli.show import as_json, status, table
from servogen.programs import dialect_of, read_source


def register(app: typer.Typer) -> None:
    app.command()(tune)


def tune(
    job: Annotated[Path, typer.Argument(help="A job file.", show_default=False)],
    hex_file: Annotated[
        Path, typer.Option("--hex", help="What the other compiler made.", show_default=False)
    ],
    c_file: Annotated[
        Path | None, typer.Option("--c", help="The C it was made of. Default: the one that build writes.")
    ] = None,
    dialect: Annotated[
        Dialect | None, typer.Option("--dialect", help="Default: that of the C, else the job's.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The next C. Default: the C's name with the next number."),
    ] = None,
    json: Json = False,
) -> None:
    """Measure what another compiler adds between a sequence job's edges, and write C that makes up for it.

    Compile that C and call tune again with it as --c. Exit code 0: the HEX is 0 cycles off; 1: not yet, the
    next C is written.
    """
    from servogen.build.retarget import tune_to
    from servogen.compiler import Source
    from servogen.job import load, plan_job
    from servogen.outputs import write_text
    from servogen.verify import verdict_lines

    loaded = plan_job(load(job))
    text = read_source(c_file) if c_file else ""
    spoken = dialect.value if dialect else dialect_of([text]) if c_file else loaded.firmware.dialect
    with status(f"{loaded.name}: measuring {hex_file.name}"):
        source = Source(text, str(c_file)) if c_file else None
        found = tune_to(loaded, read_image(hex_file), str(hex_file), spoken, source)
    target = output or _next(c_file or hex_file.parent / f"main.{spoken}.c")
    keep_apart([job, hex_file, *([c_file] if c_file else [])], target)
    if found.source:
        write_text(target, found.source)
    if json:
        as_json(
            {
                "job": loaded.name,
                "dialect": spoken,
                "next_c": str(target) if found.source else None,
                **found.to_json(),
            }
        )
    else:
        rows = [(each.way, each.theirs, each.ours) for each in found.added]
        table("Cycles beside the delays", ("way", hex_file.name, "servogen"), rows)
        for line in verdict_lines(found.verdict):
            print(line)
        if found.source:
            print(f"not exact yet: compile {target}, then servogen tune {job} --hex … --c {target}")
        else:
            print(f"{hex_file}: 0 cycles off")
    raise typer.Exit(0 if found.verdict.proven else 1)


def _next(c_file: Path) -> Path:
    """main.xc8.c is followed by main.xc8.1.c, and that by main.xc8.2.c."""
    name, _, number = c_file.stem.rpartition(".")
    if name and number.isdigit():
        return c_file.with_name(f"{name}.{int(number) + 1}.c")
    return c_file.with_name(f"{c_file.stem}.1.c")
