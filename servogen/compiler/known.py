"""What an instruction does to values that are known.

In: an instruction and the known values of W, C, Z and private bytes. Out: those known behind it.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.machine import STATUS, C, Ins, Z

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
    result, new_carry = _compute(ins, w, f, k, carry)
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


def _compute(
    ins: Ins, w: int | None, f: int | None, k: int | None, carry: int | None
) -> tuple[int | None, int | None]:
    """(result, carry), each None when it is not known."""
    one = {"MOVLW": k, "MOVWF": w, "MOVF": f, "CLRF": 0, "CLRW": 0}
    if ins.op in one:
        return one[ins.op], None
    if f is not None:
        match ins.op:
            case "INCF" | "INCFSZ":
                return f + 1 & 0xFF, None
            case "DECF" | "DECFSZ":
                return f - 1 & 0xFF, None
            case "COMF":
                return f ^ 0xFF, None
            case "SWAPF":
                return (f >> 4 | f << 4) & 0xFF, None
            case "BSF":
                return f | 1 << ins.b, None
            case "BCF":
                return f & ~(1 << ins.b), None
            case "RLF":
                return None if carry is None else (f << 1 | carry) & 0xFF, f >> 7
            case "RRF":
                return None if carry is None else f >> 1 | carry << 7, f & 1
    other = k if ins.op.endswith("LW") else f
    if w is None or other is None:
        return None, None
    match ins.op[:3]:
        case "ADD":
            return other + w & 0xFF, int(other + w > 0xFF)
        case "SUB":
            return other - w & 0xFF, int(other >= w)
        case "AND":
            return other & w, None
        case "IOR":
            return other | w, None
        case "XOR":
            return other ^ w, None
    return None, None
