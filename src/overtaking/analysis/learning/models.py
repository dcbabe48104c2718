"""Models to compare with, splits of the examples by group, and fits in one thread."""

import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.learning.attributes import Attribute
from overtaking.core.arrays import F64, I64, Mask
from overtaking.core.errors import check_choice, check_extra

if TYPE_CHECKING:
    from sklearn.base import BaseEstimator

Outcomes = NDArray[Any]
Attributes = tuple[Attribute, ...]
Split = tuple[I64, I64]
"""Indices of the examples to learn from, and of those to test on."""

TREES = "gradient boosting"
TEST_SHARE = 0.3
NUM_FOLDS = 3
"""Folds of the calibration."""

Model = Any
"""A fitted classifier of scikit-learn."""


def require_models() -> None:
    """Make sure that scikit-learn is installed.

    Raises:
        MissingExtraError: It is not.
    """
    check_extra("learn", "sklearn", what="scikit-learn, which fits models", where="learn")


@contextmanager
def one_thread() -> Generator[None]:
    """Compute in one thread: sums in another order would change the last digits of a model."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield


def split(groups: I64, seed: int, share: float = TEST_SHARE) -> Split:
    """Split the examples in two; a group stays on one side, because kin know each other's answer.

    Args:
        groups: Group of each example, shape (example,); at least two different ones.
        seed: Seed of the choice.
        share: Share of the groups to test on.

    Raises:
        MissingExtraError: scikit-learn is not installed.
    """
    require_models()
    from sklearn.model_selection import GroupShuffleSplit

    parted = GroupShuffleSplit(n_splits=1, test_size=share, random_state=seed % 2**32)
    return _as_split(next(iter(parted.split(groups, groups=groups))))


def folds(groups: I64, number: int) -> list[Split]:
    """Split the examples so that each is tested on once, by groups.

    Args:
        groups: Group of each example, shape (example,).
        number: Number of folds; fewer if there are fewer groups.
    """
    from sklearn.model_selection import GroupKFold

    parts = GroupKFold(n_splits=min(number, len(np.unique(groups))))
    return [_as_split(part) for part in parts.split(groups, groups=groups)]


def _as_split(part: tuple[NDArray[Any], NDArray[Any]]) -> Split:
    return part[0].astype(np.int64), part[1].astype(np.int64)


def _logistic(attributes: Attributes, seed: int) -> "BaseEstimator":
    from sklearn.linear_model import LogisticRegression

    return _scaled(attributes, LogisticRegression(max_iter=2000, random_state=seed % 2**32))


def _network(attributes: Attributes, seed: int) -> "BaseEstimator":
    from sklearn.neural_network import MLPClassifier

    settings: dict[str, Any] = {  # scikit-learn's annotations are guessed from its defaults.
        "hidden_layer_sizes": (32,),
        "alpha": 1e-3,
        "learning_rate_init": 3e-3,
        "max_iter": 60,
        "early_stopping": True,
        "n_iter_no_change": 6,
        "random_state": seed % 2**32,
    }
    return _scaled(attributes, MLPClassifier(**settings))


def trees(attributes: Attributes, seed: int, *, rounds: int = 100) -> "BaseEstimator":
    """Gradient boosting of small trees.

    Args:
        attributes: The attributes of the columns.
        seed: Seed of its random numbers.
        rounds: Number of trees for each class.

    Source:
        J. H. Friedman, Greedy function approximation, Ann. Stat. 29 (2001) 1189-1232; with binned
        values as in G. Ke and others, LightGBM, NeurIPS 2017.
    """
    require_models()
    from sklearn.ensemble import HistGradientBoostingClassifier

    settings: dict[str, Any] = {
        "max_iter": rounds,
        "learning_rate": 0.1,
        "max_leaf_nodes": 15,
        "min_samples_leaf": 20,
        "categorical_features": [len(one.levels) > 2 for one in attributes],
        "early_stopping": False,
        "random_state": seed % 2**32,
    }
    return HistGradientBoostingClassifier(**settings)


MODELS: dict[str, Callable[[Attributes, int], "BaseEstimator"]] = {
    "logistic regression": _logistic,
    TREES: trees,
    "neural network": _network,
}
"""The models by name."""


def _scaled(attributes: Attributes, model: "BaseEstimator") -> "BaseEstimator":
    """A model of names as columns of 0 and 1, and of numbers with mean 0 and deviation 1."""
    from sklearn.compose import make_column_transformer
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import OneHotEncoder, StandardScaler

    named = [n for n, one in enumerate(attributes) if len(one.levels) > 2]
    measured = [n for n in range(len(attributes)) if n not in named]
    encoder = OneHotEncoder(handle_unknown="ignore", sparse_output=False)
    columns = make_column_transformer((StandardScaler(), measured), (encoder, named))
    return make_pipeline(columns, model)


def model_of(name: str, attributes: Attributes, seed: int) -> "BaseEstimator":
    """A model that is not fitted yet.

    Raises:
        ConfigError: There is no model of that name.
        MissingExtraError: scikit-learn is not installed.
    """
    require_models()
    check_choice(name, MODELS, what="model", where="learn")
    return MODELS[name](attributes, seed)


def fit(model: "BaseEstimator", values: F64, outcomes: Outcomes) -> Model:
    """Fit a copy of a model in one thread.

    Args:
        model: The model.
        values: The attributes, shape (example, attribute).
        outcomes: What to predict, shape (example,).
    """
    from sklearn.base import clone
    from sklearn.exceptions import ConvergenceWarning

    with one_thread(), warnings.catch_warnings():
        # A network that stops at its last round is a small network, not a mistake.
        warnings.simplefilter("ignore", ConvergenceWarning)
        made: Any = clone(model)
        return made.fit(values, outcomes)


def fit_calibrated(model: "BaseEstimator", values: F64, outcomes: Outcomes, groups: I64) -> Model:
    """Fit a model with calibrated probabilities: a share p of the cases with probability p occurs.

    A sigmoid is fitted to its scores of examples of groups that it was not fitted on.

    Args:
        model: The model; a fitted copy is returned.
        values: The attributes, shape (example, attribute).
        outcomes: What to predict, shape (example,).
        groups: Group of each example, same shape.

    Source:
        J. Platt, Probabilistic outputs for support vector machines, 1999.
    """
    from sklearn.calibration import CalibratedClassifierCV

    settings: dict[str, Any] = {"cv": folds(groups, NUM_FOLDS), "ensemble": False}
    calibrated = CalibratedClassifierCV(model, method="sigmoid", **settings)
    return fit(calibrated, values, outcomes)


def probabilities(model: Model, values: F64) -> F64:
    """Probability of each class, shape (example, class)."""
    with one_thread():
        return np.asarray(model.predict_proba(values), dtype=np.float64)


def predicted_right(
    attributes: Attributes, values: F64, outcomes: Outcomes, parts: Split, *, seed: int, rounds: int
) -> Mask:
    """Which examples of the second part `trees` predict rightly from those of the first.

    Args:
        attributes: The attributes of the columns.
        values: The attributes, shape (example, attribute).
        outcomes: What to predict, shape (example,).
        parts: The examples to learn from, and those to test on.
        seed: Seed of the model.
        rounds: Number of trees for each class.
    """
    known, kept = parts
    model = fit(trees(attributes, seed, rounds=rounds), values[known], outcomes[known])
    return model.classes_[probabilities(model, values[kept]).argmax(axis=1)] == outcomes[kept]
