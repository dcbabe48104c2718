"""The page on a reproduction: every number of the paper among ours, and what its labels hide."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from overtaking.analysis.reproduction import tables, words
from overtaking.analysis.reproduction.replicates import SIZE
from overtaking.analysis.reproduction.run import Reproduction
from overtaking.core.errors import MissingExtraError
from overtaking.show.report.files import ReportFolder, Written
from overtaking.show.report.page import Section, definitions, page, paragraph, remarks
from overtaking.show.report.prose import FOOT

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

FITTED, OTHERS = "paper-means", "paper-others"
"""Names of the figures."""

_FIRST = ("classes", "ego's speed", "target's speed", "difference", "distance")
"""What the groups of the first figure begin with."""

_CAPTIONS = {
    FITTED: "Sizes of the classes, and speeds and distances by class: a hill of our replicates "
    "beside each number of the paper.",
    OTHERS: "The other numbers of the paper, to which nothing was fitted.",
}


def write_reproduction(found: Reproduction, out: Path) -> Written:
    """Write a reproduction as one page that needs no network.

    Args:
        found: What `analysis.reproduction.run.reproduce` returned.
        out: Folder of the page; made if missing, files of an earlier one are replaced.

    Raises:
        OSError: A file cannot be written.
    """
    folder = ReportFolder(out)
    drawn = _figures(found, folder)
    sections = _sections(found, folder, drawn)
    title = f"{found.study}, number by number"
    text = page(title, words.lead(found), _facts(found), sections, FOOT)
    return Written(**folder.finish(text))


def _facts(found: Reproduction) -> list[tuple[str, str]]:
    return [
        ("profile", found.study),
        ("replicates", f"{found.num_replicates:,} of {SIZE}"),
        ("seed", str(found.seed)),
        ("simulated by", found.simulator),
        ("parameters", "frozen" if found.is_frozen else "not the frozen ones"),
        ("hash of the parameters", found.parameters_sha256[:16]),
    ]


def _sections(found: Reproduction, folder: ReportFolder, drawn: list[str]) -> list[Section]:
    """The parts of the page."""
    numbers = [
        definitions(words.standings()),
        folder.table(tables.numbers(found)),
        folder.table(tables.design(found)),
    ]
    hidden = [*map(paragraph, words.hidden(found)), folder.table(tables.lawful(found))]
    score = [folder.table(tables.score(found)), definitions(words.causes(found))]
    chosen = [folder.table(tables.collided(found)), folder.table(tables.pushes(found))]
    starts = [paragraph(words.about_starts(found)), folder.table(tables.starts(found))]
    notes = definitions(words.remarks_on_numbers(found))
    return [
        Section("first", "To know first", [remarks(words.notes(found), words.warnings(found))]),
        Section("figures", "The paper among our replicates", drawn),
        Section("score", "What is met, and what is missed", score),
        Section("numbers", "Every number", numbers),
        Section("remarks", "Remarks on single numbers", [notes]),
        Section("collided", "The collided, and what pushes decide", chosen),
        Section("hidden", "What the label hides", hidden),
        Section("starts", "What a start decides", starts),
    ]


def _figures(found: Reproduction, folder: ReportFolder) -> list[str]:
    """The figures, or why they are left out."""
    try:
        drawn = drawers(found)
    except MissingExtraError as error:
        return [folder.lacking(f"Figures are left out: {error}")]
    return [folder.figure(name, _CAPTIONS[name], draw) for name, draw in drawn.items()]


def drawers(reproduction: Reproduction) -> "dict[str, Callable[[], Figure]]":
    """The functions that draw the figures of a reproduction, by the name of the figure.

    Raises:
        MissingExtraError: The extra `plots` is not installed.
    """
    from overtaking.show.plots.comparison import draw_ridges, panels

    all_panels = panels(reproduction.comparisons)
    panels_by_figure = {
        FITTED: [panel for panel in all_panels if panel.title.startswith(_FIRST)],
        OTHERS: [panel for panel in all_panels if not panel.title.startswith(_FIRST)],
    }
    return {
        name: partial(draw_ridges, panels_of_figure)
        for name, panels_of_figure in panels_by_figure.items()
    }
