"""Sentences of the report, made from its numbers."""

from collections.abc import Iterable, Iterator
from html import escape

from overtaking.analysis.stats.associations import ALPHA, Associations
from overtaking.analysis.stats.results import Statistics
from overtaking.analysis.stats.survival import Survival
from overtaking.core.representation import format_count
from overtaking.knowledge.glossary import TERM_GROUPS, terms
from overtaking.show.report.page import definitions, paragraph

FOOT = (
    "Legality is the verdict of a rule set, an interpretation of the law for research, not legal "
    "advice. This page needs no network."
)

ABOUT_EXAMPLES = (
    "Of each class the simulation whose numeric features lie nearest to the medians of the class. "
    "The coloured bands are what the ego does; positions along the road are seen from a mark that "
    "moves with the mean speed of the target, so that slopes are differences of speed. Below each "
    "is what there is to say of the rules that it breaks, as far as the policy counts them."
)

ABOUT_RUNNING = (
    "These overtakes as they happened: the space bar plays, the arrow keys step a frame, J and K "
    "change the simulation, ? tells the other keys."
)

_EXPLAINED = ("classes", "features")
"""The groups of terms that have their place beside the numbers."""


def lead(found: Statistics) -> str:
    """One line that describes the report."""
    sample = found.sample
    policy = f"the policy {sample.policy} ({terms('policies')[sample.policy].title})"
    weighing = "counted by their importance weights" if sample.is_weighted else "each counted once"
    return f"{format_count(len(sample), 'simulation')}, classified under {policy}, {weighing}."


def facts(found: Statistics) -> list[tuple[str, str]]:
    """Facts about the statistics."""
    sample = found.sample
    known = [
        ("simulations", f"{len(sample):,}"),
        ("policy of the classes", sample.policy),
        ("reading of the features", sample.reading),
    ]
    if sample.is_weighted:
        known.append(("effective simulations", f"{sample.num_effective:,.0f}"))
    return known


def meanings(group: str, names: Iterable[str] | None = None) -> list[tuple[str, str]]:
    """Names with their meanings.

    Args:
        group: One of the groups of terms.
        names: Those to explain, all by default.
    """
    known = terms(group)
    return [
        (
            f"{name} [{known[name].display_unit}]" if known[name].display_unit else name,
            known[name].meaning,
        )
        for name in names or known
    ]


def about_policy(found: Statistics) -> str:
    """Which rules decide about the classes."""
    policy = found.sample.policy
    meaning = terms("policies")[policy].meaning
    return f"The policy “{policy}” decides which rules a legal overtake must keep. {meaning}"


def about_reading(found: Statistics) -> str:
    """How the features were measured."""
    reading = found.sample.reading
    return f"The features, in the reading “{reading}”. {terms('readings')[reading].meaning}"


def glossary() -> Iterator[str]:
    """Every other word, by group."""
    yield paragraph(
        "The classes are explained with their frequencies, the features with their statistics."
    )
    for group, title in TERM_GROUPS.items():
        if group not in _EXPLAINED:
            yield f"<h3>{escape(title)}</h3>\n{definitions(meanings(group))}"


def about_leaks(found: Statistics) -> str:
    """Whether a class is missing where it should occur."""
    if found.leaks:
        return paragraph(
            "Some classes do not occur in some strata of these data although they should, by their "
            "frequency. A model that is trained on such labels may learn the stratum, not the "
            "overtake."
        )
    return paragraph(
        "No class is missing from a stratum (time of day, low sun, types of vehicles, weather) in "
        "which its frequency would let one expect it."
    )


def known_leaks(found: Statistics) -> list[str]:
    """What leaks by definition."""
    notes = [
        "OT is known only when the overtake is over, so it must not be used to foresee the class."
    ]
    if found.sample.reading == "paper":
        notes.append(
            "The paper's reading measures No_attempt otherwise than the other classes: its WT is "
            "the length of the simulation, and SE, SP, DSEP, D and OLR are means over all frames "
            "instead of values at the start of the overtake. That alone tells the classes apart; "
            "the matched reading measures all alike."
        )
    return notes


def about_waiting(curve: Survival) -> str:
    """The waiting time in words."""
    text = (
        f"{format_count(curve.num_events, 'driver')} began to overtake; "
        f"{curve.num_censored:,} had not begun when their simulation or a collision ended the "
        "waiting, and are censored: all that is known is that they would have waited longer."
    )
    if curve.median == curve.median:
        return f"{text} Half of the drivers have begun after {curve.median:.2f} s."
    return f"{text} Fewer than half have begun, so the median waiting time is not known."


def about_associations(found: Statistics, measured: Associations) -> list[str]:
    """How to read the matrices, and how not to."""
    number = len(found.sample)
    texts = [
        "A p-value is the probability that simulations like these would show an association at "
        "least this strong if there were none. It is not the probability that there is none, and a "
        "small one says neither that an association is strong nor that one thing causes the other. "
        f"With {format_count(number, 'simulation')}, "
        + (
            "even associations too weak to matter have tiny p-values: read the effect first."
            if number >= 5_000
            else "weak associations may go unnoticed, and some of the many pairs fall below the "
            "level by chance: read the effect and the adjusted value first."
        ),
        _count(measured),
    ]
    if measured.constant:
        names = ", ".join(measured.constant)
        texts.append(f"Left out, because they are the same in all simulations: {names}.")
    if found.sample.is_weighted:
        texts.append("Weights are not applied here: tests need simulations as they were drawn.")
    return texts


def _count(measured: Associations) -> str:
    """How many pairs stand out."""
    tested = [one for one in measured.pairs if one.p_value == one.p_value]
    if not tested:
        return "No pair of variables can be tested."
    below = sum(one.p_value < ALPHA for one in tested)
    place = {name: number for number, name in enumerate(measured.names)}
    kept = sum(measured.q_values[place[one.first], place[one.second]] < ALPHA for one in tested)
    return (
        f"Of {format_count(len(tested), 'pair')}, {below} have p < {ALPHA:g}; about "
        f"{ALPHA * len(tested):.0f} would if nothing were associated with anything. {kept} "
        "remain after the correction of Benjamini and Hochberg, which bounds the share of false "
        "discoveries among them."
    )


def methods() -> tuple[str, ...]:
    """How everything was computed."""
    texts = (
        "Standard deviations divide by n − 1. Shares have Wilson's 95 % intervals. Weighted "
        "numbers use importance weights with a mean of 1; the effective number of simulations is "
        "Kish's (Σw)²/Σw².",
        "Waiting times: Kaplan and Meier's estimate, Greenwood's error (with weights that of Xie "
        "and Liu), limits on the log(−log) scale.",
        "Associations: Spearman's ρ, the correlation ratio η and Bergsma's bias-corrected Cramér's "
        "V, the measures of dython's nominal.associations; gaps are left out pair by pair. Order: "
        "average linkage of 1 − |association|. Tests: t-test of ρ, Kruskal–Wallis, χ² (with Yates' "
        "correction for two by two levels). Effects: |ρ|, ε², V, in words by Cohen's conventions.",
        "A class counts as missing from a stratum if none of its simulations is there and chance "
        "would bring that about with a probability below 1 % (hypergeometric).",
    )
    return tuple(map(paragraph, texts))
