"""Weather and light of a simulation, as CARLA's knobs name them; what they mean is in `physics`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.model.batch import Batch

NO_PRESET = np.uint8(255)
"""Preset of a weather that is none of the presets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Weather(Batch):
    """Weather of each simulation; every array has shape (simulation,).

    Attributes:
        preset: Index into `knowledge.presets()`, or `NO_PRESET` where each quantity was drawn on
            its own.
        cloudiness: 0 to 100 [%].
        rain: CARLA's precipitation, 0 to 100 [%].
        puddles: CARLA's precipitation deposits, 0 to 100 [%].
        wind: CARLA's wind intensity, 0 to 100 [%].
        wind_direction: Where the wind blows to, anticlockwise from the direction of travel [rad].
        fog: CARLA's fog density, 0 to 100 [%].
        sun_altitude: Above the horizon [rad].
        sun_azimuth: Anticlockwise from the direction of travel [rad].
        night: Whether it is night (the paper's DN).
        horizon_line: Whether the sun stands low ahead (the paper's HL).
    """

    preset: NDArray[np.uint8]
    cloudiness: F32
    rain: F32
    puddles: F32
    wind: F32
    wind_direction: F32
    fog: F32
    sun_altitude: F32
    sun_azimuth: F32
    night: Mask
    horizon_line: Mask
