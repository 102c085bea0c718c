"""The project's page on a package index: README.md with links that work there.

An index shows the README without the repository around it, so relative links would lead nowhere. A link to
a file becomes its text, which names the file in the source distribution; pictures are omitted.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

RELATIVE = r"(?![a-z]+:|#)[^)]+"


def index_page(readme: str) -> str:
    """Returns the README for a package index."""
    text = re.sub(rf"^!\[[^\]]*\]\({RELATIVE}\)\n\n?", "", readme, flags=re.M)
    text = re.sub(rf"\[([^\]]*)\]\({RELATIVE}\)", r"\1", text)
    return text + "\nThe documents and jobs named here are in the source distribution.\n"


class Readme(MetadataHookInterface):  # type: ignore[misc]
    """Sets the readme of the package metadata."""

    def update(self, metadata: dict[str, Any]) -> None:
        readme = Path(self.root, "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": index_page(readme)}
