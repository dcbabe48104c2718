"""`plot`: the figures of a data set by name, as files for a paper."""

from __future__ import annotations

import re
import shutil
import subprocess
from typing import TYPE_CHECKING

import pytest
from matplotlib.figure import Figure

import overtaking as ot
from overtaking.core.errors import ConfigError, DatasetError
from overtaking.show.plots.style import WIDTHS
from overtaking.show.report.figures import nearest_first

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=60,
        seed=1,
        out=tmp_path_factory.mktemp("plot") / "pinto",
    )


@pytest.mark.parametrize("width", WIDTHS)
def test_a_figure_of_a_data_set_is_drawn_by_its_name(data, tmp_path: Path, width):
    figure = ot.plot(data.path, "classes", out=tmp_path / "classes.svg", width=width)
    assert isinstance(figure, Figure)
    assert figure.get_size_inches()[0] == WIDTHS[width]
    assert "Success L" in (tmp_path / "classes.svg").read_text(encoding="utf-8")


def test_the_fonts_of_a_pdf_are_truetype_and_embedded(data, tmp_path: Path):
    path = tmp_path / "classes.pdf"
    ot.plot(data, "classes", out=path)
    ot.plot(data, "classes", out=tmp_path / "again.pdf")
    assert path.read_bytes() == (tmp_path / "again.pdf").read_bytes()
    tool = shutil.which("pdffonts")
    if tool is None:
        pytest.skip("pdffonts is not installed")
    font_table = subprocess.run(
        [tool, str(path)], capture_output=True, text=True, check=True
    ).stdout
    fonts = font_table.splitlines()[2:]
    assert fonts
    assert all("TrueType" in font and "Type 3" not in font for font in fonts)
    assert all(re.search(r"\byes yes yes\b", font) for font in fonts)


def test_text_of_an_svg_is_text_with_fonts_to_fall_back_on(data, tmp_path: Path):
    path = tmp_path / "waiting.svg"
    ot.plot(data, "waiting-time", out=path)
    text = path.read_text(encoding="utf-8")
    assert re.search(r"<text[^>]*>still waiting</text>", text)
    assert "'DejaVu Sans', 'Verdana', 'Arial', 'Helvetica', sans-serif" in text


def test_an_unknown_figure_lists_those_that_exist_the_nearest_first(data):
    with pytest.raises(ConfigError, match=r"figure: expected waiting-time or "):
        ot.plot(data, "waiting_times")
    with pytest.raises(ConfigError, match=r"figure: expected classes or .*got nothing|None"):
        ot.plot(data)
    assert nearest_first("boxplot", ["classes", "pairs", "boxes"])[0] == "boxes"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"width": "wide"}, "width: expected"),
        ({"out": "classes.gif"}, r"ends in .svg or .pdf or .png, got the ending .gif"),
        ({"out": "classes"}, r"got the ending \(none\)"),
        ({"ax": 1}, "ax: expected"),
    ],
)
def test_what_cannot_be_used_is_refused(data, arguments, message):
    with pytest.raises(ConfigError, match=message):
        ot.plot(data, "classes", **arguments)


def test_a_figure_with_single_axes_is_drawn_into_those_of_the_caller(data):
    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert ot.plot(data, "waiting-time", ax=left) is figure
    assert left.lines
    assert not right.lines
    with pytest.raises(ConfigError, match=r"pairs has several axes, got axes; .*classes"):
        ot.plot(data, "pairs", ax=right)


def test_an_example_of_a_class_is_drawn_if_the_data_have_one(data, tmp_path: Path):
    ot.plot(data, "example-success-i", out=tmp_path / "example.png", width="column")
    assert (tmp_path / "example.png").stat().st_size > 5_000
    with pytest.raises(DatasetError, match="a simulation of the class censored"):
        ot.plot(data, "example-censored")


def test_statistics_and_a_curve_of_the_law_are_drawn(data, tmp_path: Path):
    ot.plot(ot.dataset_statistics(data), "boxes", out=tmp_path / "boxes.pdf", width="column")
    ot.plot(ot.law.tolerance_curve(data.path), out=tmp_path / "law.svg", width="column")
