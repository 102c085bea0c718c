"""What time alone changes in a state beside the RAM, and states of which less is known.

In: a state beside the RAM, and cycles. Out: the state so many cycles later. Instructions that do not access
TMR0 leave it where NOPs would, so chips that take different times from one state come to its later states.
What else may have happened to TMR0 and to flags meanwhile, by pins, is unknown afterwards.
"""

from __future__ import annotations

from servogen.prove.chip import BASE, FIELD, TIME_FIELDS, UNCERTAIN, AbstractChip, Reason
from servogen.prove.transitions import Rest
from servogen.prove.trim_states import TrimState
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
        self._later: dict[tuple[Rest, int], Rest] = {}

    def after(self, state: TrimState, cycles: int) -> Rest:
        """Return a state beside the RAM so many cycles later. Raises UndecidedTrims."""
        if not cycles:
            return state.rest
        later = self._later.get((state.rest, cycles))
        if later is None:
            outcome = self._idle.run(state.chip, frozenset(), cycles)
            if outcome.reason is not Reason.LIMIT or outcome.cycles != cycles or outcome.edges:
                raise state.undecided("something happens by itself")
            fields = list(outcome.rest)
            fields[FIELD["PC"]] = state.rest[FIELD["PC"]]
            later = self._later[state.rest, cycles] = tuple(fields)
        return later

    def with_time_after(self, state: TrimState, cycles: int, rest: Rest) -> Rest:
        """Return `rest`, but what time changes as it is `cycles` after `state`. Raises UndecidedTrims."""
        fields, later = list(rest), self.after(state, cycles)
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
