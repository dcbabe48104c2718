"""Who began a conflict of the ego, and whether a careful and competent driver prevents it.

A conflict is a near-crash or a contact. Only those that another vehicle began in the ego's lane can
be preventable: the reference driver of UN Regulation 157 keeps its lane. It drives on as the ego
did until the other's manoeuvre can be perceived, and brakes then.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.evaluation import competent
from overtaking.analysis.evaluation.lane_changes import of
from overtaking.analysis.validation.places import Moments, next_to
from overtaking.model.trajectories import NO_VEHICLE, Lights

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.analysis.validation.tally import Array
    from overtaking.analysis.validation.traffic import Batch
    from overtaking.labels.labelling import LabelledTrajectories


class Origin(Enum):
    """What began a conflict."""

    OWN_CHANGE = "the ego's own lane change"
    OWN_APPROACH = "the ego came too close by itself"
    FROM_BEHIND = "another ran into the ego from behind"
    CUT_IN = "another entered the ego's lane"
    CUT_OUT = "the leader left the lane, and a slower vehicle was ahead of it"
    BRAKING = "the leader braked"

    @property
    def is_others(self) -> bool:
        """Whether another vehicle began it in the ego's lane, ahead of it."""
        return self in (Origin.CUT_IN, Origin.CUT_OUT, Origin.BRAKING)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conflict:
    """A conflict of the ego.

    Attributes:
        simulation: Its place in the batch.
        frame: When: the hard reaction, or the last frame before the contact.
        partner: Slot of the other vehicle.
        is_contact: Whether they touched.
        origin: Who began it.
        perceived: Frame in which the other's manoeuvre could be perceived; that of the conflict
            where no other began it.
        is_preventable: Whether the reference driver has no contact; None where no other began it.
    """

    simulation: int
    frame: int
    partner: int
    is_contact: bool
    origin: Origin
    perceived: int
    is_preventable: bool | None


def columns(labelled: LabelledTrajectories, batch: Batch, near: Moments) -> dict[str, Array]:
    """How many conflicts each scene has, by who began them; shape (scene,)."""
    scenes = len(batch.weight)
    found = list(conflicts(labelled, batch, near))
    kinds = {
        "others_began": [one for one in found if one.origin.is_others],
        "preventable": [one for one in found if one.is_contact and one.is_preventable],
        "unpreventable": [one for one in found if one.is_contact and one.is_preventable is False],
        "avoided": [one for one in found if not one.is_contact and one.is_preventable is False],
        "own_began": [
            one for one in found if one.origin in (Origin.OWN_CHANGE, Origin.OWN_APPROACH)
        ],
        "from_behind": [one for one in found if one.origin is Origin.FROM_BEHIND],
        **{
            f"origin_{one.name.lower()}": [each for each in found if each.origin is one]
            for one in Origin
        },
    }
    return {
        name: np.bincount(np.array([one.simulation for one in some], np.intp), minlength=scenes)
        for name, some in kinds.items()
    }


def conflicts(labelled: LabelledTrajectories, batch: Batch, near: Moments) -> Iterator[Conflict]:
    """The near-crashes and contacts of the egos.

    Args:
        labelled: A batch.
        batch: The same, prepared for counting.
        near: The near-crashes of its egos.
    """
    lane = batch.runs.states.lane[near.place]
    _, leader = next_to(batch, near, lane, ahead=True)
    for simulation, frame, partner in zip(near.simulation, near.frame, leader, strict=True):
        yield _conflict(labelled, batch, int(simulation), int(frame), int(partner), contact=False)
    contacts = batch.runs.contacts
    for simulation in np.flatnonzero(contacts.partner[:, 0] != NO_VEHICLE):
        frame = int(1e-3 * contacts.time[simulation, 0] / batch.interval_s)
        frame = min(frame, int(batch.runs.num_frames[simulation]) - 1)
        partner = int(contacts.partner[simulation, 0])
        yield _conflict(labelled, batch, int(simulation), frame, partner, contact=True)


def _conflict(
    labelled: LabelledTrajectories,
    batch: Batch,
    simulation: int,
    frame: int,
    partner: int,
    *,
    contact: bool,
) -> Conflict:
    scene = _Scene(batch, simulation, frame, partner)
    origin, perceived = scene.origin()
    is_preventable = None
    if origin.is_others:
        friction = float(labelled.signals.friction[simulation, perceived])
        is_preventable = competent.prevents(
            batch.runs,
            simulation,
            partner,
            perceived,
            frame,
            friction=friction,
            waits_for_risk=origin is Origin.CUT_IN,
        )
    return Conflict(
        simulation=simulation,
        frame=frame,
        partner=partner,
        is_contact=contact,
        origin=origin,
        perceived=perceived,
        is_preventable=is_preventable,
    )


