"""Makes the pictures of the documentation again, each by the command that stands beside it.

    python tools/pictures.py [NAME ...]        # without names: all that a command makes

A test compares a picture with what its command draws. Of those for which that takes too long (`SLOW`),
docs/pictures/SOURCES has the checksums of the picture and of what it shows: a change of one alone is noticed.
"""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "docs" / "pictures"
SOURCES = FOLDER / "SOURCES"
SUFFIXES = (".png", ".gif")

WATCH = [f"templates/watch/{name}" for name in ("colours.css", "index.html", "style.css")]
SLOW = {
    "gait-ripple.gif": ["servogen/robot/catalogue/robots/hexapod.toml", "docs/pictures/gait-wave.png"],
    "twin-turn.gif": ["firmware/hexapod-turn/main.hex", "jobs/hexapod-turn.toml"],
    "twin-turn.png": ["firmware/hexapod-turn/main.hex", "jobs/hexapod-turn.toml"],
    "walk-on-command.png": ["firmware/hexapod-command/main.hex", "docs/pictures/command.py"],
    "two-chips.png": [
        "docs/examples/two-chips/hexapod-eighteen.toml",
        "servogen/report/pair.py",
        "templates/pair.html.j2",
    ],
    "two-crystals.png": [
        "docs/examples/two-chips/two-crystals.toml",
        "servogen/report/pair.py",
        "templates/pair.html.j2",
    ],
    "report.png": ["firmware/lab8-exercise/report.txt", "templates/report.html.j2"],
    **{
        f"watch-{name}.png": ["docs/pictures/watch.py", *files]
        for names, files in (
            (("hexapod", "projector", "phone", "bodies"), [*WATCH, "firmware/hexapod-tripod/main.hex"]),
            (("job", "timeline", "difference"), [*WATCH, "firmware/lab8-exercise/main.hex"]),
            (("why", "capture", "graded"), WATCH),
            (("bus",), [*WATCH, "servogen/workflows/certificates.py"]),
            (("report",), ["firmware/hexapod-tripod/main.hex", "templates/report.html.j2"]),
            (("film", "class"), ["templates/watch/colours.css"]),
        )
        for name in names
    },
}
"""Pictures that take too long to be drawn in a test, and the files whose contents they show."""


def commands() -> dict[str, str]:
    """Return picture -> the command that its page states: one that names its file, or the script after it."""
    found: dict[str, str] = {}
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        text = page.read_text()
        told = re.findall(r"`((?:servogen|python) [^`]+)`|^((?:servogen .+\n)?chromium .+)$", text, re.M)
        stated = [one or other for one, other in told if "docs/pictures/" in (one or other)]
        for picture in re.findall(r"\((?:docs/)?pictures/([\w.-]+)\)", text):
            own = [command for command in stated if f"docs/pictures/{picture}" in command]
            after = text[text.index(f"pictures/{picture}") :]
            scripts = re.findall(r"`(python docs/pictures/\w+\.py)`", after)
            if own or scripts:
                found.setdefault(picture, (own or scripts)[0])
    return found


def sources() -> str:
    """Return the lines of SOURCES: picture, its checksum, the checksum of what it shows."""
    lines = []
    for name, files in sorted(SLOW.items()):
        shown = hashlib.sha256(b"".join((ROOT / file).read_bytes() for file in files))
        picture = hashlib.sha256((FOLDER / name).read_bytes())
        lines.append(f"{name}  {picture.hexdigest()[:16]}  {shown.hexdigest()[:16]}\n")
    return "".join(lines)


def main(names: list[str]) -> None:
    stated = commands()
    (ROOT / "build").mkdir(exist_ok=True)
    for command in dict.fromkeys(stated[name] for name in names or sorted(stated)):
        for line in command.splitlines():
            tool, *words = shlex.split(line)
            if tool in ("servogen", "python"):
                tool = str(Path(sys.executable).with_name(tool))
            elif os.geteuid() == 0:
                words.insert(0, "--no-sandbox")
            print(line, flush=True)
            subprocess.run([tool, *words], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    SOURCES.write_text(sources())


if __name__ == "__main__":
    main(sys.argv[1:])
