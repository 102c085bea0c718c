"""The viewer of `servogen watch` inside a page that is one file: its modules as one script, and its data.

In: `templates/watch/`. Out: text to be put between the tags of a page, which then needs no server.
"""

from __future__ import annotations

import json
import re

from servogen.template_files import template_folder

MODULES = ("robot.js", "waves.js", "film.js")
"""The modules, in an order in which each comes after those that it imports."""

_IMPORT = re.compile(r"^import .*?;\n", re.MULTILINE)
_EXPORT = re.compile(r"^export ", re.MULTILINE)


def viewer_script() -> str:
    """Return the modules as one script; names are unique across them."""
    texts = [(template_folder() / "watch" / name).read_text("utf-8") for name in MODULES]
    return "".join(_EXPORT.sub("", _IMPORT.sub("", text)) for text in texts)


def viewer_colours() -> str:
    """Return the style sheet of the viewer's colours."""
    return (template_folder() / "watch" / "colours.css").read_text("utf-8")


def embedded_json(value: object) -> str:
    """Return a value as JSON that cannot end the script element around it."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")
