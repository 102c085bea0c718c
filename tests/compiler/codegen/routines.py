"""The routines of one program, built when they are first called."""

from __future__ import annotations

from collections.abc import Callable

from servogen.compiler.ir.function import Function


class Library:
    """Routines with those that they call; `build` writes the code of one of them."""

    def __init__(self, build: Callable[..., None]) -> None:
        self.build = build
        self.functions: dict[str, Function] = {}

    def __call__(self, kind: str, key: tuple[int, ...]) -> Function:
        name = "_".join([kind, *map(str, key)])
        if name not in self.functions:
            self.functions[name] = Function(name)
            self.build(kind, key, self.functions[name], self)
        return self.functions[name]
