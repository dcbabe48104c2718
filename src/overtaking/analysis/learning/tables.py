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
        title=f"{found.target.title}: {found.target.question} (policy {found.policy})",
        note="The prediction holds if any rule holds. Scores are on held-out simulations; “wrong "
        "in” lists the first false positives in the whole data set.",
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
        title=f"{found.target.title}: rules, speed limit and black box (policy {found.policy})",
        note="Scores on the held-out simulations.",
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
        title=f"Models that predict {_outcome_and_policy(found)}",
        note=f"Trained on {found.learned_from:,} simulations, tested on {found.held_out:,} of "
        "other scenarios or recordings. Always predicting the most frequent outcome has accuracy "
        f"{write(found.most_frequent_accuracy, _SHARE)}. From and to: 95 % confidence interval of "
        "the accuracy. Calibration error: mean distance between confidence and accuracy, before "
        "and after calibration.",
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
        title=f"Confusion matrix of {TREES}: {_outcome_and_policy(found)}",
        note="Held-out simulations.",
        columns={"actual \\ predicted": _TEXT} | dict.fromkeys(found.outcomes, _COUNT),
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
        title=f"What decides {_outcome_and_policy(found)}: sequential backward selection",
        note="Accuracy with a factor and all factors above it, on simulations not used for the "
        "selection; from and to: its 95 % confidence interval. Ranks: the best and the worst rank "
        "in all repetitions on other simulations.",
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
        title="Accuracy gained from features that are known only after the overtake",
        note=f"Accuracy of {TREES} with all factors and the leak, and its gain over the accuracy "
        "without the leak. No other number here uses these features.",
        columns={"leak": _TEXT, "why": _TEXT, "accuracy": _SHARE, "gain": _SHARE},
        rows=[(one.feature, one.why, one.accuracy, one.gain) for one in found.leakage],
    )


def _outcome_and_policy(factors: FactorsFound) -> str:
    outcome = "the class" if factors.about == "outcome" else f"“{factors.outcomes[0]}”"
    return f"{outcome} under the policy {factors.policy}"
