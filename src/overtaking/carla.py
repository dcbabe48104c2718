"""CARLA: handling limits, replay of simulations, and a server for its clients."""

from overtaking.api.carla import measure_limits as measure_limits
from overtaking.api.carla import replay as replay
from overtaking.api.carla import serve as serve
