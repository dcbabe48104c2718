"""Public functions that draw figures, write pages and films, and show a data set in the browser.

A *data set* is a folder of tables with many simulations of one *ego*, the vehicle whose overtaking
is studied. *Trajectories* are the recorded motion of a batch of simulations in memory; `label` adds
verdicts of the law and classes. *Class*: the result of a simulation, such as `Success_L`
(completed, legal). *Policy*: the set of rules of law that decides between legal and illegal:
`paper` (the rules that the reproduced study can decide), `default` (also rules that need weather
and road) or `strict` (also signals, lamps and keeping right). *Profile*: the setting that
simulations are drawn from. Its policy is `paper` for the profiles of the study, else `default`.
*Twin*: a simulation and the same simulation after a change, made by `whatif.counterfactual`.

Drawing packages are optional extras and slow to load, so they are imported inside the functions.
`check_arguments` raises a `ConfigError` for an argument of another type than its annotation; where
a function has `@overload` variants, it checks the last, most general one.
"""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, overload

from overtaking.api.datasets import load_dataset
from overtaking.core.errors import ConfigError, check_extra
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.labels.labelling import LabelledTrajectories
from overtaking.labels.law.judging import choose_policy
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
        source: A data set or its folder or URL; the result of `dataset_statistics`,
            `validate_profile`, `evaluate`, `reproduce_study`, `learning.learn_factors`,
            `law.tolerance_curve`, `whatif.counterfactual` or `whatif.outcome_fan`; or the roads of
            `list_opendrive_roads`.
        figure: Name of the figure; may be None if the source has only one. A data set has the
            figures of its report, such as `classes` or `waiting-time`. The error for an unknown
            name lists all names.
        out: File for the figure, `.svg`, `.pdf` or `.png`; an existing file is replaced. None
            writes no file.
        ax: Axes of Matplotlib to draw into, for figures with one diagram; None for a new figure.
        width: `column` (3.5 inches, one column of a paper with two) or `page` (7.16 inches, both
            columns). Letters have the same size in both.
        policy: Policy for the classes of a data set or a twin: `paper`, `default` or `strict`; None
            for the policy of the profile.

    Returns:
        The Matplotlib figure; with `ax`, the figure that `ax` belongs to.

    Raises:
        ConfigError: The source has no figures, no figure or width has this name, or the figure
            cannot be drawn into `ax`.
        DatasetError: The data set is not complete or damaged, or has too few simulations to draw.
        MissingExtraError: The extra `plots` is not installed.
        OSError: The file cannot be written.
    """
    from overtaking.show.report.figures import draw
    from overtaking.show.report.files import check_figure_file
    from overtaking.show.report.files import put_figure as write_figure

    path = None if out is None else Path(out)
    if path is not None:
        check_figure_file(path)  # Refuses an ending such as `.bmp` before the work of a minute.
    if isinstance(source, str | Path):
        source = load_dataset(source)
    drawn = draw(source, figure, axes=ax, width=width, policy=policy)
    if path is not None:
        write_figure(path, drawn)
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
    """Write a report on a data set, an evaluation or a reproduction as an HTML page.

    The page refers to files of its folder only, so it can be read without a network.

    Args:
        source: A data set or its folder or URL; or the result of `evaluate`, `run_benchmark` (a
            page for each profile, in a folder of its name) or `reproduce_study`.
        out: Folder for the page, its figures and tables; an earlier report in it is replaced. May
            be None for a data set only: then the folder `report` in the data set.
        policy: Only for data sets. Policy for the classes: `paper`, `default` or `strict`; None for
            the policy of the profile.
        reading: Only for data sets. How the features (columns that describe a simulation) are
            measured. `paper`: at the start of the overtake, or, without an overtake, as means over
            the simulation, as in the study that the package reproduces. `matched`: at the start of
            the overtake, or, without an overtake, at an instant after a random waiting time. These
            waiting times behind the vehicle ahead are distributed like the ones before overtakes.
            None for `paper` with the policy `paper`, else `matched`.
        weighted: Only for data sets. Whether statistics use the weights of the simulations, which
            restore natural shares where rare cases were drawn more often.
        learn: Only for data sets. Whether rules and factors are learned too, which takes minutes.
        films: Only for evaluations and benchmarks. Number of films of the worst scenes (collisions
            first, then near-crashes, then breaches), 0 to 10; None for 10, as an evaluation keeps
            its ten worst scenes.
        progress: Called with the number of parts or films that are done, and of all. For a
            reproduction it is accepted, but never called: its page is written in one step.

    Returns:
        A `Written` (`Report` and `Evaluated` are kinds of it), or a list of them for a benchmark:
        `path` of the page, names of its figures and tables, and `remarks` on missing parts. Without
        the extra `plots` a page has no figures, without `stats` no associations, without `learn`
        no learned rules, without `video` no films.

    Raises:
        ConfigError: The source has no report, the policy or reading is unknown, or an option does
            not apply to this source.
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
    # Imported here, because reports on data sets do not need these slow modules.
    from overtaking.analysis.evaluation.benchmark import BenchmarkResult
    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.analysis.reproduction.run import Reproduction

    name = type(source).__name__
    if not isinstance(source, Evaluation | BenchmarkResult | Reproduction):
        raise ConfigError(
            what="source",
            where="write_report",
            expected="a data set, or what evaluate, run_benchmark or reproduce_study returned",
            got=f"an object of type {name}",
            next_step="give one of them; plot draws figures of other results",
        )
    dataset_options = {"policy": policy, "reading": reading, "weighted": weighted, "learn": learn}
    _check_unused("write_report", f"a {name}", **dataset_options)
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
    """Write the page of an evaluation, or the pages of a benchmark's evaluations."""
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
    """Refuse options that the caller has set and that do not apply to this kind of source.

    None and False, the defaults, mean that an option is not set.
    """
    for name, value in options.items():
        if value is not None and value is not False:
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
        source: A data set or its folder or URL, trajectories, the result of `label`, or a `Twin`,
            whose two simulations appear one above the other. If a data set keeps no positions, they
            are simulated again. Trajectories without labels are labelled.
        out: Folder for the films. None for the folder `films` in the folder of the data set, or in
            the working folder for trajectories. For a twin the mp4 file, in an existing folder.
        simulation_ids: Numbers of the simulations, from 0 in a data set as in trajectories; `all`;
            or `one-per-class`, the first simulation of each class that lasts 2 s or more (no
            overtake fits into a shorter one), or the longest if all are shorter. Not for twins.
        policy: Policy for the class: `paper`, `default` or `strict`; None for the policy of the
            profile. Breaches of rules that it does not require are drawn in grey.
        threads: Number of films that are made at the same time; None for one per processor. Not for
            twins.
        progress: Called with the number of films that are done, and of all; never for a twin, which
            has one film.

    Returns:
        For each simulation `number`, `path`, `num_frames` and `label` (its class); for a twin, the
        path of its film.

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
        # Anything else must be a twin; `_film_twin` refuses it if not.
        # A caller may name the default value; that is no error.
        set_ids = None if simulation_ids == "one-per-class" else simulation_ids
        _check_unused("film", "a twin", simulation_ids=set_ids, threads=threads)
        return _film_twin(source, out, policy)
    if out is not None:
        folder = Path(out)
    else:
        folder = (source.path if isinstance(source, Dataset) else Path()) / "films"
    selection = simulation_ids if isinstance(simulation_ids, str) else list(simulation_ids)
    total = jobs.num_films(source, selection)
    # An iterator: simulations are read as films get made, not all at once.
    films = jobs.jobs(source, selection, policy)
    return produce.produce(films, folder, total=total, threads=threads, progress=progress)


