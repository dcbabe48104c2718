"""One simulation in SI units and road coordinates: its vehicles, frame by frame.

`Trajectories` holds integers of fixed resolutions for a batch. Exporters, films and figures show
one simulation to people or to other programs, and read it from here.
"""

import dataclasses
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from overtaking.core.arrays import F64, U8, IndexArray, Mask
from overtaking.core.equality import ContentEquality
from overtaking.model.overtake_events import OvertakeEvents
from overtaking.model.trajectories import (
    ANGLE_RESOLUTION,
    NO_VEHICLE,
    STATE_RESOLUTION,
    Lights,
    ManoeuvreKind,
    PerceivedVehicle,
    Trajectories,
)
from overtaking.model.vehicles import EGO_SLOT

EGO_ROW = 0
"""Row of the ego in every array of `VehicleTracks`."""

_INDICATORS = Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT
_MS_PER_S = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleTracks(ContentEquality):
    """The vehicles of one simulation over time.

    Arrays have shape (vehicle, frame) unless stated otherwise; the first vehicle is the ego. In
    frames in which `is_recorded` is false, the states of a vehicle are undefined.

    Attributes:
        simulation_id: Number of the simulation in its data set, or its row in a batch.
        slots: Slot of each vehicle, in ascending order.
        time: Time of each frame since the start of the recording, shape (frame,) [s].
        s: Station of the centre [m].
        d: Lateral position of the centre, positive to the left [m].
        heading: Direction in which the body points, anticlockwise from world x [rad].
        road_angle: Angle from the direction of the road to that of the body, anticlockwise; about
            pi, of either sign, for an oncoming vehicle [rad].
        speed: Speed, never negative [m/s].
        accel: Acceleration forwards, contacts excluded [m/s^2].
        yaw_rate: Rate of turning, anticlockwise [rad/s].
        is_recorded: Whether the vehicle was recorded in the frame.
        lights: `Lights` bits; a bit is 0 if the recording does not state that lamp.
        kind: `VehicleKind`, shape (vehicle,).
        length: Shape (vehicle,) [m].
        width: Shape (vehicle,) [m].
        height: Shape (vehicle,) [m].
        target: Row of the vehicle to overtake; None if the ego has none.
    """

    simulation_id: int
    slots: tuple[int, ...]
    time: F64
    s: F64
    d: F64
    heading: F64
    road_angle: F64
    speed: F64
    accel: F64
    yaw_rate: F64
    is_recorded: Mask
    lights: U8
    kind: U8
    length: F64
    width: F64
    height: F64
    target: int | None

    @classmethod
    def from_trajectories(
        cls,
        trajectories: Trajectories,
        row: int = 0,
        events: OvertakeEvents | None = None,
        *,
        simulation_id: int | None = None,
    ) -> Self:
        """The tracks of all vehicles of one simulation.

        Args:
            trajectories: A batch of recorded simulations.
            row: The row of the simulation in the batch.
            events: Events of the same batch, which name the target. Without them the target is the
                vehicle that the ego last decided to overtake, or else the nearest one ahead in its
                lane in the first frame.
            simulation_id: Number of the simulation in its data set; `row` by default.
        """
        simulation = trajectories.select(slice(row, row + 1))
        vehicles = simulation.scenario.vehicles
        slots = np.flatnonzero(vehicles.valid[0])
        frames = slice(int(simulation.num_frames[0]))

        def in_si(name: str) -> F64:
            integers = getattr(simulation.states, name)[0, slots, frames]
            return integers.astype(np.float64) * STATE_RESOLUTION[name]

        headings, direction = simulation.headings_and_origin
        road_angles = headings[0, slots, frames].astype(np.float64) * ANGLE_RESOLUTION - direction
        target_slot = _likely_target(simulation) if events is None else int(events.target_slot[row])
        return cls(
            simulation_id=row if simulation_id is None else simulation_id,
            slots=tuple(slots.tolist()),
            time=simulation.time_ms[frames] / _MS_PER_S,
            s=in_si("s"),
            d=in_si("d"),
            heading=in_si("heading"),
            road_angle=road_angles,
            speed=in_si("speed"),
            accel=in_si("accel_lon"),
            yaw_rate=in_si("yaw_rate"),
            is_recorded=simulation.state_mask[0, slots, frames],
            lights=simulation.states.lights[0, slots, frames] & _stated_lights(simulation),
            kind=vehicles.kind[0, slots],
            length=vehicles.length[0, slots].astype(np.float64),
            width=vehicles.width[0, slots].astype(np.float64),
            height=vehicles.height[0, slots].astype(np.float64),
            target=int(np.searchsorted(slots, target_slot)) if target_slot in slots[1:] else None,
        )

    def row_of(self, slot: int) -> int:
        """The row of a vehicle slot.

        Raises:
            ValueError: The simulation has no vehicle in this slot.
        """
        return self.slots.index(slot)

    def at_frames(self, frames: IndexArray) -> Self:
        """The same vehicles in some of the frames.

        Args:
            frames: Indices of the frames, in any order, shape (frame,).
        """
        arrays: dict[str, Any] = {
            field.name: getattr(self, field.name) for field in dataclasses.fields(self)
        }
        selected = {
            name: values[:, frames]
            for name, values in arrays.items()
            if isinstance(values, np.ndarray) and values.ndim == 2
        }
        return dataclasses.replace(self, time=self.time[frames], **selected)

    def gap_to_target(self) -> F64 | None:
        """Gap between the bumpers of the ego and its target.

        Returns:
            Positive while the target is ahead, 0 alongside, negative once it is behind, shape
            (frame,) [m]; undefined in frames without the target. None if the ego has no target.
        """
        if self.target is None:
            return None
        target_lead = self.s[self.target] - self.s[EGO_ROW]
        touching = 0.5 * (self.length[EGO_ROW] + self.length[self.target])
        return np.sign(target_lead) * np.maximum(np.abs(target_lead) - touching, 0.0)

    def s_from_moving_mark(self, speed: float) -> F64:
        """Stations relative to a mark that moves along the road, as space-time diagrams show them.

        The mark starts at the target in the first frame; without a target it starts at the ego.

        Args:
            speed: Speed of the mark [m/s].

        Returns:
            Positive for vehicles that are farther along the road, shape (vehicle, frame) [m].
        """
        first_row = EGO_ROW if self.target is None else self.target
        return self.s - (self.s[first_row, 0] + speed * self.time)


def _stated_lights(trajectories: Trajectories) -> np.uint8:
    """Bits of the lamps that a recording states."""
    stated = ~Lights(0)
    if "indicators" in trajectories.unknown:
        stated &= ~_INDICATORS
    if "lamps" in trajectories.unknown:
        stated &= _INDICATORS
    return np.uint8(stated)


def _likely_target(simulation: Trajectories) -> int:
    """Slot of the vehicle to overtake in a batch of one without events; `NO_VEHICLE` for none."""
    percepts = simulation.percepts
    pull_outs = np.flatnonzero(percepts.valid[0] & (percepts.kind[0] == ManoeuvreKind.PULL_OUT))
    if "percepts" not in simulation.unknown and len(pull_outs):
        return int(percepts.slot[0, pull_outs[-1], PerceivedVehicle.LEADER])
    lane, s = simulation.states.lane[0, :, 0], simulation.states.s[0, :, 0]
    is_ahead = simulation.scenario.vehicles.valid[0] & (lane == lane[EGO_SLOT]) & (s > s[EGO_SLOT])
    distance = np.where(is_ahead, s - s[EGO_SLOT], np.iinfo(s.dtype).max)
    return int(np.argmin(distance)) if is_ahead.any() else int(NO_VEHICLE)
