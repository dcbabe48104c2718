"""Figures, films and pages of data sets and results."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, overload

from overtaking.api.datasets import load_dataset
from overtaking.core.errors import ConfigError, check_extra
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.labels.label import LabelledTrajectories
from overtaking.labels.law import choose_policy
from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_arguments
from overtaking.model.trajectories import Trajectories

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from overtaking.analysis.evaluation.benchmark import BenchmarkResult
    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.analysis.reproduction.run import Reproduction
    from overtaking.analysis.whatif.twin import Twin
    from overtaking.show.report.evaluation import Evaluated
    from overtaking.show.report.files import Written
    from overtaking.show.report.write import Report
    from overtaking.show.server.running import ViewServer
    from overtaking.show.video.produce import Video
    from overtaking.show.view.write import ViewPage


@check_arguments
def plot(
    source: Any,
    figure: str | None = None,
    *,
    out: str | Path | None = None,
    ax: Any = None,
    width: str = "page",
    policy: str | None = None,
) -> "Figure":
    """Draw a figure of a data set or of a result.

    Args:
        source: A data set or its folder; the result of `dataset_statistics`, `validate_profile`,
            `evaluate`, `reproduce_study`, `learning.learn_factors`, `law.tolerance_curve`,
            `whatif.counterfactual` or `whatif.outcome_fan`; or the roads of
            `list_opendrive_roads`.
        figure: Name of the figure, needed where the source has several. A data set has the
            figures of its report, such as `classes` or `waiting-time`. The error for an unknown
            name lists all names.
        out: File for the figure, replaced as a whole: `.svg`, `.pdf` or `.png` by its name.
        ax: Axes of Matplotlib to draw into; only for figures with single axes.
        width: `column` (3.5 inches, one column of a paper) or `page` (7.16 inches, both columns).
            The figure is laid out for this width; the size of its letters does not change.
        policy: Policy that decides about the classes of a data set or of twins; None for the
            default of the profile.

    Returns:
        The Matplotlib figure; with `ax`, the figure that `ax` belongs to.

    Raises:
        ConfigError: The source has no figures, no figure or width has this name, or the figure
            cannot be drawn into `ax`.
        DatasetError: The data set is not complete or damaged, or has too little to draw.
        MissingExtraError: The extra `plots` is not installed.
        OSError: The file cannot be written.
    """
    from overtaking.show.report.figures import draw
    from overtaking.show.report.files import check_figure_file, put_figure

    path = None if out is None else Path(out)
    if path is not None:
        check_figure_file(path)
    if isinstance(source, str | Path):
        source = load_dataset(source)
    drawn = draw(source, figure, axes=ax, width=width, policy=policy)
    if path is not None:
        put_figure(path, drawn)
    return drawn


@overload
def write_report(
    source: Dataset | str | Path,
    out: str | Path | None = None,
    *,
    policy: str | None = None,
    reading: str | None = None,
    weighted: bool = False,
    learn: bool = False,
    progress: ProgressCallback | None = None,
) -> "Report": ...


@overload
def write_report(
    source: "Evaluation",
    out: str | Path,
    *,
    films: int = 10,
    progress: ProgressCallback | None = None,
) -> "Evaluated": ...


@overload
def write_report(
    source: "BenchmarkResult",
    out: str | Path,
    *,
    films: int = 10,
    progress: ProgressCallback | None = None,
) -> "list[Evaluated]": ...


@overload
def write_report(source: "Reproduction", out: str | Path) -> "Written": ...


@check_arguments
def write_report(
    source: Any,
    out: str | Path | None = None,
    *,
    policy: str | None = None,
    reading: str | None = None,
    weighted: bool = False,
    learn: bool = False,
    films: Annotated[int, FieldSpec(low=0, high=10)] | None = None,
    progress: ProgressCallback | None = None,
) -> "Written | list[Evaluated]":
    """Write a data set, an evaluation or a reproduction as a page that needs no network.

    Args:
        source: A data set or its folder, or a result of `evaluate`, `run_benchmark` or
            `reproduce_study`. Each profile of a benchmark has a page in a folder of its name.
        out: Folder for the page, its figures and tables; files of an earlier report are replaced.
            Only the report on a data set has a default: the folder `report` of the data set.
        policy: Policy that decides about the class: `paper`, `default` or `strict`; None for the
            default of the profile. Only for data sets.
        reading: How features are measured, `paper` or `matched`; as in `Dataset.features`. Only
            for data sets.
        weighted: Whether each simulation counts by its importance weight. Only for data sets.
        learn: Whether rules and factors are learned too, which takes minutes. Only for data sets.
        films: Number of films of the worst scenes, 0 to 10; 10 if left out. Only for evaluations.
        progress: Called with the number of parts or films that are done, and of all.

    Returns:
        Path of the page and remarks on missing parts: without the extra `plots` a page has no
        figures, without `stats` no associations, without `learn` no learned rules, without `video`
        no films.

    Raises:
        ConfigError: The source has no report, the policy or reading is unknown, or an option is
            not for this source.
        DatasetError: The data set is not complete, or damaged.
        OSError: A file cannot be written.
    """
    if isinstance(source, Dataset | str | Path):
        from overtaking.show.report.of_dataset import report_on

        _check_unused("write_report", "a data set", films=films)
        return report_on(
            load_dataset(source),
            None if out is None else Path(out),
            policy=policy,
            reading=reading,
            weighted=weighted,
            is_learned=learn,
            progress=progress,
        )
    name = type(source).__name__
    options = {"policy": policy, "reading": reading, "weighted": weighted, "learn": learn}
    from overtaking.analysis.evaluation.benchmark import BenchmarkResult
    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.analysis.reproduction.run import Reproduction

    if not isinstance(source, Evaluation | BenchmarkResult | Reproduction):
        raise ConfigError(
            what="source",
            where="write_report",
            expected="a data set, or what evaluate, run_benchmark or reproduce_study returned",
            got=f"an object of type {name}",
            next_step="give one of them; plot draws figures of other results",
        )
    _check_unused("write_report", f"a {name}", **options)
    if out is None:
        raise ConfigError(
            what="out",
            where="write_report",
            expected=f"a folder for the page on a {name}",
            got="None",
            next_step="name a folder",
        )
    folder = Path(out)
    if isinstance(source, Reproduction):
        from overtaking.show.report.reproduction import write_reproduction

        _check_unused("write_report", f"a {name}", films=films)
        return write_reproduction(source, folder)
    return _write_evaluation(source, folder, 10 if films is None else films, progress)


def _write_evaluation(
    result: "Evaluation | BenchmarkResult",
    folder: Path,
    films: int,
    progress: ProgressCallback | None,
) -> "Evaluated | list[Evaluated]":
    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.show.report.evaluation import write

    if isinstance(result, Evaluation):
        return write(result, folder, films=films, progress=progress)
    return [
        write(
            evaluation,
            folder / evaluation.profile,
            films=films,
            benchmark=result.title,
            progress=progress,
        )
        for evaluation in result.evaluations
    ]


def _check_unused(where: str, source: str, **options: Any) -> None:
    """Refuse options that are set and do not apply to this kind of source."""
    for name, value in options.items():
        if value not in (None, False):
            raise ConfigError(
                what=name,
                where=where,
                expected=f"no such option for {source}",
                got=value,
                next_step="leave it out",
            )


@overload
def film(
    source: Dataset | str | Path | Trajectories | LabelledTrajectories,
    out: str | Path | None = None,
    *,
    simulation_ids: Iterable[int] | str = "one-per-class",
    policy: str | None = None,
    threads: int | None = None,
    progress: ProgressCallback | None = None,
) -> "list[Video]": ...


@overload
def film(source: "Twin", out: str | Path, *, policy: str | None = None) -> Path: ...


@check_arguments
def film(
    source: Any,
    out: str | Path | None = None,
    *,
    simulation_ids: Iterable[int] | str = "one-per-class",
    policy: str | None = None,
    threads: int | None = None,
    progress: ProgressCallback | None = None,
) -> "list[Video] | Path":
    """Film simulations from above, as mp4 files; each file appears when it is complete.

    Args:
        source: A data set or its folder, trajectories, the result of `label`, or a `Twin`, whose
            two simulations appear one above the other. Frames that a data set does not keep
            are simulated again. Trajectories are labelled first.
        out: Folder for the films; `films` in the folder of the data set, or in the working folder,
            if left out. For a twin the mp4 file, in a folder that exists.
        simulation_ids: Numbers of the simulations, `all`, or `one-per-class`: the first simulation
            of each class that lasts 2 s or more. Trajectories are counted from 0. Not for twins.
        policy: Policy that decides about the class: `paper`, `default` or `strict`; None for the
            default of the profile. Breaches of other rules are grey.
        threads: Number of films that are made at the same time; one per processor if left out. Not
            for twins.
        progress: Called with the number of films that are done, and of all. Not for twins.

    Returns:
        A `Video` for each simulation; for a twin, the path of its film.

    Raises:
        ConfigError: The source cannot be filmed, or a simulation or policy does not exist.
        DatasetError: The data set is not complete or damaged, or the encoder failed.
        MissingExtraError: The extra `video` is not installed.
        OSError: A file cannot be written.
    """
    from overtaking.show.video import jobs, produce

    if isinstance(source, str | Path):
        source = load_dataset(source)
    if not isinstance(source, Dataset | Trajectories | LabelledTrajectories):
        selection = None if simulation_ids == "one-per-class" else simulation_ids
        _check_unused("film", "a twin", simulation_ids=selection, threads=threads)
        return _film_twin(source, out, policy)
    home = source.path if isinstance(source, Dataset) else Path()
    folder = home / "films" if out is None else Path(out)
    selection = simulation_ids if isinstance(simulation_ids, str) else list(simulation_ids)
    total = jobs.num_films(source, selection)
    films = jobs.jobs(source, selection, policy)
    return produce.produce(films, folder, total=total, threads=threads, progress=progress)


def _film_twin(twin: Any, out: str | Path | None, policy: str | None) -> Path:
    """Film a simulation above its twin."""
    from overtaking.analysis.whatif.twin import Twin
    from overtaking.show.video.encode import require, write_film
    from overtaking.show.video.twin import TwinFilm

    if not isinstance(twin, Twin):
        raise ConfigError(
            what="source",
            where="film",
            expected="a data set, trajectories, what label returned, or a Twin",
            got=f"an object of type {type(twin).__name__}",
            next_step="give one of them",
        )
    if out is None:
        raise ConfigError(
            what="out",
            where="film",
            expected="an mp4 file for the film of a twin",
            got="None",
            next_step="name a file",
        )
    require()
    path, policy_name = Path(out), choose_policy(policy, twin.profile)
    title = f"Simulation {twin.number} and its twin, policy {policy_name}"
    write_film(TwinFilm(twin, policy), path, title=title)
    return path


@check_arguments
def write_viewer_page(
    source: Dataset | str | Path | Trajectories | LabelledTrajectories,
    out: str | Path,
    *,
    simulation_ids: Iterable[int] | str = "one-per-class",
    policy: str | None = None,
    progress: ProgressCallback | None = None,
    say: Callable[[int], None] | None = None,
) -> "ViewPage":
    """Write simulations as one page to look at in a browser, from disk and without a network.

    Args:
        source: A data set or its folder, trajectories of any origin, or the result of `label`.
            Frames that a data set does not keep are simulated again. Trajectories are labelled
            first.
        out: The file; an existing one is replaced as a whole.
        simulation_ids: Numbers of the simulations, `all`, or `one-per-class`: the first simulation
            of each class that lasts 2 s or more. Trajectories are counted from 0.
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
    selection = simulation_ids if isinstance(simulation_ids, str) else list(simulation_ids)
    return write(runs, Path(out), chosen=selection, policy=policy, progress=progress, say=say)


@check_arguments
def serve_viewer(
    dataset: str | Path | Dataset,
    *,
    policy: str | None = None,
    port: Annotated[int, FieldSpec(low=0, high=65535)] = 0,
    ready: Callable[[str], None] | None = None,
) -> "ViewServer | None":
    """Show a whole data set in the browser of this machine.

    The server listens on the loopback address only, and writes nothing into the data set. Outside
    an event loop the call ends when the process is interrupted. Inside the event loop of a notebook
    it returns at once, and the server goes on in the background.

    Args:
        dataset: The data set, or its folder.
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

    return serve(load_dataset(dataset), policy=policy, port=port, ready=ready)
