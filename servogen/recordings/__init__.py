"""Motions that other programs wrote: CSV, ROS JointTrajectory (YAML, JSON), exports of Blender.

In: a file. Out: a `RecordedMotion`, tracks by name over time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from servogen.errors import InputError, Location
from servogen.inputs import read_input
from servogen.recordings.blender import header_file, is_blender, json_export
from servogen.recordings.csv_file import csv_tracks
from servogen.recordings.documents import json_document, yaml_document
from servogen.recordings.recording import RecordedMotion
from servogen.recordings.ros import joint_trajectory

MAX_BYTES = 8 << 20
"""The maximum size of a recording: half an hour of 13 servos at 50 Hz as text."""


def _json(text: str, file: str) -> RecordedMotion:
    document = json_document(text, file)
    return json_export(document, file) if is_blender(document) else joint_trajectory(document, file)


def _yaml(text: str, file: str) -> RecordedMotion:
    return joint_trajectory(yaml_document(text, file), file)


READERS: Mapping[str, Callable[[str, str], RecordedMotion]] = MappingProxyType(
    {".csv": csv_tracks, ".json": _json, ".yaml": _yaml, ".yml": _yaml, ".h": header_file}
)
"""The text of a file and its name -> its recording, by the file's suffix."""


def read(path: Path) -> RecordedMotion:
    """Return the recording in a file. Raises InputError; ToolError if YAML needs a package."""
    if path.suffix.lower() not in READERS:
        raise InputError(
            "unknown-suffix",
            f"motions are not read from {path.suffix or 'files without a suffix'}",
            Location(str(path)),
            f"a motion is one of {', '.join(READERS)}",
        )
    try:
        text = read_input(path, MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("not-utf8", "is not UTF-8 text", Location(str(path))) from error
    return READERS[path.suffix.lower()](text, str(path))


__all__ = ["RecordedMotion", "read"]
