"""How many completed overtakes are legal, by light, sight and rain.

A label that is impossible in a stratum says more about the stratum than about the driver. Printed
is the share of legal overtakes among those completed, for day and night, three ranges of sight and
three of rain, with Wilson's interval; a stratum fails with a share below 1 % or above 99 %, or with
too few completed. Each stratum is drawn on its own, with weather from its ranges and everything
else as the profile has it: most of them are too rare to wait for.

    python benchmarks/strata.py --profile motorway-risk --each 1024
"""

import math
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from measure import parser
from overtaking.labels.label import label
from overtaking.model.events import Outcome
from overtaking.model.labels import OvertakeClass
from overtaking.recordings.roads import load_road
from overtaking.scenarios import sample, spec
from overtaking.sim import engine
from overtaking.world.film import rain_rate
from overtaking.world.visibility import meteorological_range

PIECE = 64
ENOUGH = 30
Z_95 = 1.96
LIGHTS = {"day": (0.0, 60.0), "night": (-60.0, 0.0)}  # Height of the sun [deg].
SIGHTS = {
    "sight > 1000 m": (1000.0, 10000.0),
    "200-1000 m": (200.0, 1000.0),
    "< 200 m": (50.0, 200.0),
}
RAINS = {"no rain": (0.0, 0.0), "< 7.6 mm/h": (0.0, 7.6), ">= 7.6 mm/h": (7.6, 50.0)}


def percent_of(value: float, to_value: Any) -> float:
    """The percentage that a growing or falling map of the weather takes to a value."""
    grid = np.linspace(0.0, 100.0, 10_001, dtype=np.float32)
    return float(grid[np.abs(to_value(grid) - value).argmin()])


def weather(light: str, sight: str, rain: str) -> dict[str, Any]:
    """Overrides of a profile with weather of a stratum only."""
    near, far = SIGHTS[sight]
    fog = [percent_of(metres, meteorological_range) for metres in (far, near)]
    wet = [percent_of(rate, rain_rate) for rate in RAINS[rain]]
    overrides: dict[str, Any] = {
        "weather.sun_altitude_deg": list(LIGHTS[light]),
        "weather.fog_percent": fog,
        "weather.rain_percent": wet,
        "weather.rain_probability": float(wet[1] > 0.0),
    }
    return overrides | ({} if far > 1000.0 else {"weather.fog_probability": 1.0})


def verdicts(
    profile: str, overrides: dict[str, Any], simulations: int, policy: str
) -> NDArray[np.bool_]:
    """Whether each completed overtake is legal."""
    given = spec(profile, overrides)
    road = load_road(given.road)
    parts: list[NDArray[np.bool_]] = []
    for first in range(0, simulations, PIECE):
        index = np.arange(first, min(first + PIECE, simulations), dtype=np.uint64)
        said = label(engine.simulate(sample(given, road, 3, index))).labels
        legal = said.classes[:, said.policies.index(policy)] == OvertakeClass.SUCCESS_L
        parts.append(legal[said.outcome == Outcome.COMPLETED])
    return np.concatenate(parts)


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Wilson's interval of a share."""
    centre = (hits + Z_95**2 / 2) / (count + Z_95**2)
    half = Z_95 / (count + Z_95**2) * math.sqrt(hits * (count - hits) / count + Z_95**2 / 4)
    return centre - half, centre + half


def row(legal: NDArray[np.bool_]) -> tuple[str, bool]:
    """What to print of a stratum, and whether it fails."""
    count, hits = len(legal), int(legal.sum())
    if count < ENOUGH:
        return f"{count:6d} completed: too few", True
    low, high = wilson(hits, count)
    share = hits / count
    fails = not 0.01 <= share <= 0.99
    interval = f"[{100 * low:.1f}, {100 * high:.1f}]"
    text = f"{count:6d} completed, {100 * share:5.1f} % legal {interval}"
    return f"{text}  OUTSIDE 1-99 %" if fails else text, fails


def main() -> int:
    """Measure and print."""
    arguments = parser(__doc__)
    arguments.add_argument("--profile", default="motorway-risk")
    arguments.add_argument("--each", type=int, default=1024)
    arguments.add_argument("--policy", default="default")
    given = arguments.parse_args()
    failed = 0
    for light in LIGHTS:
        for sight in SIGHTS:
            for rain in RAINS:
                drawn = weather(light, sight, rain)
                text, fails = row(verdicts(given.profile, drawn, given.each, given.policy))
                failed += fails
                print(f"{light:6s}{sight:16s}{rain:12s}{text}", flush=True)
    print(f"{failed} strata fail", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
