"""The HTML report: one page that needs no network, from a job and what was built, proven and captured of it.

In: `PageFacts`. Out: text of HTML, the same for the same facts. All numbers and paths are made here and in
`signals` and `drawing`; `templates/report.html.j2` only writes them down.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jinja2 import Environment, StrictUndefined, TemplateError

from servogen.csource.rendering import RenderError, template_folder
from servogen.edges import PINS, EdgeTrace
from servogen.errors import Caution, Place
from servogen.job import Job
from servogen.pic.device import PACKAGE, PROGRAM_WORDS, RAM_BYTES, oscillator_for
from servogen.pic.listing import Listing, listing_text
from servogen.pulse import PulsePlan
from servogen.report.drawing import PALETTE, Chart, path_chart, time_chart
from servogen.report.motion_table import widths_us
from servogen.report.signals import captured, planned, scopes, shown_us, simulated
from servogen.report.text import ProgramFacts
from servogen.report.tool_error import ERROR_COLUMNS, error_rows, errors_of
from servogen.report.tracks import Track, tracks_of
from servogen.robot.servo import Servo
from servogen.verify import CaptureVerdict, capture_lines

TEMPLATE = "report.html.j2"
PACKAGE_ROWS = len(PACKAGE) // 2


@dataclass(frozen=True, slots=True)
class CaptureFacts:
    """A capture beside the plan: its file's name, its edges, what was found of it."""

    name: str
    trace: EdgeTrace
    verdict: CaptureVerdict


@dataclass(frozen=True, slots=True)
class PageFacts:
    """All that a page tells of. A job that was planned but not built has no programs, and says why."""

    job: Job
    plan: PulsePlan
    warnings: tuple[Caution, ...]
    programs: tuple[ProgramFacts, ...] = ()
    listing: Listing | None = None
    trace: EdgeTrace | None = None
    """The edges of the job's own program, the motion once or more."""
    capture: CaptureFacts | None = None
    not_built: str = ""


