"""Commands of job files: new, check, plan, build, demo, report, tune."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.files import keep_apart, read_image
from servogen.cli.options import (
    Animate,
    CaptureRate,
    Csv,
    Dialect,
    JobFile,
    Json,
    Partial,
    Plot,
    RecordedWires,
)
from servogen.cli.show import as_json, status, table, warn_of_all
from servogen.errors import Diagnostic, InputError
from servogen.programs import beside_c, dialect_of, included_names, read_source
from servogen.units import counted

if TYPE_CHECKING:
    from servogen.job import Job, PlannedJob
    from servogen.pulse import Quantised
    from servogen.report.plan_facts import PlanFacts, ServoFacts
    from servogen.workflows.certificates import CertificateVerdict
    from servogen.workflows.horns import Horn
    from servogen.workflows.job_build import Build


MAX_WIDTH_ROWS = 16
"""The largest number of widths of which each has a row."""
SHOWN_FIRST = "hexapod-tripod"
"""The job that is proposed after a demo: the one that moves most."""


def register(app: typer.Typer) -> None:
    """Add the commands of this module to the application."""
    app.command()(new)
    app.command()(check)
    app.command()(build)
    app.command()(demo)
    app.command()(plan)
    app.command()(report)
    app.command()(tune)


MIN_FOLDED = 3
"""A ramp of fewer widths is shown row by row."""


def new(
    file: Annotated[Path, typer.Argument(help="The job file to write.")] = Path("job.toml"),
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            help="The kind of robot: servo, arm, leg, hexapod, hexapod-hip-lift, "
            "quadruped-hip-lift, omni or stream.",
        ),
    ] = None,
    servo: Annotated[
        str | None,
        typer.Option("--servo", help="The servo of every joint: a model, such as sg90, or a servo file."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
) -> None:
    """Write a commented job file to start from (without --robot: one servo; on a terminal it asks)."""
    from servogen.errors import InputError, Location
    from servogen.job import KINDS, starter, usual_servo
    from servogen.outputs import write_text

    if file.exists() and not force:
        raise InputError(
            "output-exists", "exists already", Location(str(file)), "give another name, or --force"
        )
    asks = robot is None and sys.stdin.isatty() and sys.stdout.isatty()
    if asks:
        robot = typer.prompt(f"robot ({', '.join(KINDS)})", default=KINDS[0])
    robot = robot or KINDS[0]
    if servo is None:
        servo = usual_servo(robot)
        servo = typer.prompt("servo (a model, or a servo file)", default=servo) if asks else servo
    with status(f"{file}: planning"):
        text = starter(robot, servo, file)
    write_text(file, text)
    print(f"{file}: a job for your robot; its comments say what to change. Next:")
    print(f"  servogen check {file}\n  servogen watch {file}")


def check(job: JobFile, json: Json = False) -> None:
    """Check a job file and show its pulses, without building it."""
    from servogen.job import load, plan_job
    from servogen.plan_error import plan_text
    from servogen.workflows import planned as planned_job

    loaded = plan_job(load(job))
    with status(f"{loaded.name}: planning"):
        as_planned = planned_job(loaded)
    planned = as_planned.plan
    schedule = planned.schedule
    warnings = (*loaded.warnings, *planned.warnings)
    if json:
        as_json(as_planned.to_json(), (*warnings, *loaded.notes))
        return
    _width_table(planned.widths)
    for note in loaded.notes:
        print(note.message)
    seconds = float(schedule.clock.seconds(schedule.loop_frames * schedule.period))
    loop = f"loop of {counted(schedule.loop_frames, 'frame')}, {seconds:g} s"
    print(f"{job}: {counted(len(loaded.servos), 'servo')}, {loop}; {plan_text(schedule.plan_error)}")
    warn_of_all(warnings)


def build(
    job: JobFile,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The folder to write to (default: build/ and the job's name)."),
    ] = None,
    prove: Annotated[
        bool,
        typer.Option(
            "--prove", help="Also prove each program for every power-up, input and chip; may take minutes."
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Build a job's firmware in every dialect, run it, compare every edge, and show what is proven of it.

    Exit code 1 if a program is not exact or, with --prove, not proven and checked.
    """
    from servogen.job import load, plan_job
    from servogen.plan_error import plan_text
    from servogen.report import timing_budgets_text
    from servogen.workflows import build as built
    from servogen.workflows import write
    from servogen.workflows.job_build import program_facts

    loaded = plan_job(load(job))
    folder = output or Path("build") / loaded.name
    with status(f"{loaded.name}: planning") as tell:
        result = built(loaded, lambda step: tell(f"{loaded.name}: {step}"))
        write(result, folder)
        theorems = _theorems(result, folder, None, prove, tell)
    if json:
        as_json(_build_to_json(result, folder, theorems), result.warnings)
    else:
        _width_table(result.plan.widths, "report.txt")
        _program_table(result, theorems)
        print("\n".join(timing_budgets_text(program_facts(result), result.job.clock)))
        plan = plan_text(result.plan.schedule.plan_error)
        print(f"{folder}: {'exact' if result.exact else 'NOT EXACT'}; {plan}; all of it in report.txt")
        print("\n".join(_theorem_lines(result, folder, theorems)))
        print(f"next: servogen watch {job}, or servogen flash {folder / 'main.hex'}")
    warn_of_all(result.warnings)
    proven = all(verdict.valid or (verdict.missing and not prove) for verdict in theorems)
    raise typer.Exit(0 if result.exact and proven else 1)


