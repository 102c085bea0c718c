"""The viewer of `servogen watch`, as one module: served by it, and inside of pages that are one file.

In: `templates/watch/`. Out: text to be put between the tags of a page, which then needs no server.
"""

from __future__ import annotations

import json

from servogen.template_files import template_folder

PARTS = ("robot.js", "waves.js", "film.js")
"""The parts of the module, each after those whose names it uses.

They import nothing, so that they are joined as they stand; a name that two of them define is a syntax error.
"""


def viewer_module() -> str:
    """Return the parts as one module of JavaScript."""
    return "".join((template_folder() / "watch" / name).read_text("utf-8") for name in PARTS)


def viewer_colours() -> str:
    """Return the style sheet of the viewer's colours."""
    return (template_folder() / "watch" / "colours.css").read_text("utf-8")


def embedded_json(value: object) -> str:
    """Return a value as JSON that cannot end the script element around it."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")
