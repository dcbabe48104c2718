"""Scenes that together make the model do everything that it can do, and how two runs are compared.

Also a program, so that a test can look at what another process simulates, with other threads or
another SIMD level: `python -m tests.reference.situations 8` prints a digest of every situation.
"""

from __future__ import annotations

import dataclasses
import hashlib
import sys
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.reference.scenes import WRITTEN
from tests.support.bends import BENDS, HILLS, on

from overtaking.model.batch import Batch
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource, extend_road
from overtaking.sim import engine
from overtaking.sim.branching import ForcedDecision
from overtaking.world.step_parameters import SIMULATION_FIELDS, ParameterSwitch, step_parameters

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectories import Trajectories
    from overtaking.model.weather import Weather
    from overtaking.world.step_parameters import StepParameters

    Run = Callable[..., Trajectories]


SMALL = 240
"""Simulations of all situations together in a test."""

ROUGH = {
    "weather.mode": "independent",
    "weather.rain_probability": 0.8,
    "weather.rain_percent": [50.0, 100.0],
    "weather.puddles_percent": [60.0, 100.0],
    "weather.wind_percent": [60.0, 100.0],
    "weather.fog_probability": 0.4,
    "weather.fog_percent": [30.0, 100.0],
    "drivers.driving_style": [0.6, 1.0],
    "starts.allow_doomed": True,
    "starts.min_gap_m": 3.0,
    "traffic.vehicles": [4, 6],
}
"""Storm, standing water, fog, reckless drivers close together: collisions, aborts, aquaplaning."""

