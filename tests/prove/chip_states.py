"""States of the abstract chip, of which a test names what matters."""

from __future__ import annotations

from servogen.pic.device import RAM_FIRST, RAM_LAST
from servogen.prove.chip import FIELD, FIELDS
from servogen.simulator import layout


def rest(**fields: int) -> tuple[int, ...]:
    """A state's fields: no EEPROM write is under way, and the others are 0."""
    values = [0] * len(FIELDS)
    for name, value in ({"EE_DONE_AT": layout.NEVER} | fields).items():
        values[FIELD[name]] = value
    return tuple(values)


def fields(state: tuple[int, ...], *names: str) -> list[int]:
    """The values of a state's fields."""
    return [state[FIELD[name]] for name in names]


def ram(**cells: int) -> tuple[int, ...]:
    """A state's RAM, `c3=7` for its fourth byte; the others are 0."""
    values = [0] * (RAM_LAST - RAM_FIRST + 1)
    for name, value in cells.items():
        values[int(name[1:])] = value
    return tuple(values)
