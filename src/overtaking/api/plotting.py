"""Single figures, for a paper or for the axes of a caller."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.api.data import load_dataset
from overtaking.model.checks import check_arguments

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@check_arguments
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
        source: A data set or its folder; the result of `dataset_statistics`, `validate_profile`,
            `evaluate`, `reproduce_study`, `learning.learn_factors`, `law.tolerance_curve`,
            `whatif.counterfactual` or `whatif.outcome_fan`; or the roads of
            `list_opendrive_roads`.
        figure: Name of the figure, needed where the source has several. A data set has the
            figures of its report, such as `classes` or `waiting-time`. The error for an unknown
            name lists all names.
        out: File for the figure, replaced as a whole: `.svg`, `.pdf` or `.png` by its name.
        ax: Axes of Matplotlib to draw into; only for figures with single axes.
        width: `column` (3.5 inches, one column of a paper) or `page` (7.16 inches, both columns).
            The figure is laid out for this width; the size of its letters does not change.
        policy: Policy that decides about the classes of a data set or of twins; None for the
            default of the profile.

    Returns:
        The Matplotlib figure; with `ax`, the figure that `ax` belongs to.

    Raises:
        ConfigError: The source has no figures, no figure or width has this name, or the figure
            cannot be drawn into `ax`.
        DatasetError: The data set is not complete or damaged, or has too little to draw.
        MissingExtraError: The extra `plots` is not installed.
        OSError: The file cannot be written.
    """
    from overtaking.show.report.figures import draw
    from overtaking.show.report.files import check_figure_file, put_figure

    path = None if out is None else Path(out)
    if path is not None:
        check_figure_file(path)
    if isinstance(source, str | Path):
        source = load_dataset(source)
    drawn = draw(source, figure, axes=ax, width=width, policy=policy)
    if path is not None:
        put_figure(path, drawn)
    return drawn
