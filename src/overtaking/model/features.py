"""The paper's fifteen features of a simulation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.model.batch import Batch

U8 = NDArray[np.uint8]
I32 = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Features(Batch):
    """Seven static and eight dynamic features; every array has shape (simulation,).

    The paper's names are in brackets. Without a vehicle to overtake, what is about it is 0 and
    `has_target` is false. Waiting time, overtaking time and distance are NaN where the attempt
    began before the recording, what is about the vehicle where it is not recorded in that frame.

    Attributes:
        policy: `paper` or `matched`, how they were measured.
        night: Whether it is night [DN].
        horizon_line: Whether the sun stands low ahead [HL].
        ego_kind: `VehicleKind` of the ego [TE].
        target_kind: `VehicleKind` of the vehicle to overtake [TP].
        has_target: Whether there is one.
        waiting_time: Until the attempt [s] [WT].
        overtaking_time: From the attempt to its end [s] [OT].
        num_vehicles: Vehicles of the simulation, the ego included [NV].
        ego_speed: Speed of the ego [m/s] [SE].
        target_speed: Speed of the vehicle to overtake [m/s] [SP].
        speed_difference: Of ego and target [m/s] [DSEP].
        distance: From ego to target [m] [D].
        left_occupancy: Occupancy of the lane to the left, 0 to 1 [OLR].
        rain: CARLA's precipitation [%] [PREC].
        wind: CARLA's wind intensity [%] [WIND].
        fog: CARLA's fog density [%] [FOG].
        frame: Frame at which they were measured, `NEVER` for means over all frames.
    """

    policy: str
    night: Mask
    horizon_line: Mask
    ego_kind: U8
    target_kind: U8
    has_target: Mask
    waiting_time: F32
    overtaking_time: F32
    num_vehicles: U8
    ego_speed: F32
    target_speed: F32
    speed_difference: F32
    distance: F32
    left_occupancy: F32
    rain: F32
    wind: F32
    fog: F32
    frame: I32
