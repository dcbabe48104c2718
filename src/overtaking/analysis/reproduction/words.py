"""Sentences about a reproduction, made from its numbers."""

from overtaking.analysis.reproduction.hidden import Inference
from overtaking.analysis.reproduction.measures import POLICY
from overtaking.analysis.reproduction.replicates import SIZE
from overtaking.analysis.reproduction.run import PHYSICAL, Comparison, Reproduction
from overtaking.analysis.reproduction.statements import StatementRole, calibration
from overtaking.analysis.reproduction.variants import COLLISION
from overtaking.model.verdicts import OvertakeClass

_SHORT = 16  # Digits of a hash: enough to compare, short enough to read.


def lead(found: Reproduction) -> str:
    """A summary in one line."""
    judged = [one for one in found.comparisons if not one.is_design and one.is_inside is not None]
    inside = sum(one.is_inside is True for one in judged)
    return (
        f"{found.num_replicates:,} replicates of {SIZE} simulations, classified under the "
        f"{POLICY}'s policy: {inside} of {len(judged)} numbers of the paper lie where 95 % of the "
        "replicates do."
    )


def warnings(found: Reproduction) -> list[str]:
    """Warnings that a reader of the numbers needs."""
    said: list[str] = []
    if not found.is_frozen:
        said.append(
            "The drivers or the profile are not those that were fitted: the hash of the parameters "
            f"is {found.parameters_sha256[:_SHORT]}, the frozen one "
            f"{calibration().parameters_sha256[:_SHORT] or 'none'}."
        )
    empty = [one for one in found.comparisons if one.is_inside is None]
    if empty:
        names = ", ".join(f"{one.statement.about}: {_title(one)}" for one in empty)
        said.append(f"No replicate has a simulation to measure this in: {names}.")
    missed = _missed_shares(found)
    if missed:
        said.append(
            "These classes could not be brought to the paper's numbers with a profile that can be "
            f"defended: {missed}. Success and failure come out of drivers and motion here, never "
            "of a draw, and what is missing is left missing."
        )
    return said


def _missed_shares(found: Reproduction) -> str:
    """The classes whose number lies outside of our replicates."""
    counts = [one for one in found.comparisons if one.statement.measure == "count"]
    return ", ".join(
        f"{one.statement.outcome_class} "
        f"({one.ours:.0f} against {one.statement.quoted:.0f} of {SIZE})"
        for one in counts
        if one.is_inside is False
    )


def _title(one: Comparison) -> str:
    return " ".join(
        part for part in (one.statement.text, _class(one.statement.outcome_class)) if part
    )


def _class(scope: str) -> str:
    return "" if scope == "all" else f"of {scope}"


def notes(found: Reproduction) -> list[str]:
    """The method in three notes."""
    seeds = " and ".join(f"{seed:g}" for seed in calibration().seeds)
    return [
        "Fitted were, by a search along coordinates, the class sizes and the printed means "
        "of SE, SP and D, and nothing else; every other number is a prediction, follows from what "
        "was fitted, or could not be otherwise.",
        f"The profile was fitted with the seeds {seeds}; these replicates have seed {found.seed}, "
        "so no simulation is in both. "
        + (
            f"Parameters are the frozen ones ({found.parameters_sha256[:_SHORT]})."
            if found.is_frozen
            else "Parameters are not the frozen ones."
        ),
        "A percentile near 0 or 100 says that a set of 276 of ours hardly ever has such a number. "
        "Near 50 it says that the two cannot be told apart by it, not that they are the same.",
    ]


def standings() -> list[tuple[str, str]]:
    """Each standing and what it means."""
    return [(str(one), one.meaning) for one in StatementRole]


def remarks_on_numbers(found: Reproduction) -> list[tuple[str, str]]:
    """Remarks on single numbers, each with its number."""
    said: list[tuple[str, str]] = []
    for one in found.comparisons:
        derived = one.statement.stated.rationale
        text = "; ".join(part for part in (derived, one.statement.note) if part)
        if text:
            about = f"{one.statement.about}: " if not one.is_design else ""
            said.append((f"{about}{_title(one)}", text))
    return said


def causes(found: Reproduction) -> list[tuple[str, str]]:
    """Each number that the experiment misses, and why."""
    return [
        (
            f"{one.statement.about}: {_title(one)}",
            f"{one.statement.quoted:g} against {one.ours:.4g}: "
            + (one.statement.cause or "no cause is known"),
        )
        for one in found.comparisons
        if one.is_inside is False and not one.is_design
    ]


def hidden(found: Reproduction) -> list[str]:
    """What the labels of the paper imply about its weather."""
    said = [_inferred(one) for one in found.inferences]
    said.append(
        "Both inferences assume that CARLA's presets were used unmodified, in which fog is never "
        "below 2 %. Had fog been set to 0 on some days, a few nights could hide in the mean."
    )
    shares = {(one.policy, one.is_night): one for one in found.lawful}
    for name in dict.fromkeys(one.policy for one in found.lawful):
        day, night = shares[name, False], shares[name, True]
        if day.completed and night.completed:
            said.append(
                f"Here, under the policy {name}, {day.legal / day.completed:.1%} of the completed "
                f"overtakes are legal by day and {night.legal / night.completed:.1%} at night."
            )
    return said


def _inferred(one: Inference) -> str:
    """One inference in words."""
    means = " and ".join(f"{name} {value:.2f}" for name, value in sorted(one.means.items()))
    begin = f"{one.scope}: the printed means ({means}) of {one.simulations} simulations"
    if one.nights is None:
        return f"{begin} fit no split over the presets."
    fewest, most = one.nights
    nights = f"{fewest}" if fewest == most else f"{fewest} to {most}"
    said = f"{begin} leave {one.splits} ways to split them over the presets, with {nights} at night"
    if one.splits == 1:
        said = f"{begin} leave one way to split them over the presets, with {nights} at night"
    if one.scope == OvertakeClass.SUCCESS_L.title and most == 0:
        return f"{said}: its label says legal, and its data say by day."
    return f"{said}."


def about_starts(found: Reproduction) -> str:
    """The effect of the treatment of starts on collisions."""
    shares = {bool(one.value): one.shares[COLLISION] for one in found.starts}
    return (
        "The paper places vehicles and draws their speeds at random, and says nothing of starts "
        f"from which no driver could avoid a collision. With starts as drawn, but for a least gap, "
        f"{shares[True]:.1%} of our simulations end as {COLLISION}, with starts that can be "
        f"survived {shares[False]:.1%}. The experiment keeps the former, as the paper repairs "
        f"nothing; {PHYSICAL} keeps the latter: a collision that the draw of a start decides says "
        "nothing about overtaking."
    )
