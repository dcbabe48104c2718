"""Compares the drivers of a profile with recordings, in traffic as dense as theirs.

Recorded scenes are short and of some density. So the profile's drivers are put on rings of that
density, and distributions of what both do are compared; nothing is judged by a limit.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.validation import changes, ring
from overtaking.analysis.validation.places import Moments, next_to
from overtaking.analysis.validation.traffic import Batch, limit
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import OvertakingError
from overtaking.core.representation import json_values
from overtaking.data.import_report import report_frame
from overtaking.model.import_report import ImportFinding
from overtaking.model.vehicles import EGO_SLOT
from overtaking.recordings.formats import read_recording

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import pandas as pd

    from overtaking.analysis.validation.tally import Array
    from overtaking.model.road import Road
    from overtaking.scenarios.specification import Specification

RINGS = 24
"""Rings for all recordings together."""

FEWEST = 5
"""Vehicles around an ego of a recording whose density is taken."""

QUANTITIES = {
    "time gap of followers": "s",
    "speed": "m/s",
    "duration of a lane change": "s",
    "largest lateral speed of a lane change": "m/s",
}
"""Compared quantities with their units."""

Samples = dict[str, "Array"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Likeness(ContentEquality):
    """One quantity in recordings and in simulations like them.

    Attributes:
        title: Name of the quantity.
        unit: Unit of the medians.
        recorded: Number of recorded values.
        simulated: Number of simulated values.
        recorded_median: Their median; NaN without any.
        simulated_median: Their median.
        distance: Largest distance of the two distribution functions; NaN without values of both.
    """

    title: str
    unit: str
    recorded: int
    simulated: int
    recorded_median: float
    simulated_median: float
    distance: float

    def values(self) -> dict[str, Any]:
        """The comparison for JSON."""
        return json_values(asdict(self))


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison(ContentEquality):
    """Recordings beside simulations.

    Attributes:
        files: Names of the recordings.
        unused: Recordings that could not be used, each with the reason.
        densities: Vehicles per kilometre and lane in each recording that was used.
        likenesses: Each quantity.
        import_findings: The rows of `import_report`, of all recordings that were read.
    """

    files: tuple[str, ...]
    unused: tuple[str, ...]
    densities: tuple[float, ...]
    likenesses: tuple[Likeness, ...]
    import_findings: tuple[ImportFinding, ...] = ()

    @property
    def import_report(self) -> pd.DataFrame:
        """The findings of the examination of the recordings, one row each; see `Dataset`."""
        return report_frame(self.import_findings)

    def values(self) -> dict[str, Any]:
        """The comparison for JSON."""
        return {
            "files": list(self.files),
            "unused": list(self.unused),
            "densities": list(self.densities),
            "likenesses": [one.values() for one in self.likenesses],
            "import_report": [finding.to_dict() for finding in self.import_findings],
        }


def compare(spec: Specification, road: Road, seed: int, path: Path) -> Comparison:
    """Compare a profile with recordings in CommonRoad's format.

    Args:
        spec: A specification with a flow of traffic.
        road: Its road.
        seed: Seed of the random numbers.
        path: A recording, or a folder of recordings.

    Raises:
        OSError: The folder cannot be read.
    """
    files = sorted(path.glob("*.xml")) if path.is_dir() else [path]
    used, unused, batches, findings = _read(files)
    densities = [_density(batch) for batch in batches]
    recorded = _joined([_samples(batch, _egos(batch)) for batch in batches])
    rings = np.resize(np.array(densities or [0.0], np.float32), RINGS)
    simulated = _joined(
        [_samples(*pair) for pair in ring.batches(spec, road, seed, rings)] if used else []
    )
    return Comparison(
        files=tuple(used),
        unused=tuple(unused),
        densities=tuple(densities),
        likenesses=tuple(_likeness(name, recorded[name], simulated[name]) for name in QUANTITIES),
        import_findings=tuple(findings),
    )


def _read(
    files: Sequence[Path],
) -> tuple[list[str], list[str], list[Batch], list[ImportFinding]]:
    """The names of the usable files, the reasons for the others, the batches and the findings."""
    used, unused, batches = list[str](), list[str](), list[Batch]()
    findings = list[ImportFinding]()
    for file in files:
        try:
            scenes = read_recording("commonroad", file, {}).scenes
        except OvertakingError as error:
            unused.append(str(error))
            continue
        findings += [replace(finding, recording=file.name) for finding in scenes.import_findings]
        batch = Batch.of(scenes.trajectories(range(len(scenes))))
        if batch.runs.scenario.num_vehicles.max() < FEWEST:
            unused.append(f"{file.name}: fewer than {FEWEST} vehicles say nothing of a density")
            continue
        used.append(file.name)
        batches.append(batch)
    return used, unused, batches, findings


def _density(batch: Batch) -> float:
    """Vehicles per kilometre and lane around the egos, in the mean over simulations and frames."""
    s, there = batch.runs.states.s, batch.sound
    number = there.sum(axis=1)
    several = number > 1
    first = np.where(there, s, np.iinfo(np.int32).max).min(axis=1)[several]
    last = np.where(there, s, np.iinfo(np.int32).min).max(axis=1)[several]
    length_km = 1e-6 * (last - first)
    # Between the first and the last are one fewer than there are vehicles.
    return float(((number[several] - 1) / (batch.runs.road.num_lanes * length_km)).mean())


def _egos(batch: Batch) -> Array:
    """Only the egos: each recorded vehicle belongs to one simulation."""
    counted = np.zeros_like(batch.sound)
    counted[:, EGO_SLOT] = batch.sound[:, EGO_SLOT]
    return counted


def _samples(batch: Batch, counted: Array) -> Samples:
    """Every value of each quantity, of the counted vehicles and frames."""
    seen = np.zeros_like(counted)
    seen[:, :, batch.sampled] = counted[:, :, batch.sampled]
    simulation, vehicle, frame = np.nonzero(seen)
    at = Moments(simulation=simulation, vehicle=vehicle, frame=frame)
    speed = 1e-3 * batch.runs.states.speed
    gap, slot = next_to(batch, at, batch.runs.states.lane[at.place], ahead=True)
    time = np.maximum(gap, 0.0) / np.maximum(speed[at.place], 1.0)
    closing = np.abs(speed[at.place] - speed[simulation, slot, frame])
    follows = (time < limit("fastest_gap_time")) & (closing < limit("followed_closing"))
    measured = changes.measure(batch, changes.lane_changes(batch, counted))
    values = (time[follows], speed[at.place], measured.duration, measured.peak)
    return dict(zip(QUANTITIES, values, strict=True))


def _joined(parts: list[Samples]) -> Samples:
    return {
        name: np.concatenate([np.zeros(0), *(one[name] for one in parts)]) for name in QUANTITIES
    }


def _likeness(name: str, recorded: Array, simulated: Array) -> Likeness:
    return Likeness(
        title=name,
        unit=QUANTITIES[name],
        recorded=len(recorded),
        simulated=len(simulated),
        recorded_median=_median(recorded),
        simulated_median=_median(simulated),
        distance=distance(recorded, simulated),
    )


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def distance(one: Array, other: Array) -> float:
    """Largest distance of two empirical distribution functions, NaN if one has no values.

    Source:
        N. Smirnov, Table for estimating the goodness of fit, Ann. Math. Statist. 19 (1948) 279-281.
    """
    if not (len(one) and len(other)):
        return float("nan")
    every = np.concatenate([one, other])
    below = [
        np.searchsorted(np.sort(values), every, side="right") / len(values)
        for values in (one, other)
    ]
    return float(np.abs(below[0] - below[1]).max())
