"""Public functions that change one simulation and simulate it again: `overtaking.whatif`.

The *ego* is the vehicle whose overtaking is studied. A *branch* is a simulation with something
changed from some time on and the same random numbers; a *twin* is a pair of a simulation and its
branch. An *intervention* is one change, such as of a vehicle's speed. A *data set* is a folder of
tables with many simulations; its *manifest* (`dataset.json`) records how it was made. *Class*: the
result of a simulation, such as `Success_L` (completed, legal); *policy*: the set of rules of law
that decides between legal and illegal. *Profile*: the named setting of road and traffic that a data
set was drawn from; it has a default policy.

Only simulations of the package's own model (`engine`, `reference`) and drivers can be changed:
recorded traffic and the recorded actions of a driver of the user do not react to a change, and SUMO
and CARLA cannot change a running simulation.
`check_arguments` raises a `ConfigError` for an argument of another type than its annotation.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.api.datasets import load_dataset
from overtaking.core.errors import ConfigError
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_arguments
from overtaking.model.scenario import Intervention
from overtaking.model.trajectories import Trajectories

if TYPE_CHECKING:
    from overtaking.analysis.whatif.enough import Enough
    from overtaking.analysis.whatif.fan import Fan
    from overtaking.analysis.whatif.scenes import Scene
    from overtaking.analysis.whatif.twin import Twin
    from overtaking.data.branches import Told

    Branches = Mapping[str, Trajectories] | Twin
else:
    Branches = Any  # `Twin` is slow to import, so its type is known to type checkers only.


Futures = Annotated[int, FieldSpec(low=1, high=100_000)]
"""Number of simulated futures at each instant. The limit is a choice: a minute of one core."""


@check_arguments
def counterfactual(
    dataset: Dataset | str | Path,
    simulation_id: int,
    *,
    without: Iterable[str] = (),
    driving_style: str | None = None,
    stay: bool = False,
    delay: float | None = None,
    interventions: Iterable[Intervention] = (),
    start_time: float = 0.0,
    effect: str = "direct",
) -> "Twin":
    """Compare a simulation with the same simulation after one or more changes.

    Args:
        dataset: The data set, or its folder or URL; it may be one that `save_branches` wrote.
        simulation_id: Number of the simulation in the data set, from 0.
        without: Factors to remove from the weather: `wind`, `rain`, `fog`, `night` or `glare`.
        driving_style: Another driving style of the ego: `careful`, `average` or `reckless`; None
            for its own.
        stay: Whether the ego never begins an overtake; not together with `delay`.
        delay: Time by which the ego begins its overtake later, even if the gaps are too small then,
            0 to 60 [s]; None for no delay.
        interventions: Any other changes, each with the frame (recorded instant) from which it
            holds.
        start_time: Time in the simulation from which `without`, `driving_style` and `stay` hold
            [s].
        effect: `direct`: the simulation continues from its state at `start_time`. `total`: the
            simulation starts anew, and speeds and distances at the start, which depend on weather
            and driver, are drawn again with the same random numbers; only for `without` and
            `driving_style`, with `start_time=0`.

    Returns:
        Both simulations with their labels, and the first frame in which their motion differs.

    Raises:
        ConfigError: A name is unknown, a time is out of its range, the arguments do not go
            together, the ego begins no overtake that could be delayed, or SUMO, CARLA or a driver
            of the user made the simulation.
        DatasetError: The data set holds recorded traffic, or is damaged.
        NoSuchSimulationError: There is no such simulation.
    """
    from overtaking.analysis.whatif.twin import Wish, twin_of

    changes = Wish(
        without=tuple(without),
        driving_style=driving_style,
        stays=stay,
        delay=delay,
        interventions=tuple(interventions),
    )
    return twin_of(
        _load_scene(dataset, simulation_id), changes, start_time=start_time, effect=effect
    )


@check_arguments
def outcome_fan(
    dataset: Dataset | str | Path,
    simulation_id: int,
    *,
    condition_on: str = "truth",
    futures: Futures = 25,
    interval: Annotated[float, FieldSpec(low=0.05, high=100.0)] = 0.5,
    policy: str | None = None,
    progress: ProgressCallback | None = None,
) -> "Fan":
    """Simulate what an overtake would have led to, had the ego begun it at other instants.

    At each instant, many futures are simulated that differ in the random numbers after it.

    Args:
        dataset: The data set, or its folder or URL.
        simulation_id: Number of the simulation in the data set, from 0.
        condition_on: The common part of all futures. `truth`: the actual other vehicles and their
            drivers, which the ego cannot know. `belief`: only what the ego has noticed; all else
            (drivers, unnoticed vehicles) is drawn anew, in agreement with it. Use `belief` to judge
            a decision, because the ego decided by its beliefs, not by the truth.
        futures: Number of futures at each instant, 1 to 100,000. With `belief` there may be fewer,
            where few drawn situations agree with what the ego noticed.
        interval: Time from one instant to the next [s], 0.05 (the time between two decisions of a
            driver) to 100.
        policy: `paper`, `default` or `strict`; None for the default of the profile.
        progress: Called with the number of instants that are done, and of all.

    Returns:
        For each instant, the share of each class with its 95 % interval.

    Raises:
        ConfigError: There is no such policy or condition, or SUMO, CARLA or a driver
            of the user made the simulation.
        DatasetError: The data set holds recorded traffic, or is damaged.
        NoSuchSimulationError: There is no such simulation.
    """
    from overtaking.analysis.whatif.fan import fan_of

    scene = _load_scene(dataset, simulation_id)
    return fan_of(
        scene,
        condition_on=condition_on,
        futures=futures,
        every=interval,
        policy=policy,
        progress=progress,
    )


@check_arguments
def sufficient_changes(
    dataset: Dataset | str | Path,
    simulation_id: int,
    *,
    goal: str = "lawful",
    policy: str | None = None,
    progress: ProgressCallback | None = None,
) -> "Enough":
    """Find the smallest changes that would have made a simulation lawful or safe.

    One quantity at a time is changed in steps, such as the ego's speed, a gap or the rain, and each
    step is simulated.

    Args:
        dataset: The data set, or its folder or URL.
        simulation_id: Number of the simulation in the data set, from 0.
        goal: `lawful`: the overtake is completed and breaks no rule that the policy requires.
            `safe`: no collision, and the ego stays on the road.
        policy: `paper`, `default` or `strict`; None for the default of the profile.
        progress: Called with the number of quantities that are done, and of all.

    Returns:
        For each quantity, the smallest sufficient change, and the share of larger changes that are
        sufficient as well; also the quantities without a sufficient change.

    Raises:
        ConfigError: There is no such goal or policy, the simulation has reached the goal already,
            it is a branch (only original simulations are changed here), or SUMO,
            CARLA or a driver of the user made the simulation.
        DatasetError: The data set holds recorded traffic, or is damaged.
        NoSuchSimulationError: There is no such simulation.
    """
    from overtaking.analysis.whatif.enough import enough_of

    scene = _load_scene(dataset, simulation_id)
    return enough_of(scene, goal=goal, policy=policy, progress=progress)


@check_arguments
def resimulate_branch(dataset: Dataset | str | Path, simulation_id: int) -> Trajectories:
    """Simulate a saved branch again, from the changes that the manifest lists.

    Args:
        dataset: A data set that `save_branches` wrote, or its folder or URL.
        simulation_id: Number of the branch in it, from 0.

    Returns:
        The branch, a batch of one simulation.

    Raises:
        DatasetError: `save_branches` did not write the data set, or the version of the model has
            changed.
        NoSuchSimulationError: There is no such simulation.
    """
    from overtaking.data.branches import branch_again

    return branch_again(load_dataset(dataset), simulation_id)


@check_arguments
def save_branches(dataset: Dataset | str | Path, branches: "Branches", out: str | Path) -> Dataset:
    """Write simulations and branches of a data set as a data set of their own.

    Args:
        dataset: The data set that they branch from, or its folder or URL.
        branches: Title (a few words) to a batch of one simulation, numbered from 0 in this order;
            or a `Twin`, whose original becomes simulation 0 and whose branch becomes simulation 1.
            The manifest lists the changes, which each batch holds in `branch_origin`.
        out: Folder for the new data set, on this machine; it must not exist, or be empty.

    Returns:
        The new data set.

    Raises:
        ConfigError: A batch does not have exactly one simulation, or the folder is not empty.
        DatasetError: The data set cannot be written; no files remain.
    """
    from overtaking.analysis.whatif.twin import Twin
    from overtaking.data.branches import write_branches

    # `told` is a pair of `Told`: each a batch of one simulation with its title.
    simulations = branches.told if isinstance(branches, Twin) else _titled_branches(branches)
    write_branches(load_dataset(dataset), simulations, Path(out))
    return load_dataset(out)


def _titled_branches(branches: Any) -> "list[Told]":
    """The branches as the writer of data sets takes them.

    Raises:
        ConfigError: `branches` is no mapping or empty, or a value is no batch of one simulation.
            `check_arguments` does not check it, because `Branches` is `Any` at run time.
    """
    from overtaking.data.branches import Told

    if not isinstance(branches, Mapping) or not branches:
        raise _branches_error(branches)
    for batch in branches.values():
        if not isinstance(batch, Trajectories) or batch.scenario.num_simulations != 1:
            raise _branches_error(batch)
    return [Told(title=title, run=batch) for title, batch in branches.items()]


def _branches_error(value: object) -> ConfigError:
    """The error for branches that cannot be saved; `value` is the argument or a part of it."""
    return ConfigError(
        what="branches",
        where="save_branches",
        expected="a Twin, or batches of one simulation, by title",
        got=value,
        next_step="select one simulation, such as trajectories.select(slice(0, 1))",
    )


def _load_scene(dataset: Dataset | str | Path, simulation_id: int) -> "Scene":
    """Load a simulation that can be changed.

    Raises:
        ConfigError: SUMO, CARLA or a driver of the user made the simulation.
        DatasetError: The data set holds recorded traffic, or is damaged.
        NoSuchSimulationError: There is no such simulation.
    """
    from overtaking.analysis.whatif.scenes import scene_of

    return scene_of(load_dataset(dataset), simulation_id)
