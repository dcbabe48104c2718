"""How many completed overtakes are legal, by light, sight and rain.

A label that is impossible in a stratum says more about the stratum than about the driver. Printed
is the share of legal overtakes among those completed, for day and night, three ranges of sight and
three of rain, with Wilson's interval; a stratum fails with a share below 1 % or above 99 %, or with
too few completed. Each stratum is drawn on its own, with weather from its ranges and everything
else as the profile has it: most of them are too rare to wait for. With --classes the share of each
class among all simulations is printed as a table, and a stratum fails that lacks one of the five.

    python benchmarks/strata.py --profile motorway-risk --each 1024
    python benchmarks/strata.py --profile rural rural-risk --each 512 --classes
"""

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from measure import parser
from overtaking.analysis.stats.weighted_statistics import wilson_interval
from overtaking.labels.labelling import label
from overtaking.model.batch import concatenate
from overtaking.model.overtake_events import Outcome
from overtaking.model.verdicts import Labels, OvertakeClass
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine
from overtaking.world.road_surface import rain_rate
from overtaking.world.visibility import meteorological_range

PIECE = 256
ENOUGH = 30
STUDIED = tuple(OvertakeClass)[: OvertakeClass.UNSUCCESS_NCOL + 1]
"""The study's five classes."""
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


def labels_of(profile: str, overrides: dict[str, Any], simulations: int) -> Labels:
    """The labels of some simulations."""
    given = load_specification(profile, overrides)
    road = load_road(given.road)
    return concatenate(
        [
            label(engine.simulate(ScenarioSource(given, road, 3).sample(piece))).labels
            for piece in np.split(
                np.arange(simulations, dtype=np.uint64), range(PIECE, simulations, PIECE)
            )
        ]
    )


def verdicts(said: Labels, policy: str) -> NDArray[np.bool_]:
    """Whether each completed overtake is legal."""
    legal = said.classes[:, said.policies.index(policy)] == OvertakeClass.SUCCESS_L
    return legal[said.outcome == Outcome.COMPLETED]


def row(legal: NDArray[np.bool_]) -> tuple[str, bool]:
    """What to print of a stratum, and whether it fails."""
    count, hits = len(legal), int(legal.sum())
    if count < ENOUGH:
        return f"{count:6d} completed: too few", True
    low, high = wilson_interval(hits / count, count)
    share = hits / count
    fails = not 0.01 <= share <= 0.99
    interval = f"[{100 * low:.1f}, {100 * high:.1f}]"
    text = f"{count:6d} completed, {100 * share:5.1f} % legal {interval}"
    return f"{text}  OUTSIDE 1-99 %" if fails else text, fails


def classes_row(said: Labels, policy: str) -> tuple[str, bool]:
    """Number and share of each of the study's classes, and whether one is missing."""
    found = said.classes[:, said.policies.index(policy)]
    counts = [int((found == kind).sum()) for kind in STUDIED]
    cells = [f"{count:,} ({shares(count, len(found))})" for count in counts]
    return " | ".join(cells), not all(counts)


def shares(hits: int, count: int) -> str:
    """The interval of a share in percent; what it is below where there is none."""
    low, high = (100.0 * end for end in wilson_interval(hits / count, count))
    return f"{low:.2f} to {high:.2f} %" if hits else f"below {high:.2f} %"


def main() -> int:
    """Measure and print."""
    arguments = parser(__doc__)
    arguments.add_argument("--profile", nargs="+", default=["motorway-risk"])
    arguments.add_argument("--each", type=int, default=1024)
    arguments.add_argument("--policy", default="default")
    arguments.add_argument("--classes", action="store_true")
    given = arguments.parse_args()
    failed = 0
    if given.classes:
        print("| light | sight | rain | " + " | ".join(kind.title for kind in STUDIED) + " |")
        print("|---|---|---" + "|--:" * len(STUDIED) + "|")
    for light in LIGHTS:
        for sight in SIGHTS:
            for rain in RAINS:
                drawn = weather(light, sight, rain)
                said = concatenate([labels_of(one, drawn, given.each) for one in given.profile])
                if given.classes:
                    text, fails = classes_row(said, given.policy)
                    print(f"| {light} | {sight} | {rain} | {text} |", flush=True)
                else:
                    text, fails = row(verdicts(said, given.policy))
                    print(f"{light:6s}{sight:16s}{rain:12s}{text}", flush=True)
                failed += fails
    print(f"{failed} strata fail", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
