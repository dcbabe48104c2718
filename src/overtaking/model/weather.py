"""Weather and light of a simulation, as CARLA's knobs name them; what they mean is in `physics`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.knowledge import presets
from overtaking.model.batch import Batch
from overtaking.model.values import within

NO_PRESET = np.uint8(255)
"""Preset of a weather that is none of the presets."""

_PERCENT = within(0.0, 100.0, "%")
_TURN = within(-math.tau, math.tau, "rad")


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

    preset: NDArray[np.uint8] = field(metadata=within(0, "preset", also=int(NO_PRESET)))
    cloudiness: F32 = field(metadata=_PERCENT)
    rain: F32 = field(metadata=_PERCENT)
    puddles: F32 = field(metadata=_PERCENT)
    wind: F32 = field(metadata=_PERCENT)
    wind_direction: F32 = field(metadata=_TURN)
    fog: F32 = field(metadata=_PERCENT)
    sun_altitude: F32 = field(metadata=within(-1.5708, 1.5708, "rad"))
    sun_azimuth: F32 = field(metadata=_TURN)
    night: Mask
    horizon_line: Mask

    def sizes(self) -> Mapping[str, int]:
        """How many presets there are."""
        return {"preset": len(presets())}
