"""What every picture keeps to, whatever its style: what is read can be read, and nothing is cut off."""

from __future__ import annotations

from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

SIZES_IN = (4, 16)
TEXT_PT = (6, 14)
LINES_PT = (0.4, 4)
MARKS_PT = (2, 14)


def check_legible(figure: Any) -> None:
    """Check the sizes of a figure, its texts, lines and marks, that all texts lie within it, and that no
    legend covers a title or the label of an axis.
    """
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    assert all(SIZES_IN[0] <= each <= SIZES_IN[1] for each in figure.get_size_inches())
    # Of the numbers of an axis matplotlib keeps some that it does not draw: these are left out.
    numbers = {
        each for axes in figure.axes for axis in axes._axis_map.values() for each in axis.get_ticklabels()
    }
    for text in figure.findobj(Text):
        if text not in numbers and text.get_visible() and text.get_text().strip():
            assert TEXT_PT[0] <= text.get_fontsize() <= TEXT_PT[1], text.get_text()
            box = text.get_window_extent(renderer)
            assert box.x0 >= -1 and box.x1 <= figure.bbox.x1 + 1, text.get_text()
            assert box.y0 >= -1 and box.y1 <= figure.bbox.y1 + 1, text.get_text()
    for axes in figure.axes:
        check_marks(axes)
        legend = axes.get_legend()
        if legend is not None:
            covered = legend.get_window_extent(renderer)
            for label in (axes.title, axes.xaxis.label, axes.yaxis.label):
                box = label.get_window_extent(renderer)
                assert not label.get_text() or not covered.overlaps(box), label.get_text()


def check_marks(axes: Any) -> None:
    """Check that lines and marks can be seen, and that the grid stays behind them."""
    for line in axes.lines:
        if line.get_linestyle() != "None":
            assert LINES_PT[0] <= line.get_linewidth() <= LINES_PT[1]
        if line.get_marker() not in ("None", ""):
            assert MARKS_PT[0] <= line.get_markersize() <= MARKS_PT[1]
    grid = axes.xaxis.get_gridlines()
    if grid and grid[0].get_visible():
        assert 0 < grid[0].get_alpha() <= 0.5
