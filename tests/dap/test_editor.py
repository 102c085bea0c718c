"""The debug adapter driven by a client that nobody here wrote: a C program forwards and backwards."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from typing import Any

import pytest

from servogen.dap import DebugSession
from servogen.dap.protocol import ProtocolError, read_message, written

pytest.importorskip("dap", reason="the client is of the extra dev")

from tests.dap.client import Editor, in_thread
from tests.dap.exchange import FOLDER, SESSION, exchanged

SOURCE = (FOLDER / "main.c").read_text()


def line_of(text: str) -> int:
    """The number of the line that holds a text."""
    return next(number for number, line in enumerate(SOURCE.splitlines(), 1) if text in line)


@pytest.fixture
def editor() -> Iterator[Editor]:
    editor = in_thread()
    editor.until("initialize")
    editor.ask("launch", {"program": str(FOLDER / "main.c"), "presentation": {"order": 1}})
    editor.until("InitializedEvent")
    yield editor
    editor.close()


def frames(editor: Editor) -> list[Any]:
    return list(editor.ask("stackTrace", {"threadId": 1})["stackFrames"])


def cycle(editor: Editor) -> int:
    return int(frames(editor)[0]["name"].split("cycle ")[1].split(",")[0])


def value(editor: Editor, name: str) -> str:
    return str(editor.ask("evaluate", {"expression": name})["result"])


def armed(editor: Editor, *breakpoints: dict[str, object]) -> list[bool]:
    given = {"source": {"path": "main.c"}, "breakpoints": list(breakpoints)}
    answer = editor.ask("setBreakpoints", given)
    return [each["verified"] for each in answer["breakpoints"]]


def test_the_session_in_the_documentation_is_what_a_client_and_the_adapter_say() -> None:
    assert exchanged() == SESSION.read_text()


def test_forwards_and_back_to_the_same_cycle(editor: Editor) -> None:
    line = line_of("sum = twice")
    assert armed(editor, {"line": line}, {"line": 900}) == [True, False]
    editor.client.configuration_done()
    assert editor.until("StoppedEvent").reason == "entry"
    stops = []
    for turn in range(1, 4):
        assert editor.go("continue").reason == "breakpoint"
        assert frames(editor)[0]["line"] == line and value(editor, "turns") == str(turn)
        stops.append(cycle(editor))
    for turn in (2, 1):
        assert editor.go("reverseContinue").reason == "breakpoint"
        assert value(editor, "turns") == str(turn) and cycle(editor) == stops[turn - 1]
    assert editor.go("reverseContinue").reason == "entry"
    assert cycle(editor) == 0


def test_steps_in_over_out_and_back(editor: Editor) -> None:
    call = line_of("sum = twice")
    armed(editor, {"line": call})
    editor.client.configuration_done()
    editor.until("StoppedEvent")
    editor.go("continue")
    before = cycle(editor)
    editor.go("stepIn")
    inside = frames(editor)
    assert inside[0]["name"].startswith("twice") and inside[1]["name"] == "main"
    assert value(editor, "RB1") == "0"
    lines = [frames(editor)[0]["line"]]
    while value(editor, "RB1") == "0" and len(lines) < 4:
        editor.go("next")
        lines.append(frames(editor)[0]["line"])
    assert line_of("PORTBbits.RB1") in lines and value(editor, "RB1") == "1"
    editor.go("stepOut")
    assert frames(editor)[0]["name"].startswith("main")
    editor.go("stepBack", granularity="instruction")
    while frames(editor)[0]["line"] != call or cycle(editor) > before:
        editor.go("stepBack")
    assert cycle(editor) == before
    editor.go("next")
    assert frames(editor)[0]["line"] == line_of("PORTB = sum") and len(frames(editor)) == 1


def test_conditions_hits_pins_and_messages(editor: Editor) -> None:
    line = line_of("sum = twice")
    armed(editor, {"line": line, "condition": "turns == 5"})
    editor.client.configuration_done()
    editor.until("StoppedEvent")
    editor.go("continue")
    assert value(editor, "turns") == "5"
    armed(editor, *({"line": line, "condition": f"turns == {turn}"} for turn in (7, 6)))
    for turn in ("6", "7"):
        editor.go("continue")
        assert value(editor, "turns") == turn, "each of two at one place stops"
    assert (
        armed(editor, *({"line": line, "hitCondition": hits} for hits in ("²", "0", "9" * 5000)))
        == [False] * 3
    )
    armed(editor, {"line": line, "hitCondition": "3"})
    editor.go("continue")
    assert value(editor, "turns") == "10"
    armed(editor, {"line": line, "logMessage": "turn {turns}"})
    given = {"breakpoints": [{"name": "RB5 rise"}, {"name": "twice", "condition": "turns > 200"}]}
    answer = editor.ask("setFunctionBreakpoints", given)
    assert all(each["verified"] for each in answer["breakpoints"])
    editor.client.send_request("continue", {"threadId": 1})
    editor.until("continue")
    assert editor.until("OutputEvent").output == "turn 11\n"
    assert editor.until("StoppedEvent").reason == "breakpoint"
    assert value(editor, "RB5") == "1"
    assert "is an output" in value(editor, "why RB5")


def test_a_data_breakpoint_stops_at_each_change_and_no_other(editor: Editor) -> None:
    editor.ask("configurationDone", {})
    ids = [
        editor.ask("dataBreakpointInfo", {"variablesReference": scope, "name": name})["dataId"]
        for scope, name in ((3, "turns"), (1, "RB1"), (2, "TMR0"))
    ]
    assert ids == ["turns changes", "RB1 changes", None]
    editor.ask("setDataBreakpoints", {"breakpoints": [{"dataId": ids[0]}]})
    for turn in "123":
        editor.go("continue")
        assert value(editor, "turns") == turn
    editor.go("reverseContinue")
    assert value(editor, "turns") == "2"


def test_memory_registers_and_machine_code(editor: Editor) -> None:
    editor.client.configuration_done()
    editor.until("StoppedEvent")
    scopes = editor.ask("scopes", {"frameId": 0})["scopes"]
    assert [each["name"] for each in scopes] == ["Pins", "Registers", "Variables", "EEPROM"]
    pins = editor.ask("variables", {"variablesReference": 1})["variables"]
    assert (pins[0]["name"], pins[0]["value"]) == ("RA0", "0 (input)")
    asked = {"memoryReference": "0x000", "instructionCount": 3}
    rows = editor.ask("disassemble", asked)["instructions"]
    assert [row["address"] for row in rows] == ["0x000", "0x001", "0x002"]
    memory = editor.ask("readMemory", {"memoryReference": "0x4E", "offset": 1, "count": 4})
    assert (memory["address"], memory["data"], memory["unreadableBytes"]) == ("0x4F", "AA==", 3)
    (turns,) = (
        each
        for each in editor.ask("variables", {"variablesReference": 3})["variables"]
        if each["name"] == "turns"
    )
    editor.ask("writeMemory", {"memoryReference": turns["memoryReference"], "data": "Kg=="})
    assert value(editor, turns["evaluateName"]) == "42"
    above = editor.ask("disassemble", {**asked, "instructionOffset": -2})["instructions"]
    assert [row.get("presentationHint") for row in above] == ["invalid", "invalid", None]


def test_a_pause_stops_an_endless_run(editor: Editor) -> None:
    editor.client.configuration_done()
    editor.until("StoppedEvent")
    for _ in range(100):  # a pause that comes at once finds the chip where it was
        editor.client.send_request("continue", {"threadId": 1})
        editor.until("continue")
        editor.client.pause(1)
        assert editor.until("StoppedEvent").reason == "pause"
        if cycle(editor) > 0:
            return
    raise AssertionError("the chip never ran")


def answers(*requests: dict[str, object]) -> list[dict[str, Any]]:
    sent: list[dict[str, Any]] = []
    session = DebugSession(sent.append)
    for number, request in enumerate(requests, 1):
        session.handle({"type": "request", "seq": number, **request})
    return [message for message in sent if message["type"] == "response"]


@pytest.mark.parametrize(
    ("request_of", "message"),
    [
        ({"command": "fly"}, "'fly' is not a request"),
        ({"command": "next", "arguments": {"threadId": 1}}, "the first request is 'launch'"),
        ({"command": "configurationDone"}, "the first request is 'launch'"),
        ({"command": "launch", "arguments": {}}, "'program' is not the path"),
        ({"command": "launch", "arguments": {"program": "none.c"}}, "none.c"),
        ({"command": "launch", "arguments": {"program": "x.c", "stimuls": "y"}}, "unknown key 'stimuls'"),
        ({"command": "launch", "arguments": []}, "'program' is not the path"),
        ({"command": "disassemble", "arguments": {"memoryReference": "0x0"}}, "the first request is"),
        ({"command": "setBreakpoints", "arguments": {"source": "main.c"}}, "a wrong argument"),
        ({"command": "variables", "arguments": {"variablesReference": math.inf}}, "a wrong argument"),
    ],
)
def test_what_is_wrong_is_an_answer(request_of: dict[str, object], message: str) -> None:
    (answer,) = answers(request_of)
    assert not answer["success"] and message in answer["message"]


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (b"Content-Length: many\r\n\r\n{}", "is not a length"),
        (b"Content-Length: 99999999999\r\n\r\n{}", "is not a length"),
        (b"Host: x\r\n\r\n{}", "no Content-Length"),
        (b"Content-Length: 2\r\n\r\n{x", "not JSON"),
        (b"Content-Length: 2\r\n\r\n[]", "not an object"),
        (b"Content-Length: 200000\r\n\r\n" + b"[" * 200_000, "not JSON"),
    ],
)
def test_what_is_not_a_message_is_named(raw: bytes, message: str) -> None:
    with pytest.raises(ProtocolError, match=message):
        read_message(io.BytesIO(raw))


def test_messages_survive_the_wire() -> None:
    wire = io.BytesIO(written({"seq": 1, "text": "µs"}) + written({"seq": 2}))
    assert [read_message(wire), read_message(wire), read_message(wire)] == [
        {"seq": 1, "text": "µs"},
        {"seq": 2},
        None,
    ]


def test_what_is_set_holds_forwards_and_backwards_and_not_before(editor: Editor) -> None:
    assert armed(editor, {"line": line_of("sum = twice")}) == [True]
    editor.ask("configurationDone", {})
    editor.go("continue")
    editor.go("continue")
    assert value(editor, "turns") == "2"
    before = cycle(editor)
    answer = editor.ask("setVariable", {"variablesReference": 3, "name": "turns", "value": "0x28"})
    assert answer["value"] == "40" and value(editor, "turns") == "40"
    editor.go("continue")
    assert value(editor, "turns") == "41" and value(editor, "PORTB") == f"{2 * 40} (0x50)"
    editor.go("reverseContinue")
    assert (cycle(editor), value(editor, "turns")) == (before, "40")
    editor.go("reverseContinue")
    assert value(editor, "turns") == "1"
    editor.go("continue")
    editor.go("continue")
    assert value(editor, "turns") == "41", "the change is part of the past"


def test_a_pin_and_w_are_set_and_what_cannot_be_is_told(editor: Editor) -> None:
    editor.ask("configurationDone", {})
    assert editor.ask("setExpression", {"expression": "W", "value": "0b101"})["value"] == "5 (0x05)"
    editor.ask("setExpression", {"expression": "RA0", "value": "1"})
    editor.go("next")
    assert value(editor, "RA0") == "1"
    for name, wrong, why in (
        ("turns", "256", "up to 255"),
        ("turns", "many", "not a number"),
        ("RA0", "2", "a level is 0 or 1"),
        ("TMR0", "1", "is not set"),
        ("nobody", "1", "no variable"),
    ):
        editor.client.send_request("setExpression", {"expression": name, "value": wrong})
        with pytest.raises(AssertionError, match=why):
            editor.until("setExpression")