class _Scene:
    """The seconds before a conflict."""

    def __init__(self, batch: Batch, simulation: int, frame: int, partner: int) -> None:
        self._batch, self._frame, self._partner = batch, frame, partner
        self._simulation = simulation
        self._first = max(0, frame - round(of("conflict.look_back") / batch.interval_s))
        states = batch.runs.states
        self._lane = states.lane[simulation].astype(np.int64)
        self._s, self._d = (1e-3 * one[simulation] for one in (states.s, states.d))
        self._own_lane = int(self._lane[0, frame])

    def origin(self) -> tuple[Origin, int]:
        """Who began it, and the frame in which another's manoeuvre could be perceived."""
        if self._changed_lane() or self._is_over_line():
            return Origin.OWN_CHANGE, self._frame
        if self._s[self._partner, self._frame] < self._s[0, self._frame]:
            return Origin.FROM_BEHIND, self._frame
        entered = self._crossing(self._partner, into=True)
        if entered is not None:
            return Origin.CUT_IN, self._wandered(self._partner, entered)
        left = self._leaver()
        if left is not None:
            return Origin.CUT_OUT, self._wandered(*left)
        braked = self._braked()
        if braked is not None:
            return Origin.BRAKING, braked
        return Origin.OWN_APPROACH, self._frame

    def _changed_lane(self) -> bool:
        return bool((self._lane[0, self._first : self._frame + 1] != self._own_lane).any())

    def _is_over_line(self) -> bool:
        """Whether the ego's body is over a line of its lane."""
        road, half = self._batch.runs.road, 0.5 * self._width(0)
        if self._own_lane >= road.num_lanes:
            return True
        ends = sorted(
            float(one) for one in road.lane_boundaries[self._own_lane : self._own_lane + 2]
        )
        place = float(self._d[0, self._frame])
        return place - half < ends[0] or place + half > ends[1]

    def _width(self, slot: int) -> float:
        return float(self._batch.runs.scenario.vehicles.width[self._simulation, slot])

    def _crossing(self, slot: int, *, into: bool) -> int | None:
        """The last frame in which a vehicle came into the ego's lane, or left it."""
        inside = self._lane[slot, self._first : self._frame + 1] == self._own_lane
        steps = np.flatnonzero(np.diff(inside.astype(np.int8)) == (1 if into else -1))
        if len(steps):
            return self._first + int(steps[-1]) + 1
        # A contact over the line: the other has not crossed it yet.
        is_beside = into and not inside[-1]
        return self._frame if is_beside else None

    def _leaver(self) -> tuple[int, int] | None:
        """The vehicle between the two that left the lane last, and the frame in which it did."""
        between = (self._s[:, self._first] > self._s[0, self._first]) & (
            self._s[:, self._first] < self._s[self._partner, self._first]
        )
        between &= self._batch.runs.scenario.vehicles.valid[self._simulation]
        left = [(slot, self._crossing(int(slot), into=False)) for slot in np.flatnonzero(between)]
        found = [(int(slot), frame) for slot, frame in left if frame is not None]
        return max(found, key=lambda one: one[1]) if found else None

    def _wandered(self, slot: int, crossed: int) -> int:
        """The frame since which a vehicle is farther from its lane's centre than it wanders."""
        before = self._lane[slot, max(crossed - 1, 0)]
        road = self._batch.runs.road
        if before >= road.num_lanes:
            return crossed
        centre = 0.5 * sum(float(one) for one in road.lane_boundaries[before : before + 2])
        away = np.abs(self._d[slot, : crossed + 1] - centre) > of("competent.wander")
        calm = np.flatnonzero(~away)
        return min(int(calm[-1]) + 1, crossed) if len(calm) else 0

    def _braked(self) -> int | None:
        """The frame since which the other's stop lamps are on, if it brakes hard enough."""
        states, slot = self._batch.runs.states, (self._simulation, self._partner)
        window = slice(self._first, self._frame + 1)
        if 1e-3 * states.accel_lon[(*slot, window)].min() > -of("conflict.leader_brakes"):
            return None
        hardest = self._first + int(states.accel_lon[(*slot, window)].argmin())
        off = np.flatnonzero((states.lights[(*slot, slice(0, hardest + 1))] & Lights.BRAKE) == 0)
        return min(int(off[-1]) + 1, hardest) if len(off) else 0
