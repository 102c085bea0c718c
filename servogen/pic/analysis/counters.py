"""Counters: bytes that a program sets to constants and counts up or down, and what it copies from them.

In: the words of a program. Out: for each address, the bytes of RAM that hold a counter there. It only decides
which states the analysis keeps apart: a byte too few costs precision, a byte too many costs time, and neither
affects soundness.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from servogen.pic.device import INTERRUPT_VECTOR, PROGRAM_WORDS, RAM_FIRST, RAM_LAST
from servogen.pic.known_values import INDF, Undefined, Word, word_of

_W = 1
"""The bit of W in a bit set; that of a byte of RAM is 1 << its address."""
_STEPS = frozenset({"INCF", "DECF", "INCFSZ", "DECFSZ"})


def counters(words: Mapping[int, int]) -> dict[int, tuple[int, ...]]:
    """Return, for each address on a path, the bytes that hold nothing but counters there."""
    return _Flow(words).counters()


class _Flow:
    """Follows, forward over all paths, which bytes may hold something other than a counter."""

    def __init__(self, words: Mapping[int, int]) -> None:
        self._words: dict[int, Word] = {}
        for at, number in words.items():
            try:
                self._words[at] = word_of(number)
            except Undefined:
                continue
        counted = {word.f for word in self._words.values() if word.name in _STEPS and word.writes_f}
        self._counted = sum(1 << place for place in counted if RAM_FIRST <= place <= RAM_LAST)
        self._changed: dict[int, int] = {}

    def counters(self) -> dict[int, tuple[int, ...]]:
        """Return the counters before each instruction that is on a path."""
        places = range(RAM_FIRST, RAM_LAST + 1)
        return {
            at: tuple(place for place in places if (self._counted & ~other) >> place & 1)
            for at, other in self._follow((0, INTERRUPT_VECTOR), into_calls=True).items()
        }

    def _follow(self, starts: Iterable[int], *, into_calls: bool) -> dict[int, int]:
        """Return, for the addresses that follow `starts`, which bytes may hold something else."""
        others = dict.fromkeys(starts, _W)
        waiting = list(others)
        while waiting:
            at = waiting.pop()
            word = self._words.get(at)
            if word is None:
                continue
            after = _after(word, others[at])
            for following in self._following(at, word):
                reached = after
                if word.flow == "call" and following == word.k:
                    if not into_calls:
                        continue
                elif word.flow == "call":
                    reached |= self._changed_by(word.k) | _W
                known = others.get(following)
                if known is None or reached & ~known:
                    others[following] = (known or 0) | reached
                    waiting.append(following)
        return others

    def _changed_by(self, start: int) -> int:
        """Return the bytes to which a function, with those that it calls, gives something else."""
        if start not in self._changed:
            self._changed[start] = 0  # while a recursion is followed
            for other in self._follow((start,), into_calls=False).values():
                self._changed[start] |= other & ~_W
        return self._changed[start]

    def _following(self, at: int, word: Word) -> list[int]:
        """Return the addresses that follow, with the call's own continuation behind the called function."""
        after = (at + 1) % PROGRAM_WORDS
        if word.writes_pcl:  # the words of a table
            return [after]
        if word.name == "RETLW":
            return [after] if self._words.get((at + 1) % PROGRAM_WORDS, word).name == "RETLW" else []
        if word.flow == "jump":
            return [word.k]
        if word.flow == "call":
            return [word.k, after]
        if word.flow == "return":
            return []
        return [after, (at + 2) % PROGRAM_WORDS] if word.flow == "skip" else [after]


def _after(word: Word, other: int) -> int:
    """Return which bytes may hold something other than a counter after an instruction."""
    place = 1 << word.f if word.has_f and RAM_FIRST <= word.f <= RAM_LAST else 0
    if word.name in ("MOVLW", "CLRW"):
        return other & ~_W
    if (word.name in _STEPS and word.writes_f) or word.name in ("BTFSC", "BTFSS"):
        return other
    if word.name == "CLRF":
        return other & ~place
    if word.name in ("MOVWF", "MOVF"):
        source, target = (_W, place) if word.name == "MOVWF" else (place, _W if word.writes_w else 0)
        return other | target if other & source or not source else other & ~target
    if word.writes_w:
        return other | _W
    return other | place if word.writes_f and word.f != INDF else other
