"""The pictures of the page of `servogen watch` and of its viewer, in a headless Chromium.

python docs/pictures/watch.py [NAME ...]
"""

# ruff: noqa: E402 - the tests' browser is found from the root of the repository

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT))

from servogen.edges import LOW, PINS
from servogen.grade import Submission, load_lab, page_names
from servogen.job import load, plan_job
from servogen.programs import read_schedule, read_submission
from servogen.watch.differences import ScheduledEdges
from servogen.watch.editing import Editor
from servogen.watch.graded import class_pages, class_rooms
from servogen.watch.server import WatchServer
from servogen.watch.subject import Setting, load_subject
from servogen.workflows.films import film_page
from servogen.workflows.grading import GradingTask, grade_submissions
from servogen.workflows.reporting import build_page
from tests.engines.tape.tape_jobs import text as tape_text
from tests.watch.browser import Browser, Page, chromium, wait
from tests.watch.serving import Running
from tests.watch.test_page import NO_TRIS
from tests.watch.test_session import captured

LAB8, TRIPOD = ROOT / "jobs" / "lab8-exercise.toml", ROOT / "jobs" / "hexapod-tripod.toml"
BUILT = ROOT / "firmware" / "lab8-exercise"
PROGRAMS = ROOT / "tests" / "grade" / "programs"
STOP = 'stop_pin = "RA4"\nstop_pulses = "off"\n'
WIDE = {"width": 1280, "height": 800}
Steps = Callable[[Page], None]


class Studio:
    """Takes pictures of what a folder of this run has in it, if they are wanted."""

    def __init__(self, folder: Path, wanted: list[str]) -> None:
        program = chromium()
        assert program is not None, "there is no chromium here"
        self.folder = folder
        self._browser = Browser(program)
        self._wanted = wanted

    def close(self) -> None:
        self._browser.close()

    def wants(self, name: str) -> bool:
        return not self._wanted or name in self._wanted

    def file(self, name: str, text: str) -> Path:
        made = self.folder / name
        made.write_text(text)
        return made

    def watch(self, name: str, path: Path, setting: Setting, steps: Steps, **size: int) -> None:
        """Take a picture of the page of a file, after some steps in it."""
        if not self.wants(name):
            return
        editor = Editor(path, setting) if path.suffix == ".toml" else None
        served = Running(lambda progress: load_subject(path, setting, progress), editor)
        try:
            page = self._browser.page(**(size or WIDE))
            page.open(served.server.url)
            page.until("!document.getElementById('views').hidden && watched.latest && watched.waves.data")
            steps(page)
            self._take(page, name)
        finally:
            served.stop()

    def open(self, name: str, url: str, steps: Steps, **size: int) -> None:
        """Take a picture of any page."""
        page = self._browser.page(**size)
        page.call("Page.navigate", url=url)
        wait(lambda: bool(page.run("document.readyState === 'complete'")))
        steps(page)
        self._take(page, name)

    def _take(self, page: Page, name: str) -> None:
        time.sleep(1)  # what was asked for is painted
        page.picture(HERE / f"watch-{name}.png")
        print(f"docs/pictures/watch-{name}.png", flush=True)
        page.close()


def go(page: Page, cycle: int) -> None:
    page.run(f"document.getElementById('go').value = 'cycle {cycle}'")
    page.run("document.getElementById('go-form').requestSubmit()")
    page.until(f"Math.abs(watched.latest.cycle - {cycle}) < 3")


def change(page: Page, old: str, new: str) -> None:
    """Type over a text in the editor."""
    select = f"const at = e.value.indexOf('{old}'); e.focus(); e.setSelectionRange(at, at + {len(old)});"
    page.run(f"(e => {{ {select} }})(document.getElementById('job-text'))")
    page.call("Input.insertText", text=new)


