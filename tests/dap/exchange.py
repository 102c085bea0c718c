"""A whole debugging session, as an editor and `servogen dap` exchange it, forwards and backwards.

    python -m tests.dap.exchange

writes docs/examples/debugging/session.txt: what a client of a package (dap-python) and the adapter, each in
its own process, say to each other about main.c beside it.
"""

from __future__ import annotations

import json
import textwrap
from pathlib import Path
from typing import Any

from tests.dap.client import in_process

FOLDER = Path(__file__).parent.parent.parent / "docs" / "examples" / "debugging"
SESSION = FOLDER / "session.txt"
COLUMNS = 120


def exchanged() -> str:
    """Return the session as text: `>` is the editor, `<` the adapter, `*` an event."""
    editor, process = in_process(FOLDER)
    parts = ["The editor starts: what can the adapter do?"]
    told = 0

    def section(title: str) -> None:
        nonlocal told
        parts.extend(shown(message) for message in editor.exchanged[told:])
        told = len(editor.exchanged)
        parts.append(f"\n{title}")

    def look(*names: str) -> None:
        editor.ask("stackTrace", {"threadId": 1})
        for name in names:
            editor.ask("evaluate", {"expression": name})

    editor.until("initialize")
    section("A program, and a line at which it is to stop")
    editor.ask("launch", {"program": "main.c"})
    editor.until("InitializedEvent")
    line = 1 + (FOLDER / "main.c").read_text().splitlines().index("        sum = twice(turns);")
    editor.ask("setBreakpoints", {"source": {"path": "main.c"}, "breakpoints": [{"line": line}]})
    editor.ask("configurationDone", {})
    editor.until("StoppedEvent")
    section("Forwards to the line, three times")
    for _ in range(3):
        editor.go("continue")
        look("turns")
    section("Backwards to the same line: the same cycles, the same values")
    for _ in range(2):
        editor.go("reverseContinue")
        look("turns")
    section("Into the function, over its first line, out of it")
    for step in ("stepIn", "next", "stepOut"):
        editor.go(step)
        look("RB1")
    section("One instruction back: into the function's return")
    editor.go("stepBack", granularity="instruction")
    look()
    section("Variables, pins, machine code, and why a pin is as it is")
    editor.ask("scopes", {"frameId": 0})
    for scope in (3, 1):
        editor.ask("variables", {"variablesReference": scope})
    asked = {"memoryReference": "0x006", "instructionCount": 3}
    editor.ask("disassemble", asked)
    editor.ask("evaluate", {"expression": "why RB1"})
    section("A variable is changed: the way forwards is another one, what was before stays")
    editor.ask("setVariable", {"variablesReference": 3, "name": "turns", "value": "40"})
    for way in ("continue", "reverseContinue"):
        editor.go(way)
        look("turns")
    section("The end")
    editor.close()
    assert process.wait(300) == 0
    section("")
    return "\n".join(parts).rstrip() + "\n"


def shown(message: dict[str, Any]) -> str:
    """Return a message in lines: who, what, and its arguments or its body."""
    kind = {"request": ">", "response": "<", "event": "*"}[message["type"]]
    body = message.get("arguments") or message.get("body") or {}
    text = json.dumps(body, ensure_ascii=False).replace(f"{FOLDER.resolve()}/", "") if body else ""
    what = message.get("command") or message.get("event")
    assert message.get("success", True), message
    return textwrap.fill(
        f"{kind} {what} {text}".rstrip(),
        COLUMNS,
        subsequent_indent="      ",
        break_long_words=False,
        break_on_hyphens=False,
    )


if __name__ == "__main__":
    SESSION.write_text(exchanged())
