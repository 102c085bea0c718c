"""The input board's client against the real firmware, on a simulated ATmega2560.

    python -m tests.bench.board_in_simavr ConfigurableFirmata.ino.elf

runs the sketch, compiled for a Mega 2560, in simavr and prints which of the board's pins changed when, in ms
after MARK. It needs a C compiler and libsimavr (Debian: libsimavr-dev, libelf-dev). Exit code 1 if a change
is missing, in the wrong order or, where the board has the scheduler, more than 3 ms from where it belongs.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from servogen.bench.inputs.adapter import BoardInput, Close, DrivePin, Send, input_adapter
from servogen.bench.inputs.wiring import input_wiring
from servogen.testing.targets import BOARD_LATE_MS

SOURCE = Path(__file__).with_suffix(".c")
WAIT_S = 60
CONTACT = frozenset(("RB0", "RB4"))
CHANGES: list[tuple[int, DrivePin | Close | Send, str]] = [
    (0, DrivePin("MCLR", 1), "PJ1 1"),
    (20, DrivePin("RB0", 0), "PE4 0"),
    (23, DrivePin("RB0", 1), "PE4 1"),
    (24, DrivePin("RB0", 0), "PE4 0"),
    (40, Close(CONTACT, True), "PA0 1"),
    (84, DrivePin("RB0", 1), "PE4 1"),
]
"""What is done, and how the ATmega2560's port shows it: pins 14, 2 and 22 of a Mega are PJ1, PE4 and PA0."""
SENT = (50, Send("RA1", b"p", 2400), "TX1 112")
MARK = "PJ0 1"
LENGTH_MS = 120


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        host = f"{folder}/host"
        subprocess.run(["cc", "-O2", "-o", host, SOURCE, "-lsimavr", "-lelf", "-lutil"], check=True)
        with subprocess.Popen([host, sys.argv[1], "atmega2560"], stdout=subprocess.PIPE, text=True) as board:
            try:
                return judge(*played(board))
            finally:
                board.terminate()


def played(board: subprocess.Popen[str]) -> tuple[bool, list[str], list[tuple[float, str]]]:
    """Whether the board plays by its own clock, what should be seen, and what was, in ms after MARK."""
    assert board.stdout is not None
    path = next(line.split()[1] for line in board.stdout if line.startswith("port"))
    lines: list[str] = []
    threading.Thread(target=lambda: lines.extend(board.stdout or ()), daemon=True).start()
    with input_adapter(path, input_wiring(["RB0-RB4=22"])) as adapter:
        print(adapter.board)
        changes = list(CHANGES)
        if adapter.board.serial_ports:
            adapter.wiring = input_wiring(["RB0-RB4=22", "RA1=TX1"])
            adapter.listen("RA1", 2400)
            changes = sorted([*changes, SENT], key=lambda change: change[0])
        adapter.apply([DrivePin("MCLR", 0), DrivePin("RB0", 1)])
        adapter.load([BoardInput(ms, what) for ms, what, _ in changes], LENGTH_MS)
        time.sleep(1)
        before = len(lines)
        adapter.start()
        end = time.monotonic() + WAIT_S
        while time.monotonic() < end and len(lines) < before + len(changes) + 20:
            time.sleep(0.1)
    seen = [
        (float(time_us) / 1000, change)
        for time_us, change in (line.strip().split(" ", 1) for line in lines[before:])
    ]
    begin = next(ms for ms, change in seen if change == MARK)
    return (
        adapter.board.scheduler,
        [change for *_, change in changes],
        [(ms - begin, change) for ms, change in seen],
    )


def judge(by_the_board: bool, wanted: list[str], seen: list[tuple[float, str]]) -> int:
    own = [(ms, change) for ms, change in seen if ms >= 0 and change in set(wanted)]
    for ms, change in own[: len(wanted)]:
        print(f"{ms:9.3f} ms  {change}")
    if [change for _, change in own[: len(wanted)]] != wanted:
        print(f"wanted: {wanted}")
        return 1
    asked = sorted(ms for ms, *_ in (*CHANGES, *([SENT] if SENT[2] in wanted else [])))
    late = max(abs(ms - at) for (ms, _), at in zip(own, asked, strict=False))
    print(
        f"at most {late:.3f} ms from what was asked; "
        f"{sum(change[:3] == MARK[:3] for _, change in seen)} changes of MARK"
    )
    return int(by_the_board and late > BOARD_LATE_MS)


if __name__ == "__main__":
    sys.exit(main())
