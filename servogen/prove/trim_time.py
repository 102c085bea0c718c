"""What time alone changes in a state beside the RAM, and states of which less is known.

In: a state beside the RAM, and cycles. Out: the state so many cycles later. Instructions that do not access
TMR0 leave it where NOPs would, so chips that take different times from one state come to its later states.
What else may have happened to TMR0 and to flags meanwhile, by pins, is unknown afterwards.
"""

from __future__ import annotations

from servogen.prove.chip import BASE, FIELD, TIME_FIELDS, UNCERTAIN, AbstractChip, ChipState, Reason
from servogen.prove.transitions import Ram, Rest
from servogen.simulator import layout
from servogen.simulator.slots import Future

FLAGS = layout.T0IF | layout.INTF | layout.RBIF
_NOT_DUE = {Future.UNTIL: BASE, Future.MOMENT: layout.NEVER}
_TIMER = [r for r in layout.ROWS if r.timed and r.future is not Future.SINCE and not r.other_chips]
"""All that time changes but the watchdog, which has to be off where times differ."""


class PassingTime:
    """Time in which nothing is executed."""

    def __init__(self, idle: AbstractChip) -> None:
        """Prepare; the program of `idle` is NOPs."""
        self._idle = idle
        self._later: dict[tuple[Rest, int], Rest | None] = {}

    def after(self, ram: Ram, rest: Rest, cycles: int) -> Rest | None:
        """Return `rest` so many cycles later; None if something happens by itself meanwhile."""
        if cycles and (rest, cycles) not in self._later:
            outcome = self._idle.run(ChipState(ram, rest), frozenset(), cycles)
            quiet = outcome.reason is Reason.LIMIT and outcome.cycles == cycles and not outcome.edges
            fields = list(outcome.rest)
            fields[FIELD["PC"]] = rest[FIELD["PC"]]
            self._later[rest, cycles] = tuple(fields) if quiet else None
        return self._later[rest, cycles] if cycles else rest


def with_time_of(later: Rest, rest: Rest) -> Rest:
    """Return `rest` at the time of `later`."""
    fields = list(rest)
    for name in TIME_FIELDS:
        fields[FIELD[name]] = later[FIELD[name]]
    timed = unknown(tuple(fields), INTCON=FLAGS, RB_OLD=layout.RB4_TO_7)
    # TMR0 counts the edges of RA4 then, which a chip that executes NOPs does not make.
    return at_any_time(timed) if rest[FIELD["OPTION"]] & layout.T0CS else timed


def at_any_time(rest: Rest) -> Rest:
    """Return a state beside the RAM in which nothing is known of TMR0 and its prescaler."""
    fields = list(rest)
    for row in _TIMER:
        fields[FIELD[row.name]] = _NOT_DUE.get(row.future, row.power_up)
    bits = {row.name: row.bits for row in _TIMER if row.name in UNCERTAIN}
    return unknown(tuple(fields), INTCON=FLAGS, **bits)


def unknown(rest: Rest, **bits: int) -> Rest:
    """Return a state beside the RAM in which these bits of some fields are unknown."""
    fields = list(rest)
    for name, unknown_bits in bits.items():
        value, mask = FIELD[name], FIELD[UNCERTAIN[name].unknown_name]
        fields[value] &= ~unknown_bits
        fields[mask] = fields[mask] & UNCERTAIN[name].bits | unknown_bits
    return tuple(fields)
