"""The instruction loop as machine code that is cached across processes.

numba compiles the loop once for this processor (about seven seconds); the result is kept as an object file,
so that a later process loads it through llvmlite in milliseconds, without numba and its start-up time. The
file's name is a digest of the sources, the versions and the processor, so that any change selects a new file.
Because the file is executed, it is loaded only if nobody but the user and root can have written it.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
import re
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
from llvmlite import binding as llvm

from servogen.errors import ToolError
from servogen.pic.device import REGISTERS
from servogen.simulator.program import OPS

if os.name == "posix":
    import fcntl

ENTRY = "servogen_run"
SIGNATURE = "pipppppppipp"
"""The arguments of `kernel.instruction_loop`: pointers to int64 (p) and int64 (i)."""

_LOG = logging.getLogger(__name__)

DIGEST_BYTES = hashlib.sha256().digest_size

Loop = Callable[..., int]


@cache
def loop(observed: bool = False, tracked: bool = False, visits: bool = False) -> Loop:
    """Return the compiled loop; it takes the addresses of vectors and returns the reason why it stopped."""
    kind = "observed" if observed else "tracked" if tracked else "visits" if visits else "plain"
    name = f"simulator-{kind}-{_digest()}.o"
    code = _found(name)
    if code is None:
        _LOG.info("compiling the simulator for this processor, which takes several seconds")
        with _one_at_a_time():
            code = _found(name)  # another process may have compiled it meanwhile
            if code is None:
                code = compile_loop(observed, tracked, visits)
                _keep(name, code)
    return _load(code)


def _digest() -> str:
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    # the numbers of the instructions come from pic.isa, the addresses of the registers from pic.device
    digest.update(repr((OPS, REGISTERS)).encode())
    machine = (llvm.get_process_triple(), llvm.get_host_cpu_name(), _features(), llvmlite.__version__)
    digest.update(repr(machine).encode())
    return digest.hexdigest()[:24]


def _features() -> str:
    return str(llvm.get_host_cpu_features().flatten())


def _folders() -> Iterator[Path]:
    """Yield the folders for object files: beside the sources, or in the user's cache."""
    yield Path(__file__).parent / "__pycache__"
    base = Path(os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or "~/.cache")
    with suppress(RuntimeError):  # a user without a home
        base = base.expanduser()
        if base.is_absolute():
            yield base / "servogen"


def _found(name: str) -> bytes | None:
    """Return the machine code that an earlier process has kept under this name."""
    return next((code for folder in _folders() if (code := _kept(folder / name)) is not None), None)


@contextmanager
def _one_at_a_time() -> Iterator[None]:
    """Wait for the other processes that compile the loop, and keep them waiting: their result will do."""
    with ExitStack() as stack:
        for folder in _folders():
            with suppress(OSError):  # it cannot be made, or its file system has no locks
                _make_own(folder)
                stack.enter_context(_locked(folder / "simulator.lock"))
                break
        yield


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    if os.name != "posix":  # each process compiles for itself
        yield
        return
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _kept(path: Path) -> bytes | None:
    """Return the machine code in a file, if the file exists, matches the digest at its start and can only be
    the user's; else None.
    """
    try:
        if not _only_ours(path):
            return None
        with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0)), "rb") as file:
            content = file.read()
    except OSError:
        return None
    code = content[DIGEST_BYTES:]
    return code if hashlib.sha256(code).digest() == content[:DIGEST_BYTES] else None


def _only_ours(path: Path) -> bool:
    """Return whether only the user and root can change what is at `path`: the file, and each folder above it.

    A folder in which everybody may create files but not touch those of others (/tmp) is safe for the user's
    own files. Raises OSError if the path does not exist.
    """
    if os.name != "posix":  # the folders are the user's own
        return True
    if path.is_symlink():
        return False
    path = path.resolve(strict=True)
    for component in (path, *path.parents):
        status = component.stat()
        shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if status.st_uid not in (0, os.geteuid()) or (
            shared and (component == path or not status.st_mode & stat.S_ISVTX)
        ):
            return False
    return True


