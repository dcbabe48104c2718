from overtaking.core.errors import OvertakingError as OvertakingError
from overtaking.model.drivers import Drivers as Drivers
from overtaking.model.road import Lane as Lane
from overtaking.model.road import Road as Road
from overtaking.model.scenario import Scenario as Scenario
from overtaking.model.trajectory import Trajectories as Trajectories
from overtaking.model.vehicles import VehicleSpecs as VehicleSpecs
from overtaking.model.weather import Weather as Weather

__version__: str
