"""Weather without rain, wind, fog or night, for branches: `weather.dry(scenario.weather)`."""

from overtaking.model.weather import (
    REMOVABLE_FACTORS,
    bright,
    clear,
    dry,
    still,
    without,
    without_glare,
)

__all__ = [
    "REMOVABLE_FACTORS",
    "bright",
    "clear",
    "dry",
    "still",
    "without",
    "without_glare",
]