def jobs(studio: Studio) -> None:
    job = studio.file("hexapod.toml", TRIPOD.read_text() + STOP)
    studio.watch("hexapod", job, Setting(), lambda page: go(page, 4_210_000))
    studio.watch("projector", job, Setting(), lambda page: go(page, 4_210_000), width=1920, height=1080)
    studio.watch("phone", job, Setting(), lambda page: go(page, 4_210_000), width=390, height=844)

    def bus(page: Page) -> None:
        go(page, 6000)
        page.run("watched.waves.show(150, 900)")
        page.until("watched.waves.data.end === 900")

    studio.watch("bus", studio.file("dance.toml", tape_text()), Setting(), bus)

    def bodies(page: Page) -> None:
        page.click("#twin-show")
        page.until("!!watched.robot.bodies")
        go(page, 4_210_000)
        page.until("document.getElementById('twin-text').textContent.startsWith('bodies at 4.21')")

    studio.watch("bodies", job, Setting(), bodies)

    def ghost(page: Page) -> None:
        go(page, 1_500_000)
        change(page, "arm_deg = 30", "arm_deg = 60")
        page.until("document.getElementById('preview').textContent.includes('ghost')")

    studio.watch("job", studio.file("lab8.toml", LAB8.read_text()), Setting(), ghost)

    def poses(page: Page) -> None:
        change(page, "arm_deg = 30", "arm_deg = 300")
        page.until("!!document.querySelector('#job-problems .error')")

    studio.watch("timeline", studio.file("lab8.toml", LAB8.read_text()), Setting(), poses)


def programs(studio: Studio) -> None:
    def why(page: Page) -> None:
        go(page, 5000)
        page.click(".line[data-line='6'] button")
        page.click("#labels button")
        page.until("!document.getElementById('explanation').hidden")

    studio.watch("why", studio.file("blink.c", NO_TRIS), Setting(), why)
    text = (BUILT / "main.c2c.c").read_text().replace("delay_us(", "delay_us(40 + ", 1)

    def difference(page: Page) -> None:
        page.click("#difference")
        page.until("watched.latest.cycle > 100")
        page.click("#back-instruction")

    against = Setting(schedule=read_schedule(BUILT / "schedule.json"))
    studio.watch("difference", studio.file("wrong.c", text), against, difference, **WIDE, dark=True)
    schedule = read_schedule(ROOT / "firmware" / "hexapod-tripod" / "schedule.json")
    lift = next(PINS.index(channel.pin) for channel in schedule.channels if channel.name == "L1-lift")
    first = schedule.lead_in_frames * schedule.period
    edges = ScheduledEdges(schedule, 0).edges(first - 500_000, first + 1_500_000)
    late = sorted((at + 100 * (pin == lift and level == LOW), pin, level) for at, pin, level in edges)
    run = captured(studio.folder / "run.vcd", 0.0, late, rate=1_000_000, begin=late[0][0] - 1000)
    studio.watch("capture", run, Setting(job=TRIPOD), lambda page: go(page, 1_400_000))


def finished(studio: Studio) -> None:
    if studio.wants("report"):
        made = studio.file("report.html", build_page(plan_job(load(TRIPOD))).html)
        show = "document.getElementById('pulses').scrollIntoView(); film.go(2.6e6)"
        studio.open("report", made.as_uri(), lambda page: page.run(show), width=1000, height=1000)
    if not any(map(studio.wants, ("film", "class", "graded"))):
        return
    names = ("lab8-wrong/order.c", "lab8-right/delays.c", "lab8-wrong/syntax.c", "lab8-wrong/period.c")
    students = []
    for student, name in zip(("ana", "ben", "cora", "dan"), names, strict=True):
        (studio.folder / student).mkdir()
        file = studio.file(f"{student}/main.c", (PROGRAMS / name).read_text())
        students.append(Submission(f"{student}/main.c", file, file.parent))
    task = GradingTask.of(load_lab("lab8-exercise"), read_submission, 60.0, 300)
    graded = list(grade_submissions(students, task))
    if studio.wants("film"):
        made = studio.file("film.html", film_page(task.lab, students[0], graded[0].grade))
        studio.open("film", made.as_uri(), lambda page: None, width=900, height=860)
    pages = class_pages(task, page_names([each.name for each in students]), graded)
    served = Running(server=WatchServer(class_rooms(task, graded), pages))
    try:
        if studio.wants("class"):
            studio.open("class", served.server.url, lambda page: None, width=1000, height=360)
        if studio.wants("graded"):
            studio.open("graded", f"{served.server.url}watch/0/", opened, **WIDE)
    finally:
        served.stop()


def opened(page: Page) -> None:
    page.until("!document.getElementById('views').hidden && watched.latest && watched.waves.data")
    page.run("document.getElementById('task').open = true")


def main(names: list[str] | None = None) -> None:
    os.chdir(ROOT)
    with tempfile.TemporaryDirectory() as folder:
        studio = Studio(Path(folder), names or [])
        try:
            jobs(studio)
            programs(studio)
            finished(studio)
        finally:
            studio.close()


if __name__ == "__main__":
    main(sys.argv[1:])