def _make_own(folder: Path) -> None:
    """Create a folder, and missing folders above it, with access for the user only."""
    if not folder.exists():
        _make_own(folder.parent)
        folder.mkdir(mode=0o700, exist_ok=True)


def _keep(name: str, code: bytes) -> None:
    """Write the object file to the first folder from which it may be loaded, if there is one."""
    content = hashlib.sha256(code).digest() + code
    for folder in _folders():
        try:
            _make_own(folder)
            if not _only_ours(folder):
                continue
            with tempfile.NamedTemporaryFile(dir=folder, delete=False) as file:
                file.write(content)
            Path(file.name).chmod(0o644)
            Path(file.name).replace(folder / name)
            for old in folder.glob(f"{name.rpartition('-')[0]}-*.o"):
                if old.name != name:
                    old.unlink()
        except OSError:
            continue
        return


def compile_loop(observed: bool, tracked: bool, visits: bool) -> bytes:
    """Return an object file with the loop as ENTRY, in numba's calling convention: (result, error,
    arguments).
    """
    from numba import cfunc, types

    from servogen.simulator.compiled import Pipeline, compile_general
    from servogen.simulator.core import instruction_loop

    compile_general()
    kinds = {"p": types.CPointer(types.int64), "i": types.int64}  # type: ignore[no-untyped-call]
    signature = types.int64(*(kinds[kind] for kind in SIGNATURE))
    compiled = cfunc(signature, pipeline_class=Pipeline, error_model="numpy")(
        instruction_loop(observed, tracked, visits)
    )
    text = _alone(compiled.inspect_llvm(), compiled.native_name.removeprefix("cfunc."))
    module = llvm.parse_assembly(text)
    return bytes(_target().emit_object(module))


def _alone(text: str, name: str) -> str:
    """Return the module without numba's wrappers, which need numba to run, and with the loop under our
    name.
    """
    text = re.sub(
        r"^define [^\n]*@\"?(?:cfunc|cpython|_ZN7cpython)[^\n]*\{\n.*?^\}\n", "", text, flags=re.M | re.S
    )
    text = text.replace(f"@{name}", f"@{ENTRY}").replace(f'@"{name}"', f"@{ENTRY}")
    for declared in re.findall(r"^declare [^\n]*@\"?([\w.]+)", text, flags=re.M):
        if not declared.startswith("llvm.") and len(re.findall(rf"@\"?{re.escape(declared)}\b", text)) > 1:
            raise ToolError(
                "simulator-failed", f"the compiled simulator needs '{declared}', which only numba has"
            )
    return text


def _target() -> Any:
    """Return the target machine of this process, with the code model and relocations that numba uses at run
    time.
    """
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=_features(),
        opt=3,
        reloc="static" if target.name.startswith("x86") else "default",
        codemodel="jitdefault",
        jit=True,
    )


_ENGINES: list[Any] = []
"""Machine code lives as long as its engine."""


def _load(code: bytes) -> Loop:
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _ENGINES.append(engine)
    address = engine.get_function_address(ENTRY)
    if not address:
        raise ToolError(
            "simulator-failed",
            "the compiled simulator cannot be loaded",
            hint="this is a defect of servogen; report it",
        )
    arguments = [ctypes.c_void_p if kind == "p" else ctypes.c_int64 for kind in SIGNATURE]
    function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *arguments)(address)

    def call(*values: int) -> int:
        result, error = ctypes.c_int64(), ctypes.c_void_p()
        if function(ctypes.addressof(result), ctypes.addressof(error), *values) != 0:
            raise ToolError(
                "simulator-failed",
                "the compiled simulator failed",
                hint="this is a defect of servogen; report it",
            )
        return result.value

    return call