BRANCHED = {
    "time.horizon_s": 15.0,
    "traffic.vehicles": [2, 5],
    "starts.allow_doomed": True,
    "drivers.fixed": {
        "return_time_gap_s": 0.2,
        "gap_demand_factor": 1.2,
        "time_gap_s": 1.8,
        "safe_decel_mps2": 0.3,
    },
}
"""Egos that pull out late and return early, so that a forced decision changes much."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Situation:
    """A kind of scene.

    Attributes:
        name: What it is called in a test.
        profile: Name of the profile, or path of its file.
        road: Name of the road.
        mirrored: Whether traffic keeps left.
        winds: Whether the road bends and rises.
        heading: Direction of the road, None for its own [rad].
        seed: Seed of its random numbers.
        first: Number of its first simulation.
        share: Simulations out of `SMALL`.
        switch: Step at which decisions and weather change, as in a branch; None if they do not.
        overrides: Changes of the profile.
        numbers: Simulations that come before the others, because something rare happens in them.
        placed: What moves the vehicles to where they shall start; None leaves them.
    """

    name: str
    profile: str = "pinto2023-physical"
    road: str = "town06"
    mirrored: bool = False
    winds: bool = False
    heading: float | None = None
    seed: int = 1
    first: int = 0
    share: int
    switch: int | None = None
    overrides: Mapping[str, Any] = field(default_factory=dict)
    numbers: tuple[int, ...] = ()
    placed: Callable[[Scenario], Scenario] | None = None

    def scenario(self, count: int) -> Scenario:
        """The first `count` scenarios."""
        road = load_road(self.road)
        plan = load_specification(self.profile, self.overrides)
        if self.winds:
            road = on(extend_road(plan, road), *BENDS, grade=HILLS)
            # Not even the line between two directions is the reference line.
            road = dataclasses.replace(road, kerb_edge_d=road.kerb_edge_d + 0.7)
        road = road.mirror() if self.mirrored else road
        if self.heading is not None:
            road = dataclasses.replace(road, heading=self.heading)
        rest = np.uint64(self.first) + np.arange(count, dtype=np.uint64)
        index = np.concatenate([np.array(self.numbers, np.uint64), rest])[:count]
        drawn = ScenarioSource(plan, road, self.seed).sample(index)
        return self.placed(drawn) if self.placed else drawn

    def run(self, scenario: Scenario, run: Run) -> Trajectories:
        """Simulate a part of the scenarios with `engine.run` or `reference.run`."""
        given = step_parameters(scenario)
        if self.switch is None:
            return run(scenario, given)
        return run(scenario, given, [ParameterSwitch(self.switch, disturbed(scenario))])


def in_a_gap(scenario: Scenario) -> Scenario:
    """Vehicle 2 thinks about the lane beside it, and owes something to the one behind.

    In half of the scenes it would move to the fast side in front of vehicle 5, which follows 4; in
    the others it would move out of the way of 5 to the slow side, behind 3. The distance to 3 grows
    from scene to scene, so that in some of them the politeness decides.
    """
    turn = (scenario.scenario_index % 24).astype(np.float32)
    goes_out = turn < 12
    lead = np.float32(0.4) * turn + np.where(goes_out, np.float32(12.0), np.float32(17.7))
    front = np.where(goes_out, np.float32(21.0), np.float32(40.0))
    length = scenario.vehicles.length
    start, lane = scenario.start_s.copy(), scenario.start_lane.copy()
    start[:, 0], start[:, 1], start[:, 2] = 60.0, 120.0, 240.0
    for slot, gap in ((3, lead), (4, front), (5, np.float32(-21.0))):
        body = np.float32(0.5) * (length[:, 2] + length[:, slot])
        start[:, slot] = start[:, 2] + gap + np.copysign(body, gap)
    lane[:, :2] = 0
    lane[:, 2] = np.where(goes_out, 0, 2)
    lane[:, 3] = np.where(goes_out, 0, 1)
    lane[:, 4:] = np.where(goes_out, 1, 2)[:, None]
    speed = np.full_like(scenario.start_speed, np.float32(18.0))
    speed[:, 4] = np.where(goes_out, np.float32(16.5), np.float32(14.0))
    drivers = scenario.drivers
    owed = np.where(goes_out, np.float32(1.0), np.float32(0.3))[:, None]
    drivers = drivers.replace(politeness=owed + np.float32(0.0) * drivers.politeness)
    limit = scenario.vehicles.max_speed.copy()
    limit[:, 0] = 17.2  # The ego begins above its governor.
    vehicles = scenario.vehicles.replace(max_speed=limit)
    placed = scenario.replace(start_s=start, start_lane=lane, start_speed=speed)
    return placed.replace(vehicles=vehicles, drivers=drivers)


def before_oncomers(scenario: Scenario) -> Scenario:
    """The nearest vehicle that comes is 60 to 440 m ahead of the ego, the others behind it."""
    comes = scenario.vehicles.valid & (scenario.start_lane == 1)
    ahead = np.where(comes, scenario.start_s - scenario.start_s[:, :1], np.float32(np.inf))
    nearest = np.where(ahead > 0, ahead, np.float32(np.inf)).min(axis=1, keepdims=True)
    wanted = np.float32(60.0) + np.float32(20.0) * (scenario.scenario_index % 20).astype(np.float32)
    shift = np.where(np.isfinite(nearest), wanted[:, None] - nearest, np.float32(0.0))
    return scenario.replace(start_s=np.where(comes, scenario.start_s + shift, scenario.start_s))


SITUATIONS = (
    Situation(
        name="study",
        share=56,
        numbers=(101, 161, 544, 746, 1047, 2066),
        overrides={"time.horizon_s": 10.0},
    ),
    Situation(
        name="storm",
        seed=2**64 - 1,
        first=2**32 - 20,
        share=40,
        overrides={**ROUGH, "time.horizon_s": 6.0, "time.attempt_deadline_s": 5.0}
        | {"profile.frame_interval_ms": 10},
    ),
    Situation(
        name="left-hand traffic",
        mirrored=True,
        heading=3.14159,  # Vehicles turn across the seam of angles.
        seed=2**63 + 12345,
        first=2**64 - 5000,
        share=24,
        overrides={"time.horizon_s": 8.0, "profile.frame_interval_ms": 100}
        | {"traffic.spawn_s_m": [100.0, 230.0]}
        | {
            "traffic.types": {"T": 2, "MC": 1, "B": 1, "V": 1},
            "traffic.ego_types": {"T": 1, "S": 2},
        }
        | {"weather.presets": {"HardRainNoon": 1, "ClearSunset": 1}},
    ),
    Situation(
        name="slow motorway",
        road="motorway",
        seed=3,
        share=24,
        overrides={"time.horizon_s": 6.0, "time.attempt_deadline_s": 6.0}
        | {"traffic.vehicles": [6, 8], "traffic.speed_kmh": [50.0, 66.0]}
        | {"traffic.leader_speed_kmh": [50.0, 55.0], "traffic.spawn_s_m": [50.0, 150.0]}
        | {"starts.min_gap_m": 3.0, "starts.allow_doomed": True}
        | {"drivers.fixed": {"lane_change_threshold_mps2": 0.02, "keep_right_bias_mps2": 0.0}},
    ),
    Situation(
        name="branched",
        seed=5,
        first=2**40,
        share=24,
        switch=100,
        numbers=(1099511627976, 1099511627952, 1099511627811),
        overrides=BRANCHED,
    ),
    Situation(
        name="gap",
        road="motorway",
        seed=8,
        share=72,
        placed=in_a_gap,
        overrides={"time.horizon_s": 3.0, "time.attempt_deadline_s": 3.0}
        | {"traffic.vehicles": [6, 6], "traffic.types": {"S": 1}, "traffic.ego_types": {"S": 1}}
        | {"traffic.spawn_s_m": [50.0, 400.0], "weather.presets": {"ClearNoon": 1}}
        | {
            "drivers.fixed": {"time_gap_s": 3.0, "accel_mps2": 1.4, "decel_mps2": 2.0}
            | {"lane_change_threshold_mps2": 0.0, "safe_decel_mps2": 20.0}
        },
    ),
)
"""Everything: every vehicle type, 2 to 8 vehicles, both traffic sides, three frame intervals, both
roads, large seeds and numbers, branches; what happens in them is in `test_engine`."""


FURTHER = (
    Situation(name="told and pushed", profile="pinto2023", seed=8, share=48),
    Situation(
        name="traffic as it is met",
        profile="motorway",
        road="motorway",
        seed=9,
        share=17,
        overrides={"time.horizon_s": 12.0, "time.attempt_deadline_s": 12.0},
    ),
    Situation(
        name="enriched traffic",
        profile="motorway-risk",
        road="motorway",
        seed=9,
        share=17,
        overrides={"time.horizon_s": 12.0, "time.attempt_deadline_s": 12.0},
    ),
    Situation(
        name="all forced",
        seed=5,
        share=16,
        switch=100,
        # One simulation fills a whole block: where another driver of the block checks its mirrors,
        # the engine searches all neighbours of this ego anyway.
        numbers=(1099511627868,) * 16,
        overrides=BRANCHED,
    ),
    Situation(
        name="two directions",
        profile="rural",
        road="rural",
        seed=3,
        share=7,
        numbers=(20, 36, 112, 145, 183, 250, 456),
        overrides={"time.horizon_s": 12.0, "time.attempt_deadline_s": 11.0}
        | {"traffic.held_up": 1.0, "weather.wind_percent": [40.0, 100.0]}
        | {"weather.puddles_percent": [60.0, 100.0]},
    ),
    Situation(
        name="bends and crests",
        road="motorway",
        winds=True,
        seed=11,
        share=32,
        overrides={**ROUGH, "time.horizon_s": 7.0, "time.attempt_deadline_s": 6.0}
        | {"traffic.spawn_s_m": [330.0, 700.0], "traffic.types": {"MC": 1, "T": 1, "M": 2}},
    ),
    Situation(
        name="forced to meet",
        profile="rural",
        road="rural",
        winds=True,
        seed=13,
        share=41,
        switch=60,
        numbers=(321,),
        placed=before_oncomers,
        overrides={"time.horizon_s": 4.5, "time.attempt_deadline_s": 4.0}
        | {"traffic.held_up": 1.0, "traffic.start_s_m": [350.0, 1000.0]}
        | {"traffic.types": {"M": 4, "T": 5, "MC": 1}, "weather.fog_probability": 0.5},
    ),
)
"""Other populations and kinds of traffic, each compared with the reference once."""

EVERY = (*SITUATIONS, *FURTHER, *WRITTEN)


def turned_round(weather: Weather) -> Weather:
    """Rain for sunshine, storm for calm, night for day, and other fog."""
    return weather.replace(
        rain=np.float32(100.0) - weather.rain,
        puddles=np.float32(100.0) - weather.puddles,
        wind=np.float32(100.0) - weather.wind,
        # Fog reaches 100, and branches refuse a negative one.
        fog=np.abs(np.float32(70.0) - weather.fog),
        night=~weather.night,
    )


def disturbed(scenario: Scenario) -> StepParameters:
    """Parameters with the weather turned round and a decision forced that the number chooses."""
    later = step_parameters(scenario.replace(weather=turned_round(scenario.weather)))
    simulation = later.simulation_table.copy()
    simulation[SIMULATION_FIELDS.index("forced_decision")] = scenario.scenario_index % len(
        ForcedDecision
    )
    return dataclasses.replace(later, simulation_table=simulation)


def arrays(batch: Batch, prefix: str = "") -> dict[str, NDArray[Any]]:
    """Every recorded array of a batch by its dotted name; the scenario is not recorded."""
    found: dict[str, NDArray[Any]] = {}
    for each in dataclasses.fields(batch):  # type: ignore[arg-type]
        value = getattr(batch, each.name)
        if isinstance(value, np.ndarray):
            found[prefix + each.name] = value
        elif isinstance(value, Batch) and each.name != "scenario":
            found |= arrays(value, f"{prefix}{each.name}.")
    return found


def difference(one: Trajectories, other: Trajectories) -> str:
    """The first difference between two runs, in words; empty if every array has the same bits."""
    left, right = arrays(one), arrays(other)
    for name, values in left.items():
        against = right[name]
        if (values.dtype, values.shape) != (against.dtype, against.shape):
            return f"{name}: {values.dtype}{values.shape} against {against.dtype}{against.shape}"
        where = np.argwhere(values != against)
        if len(where):
            at = tuple(int(number) for number in where[0])
            text = f"{name}{list(at)}: {values[at]} against {against[at]}"
            simulations = np.unique(where[:, 0]).tolist()
            return f"{text}, and {len(where) - 1} more; simulations {simulations}"
    return ""


def digest(run: Trajectories) -> str:
    """SHA-256 of every recorded array, with names, types and shapes."""
    total = hashlib.sha256()
    for name, values in arrays(run).items():
        total.update(f"{name} {values.dtype.str} {values.shape}".encode())
        total.update(np.ascontiguousarray(values).tobytes())
    return total.hexdigest()


def digests(scale: int) -> list[str]:
    """One line for each situation, simulated by the engine with `scale` times its share."""
    lines: list[str] = []
    for situation in SITUATIONS:
        scenario = situation.scenario(situation.share * scale)
        lines.append(f"{situation.name} {digest(situation.run(scenario, engine.run))}")
    return lines


if __name__ == "__main__":
    print("\n".join(digests(int(sys.argv[1]))))
