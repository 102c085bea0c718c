"""Runs the server of the pages, or of `rig --debug`, and connects to one."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from servogen.errors import ToolError

if TYPE_CHECKING:
    from servogen.dap.protocol import Message
    from servogen.dap.running_page import RunningPage
    from servogen.watch.server import Attach, WatchServer


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


@contextmanager
def serving(attach: Attach) -> Iterator[str]:
    """Serve editors in a thread until the block ends; yield the address. Raises ToolError without the
    server's package, and what has ended the server before the block.
    """
    require_server()
    import asyncio

    from servogen.watch.server import DebuggerRoom, WatchServer

    begun: queue.Queue[tuple[str, Callable[[], object]] | Exception] = queue.Queue()

    async def serve() -> None:
        loop, task = asyncio.get_running_loop(), asyncio.current_task()
        assert task is not None
        server = WatchServer({"": DebuggerRoom(attach)})
        await server.run(0, lambda url: begun.put((url, lambda: loop.call_soon_threadsafe(task.cancel))))

    def run() -> None:
        try:
            with suppress(asyncio.CancelledError):
                asyncio.run(serve())
        except Exception as error:
            begun.put(error)  # for whoever waits for the address, or for the end

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    answer = begun.get()
    if isinstance(answer, OSError):
        raise ToolError("port-in-use", f"no port can be opened: {answer}") from answer
    if isinstance(answer, Exception):
        raise answer
    url, end = answer
    try:
        yield url
    finally:
        with suppress(RuntimeError):  # the server has ended by itself
            end()
        thread.join()
    error = None if begun.empty() else begun.get()
    if isinstance(error, Exception):
        raise error
