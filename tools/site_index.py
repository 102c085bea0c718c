"""A hook of mkdocs: the first page of the site is README.md, with its links as they are on the site."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files

README = Path(__file__).parent.parent / "README.md"


def index_page(readme: str) -> str:
    """Return the README for the site: links into docs/ lead to its pages, to other files they become text."""
    return re.sub(r"(?<!!)\[([^\]]*)\]\((?![a-z]+:|#|docs/)[^)]+\)", r"\1", readme).replace("](docs/", "](")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the first page."""
    from mkdocs.structure.files import File

    files.append(File.generated(config, "index.md", content=index_page(README.read_text("utf-8"))))
    return files
