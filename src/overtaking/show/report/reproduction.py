"""The page on a reproduction: every number of the paper among ours, and what its labels hide."""

from dataclasses import dataclass
from pathlib import Path

from overtaking.analysis.reproduction import tables, words
from overtaking.analysis.reproduction.replicates import SIZE
from overtaking.analysis.reproduction.run import Reproduction
from overtaking.analysis.stats.table import Table
from overtaking.core.errors import MissingExtraError
from overtaking.show.report import files
from overtaking.show.report.page import (
    Section,
    definitions,
    figure_block,
    missing,
    page,
    paragraph,
    remarks,
    table_block,
)
from overtaking.show.report.prose import FOOT

FITTED, OTHERS = "paper-means", "paper-others"
"""Names of the figures."""

_FIRST = ("classes", "ego's speed", "target's speed", "difference", "distance")
"""What the groups of the first figure begin with."""

_CAPTIONS = {
    FITTED: "Sizes of the classes, and speeds and distances by class: a hill of our replicates "
    "beside each number of the paper.",
    OTHERS: "The other numbers of the paper, to which nothing was fitted.",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """What was written.

    Attributes:
        path: The page.
        figures: Names of the figures, each as SVG and PNG in `figures`.
        tables: Names of the tables, each as LaTeX and CSV in `tables`.
        remarks: What the page could not show, and why.
    """

    path: Path
    figures: tuple[str, ...]
    tables: tuple[str, ...]
    remarks: tuple[str, ...]


def write_reproduction(found: Reproduction, out: Path) -> Written:
    """Write a reproduction as one page that needs no network.

    Args:
        found: What `analysis.reproduction.run.reproduce` returned.
        out: Folder of the page; made if missing, files of an earlier one are replaced.

    Raises:
        OSError: A file cannot be written.
    """
    files.make_folders(out)
    drawn: dict[str, bytes] = {}
    lacking: list[str] = []
    try:
        drawn = _figures(found, out)
    except MissingExtraError as error:
        lacking.append(f"Figures are left out: {error}")
    written = tables.tables(found)
    for one in written:
        files.put_table(out, one)
    title = f"{found.study}, number by number"
    text = page(title, words.lead(found), _facts(found), _sections(found, drawn, lacking), FOOT)
    files.put(out / files.PAGE, text.encode())
    files.remove_stale(out, set(drawn), {one.name for one in written})
    return Written(
        path=out / files.PAGE,
        figures=tuple(drawn),
        tables=tuple(one.name for one in written),
        remarks=tuple(lacking),
    )


def _facts(found: Reproduction) -> list[tuple[str, str]]:
    return [
        ("profile", found.study),
        ("replicates", f"{found.num_replicates:,} of {SIZE}"),
        ("seed", str(found.seed)),
        ("simulated by", found.simulator),
        ("parameters", "frozen" if found.is_frozen else "not the frozen ones"),
        ("hash of the parameters", found.parameters_sha256[:16]),
    ]


def _sections(
    found: Reproduction, drawn: dict[str, bytes], lacking: list[str]
) -> tuple[Section, ...]:
    """The parts of the page."""
    pictures = [figure_block(name, svg, _CAPTIONS[name]) for name, svg in drawn.items()]
    gaps = [missing(one) for one in lacking]
    return (
        Section(
            name="first",
            title="To know first",
            blocks=(remarks(words.notes(found), words.warnings(found)),),
        ),
        Section(name="figures", title="The paper among our replicates", blocks=(*pictures, *gaps)),
        Section(
            name="numbers",
            title="Every number",
            blocks=(
                definitions(words.standings()),
                _shown(tables.numbers(found)),
                _shown(tables.design(found)),
            ),
        ),
        Section(
            name="remarks",
            title="Remarks on single numbers",
            blocks=(definitions(words.remarks_on_numbers(found)),),
        ),
        Section(
            name="hidden",
            title="What the label hides",
            blocks=(
                *(paragraph(text) for text in words.hidden(found)),
                _shown(tables.lawful(found)),
            ),
        ),
        Section(
            name="starts",
            title="What a start decides",
            blocks=(paragraph(words.about_starts(found)), _shown(tables.starts(found))),
        ),
    )


def _shown(table: Table) -> str:
    try:
        from overtaking.show.plots.style import CLASS_COLOURS
    except MissingExtraError:
        return table_block(table, {})
    return table_block(table, CLASS_COLOURS)


def _figures(found: Reproduction, out: Path) -> dict[str, bytes]:
    """Draw and write the figures; MissingExtraError without the extra that draws."""
    from overtaking.show.plots.reproduction import draw_ridges, panels
    from overtaking.show.plots.style import to_png, to_svg

    every = panels(found.comparisons)
    parts = {
        FITTED: [one for one in every if one.title.startswith(_FIRST)],
        OTHERS: [one for one in every if not one.title.startswith(_FIRST)],
    }
    drawn: dict[str, bytes] = {}
    for name, shown in parts.items():
        figure = draw_ridges(shown)
        drawn[name] = to_svg(figure)
        files.put(out / files.FIGURES / f"{name}.svg", drawn[name])
        files.put(out / files.FIGURES / f"{name}.png", to_png(figure))
    return drawn
