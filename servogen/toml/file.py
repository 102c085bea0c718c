"""TOML files as checked values, every error with its line, its column and its key.

In: the text of a TOML file and a model (a subclass of `Table`). Out: the model's frozen value and a
`Document` that has the location of each key.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError

from servogen.errors import InputError, Location, did_you_mean
from servogen.inputs import read_input
from servogen.toml.locations import Key, TooMuch, find_places

UNITS = {
    *("us", "ms", "s", "deg", "rad", "mm", "cm", "m", "hz", "khz", "mhz", "v", "mv", "a", "ma", "nm", "ncm"),
    *("kg", "g", "deg_s", "rad_s", "mm_s", "deg_s2", "rad_s2", "mm_s2"),
}
"""The units that a key may end with, after an underscore."""


class Table(BaseModel):
    """A TOML table: unknown keys, wrong types (a boolean is not a number), NaN and infinity are rejected."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)


Model = TypeVar("Model", bound=Table)


@dataclass(frozen=True, slots=True)
class Document:
    """A parsed file: its values (arrays as tuples) and the position (line, column) of each key."""

    file: str
    data: Mapping[str, Any]
    places: Mapping[Key, tuple[int, int]]

    def place(self, *key: str | int) -> Location:
        """Return the location of `key`, or of the nearest table around it that is written in the file."""
        for end in range(len(key), 0, -1):
            if key[:end] in self.places:
                line, column = self.places[key[:end]]
                return Location(self.file, line, column, key_text(key))
        return Location(self.file, key=key_text(key))

    def error(self, code: str, key: Key, message: str, hint: str | None = None) -> InputError:
        """Return an error at the location of `key`."""
        return InputError(code, message, self.place(*key), hint)

    def check_known(self, code: str, key: Key, word: str, known: Collection[str], message: str) -> None:
        """Raise InputError at the location of `key` for a word that is not known."""
        if word not in known:
            raise self.error(code, key, message, did_you_mean(word, known))


def load(path: str | Path, model: type[Model]) -> tuple[Document, Model]:
    """Return the file at `path`, validated against `model`. Raises InputError."""
    document = read(path)
    return document, validate(document, model)


def read(path: str | Path) -> Document:
    """Return the file at `path`, parsed but not validated. Raises InputError."""
    return parse(read_text(path), str(path))


def read_text(path: str | Path) -> str:
    """Return the text of the file at `path`. Raises InputError."""
    raw = read_input(path)
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise InputError(
            "not-utf8", "is not UTF-8 text", Location(str(path), line), "TOML files are UTF-8"
        ) from error


def parse(text: str, file: str) -> Document:
    """Return `text` as a document named `file`. Raises InputError with line and column for a syntax error."""
    text = text.replace("\r\n", "\n")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _syntax_error(text, file, str(error)) from error
    except ValueError as error:  # a number of thousands of digits
        digits = re.search(r"\d[\d_]{4000}", text)
        line = text.count("\n", 0, digits.start()) + 1 if digits else None
        message = "a number has thousands of digits" if digits else f"TOML syntax: {error}"
        raise InputError("toml-syntax", message, Location(file, line), _WHOLE_RANGE) from error
    except RecursionError as error:
        raise InputError(
            "file-too-large", "tables or arrays are nested too deeply", Location(file)
        ) from error
    try:
        document = Document(file, _frozen(data), find_places(text))
        _check_range(document, document.data, ())
        return document
    except TooMuch as error:
        raise InputError("file-too-large", error.message, Location(file, error.line), error.hint) from error
    except RecursionError as error:
        raise InputError(
            "file-too-large", "tables or arrays are nested too deeply", Location(file)
        ) from error


def validate(document: Document, model: type[Model], key: Key = ()) -> Model:
    """Return the value of `model` in `document` at `key`. Raises InputError for the first error."""
    data: Any = document.data
    for step in key:
        data = data[step]
    try:
        return model.model_validate(data)
    except ValidationError as error:
        details = [dict(detail) for detail in error.errors(include_url=False)]
        causes = [detail for detail in details if not _consequence(detail)]
        # A missing key comes last: its location is the table, above the misspelt key that explains it.
        first = min(causes, key=lambda detail: _order(document, key, detail))
        raise _input_error(document, model, key, first) from error


def unknown_key(document: Document, key: Key, known: Iterable[str]) -> InputError:
    """Return the error for a key that is not in `known`; a missing or wrong unit has its own message."""
    names = sorted(known)
    word = str(key[-1])
    stem, unit = split_unit(word)
    for name in names:
        other_stem, other_unit = split_unit(name)
        if other_unit and other_stem == stem:
            if unit:
                instead = f"{name}{_conversion_text(document, key, unit, other_unit)}"
                return document.error("wrong-unit", key, f"'{word}' is not given in {unit}: write {instead}")
            return document.error("wrong-unit", key, f"'{word}' has no unit: write {name}")
    return document.error("unknown-key", key, f"unknown key '{word}'", did_you_mean(word, names))