def _film_twin(twin: Any, out: str | Path | None, policy: str | None) -> Path:
    """Film a simulation above its changed twin; arguments as in `film`."""
    from overtaking.analysis.whatif.twin import Twin
    from overtaking.show.video.encode import require as require_encoder
    from overtaking.show.video.encode import write_film
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
    require_encoder()
    path, policy_name = Path(out), choose_policy(policy, twin.profile)
    title = f"Simulation {twin.number} and its twin, policy {policy_name}"
    write_film(TwinFilm(twin, policy_name), path, title=title)
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
    """Write simulations as one HTML file that shows them in motion, without a network.

    Args:
        source: A data set or its folder or URL, trajectories, or the result of `label`. If a data
            set keeps no positions, they are simulated again. Trajectories are labelled.
        out: The file; an existing one is replaced.
        simulation_ids: As in `film`.
        policy: Policy for the class when the page opens: `paper`, `default` or `strict`; None for
            the policy of the profile. The page has a menu to change it.
        progress: Called with the number of simulations that are done, and of all.
        say: Called before a page above 8 MB is written, with its size [bytes], to warn the user:
            such a page is too large for an e-mail.

    Returns:
        `path`, `simulations` (their numbers) and `size_bytes`.

    Raises:
        ConfigError: There is no such simulation or policy, or the page would be larger than 64 MB
            (a choice: phones open pages up to this size without delay).
        DatasetError: The data set is not complete or damaged.
        OSError: The file cannot be written.
    """
    from overtaking.show.view.write import write as write_page

    simulations = load_dataset(source) if isinstance(source, (str, Path)) else source
    selection = simulation_ids if isinstance(simulation_ids, str) else list(simulation_ids)
    return write_page(
        simulations, Path(out), chosen=selection, policy=policy, progress=progress, say=say
    )


@check_arguments
def serve_viewer(
    dataset: str | Path | Dataset,
    *,
    policy: str | None = None,
    port: Annotated[int, FieldSpec(low=0, high=65535)] = 0,
    ready: Callable[[str], None] | None = None,
) -> "ViewServer | None":
    """Start a web server that shows a whole data set in the browser of this machine.

    Only programs of this machine can connect (it listens on the loopback address), and the data set
    is not changed. In a script the call blocks until Ctrl-C. In a notebook, where an event loop
    runs, it returns at once and the server runs in the background.

    Args:
        dataset: The data set, or its folder or URL.
        policy: Policy for the class when the page opens: `paper`, `default` or `strict`; None for
            the policy of the profile. The page has a menu to change it.
        port: Port to listen on, 0 to 65535; 0 lets the system choose.
        ready: Called with the URL of the page once the server answers requests. The URL contains a
            secret token that opens the page once. None prints the URL; a notebook always shows it
            as a link.

    Returns:
        In a notebook the server, with `url` and `close`, also for use in a `with` statement; None
        in a script.

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
        where="view",  # The command that calls this function; Python gets the same error.
        otherwise="write a page with --export or write_viewer_page",
    )
    from overtaking.show.server.running import serve

    return serve(load_dataset(dataset), policy=policy, port=port, ready=ready)
