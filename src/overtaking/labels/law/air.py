"""How far the air itself lets one see, whatever the lamps."""

from overtaking.core.elementary import F32
from overtaking.model.labels import Case
from overtaking.model.once import once
from overtaking.world.conditions import outlook
from overtaking.world.constants import known


@once
def optical_range(case: Case) -> F32:
    """Meteorological optical range in fog and falling rain, shape (simulation,) [m]."""
    sight = outlook(case.trajectories.scenario).sight
    air = sight["fog_extinction"] + sight["rain_extinction"]
    return known("weather.fog.transmission_depth") / air
