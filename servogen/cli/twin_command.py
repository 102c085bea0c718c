"""`servogen twin`: whether the simulated robot does what its job plans."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.files import check_outputs
from servogen.cli.options import Json, StimulusFile
from servogen.cli.show import as_json, next_step, status, table, warn_of_all
from servogen.job import load, plan_job
from servogen.outputs import write_text
from servogen.report.film import SUFFIXES as FILM_SUFFIXES
from servogen.report.film import film as write_film
from servogen.report.pictures import SUFFIXES, check_suffix
from servogen.simulator import load_stimuli
from servogen.twin import Ground, TwinSettings, TwinVerdict
from servogen.twin.pictures import check_rows, comparison_rows, csv_text, servo_rows, twin_plot, twin_scene
from servogen.workflows.twinning import twin_of


@dataclass(frozen=True, slots=True)
class GroundOptions:
    """The ground."""

    friction: Annotated[float, "Coefficient of friction of the ground."] = 0.8
    slope_deg: Annotated[float, "Slope of the ground, rising forward."] = 0.0
    step_mm: Annotated[float, "Height of a step 150 mm ahead."] = 0.0
    rough_mm: Annotated[float, "Height of random bumps."] = 0.0
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random bumps.")] = 1


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What is run, and for how long."""

    hexfile: Annotated[
        Path | None, typer.Option("--hex", help="The program to run (default: the job's, compiled).")
    ] = None
    broken: Annotated[list[str] | None, "A servo with a broken gear (repeatable)."] = None
    unplugged: Annotated[list[str] | None, "A servo that receives no pulses (repeatable)."] = None
    loops: Annotated[int, typer.Option(min=1, help="How many times the motion is played.")] = 1
    seconds: Annotated[
        float | None, typer.Option(min=0, help="Duration from power-up, instead of --loops.")
    ] = None
    stimulus: StimulusFile = None


@dataclass(frozen=True, slots=True)
class TwinFiles:
    """The files to write."""

    picture: Annotated[
        Path | None, typer.Option("--plot", help="Draw path, torques, supply and feet: .png, .svg or .pdf.")
    ] = None
    film: Annotated[Path | None, "Write an animation of the robot: .gif or .mp4 (needs ffmpeg)."] = None
    csv: Annotated[Path | None, "Write one row per 5 ms."] = None


def twin(
    job: Annotated[Path, typer.Argument(help="A job file (TOML).", show_default=False)],
    run: RunOptions,
    ground: GroundOptions,
    files: TwinFiles,
    json: Json = False,
) -> None:
    """Simulate the robot that a job's HEX drives: motors, supply, bodies and contacts (needs MuJoCo)."""
    check_outputs(
        [path for path in (job, run.hexfile, run.stimulus) if path], files.picture, files.film, files.csv
    )
    for path, suffixes, kind in ((files.picture, SUFFIXES, "picture"), (files.film, FILM_SUFFIXES, "film")):
        if path:
            check_suffix(path, suffixes, kind)
    settings = TwinSettings(
        ground=Ground(
            ground.friction,
            math.radians(ground.slope_deg),
            ground.step_mm / 1000,
            rough=ground.rough_mm / 1000,
            seed=ground.seed,
        ),
        broken=tuple(run.broken or ()),
        unplugged=tuple(run.unplugged or ()),
        seconds=run.seconds,
        loops=run.loops,
    )
    loaded = plan_job(load(job))
    stimuli = load_stimuli(run.stimulus, loaded.clock) if run.stimulus else None
    with status(f"{loaded.name}: planning") as tell:
        verdict = twin_of(loaded, settings, run.hexfile, stimuli, lambda step: tell(f"{loaded.name}: {step}"))
        if files.csv:
            write_text(files.csv, csv_text(verdict))
        if files.picture:
            twin_plot(verdict, loaded.name, files.picture)
        if files.film:
            write_film(twin_scene(verdict, loaded.name), files.film)
    if json:
        as_json({"job": loaded.name, **verdict.to_json()}, loaded.warnings)
    else:
        _show(verdict, str(job))
        if files.csv or files.picture or files.film:
            print(next_step("watch", job))
        warn_of_all(loaded.warnings)
    raise typer.Exit(0 if verdict.passed else 1)


def _show(verdict: TwinVerdict, name: str) -> None:
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
