"""`servogen grade --watch`: a class and its programs, one click away; who is let in, and what is served."""

from __future__ import annotations

import http.client
import json
import re
import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

import pytest

pytest.importorskip("websockets", reason="the extra 'watch' is not installed")

from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection

from servogen.grade import Submission, load_lab, page_names
from servogen.programs import read_submission
from servogen.watch import server as module
from servogen.watch.graded import class_pages, class_rooms, watched_program
from servogen.watch.server import WatchServer
from servogen.workflows.grading import Graded, GradingTask, grade_submissions
from tests.bench.conftest import Run, run  # noqa: F401 - a fixture
from tests.watch.browser import Browser, needs_axe, violations, wait
from tests.watch.commands import served_by
from tests.watch.serving import Running

PROGRAMS = Path(__file__).parent.parent / "grade" / "programs"
EVIL = "mal/<img src=x onerror=hacked=1>.c"
SCRIPT = "</pre></script><script>window.hacked = 1</script>"
SECRET = "the solution of dan"


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> list[Graded]:
    """Ana's program is wrong, Dan's is right, Eva's does not compile; Mal's is Ana's with a trap in it."""
    folder = tmp_path_factory.mktemp("class")
    for name, text in (
        ("ana/main.c", (PROGRAMS / "lab8-wrong" / "order.c").read_text()),
        ("dan/main.c", f"// {SECRET}\n" + (PROGRAMS / "lab8-right" / "delays.c").read_text()),
        ("eva/main.c", "int main( {\n"),
    ):
        (folder / name).parent.mkdir()
        (folder / name).write_text(text)
    students = [
        Submission(f"{each}/main.c", folder / each / "main.c", folder / each)
        for each in ("ana", "dan", "eva")
    ]
    found = grade_submissions(students, task())
    film = found[0].grade.film
    assert film is not None and film.source is not None
    trap = replace(film, source=replace(film.source, file=SCRIPT, lines=(*film.source.lines, SCRIPT)))
    evil = replace(found[0].grade, film=trap, faults=(replace(found[0].grade.faults[0], text=SCRIPT),))
    (folder / "mal").mkdir()
    source = folder / "mal" / "main.c"
    source.write_text(f"// {SCRIPT}\n" + (folder / "ana" / "main.c").read_text())
    return [*found, Graded(Submission(EVIL, source, folder / "mal"), evil)]


def task() -> GradingTask:
    return GradingTask.of(load_lab("lab8-exercise"), read_submission, 60.0, 300)


def test_it_is_said_that_a_program_is_being_compiled(graded: list[Graded]) -> None:
    said: list[str] = []
    assert watched_program(task(), graded[0], "ana.html", said.append).image.program
    assert said == ["compiling"]


def server(graded: list[Graded]) -> WatchServer:
    names = page_names([each.submission.name for each in graded])
    return WatchServer(class_rooms(task(), graded), class_pages(task(), names, graded))


@pytest.fixture
def running(graded: list[Graded]) -> Iterator[Running]:
    served = Running(server=server(graded))
    yield served
    served.stop()


def status(socket: ClientConnection) -> dict[str, Any]:
    """The first message that says how loading ended: the model, or a status that has failed."""
    while True:
        message = json.loads(socket.recv(timeout=300))
        if message["is"] == "model" or message.get("failed"):
            return dict(message)


def test_the_class_and_its_pages_are_served_to_who_has_the_address(running: Running) -> None:
    code, text, headers = running.get(f"/{running.token}/")
    assert code == 200 and headers["Content-Type"].startswith("text/html")
    assert "1 of 4 programs passed" in text and "ana/main.c" in text
    assert text.count("open in watch</a>") == 3, "Eva's program cannot be run"
    for name in re.findall(r'<a href="([^"]+)"', text):
        code, _, headers = running.get(f"/{running.token}/{name}")
        assert code == 200, name
        kind = "text/plain" if name.endswith(".md") else "text/html"
        assert headers["Content-Type"].startswith(kind), name
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert "unsafe" not in headers["Content-Security-Policy"]
        assert "default-src 'none'" in headers["Content-Security-Policy"]


