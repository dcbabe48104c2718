"""One design for all figures: colours, marks, type, and how a figure becomes a file.

The colours of the classes are from the palette of Okabe and Ito, which people with any kind of
colour vision can tell apart; each class has a marker and a hatching too, so no
information depends on colour alone.

Source:
    M. Okabe and K. Ito, Color universal design, 2002 (revised 2008).
"""

import functools
import io
import math
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Literal, ParamSpec, TypeVar, cast

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from overtaking.show.palette import CLASS_COLOURS, GRID, INK, LINE, QUIET

P = ParamSpec("P")
R = TypeVar("R")

LEGEND_LINE = 6
"""Classes that fit on one line of a legend."""

CLASS_HATCHES = dict(
    zip(CLASS_COLOURS, ("", "//", "", "xx", "..", "\\\\", "--", "++"), strict=True)
)
"""Hatching of each class, where areas lie on each other."""

PHASE_COLOURS = {
    "follows": "#eef0f2",
    "pulls out": "#fdf3c8",
    "in the other lane": "#d9e9f5",
    "returns": "#fbe3bd",
    "done": "#d5efe5",
    "gives up": "#f3dcea",
    "follows again": "#eef0f2",
    "collided": "#f8d9c7",
    "off the road": "#e6dccb",
    "spins": "#e3d5e8",
}
"""Background of each phase of an overtake, light enough to print on."""

Width = Literal["column", "page"]

WIDTHS: Mapping[Width, float] = {"column": 3.5, "page": 7.16}
"""Widths of a figure [inch]: one column of a paper, or both columns (`page`).

The letters have the same size in both. A figure of one column also fits on a phone.

Source:
    IEEE, Guidelines for graphics preparation: a column is 3.5 in wide, a page 7.16 in.
"""

_width: ContextVar[Width] = ContextVar("width of new figures", default="page")
_axes: ContextVar[Axes | None] = ContextVar("axes of the caller", default=None)

DOTS_PER_INCH = 200

_COMPRESSION = 3  # Of PNG: less than the usual 6, for speed; files grow by a fifth.

_SETTINGS: dict[str, Any] = {
    "font.family": "sans-serif",
    # Matplotlib ships DejaVu Sans, so figures are the same everywhere. The others are for readers
    # of an SVG without it: Verdana has letters of nearly the same width, Arial narrower ones.
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica"],
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8.0,
    "axes.labelcolor": QUIET,
    "axes.edgecolor": LINE,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.major.size": 3.0,
    "ytick.major.size": 0.0,
    "hatch.linewidth": 0.5,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.fonttype": "none",  # Text stays text: it can be searched, and edited for a paper.
    "pdf.fonttype": 42,  # TrueType: journals refuse the usual Type 3.
    "ps.fonttype": 42,
    "svg.hashsalt": "overtaking",  # The same figure has the same bytes.
}


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Run a drawing function with the design of the package, whatever the user's settings."""

    @functools.wraps(draw)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        with mpl.rc_context():
            mpl.rcdefaults()
            mpl.rcParams.update(cast("Any", _SETTINGS))
            drawn = draw(*args, **kwargs)
            if isinstance(drawn, Figure):
                _settle(drawn)
            return drawn

    return run


@contextmanager
def drawn_for(width: Width, axes: Axes | None = None) -> Generator[None]:
    """Set the width of the figures that are drawn in this context, and the axes to draw into.

    Args:
        width: A name of `WIDTHS`. With `column`, panels stand below each other.
        axes: Axes that `single_axes` returns; None for axes of a new figure.
    """
    tokens = _width.set(width), _axes.set(axes)
    try:
        yield
    finally:
        _width.reset(tokens[0])
        _axes.reset(tokens[1])


def is_narrow() -> bool:
    """Whether figures are laid out for one column of a paper, or a phone."""
    return _width.get() == "column"


def legend_columns(entries: int) -> int:
    """How many entries of a legend above a figure fit on a line; more take further lines."""
    if is_narrow():
        return 2
    return entries if entries <= LEGEND_LINE else math.ceil(entries / 2)


def new_figure(height: float, *, is_fixed: bool = False) -> Figure:
    """An empty figure of the common width, that belongs to no window.

    Args:
        height: Its height [inch].
        is_fixed: Whether `set_margins` says where panels go; else everything finds its place.
    """
    size = (figure_width(), height)
    figure = Figure(figsize=size, layout=None if is_fixed else "constrained")
    FigureCanvasAgg(figure)
    return figure


def figure_width() -> float:
    """Width of new figures [inch]."""
    return WIDTHS[_width.get()]


