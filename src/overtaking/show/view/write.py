"""Chosen simulations as one page on disk."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ConfigError
from overtaking.core.files import write_atomically
from overtaking.data.load import Dataset
from overtaking.labels.law.judging import choose_policy
from overtaking.model.import_report import ImportFinding, join_findings
from overtaking.show import wording
from overtaking.show.video.jobs import jobs, num_films, profile_of
from overtaking.show.view.pack import pack
from overtaking.show.view.page import packed, page

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from overtaking.data.generate import ProgressCallback
    from overtaking.labels.labelling import LabelledTrajectories
    from overtaking.show.video.jobs import Source

MOST_BYTES = 64_000_000
"""Of a page: what browsers open at once, on a phone too."""

LARGE = 8_000_000
"""Pages larger than this are announced before they are written: a mail takes no more [bytes]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewPage(ContentEquality):
    """A page that was written.

    Attributes:
        path: Where.
        simulations: Numbers of the simulations in it.
        size_bytes: How large it is.
    """

    path: Path
    simulations: tuple[int, ...]
    size_bytes: int


def write(
    source: Source,
    out: Path,
    *,
    chosen: Iterable[int] | str,
    policy: str | None,
    progress: ProgressCallback | None = None,
    say: Callable[[int], None] | None = None,
) -> ViewPage:
    """Write a page; see `overtaking.write_viewer_page`."""
    policy = choose_policy(policy, profile_of(source))
    total, entries, size = num_films(source, chosen), list[dict[str, Any]](), 0
    reports: dict[tuple[ImportFinding, ...], None] = {}
    for job in jobs(source, chosen, policy):
        values = pack(job.labelled, job.number)
        entries.append(_entry(values))
        reports[job.labelled.trajectories.import_findings] = None  # Once for many simulations.
        size += len(entries[-1]["data"])
        if size > MOST_BYTES:
            raise _too_large(len(entries), total)
        if progress is not None:
            progress(len(entries), total or len(entries))
    entries.sort(key=lambda entry: entry["number"])
    findings = join_findings(reports)
    content = page(_title(source), policy, entries, findings).encode()
    if say is not None and len(content) > LARGE:
        say(len(content))
    write_atomically(out, content)
    numbers = tuple(entry["number"] for entry in entries)
    return ViewPage(path=out, simulations=numbers, size_bytes=len(content))


def page_of(title: str, policy: str, shown: Iterable[tuple[int, LabelledTrajectories]]) -> bytes:
    """A page of simulations that are labelled already.

    Args:
        title: Its title.
        policy: Which policy is chosen when it opens.
        shown: Numbers of simulations, each with its batch of one.
    """
    simulations = list(shown)
    entries = [_entry(pack(labelled, number)) for number, labelled in simulations]
    findings = join_findings(labelled.trajectories.import_findings for _, labelled in simulations)
    return page(title, policy, entries, findings).encode()


def _entry(values: dict[str, Any]) -> dict[str, Any]:
    """What the list of a page shows of a simulation, and all of it, packed."""
    said = values["values"]
    return {
        "number": said["simulation"],
        "classes": {name: one["class"] for name, one in said["policies"].items()},
        "broken": [one["rule"] for one in said["broken"]],
        "weather": said["weather"] and (said["weather"]["preset"] or "drawn freely"),
        "night": bool(said["weather"] and said["weather"]["night"]),
        "outcome": wording.outcome_words(said),
        "duration_s": said["duration_s"],
        "num_frames": said["num_frames"],
        "data": packed(values),
    }


def _title(source: Source) -> str:
    """Title of the page."""
    return source.name if isinstance(source, Dataset) else "Simulations"


def _too_large(count: int, total: int | None) -> ConfigError:
    """The error of a page that no browser would open well."""
    return ConfigError(
        what="page",
        where="view",
        expected=f"{MOST_BYTES // 1_000_000} MB at most",
        got=f"more, from simulation {count} of {total or 'those chosen'} on",
        next_step=f"choose fewer than {count} with --simulations",
    )
