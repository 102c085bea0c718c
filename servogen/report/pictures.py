"""Pictures of all kinds: matplotlib only when one is drawn (the extra "plot"), and files that do not change.

In: a path, a figure that was drawn. Out: the file, the same for the same picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from servogen.errors import InputError, Location, ToolError
from servogen.outputs import atomic_write

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
DOTS_PER_INCH = 110


def check_suffix(path: Path, suffixes: tuple[str, ...] = SUFFIXES, kind: str = "picture") -> None:
    """Raise InputError for a suffix that is not one of `suffixes`."""
    if path.suffix.lower() not in suffixes:
        raise InputError(
            "unknown-suffix",
            f"'{path.suffix}' is not a {kind} that can be written",
            Location(str(path)),
            f"one of: {', '.join(suffixes)}",
        )


def new_figure(width: float, height: float, title: str) -> Figure:
    """Return an empty figure of that many inches. Raises ToolError without matplotlib."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ToolError(
            "tool-missing", "pictures need matplotlib", hint="pip install 'servogen[plot]'"
        ) from error
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, x=0.01, ha="left")
    return figure


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure that a notebook shows and that can be saved."""

    figure: Figure

    def save(self, path: str | Path) -> None:
        """Write the picture: .png, .svg or .pdf. Raises InputError for another suffix."""
        save(self.figure, Path(path))

    def __repr__(self) -> str:
        width, height = self.figure.get_size_inches()
        return f"<Picture {self.figure.get_suptitle()!r}, {width:g} × {height:g} inches>"

    def _repr_svg_(self) -> str:
        with BytesIO() as file:
            _write(self.figure, file, "svg")
            return file.getvalue().decode("utf-8")


def save(figure: Figure, path: Path) -> None:
    """Write the picture without a date or a version, so that the same picture is the same file."""
    check_suffix(path)
    with atomic_write(path, "wb") as file:
        _write(figure, file, path.suffix[1:].lower())


def _write(figure: Figure, file: IO[bytes], kind: str) -> None:
    import matplotlib

    metadata: dict[str, Any] = {"png": {"Software": None}, "svg": {"Date": None}}.get(
        kind, {"CreationDate": None}
    )
    with matplotlib.rc_context({"svg.hashsalt": "servogen"}):
        figure.savefig(file, format=kind, dpi=DOTS_PER_INCH, metadata=metadata)


def plane(axes: Axes, x: str, y: str, title: str) -> None:
    """Label axes as a plane in space: millimetres, the same scale on both."""
    axes.set_xlabel(f"{x}, mm")
    axes.set_ylabel(f"{y}, mm")
    axes.set_title(title, fontsize=10)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
