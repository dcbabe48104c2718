"""What if: twins and futures of a simulation, and changes that would have been enough."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.api.data import load_dataset
from overtaking.core.errors import ConfigError
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.labels.law import choose_policy
from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_argument, check_arguments
from overtaking.model.scenario import Intervention
from overtaking.model.trajectories import Trajectories

if TYPE_CHECKING:
    from overtaking.analysis.whatif.enough import Enough
    from overtaking.analysis.whatif.fan import Fan
    from overtaking.analysis.whatif.scenes import Scene
    from overtaking.analysis.whatif.twin import Twin

Futures = Annotated[int, FieldSpec(low=1, high=100_000)]
"""Futures at each instant of a fan."""


@check_arguments
def counterfactual(
    data: Dataset | str | Path,
    simulation: int,
    *,
    without: Iterable[str] = (),
    driver: str | None = None,
    stay: bool = False,
    delay: float | None = None,
    changes: Iterable[Intervention] = (),
    at: float = 0.0,
    from_start: bool = False,
) -> "Twin":
    """Compare a simulation of a data set with the same simulation after a change.

    Args:
        data: The data set, or its folder; of simulations, or of branches.
        simulation: Its number.
        without: Factors to remove from the weather, as in `Weather.without`: `wind`, `rain`, `fog`,
            `night` or `glare`.
        driver: Another temper of the ego's driver: `careful`, `average` or `reckless`.
        stay: Whether the ego never begins an overtake.
        delay: By how much later it begins, whatever the gaps are then [s].
        changes: Any other changes.
        at: From when on `without`, `driver` and `stay` hold [s].
        from_start: Whether speeds and distances at the start, which depend on weather and driver,
            are drawn again from the same random numbers: the total effect. If not, the simulation
            goes on from its state at that time: the direct effect.

    Raises:
        ConfigError: There is no such weather, driver, time or start, or the data set is not one of
            simulations of our drivers.
        DatasetError: It is of recorded traffic, or damaged.
    """
    from overtaking.analysis.whatif.twin import Wish, twin_of

    wish = Wish(
        without=tuple(without), driver=driver, stays=stay, delay=delay, changes=tuple(changes)
    )
    return twin_of(_scene(data, simulation), wish, at=at, from_start=from_start)


@check_arguments
def outcome_fan(
    data: Dataset | str | Path,
    simulation: int,
    *,
    given: str = "truth",
    futures: Futures = 25,
    every: Annotated[float, FieldSpec(low=0.05, high=100.0)] = 0.5,
    policy: str | None = None,
    progress: ProgressCallback | None = None,
) -> "Fan":
    """Outcomes of an overtake that begins at each instant of a simulation.

    Args:
        data: The data set, or its folder.
        simulation: Its number.
        given: `truth`: the others as they are, which is hindsight; or `belief`: people and
            unnoticed vehicles drawn anew, in agreement with what the ego notices when it begins.
        futures: At each instant; fewer where too few worlds agree.
        every: Time between two instants [s].
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

    scene = _scene(data, simulation)
    return fan_of(
        scene, given=given, futures=futures, every=every, policy=policy, progress=progress
    )


@check_arguments
def sufficient_changes(
    data: Dataset | str | Path,
    simulation: int,
    *,
    goal: str = "lawful",
    policy: str | None = None,
    progress: ProgressCallback | None = None,
) -> "Enough":
    """Changes of one quantity that would have made a simulation lawful or safe, each simulated.

    Args:
        data: The data set, or its folder.
        simulation: Its number.
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

    return enough_of(_scene(data, simulation), goal=goal, policy=policy, progress=progress)


@check_arguments
def resimulate_branch(data: Dataset | str | Path, simulation: int) -> Trajectories:
    """Simulate a saved branch again, from the list of changes in the manifest.

    Args:
        data: A data set of branches, or its folder.
        simulation: Its number.

    Raises:
        DatasetError: It is no such data set, or the model has changed since.
        NoSuchSimulationError: There is no such simulation.
    """
    from overtaking.data.branches import branch_again as again

    return again(load_dataset(data), simulation)


@check_arguments
def save_branches(data: Dataset | str | Path, runs: Mapping[str, Any], out: str | Path) -> Dataset:
    """Write simulations and branches of a data set as a data set of their own.

    Args:
        data: The data set that they branch from, or its folder.
        runs: Batches of one simulation, by what they are in a few words; or a `Twin`'s `told`.
        out: Folder for it; it must not exist, or be empty.

    Raises:
        ConfigError: Something else is given, or the folder holds something.
        DatasetError: It cannot be written; nothing is left behind.
    """
    from overtaking.data.branches import Told, write_branches

    for run in runs.values():
        if not isinstance(run, Trajectories) or run.scenario.num_simulations != 1:
            raise ConfigError(
                what="runs",
                where="save_branches",
                expected="batches of one simulation, by name",
                got=run,
                next_step="select one, such as run.select(slice(0, 1))",
            )
    told = [Told(title=title, run=run) for title, run in runs.items()]
    write_branches(load_dataset(data), told, Path(out))
    return load_dataset(out)


@check_arguments
def save_twin(data: Dataset | str | Path, found: Any, out: str | Path) -> Dataset:
    """Write a simulation and its twin as a data set: number 0 as it was, number 1 changed.

    Args:
        data: The data set that it is from, or its folder.
        found: What `twin` returned.
        out: Folder for it; it must not exist, or be empty.

    Raises:
        ConfigError: The folder holds something.
        DatasetError: It cannot be written; nothing is left behind.
    """
    from overtaking.data.branches import write_branches

    write_branches(load_dataset(data), found.told, Path(out))
    return load_dataset(out)


def _scene(data: Dataset | str | Path, simulation: int) -> "Scene":
    from overtaking.analysis.whatif.scenes import scene_of

    return scene_of(load_dataset(data), simulation)


@check_arguments
def film_twin(found: Any, out: str | Path, *, policy: str | None = None) -> Path:
    """Film a simulation above its twin, as an mp4 file.

    Args:
        found: What `twin` returned.
        out: The file, replaced as a whole; its folder exists.
        policy: Which rules decide about the classes: `paper`, `default` or `strict`; None for the
            default of the profile.

    Raises:
        ConfigError: Something else is given, or there is no such policy.
        MissingExtraError: The extra `video` is not installed.
        DatasetError: The encoder failed.
        OSError: The file cannot be written.
    """
    from overtaking.analysis.whatif.twin import Twin
    from overtaking.show.video.encode import require, write_film
    from overtaking.show.video.twin import TwinFilm

    require()
    twins, path = check_argument(found, Twin, "film_twin", "found"), Path(out)
    policy_name = choose_policy(policy, twins.profile)
    title = f"Simulation {twins.number} and its twin, policy {policy_name}"
    write_film(TwinFilm(twins, policy), path, title=title)
    return path
