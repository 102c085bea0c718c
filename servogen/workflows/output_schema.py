"""The JSON schema of what commands print with `--json`: each number has its unit in its name.

In: nothing. Out: a schema of draft 7, for whatever reads the outputs. A name that ends with a unit holds
numbers in that unit, alone, in lists, or by the names of servos, pins or joints; a name of `UNITLESS` holds
numbers that have none; no other field holds a number.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import TypeAdapter

from servogen.errors import Diagnostic, Location
from servogen.toml.file import UNITS
from servogen.workflows.schemas import DRAFT

OUTPUT_UNITS = frozenset(
    {
        *UNITS,
        *("seconds", "cycles", "cycle", "frames", "frame", "words", "bytes", "count", "percent", "ppm"),
        *("n", "as", "nm", "m_s", "turns_per_s", "counts_per_s", "per_second", "per_turn", "us_per_deg"),
    }
)
"""The units that a name may end with, after an underscore."""

UNITLESS = {
    "counts": (
        *("edges", "pulses", "observed_pulses", "scheduled_pulses", "captured_pulses", "extra_pulses"),
        *(
            "missing_pulses",
            "joints",
            "glitches",
            "loop_repeats",
            "deepest_stack",
            "stack_wraps",
            "executions",
        ),
        *("elements", "rank", "closed_loops", "passive_joints", "mobility", "manoeuvrability", "resets"),
        *("found", "different_frames_seen", "lead_in_only_frames_seen", "loop_frames_seen", "counters"),
        *("ram_high_water", "seen", "breaches", "states", "runs", "forks", "visits", "repeats", "chips"),
        "poses",
        *("captures", "commands", "rounds", "outages", "ram_left", "words_left", "saved_by_pass", "points"),
        *("max_points", "rows", "script", "timings", "laws", "slots_between_commands", "not_allowed", "pins"),
    ),
    "ratios and phases": (
        *("duty", "lifts", "swing_beyond", "coverage", "ratio", "asked", "used", "manipulability", "gear"),
        *("radius_in_wheel_distances", "amplitude"),
    ),
    "places: frames, cells, registers, lines of a file": (
        *("loop_start", "pc", "w", "status", "registers", "ram", "eeprom", "unexecuted", "line", "column"),
        *("levels", "level", "held", "value", "eeprom_first", "address", "read_unwritten", "position"),
        *("sent", "number"),
    ),
    "matrices and directions; translations in the unit that was typed": (
        *("rotation", "matrix", "axis", "quaternion", "jacobian", "inverse", "lost_directions"),
        *("configuration_vector", "turning", "change", "delta", "frame", "translation"),
        *("point", "base", "tool"),
    ),
}
"""The names of numbers without a unit, by what they are."""


def output_schema() -> dict[str, Any]:
    """Return the schema of an output; it holds for every line of those that are printed line by line."""
    fields: dict[str, Any] = {
        "type": "object",
        "patternProperties": {
            _ending(OUTPUT_UNITS, "(^|_)"): {"$ref": "#/definitions/measured"},
            **{
                _ending(names, "^"): {"$ref": "#/definitions/unitless", "description": kind}
                for kind, names in UNITLESS.items()
            },
        },
        "additionalProperties": {"$ref": "#/definitions/value"},
    }
    either, number = (
        {"type": ["string", "boolean", "null"]},
        {"type": ["number", "string", "boolean", "null"]},
    )
    by_name = {"type": "object", "additionalProperties": number}
    return {
        "$schema": DRAFT,
        "title": "servogen output",
        "description": "What a command prints with --json; the end of a name is its numbers' unit.",
        "allOf": [{"$ref": "#/definitions/fields"}],
        "properties": {"diagnostics": {"type": "array", "items": {"$ref": "#/definitions/diagnostic"}}},
        "definitions": {
            "fields": fields,
            "measured": _or_lists("measured", number, {"type": "object", "additionalProperties": MEASURED}),
            "unitless": _or_lists("unitless", number, by_name, FIELDS),
            "value": _or_lists("value", either, FIELDS),
            "diagnostic": _diagnostic(),
        },
    }


FIELDS, MEASURED = {"$ref": "#/definitions/fields"}, {"$ref": "#/definitions/measured"}


def _or_lists(name: str, *choices: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of one of the choices, or of lists of them."""
    return {"anyOf": [*choices, {"type": "array", "items": {"$ref": f"#/definitions/{name}"}}]}


def _ending(names: Iterable[str], before: str) -> str:
    """Return the pattern of the names that end so."""
    return f"{before}({'|'.join(sorted(names))})$"


def _diagnostic() -> dict[str, Any]:
    """Return the schema of an error or a warning, whose place stands among its other fields."""
    own, place = (TypeAdapter(kind).json_schema()["properties"] for kind in (Diagnostic, Location))
    properties = {key: value for key, value in (own | place).items() if key != "location"}
    return {"type": "object", "properties": properties, "required": ["severity", "code", "message"]}
