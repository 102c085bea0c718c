"""`servogen dap` with a HEX file: what the files beside it give the editor, and a step without any lines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from servogen.dap import DebugSession
from servogen.pic.assembler import assemble
from servogen.pic.image import to_hex
from servogen.programs import Program

SOURCE = """ list p=16f84a
 cblock 0x0C
duty
 endc
main movlw 7
 movwf duty
 incf duty, f
 goto main
 end
"""
SYMBOLS = """_main 0 0 CODE 0
__end_of_main 4 0 CODE 0
_duty C 0 BANK0 1
%segments
maintext 0 7 CODE 0 0
bssBANK0 C C BANK0 C 1
%locals
main.c
3 0 0 CODE 0
4 2 0 CODE 0
"""


def session_of(folder: Path, symbols: str) -> tuple[DebugSession, list[dict[str, Any]]]:
    (folder / "main.hex").write_text(to_hex(assemble(SOURCE).image))
    (folder / "main.sym").write_text(symbols)
    sent: list[dict[str, Any]] = []
    session = DebugSession(sent.append)
    ask(session, "launch", program=str(folder / "main.hex"))
    return session, sent


def ask(session: DebugSession, command: str, **arguments: object) -> None:
    session.handle({"type": "request", "seq": 1, "command": command, "arguments": arguments})


def top(session: DebugSession, sent: list[dict[str, Any]]) -> dict[str, Any]:
    ask(session, "stackTrace", threadId=1)
    frame: dict[str, Any] = sent[-1]["body"]["stackFrames"][0]
    return frame


def test_a_step_goes_to_the_next_line_of_the_c_and_a_variable_has_its_name(tmp_path: Path) -> None:
    session, sent = session_of(tmp_path, SYMBOLS)
    assert top(session, sent)["line"] == 3
    ask(session, "next", threadId=1)
    frame = top(session, sent)
    assert (frame["line"], frame["name"].split()[0]) == (4, "main")
    ask(session, "evaluate", expression="duty")
    assert sent[-1]["body"]["result"] == "7"


def test_without_lines_a_step_is_one_instruction(tmp_path: Path) -> None:
    session, sent = session_of(tmp_path, SYMBOLS[: SYMBOLS.index("3 0 0")])
    ask(session, "next", threadId=1)
    assert "cycle 1," in top(session, sent)["name"]
    ask(session, "stepIn", threadId=1)
    assert "cycle 2," in top(session, sent)["name"]
    ask(session, "stepBack", threadId=1)
    assert "cycle 1," in top(session, sent)["name"]


def test_the_instructions_of_one_answer_are_bounded(tmp_path: Path) -> None:
    session, sent = session_of(tmp_path, SYMBOLS)
    ask(session, "disassemble", memoryReference="0x000", instructionCount=10**12)
    assert not sent[-1]["success"] and "up to 4096" in sent[-1]["message"]


def test_names_of_another_program_are_reported_to_the_editor(tmp_path: Path) -> None:
    _, sent = session_of(tmp_path, SYMBOLS.replace("maintext 0 7", "maintext 0 9"))
    (output,) = (message["body"]["output"] for message in sent if message.get("event") == "output")
    assert "main.sym: warning: is of another program than main.hex" in output


def test_a_source_that_is_not_on_the_disk_is_asked_of_the_adapter(tmp_path: Path) -> None:
    made, sent = assemble(SOURCE, "made.asm"), list[dict[str, Any]]()
    session = DebugSession(sent.append, lambda path, device: Program(made.image, made.listing))
    ask(session, "launch", program="job.toml")
    source = top(session, sent)["source"]
    assert source["name"] == "made.asm" and "path" not in source
    ask(session, "source", sourceReference=source["sourceReference"])
    assert sent[-1]["body"]["content"] == SOURCE
    ask(session, "source", sourceReference=9)
    assert not sent[-1]["success"]


def test_a_way_back_is_left_where_it_began(tmp_path: Path) -> None:
    """A byte that is never 9 is looked for up to power-up; what is asked for meanwhile begins there."""
    session, sent = session_of(tmp_path, SYMBOLS)
    ask(session, "continue", threadId=1)
    session.run_on()
    ask(session, "pause", threadId=1)
    before = top(session, sent)["name"]
    ask(session, "setFunctionBreakpoints", breakpoints=[{"name": "0x30 == 9"}])
    for command, reasons in (("pause", ["pause"]), ("stepIn", ["pause", "step"])):
        ask(session, "reverseContinue", threadId=1)
        session.run_on()
        assert session.running and top(session, sent)["name"] != before
        sent.clear()
        ask(session, command, threadId=1, granularity="instruction")
        assert [each["body"]["reason"] for each in sent if each.get("event") == "stopped"] == reasons
        assert not session.running
    ask(session, "stepBack", threadId=1, granularity="instruction")
    assert top(session, sent)["name"] == before
    ask(session, "setFunctionBreakpoints", breakpoints=[{"name": "RA0 rise"}])
    ask(session, "reverseContinue", threadId=1)
    while session.running:
        session.run_on()
    assert sent[-1]["body"]["text"] == "power-up"


def test_a_breakpoint_that_does_not_stop_hides_none_that_does(tmp_path: Path) -> None:
    """Both are after `incf duty`: a message at the change, and the address that is next."""
    session, sent = session_of(tmp_path, SYMBOLS)
    given = [{"name": "duty changes", "logMessage": "{duty}"}, {"name": "duty > 7"}]
    ask(session, "setFunctionBreakpoints", breakpoints=given)
    ask(session, "continue", threadId=1)
    session.run_on()
    assert [each["body"].get("output") for each in sent if each.get("event") == "output"] == ["7\n", "8\n"]
    assert sent[-1]["body"]["text"] == "duty > 7"
    ask(session, "restart")
    ask(session, "setFunctionBreakpoints", breakpoints=[{**given[0], "logMessage": "x"}, {"name": "0x003"}])
    ask(session, "continue", threadId=1)
    session.run_on()
    assert sent[-1]["body"]["text"] == "0x003"
