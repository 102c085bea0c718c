"""The decorators for functions of the instruction loop, which are compiled and work on pointers to vectors of
integers.

Such functions are typed as what they are in Python; numba makes machine code of them (`aot_cache.py`).
"""

from __future__ import annotations

from collections.abc import Callable, MutableSequence
from typing import Any, TypeVar, cast

from numba import njit, types
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager
from numba.core.typed_passes import (
    AnnotateTypes,
    IRLegalization,
    NativeLowering,
    NoPythonBackend,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.untyped_passes import (
    DeadBranchPrune,
    FixupArgs,
    IRProcessing,
    ReconstructSSA,
    RewriteSemanticConstants,
    TranslateByteCode,
)

Vector = MutableSequence[int]
"""A pointer to int64 in machine code; in Python any sequence of integers that can be written."""

Function = TypeVar("Function", bound=Callable[..., Any])

_WAITING: list[tuple[Any, tuple[Any, ...]]] = []
"""The functions marked with `compiled_once` that are not compiled yet, with the types of their arguments."""
_KINDS = {"Vector": types.CPointer(types.int64), "int": types.int64}  # type: ignore[no-untyped-call]
"""The type of an argument by its annotation."""


class Pipeline(CompilerBase):
    """The passes of numba that functions of integers, branches and calls need: a third of all passes rewrite
    what these do not contain, such as closures and expressions of arrays.
    """

    def define_pipelines(self) -> list[PassManager]:
        passes = PassManager("integers")  # type: ignore[no-untyped-call]
        for step in (
            TranslateByteCode,
            FixupArgs,
            IRProcessing,
            RewriteSemanticConstants,
            DeadBranchPrune,
            ReconstructSSA,
            NopythonTypeInference,
            PreLowerStripPhis,
            IRLegalization,
            AnnotateTypes,
            NativeLowering,
            NoPythonBackend,
        ):
            passes.add_pass(step, step.__name__)  # type: ignore[no-untyped-call]
        passes.finalize()  # type: ignore[no-untyped-call]
        return [passes]


def compiled(function: Function) -> Function:
    """Mark `function` to be compiled when compiled code first calls it. No division here is ever by 0.

    Only the loop calls it: the wrappers that Python would need take a fifth of the time to compile.
    """
    options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast(Function, njit(pipeline_class=Pipeline, **options)(function))


def compiled_once(function: Function) -> Function:
    """Mark `function` to be compiled for any value of its arguments, before anything calls it.

    `compiled` makes a copy for each constant that a function is called with, which pays only where the
    constant decides a branch.
    """
    dispatcher = compiled(function)
    _WAITING.append(
        (dispatcher, tuple(_KINDS[kind] for kind in function.__annotations__.values() if kind in _KINDS))
    )
    return dispatcher


def compile_general() -> None:
    """Compile the functions marked with `compiled_once`, unless that is done."""
    while _WAITING:
        dispatcher, arguments = _WAITING.pop(0)
        dispatcher.compile(arguments)
        dispatcher.disable_compile()
