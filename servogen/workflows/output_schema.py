"""The JSON schemas of what commands print with `--json`, made of the types of `servogen.answers`.

In: the name of a command, or none. Out: a schema of draft 7 with the required and the allowed keys, their
types and meanings; `unit` is that of a number: the end of its name, or what the names of `UNITLESS` are.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from types import MappingProxyType, NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NotRequired,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from servogen import answers
from servogen.toml.file import UNITS
from servogen.workflows.schemas import DRAFT, Schema

OUTPUT_UNITS = frozenset(
    {
        *UNITS,
        *("seconds", "cycles", "cycle", "frames", "frame", "words", "bytes", "count", "percent", "ppm"),
        *("n", "as", "nm", "m_s", "turns_per_s", "counts_per_s", "per_second", "per_turn", "us_per_deg"),
    }
)
"""The units that a name may end with, after an underscore."""

UNITLESS = {
    "number": (
        *("edges", "pulses", "observed_pulses", "scheduled_pulses", "captured_pulses", "extra_pulses"),
        *("missing_pulses", "joints", "glitches", "loop_repeats", "deepest_stack", "stack_wraps"),
        *("executions", "elements", "rank", "closed_loops", "passive_joints", "mobility", "manoeuvrability"),
        *("resets", "found", "different_frames_seen", "lead_in_only_frames_seen", "loop_frames_seen"),
        *("counters", "ram_high_water", "seen", "breaches", "states", "runs", "forks", "visits", "chips"),
        *("poses", "captures", "commands", "rounds", "outages", "ram_left", "words_left", "saved_by_pass"),
        *(
            "points",
            "max_points",
            "spline_teeth",
            "rows",
            "script",
            "timings",
            "laws",
            "not_allowed",
            "pins",
            "levels",
        ),
    ),
    "ratio": (
        *("duty", "lifts", "swing_beyond", "coverage", "ratio", "asked", "used", "manipulability", "gear"),
        *("radius_in_wheel_distances", "amplitude"),
    ),
    "place": (
        *("loop_start", "pc", "w", "status", "registers", "ram", "eeprom", "unexecuted", "line", "column"),
        *("level", "held", "value", "eeprom_first", "address", "read_unwritten", "position", "number"),
        "serial_ports",
    ),
    "component": (
        *("rotation", "matrix", "axis", "quaternion", "jacobian", "inverse", "lost_directions"),
        *("configuration_vector", "turning", "change", "delta", "translation", "point"),
    ),
}
"""The names of numbers without a unit, by what they are."""

OUTPUTS: Mapping[str, tuple[type, ...]] = MappingProxyType(
    {
        "check": (answers.CheckAnswer, answers.PairCheckAnswer),
        "plan": (answers.PlanAnswer,),
        "build": (answers.BuildAnswer, answers.PairBuildAnswer),
        "demo": (answers.DemoAnswer,),
        "report": (answers.ReportAnswer, answers.PairReportAnswer),
        "tune": (answers.TuneAnswer,),
        "import": (answers.ImportAnswer, answers.ComparedMotion),
        "compile": (answers.CompileAnswer,),
        "simulate": (answers.SimulateAnswer,),
        "verify": (
            *(answers.VerifyAnswer, answers.VerifyCaptureAnswer, answers.ForeverAnswer),
            *(answers.VerifyContractAnswer, answers.PairVerdictAnswer, answers.PairCaptureAnswer),
        ),
        "measure": (answers.MeasureAnswer,),
        "prove": (
            *(answers.FactsAnswer, answers.ProofAnswer, answers.ContractProofAnswer),
            answers.PairProofAnswer,
        ),
        "check-certificate": (answers.ValidCertificate, answers.RefusedCertificate),
        "robots": (answers.RobotsAnswer, answers.ArmAnswer, answers.HexapodAnswer, answers.OmniAnswer),
        "servos": (answers.ServosAnswer, answers.ServoAnswer),
        "fk": (answers.ArmPose, answers.FeetAnswer, answers.BodySpeed, answers.SymbolicPose),
        "ik": (answers.SolutionsAnswer, answers.WheelSpeeds),
        "jacobian": (answers.JacobianAnswer, answers.BaseJacobian, answers.SymbolicJacobian),
        "statics": (answers.StaticsAnswer,),
        "transform": (answers.TransformAnswer,),
        "orientation": (answers.OrientationAnswer,),
        "differential": (answers.DifferentialAnswer,),
        "equation": (answers.EquationAnswer,),
        "mobility": (answers.MobilityAnswer,),
        "gait": (answers.GaitAnswer,),
        "run-program": (answers.RunProgramAnswer,),
        "flash": (answers.FlashAnswer, answers.FlashCommand),
        "capture": (answers.CaptureAnswer, answers.SigrokAnswer),
        "rig": (answers.RigAnswer,),
        "drive": (
            *(answers.DriveAnswer, answers.DrivenPosition, answers.DriveCommand, answers.DriveEvent),
            *(answers.CommandedAnswer, answers.CommandedFrameAnswer),
        ),
        "calibrate": (answers.CalibrateAnswer,),
        "twin": (answers.TwinAnswer,),
        "grade": (answers.GradeAnswer,),
        "doctor": (answers.DoctorAnswer,),
    }
)
"""What each command prints: one of these types, beside its diagnostics, or `Refusal`."""

LINES = (answers.DrivenPosition, answers.DriveCommand, answers.DriveEvent, answers.CommandedFrameAnswer)
"""Lines of a log, which have no diagnostics."""


def output_schema(command: str | None = None) -> Schema:
    """Return the schema of what a command prints, or of what all commands print: a definition for each."""
    made = _Definitions()
    for name, types in OUTPUTS.items():
        if command in (None, name):
            made.printed(name, types)
    name = "output" if command is None else command
    of_each = [_reference(each) for each in OUTPUTS if command in (None, each)]
    return {
        "$schema": DRAFT,
        "title": f"servogen {name}",
        "description": "What is printed with --json, a document or a line each.",
        **(of_each[0] if len(of_each) == 1 else {"anyOf": of_each}),
        "definitions": made.found,
    }


def unit_of(name: str) -> str | None:
    """Return the unit, or the meaning, of the numbers under a name; None if the name does not tell."""
    for kind, names in UNITLESS.items():
        if name in names:
            return kind
    ends = (unit for unit in OUTPUT_UNITS if name == unit or name.endswith(f"_{unit}"))
    return max(ends, key=len, default=None)


def _reference(name: str) -> Schema:
    return {"$ref": f"#/definitions/{name}"}


class _Definitions:
    """The definitions of a schema, each made once."""

    def __init__(self) -> None:
        self.found: dict[str, Schema] = {}

    def printed(self, command: str, types: Iterable[type]) -> None:
        """Define what a command prints."""
        self.found[command] = {}  # keeps its place before the definitions that it needs
        printed = [self._object(each, whole=each not in LINES) for each in types]
        refusal = answers.Refusal.__name__
        if refusal not in self.found:
            self.found[refusal] = self._object(answers.Refusal, whole=True)
        self.found[command] = {"anyOf": [*printed, _reference(refusal)]}

    def of(self, name: str, kind: Any) -> Schema:
        """Return the schema of the values of a type, under a key of this name."""
        origin, parts = get_origin(kind), get_args(kind)
        if origin is NotRequired:
            return self.of(name, parts[0])
        if origin is Annotated:
            made = self.of(name, parts[0])
            described = {"allOf": [made]} if "$ref" in made else made  # a reference stands alone in draft 7
            return {**described, "description": parts[1]}
        if is_typeddict(kind):
            if kind.__name__ not in self.found:
                self.found[kind.__name__] = {}  # keeps its place, too
                self.found[kind.__name__] = self._object(kind)
            return _reference(kind.__name__)
        if origin in (Union, UnionType):
            return {"anyOf": [self.of(name, part) for part in parts]}
        if origin is Literal:
            return {"enum": list(parts)}
        if origin is list:
            return {"type": "array", "items": self.of(name, parts[0])}
        if origin is dict:
            return self._by_name(name, parts[1])
        return _plain(name, kind)

    def _by_name(self, name: str, kind: Any) -> Schema:
        """Return the schema of values by names; where the key says no unit, those names do."""
        if kind not in (int, float) or unit_of(name) is not None:
            return {"type": "object", "additionalProperties": self.of(name, kind)}
        ends = {unit: _plain(unit, kind) for unit in OUTPUT_UNITS}
        return {
            "type": "object",
            "patternProperties": {f"_{unit}$": made for unit, made in sorted(ends.items())},
            "additionalProperties": False,
        }

    def _object(self, kind: Any, *, whole: bool = False) -> Schema:
        """Return the schema of a type; a whole document begins with its diagnostics."""
        hints = get_type_hints(kind, include_extras=True)
        fields = {key: self.of(key, hint) for key, hint in hints.items()}
        required = sorted(kind.__required_keys__)
        if whole:
            listed = {"type": "array", "items": self.of("", answers.DiagnosticAnswer)}
            if kind is answers.Refusal:
                listed["contains"] = {"properties": {"severity": {"const": "error"}}}
            fields = {"diagnostics": {**listed, "description": "Errors and warnings."}, **fields}
            required = ["diagnostics", *required]
        return {
            "type": "object",
            "description": inspect.cleandoc(kind.__doc__ or ""),
            "properties": fields,
            "required": required,
            "additionalProperties": False,
        }


def _plain(name: str, kind: Any) -> Schema:
    """Return the schema of a value that is no container."""
    types = {str: "string", bool: "boolean", NoneType: "null", int: "integer", float: "number"}
    made: Schema = {"type": types[kind]}
    unit = unit_of(name) if kind in (int, float) else None
    return made if unit is None else {**made, "unit": unit}
