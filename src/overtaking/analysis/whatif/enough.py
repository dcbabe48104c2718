"""Changes of one quantity that would have made a simulation lawful or safe, each simulated.

Of a stated list of quantities, each is changed alone in steps of its unit, and the smallest change
that is enough is told. Many may be; none of them is the cause.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.whatif.beliefs import Percept
from overtaking.analysis.whatif.scenes import Scene, class_of, pull_out
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ConfigError, check_choice
from overtaking.core.units import mps_from_kmh
from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.labels.law.judging import choose_policy
from overtaking.labels.law.judging import stored_policy as policy_named
from overtaking.model.batch import concatenate
from overtaking.model.scenario import ForcedDecision, Intervention, Scenario
from overtaking.model.vehicles import EGO_SLOT, TRAIT_RANGES
from overtaking.model.verdicts import OvertakeClass
from overtaking.sim import engine
from overtaking.sim.branching import apply_intervention, branch
from overtaking.world.road_parameters import has_two_directions

ACCIDENTS = (OvertakeClass.UNSUCCESS_COL, OvertakeClass.UNSUCCESS_DEP)

GOALS = {
    "lawful": (OvertakeClass.SUCCESS_L,),
    "safe": tuple(one for one in OvertakeClass if one not in ACCIDENTS),
}
"""Classes that are meant by each goal."""

Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """Something that can be changed alone.

    Attributes:
        name: What it is, for people.
        unit: Unit of the changes.
        steps: Changes that are tried, in this unit.
        change: The change of the simulation for one of them; None for a start at another time.
    """

    name: str
    unit: str
    steps: Values
    change: Callable[[Scenario, float], Intervention] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Sufficient(ContentEquality):
    """What was found of one quantity.

    Attributes:
        name: What it is.
        unit: Unit of the numbers that follow.
        least: Smallest change that is enough; None if none of those that were tried is.
        becomes: Class of the simulation with it; of the one as it was if there is none.
        tried: Smallest and largest change that were tried; None if none can be made.
        larger: Share of the larger changes in the same direction that are enough, too; NaN without
            any.
    """

    name: str
    unit: str
    least: float | None
    becomes: str
    tried: tuple[float, float] | None
    larger: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Enough(ContentEquality):
    """What would have been enough.

    Attributes:
        number: Number of the simulation in its data set.
        goal: A name in `GOALS`.
        policy: The policy that decides about the class.
        was: The class as it was.
        found: One for each quantity, in the order of the list.
        simulated: Simulations that were tried.
    """

    number: int
    goal: str
    policy: str
    was: str
    found: tuple[Sufficient, ...]
    simulated: int


def enough_of(
    scene: Scene,
    *,
    goal: str = "lawful",
    policy: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Enough:
    """The changes of one quantity that would have been enough.

    Args:
        scene: The simulation.
        goal: `lawful`: completed without breaking a rule that the policy requires; `safe`: without
            collision, and on the road.
        policy: Which rules decide; None for the default of the profile.
        progress: Called with the number of quantities that are done, and of all.

    Raises:
        ConfigError: There is no such goal or policy, the simulation is a branch, or it has reached
            the goal as it was.
    """
    check_choice(goal, GOALS, what="goal", where="enough")
    policy = choose_policy(policy, scene.scenario.profile)
    policy_named(policy)
    was = class_of(label(scene.run), policy)
    if scene.run.branch_origin is not None:
        raise ConfigError(
            what="simulation",
            where="enough",
            expected="one as it was drawn",
            got="a branch",
            next_step="take what it branches from",
        )
    if was in [one.title for one in GOALS[goal]]:
        raise ConfigError(
            what="simulation",
            where="enough",
            expected=f"one that was not {goal}",
            got=was,
            next_step="choose another simulation or --goal",
        )
    listed = list(quantities(scene))
    found: list[Sufficient] = []
    for done, one in enumerate(listed):
        found.append(_found(one, *_classes(scene, one, policy), goal, was))
        if progress is not None:
            progress(done + 1, len(listed))
    return Enough(
        number=scene.number,
        goal=goal,
        policy=policy,
        was=was,
        found=tuple(found),
        simulated=sum(len(one.steps) for one in listed),
    )


def quantities(scene: Scene) -> Iterator[Quantity]:
    """The list: the ego's driver, the vehicles that it decides about, the weather, the start."""
    two_way = has_two_directions(scene.scenario.road)
    for name, title, unit, size, steps in _TRAITS + (_OF_TWO_WAYS if two_way else ()):
        yield Quantity(
            name=f"ego: {title}",
            unit=unit,
            steps=_within_range(scene.scenario, name, size, steps),
            change=partial(_trait, name, size),
        )
    yield Quantity(
        name="ego: faster, and wanting to be",
        unit="km/h",
        steps=_drivable(scene.scenario, EGO_SLOT, _both(60.0, 1.0)),
        change=partial(_faster, EGO_SLOT),
    )
    for who, slot in _others(scene):
        named = f"{who} (vehicle {slot})"
        yield Quantity(
            name=f"{named}: further ahead",
            unit="m",
            steps=_both(100.0, 1.0),
            change=partial(_ahead, slot),
        )
        yield Quantity(
            name=f"{named}: faster",
            unit="km/h",
            steps=_drivable(scene.scenario, slot, _both(40.0, 1.0)),
            change=partial(_faster, slot),
        )
    weather = scene.scenario.weather
    for name in ("rain", "fog", "wind"):
        most = float(getattr(weather, name)[0])
        if most > 0.0:
            down = [-min(float(step), most) for step in range(1, int(np.ceil(most)) + 1)]
            steps = np.array(down, np.float64)
            yield Quantity(name=name, unit="% points", steps=steps, change=partial(_weather, name))
    if scene.pull_out is not None:
        yield Quantity(name="start of the overtake", unit="s", steps=_LATER, change=None)