def demo(
    jobs: Annotated[list[Path], typer.Argument(help="Job files.", show_default=False)],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The folder in which each job gets its own.")
    ] = Path("build"),
    certificates: Annotated[
        Path | None,
        typer.Option(
            "--certificates",
            help="The folder of the certificates (JOB/main.cert.xz) that show what is proven "
            "(default: beside each HEX file, or in the cache).",
        ),
    ] = None,
    prove: Annotated[
        bool, typer.Option("--prove", help="Prove what has no certificate yet, and write it; takes minutes.")
    ] = False,
    json: Json = False,
) -> None:
    """Build several jobs, each into its own folder, and print one table: what is exact, and what is proven.

    Exit code 1 if a program is not exact, a certificate is refused, or, with --prove, one is not proven.
    """
    from servogen.job import load, plan_job
    from servogen.workflows import ResourceError, write
    from servogen.workflows import build as built

    results: list[tuple[Path, Build]] = []
    refused: list[Diagnostic] = []
    wrong: list[InputError] = []
    with status("reading") as tell:
        planned = []
        for job in jobs:
            try:
                planned.append((job, plan_job(load(job))))
            except InputError as error:  # the other jobs are built all the same
                wrong.append(error)
        for job, loaded in planned:

            def progress(step: str, name: str = loaded.name) -> None:
                tell(f"{name}: {step}")

            try:
                results.append((job, built(loaded, progress)))
            except ResourceError as error:
                refused.append(error.first)
                continue
            except InputError as error:
                wrong.append(error)
                continue
            write(results[-1][1], output / results[-1][1].job.name)
        theorems = [
            _theorems(result, output / result.job.name, certificates, prove, tell) for _, result in results
        ]
    rows = [(result, verdicts) for (_, result), verdicts in zip(results, theorems, strict=True)]
    if json:
        warnings = [warning for result, _ in rows for warning in result.warnings]
        errors = [diagnostic for error in wrong for diagnostic in error.diagnostics]
        shown = [_build_to_json(result, output / result.job.name, verdicts) for result, verdicts in rows]
        as_json({"jobs": shown}, (*warnings, *refused, *errors))
    else:
        _demo_table(rows)
        for refusal in refused:
            print(refusal.message)
        for result, _ in rows:
            if result.warnings:
                print(f"{result.job.name}: {counted(len(result.warnings), 'warning')} in its report.txt")
        _demo_end(results, theorems, output)
        for unread in wrong:
            print(unread, file=sys.stderr)
    fine = all(result.exact for result, _ in rows) and all(
        verdict.valid or (verdict.missing and not prove) for verdicts in theorems for verdict in verdicts
    )
    raise typer.Exit(InputError.exit_code if wrong else 0 if fine else 1)


