"""A driver of one's own beside others in the same scenes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.api.choices import Count, Profile, Seed, module_of, road_of
from overtaking.core.errors import ConfigError, nearest_first
from overtaking.core.notebook import show_progress
from overtaking.core.progress import ProgressCallback
from overtaking.model.checks import check_argument, check_arguments
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.scenarios import profiles
from overtaking.sim import driving, policies
from overtaking.sim.driving import Driver
from overtaking.sim.sensor import Sensor

if TYPE_CHECKING:
    from overtaking.analysis.evaluation.benchmark import BenchmarkResult
    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.analysis.evaluation.run import Contestant
    from overtaking.show.report.evaluation import Evaluated

HUMAN, STAY = "human", "stay"

SHIPPED: Mapping[str, Driver | None] = {
    HUMAN: None,
    STAY: Driver(policy=policies.stay, observe="human", action="decision", name=STAY),
    "rules": Driver(policy=policies.rules, observe="human", action="decision", name="rules"),
}
"""Drivers that are part of the package; None is the model's own."""

AGAINST = (HUMAN, STAY)

RISK = "-risk"
"""What the name of a profile ends with that draws more of where something goes wrong."""


@check_arguments
def evaluate(
    policy: str | Driver,
    profile: Profile = "motorway-risk",
    *,
    num_simulations: Count = 1000,
    seed: Seed = 1,
    against: Sequence[str | Driver] = AGAINST,
    as_met: bool = False,
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    progress: ProgressCallback | None = None,
    say: Callable[[str], None] | None = None,
) -> "Evaluation":
    """Compare a driver with others in the same scenes.

    Args:
        policy: The driver: a `Driver`, or the name of one of `SHIPPED`.
        profile: What scenes to draw; of a profile of the package its `-risk` one, if there is one.
        num_simulations: Number of scenes, 1 to 1,000,000.
        seed: Seed of their random numbers, 0 <= seed < 2**64.
        against: Drivers to compare it with, each with another name.
        as_met: Whether to draw scenes of the profile that is named, as they are met.
        overrides: Dotted keys of the specification with other values.
        road: A road instead of the profile's.
        progress: Called with the number of simulations that are done, and of all.
        say: Called before the run with a sentence that names the `-risk` profile, if one is drawn.

    Returns:
        Rates with intervals, differences, margins and the worst scenes; `write_evaluation` makes a
        page of it.

    Raises:
        ConfigError: The specification, a number or a name cannot be used.
        PolicyError: A policy raises, or answers what is no action.
    """
    from overtaking.analysis.evaluation.run import evaluate as run
    from overtaking.analysis.evaluation.words import risk_note

    here, *others = _contestants([policy, *against])
    risk_profile = None if as_met else _risk_profile(profile)
    spec = profiles.load_specification(risk_profile or profile, overrides)
    if risk_profile is not None and say is not None:
        say(risk_note(str(profile), risk_profile))
    (stay,) = _contestants([STAY])
    evaluation = run(
        spec,
        road_of(road or spec.road),
        num_simulations,
        seed,
        policy=here,
        references=others,
        stay=stay,
        progress=progress,
    )
    if risk_profile is None:
        return evaluation
    return replace(evaluation, asked_profile=str(profile))


@check_arguments
def run_benchmark(
    policy: str | Driver,
    benchmark: str | Path,
    *,
    against: Sequence[str | Driver] = AGAINST,
    progress: ProgressCallback | None = None,
) -> "BenchmarkResult":
    """Compare a driver with others in the scenes of a benchmark, whose numbers are fixed.

    Args:
        policy: The driver, as in `evaluate`.
        benchmark: Its name, or a TOML file.
        against: Drivers to compare it with.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: There is no such benchmark, or a profile or the model is not the one that it
            was made with; or as in `evaluate`.
        PolicyError: A policy raises, or answers what is no action.
    """
    from overtaking.analysis.evaluation.benchmark import read, run

    here, *others = _contestants([policy, *against])
    (stay,) = _contestants([STAY])
    return run(read(benchmark), here, others, stay, road_of, progress)


