"""The viewer in the page of `servogen report`: one file that plays the robot without a server."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from servogen.job import load, plan_job
from servogen.workflows.reporting import build_page
from tests.watch.browser import Browser, Page, needs_axe, violations

ROOT = Path(__file__).parent.parent.parent
MAX_BYTES = 1_000_000


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("report") / "hexapod.html"
    made.write_text(build_page(plan_job(load(ROOT / "jobs" / "hexapod-tripod.toml"))).html)
    return made


@pytest.fixture
def page(file: Path, browser: Browser) -> Iterator[Page]:
    """The page as it opens from disk on a phone; nothing may go wrong in it, and nothing be asked for."""
    opened = browser.page(width=390, height=844)
    opened.call("Page.navigate", url=file.as_uri())
    opened.arrives(file.as_uri(), "typeof film !== 'undefined'")
    yield opened
    opened.run("0")
    assert opened.problems == []
    assert opened.requests == [file.as_uri()]
    opened.close()


def angles(page: Page) -> list[float]:
    return list(page.run("film.servos.angles"))


def go(page: Page, seconds: float) -> None:
    move = f"m => {{ m.value = {seconds * 1e6}; m.dispatchEvent(new Event('input')); }}"
    page.run(f"({move})(document.getElementById('moment'))")


@pytest.mark.campaign
def test_the_page_of_the_hexapod_is_small_and_fits_a_phone(file: Path, page: Page) -> None:
    assert file.stat().st_size < MAX_BYTES
    assert page.run("document.documentElement.scrollWidth") <= 390
    assert page.run("document.getElementById('robot').clientHeight") > 100


def test_every_pose_of_the_motion_is_reached(page: Page) -> None:
    """The servos stand where the schedule's frame puts them, once its pulses are over."""
    job = plan_job(load(ROOT / "jobs" / "hexapod-tripod.toml"))
    frames = len(job.trajectory.angles)
    lead_in = page.run("film.data.loop") / 20_000
    for frame in (0, frames // 3, frames // 2, frames - 1):
        at = frame + round(lead_in - job.trajectory.loop_start)
        go(page, (at * 20_000 + 19_000) / 1e6)
        planned = job.trajectory.angles[frame]
        assert angles(page) == pytest.approx(planned.tolist(), abs=0.012)  # pulses of whole cycles, 0.67°


def test_it_plays_and_a_servo_that_is_switched_off_stays(page: Page) -> None:
    go(page, 2.0)
    page.run("document.querySelectorAll('#servos input')[0].click()")
    before = angles(page)
    page.plays(2.5e6)
    after = angles(page)
    assert after[0] == before[0]
    assert max(abs(one - other) for one, other in zip(before, after, strict=True)) > 0.05
    assert page.run("film.robot.trails[1].length") > 3
    assert page.run("film.wrong.length") == 0


def test_pulses_that_differ_from_the_plan_are_found(page: Page) -> None:
    page.run("film.played[3].width[7] += 2; 0")
    found = page.run("film.differences().map(e => [e.pin, e.level])")
    assert found == [[3, 0], [3, 0]] or found == [[8, 0], [8, 0]]


@needs_axe
def test_axe_finds_nothing(page: Page) -> None:
    assert violations(page) == []
