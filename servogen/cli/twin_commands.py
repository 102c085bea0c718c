"""`servogen twin`: whether the simulated robot does what its job plans."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json, StimulusFile
from servogen.cli.show import as_json, status, table, warn_of_all

if TYPE_CHECKING:
    from servogen.twin import TwinVerdict


def register(app: typer.Typer) -> None:
    app.command()(twin)


def twin(
    job: Annotated[Path, typer.Argument(help="A job file (TOML).", show_default=False)],
    hexfile: Annotated[
        Path | None, typer.Option("--hex", help="The program to run (default: the job's, compiled).")
    ] = None,
    friction: Annotated[
        float, typer.Option("--friction", help="Coefficient of friction of the ground.")
    ] = 0.8,
    slope_deg: Annotated[
        float, typer.Option("--slope-deg", help="Slope of the ground, rising forward.")
    ] = 0.0,
    step_mm: Annotated[float, typer.Option("--step-mm", help="Height of a step 150 mm ahead.")] = 0.0,
    rough_mm: Annotated[float, typer.Option("--rough-mm", help="Height of random bumps.")] = 0.0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random bumps.")] = 1,
    broken: Annotated[
        list[str] | None, typer.Option("--broken", help="A servo with a broken gear (repeatable).")
    ] = None,
    unplugged: Annotated[
        list[str] | None, typer.Option("--unplugged", help="A servo that receives no pulses (repeatable).")
    ] = None,
    loops: Annotated[int, typer.Option("--loops", min=1, help="How many times the motion is played.")] = 1,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0, help="Duration from power-up, instead of --loops.")
    ] = None,
    stimulus: StimulusFile = None,
    picture: Annotated[
        Path | None,
        typer.Option("--plot", help="Draw path, torques, supply and feet: .png, .svg or .pdf."),
    ] = None,
    film: Annotated[
        Path | None,
        typer.Option("--film", help="Write an animation of the robot: .gif or .mp4 (needs ffmpeg)."),
    ] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write one row per 5 ms.")] = None,
    json: Json = False,
) -> None:
    """Simulate the robot that a job's HEX drives: motors, supply, bodies and contacts (needs MuJoCo)."""
    from servogen.cli.files import keep_apart
    from servogen.job import load, plan_job
    from servogen.outputs import write_text
    from servogen.report.film import SUFFIXES as FILM_SUFFIXES
    from servogen.report.pictures import SUFFIXES, check_suffix
    from servogen.simulator import load_stimuli
    from servogen.twin import Ground, TwinSettings
    from servogen.twin.pictures import csv_text, twin_plot, twin_scene
    from servogen.workflows.twinning import twin_of

    keep_apart([path for path in (job, hexfile, stimulus) if path], picture, film, csv)
    for path, suffixes, kind in ((picture, SUFFIXES, "picture"), (film, FILM_SUFFIXES, "film")):
        if path:
            check_suffix(path, suffixes, kind)
    loaded = plan_job(load(job))
    settings = TwinSettings(
        ground=Ground(friction, math.radians(slope_deg), step_mm / 1000, rough=rough_mm / 1000, seed=seed),
        broken=tuple(broken or ()),
        unplugged=tuple(unplugged or ()),
        seconds=seconds,
        loops=loops,
    )
    stimuli = load_stimuli(stimulus, loaded.clock) if stimulus else None
    with status(f"{loaded.name}: planning") as tell:
        verdict = twin_of(loaded, settings, hexfile, stimuli, lambda step: tell(f"{loaded.name}: {step}"))
        if csv:
            write_text(csv, csv_text(verdict))
        if picture:
            twin_plot(verdict, loaded.name, picture)
        if film:
            from servogen.report.film import film as write_film

            write_film(twin_scene(verdict, loaded.name), film)
    if json:
        as_json({"job": loaded.name, **verdict.to_json()}, loaded.warnings)
    else:
        _show(verdict, str(job))
        warn_of_all(loaded.warnings)
    raise typer.Exit(0 if verdict.passed else 1)


def _show(verdict: TwinVerdict, name: str) -> None:
    from servogen.twin.pictures import check_rows, comparison_rows, servo_rows

    table(
        "Planned and simulated",
        ("what", "asked", "rigid legs, ideal wheels", "simulated"),
        list(comparison_rows(verdict)),
    )
    table("Servos", ("servo", "peak N·m", "stall N·m", "rms N·m", "lag °"), list(servo_rows(verdict)))
    if verdict.checks:
        rows = list(check_rows(verdict))
        table("Expectations", ("what", "measured", "allowed", "unit", ""), rows)
    for text in (*verdict.record.bodies.assumptions, *verdict.record.rig.assumptions):
        print(f"assumed: {text}")
    for event in verdict.events:
        print(f"{event.seconds:.2f} s: {event.text}")
    for reason in verdict.reasons():
        print(reason)
    if verdict.missed:
        print(verdict.missed)
    word = verdict.word if verdict.judged else f"{verdict.word}: the job has no [expect]"
    print(f"{name}: {word}; {verdict.record.settings.ground.text()}")
