"""The commands put together: a table from which only the called one is loaded, and how an error is shown."""

from __future__ import annotations

import gc
import inspect
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import fields, is_dataclass
from functools import wraps
from importlib import import_module
from itertools import pairwise
from keyword import iskeyword
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup
from typer.exceptions import TyperException
from typer.models import ArgumentInfo, OptionInfo

from servogen import INTERRUPTED, NOBODY_READS, __version__
from servogen.cli.show import show_error
from servogen.errors import InputError, Location, ServogenError, ToolError

if TYPE_CHECKING:
    from typer._click.core import Command, Context  # typer has no public name for them

GROUPS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "Jobs": {
        "job_commands": ("new", "check"),
        "plan_command": ("plan",),
        "build_commands": ("build", "demo"),
        "report_command": ("report",),
        "tune_command": ("tune",),
        "import_command": ("import",),
    },
    "Programs and signals": {
        "compile_command": ("compile",),
        "assembly_commands": ("assemble", "disassemble"),
        "simulate_command": ("simulate",),
        "dap_command": ("dap",),
        "signal_commands": ("verify", "measure", "plot"),
        "prove_command": ("prove",),
        "certificate_command": ("check-certificate",),
    },
    "Robots and motion": {
        "robot_commands": (
            *("robots", "servos", "fk", "ik", "jacobian", "statics"),
            *("transform", "orientation", "differential", "equation", "mobility"),
        ),
        "gait_command": ("gait",),
        "program_command": ("run-program",),
    },
    "Bench and robot": {
        "flash_command": ("flash",),
        "capture_command": ("capture",),
        "rig_command": ("rig",),
        "drive_command": ("drive",),
        "calibrate_command": ("calibrate",),
        "twin_command": ("twin",),
        "watch_command": ("watch",),
    },
    "Labs and tools": {
        "grade_commands": ("grade", "handout"),
        "schema_command": ("schema",),
        "doctor_command": ("doctor",),
    },
}
"""The groups of commands in `servogen --help`; in each the modules that define them, and their commands.

A command is the function of its name, `_` for `-`. Modules import what they need at their top: a command that
needs much more than its neighbours has a module of its own.
"""

MODULES = {name: module for modules in GROUPS.values() for module, names in modules.items() for name in names}
PANELS = {name: group for group, modules in GROUPS.items() for names in modules.values() for name in names}


class LazyCommands(TyperGroup):
    """The commands: one is loaded when it is called; a list of them shows only what their sources say."""

    def list_commands(self, ctx: Context) -> list[str]:
        return list(MODULES)

    def get_command(self, ctx: Context, cmd_name: str) -> Command | None:
        if cmd_name in MODULES and cmd_name not in self.commands:
            self.commands[cmd_name] = TyperCommand(
                cmd_name, help=_help_in_source(cmd_name), rich_help_panel=PANELS[cmd_name]
            )
        return super().get_command(ctx, cmd_name)

    def resolve_command(self, ctx: Context, args: list[str]) -> tuple[str | None, Command | None, list[str]]:
        if args[0] in MODULES:
            self.commands[args[0]] = _load(args[0])
        else:
            for name in MODULES:  # one of them may be meant
                self.get_command(ctx, name)
        return super().resolve_command(ctx, args)


def _function_name(command: str) -> str:
    """Return the function of a command: `import` is a word of Python's."""
    return command.replace("-", "_") + ("_" if iskeyword(command) else "")


def _help_in_source(command: str) -> str:
    """Return the docstring of a command without importing its module, which takes longer than many run."""
    source = Path(__file__).with_name(f"{MODULES[command]}.py").read_text("utf-8")
    found = re.search(rf'^def {_function_name(command)}\(.*?"""(.*?)"""', source, re.DOTALL | re.MULTILINE)
    return inspect.cleandoc(found[1]) if found else ""


def _load(command: str) -> Command:
    """Return a command, ready to be called."""
    function = getattr(import_module(f"servogen.cli.{MODULES[command]}"), _function_name(command))
    gc.enable()  # see `main`
    part = typer.Typer()
    part.callback()(_options)  # makes it a group, even of a single command
    hints = _types(function)
    settings = {"ignore_unknown_options": _takes_numbers(hints)}  # -5 is a number, not an option
    spread = _spread(function, hints)
    part.command(command, context_settings=settings, rich_help_panel=PANELS[command])(spread)
    return typer.main.get_group(part).commands[command]


def _types(declared: Any) -> dict[str, Any]:
    """Return the types of the parameters of a command, or of a group of options, as typer takes them.

    A parameter of which only the meaning is stated, `Annotated[type, "meaning"]`, is an option. One that
    states no name has the parameter's.
    """
    hints = get_type_hints(declared, include_extras=True)
    for name, hint in hints.items():
        stated = next(iter(getattr(hint, "__metadata__", ())), None)
        option = typer.Option(help=stated) if isinstance(stated, str) else copy(stated)
        if isinstance(option, OptionInfo) and option.default is ...:  # where typer keeps the first name
            option.default = f"--{name.replace('_', '-')}"
            hints[name] = Annotated[hint.__origin__, option]
    return hints


def _takes_numbers(hints: Mapping[str, Any]) -> bool:
    """Return whether a parameter of these types is an argument that is a number: those alone have parsers."""
    facts = [fact for hint in hints.values() for fact in getattr(hint, "__metadata__", ())]
    return any(isinstance(fact, ArgumentInfo) and fact.parser is not None for fact in facts)


