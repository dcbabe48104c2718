"""Rules and factors as tables."""

from overtaking.analysis.learning.factors import FactorsFound
from overtaking.analysis.learning.models import TREES
from overtaking.analysis.learning.rules import RulesFound
from overtaking.analysis.stats.table import Style, Table, write

_SHARE, _TEXT, _COUNT, _NUMBER = Style.SHARE, Style.TEXT, Style.COUNT, Style.NUMBER


def rule_table(found: RulesFound) -> Table:
    """The rules, their scores on held-out examples, and counterexamples."""
    return Table.of(
        name=f"rules-{found.target.name}",
        title=f"{found.target.title}: {found.target.question}",
        note="Any of the rules is enough. Counted on simulations that were kept back; “wrong in” "
        "names the first simulations of the whole data set in which a rule holds and is wrong.",
        columns={
            "": _TEXT,
            f"{found.head} …": _TEXT,
            "wrong in": _TEXT,
            "holds in": _COUNT,
            "precision": _SHARE,
            "recall": _SHARE,
        },
        rows=[
            (
                str(number),
                one.rule.text,
                ", ".join(str(n) for n in one.counterexamples)
                + (", …" if one.num_counterexamples > len(one.counterexamples) else ""),
                one.held_out.hits + one.held_out.false_alarms,
                one.held_out.precision,
                one.held_out.recall,
            )
            for number, one in enumerate(found.rules, start=1)
        ],
    )


def comparison_table(found: RulesFound) -> Table:
    """The scores of the rules, the baseline and the black box."""
    shares = ("accuracy", "balanced", "precision", "recall", "F")
    return Table.of(
        name=f"rules-{found.target.name}-compared",
        title=f"{found.target.title}: rules, speed limit and black box",
        note="On the simulations that were kept back.",
        columns={"judge": _TEXT, "examples": _COUNT} | dict.fromkeys(shares, _SHARE),
        rows=[
            (
                *(one.name, one.num, one.accuracy, one.balanced_accuracy),
                *(one.precision, one.recall, one.f_measure),
            )
            for one in found.comparison
        ],
    )


def model_table(found: FactorsFound) -> Table:
    """The models on held-out examples."""
    return Table.of(
        name="learning-models",
        title=f"Models that foretell {_what(found)}",
        note=f"Learned from {found.learned_from:,} simulations, judged on "
        f"{found.held_out:,} of other scenarios or recordings; always saying the most frequent "
        f"outcome is right in {write(found.most_frequent_accuracy, _SHARE)}. From and to: 95 % "
        "confidence of the accuracy. Calibration error: mean distance of confidence and share "
        "foretold rightly, before and after calibration.",
        columns={
            "model": _TEXT,
            **dict.fromkeys(("accuracy", "from", "to", "balanced"), _SHARE),
            "log loss": _NUMBER,
            "error before": _SHARE,
            "calibration error": _SHARE,
        },
        rows=[
            (
                *(one.name, one.accuracy, one.accuracy_low, one.accuracy_high),
                *(one.balanced_accuracy, one.log_loss),
                *(one.calibration_error_before, one.calibration_error),
            )
            for one in found.models
        ],
    )


def confusion_table(found: FactorsFound) -> Table:
    """The confusion matrix of the trees."""
    model = next(one for one in found.models if one.name == TREES)
    return Table.of(
        name="learning-confusion",
        title=f"What came, by what {TREES} foretold",
        note="Simulations that were kept back.",
        columns={"came \\ foretold": _TEXT} | dict.fromkeys(found.outcomes, _COUNT),
        rows=[
            (name, *counts)
            for name, counts in zip(found.outcomes, model.confusion.tolist(), strict=True)
        ],
    )


def ranking_table(found: FactorsFound) -> Table:
    """The factors in order, with the accuracy of each with those before it."""
    shares = ("accuracy", "from", "to", "gain")
    return Table.of(
        name="learning-ranking",
        title=f"What decides {_what(found)}: sequential backward selection",
        note="Accuracy with a factor and all above it, on simulations that took no part in the "
        "choice; from and to: its 95 % confidence. Ranks: the best and the worst of all "
        "repetitions on other simulations.",
        columns={"": _TEXT, "factor": _TEXT, "ranks": _TEXT} | dict.fromkeys(shares, _SHARE),
        rows=[
            (
                *(str(number), one.factor, f"{one.best_rank}–{one.worst_rank}"),
                *(one.accuracy, one.accuracy_low, one.accuracy_high, one.gain),
            )
            for number, one in enumerate(found.ranking, start=1)
        ],
    )


def leakage_table(found: FactorsFound) -> Table:
    """The accuracy that leaks would fake."""
    return Table.of(
        name="learning-leakage",
        title="What features would fake that are known only afterwards",
        note=f"Accuracy of {TREES} with all factors and the leak, and how much more that is than "
        "without it. No other number here has seen them.",
        columns={"leak": _TEXT, "why": _TEXT, "accuracy": _SHARE, "faked": _SHARE},
        rows=[(one.feature, one.why, one.accuracy, one.gain) for one in found.leakage],
    )


def _what(found: FactorsFound) -> str:
    return "the class" if found.about == "outcome" else f"“{found.outcomes[0]}”"
