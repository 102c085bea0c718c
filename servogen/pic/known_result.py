"""What an instruction makes of values of which some are known (DS35007 section 7).

In: the instruction's operands, None for what is not known. Out: its result and the carry that it sets, None
likewise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

Found = tuple[int | None, int | None]
"""(result, carry)"""

_OF_ONE: Mapping[str, Callable[[int, int], int]] = {
    "MOVF": lambda f, b: f,
    "INCF": lambda f, b: f + 1,
    "INCFSZ": lambda f, b: f + 1,
    "DECF": lambda f, b: f - 1,
    "DECFSZ": lambda f, b: f - 1,
    "COMF": lambda f, b: ~f,
    "SWAPF": lambda f, b: f << 4 | f >> 4,
    "BSF": lambda f, b: f | 1 << b,
    "BCF": lambda f, b: f & ~(1 << b),
}
_OF_TWO: Mapping[str, Callable[[int, int], tuple[int, int | None]]] = {
    "ADD": lambda value, w: (value + w, int(value + w > 0xFF)),
    "SUB": lambda value, w: (value - w, int(value >= w)),
    "AND": lambda value, w: (value & w, None),
    "IOR": lambda value, w: (value | w, None),
    "XOR": lambda value, w: (value ^ w, None),
}


def known_result(
    mnemonic: str, w: int | None, f: int | None, k: int | None, b: int, carry: int | None
) -> Found:
    """Of an instruction that makes a result: from W, its byte, its literal, its bit and the carry."""
    without = {"MOVLW": k, "MOVWF": w, "CLRF": 0, "CLRW": 0}
    if mnemonic in without:
        return without[mnemonic], None
    if f is not None and mnemonic in _OF_ONE:
        return _OF_ONE[mnemonic](f, b) & 0xFF, None
    if f is not None and mnemonic == "RLF":
        return None if carry is None else (f << 1 | carry) & 0xFF, f >> 7
    if f is not None and mnemonic == "RRF":
        return None if carry is None else f >> 1 | carry << 7, f & 1
    other = k if mnemonic.endswith("LW") else f
    if w is None or other is None or mnemonic[:3] not in _OF_TWO:
        return None, None
    result, out = _OF_TWO[mnemonic[:3]](other, w)
    return result & 0xFF, out
