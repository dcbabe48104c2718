"""Single figures of data sets and results, by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from overtaking.core.errors import ConfigError, DatasetError, check_choice, nearest_first
from overtaking.labels.law.judging import choose_policy
from overtaking.show.palette import CLASS_COLOURS
from overtaking.show.report import gallery

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.analysis.learning.factors import FactorsFound
    from overtaking.analysis.reproduction.run import Reproduction
    from overtaking.analysis.stats.results import Statistics
    from overtaking.data.load import Dataset

Draw = Callable[[], "Figure"]

SINGLE_AXES = frozenset(
    ["classes", "waiting-time", "boxes", "learning-confusion", "learning-ranking", "rules", "map"]
)
"""Names of the figures with single axes: these can be drawn into axes of the caller."""


def draw(
    source: Any, figure: str | None, *, axes: Axes | None, width: str, policy: str | None
) -> Figure:
    """Draw one figure of a result.

    Args:
        source: A data set, or a result of a function of the package.
        figure: Name of the figure; None if the source has only one.
        axes: Axes to draw a figure with single axes into; None for a new figure.
        width: A name of `style.WIDTHS`.
        policy: Which rules decide about classes; None for the default of the profile.

    Raises:
        ConfigError: There is no such figure or width, or it cannot be drawn into the axes.
        DatasetError: The data have too little to draw it.
        MissingExtraError: The extra `plots` is not installed.
    """
    from overtaking.show.plots.style import WIDTHS, Axes, drawn_for

    if axes is not None and not isinstance(axes, Axes):
        raise ConfigError(
            what="ax",
            where="plot",
            expected="axes of Matplotlib",
            got=f"a {type(axes).__name__}",
            next_step="give one of figure.axes",
        )
    check_choice(width, WIDTHS, what="width", where="plot")
    figures = figures_of(source, policy)
    name = _choose_figure(figure, figures)
    if axes is not None and name not in SINGLE_AXES:
        single = ", ".join(name for name in figures if name in SINGLE_AXES)
        raise ConfigError(
            what="ax",
            where="plot",
            expected=f"None, as {name} has several axes",
            got="axes",
            next_step="leave ax out"
            + (f", or draw a figure with single axes: {single}" if single else ""),
        )
    with drawn_for("column" if width == "column" else "page", axes):
        return figures[name]()


def _choose_figure(figure: str | None, figures: Mapping[str, Draw]) -> str:
    """The name of the figure to draw.

    Raises:
        ConfigError: The source has no such figure, or several of which none is named.
    """
    if figure is None and len(figures) == 1:
        return next(iter(figures))
    if figure is None or figure not in figures:
        names = list(figures) if figure is None else nearest_first(figure, figures)
        raise ConfigError.unknown_choice(what="figure", where="plot", choices=names, got=figure)
    return figure


def figures_of(source: Any, policy: str | None) -> dict[str, Draw]:
    """The figures of a source, by name.

    Args:
        source: As in `draw`.
        policy: As in `draw`.

    Raises:
        ConfigError: The source has no figures.
    """
    # Compare names of classes, as importing the modules of all classes takes longer than drawing.
    for base in type(source).__mro__:
        if base.__name__ in _SOURCES and base.__module__.startswith("overtaking."):
            return _SOURCES[base.__name__](source, policy)
    if isinstance(source, (list, tuple)) and _are_roads(source):
        return {"map": partial(_draw_map, source)}
    raise ConfigError(
        what="source",
        where="plot",
        expected=f"a data set, roads, or what {', '.join(_FUNCTIONS)} returned",
        got=f"a {type(source).__name__}",
        next_step="give one of them",
    )


def _of_dataset(data: Dataset, policy: str | None) -> dict[str, Draw]:
    """The figures of the report on a data set; statistics are computed when one is drawn."""
    from overtaking.analysis.stats.results import statistics

    policy_name = choose_policy(policy, data.profile)

    def compute_statistics() -> Statistics:
        return statistics(data.features(policy_name), policy=policy_name)

    return {
        **{name: partial(_draw_statistic, compute_statistics, name) for name in _STATISTICS},
        **{
            gallery.example_name(name): partial(_draw_example, data, compute_statistics, name)
            for name in CLASS_COLOURS
        },
        **{name: partial(_draw_learned, data, policy_name, name) for name in _LEARNED},
    }


def _of_statistics(numbers: Statistics, policy: str | None) -> dict[str, Draw]:
    del policy
    return {name: partial(_draw_statistic, lambda: numbers, name) for name in _STATISTICS}


def _draw_statistic(compute_statistics: Callable[[], Statistics], name: str) -> Figure:
    numbers = compute_statistics()
    if name == "waiting-time" and numbers.waiting is None:
        raise _missing_data(name, "overtakes that began")
    return _picture(_STATISTICS[name](numbers), name).draw()


def _draw_example(
    data: Dataset, compute_statistics: Callable[[], Statistics], class_name: str
) -> Figure:
    """A typical simulation of a class in space and time."""
    from overtaking.analysis.stats.diagrams import diagram
    from overtaking.analysis.stats.distributions import typical
    from overtaking.labels.labelling import label

    sample = compute_statistics().sample
    row = typical(sample).get(class_name)
    if row is None:
        raise _missing_data(
            gallery.example_name(class_name), f"a simulation of the class {class_name}"
        )
    simulation = int(sample.frame.index[row])
    labelled = label(data.trajectory(simulation))
    overtake = diagram(labelled.trajectories, labelled.events)
    return gallery.overtake_picture(class_name, simulation, overtake, policy=sample.policy).draw()


def _draw_learned(data: Dataset, policy: str, name: str) -> Figure:
    from overtaking.analysis.learning.examples import examples_of
    from overtaking.analysis.learning.factors import learn_factors
    from overtaking.analysis.learning.leakage import chosen_factors
    from overtaking.analysis.learning.models import require_models

    require_models()
    factors = learn_factors(examples_of(data, policy), chosen_factors(()))
    return _picture(_LEARNED[name](factors), name).draw()


def _picture(pictures: Iterable[gallery.Picture], name: str) -> gallery.Picture:
    return next(picture for picture in pictures if picture.name == name)


def _missing_data(name: str, requirement: str) -> DatasetError:
    return DatasetError(
        what=f"figure {name}",
        where="plot",
        expected=f"a data set with {requirement}",
        got="none",
        next_step="draw another figure, or one of a larger data set",
    )


def _of_factors(factors: FactorsFound, policy: str | None) -> dict[str, Draw]:
    del policy
    return {name: _picture(pictures(factors), name).draw for name, pictures in _LEARNED.items()}


def _of_evaluation(evaluation: Evaluation, policy: str | None) -> dict[str, Draw]:
    del policy
    from overtaking.show.report.evaluation import drawers

    return {name: partial(draw_figure, evaluation) for name, draw_figure in drawers().items()}


def _of_reproduction(reproduction: Reproduction, policy: str | None) -> dict[str, Draw]:
    del policy
    from overtaking.show.report.reproduction import drawers

    return drawers(reproduction)


def _of_validation(validation: Any, policy: str | None) -> dict[str, Draw]:
    del policy
    from overtaking.show.plots.comparison import draw_validation

    return {"validation": partial(draw_validation, validation)}


def _of_curve(curve: Any, policy: str | None) -> dict[str, Draw]:
    del policy
    from overtaking.show.plots.law import draw_curve

    return {"law-curve": partial(draw_curve, curve)}


def _of_twin(twins: Any, policy: str | None) -> dict[str, Draw]:
    from overtaking.show.plots.whatif import draw_twin

    return {"twin": partial(draw_twin, twins, policy)}


def _of_fan(fan: Any, policy: str | None) -> dict[str, Draw]:
    del policy
    from overtaking.show.plots.whatif import draw_fan

    return {"fan": partial(draw_fan, fan)}


def _draw_map(roads: Any) -> Figure:
    from overtaking.show.plots.map import draw_map

    return draw_map(roads)


def _are_roads(source: Iterable[Any]) -> bool:
    from overtaking.recordings.opendrive_map import MappedRoad

    return all(isinstance(road, MappedRoad) for road in source)


def _association_pictures(numbers: Statistics) -> list[gallery.Picture]:
    from overtaking.analysis.stats.associations import associations

    return gallery.association_pictures(associations(numbers.sample))


_STATISTICS: dict[str, Callable[[Statistics], list[gallery.Picture]]] = {
    "classes": lambda numbers: [gallery.class_picture(numbers)],
    "waiting-time": lambda numbers: [gallery.waiting_picture(numbers)],
    **dict.fromkeys(("histograms", "boxes", "speed-by-class"), gallery.distribution_pictures),
    **dict.fromkeys(("pairs", "pair-details"), gallery.pair_pictures),
    **dict.fromkeys(("associations", "p-values"), _association_pictures),
}
"""The figures of statistics, in the order of the report."""

_LEARNED: dict[str, Callable[[FactorsFound], list[gallery.Picture]]] = {
    **dict.fromkeys(("learning-confusion", "learning-calibration"), gallery.model_pictures),
    "learning-ranking": lambda factors: [gallery.ranking_picture(factors)],
}
"""The figures of learned factors."""

_SOURCES: dict[str, Callable[[Any, str | None], dict[str, Draw]]] = {
    "Dataset": _of_dataset,
    "Statistics": _of_statistics,
    "FactorsFound": _of_factors,
    "Validation": _of_validation,
    "ToleranceCurve": _of_curve,
    "Twin": _of_twin,
    "Fan": _of_fan,
    "Evaluation": _of_evaluation,
    "Reproduction": _of_reproduction,
}
"""Functions that list the figures of a source, by the name of its class."""

_FUNCTIONS = (
    *("dataset_statistics", "learn_factors", "validate_profile", "tolerance_curve"),
    *("counterfactual", "outcome_fan", "evaluate", "reproduce_study"),
)