@show_progress
def write_evaluation(
    found: "Evaluation | BenchmarkResult",
    out: str | Path,
    *,
    films: int = 10,
    progress: ProgressCallback | None = None,
) -> "list[Evaluated]":
    """Write an evaluation as a page with figures, and films of the worst scenes.

    Args:
        found: What `evaluate` or `run_benchmark` returned; of a benchmark, each profile has a
            page in a folder of its name.
        out: Folder for the page; files of an earlier one are replaced.
        films: How many of the worst scenes are filmed, 10 at most.
        progress: Called with the number of films that are done, and of all.

    Returns:
        Where each page is, and what it could not show: without the extra `plots` it has no figures,
        without `video` no films.

    Raises:
        OSError: A file cannot be written.
    """
    from overtaking.analysis.evaluation.benchmark import BenchmarkResult
    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.show.report.evaluation import write

    check_argument(found, Evaluation | BenchmarkResult, "write_evaluation", "found")
    folder = Path(check_argument(out, str | Path, "write_evaluation", "out"))
    if isinstance(found, Evaluation):
        return [write(found, folder, films=films, progress=progress)]
    return [
        write(one, folder / one.profile, films=films, benchmark=found.title, progress=progress)
        for one in found.evaluations
    ]


def policy_of(
    name: str, observe: str | None, *, action: str, hold: int, option: str = "--policy"
) -> str | Driver:
    """The driver that words name: one of `SHIPPED`, or as in `driver_of`.

    Args:
        name: Its name.
        observe: What it observes; needed unless it is shipped.
        action: What it answers.
        hold: Decisions for which an answer holds.
        option: Option of the command line that names the driver, for messages.

    Raises:
        ConfigError: There is no such policy or sensor, or it is not stated what it observes.
    """
    from overtaking.api.driving import driver_of, load_policy

    if name in SHIPPED:
        return name
    if observe is None:
        load_policy(name, option, SHIPPED)  # Reports an unknown name before the missing option.
        raise ConfigError(
            what="--observe",
            where="evaluate",
            expected=f"human, truth or the file of a sensor, for {option} {name}",
            got="nothing",
            next_step=f"add --observe, or choose a shipped driver: {', '.join(SHIPPED)}",
        )
    if ":" not in name and not name.endswith(".onnx"):
        load_policy(name, option, SHIPPED)  # Raises; the message lists the shipped drivers.
    return driver_of(name, observe, action=action, hold=hold, option=option)


def _risk_profile(profile: Profile) -> str | None:
    """The profile of the package that draws dangerous scenes more often, if there is one."""
    name = f"{profile}{RISK}" if isinstance(profile, str) else ""
    return name if name in profiles.profile_names() else None


def _contestants(drivers: Sequence[str | Driver]) -> "list[Contestant]":
    """The contestant of each driver: the driver under evaluation first, then the references.

    Raises:
        ConfigError: No driver has such a name, or two drivers have the same name.
    """
    contestants = [
        _contestant(driver, "against" if index else "policy")
        for index, driver in enumerate(drivers)
    ]
    names = [contestant.name for contestant in contestants]
    if len(set(names)) < len(names):
        raise ConfigError(
            what="policies",
            where="evaluate",
            expected="a policy and others, each once",
            got=", ".join(names),
            next_step="leave out the ones that repeat, or name others with --against",
        )
    return contestants


def _contestant(driver: str | Driver, argument_name: str) -> "Contestant":
    from overtaking.analysis.evaluation.run import Contestant

    engine = module_of("engine")
    if isinstance(driver, str):
        name = driver
        if name not in SHIPPED:
            names = nearest_first(name, SHIPPED)
            raise ConfigError.unknown_choice(
                what=argument_name, where="evaluate", choices=names, got=name
            )
        shipped = SHIPPED[name]
        if shipped is None:  # The driver of the engine itself.
            return Contestant(name=name, simulate=engine.simulate)
        driver = shipped
    return Contestant(
        name=driver.title.rpartition(":")[2].rpartition("/")[2],
        source=driver.title,
        simulate=partial(_simulate, driver=driver),
        digest=driver.digest,
        observe="sensor" if isinstance(driver.observe, Sensor) else driver.observe,
        action=driver.action,
    )


def _simulate(scenario: Scenario, driver: Driver) -> Trajectories:
    return driving.drive(scenario, driver, module_of("engine").run)
