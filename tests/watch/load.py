"""The load of `servogen watch` on this machine: pictures a second, the server's share of a core, its traffic.

    python -m tests.watch.load [JOB]

starts the command for a job (default: the hexapod of twelve servos), opens it in a headless Chromium, runs it
at real speed for ten seconds, and prints how many pictures a second were painted, the processor time of the
server, the bytes that its socket sent, how long the waves take to be drawn, and how long it took to the first
answer and the first picture.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path

from tests.watch.browser import Browser, Page, chromium, wait

ROOT = Path(__file__).parent.parent.parent
SECONDS = 10.0


def main() -> int:
    job = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "jobs" / "hexapod-tripod.toml")
    program = chromium()
    if program is None:
        print("there is no chromium here")
        return 3
    begin = time.monotonic()
    command = [sys.executable, "-m", "servogen", "watch", job, "--no-browser"]
    served = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    assert served.stdout is not None
    found = re.search(r"http://\S+", served.stdout.readline())
    assert found
    print(f"address printed after {time.monotonic() - begin:.2f} s")
    browser = Browser(program)
    try:
        page = browser.page()
        begin = time.monotonic()
        page.open(found[0])
        print(f"page loaded after {time.monotonic() - begin:.2f} s")
        wait(lambda: page.run("typeof watched !== 'undefined' && watched.pictures") > 0)
        print(f"first picture {time.monotonic() - begin:.2f} s after it was asked for, compiled by then")
        _again(page)
        _measured(page, served.pid)
    finally:
        browser.close()
        served.terminate()
        served.wait(10)
    return 0


def _again(page: Page) -> None:
    begin = time.monotonic()
    page.call("Page.reload")
    page.run("window.watched = undefined; 0")
    wait(lambda: bool(page.run("typeof watched !== 'undefined' && watched?.pictures > 0")))
    print(f"first picture {time.monotonic() - begin:.2f} s after loading it again")


def _measured(page: Page, server: int) -> None:
    page.click("#run")
    page.until("watched.latest.running")
    time.sleep(1)
    bytes_before, pictures = _received(page), page.run("watched.pictures")
    cpu, begin, cycle = _cpu_s(server), time.monotonic(), page.run("watched.latest.cycle")
    time.sleep(SECONDS)
    passed = time.monotonic() - begin
    print(f"{(page.run('watched.pictures') - pictures) / passed:.1f} pictures a second")
    print(f"{(page.run('watched.latest.cycle') - cycle) / passed / 1e6:.2f} of real speed, at 1 µs a cycle")
    print(f"server {100 * (_cpu_s(server) - cpu) / passed:.1f} % of a core")
    print(f"{(_received(page) - bytes_before) / passed / 1000:.1f} kB/s of messages before compression")
    page.click("#run")
    page.until("!watched.latest.running")
    drawn = page.run(
        "(() => { const times = []; for (let n = 0; n < 99; n++) { const t = performance.now();"
        " watched.waves.paint(); times.push(performance.now() - t); }"
        " times.sort((a, b) => a - b); return [times[49], times[97]]; })()"
    )
    print(f"waves drawn in {drawn[0]:.1f} ms, 98 of 99 times within {drawn[1]:.1f} ms")


def _received(page: Page) -> int:
    page.run("0")
    return sum(len(text) for text in page.frames)


def _cpu_s(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    sys.exit(main())
