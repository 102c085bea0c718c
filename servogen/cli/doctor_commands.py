"""`servogen doctor`: which of the libraries, tools and ports that servogen can use are on this machine."""

from __future__ import annotations

import platform
import re
import shutil

import typer

from servogen import __version__
from servogen.cli.options import Json
from servogen.cli.show import as_json, table

TOOLS = (
    ("gtkwave", "shows main.vcd"),
    ("pulseview", "shows main.vcd"),
    ("sigrok-cli", "captures with a logic analyser"),
    ("xc8-cc", "compiles main.xc8.c, should you want a second opinion"),
    ("sdcc", "compiles main.sdcc.c, where it has its pic14 port"),
)
"""Beside the programmers, which `servogen flash` knows. None is needed to build and prove a job."""

MISSING = "missing"


def register(app: typer.Typer) -> None:
    app.command()(doctor)


def doctor(json: Json = False) -> None:
    """List the versions, tools and ports found on this machine."""
    from serial.tools.list_ports import comports

    from servogen.bench.programmers.table import PROGRAMMERS, installed

    libraries = _libraries()
    tools = [(name, use, shutil.which(name)) for name, use in TOOLS]
    tools += [
        (each.name, f"programs the chip: {each.hardware} (servogen flash)", installed(each))
        for each in PROGRAMMERS
    ]
    ports = [(port.device, port.description) for port in sorted(comports())]
    if json:
        as_json(
            {
                "servogen": __version__,
                "python": platform.python_version(),
                "system": platform.platform(),
                "libraries": libraries,
                "tools": {name: path for name, _, path in tools},
                "ports": [{"port": port, "description": description} for port, description in ports],
            }
        )
    else:
        print(f"servogen {__version__}, Python {platform.python_version()}, {platform.platform()}")
        table("Libraries", ("library", "version"), list(libraries.items()))
        table(
            "Tools (none is needed to build and prove a job)",
            ("tool", "what for", "found"),
            [(name, use, path or MISSING) for name, use, path in tools],
        )
        table("Serial ports", ("port", "description"), ports or [("none", "")])
    if MISSING in libraries.values():
        raise typer.Exit(3)


def _libraries() -> dict[str, str]:
    """Return the version of each library that servogen needs, by name."""
    from importlib.metadata import PackageNotFoundError, requires, version

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