def _demo_table(rows: Sequence[tuple[Build, Sequence[CertificateVerdict]]]) -> None:
    """Print a row for each job, whose dialects' programs differ in size only, unless it says otherwise."""

    def of_each(result: Build, words: Sequence[str]) -> str:
        if len(set(words)) == 1:
            return words[0]
        named = zip((program.firmware.dialect for program in result.programs), words, strict=True)
        return "; ".join(f"{dialect}: {word}" for dialect, word in named)

    table(
        "Jobs",
        ("job", "one run", "all runs", "from the plan", "engine", "words", "frames"),
        [
            (
                result.job.name,
                of_each(result, ["exact" if program.exact else "NOT EXACT" for program in result.programs]),
                of_each(result, [verdict.text for verdict in verdicts]),
                _from_plan(result),
                result.engine,
                max(program.firmware.compilation.words for program in result.programs),
                result.frames,
            )
            for result, verdicts in rows
        ],
        least=("frames", "words", "engine"),
    )


def _demo_end(
    results: Sequence[tuple[Path, Build]], theorems: Sequence[Sequence[CertificateVerdict]], output: Path
) -> None:
    """Print what was shown, and what to type next."""
    if not results:
        return
    programs = [program for _, result in results for program in result.programs]
    exact = sum(program.exact for program in programs)
    proven = sum(verdict.valid for verdicts in theorems for verdict in verdicts)
    jobs = f"{counted(len(results), 'job')}, {counted(len(programs), 'program')} in {output}/"
    print(f"{jobs}: {exact} exact in one run, {proven} proven for every power-up, input and chip")
    walking = [job for job, _ in results if job.stem == SHOWN_FIRST] or [results[0][0]]
    print(f"next: servogen watch {walking[0]}")


def _from_plan(result: Build) -> str:
    error = result.plan.schedule.plan_error
    return "?" if error is None else error.text()


def _theorems(
    result: Build, folder: Path, certificates: Path | None, prove: bool, tell: Callable[[str], None]
) -> list[CertificateVerdict]:
    """Return what is known of each program for every power-up, input and chip.

    That is what the checker says of its certificate in `certificates`, if given, or beside its HEX file in
    `folder`, or in the user's cache; or, with `prove`, of a proof that is made now. Raises InputError.
    """
    from servogen.workflows.certificates import beside, checked, kept, proved
    from servogen.workflows.job_build import hex_name

    verdicts = []
    schedule = result.plan.schedule
    for program in result.programs:
        name, image, text = hex_name(result, program), program.image, schedule.json_text()
        tell(f"{result.job.name}: {'proving' if prove else 'checking a proof of'} {program.firmware.dialect}")
        job = folder if certificates is None else certificates / result.job.name
        file = beside(job / name)
        if prove:
            verdicts.append(proved(file, image, schedule))
        elif certificates is not None:
            verdicts.append(checked(file, image, text))
        else:
            verdicts.append(kept([file], image, text.encode()))
    return verdicts


def _theorem_lines(result: Build, folder: Path, theorems: list[CertificateVerdict]) -> Iterator[str]:
    """Yield what is proven of a build's programs, and the command that proves the others."""
    from servogen.workflows.job_build import hex_name

    names = [hex_name(result, program) for program in result.programs]
    rows = sorted(zip(theorems, names, strict=True), key=lambda row: (not row[0].valid, row[0].text))
    for (text, missing), group in groupby(rows, key=lambda row: (row[0].text, row[0].missing)):
        files = [name for _, name in group]
        words = ["servogen", "prove", str(folder / files[0]), "--against", str(folder / "schedule.json")]
        how = f": {shlex.join(words)}, or build with --prove" if missing else ""
        yield f"every power-up, input and chip: {', '.join(files)}: {text}{how}"


def _width_table(widths: Sequence[Quantised], unfolded: str = "--json") -> None:
    """Print one row for each width, and one for each ramp; of many, one for each servo."""
    folded = list(_folded(widths))
    many = len(folded) > MAX_WIDTH_ROWS
    if many:
        servos = dict.fromkeys(row.channel for row in widths)
        rising = sorted(widths, key=lambda row: row.requested_us)
        folded = [[row for row in rising if row.channel == servo] for servo in servos]
    examples = any(row.which for row in widths) and not many
    table(
        "Pulse widths",
        ("servo", *(["pulse"] if examples else []), "requested µs", "cycles", "error µs", "frames"),
        [_width_cells(rows, examples, "widths" if many else "widths of ramps") for rows in folded],
    )
    if many:
        print(f"{len(widths)} widths, a row for each servo: {unfolded} has them all")


