"""A headless Chromium, driven over its DevTools protocol: pages, keys, clicks, screenshots, what went wrong.

`chromium()` returns the program, or None where there is none. One browser serves a whole module of tests.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import ClientConnection, connect

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--mute-audio"),
    *("--remote-debugging-port=0", "--disable-extensions", "--hide-scrollbars"),
)
WAIT_S = 300.0
"""Only what hangs waits so long."""


def chromium() -> str | None:
    """Return the path of a browser, or None."""
    return os.environ.get("SERVOGEN_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


AXE = os.environ.get("SERVOGEN_AXE")
"""The file axe.min.js of the npm package axe-core, where somebody has installed it."""

needs_axe = pytest.mark.skipif(AXE is None, reason="SERVOGEN_AXE does not name axe.min.js")


def violations(page: Page) -> list[str]:
    """Return what axe finds in a light page that keeps people out, and in its colours when it is dark."""
    assert AXE is not None
    if not page.run("'axe' in window"):
        page.run(Path(AXE).read_text() + "; 0")
    found = "r.violations.map(v => v.id + ': ' + v.nodes.map(n => n.target).join(' '))"
    light = page.run(f"axe.run().then(r => {found})")
    page.colours("dark")
    dark = page.run(f"axe.run({{ runOnly: ['color-contrast'] }}).then(r => {found})")
    page.colours("light")
    return [*light, *(f"dark {each}" for each in dark)]


class Browser:
    """A browser with a profile of its own."""

    def __init__(self, program: str) -> None:
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._process = subprocess.Popen(
            [program, *FLAGS, f"--user-data-dir={self._profile.name}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._sockets = ExitStack()
        port_file = Path(self._profile.name) / "DevToolsActivePort"
        wait(lambda: port_file.exists() and port_file.read_text().count("\n") > 0)
        self._port = int(port_file.read_text().split()[0])

    def page(self, width: int = 1280, height: int = 900) -> Page:
        request = urllib.request.Request(f"http://127.0.0.1:{self._port}/json/new?about:blank", method="PUT")
        with urllib.request.urlopen(request) as answer:
            made = json.load(answer)
        socket = self._sockets.enter_context(connect(made["webSocketDebuggerUrl"], max_size=None, proxy=None))
        page = Page(socket, made["id"])
        page.size(width, height)
        page.colours("light")
        return page

    def adopt(self, url: str) -> Page:
        """Return the tab that a page has opened at a URL, as soon as it is there."""
        found: list[dict[str, str]] = []

        def opened() -> bool:
            with urllib.request.urlopen(f"http://127.0.0.1:{self._port}/json/list") as answer:
                found[:] = [each for each in json.load(answer) if each["url"] == url]
            return bool(found)

        wait(opened)
        address = found[0]["webSocketDebuggerUrl"]
        return Page(self._sockets.enter_context(connect(address, max_size=None, proxy=None)), found[0]["id"])

    def close(self) -> None:
        self._sockets.close()
        self._process.terminate()
        self._process.wait(60)
        self._profile.cleanup()


class Page:
    """One tab. `problems` are the errors of its console, `requests` the addresses that it asked for."""

    def __init__(self, socket: ClientConnection, target: str) -> None:
        self._socket = socket
        self._number = 0
        self.target = target
        self.problems: list[str] = []
        self.requests: list[str] = []
        self.frames: list[str] = []
        """What its sockets received."""
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=WAIT_S))
            if message.get("id") == self._number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return dict(message["result"])
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        about = message.get("params", {})
        match message.get("method"):
            case "Runtime.exceptionThrown":
                self.problems.append(json.dumps(about["exceptionDetails"])[:600])
            case "Runtime.consoleAPICalled" if about["type"] in ("error", "warning"):
                self.problems.append(json.dumps(about["args"])[:600])
            case "Log.entryAdded" if about["entry"]["level"] in ("error", "warning"):
                self.problems.append(f"{about['entry']['text']} {about['entry'].get('url', '')}")
            case "Network.requestWillBeSent":
                self.requests.append(about["request"]["url"])
            case "Network.webSocketFrameReceived":
                self.frames.append(about["response"]["payloadData"])
            case "Network.webSocketCreated":
                self.requests.append(about["url"])

    def open(self, url: str) -> None:
        self.call("Page.navigate", url=url)
        self.arrives(url)

    def arrives(self, url: str, ready: str = "true") -> None:
        """Wait until the tab shows the page at a URL and a script finds it ready."""
        there = f"document.readyState === 'complete' && location.href === {json.dumps(url)}"
        wait(lambda: bool(self.looked(f"{there} && !!({ready})")))

    def reload(self, ready: str) -> None:
        """Load the page again and wait until a script finds the new one ready."""
        self.run("window.before = true")  # the page that goes, which may still answer
        self.call("Page.reload")
        self.until(f"!window.before && {ready}")

    def run(self, script: str) -> Any:
        """Return what a script evaluates to."""
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise RuntimeError(f"{script}: {found['exceptionDetails']['exception'].get('description')}")
        return found["result"].get("value")

    def looked(self, script: str) -> Any:
        """Return what a script evaluates to, None where the page goes meanwhile."""
        try:
            return self.run(script)
        except RuntimeError as error:
            if not str(error).startswith("Runtime.evaluate: "):
                raise  # the script's own
            return None

    def until(self, script: str) -> Any:
        """Wait until a script evaluates to something true, and return it."""
        found: list[Any] = []

        def true() -> bool:
            found[:] = [self.looked(f"typeof watched === 'undefined' ? false : ({script})")]
            return bool(found[0])

        try:
            wait(true)
        except TimeoutError as error:
            said = self.run("['status', 'said'].map(id => document.getElementById(id)?.textContent)")
            raise TimeoutError(f"{script}; {self.problems}; {said}") from error
        return found[0]

    def click(self, selector: str) -> None:
        """Click the middle of an element, as a mouse does."""
        found = (
            f"const e = document.querySelector({json.dumps(selector)}); e.scrollIntoView({{block: 'center'}})"
        )
        place = "; const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2];"
        box = self.run(f"(() => {{ {found} {place} }})()")
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=box[0], y=box[1], button="left", clickCount=1)

    def press(self, key: str, shift: bool = False) -> None:
        """Press and release a key: a letter, "Tab", "Enter", "ArrowRight", or a space."""
        codes = {
            "Tab": 9,
            "Enter": 13,
            " ": 32,
            "ArrowLeft": 37,
            "ArrowUp": 38,
            "ArrowRight": 39,
            "ArrowDown": 40,
            "Escape": 27,
            "Delete": 46,
        }
        code = codes.get(key, ord(key.upper()) if len(key) == 1 else 0)
        text = {"Enter": "\r"}.get(key, key if len(key) == 1 else "")
        common = {"key": key, "windowsVirtualKeyCode": code, "modifiers": 8 if shift else 0}
        self.call("Input.dispatchKeyEvent", type="keyDown", **common, **({"text": text} if text else {}))
        self.call("Input.dispatchKeyEvent", type="keyUp", **common)

    def plays(self, to_us: float) -> None:
        """Let the film play to a moment and stop at the next picture, however slow this machine is."""
        play = "document.getElementById('play').click()"
        look = f"film.time > {to_us} ? done({play}) : requestAnimationFrame(look)"
        self.run(f"new Promise(done => {{ {play}; const look = () => {{ {look}; }}; look(); }})")

    def size(self, width: int, height: int) -> None:
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 500,
        )

    def colours(self, scheme: str) -> None:
        """Show the page as somebody sees it who prefers the "light" or the "dark"."""
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.call("Emulation.setEmulatedMedia", features=features)

    def picture(self, path: Path, whole: bool = False) -> None:
        """Write a screenshot as PNG."""
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(shot["data"]))

    def close(self) -> None:
        self.call("Page.close")
        self._socket.close()


def wait(until: Callable[[], bool], seconds: float = WAIT_S) -> None:
    """Wait until something holds. Raises TimeoutError."""
    end = time.monotonic() + seconds
    while not until():
        if time.monotonic() > end:
            raise TimeoutError(f"it did not come within {seconds:g} s")
        time.sleep(0.02)