def _both(most: float, step: float) -> Values:
    """Changes down and up in steps, the smallest first."""
    up = np.arange(1, round(most / step) + 1) * step
    return np.stack([up, -up], axis=1).ravel().round(6).astype(np.float64)


_KMH = mps_from_kmh(1.0)

_LATER = np.arange(1, 101).astype(np.float64) * 0.1

_Trait = tuple[str, str, str, float, Values]

_TRAITS: tuple[_Trait, ...] = (
    ("desired_speed", "speed wanted", "km/h", _KMH, _both(60.0, 1.0)),
    ("time_gap", "time gap wanted", "s", 1.0, _both(3.0, 0.1)),
    ("gap_demand_factor", "factor on the gaps demanded", "", 1.0, _both(3.0, 0.1)),
    ("return_time_gap", "time gap left when returning", "s", 1.0, _both(3.0, 0.1)),
    ("indicator_lead_time", "indicator on before moving", "s", 1.0, _both(3.0, 0.1)),
    ("lane_change_duration", "duration of a lane change", "s", 1.0, _both(3.0, 0.1)),
    ("reaction_time", "reaction time", "s", 1.0, _both(1.0, 0.05)),
)
"""Trait, words, unit, the unit in SI units, and changes that are tried."""

_OF_TWO_WAYS: tuple[_Trait, ...] = (
    (
        "passing_time_factor",
        "time believed for a pass, over what it takes",
        "",
        1.0,
        _both(1.0, 0.05),
    ),
)
"""The same, of drivers on two-way roads."""


def _others(scene: Scene) -> list[tuple[str, int]]:
    """The vehicles that the ego decides about when it begins, with their roles."""
    percept = Percept.of(scene.run)
    if percept is None:
        return []
    names = ("vehicle overtaken", "next ahead in the other lane", "next behind in the other lane")
    last = int(scene.scenario.num_vehicles[0])
    found = zip(names, percept.vehicle.tolist(), strict=True)
    return [(name, slot) for name, slot in found if slot < last]


def _trait(name: str, size: float, scenario: Scenario, value: float) -> Intervention:
    """The ego's driver with another trait."""
    return Intervention(traits={name: _own_trait(scenario, name) + size * value})


