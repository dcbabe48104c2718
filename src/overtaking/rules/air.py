"""How far the air itself lets one see, whatever the lamps."""

from overtaking.core.elementary import F32
from overtaking.model.labels import Case
from overtaking.model.once import once
from overtaking.physics.constants import known
from overtaking.sim.world import outlook


@once
def optical_range(case: Case) -> F32:
    """Meteorological optical range in fog and falling rain, shape (simulation,) [m]."""
    sight = outlook(case.trajectories.scenario).sight
    air = sight["fog_extinction"] + sight["rain_extinction"]
    return known("weather.fog.transmission_depth") / air
