"""Exports of the add-on Blender Servo Animation: a position for each servo in each frame of the animation.

    .json   {"fps": 30, "positions": [{"0": 375, "1": 375}, {"1": 376}, …]}   by ID; what stays is left out
            {"fps": 30, "servos": {"0": {"name": "Bone", "positions": [375, …]}}}              its versions 1
    .h      FPS = 30, and ANIMATION_DATA[] = {0x3c, ID, high, low, 0x3e, …, 0x0a, …}: < position >, LF = frame
            FPS = 30, and for each servo an array Bone[] = {375, …}

A position is what the add-on's settings make it, which no export states: degrees, µs, or steps of a PCA9685.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from servogen.errors import InputError, Location
from servogen.recordings.documents import number, table, wrong
from servogen.recordings.recording import RecordedMotion, recording

FPS = re.compile(r"FPS\s*[:=]\s*(\d{1,4})\b")
ARRAY = re.compile(
    r"\b(?:int|byte|short|uint\d+_t|int\d+_t)\s+(?:PROGMEM\s+)?(\w+)\s*\[[^\]{]*\][^={;]*=\s*\{"
)
VALUE = re.compile(r"\s*(0[xX][0-9a-fA-F]{1,8}|\d{1,9})\s*(,|\})")
BEGIN, END, FRAME = 0x3C, 0x3E, 0x0A
"""The bytes that enclose a position, and the one after a frame."""

Frames = Sequence[tuple[Mapping[str, float], Location]]
"""The positions that each frame states, by the servo's name or ID."""


def is_blender(document: Any) -> bool:
    """Return whether a JSON document is an export of the add-on."""
    return isinstance(document, Mapping) and "fps" in document


def json_export(document: Any, file: str) -> RecordedMotion:
    """Return the recording in a JSON export. Raises InputError with the key."""
    fps = number(document["fps"], file, "fps")
    positions = document.get("positions")
    if isinstance(positions, list):
        rows = [
            (_positions(row, file, f"positions[{index}]"), Location(file, key=f"positions[{index}]"))
            for index, row in enumerate(positions)
        ]
        return _recording(rows, fps, file)
    tracks: dict[str, tuple[Any, str]] = {}
    for name, value in table(document.get("servos", positions), file, "servos").items():
        key = f"servos.{name}"
        if isinstance(value, Mapping):
            tracks[str(value.get("name", name))] = value.get("positions"), f"{key}.positions"
        else:
            tracks[name] = value, f"positions.{name}"
    return _from_arrays(tracks, fps, file)


def header_file(text: str, file: str) -> RecordedMotion:
    """Return the recording in an Arduino header. Raises InputError with the line."""
    rate, arrays = FPS.search(text), list(_arrays(text, file))
    if rate is None or not arrays:
        missing = "FPS" if rate is None else "array of positions"
        raise wrong(file, "", f"has no {missing}", "exports of Blender Servo Animation have both")
    fps = float(rate[1])
    commands = next((values for name, values in arrays if name == "ANIMATION_DATA"), None)
    if commands is None:
        tracks = {name: ([value for value, _ in values], name) for name, values in arrays}
        return _from_arrays(tracks, fps, file)
    return _recording(_command_frames(commands, file), fps, file)


def _command_frames(data: Sequence[tuple[int, int]], file: str) -> Frames:
    """Return the frames of commands, given as (byte, line)."""
    frames: list[tuple[dict[str, float], Location]] = []
    row: dict[str, float] = {}
    at = 0
    while at < len(data):
        byte, line = data[at]
        place = Location(file, line)
        if byte == FRAME:
            frames.append((row, place))
            row, at = {}, at + 1
            continue
        command = [value for value, _ in data[at : at + 5]]
        if len(command) < 5 or command[0] != BEGIN or command[4] != END:
            raise InputError(
                "bad-recording",
                f"byte {at} of ANIMATION_DATA, {byte:#04x}, begins no command",
                place,
                "a command is 0x3c, ID, position high, low, 0x3e; 0x0a ends a frame",
            )
        row[str(command[1])] = command[2] << 8 | command[3]
        at += 5
    return [*frames, (row, Location(file, data[-1][1]))] if row else frames


def _arrays(text: str, file: str) -> Iterator[tuple[str, list[tuple[int, int]]]]:
    """Yield the name of each array, and its values with their lines."""
    for found in ARRAY.finditer(text):
        line, at = text.count("\n", 0, found.end()) + 1, found.end()
        values: list[tuple[int, int]] = []
        while (value := VALUE.match(text, at)) is not None:
            line += text.count("\n", at, value.start(1))
            values.append((int(value[1], 0) if value[1][:2] in ("0x", "0X") else int(value[1]), line))
            line, at = line + text.count("\n", value.start(1), value.end()), value.end()
            if value[2] == "}":
                break
        else:
            rest = text[at : at + 200].lstrip()
            line += text.count("\n", at, at + len(text[at : at + 200]) - len(rest))
            if not rest.startswith("}"):
                raise InputError(
                    "bad-recording",
                    f"{found[1]}: '{rest[:12].split()[0].rstrip(',') if rest else ''}' is no position",
                    Location(file, line),
                )
        if values:
            yield found[1], values


def _positions(row: Any, file: str, key: str) -> Mapping[str, float]:
    return {name: number(value, file, f"{key}.{name}") for name, value in table(row, file, key).items()}


def _from_arrays(tracks: Mapping[str, tuple[Any, str]], fps: float, file: str) -> RecordedMotion:
    """Return the recording of servos that state a position for each frame."""
    lengths = set()
    for values, key in tracks.values():
        if not isinstance(values, list):
            raise wrong(file, key, "must be a list of positions")
        lengths.add(len(values))
    if len(lengths) > 1:
        counts = " and ".join(str(length) for length in sorted(lengths))
        raise wrong(file, next(iter(tracks.values()))[1], f"the servos have {counts} positions")
    rows = [
        (
            {name: number(values[frame], file, f"{key}[{frame}]") for name, (values, key) in tracks.items()},
            Location(file, key=f"frame {frame}"),
        )
        for frame in range(max(lengths, default=0))
    ]
    return _recording(rows, fps, file)


def _recording(frames: Frames, fps: float, file: str) -> RecordedMotion:
    """Return the recording; a servo that a frame does not state keeps its position."""
    if not 0 < fps <= 1000:
        raise wrong(file, "fps", f"{fps:g} frames per second", "0 to 1000")
    names = list(frames[0][0]) if frames else []
    here: dict[str, float] = {}
    samples = []
    for index, (row, place) in enumerate(frames):
        new = next((name for name in row if name not in names), None)
        if new is not None:
            raise InputError("bad-recording", f"servo {new} has no position in the first frame", place)
        here |= row
        samples.append((index / fps, [here[name] for name in names], place))
    return recording(file, names, [""] * len(names), samples)
