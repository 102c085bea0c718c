"""JSON and YAML read into plain values; errors say the line, or the key of a value that is not as it should.

YAML needs the package pyyaml (the extra `ros`), JSON nothing.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NoReturn

from servogen.errors import InputError, Location, ToolError

MAX_YAML_CHARACTERS = 2_000_000
"""A longer text is refused: reading it would take minutes. The same motion as JSON or CSV may be longer."""


def json_document(text: str, file: str) -> Any:
    """Return a JSON document. Raises InputError with the line."""

    def strange(name: str) -> NoReturn:
        raise InputError("json-syntax", f"{name} is not a number", Location(file))

    try:
        return json.loads(text, parse_constant=strange)
    except json.JSONDecodeError as error:
        place = Location(file, error.lineno, error.colno)
        raise InputError("json-syntax", f"is not JSON: {error.msg}", place) from error
    except (RecursionError, ValueError) as error:  # nested too deep; an integer of thousands of digits
        raise InputError("json-syntax", "is not JSON of a motion", Location(file)) from error


def yaml_document(text: str, file: str) -> Any:
    """Return the first document of a YAML file. Raises InputError with the line, ToolError without pyyaml."""
    try:
        import yaml
    except ImportError as error:
        hint = "pip install 'servogen[ros]', or convert the file to JSON"
        raise ToolError("tool-missing", "YAML needs the package pyyaml", Location(file), hint) from error
    if len(text) > MAX_YAML_CHARACTERS:
        hint = f"at most {MAX_YAML_CHARACTERS} characters; as JSON or CSV it may be longer"
        raise InputError("file-too-large", f"has {len(text)} characters", Location(file), hint)
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        # `rostopic echo` ends a message with ---
        return next(iter(yaml.load_all(text, Loader=loader)), None)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = Location(file, mark.line + 1, mark.column + 1) if mark else Location(file)
        raise InputError("yaml-syntax", f"is not YAML: {error.problem or error.context}", place) from error
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError("yaml-syntax", "is not YAML of a motion", Location(file)) from error


def wrong(file: str, key: str, message: str, hint: str | None = None) -> InputError:
    """Return the error about a value of a document."""
    return InputError("bad-recording", message, Location(file, key=key), hint)


def number(value: Any, file: str, key: str) -> float:
    """Return a finite number. Raises InputError."""
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1e9:
        return float(value)
    shown = "infinite" if isinstance(value, float) and math.isinf(value) else repr(value)[:40]
    raise wrong(file, key, f"{shown} is not a number of at most 1e9")


def numbers(value: Any, count: int, file: str, key: str) -> list[float]:
    """Return a list of `count` numbers. Raises InputError."""
    if not isinstance(value, list) or len(value) != count:
        has = f"has {len(value)}" if isinstance(value, list) else "is none"
        raise wrong(file, key, f"must be a list of {count} numbers, one for each name; it {has}")
    return [number(each, file, f"{key}[{index}]") for index, each in enumerate(value)]


def table(value: Any, file: str, key: str) -> Mapping[str, Any]:
    """Return a table. Raises InputError."""
    if not isinstance(value, Mapping):
        raise wrong(file, key, "must be a table of keys and values")
    return value
