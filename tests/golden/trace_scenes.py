"""Scenes, chosen by what happens in them, whose trace hashes are pinned.

Whoever changes the model on purpose writes the hashes anew and reviews the difference:

    .venv/bin/python -m tests.golden.trace_scenes

The first simulation of each kind in which it happens is taken, so the numbers may change as well.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.validation.passes import (
    LEADER,
    attempts_of_others,
    meeting,
    passes,
)
from overtaking.model.road_course import ZoneKind
from overtaking.model.trajectories import (
    NO_VEHICLE,
    Lights,
    PerceivedVehicle,
    Stage,
    Trajectories,
)
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine
from overtaking.world.road_parameters import road_parameters

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

PINNED = Path(__file__).with_name("trace_hashes.json")
BATCH = 256
MOST = 400 * BATCH
"""A scene that does not happen in this many simulations is too rare to be pinned."""


def done(run: Trajectories) -> NDArray[np.bool_]:
    """The ego has overtaken and is back."""
    return visits(run, Stage.DONE)


def visits(run: Trajectories, stage: Stage) -> NDArray[np.bool_]:
    """The ego is in a stage at some frame."""
    return ((run.stage == stage) & run.frame_mask).any(axis=1)


def ego_hit(run: Trajectories) -> NDArray[np.bool_]:
    """The ego collides."""
    return run.contacts.partner[:, EGO_SLOT] != NO_VEHICLE


def others_hit(run: Trajectories) -> NDArray[np.bool_]:
    """Two others collide with each other, and not with the ego."""
    return (run.contacts.partner != NO_VEHICLE).any(axis=1) & ~ego_hit(run)


def overtakes(run: Trajectories, kind: VehicleKind) -> NDArray[np.bool_]:
    """The ego has overtaken a vehicle of a kind that began ahead of it."""
    return done(run) & (run.scenario.vehicles.kind[:, 1] == kind)


def only(preset: str) -> dict[str, Any]:
    """The change of the profile that leaves one weather."""
    return {"weather.presets": {preset: 1}}


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A kind of scene, and what has to happen in it.

    Attributes:
        name: What it is called.
        happens: Which simulations of a batch show it.
        overrides: Changes of the profile.
        profile: Name of the profile.
        road: Name of the road.
        mirrored: Whether traffic keeps left.
        seed: Seed.
        first: Number of the simulation from which on to look.
    """

    name: str
    happens: Callable[[Trajectories], NDArray[np.bool_]]
    overrides: Mapping[str, Any] = field(default_factory=dict)
    profile: str = "pinto2023-physical"
    road: str = "town06"
    mirrored: bool = False
    seed: int = 1
    first: int = 0

    def run(self, index: NDArray[np.uint64]) -> Trajectories:
        """The simulations of these numbers."""
        road = load_road(self.road)
        road = road.mirror() if self.mirrored else road
        return engine.simulate(
            ScenarioSource(
                load_specification(self.profile, self.overrides), road, self.seed
            ).sample(index)
        )

    def find(self) -> int:
        """Number of the first simulation in which it happens.

        Raises:
            LookupError: It is too rare.
        """
        for begin in range(0, MOST, BATCH):
            index = np.uint64(self.first + begin) + np.arange(BATCH, dtype=np.uint64)
            found = np.flatnonzero(self.happens(self.run(index)))
            if len(found):
                return int(index[found[0]])
        raise LookupError(f"{self.name}: not in {MOST} simulations")


def squeezes(run: Trajectories) -> NDArray[np.bool_]:
    """The ego is back just before the oncomer, and near ahead of the vehicle that it passed."""
    found = np.zeros(len(run.stage), bool)
    for one in passes(run):
        found[one.row] = one.margin < 3.0 and one.left < 0.8
    return found


def gives_up(run: Trajectories) -> NDArray[np.bool_]:
    """The ego falls back behind the vehicle that it was to pass, and goes on following it."""
    first = (run.stage == Stage.ABORT).argmax(axis=1)
    rows = np.arange(len(first))
    target = run.percepts.slot[rows, 0, PerceivedVehicle.LEADER]
    target = np.where(target == NO_VEHICLE, EGO_SLOT, target)
    last = run.num_frames - 1
    behind = run.states.s[rows, 0, last] < run.states.s[rows, target, last]
    follows = run.stage[rows, last] == Stage.FOLLOW
    return visits(run, Stage.ABORT) & follows & behind & comes_within(run, first, 10.0)


