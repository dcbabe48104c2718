"""Studies: traffic compared with measurements, simulators with each other, ours with the paper."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.api.datasets import load_dataset
from overtaking.api.simulating import sample
from overtaking.api.simulator_registry import SIMULATORS, Count, ProfileSource, Seed, get_simulator
from overtaking.core.errors import ConfigError
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.labels.label import label as labelled
from overtaking.labels.law import choose_policy, default_policy
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
    """Names of simulators to compare, refused if they are not two or more different ones."""
    if len(set(simulators)) < 2 or len(set(simulators)) < len(simulators):
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
    """Simulate the same scenarios on several simulators: how they end, and where they differ.

    Args:
        profile: As in `sample`.
        num_simulations: Number of scenarios, 1 to 1,000,000.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        simulators: Two or more of `SIMULATORS`; the others are held against the first.
        overrides: Dotted keys of the specification with other values.
        road: A road instead of the profile's.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: The specification or a number cannot be used, or there is no such simulator,
            or it is compared with itself.
        MissingExtraError: A simulator is not installed.
    """
    spec = profiles.load_specification(profile, overrides)
    place = resolve_road(road or spec.road)
    compared = [get_simulator(name) for name in _check_simulator_names(simulators)]
    step = min(simulator.chunk_size for simulator in compared)
    parts: list[Comparison] = []
    for first in range(0, num_simulations, step):
        count = min(step, num_simulations - first)
        batch = sample(spec, num_simulations=count, seed=seed, first_scenario=first, road=place)
        runs = [simulator.simulate(batch) for simulator in compared]
        recordings = [(run, labelled(run).labels) for run in runs]
        policy = default_policy(batch.profile)
        parts.append(Comparison.of(simulators, recordings, policy=policy))
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
    """The paper's tables, class frequencies and waiting times of a data set.

    Args:
        dataset: The data set, or its folder.
        policy: Which rules decide about the class: `paper`, `default` or `strict`; None for the
            default of the profile.
        reading: How features are measured, `paper` or `matched`; as in `Dataset.features`.
        weighted: Whether to count each simulation by its importance weight.

    Raises:
        ConfigError: There is no such policy or reading.
        DatasetError: The data set is not complete, or damaged.
        SchemaError: The weights cannot be used.
    """
    from overtaking.analysis.stats.results import statistics as computed

    source = load_dataset(dataset)
    policy_name = choose_policy(policy, source.profile)
    frame = source.features(policy_name, reading=reading)
    return computed(frame, policy=policy_name, reading=reading, weighted=weighted)


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
        profile: As in `sample`.
        num_simulations: Number of simulations, 1 to 1,000,000.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        overrides: Dotted keys of the specification with other values.
        road: A road instead of the profile's.
        progress: Called with the number of simulations that are done, and of all.
        recordings: A recording in CommonRoad's format, or a folder of recordings. Their drivers are
            compared with drivers of the profile in traffic of the same density.

    Returns:
        Each figure with its interval, target and verdict, and outcomes by weather; `plot` draws
        it. `recordings.import_report` has the findings of the recordings, of which a
        `RecordingWarning` names the first.

    Raises:
        ConfigError: The specification or a number cannot be used.
    """
    from overtaking.analysis.validation.run import validate as run
    from overtaking.data.import_report import warn_about

    spec = profiles.load_specification(profile, overrides)
    where = None if recordings is None else Path(recordings)
    validation = run(spec, resolve_road(road or spec.road), num_simulations, seed, progress, where)
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
    """Compare every number that a paper states with replicates of its data set.

    Args:
        study: `pinto2023`.
        num_replicates: Number of sets of 276 simulations, 1 to 1,000,000.
        seed: Seed of all random numbers, none that the drivers were fitted with.
        overrides: Dotted keys of the specification with other values; the parameters are then not
            the frozen ones, and it says so.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Each number with its place among ours, what it is to us, and what the paper's label hides;
        `write_report` makes a page of it.

    Raises:
        ConfigError: There is no such study, or a number cannot be used.
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
