"""Writes the report: what is computed in `stats` and drawn in `plots`, in one folder."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from overtaking.analysis.stats.associations import (
    associations,
    class_associations,
    strongest_pairs,
)
from overtaking.analysis.stats.diagrams import diagram
from overtaking.analysis.stats.distributions import typical
from overtaking.analysis.stats.results import Statistics, statistics
from overtaking.core.errors import MissingExtraError, OvertakingError
from overtaking.core.representation import CompactRepr
from overtaking.labels.labelling import LabelledTrajectories
from overtaking.labels.law.judging import STORED_POLICIES
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.import_report import ImportFinding, summarize_findings
from overtaking.show.palette import CLASS_COLOURS
from overtaking.show.paragraphs import paragraphs
from overtaking.show.report import files, gallery, prose
from overtaking.show.report.learned import Learned
from overtaking.show.report.learned import sections as sections_of
from overtaking.show.report.page import (
    Section,
    definitions,
    page,
    paragraph,
    quotations,
    remarks,
)
from overtaking.show.view.write import page_of

Example = Callable[[int], LabelledTrajectories]
"""A simulation by its number: a batch of one, with its labels."""

Progress = Callable[[int, int], None]
Facts = Sequence[tuple[str, str]]

_NUM_PARTS = 18  # Figures, and the parts that take time beside them, for the progress.


@dataclass(frozen=True, slots=True, kw_only=True)
class Report(files.Written, CompactRepr):
    """What was written, with the numbers in it.

    Attributes:
        statistics: The numbers.
    """

    statistics: Statistics


def write_report(
    frame: pd.DataFrame,
    out: Path,
    *,
    title: str,
    facts: Facts = (),
    policy: str,
    reading: str | None = None,
    weighted: bool = False,
    example: Example | None = None,
    learned: Learned | None = None,
    findings: Sequence[ImportFinding] = (),
    progress: Progress | None = None,
) -> Report:
    """Write the report on some features.

    Args:
        frame: One row per simulation: the paper's features, CLASS, and `weight` if `weighted`.
        out: Folder of the report; made if missing, files of an earlier report are replaced.
        title: Its heading.
        facts: Facts about the data, as names and values.
        policy: The policy that decided about the classes.
        reading: How the features were measured.
        weighted: Whether to count each simulation by its importance weight.
        example: Gives a simulation for the diagrams; without it there are none.
        learned: Learned rules and factors, if the page shows them.
        findings: The rows of the import report of the data.
        progress: Called with the number of parts that are done, and of all.

    Raises:
        SchemaError: A column is missing or holds something that it must not.
        OSError: A file cannot be written.
    """
    found = statistics(frame, policy=policy, reading=reading, weighted=weighted)
    writer = Writer(out, found, progress)
    sections = [
        Section("first", "To know first", writer.to_know_first(findings)),
        Section("classes", f"Classes under the policy {policy}", writer.classes()),
        Section("features", "Statistics of the features", writer.tables_of_features()),
        Section("waiting", "Waiting time", writer.waiting()),
        Section("distributions", "Distributions", writer.drawn(gallery.distribution_pictures)),
        Section("pairs", "Features against each other", writer.drawn(gallery.pair_pictures)),
        Section("associations", "Associations", writer.associations()),
        Section("examples", "A typical overtake of each class", writer.examples(example)),
        *(sections_of(writer, learned) if learned else ()),
        Section("methods", "How the numbers were made", prose.methods()),
        Section("glossary", "Glossary", list(prose.glossary())),
    ]
    text = page(title, prose.lead(found), [*facts, *prose.facts(found)], sections, prose.FOOT)
    written = writer.finish(text)
    writer.step(_NUM_PARTS)
    return Report(**written, statistics=found)


class Writer(files.ReportFolder):
    """Makes the sections, and writes their figures and tables on the way."""

    def __init__(self, out: Path, found: Statistics, progress: Progress | None) -> None:
        """Begin with nothing written."""
        super().__init__(out)
        self._found, self._progress = found, progress
        self._done = 0

    def step(self, done: int | None = None) -> None:
        """Note that a part is done."""
        self._done = min(self._done + 1, _NUM_PARTS) if done is None else done
        if self._progress is not None:
            self._progress(self._done, _NUM_PARTS)

    def to_know_first(self, findings: Sequence[ImportFinding]) -> list[str]:
        """Limits of the numbers, and the findings of the recording, check by check."""
        found = self._found
        notes = [*found.notes, *prose.known_leaks(found)]
        warnings = [leak.sentence for leak in found.leaks]
        warnings += [f"Import report: {line}" for line in summarize_findings(findings)]
        return [prose.about_leaks(found), remarks(notes, warnings)]

    def classes(self) -> list[str]:
        """How often each class occurs."""
        found = self._found
        return [
            paragraph(prose.about_policy(found)),
            definitions(prose.meanings("classes", found.sample.classes), CLASS_COLOURS),
            self.pictures(lambda: [gallery.class_picture(found)]),
            self.table(found.classes),
        ]

    def tables_of_features(self) -> list[str]:
        """The paper's two tables."""
        return [
            paragraph(prose.about_reading(self._found)),
            definitions(prose.meanings("features")),
            self.table(self._found.static),
            self.table(self._found.dynamic),
        ]

    def waiting(self) -> list[str]:
        """How long drivers wait."""
        found = self._found
        if found.waiting is None:
            return [self.lacking("No curve of waiting times can be estimated from these data.")]
        drawn = self.pictures(lambda: [gallery.waiting_picture(found)])
        return [paragraph(prose.about_waiting(found.waiting)), drawn]

    def drawn(self, made: Callable[[Statistics], Sequence[gallery.Picture]]) -> list[str]:
        """Figures of the statistics."""
        return [self.pictures(lambda: made(self._found))]

    def associations(self) -> list[str]:
        """The two matrices, and the strongest pairs in words."""
        try:
            measured = associations(self._found.sample)
        except MissingExtraError as error:
            return [self.lacking(f"Associations and p-values are left out: {error}")]
        self.step()
        return [
            *(paragraph(text) for text in prose.about_associations(self._found, measured)),
            self.pictures(lambda: gallery.association_pictures(measured)),
            self.table(class_associations(measured)),
            self.table(strongest_pairs(measured)),
        ]

    def examples(self, example: Example | None) -> list[str]:
        """A typical simulation of each class in space and time."""
        about = paragraph(prose.ABOUT_EXAMPLES)
        if example is None:
            return [about, self.lacking("These data have no simulations to draw, only features.")]
        numbers = self._found.sample.frame.index
        blocks: list[str] = []
        shown: list[tuple[int, LabelledTrajectories]] = []
        for name, place in typical(self._found.sample).items():
            simulation = int(numbers[place])
            try:
                labelled = example(simulation)
                blocks.append(self._example(name, simulation, labelled))
            except OvertakingError as error:
                why = f"Simulation {simulation} ({name}) cannot be drawn: {error}"
                blocks.append(self.lacking(why))
            else:
                shown.append((simulation, labelled))
        return [about, self._running(shown), *blocks]

    def _running(self, shown: list[tuple[int, LabelledTrajectories]]) -> str:
        """The page in which the examples run."""
        if not shown:
            return ""
        content = page_of("Typical overtakes", self._found.sample.policy, shown)
        return self.view(content, prose.ABOUT_RUNNING)

    def _example(self, name: str, simulation: int, labelled: LabelledTrajectories) -> str:
        """One of them in space and time."""
        one = diagram(labelled.trajectories, labelled.events)
        drawn = self.pictures(
            lambda: [
                gallery.overtake_picture(name, simulation, one, policy=self._found.sample.policy)
            ]
        )
        return drawn + self._verdicts(labelled, simulation)

    def _verdicts(self, labelled: LabelledTrajectories, simulation: int) -> str:
        """A paragraph for each rule that the policy requires and that is broken."""
        (policy,) = (one for one in STORED_POLICIES if one.name == self._found.sample.policy)
        said = paragraphs(labelled, simulation, PORTUGAL, STORED_POLICIES)
        counted = [one for one in said if one["rule"] in policy.required]
        return quotations(one["paragraph"] for one in counted if one["verdict"] == "illegal")

    def pictures(self, made: Callable[[], Sequence[gallery.Picture]]) -> str:
        """Draw figures and write them, unless the extra that draws is missing."""
        try:
            pictures = made()
        except MissingExtraError as error:
            return self.lacking(f"Figures are left out: {error}")
        blocks: list[str] = []
        for one in pictures:
            blocks.append(self.figure(one.name, one.caption, one.draw))
            self.step()
        return "".join(blocks)
