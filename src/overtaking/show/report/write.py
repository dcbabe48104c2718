"""Writes the report: what is computed in `stats` and drawn in `plots`, in one folder."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from overtaking.analysis.stats.associations import (
    Associations,
    associations,
    class_associations,
    strongest_pairs,
)
from overtaking.analysis.stats.diagrams import diagram
from overtaking.analysis.stats.distributions import typical
from overtaking.analysis.stats.results import Statistics, statistics
from overtaking.analysis.stats.table import Table
from overtaking.core.errors import MissingExtraError, OvertakingError
from overtaking.core.summary import Summarized
from overtaking.model.events import Events
from overtaking.model.trajectory import Trajectories
from overtaking.show.report import files, prose
from overtaking.show.report.learned import Learned
from overtaking.show.report.learned import sections as sections_of
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

Example = Callable[[int], tuple[Trajectories, Events]]
"""A simulation by its number: a batch of one, and what happened in it."""

Progress = Callable[[int, int], None]
Facts = Sequence[tuple[str, str]]

_NUM_PARTS = 18  # Figures, and the parts that take time beside them, for the progress.


@dataclass(frozen=True, slots=True, kw_only=True)
class Report(Summarized):
    """What was written.

    Attributes:
        path: The page.
        figures: Names of the figures, each as SVG and PNG in `figures`.
        tables: Names of the tables, each as LaTeX and CSV in `tables`.
        remarks: What the report could not show, and why.
        statistics: The numbers in it.
    """

    path: Path
    figures: tuple[str, ...]
    tables: tuple[str, ...]
    remarks: tuple[str, ...]
    statistics: Statistics


def write_report(
    frame: pd.DataFrame,
    out: Path,
    *,
    title: str,
    facts: Facts = (),
    policy: str = "paper",
    reading: str | None = None,
    weighted: bool = False,
    example: Example | None = None,
    learned: Learned | None = None,
    progress: Progress | None = None,
) -> Report:
    """Write the report on some features.

    Args:
        frame: One row per simulation: the paper's features, CLASS, and `weight` if `weighted`.
        out: Folder of the report; made if missing, files of an earlier report are replaced.
        title: Its heading.
        facts: What is known of the data, as names and values.
        policy: The policy that decided about the classes.
        reading: How the features were measured.
        weighted: Whether to count each simulation by its importance weight.
        example: Gives a simulation for the diagrams; without it there are none.
        learned: What was learned from the data, if it is to be told.
        progress: Called with the number of parts that are done, and of all.

    Raises:
        SchemaError: A column is missing or holds something that it must not.
        OSError: A file cannot be written.
    """
    found = statistics(frame, policy=policy, reading=reading, weighted=weighted)
    files.make_folders(out)
    writer = Writer(out, found, progress)
    sections = [
        writer.to_know_first(),
        writer.classes(),
        writer.tables_of_features(),
        writer.waiting(),
        writer.distributions(),
        writer.pairs(),
        writer.associations(),
        writer.examples(example),
        *(sections_of(writer, learned) if learned else ()),
        Section(name="methods", title="How the numbers were made", blocks=prose.methods()),
        Section(name="glossary", title="Glossary", blocks=tuple(prose.glossary())),
    ]
    text = page(title, prose.lead(found), [*facts, *prose.facts(found)], sections, prose.FOOT)
    files.put(out / files.PAGE, text.encode())
    files.remove_stale(out, set(writer.figures), set(writer.tables))
    writer.step(_NUM_PARTS)
    return Report(
        path=out / files.PAGE,
        figures=tuple(writer.figures),
        tables=tuple(writer.tables),
        remarks=tuple(writer.remarks),
        statistics=found,
    )


class Writer:
    """Makes the sections, and writes their figures and tables on the way."""

    def __init__(self, out: Path, found: Statistics, progress: Progress | None) -> None:
        """Begin with nothing written."""
        self.figures: list[str] = []
        self.tables: list[str] = []
        self.remarks: list[str] = []
        self._out, self._found, self._progress = out, found, progress
        self._colours = _colours()
        self._done = 0

    def step(self, done: int | None = None) -> None:
        """Note that a part is done."""
        self._done = min(self._done + 1, _NUM_PARTS) if done is None else done
        if self._progress is not None:
            self._progress(self._done, _NUM_PARTS)

    def to_know_first(self) -> Section:
        """What a reader has to know before believing a number."""
        found = self._found
        notes = [*found.notes, *prose.known_leaks(found)]
        warnings = [leak.sentence for leak in found.leaks]
        return Section(
            name="first",
            title="To know first",
            blocks=(prose.about_leaks(found), remarks(notes, warnings)),
        )

    def classes(self) -> Section:
        """How often each class occurs."""
        blocks = (
            paragraph(prose.about_policy(self._found)),
            definitions(prose.meanings("classes", self._found.sample.classes), self._colours),
            self.pictures("class_picture", self._found),
            self.table(self._found.classes),
        )
        return Section(name="classes", title="Classes", blocks=blocks)

    def tables_of_features(self) -> Section:
        """The paper's two tables."""
        blocks = (
            paragraph(prose.about_reading(self._found)),
            definitions(prose.meanings("features")),
            self.table(self._found.static),
            self.table(self._found.dynamic),
        )
        return Section(name="features", title="Statistics of the features", blocks=blocks)

    def waiting(self) -> Section:
        """How long drivers wait."""
        curve = self._found.waiting
        if curve is None:
            blocks = (self.lacking("No curve of waiting times can be estimated from these data."),)
        else:
            drawn = self.pictures("waiting_picture", self._found)
            blocks = (paragraph(prose.about_waiting(curve)), drawn)
        return Section(name="waiting", title="Waiting time", blocks=blocks)

    def distributions(self) -> Section:
        """Histograms and boxes."""
        drawn = self.pictures("distribution_pictures", self._found)
        return Section(name="distributions", title="Distributions", blocks=(drawn,))

    def pairs(self) -> Section:
        """Features against each other."""
        drawn = self.pictures("pair_pictures", self._found)
        return Section(name="pairs", title="Features against each other", blocks=(drawn,))

    def associations(self) -> Section:
        """Associations and p-values."""
        try:
            measured = associations(self._found.sample)
        except MissingExtraError as error:
            blocks = (self.lacking(f"Associations and p-values are left out: {error}"),)
        else:
            self.step()
            blocks = self._of_associations(measured)
        return Section(name="associations", title="Associations", blocks=blocks)

    def _of_associations(self, measured: Associations) -> tuple[str, ...]:
        """The two matrices, and the strongest pairs in words."""
        return (
            *(paragraph(text) for text in prose.about_associations(self._found, measured)),
            self.pictures("association_pictures", measured),
            self.table(class_associations(measured)),
            self.table(strongest_pairs(measured)),
        )

    def examples(self, example: Example | None) -> Section:
        """A typical simulation of each class in space and time."""
        blocks = [paragraph(prose.ABOUT_EXAMPLES)]
        if example is None:
            blocks.append(self.lacking("These data have no simulations to draw, only features."))
        else:
            numbers = self._found.sample.frame.index
            for name, place in typical(self._found.sample).items():
                blocks.append(self._example(name, int(numbers[place]), example))
        return Section(
            name="examples", title="A typical overtake of each class", blocks=tuple(blocks)
        )

    def _example(self, name: str, simulation: int, example: Example) -> str:
        """One of them, or the reason why it cannot be drawn."""
        try:
            one = diagram(*example(simulation))
        except OvertakingError as error:
            return self.lacking(f"Simulation {simulation} ({name}) cannot be drawn: {error}")
        return self.pictures("overtake_picture", name, simulation, one)

    def pictures(self, maker: str, *arguments: object) -> str:
        """Draw the figures that a function of `gallery` makes, and write them."""
        from overtaking.show.report import gallery

        try:
            made = getattr(gallery, maker)(*arguments)
        except MissingExtraError as error:
            return self.lacking(f"Figures are left out: {error}")
        return "".join(self._picture(one) for one in (made if isinstance(made, list) else [made]))

    def _picture(self, one: object) -> str:
        """Draw a figure and write it."""
        from overtaking.show.plots.style import narrow, to_png, to_svg
        from overtaking.show.report.gallery import Picture

        assert isinstance(one, Picture)
        figure = one.draw()
        svg = to_svg(figure)
        files.put(self._out / files.FIGURES / f"{one.name}.svg", svg)
        files.put(self._out / files.FIGURES / f"{one.name}.png", to_png(figure))
        self.figures.append(one.name)
        self.step()
        with narrow():
            for_phone = to_svg(one.draw())
        return figure_block(one.name, svg, one.caption, for_phone)

    def table(self, table: Table) -> str:
        """Write a table."""
        files.put_table(self._out, table)
        self.tables.append(table.name)
        return table_block(table, self._colours)

    def lacking(self, why: str) -> str:
        """Note what cannot be shown."""
        if why not in self.remarks:
            self.remarks.append(why)
        return missing(why)


def _colours() -> dict[str, str]:
    """The colours of the classes, none where nothing can be drawn."""
    try:
        from overtaking.show.plots.style import CLASS_COLOURS
    except MissingExtraError:
        return {}
    return CLASS_COLOURS