def comes_within(
    run: Trajectories, frame: NDArray[np.integer[Any]], time: float
) -> NDArray[np.bool_]:
    """Somebody comes whom the ego would meet within a time, at a frame of each simulation."""
    return meeting(run, np.arange(len(frame)), frame)[0] < time


def head_on(run: Trajectories) -> NDArray[np.bool_]:
    """The ego collides with who comes, in the other lane."""
    rows = np.arange(len(run.stage))
    partner = run.contacts.partner[:, EGO_SLOT]
    other = np.where(partner == NO_VEHICLE, EGO_SLOT, partner)
    comes = run.scenario.start_lane[rows, other] == run.road.num_lanes
    frame = run.contacts.time[:, EGO_SLOT] // run.scenario.frame_interval_ms
    there = run.states.lane[rows, EGO_SLOT, frame.clip(0, run.num_frames - 1)]
    return (partner != NO_VEHICLE) & comes & (there == run.road.num_lanes)


def beyond(run: Trajectories) -> NDArray[np.bool_]:
    """Whether the middle of the ego is in the other lane, (simulation, time)."""
    return (run.states.lane[:, EGO_SLOT] == run.road.num_lanes) & run.frame_mask


def ends_on_a_solid_line(run: Trajectories) -> NDArray[np.bool_]:
    """The ego comes back over a line that it may not cross, and went out where it may."""
    stations, solid, _ = road_parameters(run.road).solid_line
    there = beyond(run)
    first = there.argmax(axis=1)
    last = there.shape[1] - 1 - there[:, ::-1].argmax(axis=1)
    rows = np.arange(len(first))
    marks = [
        solid[np.searchsorted(stations[1:], 1e-3 * run.states.s[rows, 0, at], side="right")]
        for at in (first, last)
    ]
    return done(run) & (marks[0] == 0.0) & (marks[1] > 0.0)


def over_a_crest(run: Trajectories) -> NDArray[np.bool_]:
    """The ego is on the other side where a crest hides who comes."""
    s, course = 1e-3 * run.states.s[:, EGO_SLOT], run.road.course
    crests = [one for one in course.zones if one.kind is ZoneKind.CREST] if course else []
    over = [(s > one.start) & (s < one.stop) for one in crests]
    return done(run) & (beyond(run) & np.any(over, axis=0)).any(axis=1)


def another_passes_the_leader(run: Trajectories) -> NDArray[np.bool_]:
    """Somebody else in the ego's direction passes the vehicle that began ahead of the ego."""
    found = np.zeros(len(run.stage), bool)
    for one in attempts_of_others(run):
        found[one.row] |= one.passed and one.target == LEADER
    return found


def another_gives_up(run: Trajectories) -> NDArray[np.bool_]:
    """Somebody else in the ego's direction falls back, as an oncomer is near."""
    found = np.zeros(len(run.stage), bool)
    for one in attempts_of_others(run):
        found[one.row] |= not one.passed and one.margin < 10.0
    return found


def meets_an_overtaker(run: Trajectories) -> NDArray[np.bool_]:
    """The ego brakes and moves over for who comes in its lane, before it sets out to overtake."""
    lights, brakes = run.states.lights[:, EGO_SLOT], run.states.accel_lon[:, EGO_SLOT] < -2500
    flashes = ((lights & Lights.HIGH_BEAM) > 0) & (run.stage == Stage.FOLLOW)
    aside = run.states.d[:, EGO_SLOT] < -1750 - 400
    return np.logical_and.reduce([one.any(axis=1) for one in (flashes, flashes & brakes, aside)])


