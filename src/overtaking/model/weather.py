"""Weather and light of a simulation, in CARLA's terms; `world` derives physical quantities."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from overtaking.core.arrays import F32, U8, Mask
from overtaking.knowledge import presets
from overtaking.model.batch import Batch
from overtaking.model.values import documented, meant, within

NO_PRESET = np.uint8(255)
"""Preset of a weather that is none of the presets."""


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Pushes(Batch):
    """How weather acts where it does not act by physics: as in the study, by pushes and less sight.

    The road is dry, and air, rain and wind do nothing else.
    """

    accel: Annotated[float, within(0.0, 50.0, "m/s^2", "Lateral acceleration of a push")]
    duration: Annotated[float, within(0.05, 10.0, "s", "How long a push lasts")]
    interval: Annotated[
        float, within(0.05, 1000.0, "s", "From one push to the next at 100 % of rain and wind")
    ]
    sight: Annotated[
        float, within(1.0, 1000.0, "m", "Field of vision by night, under clouds, towards the sun")
    ]


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Weather(Batch):
    """Weather of each simulation; every array has shape (simulation,)."""

    preset: Annotated[
        U8,
        within(
            0,
            "preset",
            "",
            "Index into `knowledge.presets()`, or `NO_PRESET` where quantities are drawn alone",
            also=int(NO_PRESET),
        ),
    ]
    cloudiness: Annotated[F32, within(0.0, 100.0, "%", "CARLA's cloudiness")]
    rain: Annotated[F32, within(0.0, 100.0, "%", "CARLA's precipitation")]
    puddles: Annotated[F32, within(0.0, 100.0, "%", "CARLA's precipitation deposits")]
    wind: Annotated[F32, within(0.0, 100.0, "%", "CARLA's wind intensity")]
    wind_direction: Annotated[
        F32,
        within(
            -math.tau,
            math.tau,
            "rad",
            "Where the wind blows to, anticlockwise from the direction of travel",
        ),
    ]
    fog: Annotated[F32, within(0.0, 100.0, "%", "CARLA's fog density")]
    sun_altitude: Annotated[
        F32, within(-1.5708, 1.5708, "rad", "Height of the sun above the horizon")
    ]
    sun_azimuth: Annotated[
        F32, within(-math.tau, math.tau, "rad", "Anticlockwise from the direction of travel")
    ]
    night: Annotated[Mask, meant("Whether it is night")]
    horizon_line: Annotated[Mask, meant("Whether the sun stands low ahead")]

    def sizes(self) -> Mapping[str, int]:
        """How many presets there are."""
        return {"preset": len(presets())}
