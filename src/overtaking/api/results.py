"""Results from a data set or a profile: statistics, reports, films, queries."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.api.choices import Count, Profile, Seed, road_of, simulator_of
from overtaking.api.data import load_dataset
from overtaking.core.errors import ConfigError, check_extra
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.labels.label import LabelledTrajectories
from overtaking.labels.law import choose_policy
from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_argument, check_arguments
from overtaking.model.road import Road
from overtaking.model.trajectories import Trajectories
from overtaking.scenarios import profiles

if TYPE_CHECKING:
    from overtaking.analysis.database.query import Answer
    from overtaking.analysis.reproduction.run import Reproduction
    from overtaking.analysis.stats.results import Statistics
    from overtaking.analysis.validation.run import Validation
    from overtaking.show.report.reproduction import Written
    from overtaking.show.report.write import Report
    from overtaking.show.server.running import ViewServer
    from overtaking.show.video.produce import Video
    from overtaking.show.view.write import ViewPage


@check_arguments
def dataset_statistics(
    data: Dataset | str | Path,
    *,
    policy: str | None = None,
    reading: str | None = None,
    weighted: bool = False,
) -> "Statistics":
    """The paper's tables, class frequencies and waiting times of a data set.

    Args:
        data: The data set, or its folder.
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

    source = load_dataset(data)
    policy_name = choose_policy(policy, source.profile)
    frame = source.features(policy_name, reading=reading)
    return computed(frame, policy=policy_name, reading=reading, weighted=weighted)


@check_arguments
def write_report(
    data: Dataset | str | Path,
    out: str | Path | None = None,
    *,
    policy: str | None = None,
    reading: str | None = None,
    weighted: bool = False,
    learn: bool = False,
    progress: ProgressCallback | None = None,
) -> "Report":
    """Write figures, tables and associations of a data set as one page that needs no network.

    Args:
        data: The data set, or its folder.
        out: Folder for the page, its figures and tables; `report` in that of the data set if not
            given. Files of an earlier report are replaced.
        policy: Which rules decide about the class: `paper`, `default` or `strict`; None for the
            default of the profile.
        reading: How features are measured, `paper` or `matched`; as in `Dataset.features`.
        weighted: Whether to count each simulation by its importance weight.
        learn: Whether to learn rules and factors too, which takes minutes.
        progress: Called with the number of parts that are done, and of all.

    Returns:
        Where it is, and what it could not show: without the extra `plots` it has no figures,
        without `stats` no associations, without `learn` nothing learned.

    Raises:
        ConfigError: There is no such policy or reading.
        DatasetError: The data set is not complete, or damaged.
        OSError: A file cannot be written.
    """
    from overtaking.show.report.of_dataset import report_on

    source = load_dataset(data)
    return report_on(
        source,
        None if out is None else Path(out),
        policy=policy,
        reading=reading,
        weighted=weighted,
        is_learned=learn,
        progress=progress,
    )


@check_arguments
def film(
    source: Dataset | str | Path | Trajectories | LabelledTrajectories,
    out: str | Path | None = None,
    *,
    simulations: Iterable[int] | str = "one-per-class",
    policy: str | None = None,
    threads: int | None = None,
    progress: ProgressCallback | None = None,
) -> "list[Video]":
    """Film simulations from above, as mp4 files; each appears when it is complete.

    Args:
        source: A data set or its folder, trajectories of any origin, or what `label` returned. What
            a data set did not keep is simulated again; trajectories are labelled first.
        out: Folder for the files; if not given, `videos` in the folder of the data set, or in the
            working folder.
        simulations: Their numbers (for trajectories, their indices in the batch from 0 on), `all`,
            or `one-per-class`: the first of each class that lasts 2 s or more.
        policy: Which rules decide about the class: `paper`, `default` or `strict`; None for the
            default of the profile. Breaches of other rules are grey.
        threads: How many films are made beside each other; all processors if not given.
        progress: Called with the number of films that are done, and of all.

    Raises:
        ConfigError: There is no such simulation or policy.
        DatasetError: The data set is not complete or damaged, or the encoder failed.
        MissingExtraError: The extra `video` is not installed.
        OSError: A file cannot be written.
    """
    from overtaking.show.video import jobs, produce

    runs = load_dataset(source) if isinstance(source, (str, Path)) else source
    home = runs.path if isinstance(runs, Dataset) else Path()
    folder = home / "videos" if out is None else Path(out)
    chosen = simulations if isinstance(simulations, str) else list(simulations)
    total = jobs.num_films(runs, chosen)
    films = jobs.jobs(runs, chosen, policy)
    return produce.produce(films, folder, total=total, threads=threads, progress=progress)