def _own_trait(scenario: Scenario, name: str) -> float:
    return float(getattr(scenario.drivers, name)[0, EGO_SLOT])


def _within_range(scenario: Scenario, name: str, size: float, steps: Values) -> Values:
    """The changes that leave a trait in its range; at 0 some mean another kind of driver."""
    low, high = TRAIT_RANGES[name].limits
    values = _own_trait(scenario, name) + size * steps
    return steps[(values > low) & (values <= high)]


def _ahead(slot: int, scenario: Scenario, value: float) -> Intervention:
    del scenario
    return Intervention(slot=slot, position_change=value)


def _faster(slot: int, scenario: Scenario, value: float) -> Intervention:
    del scenario
    return Intervention(slot=slot, speed_change=_KMH * value)


def _drivable(scenario: Scenario, slot: int, steps: Values) -> Values:
    """The changes of speed with which a vehicle still drives forwards."""
    slowest = min(
        float(scenario.start_speed[0, slot]), float(scenario.drivers.desired_speed[0, slot])
    )
    return steps[slowest + _KMH * steps > 0.0]


def _weather(name: str, scenario: Scenario, value: float) -> Intervention:
    """Less rain with the puddles that it leaves, less fog, or less wind."""
    weather = scenario.weather
    before = getattr(weather, name)
    after = np.maximum(before + np.float32(value), np.float32(0.0))
    found = weather.replace(**{name: after})
    if name == "rain":
        found = found.replace(puddles=weather.puddles * (after / before))
    return Intervention(weather=found)


def _classes(scene: Scene, one: Quantity, policy: str) -> tuple[Values, NDArray[np.uint8]]:
    """The changes that were made, and the class with each."""
    if one.change is None:
        return _later_classes(scene, policy)
    made = [
        apply_intervention(scene.scenario, one.change(scene.scenario, value)) for value in one.steps
    ]
    labels = label(engine.simulate(concatenate(made))).labels
    return one.steps, labels.classes[:, labels.policies.index(policy)]


def _later_classes(scene: Scene, policy: str) -> tuple[Values, NDArray[np.uint8]]:
    """By how much later the ego began, told so at one frame after the other; and the classes."""
    was = scene.pull_out
    assert was is not None  # Else the start is no quantity.
    found: dict[float, int] = {}
    for step in _LATER:
        frame = was + round(step * scene.rate)
        stay = Intervention(frame=was, decision=ForcedDecision.STAY)
        if frame >= int(scene.run.num_frames[0]):
            break
        run = branch(
            scene.run,
            interventions=[stay, Intervention(frame=frame, decision=ForcedDecision.PULL_OUT)],
        )
        began = pull_out(run)
        if began is not None:
            found[(began - was) / scene.rate] = _code(label(run), policy)
    return np.array(list(found)), np.array(list(found.values()), np.uint8)


def _code(labelled: LabelledTrajectories, policy: str) -> int:
    return int(labelled.labels.classes[0, labelled.labels.policies.index(policy)])


def _found(
    one: Quantity, steps: Values, codes: NDArray[np.uint8], goal: str, was: str
) -> Sufficient:
    """The values to report of a quantity."""
    reached = np.isin(codes, GOALS[goal])
    indices = np.flatnonzero(reached)
    best = indices[np.abs(steps[indices]).argmin()] if len(indices) else None
    tried = (float(steps.min()), float(steps.max())) if len(steps) else None
    if best is None:
        return Sufficient(
            name=one.name, unit=one.unit, least=None, becomes=was, tried=tried, larger=float("nan")
        )
    beyond = (np.sign(steps) == np.sign(steps[best])) & (np.abs(steps) > np.abs(steps[best]))
    return Sufficient(
        name=one.name,
        unit=one.unit,
        least=float(steps[best]),
        becomes=OvertakeClass(int(codes[best])).title,
        tried=tried,
        larger=float(reached[beyond].mean()) if beyond.any() else float("nan"),
    )
