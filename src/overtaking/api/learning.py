"""Rules and factors of overtakes, learned from a data set."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from overtaking.api.datasets import load_dataset
from overtaking.core.errors import check_in_range
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.model.checks import check_arguments

if TYPE_CHECKING:
    from overtaking.analysis.learning.factors import FactorsFound
    from overtaking.analysis.learning.rules import RulesFound


@check_arguments
def learn_rules(
    dataset: Dataset | str | Path,
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
        dataset: The data set, or its folder.
        about: Fact to predict: `legal`, `collision`, or `start` (now is no time to begin).
        policy: Which rules of law decide about the class: `paper`, `default` or `strict`; None
            for the default of the profile.
        seed: Seed of the split into training and held-out simulations, and of the black box.
        max_rules: Largest number of rules, 1 or more.
        max_conditions: Largest number of conditions of a rule, 1 or more.
        progress: Called with the number of rounds that are done, and of all.

    Returns:
        The rules with precision, recall and counterexamples; beside them, on the held-out
        simulations, a black box and the speed limit alone.

    Raises:
        ConfigError: A target or policy does not exist, or a number is out of its range.
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
        examples_of(load_dataset(dataset), policy),
        target,
        seed=seed,
        max_rules=max_rules,
        max_conditions=max_conditions,
        progress=progress,
    )


@check_arguments
def learn_factors(
    dataset: Dataset | str | Path,
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
        dataset: The data set, or its folder.
        about: Fact to predict: `outcome` (the class), `legal`, `collision` or `start`.
        features: Factors or single attributes to use; all factors if the list is empty.
        policy: Which rules of law decide about the class: `paper`, `default` or `strict`; None
            for the default of the profile.
        seed: Seed of all random choices.
        repeats: Number of rankings, each from other simulations, 1 or more.
        show_leakage: Whether the result includes the accuracy that features known only afterwards
            would feign.
        progress: Called with the number of fitted models, and of all models.

    Returns:
        Three calibrated models on held-out simulations, and the factors in order, with
        the accuracy that each reaches together with those before it.

    Raises:
        ConfigError: A target, feature or policy does not exist, or a feature is known only
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
    source = load_dataset(dataset)
    return learned(
        examples_of(source, policy),
        factors,
        target,
        seed=seed,
        repeats=repeats,
        leaks=leakage.leaks_of(source) if show_leakage else None,
        progress=progress,
    )
