"""Runs the tests of a change: of the files that import what changed, the nearest first.

    python tools/changed_tests.py [--list] [options of pytest]

Changed is what differs from the commit where this branch left `main` (on `main`: what is not committed),
files that git does not know yet included. First are the test files that bear the name of a changed one,
`test_trims.py` for `trims.py`; then a file is near if few imports lie between it and a changed file. One that
no chain of imports connects with a change is not run, and neither are campaigns. Imports are read from the
sources of `servogen/`, `tests/` and `tools/`, those inside functions too. As an import counts also:

- a `conftest.py`, for the tests of its folder and below;
- a module named in a string: `"servogen.cli.app"`, `"from servogen.cli import main"`, or the bare name of a
  neighbour (`"job_commands"` in `cli/app.py`), as tables of commands and engines are written;
- a file that is not Python, for each module that has in a string its name, its name without the suffix, or
  the name of its folder: so a template, a job, a page and a servo reach what reads them.

It is a choice by what could be executed, not by what is: `make check` runs everything.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parent.parent
SOURCES = ("servogen", "tests", "tools")
NAMED = re.compile(r"(?:^|\b(?:from|import) |-m )((?:servogen|tests|tools)(?:\.\w+)*)(?=$|\W)")


def changed_files(root: Path) -> list[str]:
    """Return the files that differ from where the branch left `main`; new ones included."""

    def git(*words: str) -> list[str]:
        done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True)
        return done.stdout.split("\n")[:-1] if done.returncode == 0 else []

    (base,) = git("merge-base", "HEAD", "main") or git("merge-base", "HEAD", "origin/main") or ["HEAD"]
    return sorted({*git("diff", "--name-only", base), *git("ls-files", "--others", "--exclude-standard")})


def nearest_tests(root: Path, changed: Iterable[str]) -> list[tuple[int, str]]:
    """Return the test files that a change reaches, the nearest first: how many imports away, and the file."""
    modules = {
        file.relative_to(root).as_posix(): _read(file)
        for folder in SOURCES
        for file in sorted((root / folder).rglob("*.py"))
    }
    files = {_module_of(file): file for file in (*modules, *changed) if file.endswith(".py")}
    users: dict[str, set[str]] = {}
    for file, (imports, strings) in modules.items():
        for used in _used(file, imports, strings, files):
            users.setdefault(used, set()).add(file)
    for file in changed:
        if not file.endswith(".py"):
            users[file] = {user for user, (_, texts) in modules.items() if _names(texts, PurePosixPath(file))}
    distance = dict.fromkeys(changed, 0)
    waiting = [*distance]
    for file in waiting:  # grows behind: by breadth
        for user in sorted(users.get(file, set()) - set(distance)):
            distance[user] = distance[file] + 1
            waiting.append(user)
    found = [(distance[file], file) for file in waiting if file in modules and _is_test(file)]
    stems = {PurePosixPath(file).stem for file in changed}
    return sorted(found, key=lambda each: not any(f"_{stem}" in each[1] for stem in stems))


def _is_test(file: str) -> bool:
    return file.startswith("tests/") and PurePosixPath(file).name.startswith("test_")


def _module_of(file: str) -> str:
    return file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _read(file: Path) -> tuple[set[str], set[str]]:
    """Return what a module imports, and the strings in it."""
    imports: set[str] = set()
    strings: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            strings.add(node.value)
        elif isinstance(node, ast.Import):
            imports.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            imports.update((node.module, *(f"{node.module}.{alias.name}" for alias in node.names)))
    return imports, strings


def _used(file: str, imports: set[str], strings: set[str], files: Mapping[str, str]) -> Iterator[str]:
    """Yield the files that a module imports."""
    folder = PurePosixPath(file).parent
    if _is_test(file):
        yield from (f"{each}/conftest.py" for each in (folder, *folder.parents))
    neighbours = {f"{_module_of(folder.as_posix())}.{text}" for text in strings if text.isidentifier()}
    for name in {*imports, *neighbours, *(name for text in strings for name in NAMED.findall(text))}:
        if name in files and files[name] != file:
            yield files[name]


def _names(strings: Iterable[str], file: PurePosixPath) -> bool:
    """Return whether one of the strings, or a part of a path in it, is the file's name or its folder's."""
    wanted = {file.name, file.stem, file.parent.name} - {""}
    return any(wanted.intersection(text.split("/")) for text in strings if len(text) < 200)


def main() -> int:
    """Run pytest with the files, or print them. Returns its exit code."""
    options = sys.argv[1:]
    changed = changed_files(ROOT)
    found = nearest_tests(ROOT, changed)
    print(f"{len(changed)} changed files, which {len(found)} test files import", flush=True)
    if "--list" in options:
        print(*(f"{distance:3} {file}" for distance, file in found), sep="\n")
        return 0
    if not found:
        return 0
    command = [sys.executable, "-m", "pytest", "-m", "not campaign", "-x", *options]
    return subprocess.call([*command, *(file for _, file in found)], cwd=ROOT)


if __name__ == "__main__":
    sys.exit(main())
