"""The page on an evaluation: a driver beside others in the same scenes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from overtaking.analysis.evaluation import tables, words
from overtaking.core.errors import MissingExtraError
from overtaking.show.report.files import ReportFolder, Written
from overtaking.show.report.page import Section, film_block, page, paragraph, remarks
from overtaking.show.report.prose import FOOT

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from matplotlib.figure import Figure

    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.core.progress import ProgressCallback

FILMS = "films"

_CAPTIONS = {
    "differences": "The primary endpoints: the driver minus each reference in the same scenes, "
    "with 95 % intervals. Full marks: a difference is shown; open ones: none is, or too few scenes "
    "differ.",
    "weathers": "The primary endpoints of each driver by weather, with 95 % intervals. A scene may "
    "be of several kinds; kinds with fewer than ten effective scenes are left out.",
    "rules": "How often each driver breaks a rule where it applies, with 95 % intervals; rules "
    "that no driver breaks are left out.",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated(Written):
    """What was written.

    Attributes:
        films: Names of the films in the folder `films`.
    """

    films: tuple[str, ...]


def write(
    found: Evaluation,
    out: Path,
    *,
    films: int = 10,
    benchmark: str = "",
    progress: ProgressCallback | None = None,
) -> Evaluated:
    """Write an evaluation as one page that needs no network, with films beside it.

    Args:
        found: What was evaluated.
        out: Folder of the page; made if missing, files of an earlier one are replaced.
        films: How many of the worst scenes are filmed.
        benchmark: Name and version of the benchmark, if it is one.
        progress: Called with the number of films that are done, and of all.

    Raises:
        OSError: A file cannot be written.
    """
    folder = ReportFolder(out)
    made = _films(found, folder, films, progress)
    sections = _sections(
        found, folder, [film_block(f"{FILMS}/{name}", text) for name, text in made]
    )
    text = page(words.title(found), words.lead(found), _facts(found, benchmark), sections, FOOT)
    return Evaluated(**folder.finish(text), films=tuple(name for name, _ in made))


def _facts(found: Evaluation, benchmark: str) -> list[tuple[str, str]]:
    from overtaking.analysis.evaluation.endpoints import POLICY

    facts = [
        ("benchmark", benchmark),
        ("scenes", f"{found.simulations:,} of {found.profile}"),
        ("profile asked for", found.asked_profile or ""),
        ("policy of the law", POLICY),
        ("seed", str(found.seed)),
        ("effective scenes", f"{found.effective:,.0f}"),
        ("largest weight", f"{100.0 * found.largest:.2g} %"),
        ("observes", found.observe),
        ("answers", found.action),
        ("driver", found.source),
        ("its SHA-256", found.digest[:16]),
        ("model", found.model_version),
    ]
    return [(name, value) for name, value in facts if value]


def _sections(found: Evaluation, folder: ReportFolder, films: list[str]) -> list[Section]:
    """The parts of the page."""
    from overtaking.analysis.evaluation.endpoints import SECONDARY

    drawn = _Figures(found, folder)
    primary = [folder.table(one) for one in tables.primary(found)]
    weather = [folder.table(one) for one in tables.weather(found)]
    shown = films or [paragraph(words.NO_FILMS)]
    groups = {
        name: [paragraph(words.ABOUT[name]), *map(folder.table, tables.group(found, name))]
        for name in SECONDARY
    }
    groups["law"].insert(1, drawn.of("rules"))
    groups["conflicts"].append(folder.table(tables.origins(found)))
    return [
        Section("first", "To know first", [remarks(words.notes(found), words.warnings(found))]),
        Section("primary", "Primary endpoints", [drawn.of("differences"), *primary]),
        Section("weather", "By weather", [drawn.of("weathers"), *weather]),
        *(
            Section(name.replace(" ", "-"), name.capitalize(), some)
            for name, some in groups.items()
        ),
        Section("margins", "Margins", [folder.table(tables.margins(found))]),
        Section(
            "worst",
            "The worst scenes",
            [folder.table(tables.worst(found)), f'<div class="films">{"".join(shown)}</div>'],
        ),
        Section("methods", "How the numbers were made", [*map(paragraph, words.METHODS)]),
    ]


class _Figures:
    """Draws the figures, or notes why it cannot."""

    def __init__(self, found: Evaluation, folder: ReportFolder) -> None:
        self._found, self._folder = found, folder

    def of(self, name: str) -> str:
        """The HTML of one."""
        try:
            draw = drawers()[name]
        except MissingExtraError as error:
            return self._folder.lacking(f"Figures are left out: {error}")
        return self._folder.figure(name, _CAPTIONS[name], partial(draw, self._found))


def drawers() -> dict[str, Callable[[Evaluation], Figure]]:
    """The functions that draw the figures of an evaluation, by the name of the figure.

    Raises:
        MissingExtraError: The extra `plots` is not installed.
    """
    from overtaking.show.plots import evaluation as plots

    return {
        "differences": plots.draw_contrasts,
        "weathers": plots.draw_weathers,
        "rules": plots.draw_law,
    }


def _films(
    found: Evaluation, folder: ReportFolder, number: int, progress: ProgressCallback | None
) -> list[tuple[str, str]]:
    """Film the worst scenes: names of the files, and captions."""
    from overtaking.analysis.evaluation.endpoints import POLICY
    from overtaking.labels.law.judging import stored_policy
    from overtaking.model.verdicts import OvertakeClass
    from overtaking.show.video.jobs import Job
    from overtaking.show.video.produce import produce

    chosen = found.worst[:number]
    jobs = []
    for one in chosen:
        labels = one.labelled.labels
        kind = OvertakeClass(int(labels.classes[0, labels.policies.index(POLICY)]))
        jobs.append(
            Job(number=one.scene, labelled=one.labelled, policy=stored_policy(POLICY), label=kind)
        )
    for old in (folder.out / FILMS).glob("[0-9]*.mp4"):
        old.unlink()
    try:
        made = produce(jobs, folder.out / FILMS, total=len(jobs), progress=progress) if jobs else []
    except MissingExtraError as error:
        folder.lacking(f"Films are left out: {error}")
        return []
    return [
        (film.path.name, f"Scene {one.scene}: {found.policy} {one.what}.")
        for film, one in zip(made, chosen, strict=True)
    ]
