"""How far the air itself lets one see, whatever the lamps."""

from overtaking.core.elementary import F32
from overtaking.model.labels import Case
from overtaking.physics.constants import known
from overtaking.physics.film import rain_rate
from overtaking.physics.visibility import fog_extinction, rain_extinction
from overtaking.rules.once import once


@once
def optical_range(case: Case) -> F32:
    """Meteorological optical range in fog and falling rain, shape (simulation,) [m]."""
    weather = case.trajectories.scenario.weather
    air = fog_extinction(weather.fog) + rain_extinction(rain_rate(weather.rain))
    return known("weather.fog.transmission_depth") / air
