"""What there is to know at the instant at which a driver may decide to overtake."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.model.batch import Batch
from overtaking.model.safety import Encounter

U8 = NDArray[np.uint8]
I32 = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnState(Batch):
    """The ego; every array has shape (simulation,).

    Attributes:
        kind: `VehicleKind`.
        speed: [m/s].
        accel: Along its axis [m/s^2].
        available_accel: Largest acceleration of engine and air on a level road [m/s^2].
        desired_speed: Speed wanted on a free road [m/s].
        waiting_time: Since it closed up to the vehicle ahead, NaN where the attempt began before
            the recording [s].
        lateral_offset: Of its centre from that of its lane, growing to the left [m].
    """

    kind: U8
    speed: F32
    accel: F32
    available_accel: F32
    desired_speed: F32
    waiting_time: F32
    lateral_offset: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleAhead(Batch):
    """The vehicle ahead in the ego's lane; every array has shape (simulation,).

    Where `encounter.valid` is false the others mean nothing.

    Attributes:
        encounter: The ego behind it.
        kind: `VehicleKind`.
        length: [m].
        speed: [m/s].
        accel: [m/s^2].
        lateral_offset: As the ego's, in the same lane [m].
        indicator: Its indicator: bit 0 left, bit 1 right, as recorded.
        looming: Speed at which its image grows [rad/s].
        has_next: Whether there is another vehicle ahead of it in the lane.
        return_gap: Gap between those two, where there are [m].
        overtaking_time: Least time to be ahead of it with its reaction distance between, at
            `OwnState.available_accel`; infinite if the ego cannot [s].
        overtaking_distance: Way of the ego in that time [m].
    """

    encounter: Encounter
    kind: U8
    length: F32
    speed: F32
    accel: F32
    lateral_offset: F32
    indicator: U8
    looming: F32
    has_next: Mask
    return_gap: F32
    overtaking_time: F32
    overtaking_distance: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftLane(Batch):
    """The lane to the ego's left; every array has shape (simulation,).

    Attributes:
        exists: Whether there is one; else the others mean nothing.
        front: The ego behind the vehicle ahead in it.
        rear: The vehicle behind in it, behind the ego.
        occupancy: Vehicle lengths within 100 m ahead and behind, over 200 m [1].
        count: Vehicles with their centre in that stretch.
        space_mean_speed: Mean of their speeds, 0 without any [m/s].
        time_mean_speed: Mean of the speeds past a place, 0 without any [m/s].
        crossable: Whether the line to it may be crossed.
    """

    exists: Mask
    front: Encounter
    rear: Encounter
    occupancy: F32
    count: U8
    space_mean_speed: F32
    time_mean_speed: F32
    crossable: Mask


@dataclass(frozen=True, slots=True, kw_only=True)
class Surround(Batch):
    """Road, weather and light; every array has shape (simulation,).

    Attributes:
        on_road: Whether the ego's centre is in a driving lane; else its lane means nothing.
        lane: Lane index, 0 the slowest.
        lanes_to_left: Number of driving lanes on its left.
        lane_width: [m].
        speed_limit: As posted [m/s].
        night: Whether it is night.
        low_sun: Whether the sun stands low ahead.
        rain: Rain rate [mm/h].
        optical_range: Meteorological optical range [m].
        wind: Mean wind speed [m/s].
        friction: Peak friction under the ego [1].
        sight_lit: Distance at which a lit vehicle is seen [m].
        sight_unlit: Distance at which an unlit one is seen [m].
    """

    on_road: Mask
    lane: U8
    lanes_to_left: U8
    lane_width: F32
    speed_limit: F32
    night: Mask
    low_sun: Mask
    rain: F32
    optical_range: F32
    wind: F32
    friction: F32
    sight_lit: F32
    sight_unlit: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class LawAhead(Batch):
    """Margins of the law if the ego moved over now, negative in a breach; shape (simulation,).

    A margin to a vehicle means nothing where that vehicle is not there.

    Attributes:
        follow: L3, gap to the vehicle ahead [m].
        entry_front: L4, gap to the vehicle ahead on the left [m].
        entry_rear: L5, gap to the vehicle behind on the left [m].
        speed: L12, limit of road and vehicle minus speed [m/s].
        stop_lit: L14, sight of the lit minus stopping distance [m].
        stop_unlit: L14s, sight of the unlit minus stopping distance [m].
    """

    follow: F32
    entry_front: F32
    entry_rear: F32
    speed: F32
    stop_lit: F32
    stop_unlit: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class Believed(Batch):
    """What the ego believed when it last decided to pull out.

    Arrays have shape (simulation,), or (simulation, 3) for the vehicle ahead, and the front and the
    rear of the lane on the left.

    Attributes:
        exists: Whether it had decided to; there is nothing to believe of a decision not made.
        age: Time since [s].
        detected: Whether it had noticed each, (simulation, 3); else nothing is said of it.
        gap: To it, from bumper to bumper, (simulation, 3) [m].
        closing_speed: (simulation, 3) [m/s].
    """

    exists: Mask
    age: F32
    detected: Mask
    gap: F32
    closing_speed: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class Decisions(Batch):
    """Features of the decision to overtake: nothing in them is later than `frame`.

    All is true but what is in `believed`.

    Attributes:
        frame: Frame of the attempt, or of the instant that stands for it, shape (simulation,).
        ego: The ego.
        ahead: The vehicle ahead in its lane.
        left: The lane to its left.
        around: Road, weather and light.
        law: What the law would say.
        believed: What the driver believed.
    """

    frame: I32
    ego: OwnState
    ahead: VehicleAhead
    left: LeftLane
    around: Surround
    law: LawAhead
    believed: Believed
