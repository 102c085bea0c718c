"""Commands of planned motion: plan."""

from __future__ import annotations

import re
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json
from servogen.cli.show import as_json, status, table, warn_of_all
from servogen.units import counted

if TYPE_CHECKING:
    from servogen.job import PlannedJob
    from servogen.pulse.plan import PulsePlan
    from servogen.report.servo_facts import ServoFacts
    from servogen.report.tool_error import EndError
    from servogen.report.tracks import Track

Plot = Annotated[Path | None, typer.Option("--plot", help="Draw it: .png, .svg or .pdf.")]
Animate = Annotated[Path | None, typer.Option("--animate", help="Film the robot: .gif or .mp4 (ffmpeg).")]
Csv = Annotated[Path | None, typer.Option("--csv", help="Write a row a frame.")]


def register(app: typer.Typer) -> None:
    app.command()(plan)


def plan(
    job: Annotated[Path, typer.Argument(help="A job file (TOML).", show_default=False)],
    picture: Plot = None,
    csv: Csv = None,
    animate: Animate = None,
    json: Json = False,
) -> None:
    """Say what a job will do without building it: frames, servos, paths, the error of the pulses."""
    from servogen.job import load, plan_job
    from servogen.outputs import atomic_write
    from servogen.report.motion_table import frame_lines
    from servogen.report.servo_facts import facts_of
    from servogen.report.tool_error import errors_of
    from servogen.report.tracks import tracks_of

    with status("planning"):
        loaded, made = _planned(plan_job(load(job)))
    tracks = tracks_of(loaded, made.schedule)
    if csv:
        with atomic_write(csv) as file:
            file.writelines(f"{line}\n" for line in frame_lines(loaded, made.schedule, tracks))
    if picture:
        from servogen.report.motion_plot import motion_plot

        motion_plot(loaded, made.schedule, tracks, picture)
    if animate:
        from servogen.report.film import film
        from servogen.report.scenes import job_scene

        with status(f"filming {animate}"):
            film(job_scene(loaded), animate)
    facts, errors = facts_of(loaded), errors_of(tracks)
    if json:
        as_json(_plan_dict(loaded, made, facts, tracks, errors))
    else:
        _show_plan(loaded, made, facts, tracks, errors)


def _planned(job: PlannedJob) -> tuple[PlannedJob, PulsePlan]:
    """Every pulse as near as whole cycles are; where that fits no frame, as the job's engine makes them."""
    from servogen.build import planned as engines_plan
    from servogen.errors import InputError
    from servogen.pulse.plan import plan as nearest_pulses

    try:
        return job, nearest_pulses(job.trajectory, job.servos, job.frame)
    except InputError:
        found = engines_plan(job)
        return found.job, found.plan


def _show_plan(
    job: PlannedJob,
    made: PulsePlan,
    facts: tuple[ServoFacts, ...],
    tracks: tuple[Track, ...],
    errors: tuple[EndError, ...],
) -> None:
    from servogen.report.tool_error import worst_of

    _show_servos(job, facts)
    frame_s = _seconds(made, 1)
    if errors:
        _show_ends(tracks, errors, frame_s)
    for note in job.notes:
        print(note.text)
    schedule = made.schedule
    if errors:
        worst = worst_of(errors)
        print(
            f"error of the pulses: at worst {1000 * worst.worst_m:z.3f} mm, "
            f"{worst.name} in frame {worst.frame} ({worst.frame * frame_s:.6g} s)"
        )
    parts = [("lead-in", schedule.lead_in_frames), ("loop", schedule.loop_frames)]
    text = ", ".join(
        f"{name} of {counted(frames, 'frame')}, {_seconds(made, frames):g} s"
        for name, frames in parts
        if frames
    )
    print(f"{job.file}: {counted(len(job.servos), 'servo')}, {text}")
    warn_of_all((*job.warnings, *made.warnings))


