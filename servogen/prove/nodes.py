"""The stored states of a search, and the choices on the ways between them.

In: what `explore` has followed. Out: `Node`, a state at a cut point and the way to it from the one before.
"""

from __future__ import annotations

from dataclasses import dataclass

from servogen.prove.forks import Choices
from servogen.prove.specification import SpecState
from servogen.prove.transitions import Ram


@dataclass(frozen=True, slots=True)
class Decision:
    """What was chosen before an instruction, `cycle` cycles after the last cut (in a way: after reset)."""

    cycle: int
    choices: Choices


@dataclass(frozen=True, slots=True)
class Node:
    """A stored state: its cells, beside them, and where it came from."""

    ram: Ram
    rest: int
    spec: SpecState
    parent: int
    cycles: int
    """From the parent to it."""
    decisions: tuple[Decision, ...]
    raw: tuple[Ram, int]
    """What it was before it was generalised."""
