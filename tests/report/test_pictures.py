"""Pictures as files: their kinds, their size, and that they have no date."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from servogen.errors import InputError, ToolError
from servogen.report import pictures
from servogen.report.pictures import Picture, check_suffix, new_figure, plane, save


@pytest.mark.parametrize(
    ("name", "fine"), [("a.png", True), ("a.SVG", True), ("a.pdf", True), ("a", False), ("a.gif", False)]
)
def test_a_picture_is_a_png_an_svg_or_a_pdf(name: str, fine: bool) -> None:
    if fine:
        check_suffix(Path(name))
        return
    with pytest.raises(InputError, match="is not a picture that can be written") as refused:
        check_suffix(Path(name))
    assert "one of: .png, .svg, .pdf" in str(refused.value)


def test_another_kind_of_file_has_suffixes_of_its_own() -> None:
    check_suffix(Path("a.gif"), (".gif", ".mp4"), "film")
    with pytest.raises(InputError, match="'.png' is not a film") as refused:  # noqa: RUF043
        check_suffix(Path("a.png"), (".gif", ".mp4"), "film")
    assert "one of: .gif, .mp4" in str(refused.value)


def test_a_figure_has_its_title_at_the_left_inside_of_it() -> None:
    figure = new_figure(4, 3, "title")
    assert tuple(figure.get_size_inches()) == (4, 3)
    (title,) = figure.texts
    assert (title.get_text(), title.get_ha()) == ("title", "left")
    assert 0 < title.get_position()[0] < 0.05
    assert figure.get_constrained_layout()
    assert repr(Picture(figure)) == "<Picture 'title', 4 × 3 inches>"


def test_without_matplotlib_a_figure_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ToolError, match="pictures need matplotlib") as missing:
        new_figure(4, 3, "title")
    assert "pip install 'servogen[plot]'" in str(missing.value)


@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".PDF", b"%PDF")])
def test_the_same_picture_is_the_same_file_whenever_it_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, magic: bytes
) -> None:
    """Even years later: without a date, a version or random names."""
    texts = []
    for year in ("0", "1000000000"):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", year)
        figure = new_figure(2, 1, "title")
        axes = figure.add_subplot()
        axes.fill([0, 1, 1], [0, 0, 1])
        save(figure, tmp_path / f"a{suffix}")
        texts.append((tmp_path / f"a{suffix}").read_bytes())
    assert texts[0] == texts[1]
    assert texts[0].startswith(magic)
    with pytest.raises(InputError):
        save(figure, tmp_path / "a.txt")


def test_a_png_has_110_dots_an_inch(tmp_path: Path) -> None:
    """Width and height are the fifth and sixth word of the file, in big-endian order."""
    Picture(new_figure(2, 1, "t")).save(tmp_path / "a.png")
    data = (tmp_path / "a.png").read_bytes()
    assert (int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")) == (220, 110)
    assert Picture(new_figure(2, 1, "t"))._repr_svg_().startswith("<?xml")


def test_a_plane_has_millimetres_and_one_scale() -> None:
    axes = new_figure(2, 1, "t").add_subplot()
    plane(axes, "x", "y", "above")
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("x, mm", "y, mm", "above")
    assert (axes.get_aspect(), axes.get_adjustable(), axes.title.get_fontsize()) == (1.0, "datalim", 10)
    grid = axes.xaxis.get_gridlines()[0]
    assert (grid.get_visible(), grid.get_alpha()) == (True, 0.3)
    assert pictures.SUFFIXES == (".png", ".svg", ".pdf")
