"""Clones of public repositories, FOLDER/OWNER/NAME: commands read programs from them, none is kept here."""

from __future__ import annotations

import subprocess
from pathlib import Path


def unpack(clones: Path, repository: str, commit: str, folder: str, into: Path) -> None:
    """Write a folder of a repository, as it was at a commit, into another folder."""
    archive = subprocess.run(
        ["git", "-C", clones / repository, "archive", f"{commit}:{folder}"], check=True, capture_output=True
    )
    subprocess.run(["tar", "-x", "-C", into], check=True, input=archive.stdout)
