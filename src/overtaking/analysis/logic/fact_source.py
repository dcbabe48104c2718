"""The recordings from which facts are measured.

In facts, left is the overtaking side and lanes count from the slow side, in left-hand traffic too.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.logic.vocabulary import EVENT_NAMES, rounded_up_thousandths
from overtaking.labels.snapshots import is_oncoming, other_vehicles_at
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.vehicles import EGO_SLOT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.analysis.logic.simulation_groups import SimulationGroup
    from overtaking.core.arrays import F32, I64, IndexArray, Mask
    from overtaking.model.ego_signals import EgoSignals
    from overtaking.model.road import Road
    from overtaking.model.trajectories import States, Trajectories
    from overtaking.model.verdicts import Case

REACH_MM = 200_000
"""Distance from the ego up to which vehicles have facts of position and speed [mm].

A choice, which bounds the number of facts. The gaps and distances in the facts of the law have no
such limit.
"""

ONCOMING_REACH_MM = 1_000_000
"""The same limit for oncoming vehicles [mm].

Drivers of the model look for oncoming vehicles up to 1,000 m ahead (`model.oncoming.range`) before
they pull out, so an overtake may depend on a vehicle farther away than `REACH_MM`.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ApproachingVehicles:
    """Vehicles that approach the ego from ahead in the opposite direction; shape (encounter,).

    Attributes:
        simulation: Row of the simulation.
        frame: The frame.
        slot: Slot of the vehicle.
        gap: Distance between the front bumpers [m].
    """

    simulation: IndexArray
    frame: IndexArray
    slot: IndexArray
    gap: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstContacts:
    """The first contact of each vehicle that collides; arrays have shape (contact,).

    Attributes:
        simulation: Row of the simulation.
        slot: Slot of the vehicle.
        partner: Slot of the vehicle that it touches.
        frame: First frame at or after the contact, at most the last of the simulation.
    """

    simulation: IndexArray
    slot: IndexArray
    partner: NDArray[np.integer]
    frame: NDArray[np.integer]


# eq=False: arrays have no single truth value to compare by. No slots: `cached_property` stores its
# values in the `__dict__`.
@dataclass(frozen=True, eq=False, kw_only=True)
class FactSource:
    """The recordings from which facts are measured.

    Attributes:
        group: The simulations.
        frame_step: Interval between the frames with positions [frames]. Frames in which lanes,
            order or events change have positions too.
        roles: Constants of `ROLE` for which `spacing` and `forced_braking` are measured: these
            facts exist for every frame, so roles that no rule reads are left out.
    """

    group: SimulationGroup
    frame_step: int
    roles: frozenset[str]

    @property
    def simulation_ids(self) -> I64:
        """Numbers of the simulations in the data set."""
        return self.group.simulation_ids

    @property
    def case(self) -> Case:
        """The simulations as the law reads them."""
        return self.group.case

    @property
    def trajectories(self) -> Trajectories:
        """Recorded states, scenarios and road."""
        return self.group.case.trajectories

    @property
    def states(self) -> States:
        """Recorded states of all vehicles."""
        return self.group.case.trajectories.states

    @property
    def signals(self) -> EgoSignals:
        """Signals of the egos."""
        return self.group.case.signals

    @property
    def road(self) -> Road:
        """The road that all simulations share."""
        return self.group.case.trajectories.road

    @cached_property
    def is_near(self) -> Mask:
        """Which vehicles are within reach of the ego, shape (simulation, vehicle, frame)."""
        s, reach = self.states.s, REACH_MM
        if self.road.is_two_way:
            is_other_direction = is_oncoming(self.trajectories)
            reach = np.where(is_other_direction, ONCOMING_REACH_MM, REACH_MM)[:, :, None]
        return self.trajectories.state_mask & (np.abs(s - s[:, [EGO_SLOT]]) <= reach)

    @cached_property
    def is_written_frame(self) -> Mask:
        """Which frames have positions and speeds, shape (simulation, frame).

        One frame in `frame_step`, the last frame, and all frames in which lanes, order or events
        change. Conclusions about these changes then have the same frame for every frame step.
        """
        events = self.case.events
        is_recorded = self.signals.valid
        frame = np.arange(is_recorded.shape[1])
        is_written = (frame % self.frame_step == 0) | (frame == events.last[:, None])
        # With a frame step of 1 every frame is written already.
        if self.frame_step > 1:
            is_written = is_written | _changed_frames(self.states.lane, self.is_near).any(axis=1)
            is_written |= _frames_with_new_order(self)
            for name in EVENT_NAMES:
                event_frame = getattr(events, name)[:, None]
                is_written |= (frame == event_frame) & (event_frame != NEVER)
            is_written[self.contacts.simulation, self.contacts.frame] = True
        return is_written & is_recorded

    @cached_property
    def contacts(self) -> FirstContacts:
        """The first contact of each vehicle that collides."""
        contacts, last_frame = self.trajectories.contacts, self.trajectories.num_frames - 1
        simulation, slot = np.nonzero(contacts.partner != NO_VEHICLE)
        # Times of contacts are in ms. The negated floor division rounds up to a whole frame.
        frame = -(-contacts.time[simulation, slot] // self.signals.frame_interval_ms)
        return FirstContacts(
            simulation=simulation,
            slot=slot,
            partner=contacts.partner[simulation, slot],
            frame=np.minimum(frame, last_frame[simulation]),
        )

    @cached_property
    def approaching(self) -> ApproachingVehicles:
        """Every vehicle that approaches an ego, in every frame."""
        if not self.road.is_two_way:
            no_index = np.zeros(0, np.intp)
            return ApproachingVehicles(
                simulation=no_index, frame=no_index, slot=no_index, gap=np.zeros(0, np.float32)
            )
        simulation, frame = np.nonzero(self.signals.valid)
        others = other_vehicles_at(self.trajectories, frame.astype(np.int32), simulation)
        index = instant, slot = np.nonzero(others.is_approaching)
        return ApproachingVehicles(
            simulation=simulation[instant],
            frame=frame[instant],
            slot=slot,
            gap=others.gap[index],
        )


def _changed_frames(values: NDArray[np.integer], valid: Mask) -> Mask:
    """Whether a value differs from the one in the frame before, where both frames are valid."""
    is_changed = np.zeros(valid.shape, np.bool_)
    is_changed[..., 1:] = valid[..., 1:] & valid[..., :-1] & (values[..., 1:] != values[..., :-1])
    return is_changed


def _frames_with_new_order(source: FactSource) -> Mask:
    """Whether a near vehicle comes ahead of, beside or behind another one, (simulation, frame)."""
    s, is_near = source.states.s, source.is_near
    # Rounded as in the fact `vehicle`, from which the theory concludes the same order.
    length = rounded_up_thousandths(source.trajectories.scenario.vehicles.length).astype(np.int32)
    has_new_order = np.zeros((s.shape[0], s.shape[2]), np.bool_)
    for a in range(s.shape[1]):
        for b in range(a):
            # Twice the distance of the centres is compared with the sum of both lengths, because
            # half a length may end in half a millimetre.
            distance = np.int32(2) * (s[:, a] - s[:, b])
            lengths = (length[:, a] + length[:, b])[:, None]
            # 1 where a is wholly ahead of b, -1 where it is wholly behind, 0 where they overlap.
            order = (distance >= lengths).astype(np.int8) - (distance <= -lengths)
            has_new_order |= _changed_frames(order, is_near[:, a] & is_near[:, b])
    return has_new_order
