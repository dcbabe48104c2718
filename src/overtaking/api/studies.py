"""Public functions that compare simulations with measurements, a study, or other simulators.

*Profile*: a named setting of road, traffic, weather and drivers that simulations are drawn from,
such as `motorway`; *specification*: the same as an object or as a TOML file of the user.
*Scenario*: everything decided before the first instant of a simulation. *Ego*: the vehicle whose
overtaking is studied. *Outcome*: whether the overtake was completed, was not completed or ended in
a collision. *Class*: outcome and legality, such as `Success_L` (completed, legal); *policy*: the
set of rules of law that decides between legal and illegal. The policy of a profile is `paper` for
the profiles of the paper, `default` for all others. *The paper*: the published study that the
package reproduces (Pinto, Dutra and Fonseca 2023).

`check_arguments` raises a `ConfigError` for an argument of another type than its annotation. Other
errors name in `where` the command with the same task, such as `compare` for `compare_simulators`.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.api.datasets import load_dataset
from overtaking.api.simulating import sample
from overtaking.api.simulator_registry import SIMULATORS, Count, ProfileSource, Seed, get_simulator
from overtaking.core.errors import ConfigError
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.data.tables.names import choose_reading
from overtaking.labels.labelling import label as label_batch
from overtaking.labels.law.judging import choose_policy, default_policy
from overtaking.model.batch import concatenate
from overtaking.model.checks import check_arguments
from overtaking.model.road import Road
from overtaking.recordings.roads import resolve_road
from overtaking.scenarios import profiles
from overtaking.simulators.comparison import Comparison

if TYPE_CHECKING:
    from overtaking.analysis.reproduction.run import Reproduction
    from overtaking.analysis.stats.results import Statistics
    from overtaking.analysis.validation.run import Validation


def _check_simulator_names(simulators: Sequence[str]) -> Sequence[str]:
    """Return the names; raise a `ConfigError` for fewer than two, or for one that repeats."""
    if len(simulators) < 2 or len(set(simulators)) < len(simulators):
        raise ConfigError(
            what="simulators",
            where="compare",
            expected="two or more different ones",
            got=", ".join(simulators),
            next_step=f"choose among {', '.join(SIMULATORS)}",
        )
    return simulators


@check_arguments
def compare_simulators(
    profile: ProfileSource,
    *,
    num_simulations: Count,
    seed: Seed,
    simulators: Sequence[str] = ("engine", "sumo"),
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    progress: ProgressCallback | None = None,
) -> Comparison:
    """Simulate the same scenarios on several simulators and compare what happens.

    Args:
        profile: Name of a profile, path of a TOML file, or a specification.
        num_simulations: Number of scenarios, 1 to 1,000,000.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        simulators: Two or more names in `SIMULATORS`; each is compared with the first.
        overrides: New values of keys of the specification, such as
            `{"traffic.vehicles": "2..6"}`.
        road: A road instead of the profile's: a name, an OpenDRIVE file, or a `Road`.
        progress: Called with the number of scenarios that are done, and of all.

    Returns:
        For each scenario the class and outcome on each simulator, and where and when the motion
        first differs by more than 2 m (about the width of a car) from the first simulator.

    Raises:
        ConfigError: The specification or a number cannot be used, there is no such simulator, or a
            simulator is named twice.
        MissingExtraError: A simulator is not installed.
    """
    spec = profiles.load_specification(profile, overrides)
    used_road = resolve_road(road or spec.road)
    used_simulators = [get_simulator(name) for name in _check_simulator_names(simulators)]
    # All simulators get the same batch. Each takes at most its `chunk_size` scenarios at a time, so
    # the batch has the smallest of these sizes.
    chunk_size = min(simulator.chunk_size for simulator in used_simulators)
    parts: list[Comparison] = []
    for first in range(0, num_simulations, chunk_size):
        count = min(chunk_size, num_simulations - first)
        batch = sample(spec, num_simulations=count, seed=seed, first_scenario=first, road=used_road)
        runs = [simulator.simulate(batch) for simulator in used_simulators]
        labelled_runs = [(run, label_batch(run).labels) for run in runs]
        policy = default_policy(batch.profile)  # `paper` for the profiles of the paper.
        parts.append(Comparison.of(simulators, labelled_runs, policy=policy))
        if progress is not None:
            progress(first + count, num_simulations)
    return concatenate(parts)


@check_arguments
def dataset_statistics(
    dataset: Dataset | str | Path,
    *,
    policy: str | None = None,
    reading: str | None = None,
    weighted: bool = False,
) -> "Statistics":
    """Compute class frequencies, the tables of the paper, and waiting times of a data set.

    The waiting time is the time from the start of a simulation until the ego begins to overtake.

    Args:
        dataset: The data set, or its folder or URL.
        policy: `paper`, `default` or `strict`; None for the policy of the profile.
        reading: Definition of the features (the columns that describe a simulation) in simulations
            without an overtake. In simulations with an overtake, features describe its start.
            `paper` takes means over the simulation, as in the paper. A mean and a value at an
            instant differ even in equal traffic, so the class without an overtake seems to differ
            from the others. `matched` draws an instant,
            such that the waiting times until it are distributed like the waiting times before
            overtakes. None for `paper` with the policy `paper`, else `matched`.
        weighted: Whether each simulation counts by its weight, a column of the data set. Weights
            restore natural shares where rare cases were drawn more often.

    Returns:
        The tables (`tables`, or `to_pandas` for exact values); `plot` draws figures of them.

    Raises:
        ConfigError: There is no such policy or reading.
        DatasetError: The data set is not complete, or damaged.
        SchemaError: The weights are missing or invalid.
    """
    from overtaking.analysis.stats.results import statistics as compute_statistics

    source = load_dataset(dataset)
    policy_name = choose_policy(policy, source.profile)
    reading_name = choose_reading(reading, policy_name)
    features = source.features(policy_name, reading=reading_name)
    return compute_statistics(features, policy=policy_name, reading=reading_name, weighted=weighted)


@check_arguments
def validate_profile(
    profile: ProfileSource,
    *,
    num_simulations: Count = 1000,
    seed: Seed = 1,
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    progress: ProgressCallback | None = None,
    recordings: str | Path | None = None,
) -> "Validation":
    """Compare the traffic of a profile with published measurements.

    Args:
        profile: Name of a profile, path of a TOML file, or a specification.
        num_simulations: Number of simulations, 1 to 1,000,000.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        overrides: New values of keys of the specification, such as
            `{"traffic.vehicles": "2..6"}`.
        road: A road instead of the profile's: a name, an OpenDRIVE file, or a `Road`.
        progress: Called with the number of simulations that are done, and of all.
        recordings: A recording of real traffic in CommonRoad's format, or a folder of recordings.
            Their drivers are compared with drivers of the profile in traffic of the same density.

    Returns:
        Each measured quantity with its 95 % interval, the published target and a verdict, and
        outcomes by weather; `plot` draws it. Its field `recordings` is the comparison with the
        recordings. Their faults are in the table `recordings.import_report`; if there are any, a
        `RecordingWarning` states the first.

    Raises:
        ConfigError: The specification or a number cannot be used.
        ImportFormatError: A recording cannot be read.
    """
    from overtaking.analysis.validation.run import validate as run
    from overtaking.data.import_report import warn_about

    spec = profiles.load_specification(profile, overrides)
    used_road = resolve_road(road or spec.road)
    path = None if recordings is None else Path(recordings)
    validation = run(spec, used_road, num_simulations, seed, progress, path)
    if validation.recordings is not None:
        warn_about(validation.recordings.import_findings)
    return validation


@check_arguments
def reproduce_study(
    study: str,
    *,
    num_replicates: Count = 1000,
    seed: Seed = 2023,
    overrides: Mapping[str, Any] | None = None,
    progress: ProgressCallback | None = None,
) -> "Reproduction":
    """Compare every number in the text of the paper with simulations of its experiment.

    The paper's data set is one sample of 276 simulations. Many sets of this size (replicates) show
    how much each number varies by chance, and which numbers of the paper the model cannot explain.

    Args:
        study: `pinto2023`, the only study so far; it is also the name of the profile.
        num_replicates: Number of sets of 276 simulations, 1 to 100,000.
        seed: Seed of all random numbers. Seeds of the simulations to which the drivers of the
            profile were fitted are refused: with them the agreement would be too good.
        overrides: New values of keys of the specification. The result then states that its
            parameters are not the published ones.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        For each number of the paper its position among the replicates, and whether the profile was
        fitted to it; also the weather that the paper's means imply for each class, and the shares
        of the classes under two other choices: whether a vehicle may start too fast and near behind
        another for its brakes, and the strength of the pushes that stand for rain and wind.
        `write_report` makes a page of it.

    Raises:
        ConfigError: There is no such study, or a number or seed cannot be used.
    """
    from overtaking.analysis.reproduction.run import STUDIES
    from overtaking.analysis.reproduction.run import reproduce as run

    if study not in STUDIES:
        raise ConfigError.unknown_choice(
            what="study", where="reproduce", choices=STUDIES, got=study
        )
    spec = profiles.load_specification(study, overrides)
    return run(
        spec, resolve_road(spec.road), num_replicates, seed, get_simulator("engine"), progress
    )
