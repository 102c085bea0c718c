"""What every test can rely on."""

import pytest

from servogen.simulator.native import loop


@pytest.fixture(scope="session", autouse=True)
def _the_simulator_is_compiled() -> None:
    """After a change of its sources the first command would say on standard error that it compiles it."""
    loop(observed=False, tracked=False)
    loop(observed=True, tracked=False)
    loop(observed=False, tracked=True)
