"""One browser for all tests of pages."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("websockets", reason="the extra 'watch' is not installed")

from tests.watch.browser import Browser, chromium


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    program = chromium()
    if program is None:
        pytest.skip("there is no chromium here")
    started = Browser(program)
    yield started
    started.close()
