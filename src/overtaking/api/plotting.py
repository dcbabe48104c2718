"""Single figures, for a paper or for the axes of a caller."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.api.data import load
from overtaking.model.checks import checked

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@checked
def plot(
    source: Any,
    figure: str | None = None,
    *,
    out: str | Path | None = None,
    ax: Any = None,
    width: str = "page",
    policy: str | None = None,
) -> "Figure":
    """Draw a figure of a data set or of a result.

    Args:
        source: A data set or its folder; what `statistics`, `learn_factors`, `validate`,
            `law_curve`, `twin`, `fan`, `evaluate` or `reproduce` returned; or the roads of
            `map_roads`.
        figure: Name of the figure, where the source has several: of a data set one of its report,
            such as `classes` or `waiting-time`. An unknown name lists them.
        out: File for the figure, replaced as a whole: `.svg`, `.pdf` or `.png` by its name.
        ax: Axes of Matplotlib to draw into, of a figure with single axes.
        width: `column` or `page`: 3.5 or 7.16 inches, one or both columns of a paper. The figure is
            laid out for it, with letters of the same size.
        policy: Which rules decide about the classes of a data set or of twins; None for the default
            of the profile.

    Returns:
        The figure of Matplotlib, or that of `ax`.

    Raises:
        ConfigError: Nothing can be drawn of the source, or there is no such figure or width.
        DatasetError: The data set is not complete or damaged, or has too little to draw.
        MissingExtraError: The extra `plots` is not installed.
        OSError: The file cannot be written.
    """
    from overtaking.show.report.figures import draw
    from overtaking.show.report.files import check_figure_file, put_figure

    path = None if out is None else Path(out)
    if path is not None:
        check_figure_file(path)
    known = load(source) if isinstance(source, str | Path) else source
    drawn = draw(known, figure, axes=ax, width=width, policy=policy)
    if path is not None:
        put_figure(path, drawn)
    return drawn
