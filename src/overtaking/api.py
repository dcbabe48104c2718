"""The public functions: what to call from Python, and which simulator they call."""

import importlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from overtaking import scenarios
from overtaking.core.errors import ConfigError, DatasetError
from overtaking.datasets import generate as writing
from overtaking.datasets import load as reading
from overtaking.datasets.balance import Balance
from overtaking.datasets.generate import Progress
from overtaking.datasets.load import Dataset
from overtaking.datasets.manifest import read_manifest
from overtaking.datasets.recipe import Keep, Recipe, Simulator
from overtaking.exchange import recording_export
from overtaking.exchange.roads import load_road
from overtaking.labelling import Labelled
from overtaking.labelling import label as labelled
from overtaking.model.batch import concatenate
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import Trajectories
from overtaking.model.weather import Weather
from overtaking.scenarios import Spec
from overtaking.sim.branch import branch as branched
from overtaking.sim.decision import Decision
from overtaking.sim.version import MODEL_VERSION
from overtaking.simulators.comparison import Comparison

if TYPE_CHECKING:
    from overtaking.database.query import Answer
    from overtaking.report.write import Report
    from overtaking.simulators.carla_limits import Limits
    from overtaking.simulators.carla_replay import Replayed
    from overtaking.stats.results import Statistics
    from overtaking.validation.run import Validation
    from overtaking.video.produce import Video

Profile = str | Path | Mapping[str, Any] | Spec
"""A profile of the package, a TOML file, what a manifest recorded, or a specification."""

EXPORTS = ("pinto2023", "commonroad", "highd")
"""The formats that a data set can be written in."""

SIMULATORS = ("engine", "reference", "sumo", "carla", "carla-traffic-manager")
"""What can simulate: the compiled engine, its readable twin with the same results, SUMO, and CARLA
with our drivers or with its own."""

_HOMES = {
    "engine": "overtaking.sim.engine",
    "reference": "overtaking.sim.reference",
    "sumo": "overtaking.simulators.sumo",
    "carla": "overtaking.simulators.carla",
    "carla-traffic-manager": "overtaking.simulators.carla_traffic",
}
"""The module of each simulator, loaded when it is asked for."""

BRANCHING = ("engine", "reference")
"""The simulators of our own model, which can go on from the middle of a simulation."""


def generate(
    profile: Profile,
    simulations: int,
    seed: int,
    out: str | Path,
    *,
    keep: str = Keep.FRAMES,
    resume: bool = False,
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    simulator: str = "engine",
    shard_size: int | None = None,
    balance: Balance | None = None,
    progress: Progress | None = None,
    on_candidates: Progress | None = None,
) -> Dataset:
    """Make a data set.

    Args:
        profile: What to sample.
        simulations: How many simulations.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        out: Folder for the data set; made if missing.
        keep: `frames` writes everything; `features` leaves out what has a row per frame, which is
            simulated again when it is asked for.
        resume: Whether to complete what an earlier call has begun in this folder.
        overrides: Dotted keys of the specification with other values, as in `scenarios.spec`.
        road: A road in place of the profile's: a name, an OpenDRIVE file, or a `Road`.
        simulator: One of `SIMULATORS`.
        shard_size: Simulations a file; what suits the simulator if left out.
        balance: Which classes get equal shares, and what is done if one is too rare; None for
            natural shares.
        progress: Called with the number of simulations that are done, and of all.
        on_candidates: Called with the number of candidates of a balanced data set that have been
            looked at, and about how many there will be; all that comes before the simulations.

    Returns:
        The complete data set.

    Raises:
        ConfigError: The specification or a number cannot be used.
        DatasetError: The folder holds something else or cannot be written, another process writes
            it, or the process was asked to end. Finished shards are kept, and `resume` goes on.
        KeyboardInterrupt: Ctrl-C; the same holds.
    """
    spec = scenarios.spec(profile, overrides)
    chosen = _simulator(simulator)
    recipe = Recipe(
        spec=spec,
        road=_road(road or spec.road),
        seed=seed,
        num_simulations=simulations,
        keep=_keep(keep),
        shard_size=chosen.shard_size if shard_size is None else shard_size,
        balance=balance,
    )
    return writing.generate(
        recipe,
        Path(out),
        chosen,
        resume=resume,
        progress=progress,
        on_candidates=on_candidates,
    )


