"""What the build of the package does beside copying files: its page, and its parts in C.

The page on a package index is README.md with links that work there.

An index shows the README without the repository around it, so relative links would lead nowhere. A link to
a file becomes its text, which names the file in the source distribution; pictures are omitted.

The parts in C (`servogen/native.py`) are libraries with a plain C interface: one wheel of a system suits
every Python. They need a compiler and nothing else, and are compiled in place for an editable installation.
"""

from __future__ import annotations

import re
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
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


class Compile(BuildHookInterface):  # type: ignore[misc]
    """Compiles the parts in C, and marks the wheel as one for this system."""

    made = tempfile.TemporaryDirectory()

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        sys.path.insert(0, self.root)  # the headers are made from tables of the package
        from servogen.native import parts

        if self.target_name == "sdist":
            return
        system = re.sub(r"[-. ]", "_", sysconfig.get_platform())
        build_data |= {"pure_python": False, "tag": f"py3-none-{system}"}
        for part in parts():
            if version == "editable":
                part.refresh()
            else:
                library = Path(self.made.name, part.library.name)
                part.compile(library)
                build_data["force_include"][str(library)] = str(part.library.relative_to(self.root))

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        self.made.cleanup()
