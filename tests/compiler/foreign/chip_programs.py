"""python -m tests.compiler.foreign.chip_programs FOLDER: compile programs for this chip and count why not.

Each C file with a `main` is a program; the other C files of its folder belong to it where it needs them. The
counts distinguish programs that compile, programs that are refused rightly (another chip or dialect, too
large, a file of the project is missing, an error of the program) and the rest, which are refused wrongly.
Whether an error is the program's own is for a person to say: `FOLDER/judged.toml` holds lines
`"file" = "reason"`.
"""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from servogen import isolation
from servogen.compiler import Options, Source, compile_sources
from servogen.errors import Diagnostic, InputError
from servogen.inputs import MAX_TEXT_BYTES
from servogen.isolation import COMPILING, LimitExceeded, ProcessDied
from servogen.programs import devices_of, dialect_of, included_names, read_source
from tests.compiler.foreign.judge import TOO_LARGE, Verdict

RIGHTLY = ("other chip", "other dialect", "too large", "missing file", "own error")
"""The kinds of refusals that are right."""
WRONGLY = ("refused", "over limit", "crash")

_MAIN = re.compile(r"\bmain\s*\([^;]*?\)\s*(?://[^\n]*\s*|/\*.*?\*/\s*)*\{", re.DOTALL)
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_OTHER_DIALECT = re.compile(
    r"(?i:#\s*(?:fuses|use\s+\w+|byte|int_\w+|priority)\b|#\s*include\s*[<\"](?:16|12|18)F\w+\.h"  # CCS
    r"|\bs?bit\s+\w+\s+at\b|\bPORT[AB]\.[FB]\d|\b(?:R[AB]|TRIS[AB])\d_bit\b)"  # mikroC
    r"|\b(?:Delay_(?:ms|us)|VDelay_ms|Lcd_Init|Lcd_Out|Sound_Init|Button)\s*\("
    r"|__attribute__|\bscanf\b|#\s*include\s*<(?:avr|iostream|p18|p33|p24)",  # other targets
)
"""Marks of CCS C, mikroC, C18 and compilers for larger computers."""
_OURS = re.compile(r"#\s*include\s*[<\"](?:xc|htc|pic|pic14regs|pic14/\w+|system|boostc)\.h", re.IGNORECASE)
"""Headers of the dialects that the compiler has."""
_OTHER_CHIP = re.compile(
    r"\b(?:PORT|TRIS|LAT)[C-H](?:bits)?\b|\bR[C-H]\d\b|\bR[AB][5-9]\b(?<!RB[5-7])|\bTRIS[C-H]\d\b"
    r"|\bANSEL[A-H]?(?:bits)?\b|\b(?:ADCON|T1CON|T2CON|CCP\dCON|OSCCON|CMCON|PIR1|PIE1|TXSTA|RCSTA|SPBRG|VRCON)"
    r"\d?(?:bits)?\b|\bPEIE\b|\bTMR[12][HL]?\b|\bLAT[AB](?:bits)?\b"
    r"|#\s*include\s*[<\"](?:pic14/)?p(?:ic)?(?:10|12|16|18)[fl]+(?!84)\w+\.h",
    re.IGNORECASE,
)
"""Registers, bits and headers of chips with more pins and peripherals."""
_MISSING = re.compile(r"cannot find|not found|no such")


def programs(folder: Path) -> list[Path]:
    """Return the C files below a folder that define `main`."""
    files = (path for path in _c_files(folder) if path.stat().st_size < MAX_TEXT_BYTES)
    return [path for path in files if _MAIN.search(_COMMENT.sub(" ", read_source(path)))]


def _c_files(folder: Path) -> list[Path]:
    return [path for path in sorted(folder.rglob("*")) if path.suffix.lower() == ".c" and path.is_file()]


