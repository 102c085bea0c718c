"""Runs the server of `servogen watch` and of `servogen grade --watch` until Ctrl-C, and connects to one."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from servogen.errors import ToolError

if TYPE_CHECKING:
    from servogen.dap.protocol import Message
    from servogen.dap.running_page import RunningPage
    from servogen.watch.server import WatchServer


def require_server() -> None:
    """Raise ToolError where the server's package is not installed."""
    try:
        import servogen.watch.server  # noqa: F401
    except ModuleNotFoundError as error:
        raise ToolError(
            "tool-missing",
            f"watching needs the package {error.name}, which is not installed",
            hint="pip install 'servogen[watch]'",
        ) from error


def running_page(url: str, send: Callable[[Message], None]) -> RunningPage:
    """Return the debugger of a running page. Raises ToolError, InputError without a page."""
    require_server()
    from servogen.dap.running_page import RunningPage

    return RunningPage(url, send)


def serve_until_ctrl_c(server: WatchServer, name: str, port: int, browser: bool) -> None:
    """Print the server's address, open it in the browser if asked to, and serve until Ctrl-C.

    Raises ToolError if the port cannot be opened.
    """
    import asyncio
    import webbrowser

    def ready(url: str) -> None:
        print(f"{name}: {url}  (Ctrl-C ends)", flush=True)
        if browser:
            webbrowser.open(url)

    try:
        with suppress(KeyboardInterrupt):
            asyncio.run(server.run(port, ready))
    except OSError as error:
        raise ToolError("port-in-use", f"port {port} cannot be opened: {error.strerror}") from error
