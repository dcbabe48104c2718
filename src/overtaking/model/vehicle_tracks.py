"""One simulation in SI units and road coordinates: its vehicles, frame by frame.

`Trajectories` holds a batch of simulations as integers of fixed resolutions, such as millimetres.
`VehicleTracks.from_trajectories` converts one of them. Exporters, films and figures read it.

Terms: the ego is the vehicle under study, the target the vehicle that it overtakes. A slot is the
number of a vehicle within its simulation (the ego has 0); slots may be empty. A row of
`VehicleTracks` is a filled slot. A frame is a recorded instant. A percept is the record of a
decision of the ego's driver to change lanes, with the vehicles that the driver perceived then.
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
"""Row of the ego in every array of `VehicleTracks`: slot 0 is always filled."""

_INDICATORS = Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT
_MS_PER_S = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleTracks(ContentEquality):
    """The vehicles of one simulation over time.

    Arrays have shape (vehicle, frame) unless stated otherwise; the first vehicle is the ego. In
    frames in which `is_recorded` is false, the states of a vehicle are undefined. Floats are
    float64, because float32 rounds away millimetres beyond 16 km. Two objects are equal if all
    their values are.

    Attributes:
        simulation_id: Number of the simulation in its data set; its row in the batch if the caller
            of `from_trajectories` states none.
        slots: Slot of each vehicle, in ascending order, shape (vehicle,).
        time: Time of each frame since the start of the recording, shape (frame,) [s].
        s: Station of the centre: distance along the road from its start [m].
        d: Position of the centre across the road, growing to the left of `s` [m].
        heading: Direction in which the body points, anticlockwise from world x [rad].
        road_angle: Angle from the direction of the road to `heading`, anticlockwise; about pi for
            an oncoming vehicle [rad]. It may differ by whole turns, so compare its sine and cosine.
        speed: Speed, never negative [m/s].
        accel: Acceleration forwards, without the jumps of speed in collisions [m/s^2].
        yaw_rate: Rate of turning, anticlockwise [rad/s].
        is_recorded: Whether the vehicle was recorded in the frame.
        lights: Lamps that are on, bits of `Lights`; 0 for lamps that the recording does not state.
        kind: Car, van, truck and so on, `VehicleKind`, shape (vehicle,).
        length: Length of the body, shape (vehicle,) [m].
        width: Width of the body, shape (vehicle,) [m].
        height: Height of the body, shape (vehicle,) [m].
        target: Row of the target; None for an ego without a target.
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
            row: Position of the simulation in the batch, from 0.
            events: Events of the same batch, which name the target. Without them the target is the
                leader at the ego's last decision to pull out. If the ego never so decided, it is
                the nearest vehicle ahead in the ego's lane in the first frame.
            simulation_id: Number of the simulation in its data set; `row` by default.

        Raises:
            NoSuchSimulationError: The batch has no such row.
        """
        simulation = trajectories.select(slice(row, row + 1))
        vehicles = simulation.scenario.vehicles
        slots = np.flatnonzero(vehicles.valid[0])
        frames = slice(int(simulation.num_frames[0]))

        def in_si(name: str) -> F64:
            integers = getattr(simulation.states, name)[0, slots, frames]
            return integers.astype(np.float64) * STATE_RESOLUTION[name]

        # Angles to the road are `headings - direction`. On a straight road these are the directions
        # of the bodies and of the road in the world; where the road bends, `headings` are angles to
        # the road already, and `direction` is 0.
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
            # Without the ego's slot: it cannot be its own target.
            target=int(np.searchsorted(slots, target_slot)) if target_slot in slots[1:] else None,
        )

    def row_of(self, slot: int) -> int:
        """The row of a vehicle slot.

        Raises:
            ValueError: The simulation has no vehicle in this slot.
        """
        return self.slots.index(slot)

    def at_frames(self, frames: IndexArray) -> Self:
        """The same vehicles in a selection of the frames.

        Args:
            frames: Indices of the frames, in any order, shape (frame,).
        """
        values: dict[str, Any] = {
            field.name: getattr(self, field.name) for field in dataclasses.fields(self)
        }
        selected = {
            name: array[:, frames]
            for name, array in values.items()
            if isinstance(array, np.ndarray) and array.ndim == 2  # (vehicle, frame), as stated.
        }
        return dataclasses.replace(self, time=self.time[frames], **selected)

    def gap_to_target(self) -> F64 | None:
        """Gap between the bumpers of the ego and its target.

        Returns:
            Positive while the target is ahead, 0 while the two overlap along the road, negative
            once the target is behind, shape (frame,) [m]; undefined where the target was not
            recorded. None if the ego has no target.
        """
        if self.target is None:
            return None
        target_lead = self.s[self.target] - self.s[EGO_ROW]
        distance_at_contact = 0.5 * (self.length[EGO_ROW] + self.length[self.target])
        return np.sign(target_lead) * np.maximum(np.abs(target_lead) - distance_at_contact, 0.0)

    def s_from_moving_mark(self, speed: float) -> F64:
        """Stations relative to a point that moves along the road at a constant speed.

        Space-time diagrams use it, because vehicles of similar speeds are then easy to tell apart.
        The point starts at the target in the first frame, in which the target has to be recorded;
        without a target it starts at the ego.

        Args:
            speed: Speed of the point [m/s].

        Returns:
            Positive for vehicles that are farther along the road, shape (vehicle, frame) [m].
        """
        start_row = EGO_ROW if self.target is None else self.target
        return self.s - (self.s[start_row, 0] + speed * self.time)


def _stated_lights(trajectories: Trajectories) -> np.uint8:
    """Bits of the lamps that a recording states: indicators, all other lamps, both or none."""
    stated = ~Lights(0)
    if "indicators" in trajectories.unknown:
        stated &= ~_INDICATORS
    if "lamps" in trajectories.unknown:
        stated &= _INDICATORS
    return np.uint8(stated)


def _likely_target(simulation: Trajectories) -> int:
    """Slot of the target of a single simulation whose events are unknown.

    Args:
        simulation: A batch of one simulation.

    Returns:
        With a recorded decision to pull out, the leader at the last one, `NO_VEHICLE` if there was
        no leader. Else the nearest vehicle ahead in the ego's lane in the first frame, `NO_VEHICLE`
        without one.
    """
    percepts = simulation.percepts
    pull_outs = np.flatnonzero(percepts.valid[0] & (percepts.kind[0] == ManoeuvreKind.PULL_OUT))
    if "percepts" not in simulation.unknown and len(pull_outs):
        return int(percepts.slot[0, pull_outs[-1], PerceivedVehicle.LEADER])
    lane, s = simulation.states.lane[0, :, 0], simulation.states.s[0, :, 0]
    is_ahead = simulation.state_mask[0, :, 0] & (lane == lane[EGO_SLOT]) & (s > s[EGO_SLOT])
    distance = np.where(is_ahead, s - s[EGO_SLOT], np.iinfo(s.dtype).max)
    return int(np.argmin(distance)) if is_ahead.any() else int(NO_VEHICLE)
