"""`servogen report`: one HTML page of a job, for people."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.options import CaptureRate, Json, Partial
from servogen.cli.show import as_json, status


def register(app: typer.Typer) -> None:
    app.command()(report)


def report(
    job: Annotated[Path, typer.Argument(help="A job file (TOML).", show_default=False)],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The page (default: the job's name with .html).")
    ] = None,
    capture: Annotated[
        Path | None,
        typer.Option("--capture", help="An analyser's capture to show beside the plan: .vcd, .sr, .csv."),
    ] = None,
    rate: CaptureRate = None,
    partial: Partial = False,
    json: Json = False,
) -> None:
    """Build and prove a job and write one HTML page of it, which needs no network."""
    from servogen.build.reporting import page_of
    from servogen.errors import InputError, Location
    from servogen.job import load, plan_job
    from servogen.outputs import write_text
    from servogen.plan_error import plan_words
    from servogen.verify import capture_lines

    if rate is not None and capture is None:
        raise InputError(
            "conflicting-options", "only a capture has a sampling rate", Location(str(job), key="--rate")
        )
    loaded = plan_job(load(job))
    target = output or Path(f"{loaded.name}.html")
    with status(f"{loaded.name}: planning") as tell:
        page = page_of(loaded, capture, lambda step: tell(f"{loaded.name}: {step}"), rate)
    write_text(target, page.html)
    if json:
        as_json({"file": str(target), **page.to_json()}, [page.not_built] if page.not_built else [])
    elif page.not_built:
        print(page.not_built.message)
        print(f"{target}: the plan; {plan_words(page.plan_error)}")
    else:
        said = "proven" if page.programs_proven else "NOT PROVEN"
        said = f"programs {said}" if page.capture else said
        print(f"{target}: {said}; {plan_words(page.plan_error)}")
    if page.capture and not json:
        print(f"{capture}: {capture_lines(page.capture)[0]}")
    found = page.capture
    right = found is None or found.accepted(partial)
    raise typer.Exit(0 if right and (page.programs_proven or page.not_built) else 1)