def _show_servos(job: PlannedJob, facts: tuple[ServoFacts, ...]) -> None:
    joints = {binding.servo: binding.joint for binding in job.bindings}
    rows = []
    for each in facts:
        model, unit = each.servo.model, each.servo.model.unit
        rows.append(
            (
                each.servo.name,
                joints.get(each.servo.name, ""),
                f"{degrees(each.least):z.2f} to {degrees(each.greatest):z.2f}{unit}",
                " to ".join(f"{degrees(limit):zg}" for limit in each.servo.limits) + unit,
                _degrees(each.speed),
                _degrees(model.speed),
                "" if each.speed_frame is None else each.speed_frame,
                _degrees(each.step),
                _number(each.step_needs_s),
                _number(each.step_s),
            )
        )
    table(
        "Servos",
        (
            "servo",
            "joint",
            "range",
            "limits",
            "peak °/s",
            "limit °/s",
            "at frame",
            "step °",
            "needs s",
            "has s",
        ),
        rows,
    )


def _show_ends(tracks: tuple[Track, ...], errors: tuple[EndError, ...], frame_s: float) -> None:
    from servogen.report.tool_error import ERROR_COLUMNS, error_rows

    by_name = {track.name: track for track in tracks}
    rows = []
    for each in errors:
        least, greatest = _extent(by_name[each.name])
        spans = (f"{_mm(low)} to {_mm(high)}" for low, high in zip(least, greatest, strict=True))
        rows.append((each.name, *spans))
    table("Paths", ("end", "x mm", "y mm", "z mm"), rows)
    columns = [re.sub(r"_(mm|s)$", r" \1", column).replace("_", " ") for column in ERROR_COLUMNS]
    table("Error of the pulses", columns, list(error_rows(errors, frame_s)))


def _plan_dict(
    job: PlannedJob,
    made: PulsePlan,
    facts: tuple[ServoFacts, ...],
    tracks: tuple[Track, ...],
    errors: tuple[EndError, ...],
) -> dict[str, object]:
    """Metres, radians and seconds."""
    by_name = {track.name: track for track in tracks}
    schedule, frame_s = made.schedule, _seconds(made, 1)
    return {
        "job": job.name,
        "device": job.device.name,
        "clock_hz": job.clock.hz,
        "period_s": frame_s,
        "lead_in_frames": schedule.lead_in_frames,
        "loop_frames": schedule.loop_frames,
        "lead_in_s": _seconds(made, schedule.lead_in_frames),
        "loop_s": _seconds(made, schedule.loop_frames),
        "servos": [
            {
                "name": each.servo.name,
                "pin": each.servo.pin,
                "model": each.servo.model.name,
                "continuous": each.servo.model.continuous,
                "least": each.least,
                "greatest": each.greatest,
                "lower_limit": each.servo.limits[0],
                "upper_limit": each.servo.limits[1],
                "peak_speed": each.speed,
                "peak_speed_frame": each.speed_frame,
                "speed_limit": each.servo.model.speed,
                "largest_step": each.step,
                "step_needs_s": each.step_needs_s,
                "step_has_s": each.step_s,
            }
            for each in facts
        ],
        "ends": [
            {
                "name": each.name,
                "kind": by_name[each.name].kind,
                "least_m": _extent(by_name[each.name])[0],
                "greatest_m": _extent(by_name[each.name])[1],
                "error": {
                    "worst_m": each.worst_m,
                    "rms_m": each.rms_m,
                    "frame": each.frame,
                    "time_s": each.frame * frame_s,
                    "jacobian_worst_m": each.first_order_worst_m,
                    "jacobian_rms_m": each.first_order_rms_m,
                },
            }
            for each in errors
        ],
        "notes": [{"code": note.code, "text": note.text} for note in job.notes],
        "warnings": [
            {"code": warning.code, "text": str(warning)} for warning in (*job.warnings, *made.warnings)
        ],
    }


def _extent(track: Track) -> tuple[list[float], list[float]]:
    """The least and greatest x, y, z of a track that has points."""
    import numpy as np

    return np.nanmin(track.planned, axis=0).tolist(), np.nanmax(track.planned, axis=0).tolist()


def _seconds(made: PulsePlan, frames: int) -> float:
    return float(made.schedule.clock.seconds(frames * made.schedule.period))


def _degrees(value: float | None) -> str:
    return "" if value is None else f"{degrees(value):z.1f}"


def _mm(metres: float) -> str:
    return f"{1000 * metres:z.2f}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:z.3f}"
