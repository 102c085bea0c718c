"""The functions of the checker's chip, which chip.c explains; the checker itself calls `run` only."""

from __future__ import annotations

from servogen.checker import chip, layout

ask, operate, read, write = (
    chip.exported(chip.library, name) for name in ("ask", "operate", "read_slot", "write_slot")
)
_tick, _drive, _events = chip.exported(chip.library, "tick", None), *(
    chip.exported(chip.library, name) for name in ("drive", "events")
)  # fmt: skip


def tick(s: chip.Ints, cycles: int = 1) -> None:
    """Let cycles pass."""
    for _ in range(cycles):
        _tick(s)


def drive(s: chip.Ints, edge_at: chip.Ints, edge_out: chip.Ints, board: layout.ChipSurroundings) -> int:
    """Compare the pins with the expected edges after an instruction wrote a port or TRIS."""
    return _drive(s, chip.edges(edge_at, edge_out), board)


def events(s: chip.Ints, edge_at: chip.Ints, board: layout.ChipSurroundings) -> int:
    """Process what is due between two instructions; return the reason to stop."""
    return _events(s, chip.edges(edge_at, edge_at), board)