def test_a_page_lets_only_its_own_script_run(running: Running) -> None:
    """Each answer names another nonce, and only the page's one script carries it."""
    seen = set()
    for _ in range(2):
        _, text, headers = running.get(f"/{running.token}/{quote('ana+main.c.html')}")
        (nonce,) = re.findall(r"script-src 'nonce-([^']+)';", headers["Content-Security-Policy"])
        assert len(nonce) >= 20 and text.count(f'<script type="module" nonce="{nonce}">') == 1
        assert "connect-src 'none'" in headers["Content-Security-Policy"]
        seen.add(nonce)
    assert len(seen) == 2


@pytest.mark.parametrize("path", ["", "ana+main.c.html", "dan+main.c.md", "watch/0/", "watch/0/app.js"])
@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Host": "evil.example"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": ""},
    ],
)
def test_a_page_is_refused(running: Running, path: str, headers: dict[str, str]) -> None:
    code, text, _ = running.get(f"/{running.token}/{quote(path)}", **headers)
    assert code == 403
    assert "ana" not in text and "<" not in text


@pytest.mark.parametrize("path", ["", "ana+main.c.html", "dan+main.c.md", "watch/0/", "watch/0/app.js"])
def test_a_wrong_token_is_refused(running: Running, path: str) -> None:
    for token in ("x", running.token[:-1], f"{running.token}x"):
        assert running.get(f"/{token}/{quote(path)}")[0] == 403
    assert running.get(f"/{quote(path)}")[0] == 403


@pytest.mark.parametrize(
    ("token", "headers"),
    [
        (None, {"Origin": "http://evil.example"}),
        (None, {"Origin": None}),
        (None, {"Origin": "null"}),
        ("x", {}),
        ("", {}),
    ],
)
def test_a_socket_is_refused(running: Running, token: str | None, headers: dict[str, str | None]) -> None:
    with pytest.raises(InvalidStatus) as refused, running.socket(token, "watch/0/", **headers):
        pass
    assert refused.value.response.status_code == 403


def test_a_socket_with_a_foreign_host_is_refused(running: Running) -> None:
    assert running.handshake("watch/0/", Host="evil.example", Origin="http://evil.example") == 403


@pytest.mark.parametrize(
    "name",
    [
        "ana/main.c",
        "../ana/main.c",
        "%2e%2e/ana/main.c",
        "..%2fana%2fmain.c",
        "/etc/passwd",
        "%2fetc%2fpasswd",
        "watch/2/",
        "watch/99/",
        "watch/-1/",
        "watch/0/../1/",
        "watch/0/main.c",
        "watch/0/ana+main.c.html",
        "watch/0/%2e%2e/1/app.js",
        "app.js",
        "socket",
    ],
)
def test_nothing_else_is_served(running: Running, name: str) -> None:
    code, text, _ = running.get(f"/{running.token}/{name}")
    assert code == 404
    assert SECRET not in text and "PULSES" not in text


def test_a_room_without_its_last_slash_leads_to_the_room(running: Running) -> None:
    code, text, headers = running.get(f"/{running.token}/watch/0")
    assert (code, text, headers["Location"]) == (308, "", f"/{running.token}/watch/0/")


@pytest.mark.parametrize("room", ["", "watch/2/", "watch/99/", "watch/0/../1/", "watch/0/watch/1/"])
def test_there_is_no_other_socket(running: Running, room: str) -> None:
    with pytest.raises(InvalidStatus) as refused, running.socket(room=room):
        pass
    assert refused.value.response.status_code == 404


