"""Counterfactuals, futures and sufficient changes of a simulation, and saved branches."""

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
    Branches = Any  # The module of `Twin` is loaded when a twin is made.


Futures = Annotated[int, FieldSpec(low=1, high=100_000)]
"""Futures at each instant of a fan."""


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
    """Compare a simulation of a data set with the same simulation after a change.

    Args:
        dataset: The data set, or its folder; of simulations, or of branches.
        simulation_id: Number of the simulation.
        without: Factors to remove from the weather, as in `Weather.without`: `wind`, `rain`, `fog`,
            `night` or `glare`.
        driving_style: Another driving style of the ego: `careful`, `average` or `reckless`.
        stay: Whether the ego never begins an overtake.
        delay: Delay of the overtake, without regard to the gaps, 0 to 60 [s].
        interventions: Any other changes.
        start_time: Time from which `without`, `driving_style` and `stay` hold [s].
        effect: `direct`: the simulation continues from its state at `start_time`. `total`: speeds
            and distances at the start, which depend on weather and driver, are drawn again for the
            changed weather or driver from the same random numbers.

    Returns:
        Both simulations with their labels, and the first frame in which they differ.

    Raises:
        ConfigError: A name is unknown, a time is out of its range, the ego begins no overtake that
            can be delayed, or the simulations are not of this package's drivers.
        DatasetError: The data set holds recorded traffic, or is damaged.
    """
    from overtaking.analysis.whatif.twin import Wish, twin_of

    wish = Wish(
        without=tuple(without),
        driving_style=driving_style,
        stays=stay,
        delay=delay,
        interventions=tuple(interventions),
    )
    return twin_of(_scene(dataset, simulation_id), wish, start_time=start_time, effect=effect)


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
    """Outcomes of an overtake that begins at each instant of a simulation.

    Args:
        dataset: The data set, or its folder.
        simulation_id: Number of the simulation.
        condition_on: `truth`: the others as they are, which is hindsight; or `belief`: people and
            unnoticed vehicles drawn anew, in agreement with what the ego notices when it begins.
        futures: Futures at each instant; fewer where too few worlds agree.
        interval: Time from one instant to the next, 0.05 to 100 [s].
        policy: Which rules decide about the class: `paper`, `default` or `strict`; None for the
            default of the profile.
        progress: Called with the number of instants that are done, and of all.

    Returns:
        Shares of the classes with 95 % intervals, for each instant.

    Raises:
        ConfigError: There is no such policy, or the data set is not one of simulations of our
            drivers.
        DatasetError: It is of recorded traffic, or damaged.
    """
    from overtaking.analysis.whatif.fan import fan_of

    scene = _scene(dataset, simulation_id)
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
    """Changes of one quantity that would have made a simulation lawful or safe, each simulated.

    Args:
        dataset: The data set, or its folder.
        simulation_id: Number of the simulation.
        goal: `lawful`: completed without a breach that the policy counts; `safe`: without collision
            and on the road.
        policy: Which rules decide: `paper`, `default` or `strict`; None for the
            default of the profile.
        progress: Called with the number of quantities that are done, and of all.

    Raises:
        ConfigError: There is no such goal or policy, it is reached already, or the data set is not
            one of simulations of our drivers.
        DatasetError: It is of recorded traffic, or damaged.
    """
    from overtaking.analysis.whatif.enough import enough_of

    return enough_of(_scene(dataset, simulation_id), goal=goal, policy=policy, progress=progress)


@check_arguments
def resimulate_branch(dataset: Dataset | str | Path, simulation_id: int) -> Trajectories:
    """Simulate a saved branch again, from the list of changes in the manifest.

    Args:
        dataset: A data set of branches, or its folder.
        simulation_id: Number of the branch in it.

    Raises:
        DatasetError: It is no such data set, or the model has changed since.
        NoSuchSimulationError: There is no such simulation.
    """
    from overtaking.data.branches import branch_again as again

    return again(load_dataset(dataset), simulation_id)


@check_arguments
def save_branches(dataset: Dataset | str | Path, branches: "Branches", out: str | Path) -> Dataset:
    """Write simulations and branches of a data set as a data set of their own.

    Args:
        dataset: The data set that they branch from, or its folder.
        branches: Batches of one simulation each, by a title of a few words; or a `Twin`, of which
            simulation 0 is the original and simulation 1 the changed one.
        out: Folder for the new data set; it must not exist, or be empty.

    Raises:
        ConfigError: A batch has several simulations, or the folder holds something.
        DatasetError: The data set cannot be written; nothing is left behind.
    """
    from overtaking.analysis.whatif.twin import Twin
    from overtaking.data.branches import write_branches

    simulations = branches.told if isinstance(branches, Twin) else _titled_branches(branches)
    write_branches(load_dataset(dataset), simulations, Path(out))
    return load_dataset(out)


def _titled_branches(branches: Any) -> "list[Told]":
    from overtaking.data.branches import Told

    is_mapping = isinstance(branches, Mapping) and len(branches) > 0
    for batch in branches.values() if is_mapping else [branches]:
        if not isinstance(batch, Trajectories) or batch.scenario.num_simulations != 1:
            raise ConfigError(
                what="branches",
                where="save_branches",
                expected="a Twin, or batches of one simulation, by title",
                got=batch,
                next_step="select one simulation, such as trajectories.select(slice(0, 1))",
            )
    return [Told(title=title, run=batch) for title, batch in branches.items()]


def _scene(dataset: Dataset | str | Path, simulation_id: int) -> "Scene":
    from overtaking.analysis.whatif.scenes import scene_of

    return scene_of(load_dataset(dataset), simulation_id)