def verdict(program: Path, judged: str | None) -> Verdict:
    """Compile a program and return the kind of its end: "compiled", one of `RIGHTLY` or of `WRONGLY`."""
    errors = _errors(program, alone=True)
    if isinstance(errors, Verdict):
        return errors
    others = errors and _errors(program, alone=False)
    if isinstance(others, Verdict):
        return others
    errors = min((each for each in (errors, others) if each is not None), key=len)
    if not errors:
        return Verdict("compiled")
    text = _COMMENT.sub(" ", read_source(program))
    reason = f"{errors[0]}"
    if not _OURS.search(text) and _OTHER_DIALECT.search(text):
        return Verdict("other dialect", reason)
    if _OTHER_CHIP.search(text) or any("unknown configuration setting" in each.message for each in errors):
        return Verdict("other chip", reason)
    if all(TOO_LARGE.search(each.message) for each in errors):
        return Verdict("too large", reason)
    if judged is not None:
        return Verdict("own error", judged)
    missing = next((each for each in errors if each.code == "c-include"), None)
    return Verdict("refused", reason) if missing is None else Verdict("missing file", f"{missing}")


def _errors(program: Path, *, alone: bool) -> list[Diagnostic] | Verdict:
    """Return the errors of a program, compiled by itself or together with the files beside it."""
    beside = [] if alone else _belonging(program)
    if not alone and not beside:
        return _errors(program, alone=True)
    for clock_hz in (None, 4_000_000):
        try:
            isolation.run(partial(_compiled, [program, *beside], clock_hz), COMPILING)
        except InputError as error:
            found = [each for each in error.diagnostics if each.severity == "error"]
            missing = [each.code == "c-clock" and "is not known" in each.message for each in found]
            if clock_hz is None and any(missing):
                continue
            return found
        except LimitExceeded as error:
            return Verdict("over limit", str(error))
        except ProcessDied as error:
            return Verdict("crash", str(error))
        return []
    raise AssertionError


def _belonging(program: Path) -> list[Path]:
    """Return the C files in the folder of a program, and in folders below, that have no `main`."""
    mains = set(programs(program.parent))
    return [path for path in _c_files(program.parent) if path not in mains]


def _compiled(files: Sequence[Path], clock_hz: int | None) -> None:
    sources = [Source(read_source(path), str(path)) for path in files]
    names = included_names([(each.file, each.text) for each in sources], _include)
    chip, faster = devices_of(None, names)
    options = Options(dialect_of(names), chip, faster, clock_hz=clock_hz, include=_include)
    compile_sources(sources, options)


def _include(name: str, including: str) -> tuple[str, str] | None:
    """Return a header that lies beside the file, or anywhere in the folder of its project."""
    path = Path(including).parent / name.replace("\\", "/")
    if not path.is_file():
        wanted = path.name.lower()
        project = Path(including).parent
        near = [each for each in project.parent.rglob("*") if each.name.lower() == wanted and each.is_file()]
        if not near:
            return None
        path = near[0]
    return str(path), read_source(path)


def count(folder: Path, judged: Mapping[str, str], *, verbose: bool = False) -> Counter[str]:
    """Return how many programs below a folder end in each way; print those that are refused wrongly."""
    kinds: Counter[str] = Counter()
    for path in programs(folder):
        name = str(path.relative_to(folder))
        found = verdict(path, judged.get(name))
        kinds[found.kind] += 1
        if verbose or found.kind in WRONGLY:
            print(f"{found.kind.upper()} {name}: {found.reason}", flush=True)
    return kinds


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.compiler.foreign.chip_programs", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("folder", type=Path, help="where the programs lie, at any depth")
    parser.add_argument("--verbose", action="store_true", help="print the verdict of each program")
    arguments = parser.parse_args(given)
    if not arguments.folder.is_dir():
        parser.error(f"{arguments.folder} is not a folder")
    said = arguments.folder / "judged.toml"
    judged = tomllib.loads(said.read_text(encoding="utf-8")) if said.is_file() else {}
    kinds = count(arguments.folder, judged, verbose=arguments.verbose)
    print(f"{kinds.total():5} programs")
    for kind in ("compiled", *RIGHTLY, *WRONGLY):
        print(f"{kinds[kind]:5} {kind}")
    return int(not kinds or any(kinds[kind] for kind in WRONGLY))


if __name__ == "__main__":
    sys.exit(main())
