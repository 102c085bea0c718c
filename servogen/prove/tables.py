"""Bytes of a chip as tables over the contents of the EEPROM.

A table quantifies over the 256 contents of one byte of the EEPROM, or over the 65536 pairs of two, and says
for each which value the chip's byte has. It is an array of the shape (256,) or (256, 256), with an axis for
each byte of the EEPROM, in the order of their addresses; what depends on none has the shape ().
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]
VALUES = 256
"""Values of a byte."""
EEDATA = "EEDATA"
Place = int | str
"""A place in the RAM, or EEDATA."""


class UndecidedTrims(Exception):
    """The proof for any EEPROM does not reach so far; the text says why."""


@dataclass(frozen=True, eq=False)
class Pairing:
    """The row in which each pair of contents was run: tables of two bytes are split by rows, not by pairs."""

    table: object
    """The `RunTable` of the rows: a row means the same in all pairings that have it."""
    rows: Ints


@dataclass(frozen=True, eq=False)
class ByteTable:
    """A byte of the chip, for each content of one byte of the EEPROM or of two."""

    addresses: tuple[int, ...]
    """Of the bytes of the EEPROM."""
    values: Ints
    pairing: Pairing | None = None
    """Of a table of two bytes."""


def table_of(values: Ints, addresses: tuple[int, ...], pairing: Pairing) -> ByteTable:
    """Return the table of a byte: of one byte of the EEPROM if that is enough."""
    if len(addresses) == 1:
        return ByteTable(addresses, values)
    if (values == values[:, :1]).all():
        return ByteTable(addresses[:1], values[:, 0])
    if (values == values[:1]).all():
        return ByteTable(addresses[1:], values[0])
    return ByteTable(addresses, values, pairing)


def addresses_of(tables: Iterable[ByteTable]) -> tuple[int, ...]:
    """Return the bytes of the EEPROM that any of the tables depends on."""
    return tuple(sorted({address for table in tables for address in table.addresses}))


def pairing_of(tables: Iterable[ByteTable]) -> Pairing | None:
    """Return the first pairing among tables."""
    return next((table.pairing for table in tables if table.pairing), None)


def along(values: Ints, axis: int, axes: int) -> Ints:
    """Return values that belong to one of several bytes, for all their combinations."""
    shape = [1] * axes
    shape[axis] = VALUES
    return np.broadcast_to(values.reshape(shape), (VALUES,) * axes)


def spread(table: ByteTable, addresses: tuple[int, ...]) -> Ints:
    """Return what a table says for each combination of the contents of `addresses`."""
    if table.addresses == addresses:
        return table.values
    return along(table.values, addresses.index(table.addresses[0]), len(addresses))