def _spread(command: Callable[..., None], hints: Mapping[str, Any]) -> Callable[..., None]:
    """Return a command whose parameters that are dataclasses of options are those options, one each; `hints`
    are the types of all.
    """
    groups = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    parameters: list[inspect.Parameter] = []
    for name, parameter in inspect.signature(command).parameters.items():
        if name in groups:
            parameters += _option_parameters(groups[name])
        else:
            parameters.append(parameter.replace(annotation=hints[name], kind=parameter.KEYWORD_ONLY))

    @wraps(command)
    def spread(**values: Any) -> None:
        for name, kind in groups.items():
            values[name] = kind(**{field.name: values.pop(field.name) for field in fields(kind)})  # type: ignore[operator]
        command(**values)

    spread.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return spread


def _option_parameters(options: Any) -> Iterator[inspect.Parameter]:
    hints = _types(options)
    for field in fields(options):
        yield inspect.Parameter(
            field.name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=hints[field.name]
        )


app = typer.Typer(
    name="servogen",
    cls=LazyCommands,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    help="Turn a robot's job file into PIC16F84 firmware whose every servo pulse edge is exact.",
    epilog="Exit codes: 0 done, and right if it was checked, 1 checked and found wrong, 2 bad input, "
    "3 a tool is missing or failed, 130 interrupted, 141 the output's reader has gone (broken pipe).",
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"servogen {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def run() -> int:
    """Run one command and return its exit code; show errors without a traceback."""
    try:
        code = app(sys.argv[1:] or ["--help"], prog_name="servogen", standalone_mode=False)
        return code if isinstance(code, int) else 0
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except TyperException as error:  # the command line is wrong
        text = error.format_message().rstrip(".").replace(": Value error, ", ": ")
        text = _with_value(text, error, sys.argv[1:])
        meant = _suggestion(text)
        text = (BY_LETTERS if meant else HELP_ALONE).sub("", text)
        hint = meant or _outputs(text, error) or f"see: {_command_name(error)} --help"
        show_error(InputError("usage", text, hint=hint), sys.argv[1:])
        return InputError.exit_code
    except typer.Abort:
        return INTERRUPTED
    except ServogenError as error:
        show_error(error, sys.argv[1:])
        return error.exit_code
    except KeyboardInterrupt:  # before or after the command itself
        return INTERRUPTED
    except BrokenPipeError:  # of standard output, or of a file that is a pipe
        return NOBODY_READS
    except OSError as error:
        where = Location(str(error.filename)) if error.filename else None
        show_error(InputError("unreadable-file", error.strerror or str(error), where), sys.argv[1:])
        return InputError.exit_code
    except MemoryError:
        text = "out of memory: the input is too large for this machine"
        show_error(ToolError("out-of-memory", text), sys.argv[1:])
        return ToolError.exit_code
    except Exception:  # a defect of servogen: never the exit code of a verdict
        traceback.print_exc()
        text = "this is a defect of servogen itself; please report it with the lines above"
        show_error(ToolError("internal-error", text), sys.argv[1:])
        return ToolError.exit_code
    return 0


MEANT = {"upload": "flash", "program": "flash", "burn": "flash", "run": "simulate", "sim": "simulate"}
MEANT |= {"init": "new", "create": "new", "asm": "assemble", "cc": "compile", "labs": "handout"}
MEANT |= {"ui": "watch", "show": "watch"}
"""What other tools call a command."""
BY_LETTERS = re.compile(r"\. Did you mean .*$")
HELP_ALONE = re.compile(r" \(Possible options: --help\)$")


def _suggestion(text: str) -> str:
    """Return which command somebody means who types another tool's; empty where that is not known."""
    word = re.match(r"No such command '([\w-]+)'", text)
    command = MEANT.get(word[1]) if word else None
    return f"did you mean '{command}'?" if command else ""


def _outputs(text: str, error: TyperException) -> str:
    """Return the options that write a file, if `-o` was typed where there is no such option; else empty."""
    if not re.match(r"No such option: (-o|--output)\b", text):
        return ""
    command = getattr(getattr(error, "ctx", None), "command", None)
    writing = [
        each.opts[0] for each in getattr(command, "params", ()) if re.match("Write|Draw", each.help or "")
    ]
    return f"files are written by {', '.join(writing)}" if writing else ""


def _with_value(text: str, error: TyperException, words: Sequence[str]) -> str:
    """Return an error message about an option's value, quoting the value if it was typed."""
    names: Sequence[str] = getattr(getattr(error, "param", None), "opts", [])
    values = [after for before, after in pairwise(words) if before in names]
    values += [word.partition("=")[2] for word in words if word.partition("=")[0] in names and "=" in word]
    if not values or repr(values[-1]) in text:
        return text
    value = values[-1]
    with suppress(ValueError):
        if isnan(float(value)):
            return f"Invalid value for '{names[0]}': '{value}' is not a number"
    return text.replace(": Input should", f": '{value}' should", 1)


def _command_name(error: TyperException) -> str:
    """Return the command whose arguments are wrong, as it is typed."""
    context = getattr(error, "ctx", None)
    if context:
        return str(context.command_path)
    # An option without its values has no context.
    named = [arg for arg in sys.argv[1:2] if arg in MODULES]
    return " ".join(["servogen", *named])