def _folded(widths: Sequence[Quantised]) -> Iterator[list[Quantised]]:
    """Yield each row alone, but neighbouring widths that no pose holds together: they are a ramp's."""
    for (_, held), group in groupby(widths, key=lambda row: (row.channel, row.held)):
        rows = list(group)
        if held or len(rows) < MIN_FOLDED:
            yield from ([row] for row in rows)
        else:
            yield rows


def _width_cells(rows: list[Quantised], examples: bool, what: str) -> tuple[object, ...]:
    first, last = rows[0], rows[-1]
    if len(rows) == 1:
        which = [first.which] if examples else []
        error = f"{float(first.error_us):+z.3f}"
        return (first.channel, *which, f"{float(first.requested_us):z.3f}", first.cycles, error, first.frames)
    errors = [float(row.error_us) for row in rows]
    return (
        f"{first.channel}, {len(rows)} {what}",
        *([""] if examples else []),
        f"{float(first.requested_us):z.3f} to {float(last.requested_us):z.3f}",
        f"{first.cycles} to {last.cycles}",
        f"{min(errors):+z.3f} to {max(errors):+z.3f}",
        sum(row.frames for row in rows),
    )


def _program_table(result: Build, theorems: Sequence[CertificateVerdict]) -> None:
    from servogen.pic.device import PROGRAM_WORDS, RAM_BYTES

    table(
        f"Programs: engine {result.engine}, {counted(result.frames, 'frame')} compared",
        (
            *("dialect", "one run", "all runs", "worst edge error", "from the plan"),
            *("words", "words left", "RAM", "RAM left"),
        ),
        [
            (
                program.firmware.dialect,
                "exact" if program.exact else "NOT EXACT",
                verdict.text,
                f"{program.verdict.worst_edge_error} cycles",
                "?" if program.verdict.plan_error is None else program.verdict.plan_error.text(),
                program.firmware.compilation.words,
                PROGRAM_WORDS - program.firmware.compilation.words,
                program.firmware.compilation.ram_bytes,
                RAM_BYTES - program.firmware.compilation.ram_bytes,
            )
            for program, verdict in zip(result.programs, theorems, strict=True)
        ],
        least=("from the plan",),
    )


def _build_to_json(result: Build, folder: Path, theorems: list[CertificateVerdict]) -> dict[str, object]:
    proven = {
        "proven": all(verdict.valid for verdict in theorems),
        "all_runs": [verdict.text for verdict in theorems],
    }
    return {"folder": str(folder), **result.to_json(), **proven}


def plan(
    job: JobFile,
    picture: Plot = None,
    csv: Csv = None,
    animate: Animate = None,
    fit: Annotated[
        bool,
        typer.Option("--fit", help="Write into the job where its horns centre the motion; comments stay."),
    ] = False,
    json: Json = False,
) -> None:
    """Show a job's motion without building it: frames, servos, horns, paths, pulse errors."""
    from servogen.job import load
    from servogen.outputs import atomic_write
    from servogen.report.motion_table import frame_lines
    from servogen.report.plan_facts import plan_facts
    from servogen.workflows import nearest_pulses
    from servogen.workflows.horns import horns_of

    with status("planning"):
        asked = _planned_with_horns(load(job), job, fit)
        played, made = nearest_pulses(asked)
        facts = plan_facts(played, made, engine=played is not asked)
    loaded, pulses, tracks = facts.job, facts.plan, facts.tracks
    if csv:
        with atomic_write(csv) as file:
            file.writelines(f"{line}\n" for line in frame_lines(loaded, pulses.schedule, tracks))
    if picture:
        from servogen.report.motion_plot import motion_plot

        motion_plot(loaded, pulses.schedule, tracks, picture)
    if animate:
        from servogen.report.film import film, job_scene

        with status(f"filming {animate}"):
            film(job_scene(loaded), animate)
    if json:
        horns = [horn.to_json() for horn in horns_of(asked)]
        as_json({**facts.to_json(), "horns": horns}, (*loaded.warnings, *pulses.warnings, *loaded.notes))
    else:
        _show_plan(facts, horns_of(asked))


