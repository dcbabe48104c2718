"""Scenes written by hand, for what drawn ones hardly show: who retreats, is stuck, squeezes in.

A row of numbers goes through what is not known beforehand, so that one of its scenes lies between
what is done and what would be done with any sign or comparison turned round.
"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.model.driver_interface import MAX_ACTION_PARTS, Actions, Move
from overtaking.model.known_roads import known_road
from overtaking.model.road import RoadMark
from overtaking.model.road_course import CentreLineSpan, RoadCourse, SpeedLimitSpan
from overtaking.world.constants import DECISIONS_PER_SECOND, EnabledEffects
from overtaking.world.step_parameters import (
    VEHICLE_FIELDS,
    StepParameters,
    step_parameters,
    with_ring,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from overtaking.model.road import Road
    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectories import Trajectories

    Run = Callable[..., Trajectories]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One simulation written by hand.

    Attributes:
        name: What happens.
        vehicles: Who is there, the ego first. Their drivers may have any parameter of the step.
        weather: What differs from a clear noon.
        moves: What another driver asks of the ego from a time on [s], in the steps of `Actions`.
    """

    name: str
    vehicles: list[Vehicle]
    weather: dict[str, float] = field(default_factory=dict)
    moves: tuple[tuple[float, *tuple[int, ...]], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Written:
    """Scenes on one road, simulated together, as a `situations.Situation`.

    Attributes:
        name: What they are called in a test.
        road: The road.
        scenes: They.
        horizon: How long they take [s].
        effects: Ablations.
        kind: What the moves are, as in `Actions`.
        ring: Length after which the road closes on itself; None if it does not [m].
        first: Number of the first simulation, which decides its random numbers.
    """

    name: str
    road: Road
    scenes: tuple[Scene, ...]
    horizon: float
    effects: EnabledEffects | None = None
    kind: str = "decision"
    ring: float | None = None
    first: int = 0
    switch: None = None
    profile: str = "by hand"

    @property
    def share(self) -> int:
        """How many there are."""
        return len(self.scenes)

    def scenario(self, count: int) -> Scenario:
        """The first `count`; all of them again, with other random numbers, where there are less."""
        index = range(self.first, self.first + count)
        scenes = [self._scene(k) for k in index]
        return scenario(
            *(scene.vehicles for scene in scenes),
            road=self.road,
            weather=[scene.weather for scene in scenes],
            horizon=self.horizon,
            index=index,
        )

    def _scene(self, index: int) -> Scene:
        """The scene of the simulation with a number."""
        return self.scenes[(index - self.first) % self.share]

    def run(self, scenario: Scenario, run: Run) -> Trajectories:
        """Simulate scenarios of this with `engine.run` or `reference.run`."""
        given = self._parameters(scenario)
        if not any(one.moves for one in self.scenes):
            return run(scenario, given)
        return run(scenario, given, actions=self._actions(scenario))

    def _actions(self, scenario: Scenario) -> Actions:
        """What another driver does with the egos."""
        decisions = round(DECISIONS_PER_SECOND * self.horizon)
        values = np.zeros((scenario.num_simulations, decisions, MAX_ACTION_PARTS), np.int32)
        for row, index in zip(values, scenario.scenario_index, strict=True):
            for time, *steps in self._scene(int(index)).moves:
                row[round(DECISIONS_PER_SECOND * time) :, : len(steps)] = steps
        return Actions(kind=self.kind, values=values)

    def _parameters(self, scenario: Scenario) -> StepParameters:
        """Parameters of scenarios, with what the drivers of the scenes have of their own."""
        given = step_parameters(scenario, self.effects)
        if self.ring is not None:
            given = with_ring(given, np.full_like(scenario.horizon, self.ring))
        vehicle = given.vehicle_table.copy()
        for row, index in enumerate(scenario.scenario_index):
            for slot, one in enumerate(self._scene(int(index)).vehicles):
                for name in one.driver.keys() & set(VEHICLE_FIELDS):
                    vehicle[VEHICLE_FIELDS.index(name), slot, row] = one.driver[name]
        return dataclasses.replace(given, vehicle_table=vehicle)


SHARP_EYED = EnabledEffects(distance_error=False, looming=False)
"""Distances and their changes are known, so that a row of numbers is in order."""


# --- Lanes in one direction: whoever is told of drives at 1000 m --------------------------------

LENGTH = 4.4  # Of every car here [m].

ELSEWHERE = Vehicle(s=15_000.0)
"""An ego that is in nobody's way."""

HEEDLESS = {"checks_blind_spot": 0.0, "time_gap": 0.2}
"""Changes lanes without a look over the shoulder, and finds somebody there."""

TAILGATER = {"time_gap": 0.02, "min_gap": 0.3}


def car(s: float, lane: int, speed: float = 25.0, **driver: float) -> Vehicle:
    """A car whose driver keeps its speed and its lane, but for what is said."""
    return Vehicle(s=s, lane=lane, speed=speed, driver={"desired_speed": speed} | driver)


def ahead(gap: float, lane: int, speed: float = 25.0, **driver: float) -> Vehicle:
    """A car so far ahead of one at 1000 m, from bumper to bumper; behind if negative."""
    away = gap + LENGTH if gap > 0 else gap - LENGTH
    return car(1000.0 + away, lane, speed, **driver)


def truck(lane: int, driver: dict[str, float]) -> Vehicle:
    """A truck at 1000 m that would like to be faster."""
    return Vehicle(kind="T", s=1000.0, lane=lane, speed=24.0, driver=driver)


def lane_changes() -> Iterable[Scene]:
    """Others who weigh a lane change, or give one up."""
    eager = {"lane_change_threshold": 0.1, "politeness": 0.0, "keep_right_bias": 0.0}
    yield Scene(
        name="nobody gains on the slow side above 60 km/h",
        vehicles=[ELSEWHERE, car(1000.0, 2, **eager, desired_speed=33.0), ahead(40.0, 2, 20.0)],
    )
    for threshold in np.arange(0.6, 2.2, 0.2):
        weighs = {"politeness": 0.5, "keep_right_bias": 0.0, "safe_decel": 30.0, "decel": 3.0}
        yield Scene(
            name="a truck behind a slow car considers who is coming fast behind it",
            vehicles=[
                ELSEWHERE, truck(0, weighs | {"lane_change_threshold": threshold}),
                ahead(33.0, 0, 18.0), ahead(43.0, 1, 22.0), ahead(-127.0, 1, 37.0),
            ],
        )  # fmt: skip
    for threshold in np.arange(4.4, 6.8, 0.3):
        weighs = {"politeness": 0.8, "keep_right_bias": 2.0, "safe_decel": 9.0}
        yield Scene(
            name="a truck considers letting a follower by",
            vehicles=[
                ELSEWHERE, truck(2, weighs | {"lane_change_threshold": threshold}),
                ahead(46.0, 2, 18.0), ahead(-18.0, 2, 26.0, desired_speed=33.0),
            ],
        )  # fmt: skip

    slow = {"lane_change_threshold": 0.1, "politeness": 0.0, "keep_right_bias": 3.0}
    slow |= {"safe_decel": 0.02, "accel": 0.25, "decel": 0.25}
    for gap in (58.0, 60.0, 62.0, 64.0):
        halted = Vehicle(
            kind="T", s=1000.0 + gap, lane=0, speed=0.0, driver={"desired_speed": 0.01}
        )
        yield Scene(
            name="nobody moves over behind a truck that stands, at walking pace",
            vehicles=[ELSEWHERE, car(1000.0, 1, 5.0, **slow), halted],
        )

    waits = {"lane_change_threshold": 0.1, "politeness": 0.0, "indicator_lead_time": 1.5}
    yield Scene(
        name="two side by side signal for the lane between them",
        vehicles=[
            ELSEWHERE, car(9000.0, 0, **waits, keep_right_bias=-2.0),
            car(9000.0, 2, **waits, keep_right_bias=2.0),
        ],
    )  # fmt: skip
    yield from retreats()


def retreats() -> Iterable[Scene]:
    """Somebody finds another beside in the new lane; the old lane has room, or has not."""
    for old, new in ((0, 1), (1, 0)):
        subject = car(
            1000.0, old, **HEEDLESS, lane_change_threshold=0.1, keep_right_bias=5.0 * (old - new)
        )
        beside = ahead(-2.0, new, **TAILGATER)
        for others in (
            [ahead(60.0, old, 15.0), ahead(-3.0, old, time_gap=0.04)],
            [ahead(-1.0, old, **TAILGATER)],
            [ahead(1.5, old, 25.0), ahead(-40.0, old)],
            *([ahead(8.0, old), ahead(-gap, old, 50.0)] for gap in (100.0, 120.0)),
        ):
            yield Scene(
                name="somebody finds another beside", vehicles=[ELSEWHERE, subject, beside, *others]
            )


def overtakes() -> Iterable[Scene]:
    """Egos on a road of one direction."""
    keen = {"min_speed_gain": 1.0, "desired_speed": 30.0}
    for gap in np.arange(38.0, 58.0, 2.0):
        yield Scene(
            name="the ego lets somebody by whom it would make brake hard",
            vehicles=[
                car(1000.0, 0, 27.0, **keen), ahead(40.0, 0, 20.0), ahead(-gap, 1, 30.0)
            ],
        )  # fmt: skip
    yield Scene(
        name="the ego is stuck beside a faster one, and goes back after 8 s",
        vehicles=[
            Vehicle(
                s=1000.0, speed=25.0, body={"max_speed": 27.0},
                driver=keen,
            ),
            ahead(20.0, 0, 22.0, desired_speed=29.0, accel=2.5),
        ],
    )  # fmt: skip
    for gap in np.arange(56.0, 96.0, 8.0):
        yield Scene(
            name="the ego returns, or passes the next one, too",
            vehicles=[car(1000.0, 0, 27.0, **keen), ahead(20.0, 0, 20.0), ahead(gap, 0, 22.0)],
        )
    heedless = keen | HEEDLESS
    beside = ahead(-2.0, 1, 27.0)
    for gap in (50.0, 60.0, 70.0):
        yield Scene(
            name="the ego finds another beside, and is too near to go back in the rain",
            vehicles=[
                car(1000.0, 0, 27.0, **heedless), ahead(gap, 0, 10.0), beside
            ],
            weather={"rain": 100.0},
        )  # fmt: skip
    ego = Vehicle(
        s=1000.0, speed=24.0, body={"max_speed": 24.0},
        driver=keen | {"checks_blind_spot": 0.0, "accel": 3.0, "decel": 4.0, "safe_decel": 5.0},
    )  # fmt: skip
    target, fog = ahead(28.0, 0, 20.0), {"fog": 100.0, "rain": 100.0}
    for weather, others in (
        ({}, []),
        *((fog, [ahead(gap, 1, 0.5)]) for gap in (310.0, 315.0)),
    ):
        yield Scene(
            name="the ego returns too early, and stays out or cannot",
            vehicles=[ego, target, *others],
            weather=weather,
        )
    comes_in = HEEDLESS | {"lane_change_threshold": 0.1, "keep_right_bias": 5.0, "safe_decel": 30.0}
    comes_in |= {"indicator_lead_time": 9.5, "desired_speed": 23.4}
    for offset in np.arange(-12.0, -5.0, 1.0):
        third = Vehicle(kind="MC", s=1000.0 + offset, lane=2, speed=23.4, driver=comes_in)
        yield Scene(
            name="the ego gives up beside another whom it does not see, while a third comes in",
            vehicles=[
                Vehicle(s=1000.0, speed=24.0, body={"max_speed": 24.0}, driver=heedless),
                ahead(10.0, 0, 18.0, desired_speed=24.0),
                third,
            ],
        )


# --- A lane in each direction -------------------------------------------------------------------

KEEN = {
    "desired_speed": 27.0, "min_speed_gain": 1.0, "patience": 10.0, "lane_change_duration": 4.0,
    "return_time_gap": 0.8, "reaction_time": 0.8,
}  # fmt: skip
BOLD = KEEN | {"gap_demand_factor": 0.1}
"""Spares next to no time."""


def two_way() -> Road:
    """A straight road; lines and sight differ by place and direction, and d begins at an edge."""
    lines = (
        CentreLineSpan(start=2100.0, stop=2250.0, mark=RoadMark.SOLID),
        CentreLineSpan(start=2250.0, stop=2400.0, mark=RoadMark.SOLID_BROKEN),
        CentreLineSpan(start=2400.0, stop=2550.0, mark=RoadMark.BROKEN_SOLID),
    )
    sight = ((3000.0, 1500.0), (3100.0, 260.0), (3600.0, 240.0), (3700.0, 1500.0))
    against = ((3500.0, 1500.0), (3600.0, 280.0), (4000.0, 220.0), (4100.0, 1500.0))
    course = RoadCourse(centre_line_spans=lines, sight=sight, sight_against=against)
    return dataclasses.replace(known_road("rural"), kerb_edge_d=0.4, length=6000.0, course=course)


def oncomer(s: float, speed: float = 25.0, kind: str = "M", **driver: float) -> Vehicle:
    """Who comes the other way."""
    return Vehicle(kind=kind, s=s, lane=1, speed=speed, driver={"desired_speed": speed} | driver)


def pair(
    gap: float, *others: Vehicle, s: float = 1000.0, kind: str = "L", **ego: float
) -> list[Vehicle]:
    """An ego so far behind a slower one, and others."""
    lead = Vehicle(kind=kind, s=s + gap + 5.0, speed=18.0, driver={"desired_speed": 18.0})
    return [Vehicle(s=s, speed=21.0, driver=BOLD | ego), lead, *others]


def along(s: float, speed: float = 18.0, kind: str = "L", **driver: float) -> Vehicle:
    """Who drives the same way as the ego."""
    return Vehicle(kind=kind, s=s, speed=speed, driver={"desired_speed": speed} | driver)


def brakes_behind_the_next() -> Scene:
    """While the ego passes, it would have to brake behind the next vehicle before an oncoming one.

    Only with some random numbers, such as those of simulation 235, does it matter that braking
    shortens the gap to the next vehicle.
    """
    return Scene(
        name="the ego would have to brake behind the next vehicle",
        vehicles=pair(25.0, oncomer(1800.0, 65.0)),
    )


def meetings() -> Iterable[Scene]:
    """Egos before oncoming traffic."""
    for gap in np.arange(200.0, 900.0, 50.0):
        yield Scene(name="somebody comes", vehicles=pair(25.0, oncomer(1000.0 + gap)))
    for gap in np.arange(500.0, 1500.0, 50.0):
        comes = oncomer(1000.0 + gap, 65.0)
        yield Scene(name="somebody comes much faster than is usual", vehicles=pair(25.0, comes))
    for gap in np.arange(600.0, 1200.0, 100.0):
        weak = Vehicle(s=1000.0, speed=20.0, body={"max_speed": 21.3}, driver=BOLD)
        yield Scene(
            name="a weak ego passes slowly",
            vehicles=[weak, along(1027.0), oncomer(1000.0 + gap, 50.0)],
        )
    for s in np.arange(2820.0, 2910.0, 10.0):
        yield Scene(
            name="the ego falls back, and who comes is hidden again",
            vehicles=pair(11.0, oncomer(s + 635.0, 55.0), s=s, passing_time_factor=0.4),
        )
    for room in (9.0, 14.0, 20.0, 30.0, 45.0, 70.0):
        for gap in np.arange(500.0, 1300.0, 100.0):
            yield Scene(
                name="the ego fits in between two, passes both, or is trapped",
                vehicles=pair(25.0, along(1036.0 + room), oncomer(1000.0 + gap, 40.0)),
            )


def views() -> Iterable[Scene]:
    """Egos that see, or may cross, more or less of the road."""
    for gap in np.arange(12.0, 36.0, 4.0):
        for away in (150.0, 250.0, 400.0):
            yield Scene(
                name="a truck hides who comes",
                vehicles=pair(gap, oncomer(1000.0 + away), kind="T"),
            )
    yield from in_bad_light()
    for heeds in (0.0, 1.0):
        for s in (*np.arange(2030.0, 2100.0, 10.0), *np.arange(2100.0, 2600.0, 75.0)):
            yield Scene(
                name="the line may not be crossed, here or soon",
                vehicles=pair(25.0, s=s, heeds_solid_lines=heeds),
            )


def in_bad_light() -> Iterable[Scene]:
    """Oncoming traffic at night and in the rain."""
    for gap in np.arange(150.0, 700.0, 50.0):
        yield Scene(
            name="at night somebody comes",
            vehicles=pair(20.0, oncomer(1000.0 + gap), oncomer(1100.0 + gap, kind="MC")),
            weather={"night": 1.0, "sun_altitude": -0.5},
        )
    for gap in np.arange(300.0, 480.0, 20.0):
        yield Scene(
            name="behind spray somebody comes without lamps",
            vehicles=pair(16.0, oncomer(1000.0 + gap, 18.0, kind="B")),
            weather={"rain": 90.0, "cloudiness": 100.0},
        )


def others_overtake() -> Iterable[Scene]:
    """Others overtake, and the ego is passed, follows, or meets them."""
    goes = BOLD | {"edge_shift_when_passed": 0.0}
    for gap in np.arange(300.0, 1200.0, 100.0):
        first = Vehicle(s=1000.0, speed=21.0, driver=goes)
        second = Vehicle(s=970.0, speed=21.0, driver=goes)
        yield Scene(
            name="others overtake before the ego",
            vehicles=[
                along(940.0, 21.0),
                along(1030.0),
                first,
                second,
                oncomer(1000.0 + gap, 40.0),
            ],
        )
        yield Scene(
            name="who comes overtakes",
            vehicles=[
                along(2300.0, 21.0), oncomer(2300.0 + gap, 18.0, kind="T"),
                oncomer(2330.0 + gap, 21.0, **goes | {"desired_speed": 27.0}),
                oncomer(2360.0 + gap, 21.0, **goes | {"desired_speed": 29.0}),
            ],
        )  # fmt: skip
    for speed in (0.94, 1.0, 1.08):
        yield Scene(
            name="the ego is passed, and makes room, yields or races",
            vehicles=[
                along(1030.0, 18.0, speed_factor_when_passed=speed, edge_shift_when_passed=0.4),
                Vehicle(s=1000.0, speed=21.0, driver=goes),
                along(1100.0, 18.0), oncomer(2000.0),
            ],
        )  # fmt: skip


def rules() -> Iterable[Scene]:
    """Who lets others go first, and who does not count."""
    for time in (0.0, 1.5, 3.0):
        yield Scene(
            name="the leader signals, and goes before its follower",
            vehicles=[
                along(100.0), along(1085.0),
                Vehicle(
                    s=1000.0,
                    speed=18.0,
                    driver=BOLD | {"indicator_lead_time": 3.0, "time_gap": 4.0},
                ),
                Vehicle(s=980.0, speed=19.0, driver=BOLD | {"indicator_lead_time": time}),
            ],
        )  # fmt: skip
    for edge, name in ((0.4 - 0.9, "this"), (7.4 + 0.9, "the other")):
        halted = oncomer(1400.0, 0.0, desired_speed=0.01, start_d=edge)
        yield Scene(name=f"somebody halts beyond {name} edge", vehicles=pair(25.0, halted))
    races = {"desired_speed": 20.0, "accel": 3.0, "speed_factor_when_passed": 1.15, "time_gap": 0.3}
    for gap in np.arange(740.0, 820.0, 5.0):
        ego = Vehicle(s=1000.0, speed=20.0, body={"max_speed": 31.0}, driver=BOLD)
        yield Scene(
            name="the ego squeezes in before one who races",
            vehicles=[
                ego, along(1020.0, 18.0, **races), along(1062.0, 20.0), oncomer(1000.0 + gap, 28.0)
            ],
        )  # fmt: skip
    near = BOLD | {
        "passing_time_factor": 0.4,
        "return_time_gap": 0.1,
        "min_gap": 2.5,
        "time_gap": 0.9,
    }
    for gap in np.arange(550.0, 610.0, 6.0):
        ego = Vehicle(s=1000.0, speed=20.0, body={"max_speed": 29.0}, driver=near)
        yield Scene(
            name="the ego is past one, and gives up beside a slower one",
            vehicles=[ego, along(1030.0), along(1062.0, 10.0), oncomer(1000.0 + gap, 50.0)],
        )


def comes_in() -> Scene:
    """Somebody pulls out before an oncomer."""
    hurried = BOLD | {"passing_time_factor": 0.08, "desired_speed": 30.0, "gap_demand_factor": 0.01}
    return Scene(
        name="somebody comes in the lane of the ego",
        vehicles=[
            along(1450.0), oncomer(1654.0, 18.0, kind="T"),
            oncomer(1678.0, 25.0, **hurried),
        ],
    )  # fmt: skip


def doubts() -> Scene:
    """Somebody who does not signal sets out and gives up, and would like to again."""
    driver = BOLD | {"passing_time_factor": 0.25, "uses_indicator": 0.0, "indicator_lead_time": 1.4}
    return Scene(
        name="somebody sets out, gives up at once, and doubts",
        vehicles=[
            along(1464.0, 23.0), along(1030.0), Vehicle(s=1011.0, speed=23.0, driver=driver),
            oncomer(1500.0), along(1100.0),
        ],
    )  # fmt: skip


def given_up() -> Iterable[Scene]:
    """An ego that another driver lets pull out and fall back."""
    for time in (4.5, 5.0, 5.5, 6.0):
        yield Scene(
            name="the ego is told to fall back, as long as it can",
            vehicles=pair(25.0),
            moves=(
                *((1.0, Move.PULL_OUT), (1.05, Move.KEEP)),
                *((time, Move.CANCEL), (time + 0.05, Move.KEEP)),
            ),
        )


def hidden() -> Scene:
    """Somebody changes lanes slowly, and a truck in the new lane hides the old leader."""
    slow = {"min_speed_gain": 1.0, "desired_speed": 30.0, "lane_change_duration": 11.0}
    slow |= {"time_gap": 0.4, "safe_decel": 30.0, "decel": 8.0, "accel": 3.0}
    slow |= {"reaction_time": 1.3, "gap_demand_factor": 0.2}
    tall = {"desired_speed": 27.0, "start_d": -5.85, "max_speed": 40.0}
    return Scene(
        name="a truck near the line hides the leader of the lane that the ego leaves",
        vehicles=[
            car(1000.0, 0, 26.0, **slow), ahead(38.0, 0, 20.0, start_d=-7.91),
            Vehicle(kind="T", s=1015.2, lane=1, speed=27.0, driver=tall),
            ahead(95.0, 0, 0.0, desired_speed=0.01),
        ],
    )  # fmt: skip


def laps() -> Scene:
    """Two on a ring, each behind the other."""
    return Scene(
        name="the ego is followed by who began far ahead of it",
        vehicles=[car(1000.0, 0, 15.0), ahead(180.0, 0, 20.0)],
    )


def accidents() -> Iterable[Scene]:
    """Bodies that just touch at a corner, and a wreck in the fog."""
    heedless = HEEDLESS | {
        "lane_change_threshold": 0.1,
        "keep_right_bias": -5.0,
        "safe_decel": 30.0,
    }
    unaware = {"reaction_delay": 60.0, "urgent_reaction_delay": 60.0, "attention_range": 0.1}
    for gap, speed, duration in (
        *itertools.product(np.arange(16.0, 20.0, 0.1), (32.0,), (2.5, 3.0)),
        *itertools.product(np.arange(-1.0, 2.0, 0.1), (25.2,), (4.5,)),
        *itertools.product(np.arange(-4.0, -1.0, 0.1), (24.0,), (4.5,)),
    ):
        passes = {"start_d": -4.65, "desired_speed": speed} | unaware
        yield Scene(
            name="somebody touches the corner of a passing truck",
            vehicles=[
                ELSEWHERE, car(1000.0, 0, **heedless, lane_change_duration=duration),
                Vehicle(kind="T", s=1000.0 - gap, lane=1, speed=speed, driver=passes),
            ],
        )  # fmt: skip
    halted = Vehicle(kind="B", s=1150.0, lane=1, speed=0.0, driver={"desired_speed": 0.01})
    for gap in np.arange(190.0, 290.0, 10.0):
        yield Scene(
            name="somebody approaches a wreck in the fog",
            vehicles=[ELSEWHERE, halted, car(1000.0, 1, 30.0), car(1000.0 - gap, 1, 30.0)],
            weather={"fog": 85.0, "night": 1.0, "sun_altitude": -0.5},
        )


def steered() -> Iterable[Scene]:
    """An ego whose wheels another driver turns farther than they go, in tenths of a milliradian."""
    for angle in (-7000, 7000):
        yield Scene(
            name="the ego's wheels are turned too far",
            vehicles=[car(1000.0, 1, 5.0)],
            moves=((0.5, 0, angle),),
        )


# --- Limits that change along the road: from 25 to 15 m/s between 2000 and 2200 m ---------------

LOWER = SpeedLimitSpan(start=2000.0, stop=2200.0, speed=15.0)


def limited(road: Road, *limits: SpeedLimitSpan) -> Road:
    """A road with other limits on the way."""
    course = dataclasses.replace(road.course or RoadCourse(), speed_limit_spans=limits)
    return dataclasses.replace(road, speed_limit=25.0, course=course)


def obedient(gap: float, speed: float = 25.0, respect: float = 1.0, **driver: float) -> Vehicle:
    """A car so far before the lower limit, whose driver would like to be faster."""
    return car(
        LOWER.start - gap,
        1,
        speed,
        **{"desired_speed": 27.0, "speed_limit_compliance": respect} | driver,
    )


def lower_limits() -> Iterable[Scene]:
    """Others who come to a lower limit, drive by it, and leave it; and an ego who overtakes."""
    for gap in (40.0, 150.0, 190.0):
        for respect in (0.4, 1.0):
            yield Scene(
                name="somebody comes to a lower limit",
                vehicles=[ELSEWHERE, obedient(gap, respect=respect)],
            )
    yield Scene(
        name="somebody wants to be slower than any limit",
        vehicles=[ELSEWHERE, obedient(60.0, 14.0, desired_speed=14.5)],
    )
    for caution in (0.5, 1.0):
        for sky in ({"rain": 100.0}, {"rain": 100.0, "fog": 100.0}):
            yield Scene(
                name="somebody comes to a lower limit and slows for the weather, too",
                vehicles=[ELSEWHERE, obedient(150.0, caution=caution, respect=0.6)],
                weather=sky,
            )
    top = {"desired_speed": 40.0, "speed_limit_compliance": 0.2}
    yield Scene(
        name="a truck is as fast as it can be, whatever the limit",
        vehicles=[ELSEWHERE, Vehicle(kind="T", s=1900.0, lane=1, speed=24.0, driver=top)],
    )
    yield Scene(
        name="somebody brakes for the limit no harder than is comfortable",
        vehicles=[ELSEWHERE, obedient(150.0, decel=0.5)],
    )
    yield Scene(
        name="somebody leaves the stretch", vehicles=[ELSEWHERE, obedient(-170.0, speed=15.0)]
    )
    eager = {"lane_change_threshold": 0.1, "politeness": 0.0, "keep_right_bias": 0.0}
    for gap, lane in ((150.0, 1), (15.0, 2)):
        speed = 25.0 if lane == 1 else 16.0
        given = eager | {"desired_speed": 27.0, "speed_limit_compliance": 1.0}
        yield Scene(
            name="nobody changes lanes for the limit",
            vehicles=[ELSEWHERE, car(LOWER.start - gap, lane, speed, **given)],
        )
    for gap in (150.0, 100.0, -50.0):
        yield Scene(
            name="somebody behind a slow car weighs another lane by the limit",
            vehicles=[ELSEWHERE, obedient(gap, 20.0, **eager), obedient(gap - 40.0, 14.0)],
        )
    bold = {"min_speed_gain": 0.5, "desired_speed": 27.0, "speed_limit_compliance": 0.9}
    weak = Vehicle(s=1600.0, lane=1, speed=20.0, body={"max_speed": 26.0}, driver=bold)
    yield Scene(
        name="an ego that is no faster passes before the lower limit",
        vehicles=[weak, car(1630.0, 1, 14.0)],
    )
    for gap, leader in ((400.0, 13.0), (160.0, 13.0), (-20.0, 16.0)):
        yield Scene(
            name="the ego overtakes before the lower limit, and hardly behind it",
            vehicles=[
                obedient(gap, leader + 3.0, **bold),
                car(LOWER.start - gap + 30.0, 1, leader),
            ],
        )


def limits_of_each_way() -> Iterable[Scene]:
    """Both directions of a road, on which only one has a lower limit; and a pass before it."""
    respects = {"desired_speed": 27.0, "speed_limit_compliance": 1.0}
    yield Scene(
        name="who comes slows down, who goes does not",
        vehicles=[along(1900.0, 25.0, **respects), oncomer(2350.0, 25.0, **respects)],
    )
    for gap in (700.0, 300.0):
        yield Scene(
            name="somebody passes before a lower limit",
            vehicles=pair(25.0, oncomer(4000.0), s=4300.0 - gap, speed_limit_compliance=0.8),
        )


WRITTEN = (
    Written(
        name="lane changes by hand",
        road=wide_road(lanes=3),
        scenes=(*lane_changes(), *overtakes()),
        horizon=17.0,
        effects=SHARP_EYED,
    ),
    Written(
        name="accidents by hand",
        road=wide_road(lanes=3),
        scenes=tuple(accidents()),
        horizon=8.0,
        effects=SHARP_EYED,
    ),
    Written(
        name="meetings by hand",
        road=two_way(),
        scenes=(*meetings(), *views(), *others_overtake(), *rules()),
        horizon=14.0,
    ),
    # Neighbours in the same block would hide what happens in these three.
    Written(name="hidden alone", road=wide_road(lanes=3), scenes=(hidden(),), horizon=8.0),
    Written(name="comes in alone", road=two_way(), scenes=(comes_in(),), horizon=6.0),
    Written(name="doubts alone", road=two_way(), scenes=(doubts(),), horizon=12.0),
    Written(
        name="brakes behind the next vehicle",
        road=two_way(),
        scenes=(brakes_behind_the_next(),),
        horizon=14.0,
        first=235,
    ),
    Written(name="given up by hand", road=two_way(), scenes=tuple(given_up()), horizon=9.0),
    Written(
        name="steered by hand",
        road=wide_road(lanes=3),
        scenes=tuple(steered()),
        horizon=3.0,
        kind="accel_steer",
    ),
    Written(
        name="ring by hand",
        road=wide_road(lanes=1),
        scenes=(laps(),),
        horizon=5.0,
        ring=200.0,
    ),
    Written(
        name="limits by hand",
        road=limited(wide_road(lanes=3), LOWER),
        scenes=tuple(lower_limits()),
        horizon=9.0,
        effects=SHARP_EYED,
    ),
    Written(
        name="limits of each way by hand",
        road=limited(
            two_way(),
            SpeedLimitSpan(start=2000.0, stop=2200.0, speed=15.0, direction=-1),
            SpeedLimitSpan(start=4300.0, stop=4500.0, speed=18.0, direction=1),
        ),
        scenes=tuple(limits_of_each_way()),
        horizon=12.0,
    ),
)
"""Each is compared with the reference once."""