def html_page(facts: PageFacts) -> str:
    """The page. Raises RenderError where the template is wrong."""
    environment = Environment(
        undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    try:
        template = environment.from_string((template_folder() / TEMPLATE).read_text("utf-8"))
        return template.render(_values(facts))
    except TemplateError as error:
        raise RenderError(error.message or "the template is wrong", Place(TEMPLATE)) from error


def _values(facts: PageFacts) -> dict[str, object]:
    schedule, job = facts.plan.schedule, facts.job
    tracks = [track for track in tracks_of(job, schedule) if not np.isnan(track.planned).all()]
    frame_s = float(schedule.clock.seconds(schedule.period))
    return {
        "title": job.name,
        "state": _state(facts),
        "tiles": tuple(_tiles(facts)),
        "chip": f"{job.device.name}, {job.clock.hz / 1e6:g} MHz crystal ({oscillator_for(job.clock.hz)}); "
        f"one instruction cycle is {float(job.clock.cycle_us):g} µs",
        "pins": _package(job.servos),
        "wiring": tuple(_wiring(job.servos)),
        "angles": _angle_chart(facts),
        "widths": _width_chart(facts),
        "rounding": tuple(_rounding(facts)),
        "paths": tuple(_paths(tracks, schedule.lead_in_frames)),
        "errors": tuple(error_rows(errors_of(tracks), frame_s)),
        "error_columns": ERROR_COLUMNS,
        **_signal_values(facts),
        "programs": tuple(_program(program) for program in facts.programs),
        "capture": _capture(facts.capture),
        "not_built": facts.not_built,
        "costs": tuple(_costs(facts.listing)),
        "memory": _memory(facts),
        "listing": listing_text(facts.listing) if facts.listing else "",
        "notes": [note.text for note in job.notes],
        "warnings": [_without_folder(warning) for warning in facts.warnings],
    }


def _state(facts: PageFacts) -> tuple[str, str]:
    """A class of the page's style, and the words of the badge."""
    if not facts.programs:
        return "open", "planned, not built"
    proven = all(program.proven for program in facts.programs)
    return ("good", "every edge proven") if proven else ("bad", "NOT proven")


def _tiles(facts: PageFacts) -> Iterator[tuple[str, str]]:
    schedule = facts.plan.schedule
    second = schedule.clock.seconds
    yield f"{len(facts.job.servos)}", "servos" if len(facts.job.servos) > 1 else "servo"
    yield f"{float(schedule.clock.us(schedule.period)) / 1000:g} ms", "period"
    yield (
        f"{float(second(schedule.loop_frames * schedule.period)):g} s",
        f"loop, {schedule.loop_frames} frames",
    )
    if schedule.lead_in_frames:
        lead_in = float(second(schedule.lead_in_frames * schedule.period))
        yield f"{lead_in:g} s", f"lead-in, {schedule.lead_in_frames} frames"
    for program in facts.programs[:1]:
        yield f"{program.words} of {PROGRAM_WORDS}", "words of program"
        yield f"{program.ram_bytes} of {RAM_BYTES}", "bytes of RAM"
        yield f"{program.verdict.worst_edge_error}", "cycles, the worst edge error"
        yield f"{program.verdict.span.frames}", "frames checked"


@dataclass(frozen=True, slots=True)
class _Pin:
    """A leg of the chip in the drawing of its package."""

    number: int
    name: str
    servo: str
    colour: str
    y: int
    left: bool


def _package(servos: Sequence[Servo]) -> tuple[_Pin, ...]:
    """The DIP from above: pins 1 to 9 down the left side, 18 to 10 down the right."""
    index = {servo.pin: number for number, servo in enumerate(servos)}
    made = []
    for pin in PACKAGE:
        left = pin.number <= PACKAGE_ROWS
        row = pin.number - 1 if left else len(PACKAGE) - pin.number
        number = index.get(pin.name)
        servo = "" if number is None else servos[number].name
        colour = "" if number is None else PALETTE[number % len(PALETTE)]
        made.append(_Pin(pin.number, pin.name, servo, colour, 24 + 26 * row, left))
    return tuple(made)


def _wiring(servos: Sequence[Servo]) -> Iterator[tuple[str, ...]]:
    numbers = {pin.name: pin.number for pin in PACKAGE}
    for servo in servos:
        low, high = servo.widths_us
        yield (
            str(numbers[servo.pin]),
            servo.pin,
            servo.name,
            servo.model.title,
            f"{low:g} to {high:g} µs",
            f"{servo.trim_us:+g} µs" if servo.trim_us else "–",
        )
    for name, use in (
        ("VDD", "+5 V, 100 nF to VSS"),
        ("VSS", "ground, also of the servos' supply"),
        ("MCLR", "10 kΩ to VDD"),
        ("OSC1", "crystal, 22 pF to VSS"),
        ("OSC2", "crystal, 22 pF to VSS"),
    ):
        yield str(numbers[name]), name, use, "", "", ""


def _times(facts: PageFacts) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    schedule = facts.plan.schedule
    frames = schedule.lead_in_frames + schedule.loop_frames
    return float(schedule.clock.seconds(schedule.period)) * np.arange(frames + 1, dtype=np.float64)


def _mark(facts: PageFacts) -> float | None:
    """When the loop begins, where something comes before it."""
    schedule = facts.plan.schedule
    return float(schedule.clock.seconds(schedule.lead_in_frames * schedule.period)) or None


def _angle_chart(facts: PageFacts) -> Chart:
    servos = facts.job.servos
    names = [servo.name for servo in servos]
    label = "wheel speed, °/s" if all(servo.model.continuous for servo in servos) else "servo angle, °"
    columns = np.degrees(facts.job.trajectory.angles)
    return time_chart(_times(facts), columns, names, label, _mark(facts))


def _width_chart(facts: PageFacts) -> Chart:
    names = [servo.name for servo in facts.job.servos]
    return time_chart(_times(facts), widths_us(facts.plan.schedule), names, "pulse width, µs", _mark(facts))


def _rounding(facts: PageFacts) -> Iterator[tuple[str, ...]]:
    for row in facts.plan.widths:
        yield (
            f"{row.channel}, {row.which}" if row.which else row.channel,
            f"{math.degrees(row.angle):.2f}",
            f"{float(row.requested_us):.3f}",
            str(row.cycles),
            f"{float(row.achieved_us):.3f}",
            f"{float(row.error_us):+.3f}",
            str(row.frames),
        )


def _paths(tracks: Sequence[Track], loop_start: int) -> Iterator[tuple[str, Chart]]:
    """From above and, unless all lies in the ground plane, from the side; millimetres."""
    views = [("from above", 0, 1, "x, mm", "y, mm"), ("from the side", 0, 2, "x, mm", "z, mm")]
    flat = all(track.kind == "base" for track in tracks)
    for title, x, y, x_label, y_label in views[: 1 if flat else 2] if tracks else ():
        drawn = []
        for track in tracks:
            # The loop's end leads back to its beginning.
            around = np.vstack((track.planned, track.planned[loop_start : loop_start + 1]))
            drawn.append((track.name, 1000 * around[:, [x, y]], 1000 * track.made[:, [x, y]]))
        yield title, path_chart(drawn, x_label, y_label)


def _signal_values(facts: PageFacts) -> dict[str, object]:
    """The rows of pulses, and their numbers for the zoom."""
    schedule = facts.plan.schedule
    groups = [planned(schedule)]
    if facts.trace is not None:
        groups.append(simulated(schedule, facts.trace))
    if facts.capture is not None:
        groups.append(captured(schedule, facts.capture.trace, facts.capture.verdict))
    rows = [row for channel in zip(*groups, strict=True) for row in channel]
    shown = scopes(schedule)
    span = shown_us(schedule)
    data = {"end": span, "rows": [{"rise": row.rise, "width": row.width} for row in rows]}
    whole = (schedule.lead_in_frames + schedule.loop_frames) * float(schedule.clock.us(schedule.period))
    return {
        "signals": rows,
        "signal_data": json.dumps(data, separators=(",", ":")),
        "scopes": shown,
        "span_s": f"{span / 1e6:g}",
        "cut": span < whole,
    }


def _program(program: ProgramFacts) -> dict[str, object]:
    verdict = program.verdict
    late = (
        [] if program.proven or not program.overrun else [f"overrun: {program.overrun.text(verdict.clock)}"]
    )
    return {
        "name": program.hex_file,
        "facts": ", ".join(
            (
                f"{program.dialect}, {program.words} words, {program.ram_bytes} bytes of RAM",
                *(
                    f"the C between {room.between} at most {room.worst} of {room.room} cycles"
                    for room in program.rooms
                ),
            )
        ),
        "proven": program.proven,
        "span": f"{verdict.span.frames} frames, {float(verdict.clock.seconds(verdict.span.compared)):g} s, "
        f"{verdict.span.compared} cycles, on all 13 pins",
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


def _capture(capture: CaptureFacts | None) -> dict[str, object] | None:
    if capture is None:
        return None
    verdict = capture.verdict
    return {
        "name": capture.name,
        "proven": verdict.proven,
        "lines": [line for line in capture_lines(verdict) if not line.startswith("- ")],
        "reasons": verdict.reasons,
        "rows": [
            (
                channel.name,
                PINS[channel.pin],
                f"{channel.captured} of {channel.scheduled}" if channel.connected else "not connected",
                f"{channel.width.worst_us:+.3f}",
                f"{channel.width.mean_us:+.3f}",
                "–" if channel.mean_period_us is None else f"{channel.mean_period_us:.2f}",
                f"{channel.jitter_us:.3f}",
            )
            for channel in verdict.channels
        ],
    }


def _costs(listing: Listing | None) -> Iterator[tuple[str, ...]]:
    """One row a function, the dearest first."""
    functions = listing.functions if listing else ()
    for each in sorted(functions, key=lambda each: (each.start - each.end, each.start)):
        yield (
            each.name,
            f"{each.start:04X}",
            str(each.end - each.start),
            str(each.ram_bytes),
            str(each.deepest_calls),
            _cycles(each.least_cycles, each.most_cycles),
        )


def _cycles(least: int | None, most: int | None) -> str:
    if least is None and most is None:
        return "–"
    if least == most:
        return str(least)
    return f"{'?' if least is None else least} to {'no end' if most is None else most}"


def _memory(facts: PageFacts) -> tuple[tuple[str, int, int, str], ...]:
    """(what, used, of, per cent) of each memory."""
    if not facts.programs:
        return ()
    own = facts.programs[0]
    used = (("program words", own.words, PROGRAM_WORDS), ("bytes of RAM", own.ram_bytes, RAM_BYTES))
    return tuple((what, part, whole, f"{100 * part / whole:.1f}") for what, part, whole in used)


def _without_folder(warning: Caution) -> str:
    place = warning.place
    return str(replace(warning, place=replace(place, file=Path(place.file or "").name) if place else None))