def resume(
    out: str | Path,
    *,
    progress: Progress | None = None,
    on_candidates: Progress | None = None,
) -> Dataset:
    """Complete a data set from what its manifest says, or check that it is complete.

    Args:
        out: Folder of the data set.
        progress: Called with the number of simulations that are done, and of all.
        on_candidates: As in `generate`.

    Returns:
        The complete data set; shards that were damaged are written again.

    Raises:
        DatasetError: Nothing was begun there, or as in `generate`.
        SchemaError: It was begun by a newer version.
    """
    begun = read_manifest(Path(out)).identity
    if begun.seed is None:
        raise DatasetError.of(
            what="data set",
            where=str(out),
            expected="one that was generated",
            got=f"one that was imported from {begun.profile}",
            next_step="import it again into another folder",
        )
    return generate(
        begun.spec,
        begun.simulations,
        begun.seed,
        out,
        keep=begun.keep,
        resume=True,
        road=begun.road,
        simulator=begun.simulator,
        shard_size=begun.shard_size,
        balance=begun.balance,
        progress=progress,
        on_candidates=on_candidates,
    )


def load(path: str | Path) -> Dataset:
    """A complete data set.

    Raises:
        DatasetError: There is none, or it is not complete.
        SchemaError: It is of a newer version.
    """
    by = read_manifest(Path(path)).identity.simulator
    is_foreign = by in SIMULATORS and by not in BRANCHING
    return reading.load(Path(path), _simulator(by if is_foreign else "engine"))


def sample(
    profile: Profile,
    simulations: int,
    seed: int,
    *,
    first: int = 0,
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
) -> Scenario:
    """Draw scenarios.

    Args:
        profile: What to sample.
        simulations: How many.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        first: Number of the first one; each is the same in any batch.
        overrides: Dotted keys of the specification with other values.
        road: A road in place of the profile's.

    Raises:
        ConfigError: The specification or a number cannot be used.
        InfeasibleError: No such scenario fits on the road.
    """
    spec = scenarios.spec(profile, overrides)
    index = np.arange(first, first + simulations, dtype=np.uint64)
    return scenarios.sample(spec, _road(road or spec.road), seed, index)


def simulate(scenario: Scenario, *, simulator: str = "engine") -> Trajectories:
    """Simulate a batch.

    Args:
        scenario: A batch of scenarios.
        simulator: One of `SIMULATORS`; the results of `engine` and `reference` are the same, bit
            for bit.

    Raises:
        ConfigError: There is no such simulator, or it cannot run the scenario.
        MissingExtraError: The simulator is not installed.
    """
    return _simulator(simulator).simulate(scenario)


