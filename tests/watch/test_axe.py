"""What axe finds in the page of `servogen watch`: nothing. It takes long, so it is a file of its own."""

from __future__ import annotations

import pytest

pytest.importorskip("websockets", reason="the extra 'watch' is not installed")

from tests.watch.browser import needs_axe, violations
from tests.watch.test_page import ROOT, Open, watch  # noqa: F401 - a fixture


@needs_axe
@pytest.mark.parametrize("job", ["lab8-exercise", "hexapod-command", "stream-arm"])
def test_axe_finds_nothing(watch: Open, job: str) -> None:  # noqa: F811
    page = watch(ROOT / "jobs" / f"{job}.toml")
    page.click("#labels button")
    page.until("!document.getElementById('explanation').hidden")
    for tabs in (("source", "chip"), ("job", "memory"), ("job", "serial"), ("job", "hands")):
        for tab in tabs:
            page.click(f"#tab-{tab}")
        assert violations(page) == [], tabs
