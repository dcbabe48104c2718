"""Rules and factors that decide an overtake, learned from a data set."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from overtaking.api.data import load_dataset
from overtaking.core.errors import check_in_range
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.model.checks import check_arguments

if TYPE_CHECKING:
    from overtaking.analysis.learning.factors import FactorsFound
    from overtaking.analysis.learning.rules import RulesFound


@check_arguments
def learn_rules(
    data: Dataset | str | Path,
    about: str = "legal",
    *,
    policy: str | None = None,
    seed: int = 1,
    max_rules: int = 12,
    max_conditions: int = 3,
    progress: ProgressCallback | None = None,
) -> "RulesFound":
    """Learn a few short rules from the state when an overtake begins.

    Args:
        data: The data set, or its folder.
        about: `legal`, `collision`, or `start`: that this is no time to begin.
        policy: Which rules of law decide about the class: `paper`, `default` or `strict`; None
            for the default of the profile.
        seed: Of the split into training and held-out simulations, and of the black box.
        max_rules: How many rules at most.
        max_conditions: How many conditions a rule may have.
        progress: Called with the number of rounds that are done, and of all.

    Returns:
        The rules with precision, recall and counterexamples; beside them, on the held-out
        simulations, a black box and the speed limit alone.

    Raises:
        ConfigError: There is no such target or policy, or a number cannot be used.
        DatasetError: The data set is not complete or damaged, or has too few examples.
        MissingExtraError: The extra `learn` is not installed.
    """
    from overtaking.analysis.learning.examples import examples_of
    from overtaking.analysis.learning.models import require_models
    from overtaking.analysis.learning.rules import learn_rules as learned
    from overtaking.analysis.learning.targets import target_of

    require_models()
    target = target_of(about)
    check_in_range(max_rules, 1, what="--max-rules", where="learn")
    check_in_range(max_conditions, 1, what="--max-conditions", where="learn")
    return learned(
        examples_of(load_dataset(data), policy),
        target,
        seed=seed,
        max_rules=max_rules,
        max_conditions=max_conditions,
        progress=progress,
    )


@check_arguments
def learn_factors(
    data: Dataset | str | Path,
    about: str = "outcome",
    *,
    features: Iterable[str] = (),
    policy: str | None = None,
    seed: int = 1,
    repeats: int = 1,
    show_leakage: bool = False,
    progress: ProgressCallback | None = None,
) -> "FactorsFound":
    """Rank the factors that decide, from the state when an overtake begins.

    Args:
        data: The data set, or its folder.
        about: `outcome` for the class; or `legal`, `collision`, `start`.
        features: Factors or single attributes to use; all factors if none.
        policy: Which rules of law decide about the class: `paper`, `default` or `strict`; None
            for the default of the profile.
        seed: Of all choices.
        repeats: How often the factors are ranked, each time on other simulations.
        show_leakage: Whether to show what features would fake that are known only afterwards.
        progress: Called with the number of models that are fitted, and of all.

    Returns:
        Three calibrated models on held-out simulations, and the factors in order, with
        the accuracy that each reaches together with those before it.

    Raises:
        ConfigError: There is no such target, feature or policy, or a feature is known only
            afterwards.
        DatasetError: The data set is not complete or damaged, or has too few examples.
        MissingExtraError: The extra `learn` is not installed.
    """
    from overtaking.analysis.learning import leakage
    from overtaking.analysis.learning.examples import examples_of
    from overtaking.analysis.learning.factors import learn_factors as learned
    from overtaking.analysis.learning.models import require_models
    from overtaking.analysis.learning.targets import target_of

    require_models()
    factors = leakage.chosen_factors(tuple(features))
    check_in_range(repeats, 1, what="--repeats", where="learn")
    target = None if about == "outcome" else target_of(about, others=("outcome",))
    source = load_dataset(data)
    return learned(
        examples_of(source, policy),
        factors,
        target,
        seed=seed,
        repeats=repeats,
        leaks=leakage.leaks_of(source) if show_leakage else None,
        progress=progress,
    )
