"""The HTML report: one page that needs no network, from a job, what was built, and what was captured.

In: `PageFacts`. Out: text of HTML, the same for the same facts. All numbers and paths are made here and in
`signals` and `drawing`; `templates/report.html.j2` only writes them down.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jinja2 import Environment, StrictUndefined, TemplateError

from servogen.edges import PINS, EdgeTrace
from servogen.engines.c_text import RenderError
from servogen.engines.inputs import given
from servogen.engines.inputs.tape import Tape
from servogen.errors import Diagnostic, Location
from servogen.job import PlannedJob
from servogen.motion.trajectory import Floats
from servogen.pic.device import PROGRAM_WORDS, RAM_BYTES, oscillator_for
from servogen.pic.listing import ListedFunction, Listing, listing_text
from servogen.plan_error import plan_text
from servogen.pulse import PulsePlan, PulseSchedule
from servogen.report.drawing import Chart, path_chart, time_chart
from servogen.report.motion_table import widths_us
from servogen.report.robot_model import robot_model
from servogen.report.signals import captured, frames_to_show, planned, pose_frames, shown_us, simulated
from servogen.report.text import ProgramFacts, rounded_width, sentence
from servogen.report.tracks import Track, end_errors, end_tracks, error_rows
from servogen.report.viewer import embedded_json, viewer_colours, viewer_module
from servogen.report.wiring import open_drain, package, remarks, wires
from servogen.template_files import template_folder
from servogen.units import counted
from servogen.verify import CaptureVerdict, capture_summary

TEMPLATE = "report.html.j2"

ALONE = "Positions come over the serial line; this page shows what the chip does until one comes."

BY_JACOBIAN = ("worst by the Jacobian, mm", "rms by the Jacobian, mm")

FIRST_FRAMES = 4
"""The number of frames of the pulses that are shown at first: widths are still legible on a phone."""


FEW = 2
"""The number of reasons named for an unbounded call: they stand in a cell of a table."""


@dataclass(frozen=True, slots=True)
class CaptureFacts:
    """A capture to show beside the plan: its file's name, its edges, its verdict."""

    name: str
    trace: EdgeTrace
    verdict: CaptureVerdict


@dataclass(frozen=True, slots=True)
class TwinFacts:
    """What the robot did in the physics: words, rows and charts; `badge` is a class of the style."""

    word: str
    badge: str
    ground: str
    rows: tuple[tuple[str, ...], ...]
    servos: tuple[tuple[str, ...], ...]
    checks: tuple[tuple[str, ...], ...]
    reasons: tuple[str, ...]
    events: tuple[str, ...]
    assumptions: tuple[str, ...]
    charts: tuple[tuple[str, Chart], ...]


@dataclass(frozen=True, slots=True)
class PageFacts:
    """Everything on a page. A job that was planned but not built has no programs, and says why not."""

    job: PlannedJob
    plan: PulsePlan
    warnings: tuple[Diagnostic, ...]
    programs: tuple[ProgramFacts, ...] = ()
    listing: Listing | None = None
    trace: EdgeTrace | None = None
    """The edges of the job's own program, over at least one pass of the motion."""
    capture: CaptureFacts | None = None
    not_built: str = ""
    twin: TwinFacts | None = None
    theorem: str = ""
    """What is known of the job's program in one run and in all runs."""


def html_page(facts: PageFacts) -> str:
    """Return the page. Raises RenderError if the template is wrong."""
    return render_page(TEMPLATE, _values(facts))


