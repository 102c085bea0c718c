"""What an instruction does to values that are known.

In: an instruction and the known values of W, C, Z and private bytes. Out: those known behind it.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.machine import STATUS, C, Ins, Z
from servogen.pic.known_result import known_result

State = dict[object, int]
"""Values by "W", "C", "Z" and byte."""


def without_flags(state: State) -> State:
    """The same without C and Z, in place."""
    state.pop("C", None)
    state.pop("Z", None)
    return state


def bit_value(ins: Ins, state: State) -> int | None:
    """The bit that an instruction names, when it is known."""
    if ins.f == STATUS:
        return state.get({C: "C", Z: "Z"}.get(ins.b, ""))
    value = state.get(ins.f)
    return None if value is None else value >> ins.b & 1


def execute(ins: Ins, state: State, followed: Callable[[object], bool]) -> None:
    """Change the known values as an instruction does; what it makes unknown is dropped.

    Only bytes that are `followed` are kept.
    """
    w, f = state.get("W"), state.get(ins.f) if ins.f is not None else None
    k = ins.k if isinstance(ins.k, int) else None
    carry = state.get("C")
    result, new_carry = known_result(ins.op, w, f, k, ins.b, carry)
    for letter in ins.flags:
        state.pop(letter, None)
    if ins.f == STATUS and ins.op in ("BCF", "BSF"):
        name = {C: "C", Z: "Z"}.get(ins.b)
        if name is not None:
            state[name] = int(ins.op == "BSF")
        return
    if "Z" in ins.flags and result is not None:
        state["Z"] = int(result == 0)
    if "C" in ins.flags and new_carry is not None:
        state["C"] = new_carry
    target: object = ins.f if ins.writes_f else "W" if ins.writes_w else None
    if target is None:
        return
    state.pop(target, None)
    if result is not None and (target == "W" or followed(target)):
        state[target] = result
