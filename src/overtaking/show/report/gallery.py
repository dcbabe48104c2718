"""The figures of a report: what draws each, and the words below it."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from overtaking.analysis.stats import distributions
from overtaking.analysis.stats.associations import Associations
from overtaking.analysis.stats.columns import BY_NAME, FEATURES, NUMERIC
from overtaking.analysis.stats.diagrams import Diagram
from overtaking.analysis.stats.results import Statistics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from overtaking.analysis.learning.factors import FactorsFound


class Picture(NamedTuple):
    """A figure that can be drawn.

    Attributes:
        name: Name of its files.
        caption: The words below it.
        draw: Draws it.
    """

    name: str
    caption: str
    draw: Callable[[], "Figure"]


def class_picture(found: Statistics) -> Picture:
    """How often each class occurs."""
    from overtaking.show.plots.distributions import draw_classes

    return Picture(
        name="classes",
        caption="Frequency of the classes, as number and share of the simulations. "
        + _of_policy(found.sample.policy),
        draw=lambda: draw_classes(found.classes, policy=found.sample.policy),
    )


def waiting_picture(found: Statistics) -> Picture:
    """The curve of waiting times."""
    from overtaking.show.plots.distributions import draw_waiting

    curve = found.waiting
    assert curve is not None
    return Picture(
        name="waiting-time",
        caption="Share of the drivers who have not begun to overtake, by the time since the start "
        "(Kaplan–Meier; the band is 95 % confidence). Who never began counts for as long as it was "
        "watched.",
        draw=lambda: draw_waiting(curve, float(found.sample.frame["WT"].max())),
    )


def distribution_pictures(found: Statistics) -> list[Picture]:
    """Histograms, scaled boxes, and the ego's speed by class."""
    from overtaking.show.plots.distributions import (
        draw_boxes_and_swarm,
        draw_histograms,
        draw_scaled_boxes,
    )

    sample = found.sample
    counted = [distributions.histogram(sample, one.name) for one in FEATURES]
    points = distributions.swarm_points(sample, "SE")
    most = "" if not any(one.is_sampled for one in points.values()) else _sampled_swarm()
    return [
        Picture(
            name="histograms",
            caption="Histogram of every feature, with the classes stacked. "
            + _of_policy(sample.policy),
            draw=lambda: draw_histograms(
                counted, sample.classes, policy=sample.policy, is_weighted=sample.is_weighted
            ),
        ),
        Picture(
            name="boxes",
            caption="Box plots of the numeric features, each scaled to its range (min–max). Boxes "
            "hold the middle half, the line is the median, whiskers end at the last value within "
            "1.5 box lengths, circles are beyond.",
            draw=lambda: draw_scaled_boxes(distributions.scaled_boxes(sample)),
        ),
        Picture(
            name="speed-by-class",
            caption="Speed of the ego by class, as box plots and as single simulations. "
            + _of_policy(sample.policy)
            + most,
            draw=lambda: draw_boxes_and_swarm(
                sample, BY_NAME["SE"], distributions.boxes_by_class(sample, "SE"), points
            ),
        ),
    ]


def _sampled_swarm() -> str:
    """Caption if the points are a sample of the simulations."""
    return (
        f" Of each class at most {distributions.MAX_SWARM} simulations are drawn on the right, at "
        "equal distances in the data set; the boxes hold all."
    )


def pair_pictures(found: Statistics) -> list[Picture]:
    """Every numeric feature against every other, and the paper's two details."""
    from overtaking.show.plots.pairs import draw_details, draw_pairs

    sample = found.sample
    points = distributions.pair_points(sample)
    counted = [distributions.histogram(sample, one.name) for one in NUMERIC]
    sampled = (
        f" Drawn are {len(points.simulations):,} of {points.num_all:,} simulations, at equal "
        "distances in the data set, and rare classes more often than they occur; the histograms "
        "hold all."
        if points.is_sampled
        else ""
    )
    return [
        Picture(
            name="pairs",
            caption="Every numeric feature against every other one, each panel scaled to its "
            "range; on the diagonal the histograms. " + _of_policy(sample.policy) + sampled,
            draw=lambda: draw_pairs(sample, counted, points),
        ),
        Picture(
            name="pair-details",
            caption="Speeds of ego and target, and the ego's speed against their difference. On "
            "the line both drive equally fast. " + _of_policy(sample.policy) + sampled,
            draw=lambda: draw_details(sample, points),
        ),
    ]


def association_pictures(found: Associations) -> list[Picture]:
    """The two matrices."""
    from overtaking.show.plots.pairs import draw_associations, draw_p_values

    return [
        Picture(
            name="associations",
            caption="Associations: Spearman's ρ between numbers (−1 to 1), correlation ratio η "
            "between a name and a number, bias-corrected Cramér's V between names (0 to 1). What "
            "goes together stands beside each other.",
            draw=lambda: draw_associations(found),
        ),
        Picture(
            name="p-values",
            caption="P-values of the same pairs: t-test of ρ, Kruskal–Wallis, χ². Bold numbers, or "
            "dots in narrow figures: the adjusted value is below 0.05, too.",
            draw=lambda: draw_p_values(found),
        ),
    ]


def model_pictures(found: "FactorsFound") -> list[Picture]:
    """Confusion of the trees, and calibration of all models."""
    from overtaking.show.plots.learning import draw_confusion, draw_reliability

    return [
        Picture(
            name="learning-confusion",
            caption="Confusion matrix of gradient boosting on held-out simulations, with shares of "
            "the actual class. " + _of_policy(found.policy),
            draw=lambda: draw_confusion(found),
        ),
        Picture(
            name="learning-calibration",
            caption="Calibration: accuracy of each model by its confidence; larger points stand "
            "for more simulations. On the line, accuracy equals confidence.",
            draw=lambda: draw_reliability(found),
        ),
    ]


def ranking_picture(found: "FactorsFound") -> Picture:
    """The factors in order."""
    from overtaking.show.plots.learning import draw_ranking

    return Picture(
        name="learning-ranking",
        caption="Accuracy of gradient boosting with the first factor, the first two, and so on; "
        "the band is its 95 % confidence. " + _of_policy(found.policy),
        draw=lambda: draw_ranking(found),
    )


def example_name(class_name: str) -> str:
    """Name of the figure of an example of a class."""
    return f"example-{class_name.lower().replace('_', '-')}"


def _of_policy(policy: str) -> str:
    """The part of a caption that names the policy."""
    return f"Classes under the policy {policy}."


def overtake_picture(name: str, simulation: int, diagram: Diagram, *, policy: str) -> Picture:
    """An example of a class in space and time."""
    from overtaking.show.plots.overtake import draw_overtake

    return Picture(
        name=example_name(name),
        caption=f"{name} under the policy {policy}: simulation {simulation}, the most typical of "
        "its class. Above, positions along the road, with the lengths of the vehicles; below, "
        "across it, with the widths of ego and target. a: begins to pull out; x₁: crosses the "
        "line; o₁, o₂: alongside the target; b: begins to return; x₂: is back in its lane.",
        draw=lambda: draw_overtake(diagram, name),
    )