def compare(
    profile: Profile,
    simulations: int,
    seed: int,
    *,
    simulators: tuple[str, str] = ("engine", "sumo"),
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Simulate the same scenarios twice, and say how they end and where they part.

    Args:
        profile: What to sample.
        simulations: How many.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        simulators: Two of `SIMULATORS`.
        overrides: Dotted keys of the specification with other values.
        road: A road in place of the profile's.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: The specification or a number cannot be used, or there is no such simulator.
        MissingExtraError: A simulator is not installed.
    """
    spec = scenarios.spec(profile, overrides)
    place = _road(road or spec.road)
    chosen = [_simulator(name) for name in simulators]
    step = min(one.chunk_size for one in chosen)
    parts: list[Comparison] = []
    for first in range(0, _at_least_one(simulations), step):
        count = min(step, simulations - first)
        batch = sample(spec, count, seed, first=first, road=place)
        runs = [by.simulate(batch) for by in chosen]
        one, other = ((run, labelled(run).labels) for run in runs)
        parts.append(Comparison.of(simulators, one, other))
        if progress is not None:
            progress(first + count, simulations)
    return concatenate(parts)


def label(runs: Trajectories) -> Labelled:
    """What happened in recorded simulations, whether it was lawful, and what describes it.

    Args:
        runs: A batch from `simulate`, `branch` or any other source.

    Returns:
        Signals, events, findings, labels and features, one for each simulation.
    """
    return labelled(runs)


def relabel(data: str | Path, *, progress: Progress | None = None) -> Dataset:
    """Write the labels of a data set anew, by the rules of this version.

    Args:
        data: Folder of the data set.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        DatasetError: There is none, it is not complete or damaged, or another process writes it.
        SchemaError: It is of a newer version.
    """
    from overtaking.datasets.relabel import relabel as written_anew

    return written_anew(Path(data), _simulator("engine"), progress)


def branch(
    scenario: Scenario,
    frame: int,
    *,
    decision: Decision | None = None,
    weather: Weather | None = None,
    simulator: str = "engine",
) -> Trajectories:
    """Simulate again, with a decision or the weather changed from a frame on.

    Args:
        scenario: A batch of scenarios.
        frame: First frame that the change can affect; up to it, all is as it was.
        decision: Decision forced on every ego, at the first instant that allows it.
        weather: Weather of every simulation from then on, as long as the batch.
        simulator: One of `BRANCHING`.

    Raises:
        ConfigError: The frame is negative, or there is no such simulator.
    """
    run = _module(simulator, BRANCHING).run
    return branched(scenario, frame, decision=decision, weather=weather, run=run)


def export(
    data: Dataset | str | Path,
    out: str | Path,
    *,
    file_format: str = EXPORTS[0],
    progress: Progress | None = None,
) -> int:
    """Write a data set as a file of another program or paper.

    Args:
        data: The data set, or its folder.
        out: The paper's table is a file that ends in `.csv` or `.parquet`, replaced as a whole;
            the other formats are a folder, which must not exist or be empty, with one scenario or
            recording for each simulation.
        file_format: One of `EXPORTS`.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Number of rows or states written.

    Raises:
        ConfigError: There is no such format, the name does not fit it, or the folder is taken.
        DatasetError: The data set is not complete, or damaged.
        OSError: The file cannot be written.
    """
    if file_format not in EXPORTS:
        raise ConfigError.of(
            what=f"format {file_format}",
            where="export",
            expected=" or ".join(EXPORTS),
            got=file_format,
            next_step="choose one of them",
        )
    source = data if isinstance(data, Dataset) else load(data)
    if file_format in recording_export.FORMATS:
        return recording_export.write_folder(
            source.batches(),
            Path(out),
            file_format=file_format,
            total=len(source),
            road=source.road,
            progress=progress,
        )
    from overtaking.exchange import pinto2023  # It loads pandas, which nothing else here needs.

    def tables() -> Iterator[pa.Table]:
        for numbers, trajectories in source.batches():
            yield pinto2023.to_table(trajectories, numbers)
            if progress is not None:
                progress(int(numbers[-1]) + 1, len(source))

    return pinto2023.write_table(tables(), out)


def import_recording(
    file_format: str,
    path: str | Path,
    out: str | Path,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> Dataset:
    """Make a data set of a recording of others: every overtake in it becomes a simulation.

    Args:
        file_format: `commonroad` (XML 2018b or 2020a), `highd` or `pinto2023` (the paper's table).
        path: The file; of highD its `_tracks.csv`.
        out: Folder for the data set; it must not exist, or be empty.
        progress: Called with the number of simulations that are done, and of all.
        options: `attempts_only=True` leaves out vehicles that follow and never move left, and
            `vehicles` is how many a simulation has at most (both not for `pinto2023`); `lanelet`
            chooses a road of a CommonRoad file, `direction` (1, 2) one of highD, `road` (a `Road`)
            is where a `pinto2023` table was recorded.

    Returns:
        The complete, labelled data set; its manifest says what was found and what was measured.

    Raises:
        ConfigError: There is no such format, an option is not for it, or the folder is taken.
        ImportFormatError: The file cannot be used; the message names line and element or column.
        DatasetError: The folder cannot be written. Nothing is left behind.
    """
    from overtaking.datasets.importing import write_scenes
    from overtaking.exchange.recording_formats import read_recording

    read = read_recording(file_format, path, options)
    write_scenes(
        read.scenes,
        Path(out),
        file_format=file_format,
        files=read.files,
        options=read.options,
        on_piece=progress,
    )
    return load(out)


def statistics(
    data: Dataset | str | Path,
    *,
    policy: str = "paper",
    reading: str | None = None,
    weighted: bool = False,
) -> "Statistics":
    """The paper's tables, class frequencies and waiting times of a data set.

    Args:
        data: The data set, or its folder.
        policy: Which rules decide about the class: `paper`, `default` or `strict`.
        reading: How features are measured, `paper` or `matched`; as in `Dataset.features`.
        weighted: Whether to count each simulation by its importance weight.

    Raises:
        ConfigError: There is no such policy or reading.
        DatasetError: The data set is not complete, or damaged.
        SchemaError: The weights cannot be used.
    """
    from overtaking.stats.results import statistics as computed

    source = data if isinstance(data, Dataset) else load(data)
    frame = source.features(policy, reading=reading)
    return computed(frame, policy=policy, reading=reading, weighted=weighted)


def write_report(
    data: Dataset | str | Path,
    out: str | Path | None = None,
    *,
    policy: str = "paper",
    reading: str | None = None,
    weighted: bool = False,
    progress: Progress | None = None,
) -> "Report":
    """Write figures, tables and associations of a data set as one page that needs no network.

    Args:
        data: The data set, or its folder.
        out: Folder for the page, its figures and tables; `report` in that of the data set if not
            given. Files of an earlier report are replaced.
        policy: Which rules decide about the class: `paper`, `default` or `strict`.
        reading: How features are measured, `paper` or `matched`; as in `Dataset.features`.
        weighted: Whether to count each simulation by its importance weight.
        progress: Called with the number of parts that are done, and of all.

    Returns:
        Where it is, and what it could not show: without the extra `plots` it has no figures,
        without `stats` no associations.

    Raises:
        ConfigError: There is no such policy or reading.
        DatasetError: The data set is not complete, or damaged.
        OSError: A file cannot be written.
    """
    from overtaking.report.of_dataset import report_on

    source = data if isinstance(data, Dataset) else load(data)
    return report_on(
        source,
        None if out is None else Path(out),
        policy=policy,
        reading=reading,
        weighted=weighted,
        progress=progress,
    )


def carla_limits() -> "Limits":
    """Measure the limits of CARLA's Traffic Manager that the study met.

    Raises:
        MissingExtraError: CARLA's client is not installed.
        ConfigError: The server that `OVERTAKING_CARLA` names is not there or of another version.
        SimulationLostError: Client or server failed several times.
    """
    from overtaking.simulators import carla_company

    return carla_company.limits()


def replay_in_carla(
    data: Dataset | str | Path,
    out: str | Path,
    *,
    simulations: Iterable[int],
    size: tuple[int, int] = (800, 450),
    progress: Progress | None = None,
) -> "list[Replayed]":
    """Play recorded simulations in CARLA pose by pose, and film them from behind and from above.

    Args:
        data: The data set, or its folder; what it did not keep is simulated again.
        out: Folder for the films; made if missing. Each appears when it is complete.
        simulations: Their numbers.
        size: Width and height of the pictures, even numbers [pixels].
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        The films of each simulation.

    Raises:
        ConfigError: There is no such simulation or size, or the server that `OVERTAKING_CARLA`
            names is not there or of another version.
        MissingExtraError: CARLA's client or the encoder of films is not installed.
        SimulationLostError: Client or server failed several times.
    """
    from overtaking.exchange.opendrive_writer import write_opendrive
    from overtaking.simulators import carla_company, carla_replay

    source = data if isinstance(data, Dataset) else load(data)
    folder, chosen = Path(out), list(simulations)
    carla_replay.check_size(size)
    films: list[Replayed] = []
    for number in chosen:
        run = source.trajectory(number)
        job = carla_replay.ReplayJob(
            run=run,
            folder=folder.resolve(),
            name=f"{number:06d}",
            size=size,
            opendrive=None if carla_replay.map_of(run) else write_opendrive(run.road),
        )
        folder.mkdir(parents=True, exist_ok=True)
        films.append(carla_company.replay(job))
        if progress is not None:
            progress(len(films), len(chosen))
    return films


def serve_carla(
    *,
    port: int = 2000,
    host: str = "127.0.0.1",
    place: str | Path = "town06",
    seed: int = 1,
    ready: Callable[[int, int], None] | None = None,
    log: Callable[[str], None] | None = None,
) -> None:
    """Answer clients of CARLA 0.9.16 without CARLA, until the process is interrupted.

    Args:
        port: For calls; streams get the next one. 0 lets the system choose both.
        host: Address to listen on; whoever can reach it can use the server.
        place: The map: a road of the package, or an OpenDRIVE file.
        seed: Seed of gusts and puddles, 0 <= seed < 2**64.
        ready: Called with the ports of calls and streams when clients may come.
        log: Called with a line when something happens that a person may want to know.

    Raises:
        ConfigError: An argument cannot be used, or the port is taken.
        MissingExtraError: The map is a file, and CARLA's wheel is not there to read it.
    """
    from overtaking.carla_server.running import run_server

    run_server(
        port=port,
        host=host,
        place=place,
        seed=seed,
        ready=ready or _ignore,
        log=log or _ignore,
    )


def film(
    data: Dataset | str | Path,
    out: str | Path | None = None,
    *,
    simulations: Iterable[int] | str = "one-per-class",
    threads: int | None = None,
    progress: Progress | None = None,
) -> "list[Video]":
    """Film simulations from above, as mp4 files; each appears when it is complete.

    Args:
        data: The data set, or its folder; what it did not keep is simulated again.
        out: Folder for the files, `videos` in that of the data set if not given.
        simulations: Their numbers, `all`, or `one-per-class`: the first of each class.
        threads: How many films are made beside each other; all processors if not given.
        progress: Called with the number of films that are done, and of all.

    Raises:
        ConfigError: There is no such simulation.
        DatasetError: The data set is not complete or damaged, or the encoder failed.
        MissingExtraError: The extra `video` is not installed.
        OSError: A file cannot be written.
    """
    from overtaking.video import jobs, produce

    source = data if isinstance(data, Dataset) else load(data)
    folder = source.path / "videos" if out is None else Path(out)
    chosen = simulations if isinstance(simulations, str) else list(simulations)
    total = jobs.num_films(source, chosen)
    films = jobs.jobs(source, chosen)
    return produce.produce(films, folder, total=total, threads=threads, progress=progress)


def validate(
    profile: Profile,
    simulations: int = 1000,
    seed: int = 1,
    *,
    overrides: Mapping[str, Any] | None = None,
    road: str | Path | Road | None = None,
    progress: Progress | None = None,
) -> "Validation":
    """Hold the traffic of a profile against what is known of real traffic.

    Args:
        profile: What to sample.
        simulations: How many.
        seed: Seed of all random numbers, 0 <= seed < 2**64.
        overrides: Dotted keys of the specification with other values.
        road: A road in place of the profile's.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Each figure with its interval, target and verdict, and outcomes by weather;
        `plot_validation` draws it.

    Raises:
        ConfigError: The specification or a number cannot be used.
    """
    from overtaking.validation.run import validate as run

    spec = scenarios.spec(profile, overrides)
    number = _at_least_one(simulations)
    return run(spec, _road(road or spec.road), number, seed, progress)


def plot_validation(found: "Validation", out: str | Path) -> None:
    """Draw a validation as a PNG or SVG file, by its name.

    Args:
        found: What `validate` returned.
        out: The file, replaced as a whole.

    Raises:
        MissingExtraError: The extra `plots` is not installed.
        OSError: The file cannot be written.
    """
    from overtaking.plots.style import to_png, to_svg
    from overtaking.plots.validation import draw_validation
    from overtaking.report.files import put

    drawing, path = draw_validation(found), Path(out)
    content = to_svg(drawing) if path.suffix == ".svg" else to_png(drawing)
    put(path, content)


def literature(
    table: str,
    *,
    wanted: Iterable[str] = (),
    own: str | Path | Dataset | None = None,
    is_corrected: bool = True,
) -> dict[str, Any]:
    """What the source paper says of the literature, with corrections and sources.

    Args:
        table: `systems`, `datasets`, `factors` or `studies`.
        wanted: What a data set must have, such as `night` or `boxes3d`.
        own: A data set of one's own to put below the others.
        is_corrected: Whether corrections are applied; if not, values are as printed.

    Returns:
        `rows` by the names of their columns, and `references` by their ids.

    Raises:
        ConfigError: There is no such table, or no such thing can be wanted.
        DatasetError: One's own data set is not complete or damaged.
    """
    from overtaking.literature.answers import answer

    data = own if own is None or isinstance(own, Dataset) else load(own)
    return answer(table, wanted=tuple(wanted), own=data, is_corrected=is_corrected)


def query(
    data: str | Path | Dataset,
    sql: str,
    *,
    max_rows: int = 10_000,
    timeout_s: float = 60.0,
    memory_mib: int = 1024,
) -> "Answer":
    """Ask a data set a question in SQL (DuckDB's), which reads its tables and nothing else.

    Args:
        data: The data set, or its folder.
        sql: One SELECT, DESCRIBE, SUMMARIZE or SHOW. The tables have their own names; the source
            paper's entities are views, such as `paper.EgoVehicle`.
        max_rows: How many rows to give at most.
        timeout_s: How long it may take [s].
        memory_mib: How much memory the database may use [MiB].

    Returns:
        Names of the columns, the rows, and whether there are more.

    Raises:
        ConfigError: It is no query, is wrong, or needs more time or memory than it may.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `sql` is not installed.
    """
    from overtaking.database import query as asking

    source = data if isinstance(data, Dataset) else load(data)
    return asking.query(source, sql, max_rows=max_rows, timeout_s=timeout_s, memory_mib=memory_mib)


def entity_relationship_diagram(form: str = "svg", out: str | Path | None = None) -> str:
    """The diagram of the tables of a data set, drawn from their schemas.

    Args:
        form: `svg` or `mermaid`.
        out: File to write it to; it appears whole or not at all.

    Returns:
        The diagram.

    Raises:
        ConfigError: There is no such form.
        OSError: The file cannot be written.
    """
    from overtaking.database.diagram import diagram

    text = diagram(form)
    if out is not None:
        from overtaking.report.files import put

        put(Path(out), text.encode())
    return text


def _ignore(*_: object) -> None:
    """Where nobody wants to be told."""


def _simulator(name: str) -> Simulator:
    """A simulator by its name."""
    module = _module(name)
    if name in BRANCHING:
        return Simulator(
            name=name,
            version=MODEL_VERSION,
            simulate=module.simulate,
            threads=os.cpu_count() or 1,
        )
    return Simulator(
        name=name,
        version=module.version(),
        simulate=module.simulate,
        unknown=module.UNKNOWN,
        chunk_size=module.CHUNK_SIZE,
        shard_size=module.SHARD_SIZE,
    )


def _module(name: str, among: tuple[str, ...] = SIMULATORS) -> ModuleType:
    """The module of a simulator."""
    if name not in among:
        raise ConfigError.of(
            what="simulator",
            where="simulate",
            expected=" or ".join(among),
            got=name,
            next_step="choose one of them",
        )
    return importlib.import_module(_HOMES[name])


def _at_least_one(simulations: int) -> int:
    if simulations < 1:
        raise ConfigError.of(
            what="simulations",
            where="compare",
            expected="1 or more",
            got=simulations,
            next_step="choose a number in that range",
        )
    return simulations


def _keep(name: str) -> Keep:
    try:
        return Keep(name)
    except ValueError:
        raise ConfigError.of(
            what="keep",
            where="generate",
            expected=" or ".join(Keep),
            got=name,
            next_step="choose one of them",
        ) from None


def _road(road: str | Path | Road) -> Road:
    return road if isinstance(road, Road) else load_road(road)