def _planned_with_horns(loaded: Job, file: Path, fit: bool) -> PlannedJob:
    """Return a job's plan; with `fit` that with centred horns, which is written into its file.

    Raises InputError, with the horns that would help where they are all that is in the way.
    """
    from servogen.errors import ServogenError
    from servogen.job import plan_job
    from servogen.outputs import write_text
    from servogen.workflows.horns import advised, centred, edits, rewritten

    try:
        planned = plan_job(loaded)
    except ServogenError as error:
        horns, made = centred(loaded)
        if not fit:
            raise advised(error, horns) from error
    else:
        if not fit:
            return planned
        horns, made = centred(loaded)
    values = edits(loaded, horns)
    if not values:
        print(f"{file}: every horn is where it centres the motion")
        return made
    write_text(file, rewritten(file.read_text(encoding="utf-8"), values))
    print(f"{file}: {counted(sum(bool(horn.turn) for horn in horns), 'horn')} turned")
    return made


def _show_horns(horns: tuple[Horn, ...]) -> None:
    """Print which part of its travel each servo's motion uses, and the zero that centres it."""
    rows = []
    for horn in horns:
        low, high = (degrees(end) for end in horn.used)
        whole = degrees(horn.whole[1] - horn.whole[0])
        rows.append(
            (
                horn.servo,
                f"{degrees(horn.whole[0]):z.4g} to {degrees(horn.whole[1]):z.4g}°",
                f"{low:z.1f} to {high:z.1f}°, {100 * (high - low) / whole:.0f} %",
                f"{degrees(horn.zero):z.4g}",
                "as it is" if not horn.turn else f"{degrees(horn.zero + horn.turn):z.4g}",
            )
        )
    if rows:
        table("Horns", ("servo", "travel", "used", "zero_deg", "centred"), rows)


def _show_plan(facts: PlanFacts, horns: tuple[Horn, ...]) -> None:
    job, schedule = facts.job, facts.plan.schedule
    _show_servos(job, facts.servos)
    _show_horns(horns)
    if facts.ends:
        _show_ends(facts)
    for note in job.notes:
        print(note.message)
    if facts.rigid_legs_end is not None:
        x, y, yaw = facts.rigid_legs_end
        print(
            f"rigid legs take the body {1000 * x:z.1f} mm forward, {1000 * y:z.1f} mm to the left "
            f"and turn it by {degrees(yaw):z.1f}°"
        )
    if facts.worst is not None:
        worst = facts.worst
        print(
            f"{_of_what(facts)}: at worst {1000 * worst.worst_m:z.3f} mm, "
            f"{worst.name} in frame {worst.frame} ({facts.seconds(worst.frame):.6g} s)"
        )
        if not facts.engine:
            print("how far the engine's schedule is from the plan, which may be more: servogen check")
    parts = [("lead-in", schedule.lead_in_frames), ("loop", schedule.loop_frames)]
    text = ", ".join(
        f"{name} of {counted(frames, 'frame')}, {facts.seconds(frames):g} s"
        for name, frames in parts
        if frames
    )
    print(f"{job.file}: {counted(len(job.servos), 'servo')}, {text}")
    warn_of_all((*job.warnings, *facts.plan.warnings))