SI = {"us": -6, "ms": -3, "s": 0, "mm": -3, "cm": -2, "m": 0, "hz": 0, "khz": 3, "mhz": 6, "mv": -3, "v": 0}
SI |= {"ma": -3, "a": 0}
"""Units of one quantity each, as powers of ten of its SI unit."""
QUANTITIES = (("us", "ms", "s"), ("mm", "cm", "m"), ("hz", "khz", "mhz"), ("mv", "v"), ("ma", "a"))


def _conversion_text(document: Document, key: Key, unit: str, other: str) -> str:
    """Return " = 2" for a value of 2000 in ms that should be in s; empty where the units do not fit."""
    value: Any = document.data
    for step in key:
        value = value[step]
    alike = any({unit, other} <= set(quantity) for quantity in QUANTITIES)
    if not alike or isinstance(value, bool) or not isinstance(value, int | float):
        return ""
    return f" = {value * 10.0 ** (SI[unit] - SI[other]):.12g}"


def split_unit(word: str) -> tuple[str, str]:
    """Return the name and the unit of a key: ("period", "us") for "period_us", ("pin", "") for "pin"."""
    parts = word.split("_")
    for start in range(1, len(parts)):
        unit = "_".join(parts[start:])
        if unit.lower() in UNITS:
            return "_".join(parts[:start]), unit
    return word, ""


def exact(number: float) -> Fraction:
    """Return the number as it is written: 0.1 in a file is a tenth."""
    return Fraction(repr(number)) if isinstance(number, float) else Fraction(number)


def key_text(key: Key) -> str:
    """Return a key as people write it: servo[1].trim_us, with arrays counted from 1."""
    text = ""
    for step in key:
        text += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if text else step
    return text


_WHOLE_RANGE = "whole numbers are those of 64 bits: -2^63 to 2^63 - 1"


def _check_range(document: Document, value: Any, key: Key) -> None:
    """Raise InputError for integers of more than 64 bits, which TOML does not have."""
    if isinstance(value, dict):
        for name, item in value.items():
            _check_range(document, item, (*key, name))
    elif isinstance(value, tuple):
        for index, item in enumerate(value):
            if not isinstance(item, float | str):
                _check_range(document, item, (*key, index))
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise document.error("out-of-range", key, f"{shown(value)} is too large", _WHOLE_RANGE)


def _frozen(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _frozen(item) for name, item in value.items()}
    return tuple(_frozen(item) for item in value) if isinstance(value, list) else value


def _syntax_error(text: str, file: str, detail: str) -> InputError:
    match = re.search(r" \(at (?:line (\d+), column (\d+)|end of document)\)$", detail)
    message = detail[: match.start()] if match else detail
    if match and match[1]:
        line, column = int(match[1]), int(match[2])
    else:
        line, column = text.count("\n") + 1, len(text) - text.rfind("\n")
    whole = text.split("\n")[line - 1]
    shown, before, behind = whole.strip(), whole[: column - 1], whole[column - 1 :]
    message = next(
        (
            plain
            for pattern, there, plain in _PLAIN
            if re.match(pattern, message) and re.search(there, f"{before}\0{behind}")
        ),
        message[:1].lower() + message[1:],
    )
    return InputError(
        "toml-syntax",
        f"TOML syntax: {message}",
        Location(file, line, column),
        f"in: {shown}" if shown else None,
    )


# tomllib's message, the line with \0 where it stopped -> the cause, as a user knows it; the first that fits.
_UNIT = r"=\s*[-+]?[\d._]+[ \t]*\0[ \t]*[°µ%/A-Za-z]+\s*([,}\]#]|$)"
_PLAIN = (
    (r"Illegal character '\\n'", "", "this text has no closing quote"),
    (
        r"Invalid value",
        r"\0(?i:true|false|yes|no|on|off)\b",
        "not a value: write true or false, in small letters",
    ),
    (r"Invalid value", "\0[“”„‘’«»]", 'not a value: the quotes are "straight" ones'),
    (r"Invalid value", "", 'not a value: put text in "quotes"; an array above may lack its ]'),
    (r"Unclosed array", "", "an array above lacks its ]"),
    (r"Cannot overwrite a value", "", "this name is given twice"),
    (
        r"Cannot declare \(.*\) twice",
        "",
        "this table is given twice; one of several has two brackets: [[ … ]]",
    ),
    (r"Expected '=' after a key", r"\d,\d+[ \t]*\0", "a number has a decimal point, not a comma"),
    (r"Expected '=' after a key", "", "a key, then =, then its value"),
    (
        r"Unclosed inline table|Expected newline",
        _UNIT,
        "a number has no unit behind it: the key's name says the unit",
    ),
    (r"Expected newline", r"\d[ \t]*\0,\d", "a number has a decimal point, not a comma"),
    (
        r"Unclosed inline table|Invalid initial character",
        r"\{[^}]*\0\s*(#.*)?$",
        "an inline table lacks its }",
    ),
)


