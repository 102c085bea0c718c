"""A capture by any analyser that sigrok knows, through `sigrok-cli`.

In: sigrok's driver and its channels' pins. Out: a sigrok session (.sr), whose channels are named by the pins.
A pseudo-terminal, as the virtual bench's, gets the modem lines that sigrok's serial library insists on.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from servogen.bench.ports import is_terminal, library
from servogen.edges import PINS
from servogen.errors import InputError, Location, ToolError, did_you_mean

PROGRAM = "sigrok-cli"
SUFFIX = ".sr"
SLACK_S = 30.0


@dataclass(frozen=True, slots=True)
class SigrokLook:
    """`driver` as for sigrok-cli's -d; `wires` as in ("D0", "RB0")."""

    driver: str
    rate: int
    samples: int
    wires: tuple[tuple[str, str], ...]
    rle: bool = False


def sigrok_wires(said: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Return channels and pins from texts such as `D0=RB0`. Raises InputError."""
    found = []
    for text in said:
        channel, _, pin = (part.strip() for part in text.partition("="))
        if not channel or pin.upper() not in PINS:
            hint = did_you_mean(pin.upper(), PINS) if channel else "as D0=RB0"
            raise InputError("bad-wiring", f"'{text}' wires no channel to a pin", hint=hint)
        found.append((channel, pin.upper()))
    if not found:
        raise InputError(
            "bad-wiring", "sigrok's channels have no pins", hint="say which is which, as --wire D0=RB0"
        )
    return tuple(found)


def command_of(look: SigrokLook, output: Path) -> tuple[str, ...]:
    """Return the command to run."""
    config = f"samplerate={look.rate}" + (":rle=on" if look.rle else "")
    channels = ",".join(f"{channel}={pin}" for channel, pin in look.wires)
    return (
        *(PROGRAM, "-d", look.driver, "--config", config, "--channels", channels),
        *("--samples", str(look.samples), "-o", str(output)),
    )


def capture(look: SigrokLook, output: Path) -> None:
    """Write the session. Raises ToolError."""
    if output.suffix.lower() != SUFFIX:
        raise InputError(
            "unknown-suffix",
            f"'{output.suffix}' is not the ending of a sigrok session",
            Location(str(output)),
            SUFFIX,
        )
    if shutil.which(PROGRAM) is None:
        raise ToolError(
            "tool-missing", f"{PROGRAM} is not installed", hint="https://sigrok.org/wiki/Sigrok-cli"
        )
    output.unlink(missing_ok=True)
    if is_terminal(look.driver):
        with library() as lines:
            _captured(look, output, {**os.environ, "LD_PRELOAD": str(lines)})
    else:
        _captured(look, output, dict(os.environ))


def _captured(look: SigrokLook, output: Path, environment: Mapping[str, str]) -> None:
    seconds = look.samples / look.rate
    try:
        done = subprocess.run(
            command_of(look, output),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=2 * seconds + SLACK_S,
            check=False,
            env=environment,
        )
    except subprocess.TimeoutExpired as error:
        output.unlink(missing_ok=True)
        raise ToolError("tool-failed", f"{PROGRAM} did not end within {error.timeout:g} s") from None
    said = "\n  ".join((done.stderr or done.stdout).strip().splitlines()[-3:])
    if done.returncode != 0 or not output.exists():
        output.unlink(missing_ok=True)
        raise ToolError(
            "capture-failed", f"{PROGRAM} captured nothing with '{look.driver}'", hint=said or None
        )
