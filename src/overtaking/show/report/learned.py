"""The sections of a report about learned rules and factors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from overtaking.core.errors import DatasetError, MissingExtraError
from overtaking.show.report import gallery
from overtaking.show.report.page import Section, paragraph

if TYPE_CHECKING:
    from overtaking.analysis.learning.factors import FactorsFound
    from overtaking.analysis.learning.rules import RulesFound
    from overtaking.data.load import Dataset
    from overtaking.show.report.write import Writer

_ABOUT_RULES = (
    "The rules use only the state at the instant at which an overtake begins, or could have begun; "
    "every score is on held-out simulations. A rule describes an association in these data, not a "
    "cause. Shares count each simulation once, whatever its importance weight."
)
_ABOUT_FACTORS = (
    "Three models predict the class from the same state. They do not use features that are known "
    "only afterwards (the duration, the collision partner, lane changes, the largest acceleration, "
    "means over the run). Simulations of one scenario or recording stay on one side of the split."
)
_ABOUT_RANKING = (
    "Backward selection drops the factor whose loss costs the model least accuracy, then the next; "
    "the last factor left ranks first. If intervals overlap, the order is not significant. Of "
    "redundant factors, one takes the credit for all."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Learned:
    """What a report says was learned.

    Attributes:
        rules: About each target that could be learned.
        factors: What decides, None if that could not be found out.
        remarks: What could not be learned, and why.
    """

    rules: tuple["RulesFound", ...]
    factors: "FactorsFound | None"
    remarks: tuple[str, ...]


def learn(data: "Dataset", policy: str) -> Learned:
    """Learn all that a report says.

    Args:
        data: The data set.
        policy: Which rules decide about the class.

    Raises:
        ConfigError: There is no such policy.
    """
    rules: list[RulesFound] = []
    remarks: list[str] = []
    factors: FactorsFound | None = None
    try:
        from overtaking.analysis.learning.examples import examples_of
        from overtaking.analysis.learning.factors import learn_factors
        from overtaking.analysis.learning.leakage import chosen_factors
        from overtaking.analysis.learning.rules import learn_rules
        from overtaking.analysis.learning.targets import TARGETS

        examples = examples_of(data, policy)
        for target in TARGETS.values():
            try:
                rules.append(learn_rules(examples, target))
            except DatasetError as error:
                remarks.append(f"No rules about “{target.title}”: {error}")
        factors = learn_factors(examples, chosen_factors(()))
    except (DatasetError, MissingExtraError) as error:
        remarks.append(f"Nothing is said about what decides: {error}")
    return Learned(rules=tuple(rules), factors=factors, remarks=tuple(remarks))


def sections(writer: "Writer", learned: Learned) -> Sequence[Section]:
    """The sections about rules and factors."""
    return (
        Section("rules", "Rules that were learned", _rules(writer, learned)),
        Section("factors", "What decides", _factors(writer, learned)),
    )


def _rules(writer: "Writer", learned: Learned) -> tuple[str, ...]:
    blocks = [paragraph(_ABOUT_RULES)]
    for found in learned.rules:
        from overtaking.analysis.learning.tables import comparison_table, rule_table

        blocks += [writer.table(rule_table(found)), writer.table(comparison_table(found))]
    blocks += [writer.lacking(one) for one in learned.remarks]
    return tuple(blocks)


def _factors(writer: "Writer", learned: Learned) -> tuple[str, ...]:
    found = learned.factors
    if found is None:
        return (writer.lacking("Which factors decide could not be found out, see above."),)
    from overtaking.analysis.learning.tables import model_table, ranking_table

    return (
        paragraph(_ABOUT_FACTORS),
        writer.table(model_table(found)),
        writer.pictures(lambda: gallery.model_pictures(found)),
        paragraph(_ABOUT_RANKING),
        writer.pictures(lambda: [gallery.ranking_picture(found)]),
        writer.table(ranking_table(found)),
    )
