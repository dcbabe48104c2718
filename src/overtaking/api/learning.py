"""Public functions that learn from a data set why overtakes succeed or fail: `overtaking.learning`.

Both functions learn from the state (gaps, speeds, weather and so on) at the instant when the ego,
the vehicle whose overtaking is studied, begins an overtake or could begin one. Each simulation is
one example. 30 % of the scenarios (situations at the start) are held out: their examples do not
serve for learning, and all scores are measured on them. All examples of a scenario, such as a
simulation and its repetition with a change, are on the same side of this split.

*Class*: the result of a simulation, such as `Success_L` (completed, legal). *Policy*: the set of
rules of law that decides between legal and illegal. *Profile*: the setting that simulations are
drawn from; it has a default policy. *Factor*: one or several related attributes of the state, such
as `sight`.

`check_arguments` raises a `ConfigError` for an argument of another type than its annotation.
"""

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
    """Learn a few short rules, such as "legal if the gap is large and the road is dry".

    Args:
        dataset: The data set, or its folder or URL.
        about: The fact to predict: `legal` (the overtake that begins is completed and legal),
            `collision` (it ends in a collision), or `start` (this is a bad instant to start: the
            driver does not start, or the overtake fails; rules read "do not start now if ...").
        policy: `paper`, `default` or `strict`; None for the default of the profile.
        seed: Seed of the choice of held-out scenarios, and of the black box (see Returns).
        max_rules: Largest number of rules, 1 or more.
        max_conditions: Largest number of conditions of a rule, 1 or more.
        progress: Called with the number of rounds of learning that are done, and of all.

    Returns:
        The rules with precision, recall, and simulations in which they are wrong. For comparison,
        the scores of a black box (gradient boosting: many decision trees, too many to read), and of
        a single rule about the speed over the speed limit.

    Raises:
        ConfigError: A fact or policy does not exist, or a number is out of its range.
        DatasetError: The data set is not complete or damaged, or has too few examples.
        MissingExtraError: The extra `learn` is not installed.
    """
    from overtaking.analysis.learning.examples import examples_of
    from overtaking.analysis.learning.models import require_models
    from overtaking.analysis.learning.rules import learn_rules as learn_from_examples
    from overtaking.analysis.learning.targets import target_of

    require_models()  # Raises MissingExtraError before any work is done.
    # Errors name the options of the command line, which users of Python understand, too.
    target = target_of(about)
    check_in_range(max_rules, 1, what="--max-rules", where="learn")
    check_in_range(max_conditions, 1, what="--max-conditions", where="learn")
    return learn_from_examples(
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
    """Rank the factors by their importance for the prediction of a result.

    The least important factor is removed and the models are fitted again, until one remains
    (sequential backward selection).

    Args:
        dataset: The data set, or its folder or URL.
        about: The fact to predict: `outcome` (the class), or `legal`, `collision` or `start` as in
            `learn_rules`.
        features: Names of factors or single attributes to use; all factors if empty.
        policy: `paper`, `default` or `strict`; None for the default of the profile.
        seed: Seed of all random choices.
        repeats: Number of rankings, 1 or more, each from another choice of simulations. Several
            rankings show how much a rank depends on chance.
        show_leakage: Whether the result also has the misleadingly high accuracy of models that see
            features known only after the overtake, such as its duration.
        progress: Called with the number of fitted models, and of all models.

    Returns:
        Three models (logistic regression, gradient boosting, neural network) with calibrated
        probabilities and their scores; and the factors in order of importance, each with the
        accuracy that it reaches together with all before it.

    Raises:
        ConfigError: A fact, feature or policy does not exist, or a feature is known only after the
            overtake.
        DatasetError: The data set is not complete or damaged, or has too few examples.
        MissingExtraError: The extra `learn` is not installed.
    """
    from overtaking.analysis.learning import leakage
    from overtaking.analysis.learning.examples import examples_of
    from overtaking.analysis.learning.factors import learn_factors as learn_from_examples
    from overtaking.analysis.learning.models import require_models
    from overtaking.analysis.learning.targets import target_of

    require_models()  # Raises MissingExtraError before any work is done.
    # Raises for a feature that is known only after the overtake.
    factors = leakage.chosen_factors(tuple(features))
    check_in_range(repeats, 1, what="--repeats", where="learn")
    # None stands for the class, which has several values; a target is a question with yes or no.
    # `others` completes the list of names in the error message.
    target = None if about == "outcome" else target_of(about, others=("outcome",))
    source = load_dataset(dataset)
    return learn_from_examples(
        examples_of(source, policy),
        factors,
        target,
        seed=seed,
        repeats=repeats,
        leaks=leakage.leaks_of(source) if show_leakage else None,
        progress=progress,
    )
