"""One debugging session: what an editor asks of a chip that goes forwards and backwards.

In: requests. Out: answers and events. All addresses of the protocol are program addresses as hexadecimal
numbers; the chip has one thread. The frame's name states the cycle, because time is what is debugged here.
"""

from __future__ import annotations

import base64
import re
import time
from bisect import bisect_right
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from servogen.dap.breakpoints import Armed, armed, going_back, next_stop
from servogen.dap.protocol import Message
from servogen.debug.breakpoints import parse_breakpoint
from servogen.debug.pins import explain_pin
from servogen.debug.symbols import ListedLine, line_at, variable
from servogen.debug.time_machine import TimeMachine
from servogen.edges import PINS
from servogen.errors import InputError, ServogenError
from servogen.pic.device import EEPROM_BYTES, PROGRAM_WORDS, RAM_FIRST, RAM_LAST
from servogen.pic.listing import Listing
from servogen.pic.spelling import assembly_text
from servogen.programs import Program, clock_of, read_program
from servogen.simulator import LevelChange, Levels, SimulatorOptions, Stimuli, load_stimuli

THREAD = 1
SLICE_S = 0.2
"""Seconds of the chip between two looks for a request, while it runs."""
NOTHING_YET = "nothing is debugged yet: the first request is 'launch' or 'attach'"
MAX_STEPS = 2_000
"""The lines that "step over" and "step out" run through before they stop in the middle."""
MAX_LOGGED = 200
"""The lines that an editor is sent in a second."""
MAX_INSTRUCTIONS = 4 * PROGRAM_WORDS
"""The instructions of one answer, with those before and behind the program that an editor asks for, too."""
PINS_OF, REGISTERS, VARIABLES, EEPROM = 1, 2, 3, 4
"""References of the scopes."""
ACTIONS = (
    *("launch", "restart", "continue", "reverseContinue", "next", "stepIn", "stepOut", "stepBack"),
    *("setVariable", "setExpression", "writeMemory"),
)
"""Requests that begin where the chip stands: a way back is left for them."""
LAUNCH_KEYS = ("program", "stimulus", "inputs", "clock_hz", "device", "stopOnEntry", "floating")
ATTACH_KEYS = ("url",)
EDITOR_KEYS = (
    *("name", "type", "request", "noDebug", "preLaunchTask", "postDebugTask", "presentation"),
    *("internalConsoleOptions", "debugServer", "serverReadyAction", "suppressMultipleSessionWarning"),
)
"""What editors give a configuration for themselves."""

CAPABILITIES = {
    "supportsConfigurationDoneRequest": True,
    "supportsStepBack": True,
    "supportsConditionalBreakpoints": True,
    "supportsHitConditionalBreakpoints": True,
    "supportsLogPoints": True,
    "supportsFunctionBreakpoints": True,
    "supportsInstructionBreakpoints": True,
    "supportsDataBreakpoints": True,
    "supportsDisassembleRequest": True,
    "supportsReadMemoryRequest": True,
    "supportsWriteMemoryRequest": True,
    "supportsEvaluateForHovers": True,
    "supportsSteppingGranularity": True,
    "supportsSetVariable": True,
    "supportsSetExpression": True,
    "supportsTerminateRequest": True,
    "supportsRestartRequest": True,
}

Body = dict[str, Any]


class Elsewhere(Protocol):
    """A debugger in another process, whose messages go to the editor."""

    def send(self, request: Message) -> bool:
        """Pass a request on; return False where nobody answers any more."""

    def close(self) -> None:
        """Let the program go on without the editor."""


Connect = Callable[[str, Callable[[Message], None]], Elsewhere]
"""Return the debugger of a running program, from its address and what takes its messages. Raises
InputError.
"""


@dataclass(frozen=True, slots=True)
class Loaded:
    """What is debugged."""

    path: Path
    program: Program
    options: SimulatorOptions
    stimulus: Stimuli | None

    @property
    def listing(self) -> Listing | None:
        return self.program.listing