def test_a_program_is_at_the_moment_of_its_film_when_it_is_opened(
    running: Running, graded: list[Graded]
) -> None:
    film = graded[0].grade.film
    assert film is not None
    with running.socket(room="watch/0/") as socket:
        socket.send(json.dumps({"window": ""}))
        model = status(socket)
        assert model["name"] == "ana/main.c" and not model["poses"]
        assert [servo["name"] for servo in model["robot"]["servos"]] == ["arm"]
        while (now := json.loads(socket.recv(timeout=300)))["is"] == "going":
            pass
        assert now["cycle"] - film.moment_us in (0, 1)  # 1 µs a cycle
        socket.send(json.dumps({"do": "save", "text": "x"}))
        assert "only a job file" in json.loads(socket.recv(timeout=300))["text"]


def test_a_program_includes_only_its_own_students_files(graded: list[Graded]) -> None:
    """Dan's file is right beside Mal's folder; the message quotes nothing of it."""
    mine = graded[3].submission.file
    trap = mine.with_name("trap.c")
    trap.write_text('#include "../dan/main.c"\n' + mine.read_text())
    stolen = replace(graded[3], submission=replace(graded[3].submission, file=trap))
    served = Running(server=server([*graded[:3], stolen]))
    try:
        with served.socket(room="watch/3/") as socket:
            socket.send(json.dumps({"window": ""}))
            found = status(socket)
        assert found["is"] == "status" and "outside the student's own folder" in found["text"]
        assert SECRET not in found["text"]
    finally:
        served.stop()


def test_a_program_that_has_become_a_link_out_of_its_folder_is_not_read(
    graded: list[Graded], tmp_path: Path
) -> None:
    link = tmp_path / "main.c"
    link.symlink_to(graded[1].submission.file)
    stolen = replace(graded[0], submission=Submission("ana/main.c", link, tmp_path.resolve()))
    served = Running(server=server([stolen]))
    try:
        with served.socket(room="watch/0/") as socket:
            socket.send(json.dumps({"window": ""}))
            assert "outside the student's own folder" in status(socket)["text"]
    finally:
        served.stop()


