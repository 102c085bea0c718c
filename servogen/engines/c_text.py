"""The rendering of every engine's C: the dialects, the files of `templates/`, the header of a C file.

A template is rendered from the values that it uses. Nothing is computed in the templates; an undefined name
is an error.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from textwrap import wrap
from traceback import walk_tb

from jinja2 import Environment, FileSystemLoader, StrictUndefined, TemplateError, TemplateSyntaxError

from servogen.errors import Location, ServogenError
from servogen.pic.device import Device, config_word, oscillator_for
from servogen.pulse import PulseSchedule
from servogen.template_files import template_folder
from servogen.units import Cycles

SUFFIXES = (".j2", ".asm")
"""The endings of templates: bodies and dialects, and the engines' assembly."""


class RenderError(ServogenError):
    """An error in a template, with its name and line."""


def render_template(template: str, **values: object) -> str:
    """Return the text of a template. Raises RenderError with the template's name and line."""
    try:
        return environment().get_template(template).render(**values)
    except TemplateError as error:
        raise RenderError(
            "internal-error", error.message or "the template is wrong", _template_place(error)
        ) from error


def _template_place(error: TemplateError) -> Location:
    """Return the template and line of an error: its own, or the last template line that was executed."""
    if isinstance(error, TemplateSyntaxError):
        return Location(error.name, error.lineno)
    lines = [
        (frame.f_code.co_filename, line)
        for frame, line in walk_tb(error.__traceback__)
        if frame.f_code.co_filename.endswith(SUFFIXES)
    ]
    file, line = lines[-1] if lines else (None, None)
    return Location(str(Path(file).relative_to(template_folder())) if file else None, line)


@dataclass(frozen=True, slots=True)
class AsmLine:
    """A line of assembly and its comment; either may be empty."""

    code: str
    comment: str


def assembly(text: str) -> Iterator[AsmLine]:
    """Yield the lines of assembly; every dialect writes the comments in its own form."""
    for line in text.splitlines():
        code, _, comment = line.partition(";")
        yield AsmLine(code, comment.strip())


@cache
def environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(template_folder()),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


NUMBERS_WIDTH = 90
"""The characters in a line of numbers."""


def table_lines(groups: Iterable[tuple[Iterable[object], str]]) -> list[str]:
    """Return the lines of a table: groups of numbers, with a comment behind the first line of each."""
    lines: list[tuple[str, str]] = []
    for values, comment in groups:
        first, *rest = wrap(", ".join(map(str, values)) + ",", NUMBERS_WIDTH)
        lines += [(first, f"   /* {comment} */" if comment else ""), *((line, "") for line in rest)]
    return [
        (text if number < len(lines) else text[:-1]) + comment
        for number, (text, comment) in enumerate(lines, 1)
    ]


@dataclass(frozen=True, slots=True)
class ChannelText:
    """A channel in the header of the C file."""

    name: str
    pin: str
    widths_us: str


def channel_text(schedule: PulseSchedule, channel: int, widths: Collection[int]) -> ChannelText:
    """Return a channel with `widths` in cycles: the one that all are, or the shortest and the longest."""
    described = schedule.channels[channel]
    ends = dict.fromkeys((min(widths), max(widths)))
    texts = (decimal(schedule.clock.us(Cycles(width))) for width in ends)
    return ChannelText(described.name, described.pin, " to ".join(texts))


@dataclass(frozen=True, slots=True)
class PortText:
    """A port in use and the value of its TRIS register."""

    name: str
    tris: str


def header_values(dialect: str, title: str, device: Device, schedule: PulseSchedule) -> dict[str, object]:
    """Return the template's values that the header of every engine's C file uses, by name."""
    clock = schedule.clock
    return {
        "dialect": dialect,
        "title": title,
        "device": device.name,
        "clock_hz": clock.hz,
        "clock_mhz": decimal(Fraction(clock.hz, 1_000_000)),
        "oscillator": oscillator_for(clock.hz),
        "configuration": f"0x{config_word(oscillator_for(clock.hz)):04X}",
        "period_us": decimal(clock.us(schedule.period)),
        "ports": list(ports_of(schedule)),
    }


def ports_of(schedule: PulseSchedule) -> Iterator[PortText]:
    """Yield the ports in use; their other pins stay inputs, as after a reset."""
    for port, inputs in (("A", 0x1F), ("B", 0xFF)):
        pins = [int(channel.pin[2]) for channel in schedule.channels if channel.pin[1] == port]
        restart = schedule.wire.restart if schedule.wire else None
        if pins or (restart and restart[1] == port):
            yield PortText(port, f"0x{inputs & ~sum(1 << pin for pin in pins):02X}")


def decimal(value: Fraction) -> str:
    """Return a number as text: whole, or with as many decimals as needed, up to three."""
    return f"{float(value):.3f}".rstrip("0").rstrip(".")