FOG = {
    "weather.mode": "independent",
    "weather.rain_probability": 0.0,
    "weather.fog_probability": 1.0,
}
PRESSED = {
    "traffic.held_up": 1.0,
    "traffic.flow_vph": [200.0, 400.0],
    "traffic.slow_share": 0.2,
    "drivers.driving_style": [0.7, 1.0],
}
"""Reckless drivers on a busy two-way road, held up by somebody."""
SCENES = (
    Scene(name="clear-day-overtake", happens=done, overrides=only("ClearNoon")),
    Scene(
        name="clear-night-no-attempt",
        happens=lambda run: ~visits(run, Stage.PULL_OUT),
        overrides=only("ClearNight"),
    ),
    Scene(name="hard-rain-night-collision", happens=ego_hit, overrides=only("HardRainNight")),
    Scene(
        name="hard-rain-noon-aborted",
        happens=lambda run: visits(run, Stage.ABORT),
        overrides=only("HardRainNoon"),
    ),
    Scene(name="low-sun-overtake", happens=done, overrides=only("ClearSunset"), seed=2),
    Scene(name="bicycle-overtaken", happens=lambda run: overtakes(run, VehicleKind.BICYCLE)),
    Scene(name="motorcycle-overtaken", happens=lambda run: overtakes(run, VehicleKind.MOTORCYCLE)),
    Scene(name="truck-overtaken", happens=lambda run: overtakes(run, VehicleKind.TRUCK)),
    Scene(
        name="truck-overtakes-in-the-storm",
        happens=done,
        overrides={**only("HardRainNoon"), "traffic.ego_types": {"T": 1}},
    ),
    Scene(name="others-collide", happens=others_hit, overrides={"starts.allow_doomed": True}),
    Scene(
        name="six-vehicles-two-tries",
        happens=lambda run: (run.percepts.valid & (run.percepts.kind == 0)).sum(axis=1) > 1,
        overrides={"traffic.vehicles": [6, 6]},
    ),
    Scene(name="two-vehicles-overtake", happens=done, overrides={"traffic.vehicles": [2, 2]}),
    Scene(
        name="dense-fog-collision",
        happens=ego_hit,
        overrides={**FOG, "weather.fog_percent": [90.0, 100.0]},
    ),
    Scene(
        name="left-hand-traffic-overtake",
        happens=done,
        mirrored=True,
        overrides={"profile.frame_interval_ms": 100},
    ),
    Scene(
        name="motorway-overtake-at-100-hz",
        happens=done,
        road="motorway",
        overrides={"traffic.spawn_s_m": [50.0, 180.0], "profile.frame_interval_ms": 10},
    ),
    *(
        Scene(name=name, happens=happens, profile="rural", road="rural", overrides=PRESSED)
        for name, happens in (
            ("rural-squeeze", squeezes),
            ("rural-given-up-for-who-comes", gives_up),
            ("rural-ends-on-a-solid-line", ends_on_a_solid_line),
            ("rural-over-a-crest", over_a_crest),
            ("rural-another-gives-up", another_gives_up),
            ("rural-oncomer-in-the-own-lane", meets_an_overtaker),
            ("rural-head-on-collision", head_on),
        )
    ),
    Scene(
        name="rural-another-passes-the-leader",
        happens=another_passes_the_leader,
        profile="rural",
        road="rural",
        overrides={**PRESSED, "traffic.ego_types": {"T": 1}},
    ),
    Scene(name="last-numbers-overtake", happens=done, seed=2**64 - 1, first=2**64 - MOST),
)
"""By what happens in them."""


def hexadecimal(run: Trajectories) -> str:
    """The trace hash of a single simulation, as the command line shows it."""
    return run.trace_hash[0].astype("<u4").tobytes().hex()


def entry(scene: Scene) -> dict[str, Any]:
    """What is pinned of a scene: enough to simulate it again, and what came of it."""
    index = scene.find()
    run = scene.run(np.array([index], np.uint64))
    return {
        "name": scene.name,
        "profile": scene.profile,
        "overrides": dict(scene.overrides),
        "road": scene.road,
        "mirrored": scene.mirrored,
        "seed": scene.seed,
        "index": index,
        "frames": int(run.num_frames[0]),
        "trace_hash": hexadecimal(run),
    }


def main() -> None:
    """Write the pinned hashes anew."""
    lines = [json.dumps(entry(scene)) for scene in SCENES]
    PINNED.write_text("[\n  " + ",\n  ".join(lines) + "\n]\n", encoding="utf-8")
    print(f"{PINNED}: {len(lines)} scenes; review the difference")


if __name__ == "__main__":
    main()