# What pydantic finds, as a sentence: the kind of error -> what is allowed there.
_ALLOWED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": 'a text in "quotes"',
    "bool_type": "true or false",
    "tuple_type": "an array [ … ]",
    "model_type": "a table { … }",
    "dict_type": "a table { … }",
    "finite_number": "a finite number",
}
_BOUNDS = {
    "greater_than": ("more than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}


def _input_error(document: Document, model: type[Table], root: Key, detail: Mapping[str, Any]) -> InputError:
    kind, where = str(detail["type"]), tuple(detail["loc"])
    key, context = root + where, detail.get("ctx", {})
    if kind == "extra_forbidden":
        return unknown_key(document, key, _known_keys(model, where[:-1]))
    if kind == "missing":
        if where and isinstance(where[-1], int):
            return document.error(
                "wrong-type", key[:-1], f"has too few values: number {where[-1] + 1} is missing"
            )
        return document.error(
            "missing-key", key[:-1], f"'{key[-1]}' is missing", f"add {_missing_key_text(model, key, where)}"
        )
    if kind == "value_error":
        return document.error("not-allowed", key, str(context["error"]))
    value = shown(detail["input"])
    if kind == "literal_error":
        return document.error(
            "not-allowed", key, f"{value} is not allowed here", f"allowed: {context['expected']}"
        )
    if kind in _BOUNDS:
        words, name = _BOUNDS[kind]
        return document.error(
            "out-of-range", key, f"{value} is out of range: {words} {context[name]:g} is allowed"
        )
    if kind in ("too_short", "too_long"):
        count = context["actual_length"]
        return document.error(
            "wrong-type", key, f"has {count} value{'s' if count != 1 else ''}", _length_hint(kind, context)
        )
    if kind in _ALLOWED:
        return document.error(
            "wrong-type", key, f"{value} is not {_ALLOWED[kind]}", _type_hint(kind, key, detail["input"])
        )
    if kind == "string_pattern_mismatch":
        return document.error(
            "wrong-type", key, f"{value} is not a name", "a letter, then letters, digits, _ or -"
        )
    return document.error("not-allowed", key, f"{value}: {detail['msg']}")


def _consequence(detail: Mapping[str, Any]) -> bool:
    """Return whether an error only follows from that of an element: its array then counts as too short."""
    return bool(detail["type"] == "too_short" and len(detail["input"]) >= detail["ctx"]["min_length"])


def _length_hint(kind: str, context: Mapping[str, Any]) -> str:
    return f"at least {context['min_length']}" if kind == "too_short" else f"at most {context['max_length']}"


def _type_hint(kind: str, key: Key, given: Any) -> str | None:
    """Return how to write one of several tables, or a number such as 4e6, which is an integer in TOML only if
    written as one.
    """
    if kind == "tuple_type" and isinstance(given, dict) and len(key) == 1:
        return f"one of several has two brackets: [[{key[0]}]]"
    whole = kind == "int_type" and isinstance(given, float) and given.is_integer() and abs(given) < 1e15
    return f"without a point and an exponent: {int(given):_}" if whole else None


def _missing_key_text(model: type[Table], key: Key, where: Key) -> str:
    """Return how a missing key is written: a table has its own heading."""
    fields = [table.model_fields.get(str(where[-1])) for table in _tables(model, where[:-1])]
    annotation = next((field.annotation for field in fields if field), None)
    if len(key) > 1 or not any(_models(annotation)):
        return f"{key_text(key)} = …"
    return f"[[{key[0]}]]" if get_origin(annotation) is tuple else f"[{key[0]}]"


def _order(document: Document, root: Key, detail: Mapping[str, Any]) -> tuple[bool, int, int]:
    """Return the sort key of an error: missing keys come after all others, then the position counts."""
    where = tuple(detail["loc"])
    missing = detail["type"] == "missing"
    place = document.place(*root, *(where[:-1] if missing else where))
    return missing and not isinstance(where[-1], int), place.line or 0, place.column or 0


def shown(value: Any) -> str:
    """Return a value as TOML writes it, shortened."""
    if isinstance(value, tuple):
        text = f"[{', '.join(shown(item) for item in value)}]"
    elif isinstance(value, dict):
        text = f"{{ {', '.join(f'{name} = {shown(item)}' for name, item in value.items())} }}"
    elif isinstance(value, str):
        text = f'"{value}"'
    else:
        text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= 40 else f"{text[:37]}…"


def _known_keys(model: type[Table], where: Key) -> Iterator[str]:
    """Yield the names of the fields of the table that is at `where` in `model`."""
    for table in _tables(model, where):
        for name, field in table.model_fields.items():
            yield field.alias or name


def _tables(model: type[Table], where: Key) -> list[type[BaseModel]]:
    """Return the models that the table at `where` in `model` may be."""
    tables: list[type[BaseModel]] = [model]
    for step in where:
        if isinstance(step, str):
            annotations = [
                table.model_fields[step].annotation for table in tables if step in table.model_fields
            ]
            tables = [inner for annotation in annotations for inner in _models(annotation)] or tables
    return tables


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _models(inner)
