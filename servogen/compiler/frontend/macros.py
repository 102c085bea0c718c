"""Macro replacement (ISO C 6.10.3).

In: tokens and the macros defined before them. Out: the tokens with every macro replaced. A token carries the
names of the macros that it comes from, its hide set: those are not replaced in it again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

Tokens = list[Any]
"""Tokens of pcpp's lexer: `type`, `value`, `source`, `lineno`; `hidden`, the hide set, and `outermost`, the
macro that the source names, where one was replaced.
"""
SPACE = ("CPP_WS", "CPP_LINECONT", "CPP_COMMENT1", "CPP_COMMENT2")
_NONE: frozenset[str] = frozenset()
_OMITTED: Tokens = []
"""The last arguments of a macro that are not even an empty one."""
_EMPTY = object()
"""Stands for an argument without tokens beside `##` (a placemarker)."""


@dataclass(frozen=True)
class Replacer:
    """Replaces macros.

    `numbers` are those whose value depends on where they stand. `spelled` makes the string of `#x`, `joined`
    the tokens of `a ## b`; `counted` sees every replacement, and `fault` takes what is wrong with a use.
    """

    macros: Mapping[str, Any]
    numbers: Mapping[str, Callable[[Any], int]]
    spelled: Callable[[Tokens], Any]
    joined: Callable[[Any, Any], Tokens]
    counted: Callable[[Any, Tokens], None]
    fault: Callable[[Any, str], None]

    def replace(self, tokens: Tokens) -> Tokens:
        """Return the tokens with every macro replaced, and what comes of one searched again with the tokens
        behind it.
        """
        waiting, out = tokens[::-1], []
        while waiting:
            token = waiting.pop()
            if token.value in self.numbers and token.value not in self.macros:
                token = copied(token)
                token.type, token.value = "CPP_INTEGER", str(self.numbers[token.value](token))
            macro = self.macros.get(token.value) if token.type == "CPP_ID" else None
            if macro is None or token.value in _hidden(token):
                out.append(token)
                continue
            arguments: list[Tokens] = []
            hidden = _hidden(token)
            if macro.arglist is not None:
                opening = next(
                    (index for index in _from_end(waiting) if waiting[index].type not in SPACE), None
                )
                closing = None if opening is None else _closing(waiting, opening)
                # a name without parentheses behind it, or whose parentheses do not close, stays
                if opening is None or closing is None:
                    out.append(token)
                    continue
                given = self._arguments(macro, token, waiting[closing + 1 : opening][::-1])
                if given is None:
                    out += [token, *waiting[closing:][::-1]]
                    del waiting[closing:]
                    continue
                arguments = given
                hidden &= _hidden(waiting[closing])
                del waiting[closing:]
            body = self._body(macro, arguments)
            hidden |= {token.value}
            for replaced in body:
                replaced.source, replaced.lineno = token.source, token.lineno
                replaced.outermost = getattr(token, "outermost", token.value)
                replaced.hidden = _hidden(replaced) | hidden if _hidden(replaced) else hidden
            self.counted(token, body)
            waiting += reversed(body)
        return out

    def _arguments(self, macro: Any, name: Any, inside: Tokens) -> list[Tokens] | None:
        """Return the arguments of a use, one for each parameter; None where their number is wrong."""
        most = len(macro.arglist)
        arguments: list[Tokens] = [[]]
        depth = 0
        for token in inside:
            depth += {"(": 1, ")": -1}.get(token.value, 0)
            if token.value == "," and depth == 0 and not (macro.variadic and len(arguments) == most):
                arguments.append([])
            else:
                arguments[-1].append(token)
        arguments = [_stripped(argument) for argument in arguments]
        if most == 0 and arguments == [[]]:
            return []
        if macro.variadic and arguments == [[]] and most == 1:
            return [_OMITTED]
        if macro.variadic and len(arguments) == most - 1:
            arguments.append(_OMITTED)
        if len(arguments) == most:
            return arguments
        if macro.variadic:
            self.fault(name, f"Macro {name.value} must have at least {most - 1} arguments")
        else:
            self.fault(name, f"Macro {name.value} requires {most} arguments but was passed {len(arguments)}")
        return None

    def _body(self, macro: Any, arguments: list[Tokens]) -> Tokens:
        """Return copies of the tokens of a macro, with its arguments in the place of its parameters."""
        given = dict(zip(macro.arglist or (), arguments, strict=True))
        out: Tokens = []
        # spaces do not count beside # and ##
        value = macro.value
        index = 0

        def behind(index: int) -> int:
            return next(
                (after for after in range(index + 1, len(value)) if value[after].type not in SPACE), -1
            )

        while index < len(value):
            token, after = value[index], behind(index)
            if token.value == "#" and after > 0 and value[after].value in given:
                out.append(self._string(value[after], given))
                index = after
            elif token.type == "CPP_DPOUND" and after > 0:
                out = _stripped(out)
                right = value[after]
                second = behind(after)
                if right.value == "#" and second > 0 and value[second].value in given:
                    after, operand = second, [self._string(value[second], given)]
                elif right.value in given:
                    operand = _copies(given[right.value]) or [_EMPTY]
                else:
                    operand = _copies([right])
                if not self._is_comma(macro, out, right):
                    self._join(out, operand)
                elif given[right.value] is _OMITTED:
                    out.pop()
                else:
                    out += operand
                index = after
            elif token.type == "CPP_ID" and token.value in given:
                if after > 0 and value[after].type == "CPP_DPOUND":
                    out += _copies(given[token.value]) or [_EMPTY]
                else:
                    out += self.replace(_copies(given[token.value]))
            else:
                out += _copies([token])
            index += 1
        return [token for token in out if token is not _EMPTY]

    def _string(self, parameter: Any, given: Mapping[str, Tokens]) -> Any:
        token = copied(parameter)
        token.type, token.value = "CPP_STRING", self.spelled(given[parameter.value])
        return token

    def _is_comma(self, macro: Any, out: Tokens, right: Any) -> bool:
        """Return whether `##` stands between a comma and the last arguments: it joins nothing there, and the
        comma goes where they are left out (GNU).
        """
        last = macro.variadic and right.value == macro.arglist[-1]
        return last and bool(out) and out[-1] is not _EMPTY and out[-1].value == ","

    def _join(self, out: Tokens, operand: Tokens) -> None:
        """Append the right operand of `##`, its first token joined to the last one of `out`."""
        left = out[-1] if out else _EMPTY
        if operand[0] is _EMPTY:
            return
        joined = operand[:1] if left is _EMPTY else self.joined(left, operand[0])
        out[-1:] = [*joined, *operand[1:]]


def _hidden(token: Any) -> frozenset[str]:
    hidden: frozenset[str] = getattr(token, "hidden", _NONE)
    return hidden


def copied(token: Any) -> Any:
    """Return a copy of a token, as copy.copy does, which takes four times as long: it asks how, each time."""
    duplicate = object.__new__(type(token))
    duplicate.__dict__.update(token.__dict__)
    return duplicate


def _copies(tokens: Tokens) -> Tokens:
    return [copied(token) for token in tokens]


def _from_end(tokens: Tokens) -> Iterator[int]:
    return iter(range(len(tokens) - 1, -1, -1))


def _closing(waiting: Tokens, opening: int) -> int | None:
    """Return the index of the parenthesis that closes the one at `opening`, in tokens from last to first."""
    if waiting[opening].value != "(":
        return None
    depth = 0
    for index in range(opening, -1, -1):
        depth += {"(": 1, ")": -1}.get(waiting[index].value, 0)
        if depth == 0:
            return index
    return None


def _stripped(tokens: Tokens) -> Tokens:
    """Return tokens without the spaces at both ends."""
    first, last = 0, len(tokens)
    while first < last and tokens[first] is not _EMPTY and tokens[first].type in SPACE:
        first += 1
    while last > first and tokens[last - 1] is not _EMPTY and tokens[last - 1].type in SPACE:
        last -= 1
    return tokens[first:last]
