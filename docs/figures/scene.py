"""The simulation that the picture shows, in metres and seconds, and how it is chosen."""

from __future__ import annotations

import numpy as np

import overtaking as ot
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind, Stage
from overtaking.model.vehicles import EGO_SLOT, VehicleKind

PROFILE, SEED = "pinto2023-physical", 1
POOL, PIECE = 20_000, 1000  # Simulations that are looked through, and how many at a time.
BEHIND, AHEAD = 58.0, 108.0  # Metres of road that are shown around the overtaken vehicle.


class Scene:
    """One recorded simulation in metres and seconds, from its start to the end of the overtake."""

    def __init__(self, run: ot.Trajectories, number: int) -> None:
        """Convert a batch of one."""
        self.run, self.number = run, number
        count = int(run.num_frames[0])
        self.time = run.time_ms[:count] / 1000.0
        self.stage = run.stage[0, :count]
        states = run.states
        self.s, self.d = (a[0, :, :count].astype(float) / 1000.0 for a in (states.s, states.d))
        self.speed = states.speed[0, :, :count] * 3.6e-3
        self.heading = states.heading[0, :, :count] * 1e-4 - run.road.heading
        self.lights = states.lights[0, :, :count]
        bodies = run.scenario.vehicles
        self.slots: list[int] = np.flatnonzero(bodies.valid[0]).tolist()
        self.length, self.width = bodies.length[0].astype(float), bodies.width[0].astype(float)
        self.kinds = [VehicleKind(int(kind)).code for kind in bodies.kind[0]]
        self.target = int(run.percepts.slot[0, 0, 0])

    @property
    def offset(self) -> np.ndarray:
        """How far the ego is ahead of the overtaken vehicle, centre to centre [m]."""
        return self.s[EGO_SLOT] - self.s[self.target]

    @property
    def reach(self) -> float:
        """Distance of their centres at which the two touch [m]."""
        return 0.5 * (self.length[EGO_SLOT] + self.length[self.target])

    def first(self, stage: Stage) -> int:
        """First frame of a stage, -1 if there is none."""
        found = np.flatnonzero(self.stage == stage)
        return int(found[0]) if len(found) else -1

    def moments(self) -> list[tuple[str, int]]:
        """What is drawn from above: a caption and a frame."""
        out, back, done = (self.first(s) for s in (Stage.PULL_OUT, Stage.RETURN, Stage.DONE))
        crossing = out + int(np.argmin(np.abs(self._across(out, self.first(Stage.PASS)))))
        beside = int(np.argmin(np.abs(self.offset)))
        captions = ("pulls out", "crosses", "alongside", "returns", "done")
        return list(zip(captions, (out, crossing, beside, back, done), strict=True))

    def _across(self, start: int, stop: int) -> np.ndarray:
        """Distance of the ego from the middle of its way across [m]."""
        d = self.d[EGO_SLOT]
        return d[start:stop] - 0.5 * (d[start] + d[stop])

    def belief(self, kind: ManoeuvreKind, column: int) -> tuple[float, float] | None:
        """Time of a decision and the gap that the ego then believed in, None if it saw nobody."""
        percepts = self.run.percepts
        rows = np.flatnonzero(percepts.valid[0] & (percepts.kind[0] == kind))
        if not len(rows) or percepts.slot[0, rows[0], column] != self.target:
            return None
        if not percepts.is_detected[0, rows[0], column]:
            return None
        return percepts.time[0, rows[0]] / 1000.0, percepts.gap[0, rows[0], column] / 1000.0


def is_telling(scene: Scene) -> bool:
    """Whether a car passes a truck that keeps its lane, in the rain and among others."""
    stages = [Stage(int(s)) for s in scene.stage[np.flatnonzero(np.diff(scene.stage, prepend=9))]]
    wanted = [Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE]
    if stages != wanted or scene.target == NO_VEHICLE or "B" in scene.kinds:
        return False
    frames = [frame for _, frame in scene.moments()]
    keeps_lane = np.ptp(scene.d[scene.target, : frames[-1]]) < 1.0
    spread = min(np.diff(scene.time[frames])) > 1.0
    near = [
        _is_in_view(scene, slot, frames) for slot in scene.slots if slot not in (0, scene.target)
    ]
    rains = scene.run.scenario.weather.rain[0] > 0
    passes = scene.kinds[EGO_SLOT] in "SML" and scene.kinds[scene.target] == "T"
    return bool(passes and rains and keeps_lane and spread and sum(near) >= 2)


def _is_in_view(scene: Scene, slot: int, frames: list[int]) -> bool:
    """Whether a vehicle is in most of the views from above."""
    ahead = scene.s[slot, frames] - scene.s[scene.target, frames]
    return int(((ahead > -BEHIND) & (ahead < AHEAD)).sum()) > len(frames) // 2


def chosen() -> Scene:
    """The first telling simulation."""
    for first in range(0, POOL, PIECE):
        runs = ot.simulate(
            ot.sample(PROFILE, num_simulations=PIECE, seed=SEED, first_scenario=first)
        )
        for row in np.flatnonzero((runs.stage == Stage.DONE).any(axis=1)):
            scene = Scene(runs.select(slice(row, row + 1)), first + int(row))
            if is_telling(scene):
                return scene
    raise SystemExit("docs/figures/scene.py: no simulation is telling; ask less in is_telling")