def _show_servos(job: PlannedJob, facts: tuple[ServoFacts, ...]) -> None:
    joints = {binding.servo: binding.joint for binding in job.bindings}
    rows = []
    for row in facts:
        model, unit = row.servo.model, row.servo.model.unit
        rows.append(
            (
                row.servo.name,
                joints.get(row.servo.name, ""),
                f"{degrees(row.minimum):z.2f} to {degrees(row.maximum):z.2f}{unit}",
                " to ".join(f"{degrees(limit):zg}" for limit in row.servo.limits) + unit,
                _degrees(row.speed),
                _degrees(model.speed),
                "" if row.speed_frame is None else row.speed_frame,
                _degrees(row.step),
                _number(row.step_needs_s),
                _number(row.step_s),
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


def _show_ends(facts: PlanFacts) -> None:
    from servogen.report.tracks import ERROR_COLUMNS, error_rows

    rows = []
    for end in facts.ends:
        spans = (f"{_mm(low)} to {_mm(high)}" for low, high in zip(*facts.extent(end), strict=True))
        rows.append((end.name, *spans))
    table("Paths", ("end", "x mm", "y mm", "z mm"), rows)
    columns = [re.sub(r"_(mm|s)$", r" \1", column).replace("_", " ") for column in ERROR_COLUMNS]
    title = _of_what(facts)
    table(title[0].upper() + title[1:], columns, list(error_rows(facts.ends, facts.seconds(1))))


def _of_what(facts: PlanFacts) -> str:
    """Return which error the facts tell: that of rounding alone, or that of what is built."""
    return "error of the engine's schedule" if facts.engine else "error of rounding to whole cycles"


def _degrees(value: float | None) -> str:
    return "" if value is None else f"{degrees(value):z.1f}"


def _mm(metres: float) -> str:
    return f"{1000 * metres:z.2f}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:z.3f}"


def report(
    job: JobFile,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The page to write (default: the job's name with .html)."),
    ] = None,
    capture: Annotated[
        Path | None,
        typer.Option(
            "--capture", help="A logic analyser's capture to show beside the plan: .vcd, .sr or .csv."
        ),
    ] = None,
    rate: CaptureRate = None,
    wire: RecordedWires = None,
    partial: Partial = False,
    twin: Annotated[
        bool, typer.Option("--twin", help="Also simulate the robot's physics (needs MuJoCo).")
    ] = False,
    json: Json = False,
) -> None:
    """Build a job, run it and write a self-contained HTML page about it."""
    from servogen.errors import Location
    from servogen.job import load, plan_job
    from servogen.outputs import write_text
    from servogen.plan_error import plan_text
    from servogen.traces.channels import wires_of
    from servogen.verify import capture_lines
    from servogen.workflows.reporting import page_of

    for given, key, what in ((rate, "--rate", "a sampling rate"), (wire, "--wire", "wires")):
        if given and capture is None:
            text = f"only a capture has {what}"
            raise InputError("conflicting-options", text, Location(str(job), key=key))
    loaded = plan_job(load(job))
    target = output or Path(f"{loaded.name}.html")
    with status(f"{loaded.name}: planning") as tell:
        page = page_of(
            loaded, capture, lambda step: tell(f"{loaded.name}: {step}"), rate, twin, wires_of(wire or ())
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
        print(f"{capture}: {capture_lines(page.capture)[0]}")
    if page.twin and not json:
        print(f"twin: {page.twin.word}")
        for reason in page.twin.reasons():
            print(reason)
    recorded = page.capture
    right = (recorded is None or recorded.accepted(partial)) and (page.twin is None or page.twin.passed)
    raise typer.Exit(0 if right and (page.programs_exact or page.not_built) else 1)


def tune(
    job: JobFile,
    hex_file: Annotated[
        Path, typer.Option("--hex", help="The HEX file that the other compiler made.", show_default=False)
    ],
    c_file: Annotated[
        Path | None,
        typer.Option("--c", help="The C that it was compiled from (default: the file that build writes)."),
    ] = None,
    dialect: Annotated[
        Dialect | None,
        typer.Option("--dialect", help="The C dialect (default: that of the C, else the job's)."),
    ] = None,
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
    from servogen.compiler import Source
    from servogen.job import load, plan_job
    from servogen.outputs import write_text
    from servogen.verify import verdict_lines
    from servogen.workflows.retarget import tune_to

    loaded = plan_job(load(job))
    text = read_source(c_file) if c_file else ""
    spoken = (
        dialect.value
        if dialect
        else dialect_of(included_names([(str(c_file), text)], beside_c))
        if c_file
        else loaded.firmware.dialect
    )
    with status(f"{loaded.name}: measuring {hex_file.name}"):
        source = Source(text, str(c_file)) if c_file else None
        tuned = tune_to(loaded, read_image(hex_file), str(hex_file), spoken, source)
    target = output or _next_c_file(c_file or hex_file.parent / f"main.{spoken}.c")
    keep_apart([job, hex_file, *([c_file] if c_file else [])], target)
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
        table("Cycles beside the delays", ("path", hex_file.name, "servogen"), rows)
        for line in verdict_lines(tuned.verdict):
            print(line)
        if tuned.source:
            print(f"not exact yet: compile {target}, then servogen tune {job} --hex … --c {target}")
        else:
            print(f"{hex_file}: 0 cycles off")
    raise typer.Exit(0 if tuned.verdict.passed else 1)


def _next_c_file(c_file: Path) -> Path:
    """Return the name after this one: main.xc8.1.c after main.xc8.c, main.xc8.2.c after that."""
    name, _, number = c_file.stem.rpartition(".")
    if name and number.isdigit():
        return c_file.with_name(f"{name}.{int(number) + 1}.c")
    return c_file.with_name(f"{c_file.stem}.1.c")