def test_only_some_programs_are_loaded_at_a_time(running: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_ROOMS", 1)
    with running.socket(room="watch/0/") as first:
        first.send(json.dumps({"window": ""}))
        assert status(first)["is"] == "model"
        with running.socket(room="watch/1/") as second:
            second.send(json.dumps({"window": ""}))
            assert "1 programs are open: close one" in status(second)["text"]
    wait(lambda: not running.server.rooms["watch/0"].watched)
    with running.socket(room="watch/1/") as again:
        again.send(json.dumps({"window": ""}))
        assert status(again)["name"] == "dan/main.c"


def test_a_click_opens_a_students_program_where_it_is_wrong(
    running: Running, browser: Browser, graded: list[Graded]
) -> None:
    """From the class to the film to the chip; the program is run, stepped back, and keeps its place."""
    tab = browser.page()
    tab.open(running.server.url)
    tab.click("tr:nth-child(2) td:nth-child(4) a")
    film = f"{running.server.url}{quote('ana+main.c.html', safe='%')}"
    tab.arrives(film, "typeof film === 'object'")
    tab.click("#watch")
    opened = browser.adopt(f"{running.server.url}watch/0/")
    opened.until("!document.getElementById('views').hidden && watched.latest && watched.waves.data")
    assert opened.run("document.title") == "ana/main.c · servogen"
    assert opened.run("document.getElementById('verdict').textContent") == "NOT passed"
    reason = graded[0].grade.reasons[0]
    assert reason in opened.run("document.getElementById('difference-text').textContent")
    assert reason in opened.run("document.getElementById('task-reasons').textContent")
    assert "30" in opened.run("document.getElementById('task-text').textContent")
    begin = opened.run("watched.latest.cycle")
    assert opened.run("watched.robot.angles[0] * 180 / Math.PI") == pytest.approx(
        28.8, abs=0.5
    )  # 1160 µs before
    opened.click("#next-edge")
    opened.until(f"watched.latest.cycle > {begin}")
    opened.click("#back-edge")
    opened.until(f"watched.latest.cycle < {begin}")
    here = opened.run("watched.latest.cycle")
    opened.open(f"{running.server.url}watch/1/")
    opened.until("watched.latest?.cycle === 0 && document.title.startsWith('dan')")
    opened.open(f"{running.server.url}watch/0/")
    opened.until(f"watched.latest?.cycle === {here}")
    opened.click("#difference")
    opened.until(f"Math.abs(watched.latest.cycle - {begin}) < 3")
    opened.click("#to-film")
    opened.arrives(film, "typeof film === 'object'")
    opened.open(f"{running.server.url}watch/1/")
    opened.until("document.getElementById('verdict').textContent === 'passed'")
    opened.click("#graded a")
    opened.arrives(running.server.url)
    for page in (tab, opened):
        assert page.problems == []
        addresses = [each for each in page.requests if not each.startswith("data:")]
        assert {address.split("/")[2] for address in addresses} == {running.host}
        page.close()


def test_what_students_wrote_stays_text_in_every_page(running: Running, browser: Browser) -> None:
    tab = browser.page(width=390, height=844)
    film = quote(quote(EVIL.replace("/", "+"), safe="+.") + ".html", safe="+.")
    for name, ready in (
        ("", "document.querySelector('table')"),
        (film, "typeof film !== 'undefined'"),
        (
            "watch/3/",
            "typeof watched !== 'undefined' && watched.latest?.chip && document.querySelector('.line')",
        ),
    ):
        tab.call("Page.navigate", url=f"{running.server.url}{name}")
        tab.arrives(f"{running.server.url}{name}", ready)
        assert tab.run("typeof window.hacked") == "undefined", name
        assert "<img src=x" in tab.run("document.body.textContent"), name
        assert tab.run("document.querySelectorAll('img').length") == 0
        assert tab.run("document.documentElement.scrollWidth") <= 390, name
    assert tab.problems == []
    tab.close()


@needs_axe
def test_axe_finds_nothing(running: Running, browser: Browser) -> None:
    """The policy lets no other script into a served page: it is left out here."""
    graded = "window.watched?.waves?.data && (document.getElementById('task').open = true)"
    pages = (("", "document.querySelector('table')"), ("ana%2Bmain.c.html", "film"), ("watch/0/", graded))
    for name, ready in pages:
        tab = browser.page()
        tab.call("Page.setBypassCSP", enabled=True)
        tab.call("Page.navigate", url=f"{running.server.url}{name}")
        tab.arrives(f"{running.server.url}{name}", ready)
        assert violations(tab) == []
        tab.close()


def test_the_command_serves_until_ctrl_c_and_ends_with_the_grades_code(graded: list[Graded]) -> None:
    folder = graded[2].submission.file.parent
    command = ["grade", "lab8-exercise", str(folder), "--level", "0", "--watch", "--no-browser"]
    with served_by(*command) as (served, output, errors):
        lines = iter(output.readline, "")
        found = next(
            filter(
                None, (re.search(r"lab8-exercise: (http://127\.0\.0\.1:\d+/\S+/)", line) for line in lines)
            )
        )
        address = urlsplit(found[1])
        connection = http.client.HTTPConnection(address.netloc, timeout=300)
        connection.request("GET", address.path, headers={"Sec-Fetch-Site": "none"})
        assert "0 of 1 programs passed" in connection.getresponse().read().decode()
        served.send_signal(signal.SIGINT)
        assert served.wait(300) == 1, "the program has not passed"
        assert "Traceback" not in errors.read()


def test_bad_input_ends_before_anything_is_graded(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    wrong = PROGRAMS / "lab8-wrong" / "order.c"
    done = run("grade", "lab8-exercise", wrong, "--watch", "--json")
    assert done.code == 2 and "--json" in done.err
    assert run("grade", "lab8-exercise", wrong, "--port", "80").code == 2
    monkeypatch.setitem(sys.modules, "servogen.watch.server", None)
    done = run("grade", "lab8-exercise", wrong, "--watch")
    assert done.code == 3 and "servogen[watch]" in done.err