def single_axes(height: float) -> tuple[Figure, Axes]:
    """The axes of a figure with single axes: the axes of the caller, or axes of a new figure.

    Args:
        height: Height of a new figure [inch].
    """
    axes = _axes.get()
    if axes is None:
        figure = new_figure(height)
        return figure, figure.add_subplot()
    figure = axes.get_figure(root=True)
    assert figure is not None
    return figure, axes


def add_legend(figure: Figure, axes: Axes, handles: Sequence[Any], *, columns: int) -> None:
    """Add a legend above a figure with single axes, or inside the axes of the caller."""
    if _axes.get() is None:
        figure.legend(handles=handles, loc="outside upper left", ncols=columns)
    else:
        axes.legend(handles=handles)


def _settle(figure: Figure) -> None:
    """Give everything its place once; otherwise each file would cost that again."""
    engine = figure.get_layout_engine()
    if engine is not None and _axes.get() is None:
        engine.execute(figure)
        figure.set_layout_engine("none")


def set_margins(
    figure: Figure, *, left: float, right: float, top: float, bottom: float, **gaps: float
) -> None:
    """Fix the margins [inch], and the gaps between panels; for figures of many panels.

    Args:
        figure: The figure.
        left: Left of the panels.
        right: Right of them.
        top: Above them.
        bottom: Below them.
        **gaps: `wspace` and `hspace`, in sizes of a panel.
    """
    width, height = figure.get_size_inches()
    figure.subplots_adjust(
        left=left / width,
        right=1.0 - right / width,
        top=1.0 - top / height,
        bottom=bottom / height,
        **gaps,
    )


def lightened(colour: str, strength: float) -> tuple[float, float, float]:
    """A colour mixed with white, for areas; unlike transparency it hides the grid behind it."""
    red, green, blue = (1.0 - strength * (1.0 - part) for part in to_rgb(colour))
    return red, green, blue


@styled
def to_svg(figure: Figure) -> bytes:
    """A figure as SVG; dense clouds of points are pictures in it."""
    buffer = io.BytesIO()
    figure.set_dpi(DOTS_PER_INCH)
    # `savefig` would draw once more, to find places that are settled.
    FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


@styled
def to_pdf(figure: Figure) -> bytes:
    """A figure as PDF with embedded TrueType fonts; dense clouds of points become pixels."""
    buffer = io.BytesIO()
    figure.set_dpi(DOTS_PER_INCH)
    # Without the date, the same figure gives the same bytes.
    FigureCanvasPdf(figure).print_pdf(
        buffer, metadata={"CreationDate": None, "Creator": None, "Producer": None}
    )
    return buffer.getvalue()


@styled
def to_png(figure: Figure) -> bytes:
    """A figure as PNG."""
    buffer = io.BytesIO()
    figure.set_dpi(DOTS_PER_INCH)
    FigureCanvasAgg(figure).print_png(
        buffer, metadata={"Software": None}, pil_kwargs={"compress_level": _COMPRESSION}
    )
    return buffer.getvalue()


def words(name: str) -> str:
    """A class as an axis shows it: without the underscore that only a column needs."""
    return name.replace("_", " ")


def remark(axes: Axes, text: str, *, height: float = 1.02, **style: Any) -> None:
    """Write a remark above the right end of a panel.

    Args:
        axes: The panel.
        text: The remark.
        height: Bottom of the text; 0 is the lower and 1 the upper edge of the panel.
        style: Further settings of the text.
    """
    known: dict[str, Any] = {"ha": "right", "va": "bottom", "color": QUIET}
    axes.text(1.0, height, text, transform=axes.transAxes, **known | style)


def write_cells(axes: Axes, texts: Mapping[tuple[int, int], str], **styles: Any) -> None:
    """Write into the cells of a matrix.

    Args:
        axes: Where it is drawn.
        texts: Text of each cell, by row and column.
        **styles: Properties of all texts, or functions of the cell that give them.
    """
    for cell, text in texts.items():
        style: dict[str, Any] = {
            name: of(cell) if callable(of) else of for name, of in styles.items()
        }
        axes.text(cell[1], cell[0], text, ha="center", va="center", **style)


def say_nothing_to_draw(axes: Axes) -> None:
    """Say in an empty panel that there are no values."""
    axes.set(xticks=[], yticks=[])
    axes.grid(visible=False)
    style: dict[str, Any] = {"ha": "center", "va": "center", "color": QUIET, "style": "italic"}
    axes.text(0.5, 0.5, "no values", transform=axes.transAxes, **style)


FORMATS: Mapping[str, Callable[[Figure], bytes]] = {
    ".svg": to_svg,
    ".pdf": to_pdf,
    ".png": to_png,
}
"""How a figure becomes a file, by the ending of its name."""
