"""The files of `templates/`, filled.

In: a template's name and the values that it uses. Out: its text. Nothing is computed in the templates; a name
that they use and that is not given is an error.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from traceback import walk_tb

from jinja2 import Environment, FileSystemLoader, StrictUndefined, TemplateError, TemplateSyntaxError

from servogen.errors import Place, ServogenError

SUFFIXES = (".j2", ".asm")
"""Of templates: bodies and dialects, and the engines' assembly."""


class RenderError(ServogenError):
    """A template is wrong: its name and line."""


def filled(template: str, **values: object) -> str:
    """The text of a template. Raises RenderError, with the template's name and line."""
    try:
        return _environment().get_template(template).render(**values)
    except TemplateError as error:
        raise RenderError(error.message or "the template is wrong", _template_place(error)) from error


def _template_place(error: TemplateError) -> Place:
    """The template and line of an error: its own, or the last template line that was running."""
    if isinstance(error, TemplateSyntaxError):
        return Place(error.name, error.lineno)
    lines = [
        (frame.f_code.co_filename, line)
        for frame, line in walk_tb(error.__traceback__)
        if frame.f_code.co_filename.endswith(SUFFIXES)
    ]
    file, line = lines[-1] if lines else (None, None)
    return Place(Path(file).name if file else None, line)


@dataclass(frozen=True, slots=True)
class AsmLine:
    """A line of assembly; either may be empty."""

    code: str
    comment: str


def assembly(text: str) -> Iterator[AsmLine]:
    """The lines of assembly, whose comments each dialect writes in its own way."""
    for line in text.splitlines():
        code, _, comment = line.partition(";")
        yield AsmLine(code, comment.strip())


def template_folder() -> Path:
    """`templates/`: inside the package when installed from a wheel, beside it in a checkout."""
    package = Path(__file__).parent.parent
    inside = package / "templates"
    return inside if inside.is_dir() else package.parent / "templates"


@cache
def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(template_folder()),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
