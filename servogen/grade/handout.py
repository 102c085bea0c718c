"""A lab's task sheet for students, without its solution: wiring, the servos' facts, the task, the grading.

In: a `Lab`. Out: the sheet as Markdown or as one HTML page. The angles and names of the lab's positions are
its solution, and stay out of it: what the students are asked is the lab's own sentence.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from itertools import chain
from math import degrees, isfinite

from servogen.grade.display import markdown
from servogen.grade.lab import Check, Lab
from servogen.grade.points import CHECK_TITLES, number
from servogen.robot.servo import ServoModel

STYLE = (
    "body{font:16px/1.5 sans-serif;max-width:46em;margin:2em auto;padding:0 1em}"
    "table{border-collapse:collapse}th,td{border:1px solid #888;padding:.2em .7em;text-align:left}"
)


@dataclass(frozen=True, slots=True)
class SheetSection:
    """A section of the sheet: its heading, paragraphs, and a table whose first row is its head."""

    heading: str
    paragraphs: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()


def handout_markdown(lab: Lab) -> str:
    """Return the sheet as Markdown."""
    lines = [f"# {markdown(lab.title)}"]
    for part in _parts(lab):
        lines += ["", f"## {markdown(part.heading)}"]
        lines += chain.from_iterable(("", markdown(text)) for text in part.paragraphs)
        if part.rows:
            rows = ["| " + " | ".join(map(markdown, row)) + " |" for row in part.rows]
            lines += ["", rows[0], "|" + "---|" * len(part.rows[0]), *rows[1:]]
    return "\n".join(lines) + "\n"


def handout_html(lab: Lab) -> str:
    """Return the sheet as a page that needs no other file."""
    title = escape(lab.title)
    lines = ["<!doctype html>", '<html lang="en">', '<meta charset="utf-8">', f"<title>{title}</title>"]
    lines += [f"<style>{STYLE}</style>", f"<h1>{title}</h1>"]
    for part in _parts(lab):
        lines.append(f"<h2>{escape(part.heading)}</h2>")
        lines += [f"<p>{escape(text)}</p>" for text in part.paragraphs]
        if part.rows:
            lines += ["<table>", *map(_html_row, part.rows, ["th", *["td"] * len(part.rows)]), "</table>"]
    return "\n".join([*lines, "</html>"]) + "\n"


def _html_row(row: Sequence[str], tag: str) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(text)}</{tag}>" for text in row) + "</tr>"


def _parts(lab: Lab) -> Iterator[SheetSection]:
    yield SheetSection("Task", (lab.task,))
    wiring = [("servo", "model", "pin", "also accepted")]
    for each in lab.servos:
        others = ", ".join(each.pins[1:]) or "–"
        wiring.append((each.servo.name, each.servo.model.title, each.pins[0], others))
    crystal = (
        f"The chip has a crystal of {lab.clock.hz / 1e6:g} MHz; an instruction cycle is four of its periods."
    )
    supply = "Each servo has its own supply; the grounds of the supply and of the chip are connected."
    yield SheetSection("Wiring", (crystal, supply), wiring)
    for model in dict.fromkeys(each.servo.model for each in lab.servos):
        yield SheetSection(model.title, (), [("fact", "value"), *_facts(model)])
    yield SheetSection("How it is graded", tuple(_rules(lab)), [("check", "points"), *_points(lab)])


def _facts(model: ServoModel) -> Iterator[tuple[str, str]]:
    sign = "°/s" if model.continuous else "°"
    for point in model.calibration.points:
        yield f"pulse for {degrees(point.angle):g}{sign}", f"{point.width_us:g} µs"
    if all(map(isfinite, model.travel)):
        yield "travel", " to ".join(f"{degrees(angle):g}°" for angle in model.travel)
    at = "" if model.supply_v is None else f" at {model.supply_v:g} V"
    for name, value, scale, unit in (
        (f"speed without load{at}", model.speed, degrees(1), "°/s"),
        (f"torque{at}", model.torque_nm, 100, "N·cm"),
        ("current at rest", model.idle_a, 1000, "mA"),
        ("greatest current", model.max_a, 1000, "mA"),
        ("mass", model.mass_kg, 1000, "g"),
    ):
        if value is not None:
            yield name, f"{value * scale:.4g} {unit}"


def _rules(lab: Lab) -> Iterator[str]:
    yield f"The program runs for {lab.watch_s:g} s, and makes at least {lab.rounds} complete rounds."
    low, high = lab.period_ms
    yield (
        f"From pulse to pulse there are {low:g} to {high:g} ms; within one position the periods differ by at "
        f"most {lab.spread_us:g} µs."
    )
    if lab.has_pauses:
        yield f"A pause may be {100 * lab.pause_tolerance:g} % shorter or longer than required."
    if lab.longest_move_s:
        yield f"A ramp of pulse widths from one position to the next takes at most {lab.longest_move_s:g} s."


def _points(lab: Lab) -> Iterator[tuple[str, str]]:
    worth = dict(lab.points)
    for check in Check:
        if check in worth:
            yield CHECK_TITLES[check], number(worth[check])
    if lab.points_passed:
        yield "everything is right", number(lab.points_passed)
