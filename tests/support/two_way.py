"""Traffic on a two-way road, written by hand: who passes whom, and who comes."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from overtaking.model.known_roads import known_road
from overtaking.sim import engine
from overtaking.world.step_parameters import step_parameters

from .worlds import Vehicle, body_of, scenario

if TYPE_CHECKING:
    from overtaking.model.road import Road
    from overtaking.model.trajectories import Trajectories

KEEN = {
    "desired_speed": 27.0, "min_speed_gain": 1.0, "patience": 10.0, "lane_change_duration": 4.5,
    "return_time_gap": 0.8, "reaction_time": 0.8, "gap_demand_factor": 0.7,
}  # fmt: skip


@cache
def road(*, is_open: bool = True) -> Road:
    """The rural road; an open one does not limit sight, and its line is broken."""
    rural = known_road("rural").extend_to(8000.0)
    return dataclasses.replace(rural, course=None) if is_open else rural


def pair(*gaps: float, lead: float = 18.0, comes: float = 25.0, **ego: float) -> list[Vehicle]:
    """An ego behind a slower van, and others who come from these distances."""
    others = [
        Vehicle(s=1000.0 + gap, lane=1, speed=comes, driver={"desired_speed": comes})
        for gap in gaps
    ]
    leader = Vehicle(kind="L", s=1035.0, speed=lead, driver={"desired_speed": lead})
    return [Vehicle(s=1000.0, speed=lead + 3.0, driver=KEEN | ego), leader, *others]


def simulated(
    *scenes: list[Vehicle], horizon: float = 25.0, on: Road | None = None
) -> Trajectories:
    world = scenario(*scenes, road=on or road(), horizon=horizon)
    return engine.run(world, step_parameters(world))


def with_another(*gaps: float, comes: float = 25.0, **driver: float) -> list[Vehicle]:
    """The ego follows far behind another, who is held up by a van; others come from distances."""
    ego = Vehicle(s=800.0, speed=17.0, driver={"desired_speed": 17.0})
    another, leader, *others = pair(*gaps, comes=comes, **{"gap_demand_factor": 0.5, **driver})
    return [ego, leader, another, *others]


def with_an_oncomer_that_overtakes(gap: float, **driver: float) -> list[Vehicle]:
    """Somebody who comes from a distance is held up by a van."""
    ego = Vehicle(s=1000.0, speed=22.0, driver={"desired_speed": 22.0})
    another, leader = (
        dataclasses.replace(one, s=1000.0 + gap + (1035.0 - one.s), lane=1)
        for one in pair(**{"gap_demand_factor": 0.5, **driver})
    )
    return [ego, leader, another]


SCENES = (
    with_another(700.0),
    with_another(500.0, comes=60.0, gap_demand_factor=0.2),
    with_an_oncomer_that_overtakes(900.0, gap_demand_factor=0.2),
    pair(300.0),
    pair(900.0, gap_demand_factor=0.0),
    pair(250.0, gap_demand_factor=0.0),
    pair(560.0, 640.0, comes=38.0, gap_demand_factor=0.3),
    pair(),
)


def platoon(room: float, *gaps: float, **ego: float) -> list[Vehicle]:
    """As `pair`, with a second van so far ahead of the first, from bumper to bumper."""
    first, leader, *others = pair(*gaps, **ego)
    length = body_of("L")["length"]
    ahead = Vehicle(
        kind="L", s=leader.s + length + room, speed=17.0, driver={"desired_speed": 17.0}
    )
    return [first, leader, ahead, *others]


def beyond(run: Trajectories, slot: int) -> list[np.ndarray]:
    """Frames in which the middle of a vehicle is in the lane of others, by simulation."""
    away = run.states.lane[:, slot] != run.scenario.start_lane[:, [slot]]
    return [np.flatnonzero(row) for row in away & run.frame_mask]


def in_the_other_lane(run: Trajectories, row: int) -> np.ndarray:
    return np.flatnonzero((run.states.lane[row, 0] == 1) & run.frame_mask[row])