class DebugSession:
    """Answers the requests of one editor."""

    def __init__(
        self,
        send: Callable[[Message], None],
        read: Callable[[Path, str | None], Program] = read_program,
        connect: Connect | None = None,
    ):
        """Begin with nothing to debug: `read` is what `launch` reads with, `connect` what `attach` needs."""
        self._send = send
        self._read = read
        self._connect = connect
        self._elsewhere: Elsewhere | None = None
        """Who answers instead, from `attach` on."""
        self.running = False
        self.stands_at = 0
        """The cycle at which the editor was told last that the chip stands."""
        self.ended = False
        self._back: Generator[None, None, Armed | None] | None = None
        """The way back to a breakpoint, while it is being gone from cycle `stands_at`."""
        self._loaded: Loaded | None = None
        self._chip: TimeMachine | None = None
        self._runs_at_first: bool | None = None
        """None: as it does already."""
        self._second, self._logged = time.monotonic(), 0
        """When a second of printed lines began, and how many lines it has."""
        self._later: list[Message] | None = None
        """While a request is answered: the events that follow the answer."""
        self._armed: dict[str, list[Armed]] = {}
        """By source file, or kind: what stops the chip."""
        self._requests: dict[str, Callable[[Body], Body | None]] = {
            "initialize": self._initialize,
            "launch": self._launch,
            "attach": self._attach,
            "restart": self._restart,
            "setBreakpoints": self._set_breakpoints,
            "setFunctionBreakpoints": self._set_function_breakpoints,
            "setInstructionBreakpoints": self._set_instruction_breakpoints,
            "dataBreakpointInfo": self._data_breakpoint_info,
            "setDataBreakpoints": self._set_data_breakpoints,
            "setExceptionBreakpoints": lambda _: {},
            "configurationDone": self._configuration_done,
            "threads": lambda _: {"threads": [{"id": THREAD, "name": "PIC16F84"}]},
            "stackTrace": self._stack_trace,
            "scopes": self._scopes,
            "variables": self._variables,
            "evaluate": self._evaluate,
            "setVariable": lambda given: self._set(str(given["name"]), str(given["value"])),
            "setExpression": lambda given: self._set(str(given["expression"]), str(given["value"])),
            "disassemble": self._disassemble,
            "readMemory": self._read_memory,
            "writeMemory": self._write_memory,
            "source": self._source_text,
            "continue": self._continue,
            "reverseContinue": self._reverse_continue,
            "next": self._next,
            "stepIn": self._step_in,
            "stepOut": self._step_out,
            "stepBack": self._step_back,
            "pause": self._pause,
            "disconnect": self._end,
            "terminate": self._end,
        }

    @property
    def armed(self) -> list[Armed]:
        """Return what stops the chip."""
        return [each for group in self._armed.values() for each in group]

    def debug(self, loaded: Loaded, chip: TimeMachine) -> None:
        """Debug a chip that another one runs, too: `running` is what both know of it."""
        self._loaded, self._chip = loaded, chip

    # Requests

    def handle(self, request: Message) -> None:
        """Answer a request, or have it answered by who debugs the program that is attached to."""
        if self._elsewhere is None:
            self._answer(request)
        elif request.get("command") in ("disconnect", "terminate"):
            self._elsewhere.close()
            self._elsewhere = None
            self._answer(request)
        if self._elsewhere is not None and not self._elsewhere.send(request):
            self._elsewhere = None

    def _answer(self, request: Message) -> None:
        """Answer a request; what is wrong is an answer, too. One to attach is answered elsewhere."""
        command = str(request.get("command"))
        answer: Message = {"type": "response", "request_seq": request.get("seq"), "command": command}
        given = request.get("arguments")
        later: list[Message] = []
        self._later = later
        try:
            if command not in self._requests:
                raise InputError("unknown-command", f"'{command}' is not a request of this debugger")
            if command in ACTIONS:
                self.stay()
            body = self._requests[command](given if isinstance(given, dict) else {})
        except (ServogenError, ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            text = _error_text(error) if isinstance(error, ServogenError) else f"a wrong argument: {error!r}"
            answer |= {"success": False, "message": text, "body": _error(text)}
        else:
            if self._elsewhere is not None:
                return
            answer |= {"success": True, "body": body or {}}
            self._after(command)
        self._later = None
        for message in (answer, *later):
            self._send(message)

    def _after(self, command: str) -> None:
        """Add the events that follow an answer."""
        if command in ("launch", "attach"):  # from now on there is a program to have breakpoints in
            self.event("initialized")
        if command in ("configurationDone", "restart") and not self.running:
            self.stopped("entry")
        if command in ("next", "stepIn", "stepOut", "stepBack") and self._chip is not None:
            self.stopped("step")
        if command == "terminate":  # the editor disconnects then
            self.event("terminated")
        self.ended = command == "disconnect"

    @property
    def goes_back(self) -> bool:
        """Return whether a breakpoint in the past is being looked for: the chip is anywhere then."""
        return self._back is not None

    def stay(self) -> None:
        """Leave the way back, if there is one, and stand where it began."""
        if self._back is not None:
            self._back = None
            self._need_chip().seek(self.stands_at)
            self.stopped("pause")

    def run_on(self) -> None:
        """Run a slice of time, or go a step back; stop at a breakpoint."""
        if self._back is not None:
            try:
                next(self._back)
            except StopIteration as arrived:
                self._back, hit = None, arrived.value
                self.stopped("breakpoint" if hit else "entry", hit.text if hit else "power-up")
            return
        chip = self._need_chip()
        end = chip.now + chip.clock.round_seconds(SLICE_S)
        hit = next_stop(chip, end, self.armed, self.log)
        if hit is not None:
            self.stopped("breakpoint", hit.text)

    def _initialize(self, given: Body) -> Body:
        return dict(CAPABILITIES)

    def _launch(self, given: Body) -> None:
        _check_keys("launch", given, LAUNCH_KEYS)
        if not isinstance(given.get("program"), str):
            raise InputError("missing-key", "launch: 'program' is not the path of a HEX, C or assembly file")
        path = Path(given["program"])
        program = self._read(path, given.get("device"))
        clock = clock_of(program, given.get("clock_hz"))
        options = SimulatorOptions(device=given.get("device") or program.device or SimulatorOptions().device)
        options = replace(options, floating=int(given.get("floating", 0)))
        stimulus = load_stimuli(given["stimulus"], clock) if given.get("stimulus") else None
        held = [Levels(_pin(name), ((0, int(level)),)) for name, level in (given.get("inputs") or {}).items()]
        if held:
            stimulus = Stimuli((*held, *(stimulus.sources if stimulus else ())))
        self._loaded = Loaded(path, replace(program, clock=clock), options, stimulus)
        self._runs_at_first = bool(given.get("noDebug")) or not given.get("stopOnEntry", True)
        for remark in program.remarks:
            self.log(str(remark))
        self._power_up()

    def _attach(self, given: Body) -> None:
        """Debug the chip of a running page, here if it is, or where it is."""
        _check_keys("attach", given, ATTACH_KEYS)
        if self._chip is not None:
            return
        if self._connect is None:
            raise InputError("not-allowed", "there is no running program to attach to")
        self._elsewhere = self._connect(str(given.get("url", "")), self._send)

    def _power_up(self) -> None:
        loaded = self._need_loaded()
        clock = clock_of(loaded.program, None)
        image, listing = loaded.program.image, loaded.listing
        self._chip = TimeMachine(image, clock, loaded.options, loaded.stimulus, listing)

    def _restart(self, given: Body) -> None:
        self.running = False
        if self._runs_at_first is None:  # whose the chip is has its past
            self._need_chip().seek(0)
        else:
            self._power_up()

    def _set_breakpoints(self, given: Body) -> Body:
        source = str(given.get("source", {}).get("path") or given.get("source", {}).get("name"))
        wanted = given.get("breakpoints") or ()
        texts = [(f"{Path(source).name}:{each['line']}", each) for each in wanted]
        return self._arm(source, texts)

    def _set_function_breakpoints(self, given: Body) -> Body:
        """Set breakpoints by name: a function, or an edge or a condition as `watch` has them."""
        texts = []
        for each in given.get("breakpoints") or ():
            name = str(each["name"]).strip()
            texts.append(
                (f"{name}()" if re.fullmatch(r"[A-Za-z_]\w*", name) and name not in PINS else name, each)
            )
        return self._arm("function", texts)

    def _set_instruction_breakpoints(self, given: Body) -> Body:
        wanted = given.get("breakpoints") or ()
        texts = [
            (f"0x{int(each['instructionReference'], 16) + int(each.get('offset', 0)):03X}", each)
            for each in wanted
        ]
        return self._arm("instruction", texts)

    def _data_breakpoint_info(self, given: Body) -> Body:
        """Return how to stop at each change of a variable, a byte of RAM or a pin, if it is one."""
        text, listing = f"{given['name']} changes", self._need_loaded().listing
        try:
            parse_breakpoint(text, listing)
        except InputError as error:
            return {"dataId": None, "description": error.message}
        return {"dataId": text, "description": text, "accessTypes": ["write"], "canPersist": True}

    def _set_data_breakpoints(self, given: Body) -> Body:
        return self._arm("data", [(str(each["dataId"]), each) for each in given.get("breakpoints") or ()])

    def _arm(self, group: str, texts: Sequence[tuple[str, Body]]) -> Body:
        listing = self._need_loaded().listing
        self._armed[group] = []
        answers: list[Body] = []
        for text, each in texts:
            try:
                found = armed(parse_breakpoint(text, listing), each, listing)
            except InputError as error:
                answers.append({"verified": False, "message": error.message, **_line(each)})
                continue
            self._armed[group].append(found)
            answers.append({"verified": True, **_line(each)})
        return {"breakpoints": answers}

    def _configuration_done(self, given: Body) -> None:
        self._need_chip()
        if self._runs_at_first is not None:
            self.running = self._runs_at_first

    def _stack_trace(self, given: Body) -> Body:
        chip = self._need_chip()
        state = chip.machine.state()
        returns = [(address - 1) % PROGRAM_WORDS for address in state.stack[: min(state.stack_depth, 8)]]
        frames = [self._frame(number, address) for number, address in enumerate((state.pc, *returns))]
        frames[0]["name"] += f" · cycle {chip.now}, {float(chip.clock.seconds(chip.now)) * 1000:.3f} ms"
        begin = int(given.get("startFrame") or 0)
        count = int(given.get("levels") or len(frames))
        return {"stackFrames": frames[begin : begin + count], "totalFrames": len(frames)}

    def _frame(self, number: int, address: int) -> Body:
        chip = self._need_chip()
        found = line_at(chip, address)
        frame: Body = {
            "id": number,
            "name": self._function(address),
            "line": found.line if found else 0,
            "column": 1 if found else 0,
            "instructionPointerReference": f"0x{address % PROGRAM_WORDS:03X}",
        }
        if found is not None:
            frame["source"] = self._source(found)
        return frame

    def _source(self, found: ListedLine) -> Body:
        """Return where a line's file is; one that is not on the disk (a job's C) is asked for by number."""
        beside = self._need_loaded().path.parent / found.file
        for path in (Path(found.file), beside):
            if path.is_file():
                return {"name": path.name, "path": str(path.resolve())}
        return {"name": Path(found.file).name, "sourceReference": 1 + self._texts().index(found.file)}

    def _texts(self) -> list[str]:
        """Return the files whose lines the listing knows."""
        return sorted({file for file, _ in self._need_chip().lines})

    def _source_text(self, given: Body) -> Body:
        listing = self._need_loaded().listing
        file = self._texts()[int(given["sourceReference"]) - 1]
        texts = dict(listing.sources) if listing else {}
        if file not in texts:
            raise InputError("unknown-name", f"{file}: its text is not known")
        return {"content": texts[file]}

    def _function(self, address: int) -> str:
        listing = self._need_loaded().listing
        functions = listing.functions if listing else ()
        inside = [each.name for each in functions if each.start <= address % PROGRAM_WORDS < each.end]
        if inside:
            return inside[0]
        labels = sorted((start, name) for name, start in (listing.labels if listing else ()))
        place = bisect_right(labels, (address % PROGRAM_WORDS, "\uffff")) - 1
        return labels[place][1] if place >= 0 else f"0x{address % PROGRAM_WORDS:03X}"

    def _scopes(self, given: Body) -> Body:
        names = (("Pins", PINS_OF), ("Registers", REGISTERS), ("Variables", VARIABLES), ("EEPROM", EEPROM))
        return {
            "scopes": [
                {"name": name, "variablesReference": number, "expensive": False} for name, number in names
            ]
        }

    def _variables(self, given: Body) -> Body:
        shown = {
            PINS_OF: self._pins_shown,
            REGISTERS: self._registers_shown,
            VARIABLES: self._variables_shown,
            EEPROM: self._eeprom_shown,
        }
        scope = int(given["variablesReference"])
        rows: list[Body] = [
            {"name": name, "value": value, "variablesReference": 0} for name, value in shown[scope]()
        ]
        for row in rows if scope != EEPROM else ():  # to be watched, and what is in RAM seen as bytes
            row["evaluateName"] = row["name"]
            if scope == VARIABLES:
                row["memoryReference"] = f"0x{variable(row['name'], self._need_loaded().listing).address:02X}"
        return {"variables": rows}

    def _pins_shown(self) -> list[tuple[str, str]]:
        machine = self._need_chip().machine
        driven = machine.levels
        rows = []
        for pin, name in enumerate(PINS):
            by = "driven" if driven[pin] in (0, 1) else "input"
            rows.append((name, f"{machine.pins >> pin & 1} ({by})"))
        return rows

    def _registers_shown(self) -> list[tuple[str, str]]:
        state = self._need_chip().machine.state()
        rows = [("PC", f"0x{state.pc:03X}"), ("W", _byte(state.w))]
        return rows + [(name, _byte(value)) for name, value in state.registers.items()]

    def _variables_shown(self) -> list[tuple[str, str]]:
        listing = self._need_loaded().listing
        ram = self._need_chip().machine.ram
        if listing is None or not listing.variables:
            return [(f"0x{RAM_FIRST + place:02X}", _byte(byte)) for place, byte in enumerate(ram)]
        names = sorted({name for _, name, _ in listing.variables})
        return [(name, str(variable(name, listing).number(ram))) for name in names]

    def _eeprom_shown(self) -> list[tuple[str, str]]:
        cells = self._need_chip().machine.state().eeprom
        return [(f"0x{place:02X}", _byte(cells[place])) for place in range(EEPROM_BYTES)]

    def _evaluate(self, given: Body) -> Body:
        """Return a variable, a register, a pin or a byte of RAM; `why RB0` explains a pin's level."""
        chip, text = self._need_chip(), str(given["expression"]).strip()
        asked = re.fullmatch(r"why\s+(R[AB]\d)", text, re.IGNORECASE)
        if asked:
            return {"result": " ".join(explain_pin(chip, _pin(asked[1].upper()))), "variablesReference": 0}
        if text.upper() in PINS:
            return {"result": str(chip.machine.pins >> _pin(text.upper()) & 1), "variablesReference": 0}
        registers = dict(self._registers_shown())
        if text.upper() in registers:
            return {"result": registers[text.upper()], "variablesReference": 0}
        number = variable(text, self._need_loaded().listing).number(chip.machine.ram)
        return {"result": str(number), "variablesReference": 0}

    def _set(self, name: str, text: str) -> Body:
        """Set a variable, a byte of RAM, W, or the level at a pin; return it as it is shown then.

        The past stays, and what came after this moment is dropped.
        """
        chip, name = self._need_chip(), name.strip()
        number = _number(text)
        if name.upper() in PINS:
            if number not in (0, 1):
                raise InputError("out-of-range", f"{name.upper()}: a level is 0 or 1, not '{text}'")
            chip.apply([LevelChange(chip.now, _pin(name.upper()), number)])
        elif name.upper() == "W":
            _fits(name, number, 1)
            chip.poke(None, number)
        elif name.upper() in dict(self._registers_shown()):
            raise InputError("out-of-range", f"'{name}' is not set: variables, 0x0C to 0x4F, W and pins are")
        else:
            found = variable(name, self._need_loaded().listing)
            _fits(name, number, found.size)
            for place, byte in enumerate((number % 256**found.size).to_bytes(found.size, "little")):
                chip.poke(found.address + place, byte)
        return {"value": self._evaluate({"expression": name})["result"]}

    def _disassemble(self, given: Body) -> Body:
        image = self._need_loaded().program.image
        begin = int(given["memoryReference"], 16) + int(given.get("instructionOffset") or 0)
        count = int(given["instructionCount"])
        if count > MAX_INSTRUCTIONS:
            raise InputError(
                "out-of-range", f"{count} instructions: up to {MAX_INSTRUCTIONS} are shown at a time"
            )
        rows = []
        for address in range(begin, begin + count):
            word = image.program.get(address, 0x3FFF)
            row: Body = {
                "address": f"0x{address:03X}" if address >= 0 else "0x000",
                "instructionBytes": f"{word:04X}",
                "instruction": assembly_text(word) if 0 <= address < PROGRAM_WORDS else "",
            }
            found = line_at(self._need_chip(), address) if 0 <= address < PROGRAM_WORDS else None
            if found is not None:
                row |= {"location": self._source(found), "line": found.line}
            if not 0 <= address < PROGRAM_WORDS:
                row["presentationHint"] = "invalid"
            rows.append(row)
        return {"instructions": rows}

    def _read_memory(self, given: Body) -> Body:
        """Return bytes of RAM, as far as they are, and how many are beyond it."""
        begin, count, ram = _ram_address(given), int(given["count"]), self._need_chip().machine.ram
        data = ram[begin - RAM_FIRST :][:count] if begin >= RAM_FIRST else b""
        answer: Body = {"address": f"0x{begin:02X}", "data": base64.b64encode(data).decode()}
        return answer | ({"unreadableBytes": count - len(data)} if len(data) < count else {})

    def _write_memory(self, given: Body) -> Body:
        begin, data = _ram_address(given), base64.b64decode(str(given["data"]), validate=True)
        if not RAM_FIRST <= begin <= begin + len(data) - 1 <= RAM_LAST:
            raise InputError("out-of-range", f"RAM is from 0x{RAM_FIRST:02X} to 0x{RAM_LAST:02X}")
        for place, byte in enumerate(data):
            self._need_chip().poke(begin + place, byte)
        return {"bytesWritten": len(data)}

    # Running

    def _continue(self, given: Body) -> Body:
        self._need_chip()
        self.running = True
        return {"allThreadsContinued": True}

    def _pause(self, given: Body) -> None:
        self.stay()
        if self.running:
            self.stopped("pause")

    def _reverse_continue(self, given: Body) -> None:
        chip = self._need_chip()
        self._back, self.stands_at, self.running = going_back(chip, self.armed), int(chip.now), True

    def _step_in(self, given: Body) -> None:
        chip = self._need_chip()
        if self._by_instruction(given):
            chip.step(1)
        else:
            chip.step_line(forwards=True)

    def _step_back(self, given: Body) -> None:
        chip = self._need_chip()
        if self._by_instruction(given):
            chip.step(-1)
        else:
            chip.step_line(forwards=False)

    def _next(self, given: Body) -> None:
        """Go to the next line of this function, or of the one that called it."""
        chip = self._need_chip()
        depth, line = self._depth(), line_at(chip, chip.machine.pc)
        for _ in range(MAX_STEPS):
            self._step_in(given)
            if self._depth() > depth:
                self._return_to(depth)
            now = line_at(chip, chip.machine.pc)
            if self._by_instruction(given) or self._depth() < depth or (now is not None and now != line):
                return

    def _by_instruction(self, given: Body) -> bool:
        """Return whether a step is one instruction: as asked for, or because nothing tells the lines."""
        return given.get("granularity") == "instruction" or not self._need_chip().lines

    def _step_out(self, given: Body) -> None:
        depth = self._depth()
        if depth:
            self._return_to(depth - 1)

    def _return_to(self, depth: int) -> None:
        """Run until the stack is no deeper: calls that this function makes return before."""
        chip = self._need_chip()
        for _ in range(MAX_STEPS):
            if self._depth() <= depth:
                return
            state = chip.machine.state()
            address = state.stack[self._depth() - depth - 1] % PROGRAM_WORDS
            if chip.run(chip.now + chip.clock.round_seconds(60), stops={address}) is None:
                return

    def _depth(self) -> int:
        return self._need_chip().machine.state().stack_depth

    def _end(self, given: Body) -> None:
        self.stay()
        self.running = False

    # Events

    def stopped(self, reason: str, text: str = "") -> None:
        """Tell the editor that the chip stands, and why."""
        self._tell_left_out()
        self.running = False
        self.stands_at = int(self._chip.now) if self._chip is not None else 0
        body = {"reason": reason, "threadId": THREAD, "allThreadsStopped": True}
        self.event("stopped", {**body, "description": text, "text": text} if text else body)

    def continued(self) -> None:
        """Tell the editor that another one has let the chip run."""
        self.running = True
        self.event("continued", {"threadId": THREAD, "allThreadsContinued": True})

    def log(self, text: str) -> None:
        """Print a line in the editor; of more than it can read in a second, how many were left out."""
        now = time.monotonic()
        if now >= self._second + 1:
            self._tell_left_out()
            self._second, self._logged = now, 0
        self._logged += 1
        if self._logged <= MAX_LOGGED:
            self._print(text)

    def _tell_left_out(self) -> None:
        if self._logged > MAX_LOGGED:
            left_out = self._logged - MAX_LOGGED
            self._print(f"({left_out} more lines were left out: {MAX_LOGGED} are printed in a second)")
            self._logged = MAX_LOGGED

    def _print(self, text: str) -> None:
        self.event("output", {"category": "console", "output": text + "\n"})

    def event(self, name: str, body: Mapping[str, object] | None = None) -> None:
        """Send an event; while a request is answered, after the answer."""
        message = {"type": "event", "event": name, "body": dict(body or {})}
        if self._later is None:
            self._send(message)
        else:
            self._later.append(message)

    def _need_chip(self) -> TimeMachine:
        if self._chip is None:
            raise InputError("missing-option", NOTHING_YET)
        return self._chip

    def _need_loaded(self) -> Loaded:
        if self._loaded is None:
            raise InputError("missing-option", NOTHING_YET)
        return self._loaded


def _check_keys(request: str, given: Body, allowed: Sequence[str]) -> None:
    """Raise InputError for a key of a configuration that nobody knows."""
    for key in sorted(given):
        if key not in (*allowed, *EDITOR_KEYS) and not key.startswith("_"):
            raise InputError("unknown-key", f"{request}: unknown key '{key}'", hint=", ".join(allowed))


def _ram_address(given: Body) -> int:
    return int(given["memoryReference"], 16) + int(given.get("offset") or 0)


def _pin(name: str) -> int:
    if name not in PINS:
        raise InputError("unknown-pin", f"there is no pin '{name}'")
    return PINS.index(name)


def _number(text: str) -> int:
    """Return a number as it is shown or as C writes it. Raises InputError."""
    word = text.split()[0] if text.split() else ""
    try:
        return int(word, 0)
    except ValueError:
        raise InputError("out-of-range", f"'{text}' is not a number such as 18, 0x12 or 0b10010") from None


def _fits(name: str, number: int, size: int) -> None:
    most = 256**size - 1
    if not -(most + 1) // 2 <= number <= most:
        raise InputError("out-of-range", f"'{name}' has {size} bytes: up to {most}, not {number}")


def _line(given: Body) -> Body:
    return {"line": given["line"]} if "line" in given else {}


def _error_text(error: ServogenError) -> str:
    place = f"{error.location.file}: " if error.location and error.location.file else ""
    return f"{place}{error.message}" + (f" ({error.hint})" if error.hint else "")


def _byte(value: int) -> str:
    return f"{value} (0x{value:02X})"


def _error(text: str) -> Body:
    return {"error": {"id": 1, "format": text, "showUser": True}}
