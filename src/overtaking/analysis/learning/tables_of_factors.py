"""What was found out about the factors, as tables."""

import pandas as pd

from overtaking.analysis.learning.factors import FactorsFound
from overtaking.analysis.learning.models import TREES
from overtaking.analysis.stats.table import Style, Table, write

_SHARE, _TEXT, _COUNT, _NUMBER = Style.SHARE, Style.TEXT, Style.COUNT, Style.NUMBER


def model_table(found: FactorsFound) -> Table:
    """The models on what was kept back."""
    rows = [
        {
            "model": one.name,
            "accuracy": one.accuracy,
            "from": one.low,
            "to": one.high,
            "balanced": one.balanced,
            "log loss": one.log_loss,
            "error before": one.error_before,
            "calibration error": one.error,
        }
        for one in found.models
    ]
    return Table(
        name="learning-models",
        title=f"Models that foretell {_what(found)}",
        note=f"Learned from {found.num_learned_from:,} simulations, judged on "
        f"{found.num_kept:,} of other scenarios or recordings; always saying the most frequent "
        f"outcome is right in {write(found.most_frequent, _SHARE)}. From and to: 95 % confidence "
        "of the accuracy. Calibration error: mean distance of confidence and share foretold "
        "rightly, before and after calibration.",
        rows=pd.DataFrame(rows),
        styles=(_TEXT, *[_SHARE] * 4, _NUMBER, _SHARE, _SHARE),
        num_texts=1,
        by_column=True,
    )


def confusion_table(found: FactorsFound) -> Table:
    """What came of it by what the trees foretold."""
    model = next(one for one in found.models if one.name == TREES)
    rows = [
        {"came \\ foretold": name, **dict(zip(found.outcomes, counts, strict=True))}
        for name, counts in zip(found.outcomes, model.confusion.tolist(), strict=True)
    ]
    return Table(
        name="learning-confusion",
        title=f"What came, by what {TREES} foretold",
        note="Simulations that were kept back.",
        rows=pd.DataFrame(rows),
        styles=(_TEXT, *[_COUNT] * len(found.outcomes)),
        num_texts=1,
        by_column=True,
    )


def ranking_table(found: FactorsFound) -> Table:
    """The factors in order, with the accuracy of each with those before it."""
    rows = [
        {
            "": str(number + 1),
            "factor": one.name,
            "ranks": f"{one.best_rank}–{one.worst_rank}",
            "accuracy": one.accuracy,
            "from": one.low,
            "to": one.high,
            "gain": one.gain,
        }
        for number, one in enumerate(found.ranking)
    ]
    return Table(
        name="learning-ranking",
        title=f"What decides {_what(found)}: sequential backward selection",
        note="Accuracy with a factor and all above it, on simulations that took no part in the "
        "choice; from and to: its 95 % confidence. Ranks: the best and the worst of all "
        "repetitions on other simulations.",
        rows=pd.DataFrame(rows),
        styles=(_TEXT, _TEXT, _TEXT, *[_SHARE] * 4),
        num_texts=3,
        by_column=True,
    )


def leakage_table(found: FactorsFound) -> Table:
    """What leaks would fake."""
    rows = [
        {"leak": one.name, "why": one.why, "accuracy": one.accuracy, "faked": one.gain}
        for one in found.faked
    ]
    return Table(
        name="learning-leakage",
        title="What features would fake that are known only afterwards",
        note=f"Accuracy of {TREES} with all factors and the leak, and how much more that is than "
        "without it. No other number here has seen them.",
        rows=pd.DataFrame(rows),
        styles=(_TEXT, _TEXT, _SHARE, _SHARE),
        num_texts=2,
        by_column=True,
    )


def _what(found: FactorsFound) -> str:
    return "the class" if found.about == "outcome" else f"“{found.outcomes[0]}”"
