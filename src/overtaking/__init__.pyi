from overtaking.api import branch as branch
from overtaking.api import compare as compare
from overtaking.api import film as film
from overtaking.api import generate as generate
from overtaking.api import label as label
from overtaking.api import load as load
from overtaking.api import plot_validation as plot_validation
from overtaking.api import relabel as relabel
from overtaking.api import resume as resume
from overtaking.api import sample as sample
from overtaking.api import simulate as simulate
from overtaking.api import statistics as statistics
from overtaking.api import validate as validate
from overtaking.api import write_report as write_report
from overtaking.core.errors import OvertakingError as OvertakingError
from overtaking.datasets.balance import Balance as Balance
from overtaking.datasets.load import Dataset as Dataset
from overtaking.labelling.label import Labelled as Labelled
from overtaking.model.drivers import Drivers as Drivers
from overtaking.model.road import Lane as Lane
from overtaking.model.road import Road as Road
from overtaking.model.scenario import Scenario as Scenario
from overtaking.model.trajectory import Trajectories as Trajectories
from overtaking.model.vehicles import VehicleSpecs as VehicleSpecs
from overtaking.model.weather import Weather as Weather
from overtaking.sim.decision import Decision as Decision

__version__: str
