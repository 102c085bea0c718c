"""`servogen report`: the page about a job."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.options import CaptureRate, JobFile, Json, Partial, RecordedWires
from servogen.cli.show import as_json, next_step, status
from servogen.errors import InputError, Location
from servogen.job import PlannedJob, load, plan_job
from servogen.outputs import write_text
from servogen.plan_error import plan_text
from servogen.traces.channels import parse_wires
from servogen.verify import capture_lines
from servogen.workflows.pair import build_pair, pair_html
from servogen.workflows.reporting import build_page


@dataclass(frozen=True, slots=True)
class ReportedCapture:
    """The capture beside the plan."""

    capture: Annotated[
        Path | None, "A logic analyser's capture to show beside the plan: .vcd, .sr or .csv."
    ] = None
    rate: CaptureRate = None
    wire: RecordedWires = None
    partial: Partial = False


def report(
    job: JobFile,
    recording: ReportedCapture,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The page to write (default: the job's name with .html)."),
    ] = None,
    twin: Annotated[bool, "Also simulate the robot's physics (needs MuJoCo)."] = False,
    json: Json = False,
) -> None:
    """Build a job, run it and write a self-contained HTML page about it."""
    for given, key, what in (
        (recording.rate, "--rate", "a sampling rate"),
        (recording.wire, "--wire", "wires"),
    ):
        if given and recording.capture is None:
            text = f"only a capture has {what}"
            raise InputError("conflicting-options", text, Location(str(job), key=key))
    loaded = plan_job(load(job))
    target = output or Path(f"{loaded.name}.html")
    if loaded.chips:
        raise typer.Exit(_report_pair(loaded, target, recording.capture is not None or twin, json))
    with status(f"{loaded.name}: planning") as tell:
        page = build_page(
            loaded,
            recording.capture,
            lambda step: tell(f"{loaded.name}: {step}"),
            recording.rate,
            twin,
            parse_wires(recording.wire or ()),
        )
    write_text(target, page.html)
    if json:
        as_json({"file": str(target), **page.to_json()}, [page.not_built] if page.not_built else [])
    elif page.not_built:
        print(page.not_built.message)
        print(f"{target}: the plan; {plan_text(page.plan_error)}")
    else:
        verdict = "exact" if page.programs_exact else "NOT EXACT"
        verdict = f"programs {verdict}" if page.capture else verdict
        print(f"{target}: {verdict}; {plan_text(page.plan_error)}")
    if page.capture and not json:
        print(f"{recording.capture}: {capture_lines(page.capture)[0]}")
    if page.twin and not json:
        print(f"twin: {page.twin.word}")
        for reason in page.twin.reasons():
            print(reason)
    if not json:
        print(f"next: open {target} in a browser, or {next_step('watch', job).removeprefix('next: ')}")
    recorded = page.capture
    right = (recorded is None or recorded.accepted(recording.partial)) and (
        page.twin is None or page.twin.passed
    )
    raise typer.Exit(0 if right and (page.programs_exact or page.not_built) else 1)


def _report_pair(job: PlannedJob, target: Path, more: bool, json: bool) -> int:
    """Build both chips of a job, write their page and return the exit code."""
    if more:
        message = "the page of two chips shows their wiring and programs, no capture and no twin"
        hint = "servogen verify CAPTURE --against build/JOB; servogen twin JOB.toml"
        raise InputError("chip-pair", message, job.document.place("chip"), hint)
    with status(f"{job.name}: planning") as tell:
        result = build_pair(job, lambda step: tell(f"{job.name}: {step}"))
    write_text(target, pair_html(result))
    if json:
        as_json({"file": str(target), **result.to_json()}, job.warnings)
    else:
        print(f"{target}: both chips {'exact' if result.exact else 'NOT EXACT'} in one run")
    return 0 if result.exact else 1