def render_page(template: str, values: Mapping[str, object]) -> str:
    """Return the page that a template makes of values. Raises RenderError if the template is wrong."""
    environment = Environment(
        undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    try:
        text = (template_folder() / template).read_text("utf-8")
        return environment.from_string(text).render(values)
    except TemplateError as error:
        message = error.message or "the template is wrong"
        raise RenderError("internal-error", message, Location(template)) from error


def _values(facts: PageFacts) -> dict[str, object]:
    schedule, job = facts.plan.schedule, facts.job
    tracks = [track for track in end_tracks(job, schedule) if not np.isnan(track.planned).all()]
    frame_s = float(schedule.clock.seconds(schedule.period))
    return {
        "title": job.name,
        "state": _state(facts),
        "distance": _distance(facts),
        "theorem": facts.theorem,
        "tiles": tuple(_tiles(facts)),
        "chip": f"{job.device.name}, {job.clock.hz / 1e6:g} MHz crystal ({oscillator_for(job.clock.hz)}); "
        f"one instruction cycle is {float(job.clock.cycle_us):g} µs",
        "pins": package(job.servos, given(job.inputs, Tape)),
        "wiring": tuple(wiring_rows(job)),
        "remarks": tuple(_ohm(line) for line in (*open_drain(job), *remarks(job))),
        "angles": angle_chart(job, schedule),
        "widths": width_chart(schedule),
        "rounding": tuple(rounding(facts.plan)),
        "paths": tuple(path_charts(tracks, schedule.lead_in_frames)),
        "errors": tuple(error_rows(end_errors(tracks), frame_s)),
        "error_columns": ("end", "worst, mm", "rms, mm", "worst in frame", "at, s", *BY_JACOBIAN),
        **_signal_values(facts),
        "programs": tuple(program_values(program) for program in facts.programs),
        "capture": capture_values(facts.capture),
        "not_built": facts.not_built,
        "twin": facts.twin,
        "costs": tuple(costs(facts.listing)),
        "memory": memory(facts.programs),
        "listing": listing_text(facts.listing) if facts.listing else "",
        "notes": [*([ALONE] if job.stream else []), *(_with_key(note) for note in job.notes)],
        "warnings": [sentence(warning) for warning in facts.warnings],
    }


def _state(facts: PageFacts) -> tuple[str, str]:
    """Return a class of the page's style, and the words of the badge."""
    if not facts.programs:
        return "open", "planned, not built"
    if not all(program.exact for program in facts.programs):
        return "bad", "NOT exact"
    if facts.capture is not None and not facts.capture.verdict.passed:
        if facts.capture.verdict.agrees:
            return "open", f"program exact, capture {facts.capture.verdict.word}"
        return "bad", "program exact, capture does NOT agree"
    return "good", "every edge exact"


def _distance(facts: PageFacts) -> str:
    """Return how far the edges are from the schedule, and the schedule from the plan."""
    words = plan_text(facts.plan.schedule.plan_error)
    exact = bool(facts.programs) and all(program.exact for program in facts.programs)
    return f"0 cycles from the schedule; {words}" if exact else words


def _tiles(facts: PageFacts) -> Iterator[tuple[str, str]]:
    schedule = facts.plan.schedule
    second = schedule.clock.seconds
    yield f"{len(facts.job.servos)}", "servos" if len(facts.job.servos) > 1 else "servo"
    yield f"{float(schedule.clock.us(schedule.period)) / 1000:g} ms", "period"
    yield (
        f"{float(second(schedule.loop_frames * schedule.period)):g} s",
        f"loop, {counted(schedule.loop_frames, 'frame')}",
    )
    if schedule.lead_in_frames:
        lead_in = float(second(schedule.lead_in_frames * schedule.period))
        yield f"{lead_in:g} s", f"lead-in, {counted(schedule.lead_in_frames, 'frame')}"
    for program in facts.programs[:1]:
        yield f"{program.words} of {PROGRAM_WORDS}", "words of program"
        yield f"{program.ram_bytes} of {RAM_BYTES}", "bytes of RAM"
        yield f"{program.verdict.worst_edge_error}", "cycles, the worst edge error"
        yield f"{program.verdict.span.frames}", "frames checked"


def _ohm(text: str) -> str:
    return text.replace("kOhm", "kΩ")


def wiring_rows(job: PlannedJob) -> Iterator[tuple[str, ...]]:
    """Yield the wires of a job: pin, name, where it goes, and of a servo its model, pulses and trim."""
    for wire in wires(job):
        use, servo = _ohm(wire.use), wire.servo
        if servo is None:
            yield str(wire.number), wire.pin, use, "", "", ""
            continue
        low, high = servo.widths_us
        trim = f"{servo.trim_us:+zg} µs" if servo.trim_us else "–"
        yield str(wire.number), wire.pin, servo.name, servo.model.title, f"{low:g} to {high:g} µs", trim


def _signal_values(facts: PageFacts) -> dict[str, object]:
    """Return the rows of pulses, and their numbers for the zoom."""
    schedule = facts.plan.schedule
    groups = [planned(schedule)]
    if facts.trace is not None:
        groups.append(simulated(schedule, facts.trace))
    if facts.capture is not None:
        groups.append(captured(schedule, facts.capture.trace, facts.capture.verdict))
    rows = [row for channel in zip(*groups, strict=True) for row in channel]
    shown = frames_to_show(schedule, pose_frames(facts.job))
    span = shown_us(schedule)
    period = float(schedule.clock.us(schedule.period))
    start = min(shown[0].start_us if shown else 0.0, max(0.0, span - FIRST_FRAMES * period))
    data = {
        "end": span,
        "period": period,
        "first": [start, min(span, start + FIRST_FRAMES * period)],
        "loop": float(schedule.clock.us(schedule.lead_in_frames * schedule.period)),
        "cycle_us": float(schedule.clock.cycle_us),
        "pins": PINS,
        "robot": robot_model(facts.job),
        "rows": [
            {
                "channel": row.channel,
                "pin": PINS.index(row.pin),
                "kind": row.kind,
                "colour": row.colour,
                "rise": row.rise,
                "width": row.width,
            }
            for row in rows
        ],
    }
    whole = (schedule.lead_in_frames + schedule.loop_frames) * float(schedule.clock.us(schedule.period))
    return {
        "signal_data": embedded_json(data),
        "viewer_module": viewer_module(),
        "viewer_colours": viewer_colours(),
        "views": shown,
        "span_s": f"{span / 1e6:g}",
        "cut": span < whole,
    }


def _with_key(note: Diagnostic) -> str:
    key = note.location.key if note.location else None
    return f"{key}: {note.message}" if key else note.message


def _times(schedule: PulseSchedule) -> Floats:
    frames = schedule.lead_in_frames + schedule.loop_frames
    return float(schedule.clock.seconds(schedule.period)) * np.arange(frames + 1, dtype=np.float64)


def _mark(schedule: PulseSchedule) -> float | None:
    """Return when the loop begins, if something comes before it."""
    return float(schedule.clock.seconds(schedule.lead_in_frames * schedule.period)) or None


def angle_chart(job: PlannedJob, schedule: PulseSchedule) -> Chart:
    servos = job.servos
    names = [servo.name for servo in servos]
    label = "wheel speed, °/s" if all(servo.model.continuous for servo in servos) else "servo angle, °"
    columns = np.degrees(job.trajectory.angles)
    return time_chart(_times(schedule), columns, names, label, _mark(schedule))


def width_chart(schedule: PulseSchedule) -> Chart:
    names = [channel.name for channel in schedule.channels]
    return time_chart(_times(schedule), widths_us(schedule), names, "pulse width, µs", _mark(schedule))


def rounding(plan: PulsePlan) -> Iterator[tuple[str, ...]]:
    for row in plan.widths:
        yield (
            f"{row.channel}, {row.which}" if row.which else row.channel,
            *rounded_width(row),
        )


def path_charts(tracks: Sequence[Track], loop_start: int) -> Iterator[tuple[str, Chart]]:
    """Yield the views in mm: from above and, unless all is in the ground plane, from the side."""
    views = [("from above", 0, 1, "x, mm", "y, mm"), ("from the side", 0, 2, "x, mm", "z, mm")]
    flat = all(track.kind == "base" for track in tracks)
    for title, x, y, x_label, y_label in views[: 1 if flat else 2] if tracks else ():
        drawn = []
        for track in tracks:
            # The loop's end leads back to its beginning.
            around = np.vstack((track.planned, track.planned[loop_start : loop_start + 1]))
            drawn.append((track.name, 1000 * around[:, [x, y]], 1000 * track.made[:, [x, y]]))
        yield title, path_chart(drawn, x_label, y_label)


def program_values(program: ProgramFacts) -> dict[str, object]:
    verdict = program.verdict
    late = [] if program.exact or not program.overrun else [f"overrun: {program.overrun.text(verdict.clock)}"]
    return {
        "name": program.hex_file,
        "facts": ", ".join(
            (
                f"{program.dialect}, {program.words} words, {program.ram_bytes} bytes of RAM",
                *(
                    f"the C between {room.between} at most {room.worst} of {room.room} cycles"
                    for room in program.timing_budgets
                ),
            )
        ),
        "exact": program.exact,
        "span": f"{verdict.span.frames} frames, {float(verdict.clock.seconds(verdict.span.compared)):g} s, "
        f"{verdict.span.compared} cycles, on all 13 pins; {plan_text(verdict.plan_error)}",
        "start": None
        if verdict.start is None
        else f"{float(verdict.clock.us(verdict.start)):g} µs after reset",
        "reasons": (*verdict.reasons, *late),
        "rows": [
            (
                channel.name,
                PINS[channel.pin],
                f"{channel.observed} of {channel.scheduled}",
                str(channel.missing),
                str(channel.extra),
                f"{channel.width.error:+d}" if channel.width.error else "0",
                f"{channel.period.error:+d}" if channel.period.error else "0",
                f"{channel.edge.error:+d}" if channel.edge.error else "0",
            )
            for channel in verdict.channels
        ],
    }


def capture_values(capture: CaptureFacts | None) -> dict[str, object] | None:
    if capture is None:
        return None
    verdict = capture.verdict
    return {
        "name": capture.name,
        "badge": "good" if verdict.passed else "open" if verdict.agrees else "bad",
        "word": verdict.word if verdict.agrees else "does NOT agree",
        "lines": capture_summary(verdict),
        "reasons": verdict.reasons,
        "rows": [
            (
                channel.name,
                PINS[channel.pin],
                f"{channel.captured} of {channel.scheduled}" if channel.connected else "not connected",
                f"{channel.width.worst_us:+z.3f}",
                f"{channel.width.mean_us:+z.3f}",
                "–" if channel.mean_period_us is None else f"{channel.mean_period_us:z.2f}",
                f"{channel.jitter_us:z.3f}",
            )
            for channel in verdict.channels
        ],
    }


def costs(listing: Listing | None) -> Iterator[tuple[str, ...]]:
    """Yield one row per function, the longest first."""
    functions = listing.functions if listing else ()
    for function in sorted(functions, key=lambda function: (function.start - function.end, function.start)):
        yield (
            _function_title(function.name),
            f"{function.start:04X}",
            str(function.end - function.start),
            str(function.ram_bytes),
            str(function.deepest_calls),
            _cycles(function),
        )


def _function_title(name: str) -> str:
    """Return a function's name for people; a table is `__table.NAME@file:line:column`."""
    table, _, place = name.removeprefix("__table.").partition("@")
    return f"table {table}, {place.rpartition(':')[0]}" if name.startswith("__table.") else name


def _cycles(listed: ListedFunction) -> str:
    """Return the cycles of a call: exact, or from the shortest to the longest path, and what is unbounded."""
    minimum, most = listed.minimum_cycles, listed.maximum_cycles
    if minimum is None:
        return "–" if most is None else f"up to {most}"
    if most is None:
        return f"{minimum} or more" + (f": {_few(listed.unbounded)}" if listed.unbounded else "")
    return str(minimum) if minimum == most else f"{minimum} to {most}"


def _few(texts: Sequence[str]) -> str:
    more = f" and {len(texts) - FEW} more" if len(texts) > FEW else ""
    return ", ".join(texts[:FEW]) + more


def memory(programs: Sequence[ProgramFacts]) -> tuple[tuple[str, int, int, str], ...]:
    """Return (what, used, of, per cent) of each memory."""
    if not programs:
        return ()
    own = programs[0]
    used = (("program words", own.words, PROGRAM_WORDS), ("bytes of RAM", own.ram_bytes, RAM_BYTES))
    return tuple((name, part, whole, f"{100 * part / whole:z.1f}") for name, part, whole in used)
