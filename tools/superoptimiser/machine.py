"""What the instructions of a rule do, for many states at once.

In: a sequence of rule instructions, a state of NumPy arrays. Out: the state behind it. The bytes are W and
the file registers `a` and `b`, which are different bytes of RAM; the flags are C, D (digit carry) and Z.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from servogen.compiler.passes.superoptimise import RuleInstruction

Values = npt.NDArray[np.uint8]
State = dict[str, Values]
"""By name: W, a, b from 0 to 255; C, D, Z 0 or 1; k, the literal of a rule that holds for all."""

NAMES = ("W", "a", "b", "C", "D", "Z")
FLAGS = ("C", "D", "Z")


def run(sequence: Iterable[RuleInstruction], state: Mapping[str, Values]) -> State:
    """Return the state behind a sequence; a skip that is taken leaves out the next instruction."""
    here = dict(state)
    skipped: Values | None = None
    for each in sequence:
        after, skips = step(each, here)
        if skipped is not None:
            taken = skipped.astype(bool)
            after = {
                name: value if value is here[name] else np.where(taken, here[name], value)
                for name, value in after.items()
            }
            assert skips is None, "a skip over a skip is not modelled"
        here, skipped = after, skips
    assert skipped is None, "a sequence ends with a skip"
    return here


def step(ins: RuleInstruction, state: Mapping[str, Values]) -> tuple[State, Values | None]:
    """Return the state behind one instruction, and where it skips the next one."""
    out = dict(state)
    literal = state["k"] if ins.k == "k" else np.uint8(ins.k or 0)
    w = state["W"]
    f = state[ins.f] if ins.f in ("a", "b") else w
    skips: Values | None = None
    value: Values | None = None
    match ins.op:
        case "MOVLW":
            out["W"] = w * np.uint8(0) + literal
        case "ADDLW":
            value = _add(out, w, w * np.uint8(0) + literal)
        case "SUBLW":
            value = _subtract(out, w * np.uint8(0) + literal, w)
        case "ANDLW":
            value = w & literal
        case "IORLW":
            value = w | literal
        case "XORLW":
            value = w ^ literal
        case "CLRW":
            value = w * np.uint8(0)
        case "MOVWF":
            out[ins.f] = w
        case "CLRF":
            out[ins.f] = f * np.uint8(0)
            out["Z"] = f * np.uint8(0) + np.uint8(1)
        case "MOVF":
            value = f
        case "ADDWF":
            value = _add(out, f, w)
        case "SUBWF":
            value = _subtract(out, f, w)
        case "ANDWF":
            value = f & w
        case "IORWF":
            value = f | w
        case "XORWF":
            value = f ^ w
        case "INCF":
            value = f + np.uint8(1)
        case "DECF":
            value = f - np.uint8(1)
        case "COMF":
            value = ~f
        case "SWAPF":
            _store(out, ins, (f << np.uint8(4)) | (f >> np.uint8(4)))
        case "RLF":
            carry = state["C"]
            out["C"] = f >> np.uint8(7)
            _store(out, ins, (f << np.uint8(1)) | carry)
        case "RRF":
            carry = state["C"]
            out["C"] = f & np.uint8(1)
            _store(out, ins, (f >> np.uint8(1)) | (carry << np.uint8(7)))
        case "INCFSZ" | "DECFSZ":
            counted = f + np.uint8(1) if ins.op == "INCFSZ" else f - np.uint8(1)
            _store(out, ins, counted)
            skips = (counted == 0).astype(np.uint8)
        case "BCF" | "BSF" | "BTFSC" | "BTFSS":
            skips = _bit(out, ins, state)
        case _:
            raise ValueError(f"a rule has the instruction {ins.op}")
    if value is not None:
        if ins.op not in ("ADDLW", "SUBLW", "ANDLW", "IORLW", "XORLW", "CLRW"):
            _store(out, ins, value)
        else:
            out["W"] = value
        out["Z"] = (value == 0).astype(np.uint8)
    return out, skips


def _store(out: State, ins: RuleInstruction, value: Values) -> None:
    out[ins.f if ins.d else "W"] = value


def _add(out: State, one: Values, two: Values) -> Values:
    """Return the sum and set the carries (DS35007, section 2.3.1)."""
    out["C"] = (one.astype(np.uint16) + two > 255).astype(np.uint8)
    out["D"] = ((one & np.uint8(15)) + (two & np.uint8(15)) > 15).astype(np.uint8)
    return np.asarray(one + two, np.uint8)


def _subtract(out: State, one: Values, two: Values) -> Values:
    """Return the difference; C and D are set where nothing is borrowed."""
    out["C"] = (one >= two).astype(np.uint8)
    out["D"] = ((one & np.uint8(15)) >= (two & np.uint8(15))).astype(np.uint8)
    return np.asarray(one - two, np.uint8)


def _bit(out: State, ins: RuleInstruction, state: Mapping[str, Values]) -> Values | None:
    """Change a bit, or return where the test of it skips."""
    flag = ins.f in FLAGS
    one = np.uint8(1) if flag else np.uint8(1 << ins.b)
    held = state[ins.f]
    if ins.op == "BSF":
        out[ins.f] = held | one
    elif ins.op == "BCF":
        out[ins.f] = held & ~one
    else:
        return ((held & one != 0) == (ins.op == "BTFSS")).astype(np.uint8)
    return None
