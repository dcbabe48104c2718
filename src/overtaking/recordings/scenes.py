"""The simulations of a recording: its candidate overtakes and their vehicles."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.model.import_report import ImportFinding
from overtaking.model.road import Road
from overtaking.model.trajectories import Trajectories
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.batch import (
    MAX_SLOTS,
    NUM_SLOTS,
    coverage,
    trajectories,
    vehicles_of,
)
from overtaking.recordings.candidates import (
    LaneChanges,
    Window,
    followers,
    lane_changes,
    num_passes,
    overtakes,
)
from overtaking.recordings.messages import refused
from overtaking.recordings.neighbours import Surroundings
from overtaking.recordings.reading_progress import report_chosen_vehicles, report_stage
from overtaking.recordings.recording import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """Simulations that are parts of a recording.

    Attributes:
        recording: The recording.
        windows: The frames and vehicles of each simulation.
    """

    recording: Recording
    windows: Sequence[Window]

    def __len__(self) -> int:
        """Number of simulations."""
        return len(self.windows)

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.recording.name

    @property
    def road(self) -> Road:
        """The road of all of them."""
        return self.recording.road

    @property
    def unknown(self) -> frozenset[str]:
        """What the recording does not tell, names of `UNKNOWNS`."""
        return self.recording.unknown

    @property
    def notes(self) -> dict[str, Any]:
        """What the reader decided, left out or measured."""
        return self.recording.notes

    @property
    def import_findings(self) -> tuple[ImportFinding, ...]:
        """The findings of the examination, as rows of an import report."""
        return tuple(
            ImportFinding(
                recording=self.name,
                check=str(finding.check),
                vehicle=finding.vehicle,
                first_time_s=finding.first_time_s,
                rows=finding.rows,
                consequence=str(finding.consequence),
                detail=finding.detail,
            )
            for finding in self.recording.findings
        )

    def trajectories(self, numbers: range) -> Trajectories:
        """Some of the simulations."""
        windows = self.windows[numbers.start : numbers.stop]
        made = trajectories(self.recording, windows, first_index=numbers.start)
        return made.replace(import_findings=self.import_findings)

    def sources(self, numbers: range) -> list[str]:
        """The origin of some simulations in the recording, one text for each.

        It names the part and, slot by slot, the vehicles as the recording does.
        """
        name_of = self.recording.tracks.name_of
        return [
            f"{self.name} {self._part(number)} vehicles "
            + " ".join(name_of(vehicle) for vehicle in self.windows[number].vehicles)
            for number in numbers
        ]

    def _part(self, number: int) -> str:
        """The part of the recording that a simulation is."""
        window = self.windows[number]
        return f"frames {window.first} to {window.last}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenes(Parts):
    """Simulations that can be made from a recording, in order.

    Attributes:
        counts: What was found.
    """

    counts: dict[str, Any]


def scenes(
    recording: Recording, *, attempts_only: bool = False, num_slots: int = NUM_SLOTS
) -> Scenes:
    """Everything in a recording that may be an overtake, or could have been one.

    Args:
        recording: The recording.
        attempts_only: Whether vehicles are left out that have a leader and never leave their lane
            to the left.
        num_slots: Vehicles of a simulation at most, the ego among them.

    Raises:
        ConfigError: That many vehicles are too few or too many.
        ImportFormatError: There is nothing of the kind in the recording.
    """
    check_num_slots(num_slots)
    changes, around = lane_changes(recording), Surroundings.of(recording)
    report_stage("neighbours")
    moving = overtakes(recording, changes, around)
    waiting = followers(recording, changes, around)
    chosen = moving if attempts_only else [*moving, *waiting]
    if not chosen:
        raise _nothing(recording, len(waiting))
    report_stage("candidates")
    windows: list[Window] = []
    for window in chosen:
        vehicles = vehicles_of(recording, around, window, num_slots)
        windows.append(replace(window, vehicles=vehicles))
        report_chosen_vehicles(len(windows), len(chosen))
    counts = _counts(recording, changes, moving, waiting)
    counts["neighbours_with_a_slot"] = round(coverage(recording, around, windows), 4)
    return Scenes(recording=recording, windows=windows, counts=counts)


def check_num_slots(num_slots: int) -> None:
    """Refuse a number of vehicles that no simulation can have.

    Raises:
        ConfigError: There are fewer than 2 or more than `MAX_SLOTS`.
    """
    if not 2 <= num_slots <= MAX_SLOTS:
        raise ConfigError.out_of_range(
            what="vehicles of a simulation", where="import", low=2, high=MAX_SLOTS, got=num_slots
        )


def _counts(
    recording: Recording, changes: LaneChanges, moving: list[Window], waiting: list[Window]
) -> dict[str, Any]:
    """What was found, in numbers."""
    to_left = int(changes.is_left.sum())
    types = Counter(VehicleKind(kind).code for kind in recording.tracks.kind)
    return {
        "vehicles": recording.tracks.num_vehicles,
        "lane_changes_left": to_left,
        "lane_changes_right": len(changes.row) - to_left,
        "passes": num_passes(recording.tracks),
        "candidate_overtakes": len(moving),
        "candidates_that_return": sum(one.returns is not None for one in moving),
        "followers_without_attempt": len(waiting),
        "types": dict(sorted(types.items())),
    }


def _nothing(recording: Recording, num_waiting: int) -> ImportFormatError:
    followed = f"and {num_waiting} vehicles that only follow" if num_waiting else "and no followers"
    others = recording.notes.get("other_roads")
    elsewhere = f"choose another road, --lanelet {others}" if others else "choose another recording"
    return refused(
        recording.name,
        "recording",
        "a vehicle that leaves its lane to the left behind a leader",
        f"none {followed}",
        "import the followers too" if num_waiting else elsewhere,
    )
