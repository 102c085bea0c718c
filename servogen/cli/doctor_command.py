"""`servogen doctor`: which of the libraries, tools and ports that servogen can use are on this machine."""

from __future__ import annotations

import platform
import re
import shutil
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, requires, version
from typing import Annotated

import typer
from serial.tools.list_ports import comports

from servogen import __version__
from servogen.bench.inputs.adapter import BoardFacts, identify
from servogen.bench.inputs.firmata import BAUDS
from servogen.bench.ports import open_port
from servogen.bench.programmers.table import PROGRAMMERS, installed
from servogen.cli.options import Json
from servogen.cli.show import as_json, table

TOOLS = (
    ("gtkwave", "shows main.vcd"),
    ("pulseview", "shows main.vcd"),
    ("sigrok-cli", "captures with a logic analyser"),
    ("xc8-cc", "compiles main.xc8.c, should you want a second opinion"),
    ("sdcc", "compiles main.sdcc.c, where it has its pic14 port"),
)
"""Beside the programmers, which `servogen flash` knows. None is needed to build a job and prove it."""

MISSING = "missing"


def doctor(
    inputs: Annotated[str | None, "Identify the input board at this port."] = None,
    json: Json = False,
) -> None:
    """List the versions, tools and ports found on this machine."""
    libraries = _libraries()
    tools = [(name, use, shutil.which(name)) for name, use in TOOLS]
    tools += [
        (programmer.name, f"programs the chip: {programmer.hardware} (servogen flash)", installed(programmer))
        for programmer in PROGRAMMERS
    ]
    ports = [(port.device, port.description) for port in sorted(comports())]
    board = None if inputs is None else _board(inputs)
    if json:
        as_json(
            {
                "servogen": __version__,
                "python": platform.python_version(),
                "system": platform.platform(),
                "libraries": libraries,
                "tools": {name: path for name, _, path in tools},
                "ports": [{"port": port, "description": description} for port, description in ports],
                **({} if board is None else {"inputs": asdict(board)}),
            }
        )
    else:
        print(f"servogen {__version__}, Python {platform.python_version()}, {platform.platform()}")
        table("Libraries", ("library", "version"), list(libraries.items()))
        table(
            "Tools (none is needed to build a job and prove it)",
            ("tool", "what for", "found"),
            [(name, use, path or MISSING) for name, use, path in tools],
        )
        table("Serial ports", ("port", "description"), ports or [("none", "")])
        if board is not None:
            clock = "by its own clock" if board.scheduler else "by this computer's clock"
            lines = ", ".join(f"TX{port}" for port in board.serial_ports) or "none"
            print(
                f"Input board: {board.firmware}, {board.pins} pins, plays runs {clock}, serial ports: {lines}"
            )
    if MISSING in libraries.values():
        raise typer.Exit(3)


def _board(path: str) -> BoardFacts:
    """Return the facts that the input board at a port reports. Raises ToolError."""
    with open_port(path, BAUDS[0]) as port:
        return identify(port)


def _libraries() -> dict[str, str]:
    """Return the version of each library that servogen needs, by name."""
    names = [requirement_name(line) for line in requires("servogen") or () if "extra" not in line]
    versions = {}
    for name in names:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = MISSING
    return versions


def requirement_name(requirement: str) -> str:
    """Return the name in a requirement of the package metadata: numpy in `numpy<3,>=1.26`."""
    return re.split(r"[^\w.-]", requirement.strip(), maxsplit=1)[0]
