"""What every test can rely on."""

import gc
import os
import pickle
from collections.abc import Iterator, Sequence

import pytest
from hypothesis import HealthCheck, settings

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.compiler.options import VERIFY_IR
from servogen.native import parts

os.environ[VERIFY_IR] = "1"  # the compiler checks its intermediate form after every pass

# The same examples on every machine, however slow it is.
settings.register_profile(
    "servogen", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("servogen")


def pytest_xdist_auto_num_workers() -> int:
    """Return one more than there are processors: many tests wait for a port or another process."""
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return processors + 1


def pytest_collection_finish() -> None:
    """Spare the garbage collector the thousands of tests, which live to the end, and most of its rounds."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 50)  # it took a tenth of the tests that compile


@pytest.fixture(scope="session", autouse=True)
def _the_cache_is_of_this_session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The certificates of the user's own proofs would change what a build says."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session", autouse=True)
def _the_parts_in_c_are_compiled() -> None:
    """After a change of their sources every command would ask for a new installation."""
    for part in parts():
        part.refresh()


@pytest.fixture(scope="session", autouse=True)
def _the_c_of_an_engine_is_compiled_once() -> Iterator[None]:
    """Hundreds of tests build the same jobs; each gets a copy of its own.

    Where a test patches the compiler itself, a job that was compiled before stays as it was.
    """
    kept: dict[str, bytes] = {}

    def compiled(sources: Sequence[Source], options: Options) -> Compilation:
        key = repr((sources, options))
        if key not in kept:
            kept[key] = pickle.dumps(compile_sources(sources, options))
        copy: Compilation = pickle.loads(kept[key])
        return copy

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("servogen.engines.fitting.compile_sources", compiled)
        yield
