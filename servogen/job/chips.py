"""[[chip]] twice in a job -> the two chips, their servos and the wire between them.

In: the tables, and the motion of the whole robot. Out: `PairedChip`, its servos and its end of the wire;
the motion of some of the servos. Raises InputError for servos that both chips have or none, for chips of
different clocks, and for a wire that is no servo's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from servogen.engines.inputs import EngineInput, check_free
from servogen.engines.inputs.wire import FrameWire
from servogen.engines.registry import ENGINES
from servogen.job.schema import ChipPairTable, ChipTable, JobTable, ServoTable
from servogen.motion import JointTrajectory
from servogen.pic.device import OPEN_DRAIN_PIN
from servogen.toml import file as toml_file
from servogen.toml.file import Document


@dataclass(frozen=True, slots=True)
class PairedChip:
    """One of two chips: its servos by name, in the order of the job, and its pin of the wire."""

    servos: tuple[str, ...]
    wire: FrameWire


def of_one_chip(document: Document) -> Document:
    """Return the document as if it had only what both of its chips share; unchanged if it has one chip.

    Raises InputError unless an array of chips has two.
    """
    given = document.data.get("chip")
    if not isinstance(given, tuple):
        return document
    if len(given) != 2:
        raise document.error(
            "chip-pair", ("chip",), f"there are {len(given)} chips: a job has one [chip], or two [[chip]]"
        )
    first = toml_file.validate(document, ChipPairTable, ("chip", 0))
    shared = {key: getattr(first, key) for key in ChipTable.model_fields}
    return replace(document, data={**document.data, "chip": shared})


def read_chips(document: Document, rows: Sequence[ServoTable]) -> tuple[PairedChip, ...]:
    """Return the two chips of a job; none if it has one chip. Raises InputError."""
    if not isinstance(document.data["chip"], tuple):
        return ()
    first, second = (toml_file.validate(document, ChipPairTable, ("chip", index)) for index in (0, 1))
    for key in ("device", "clock_hz"):
        if getattr(first, key) != getattr(second, key):
            raise document.error(
                "chip-pair",
                ("chip", 1, key),
                f"both chips count the same cycles: {key} is {getattr(first, key)} in the first",
                "write the same in both",
            )
    names = [row.name for row in rows]
    lists = (
        _by_chip(rows) if first.servos is None and second.servos is None else (first.servos, second.servos)
    )
    for index, (mine, others) in enumerate(zip(lists, reversed(lists), strict=True)):
        where = ("chip", index, "servos")
        if mine is None:
            raise document.error("missing-key", ("chip", index), "'servos' is missing", "add servos = […]")
        for name in mine:
            document.check_known("unknown-servo", where, name, names, f"there is no servo '{name}'")
            if others is not None and name in others:
                raise document.error("chip-pair", where, f"both chips have the servo {name}", "name it once")
    left = next((name for name in names if not any(mine and name in mine for mine in lists)), None)
    if left is not None:
        raise document.error("chip-pair", ("chip",), f"no chip has the servo {left}", "add it to servos")
    on_first, on_second = ({row.pin: row.name for row in rows if mine and row.name in mine} for mine in lists)
    if first.wire not in on_first or first.wire == OPEN_DRAIN_PIN:
        raise document.error(
            "chip-pair",
            ("chip", 0, "wire"),
            f"no servo of the first chip is on {first.wire}, or that pin is an open drain",
            "the wire begins at a pin whose servo has a pulse in every frame: its rise tells the second chip",
        )
    check_free(document, ("chip", 1, "wire"), second.wire, on_second, "the wire needs a pin of its own")
    restart = _restart(document, first, second, {**on_second, second.wire: "wire"})
    ppm = second.crystal_ppm or 0
    wires = (
        FrameWire(first.wire, False, second.wire, restart, ppm),
        FrameWire(second.wire, True, first.wire, restart, ppm),
    )
    return tuple(
        PairedChip(tuple(name for name in names if mine and name in mine), wire)
        for mine, wire in zip(lists, wires, strict=True)
    )


def _restart(
    document: Document, first: ChipPairTable, second: ChipPairTable, used: Mapping[str, str]
) -> str | None:
    """Return the second chip's pin that resets the first one, if there is one. Raises InputError."""
    for key in ("restart", "crystal_ppm"):
        if getattr(first, key) is not None:
            raise document.error(
                "chip-pair",
                ("chip", 0, key),
                f"the first chip does not restart or follow the second one: {key} is a key of the second",
                f"write {key} in the second [[chip]]",
            )
    where = ("chip", 1, "restart")
    if second.restart not in (None, OPEN_DRAIN_PIN):
        raise document.error(
            "chip-pair",
            where,
            f"{second.restart} is no open drain: it could drive the first chip's MCLR high",
            f'write restart = "{OPEN_DRAIN_PIN}", and use {second.restart} for a servo on {OPEN_DRAIN_PIN}',
        )
    if second.restart is not None:
        check_free(document, where, second.restart, used, "without restart the first chip is reset by hand")
    return second.restart


def _by_chip(rows: Sequence[ServoTable]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the servos of each chip: the second one's begin with the first whose pin is in use."""
    pins: set[str] = set()
    for index, row in enumerate(rows):
        if row.pin in pins:
            names = [each.name for each in rows]
            return tuple(names[:index]), tuple(names[index:])
        pins.add(row.pin)
    return tuple(row.name for row in rows), ()


def check_alone(document: Document, inputs: Sequence[EngineInput], table: JobTable) -> None:
    """Raise InputError for an engine that does not know the wire, and for what steers a program and does not
    reach the second chip.
    """
    engine = table.firmware.engine
    if engine in ENGINES and FrameWire.kind not in ENGINES[engine].accepts:
        raise document.error(
            "engine-unsupported",
            ("firmware", "engine"),
            f"the {engine} engine does not follow another chip",
            'write engine = "player"',
        )
    for each in inputs:
        raise document.error(
            "engine-unsupported",
            ("chip",),
            f"two chips do not read {each.kind}: the wire tells the second one only when a frame begins",
            "one chip, or a motion without inputs",
        )


def motion_part(trajectory: JointTrajectory, names: Sequence[str]) -> JointTrajectory:
    """Return the motion of some of the servos."""
    columns = [trajectory.joints.index(name) for name in names]
    return replace(trajectory, joints=tuple(names), angles=trajectory.angles[:, columns])