@check_arguments
def write_viewer_page(
    source: Dataset | str | Path | Trajectories | LabelledTrajectories,
    out: str | Path,
    *,
    simulations: Iterable[int] | str = "one-per-class",
    policy: str | None = None,
    progress: ProgressCallback | None = None,
    say: Callable[[int], None] | None = None,
) -> "ViewPage":
    """Write simulations as one page to look at in a browser, from disk and without a network.

    Args:
        source: A data set or its folder, trajectories of any origin, or what `label` returned. What
            a data set did not keep is simulated again; trajectories are labelled first.
        out: The file; an existing one is replaced as a whole.
        simulations: Their numbers (for trajectories, their indices in the batch from 0 on), `all`,
            or `one-per-class`: the first of each class that lasts 2 s or more.
        policy: Which rules decide about the class when the page opens: `paper`, `default` or
            `strict`; None for the default of the profile. The page can change it.
        progress: Called with the number of simulations that are done, and of all.
        say: Called with the size of a large page before it is written [bytes].

    Returns:
        Where it is, which simulations it has, and how large it is.

    Raises:
        ConfigError: There is no such simulation or policy, or the page would be larger than 64 MB.
        DatasetError: The data set is not complete or damaged.
        OSError: The file cannot be written.
    """
    from overtaking.show.view.write import write

    runs = load_dataset(source) if isinstance(source, (str, Path)) else source
    chosen = simulations if isinstance(simulations, str) else list(simulations)
    return write(runs, Path(out), chosen=chosen, policy=policy, progress=progress, say=say)


@check_arguments
def serve_viewer(
    data: str | Path | Dataset,
    *,
    policy: str | None = None,
    port: Annotated[int, FieldSpec(low=0, high=65535)] = 0,
    ready: Callable[[str], None] | None = None,
) -> "ViewServer | None":
    """Show a whole data set in the browser of this machine.

    The server listens on the loopback address only, and writes nothing into the data set. Outside
    an event loop the call ends when the process is interrupted. Inside a running event loop, such
    as that of a notebook, it returns at once, and the server goes on in the background.

    Args:
        data: The data set, or its folder.
        policy: Which rules decide about the class when the page opens: `paper`, `default` or
            `strict`; None for the default of the profile. The page can change it.
        port: To listen on; 0 lets the system choose.
        ready: Called with the address of the page once the server has answered a request. The
            token in the address opens the page once. If left out, the address is printed; a
            notebook shows it as a link in any case.

    Returns:
        Inside a running event loop the server, with `url` and `close`, which is also a context
        manager.

    Raises:
        ConfigError: There is no such policy, or the port is taken.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `view` is not installed.
    """
    check_extra(
        "view",
        "starlette",
        "uvicorn",
        what="Starlette and uvicorn, which serve the page",
        where="view",
        otherwise="write a page with --export",
    )
    from overtaking.show.server.running import serve

    return serve(load_dataset(data), policy=policy, port=port, ready=ready)


@check_arguments
def validate_profile(
    profile: Profile,
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
        recordings: A recording in CommonRoad's format, or a folder of them: what the profile's
            drivers do in traffic as dense as theirs is compared with what they show.

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
    validation = run(spec, road_of(road or spec.road), num_simulations, seed, progress, where)
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
        `write_reproduction` makes a page of it.

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
    return run(spec, road_of(spec.road), num_replicates, seed, simulator_of("engine"), progress)


def write_reproduction(found: "Reproduction", out: str | Path) -> "Written":
    """Write a reproduction as one page that needs no network.

    Args:
        found: What `reproduce` returned.
        out: Folder for the page, its figures and tables; files of an earlier one are replaced.

    Returns:
        Where it is, and what it could not show: without the extra `plots` it has no figures.

    Raises:
        OSError: A file cannot be written.
    """
    from overtaking.analysis.reproduction.run import Reproduction
    from overtaking.show.report.reproduction import write_reproduction as write

    check_argument(found, Reproduction, "write_reproduction", "found")
    return write(found, Path(check_argument(out, str | Path, "write_reproduction", "out")))


@check_arguments
def literature(
    table: str,
    *,
    wanted: Iterable[str] = (),
    own: str | Path | Dataset | None = None,
    is_corrected: bool = True,
) -> dict[str, Any]:
    """The source paper's tables of the literature, with corrections and sources.

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
    from overtaking.analysis.literature.answers import answer

    data = None if own is None else load_dataset(own)
    return answer(table, wanted=tuple(wanted), own=data, is_corrected=is_corrected)


@check_arguments
def sql(
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
        memory_mib: How much memory the database may use [MiB]; the answer may take an eighth of it.

    Returns:
        Names of the columns, the rows, and whether there are more.

    Raises:
        ConfigError: It is no query, is wrong, or needs more time or memory than it may.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `sql` is not installed.
    """
    from overtaking.analysis.database import query as asking

    source = load_dataset(data)
    return asking.query(source, sql, max_rows=max_rows, timeout_s=timeout_s, memory_mib=memory_mib)


@check_arguments
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
    from overtaking.analysis.database.diagram import diagram

    text = diagram(form)
    if out is not None:
        from overtaking.core.files import write_atomically

        write_atomically(Path(out), text.encode())
    return text
