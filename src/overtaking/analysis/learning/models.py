"""Models to compare with: a straight one, a black box of trees, and a small neural network."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.learning.attributes import Attribute
from overtaking.analysis.learning.extra import one_thread, require_models
from overtaking.analysis.learning.splits import folds
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from sklearn.base import BaseEstimator

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

TREES = "gradient boosting"
NUM_FOLDS = 3
"""Folds in which a model is calibrated."""

Model = Any
"""A fitted classifier of scikit-learn."""


def _logistic(attributes: tuple[Attribute, ...], seed: int) -> "BaseEstimator":
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline

    return make_pipeline(
        _numbers(attributes), LogisticRegression(max_iter=2000, random_state=seed % 2**32)
    )


def _trees(attributes: tuple[Attribute, ...], seed: int) -> "BaseEstimator":
    return trees(attributes, seed, rounds=100)


def _network(attributes: tuple[Attribute, ...], seed: int) -> "BaseEstimator":
    from sklearn.neural_network import MLPClassifier
    from sklearn.pipeline import make_pipeline

    settings: dict[str, Any] = {  # Annotations of scikit-learn are guessed from its defaults.
        "hidden_layer_sizes": (32,),
        "alpha": 1e-3,
        "learning_rate_init": 3e-3,
        "max_iter": 60,
        "early_stopping": True,
        "n_iter_no_change": 6,
        "random_state": seed % 2**32,
    }
    return make_pipeline(_numbers(attributes), MLPClassifier(**settings))


MODELS: dict[str, Callable[[tuple[Attribute, ...], int], "BaseEstimator"]] = {
    "logistic regression": _logistic,
    TREES: _trees,
    "neural network": _network,
}
"""What can be fitted, by name."""


def trees(attributes: tuple[Attribute, ...], seed: int, *, rounds: int) -> "BaseEstimator":
    """Gradient boosting of small trees.

    Args:
        attributes: What the columns are.
        seed: Of its random numbers.
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


def _numbers(attributes: tuple[Attribute, ...]) -> Any:
    """Names as columns of 0 and 1, numbers scaled by mean and deviation."""
    from sklearn.compose import make_column_transformer
    from sklearn.preprocessing import OneHotEncoder, StandardScaler

    named = [n for n, one in enumerate(attributes) if len(one.levels) > 2]
    measured = [n for n in range(len(attributes)) if n not in named]
    return make_column_transformer(
        (StandardScaler(), measured),
        (OneHotEncoder(handle_unknown="ignore", sparse_output=False), named),
    )


def model_of(name: str, attributes: tuple[Attribute, ...], seed: int) -> "BaseEstimator":
    """A model that is not fitted yet.

    Raises:
        ConfigError: There is none of that name.
        MissingExtraError: scikit-learn is not installed.
    """
    require_models()
    if name not in MODELS:
        raise ConfigError.of(
            what="model",
            where="learn",
            expected=" or ".join(MODELS),
            got=name,
            next_step="choose one of them",
        )
    return MODELS[name](attributes, seed)


def fit(model: "BaseEstimator", values: F64, outcomes: NDArray[Any]) -> Model:
    """Fit a model in one thread.

    Args:
        model: A model; a fitted copy is returned.
        values: Shape (example, attribute).
        outcomes: What is to be foretold, shape (example,).
    """
    import warnings

    from sklearn.base import clone
    from sklearn.exceptions import ConvergenceWarning

    with one_thread(), warnings.catch_warnings():
        # A network that stops at its last round is a small network, no mistake.
        warnings.simplefilter("ignore", ConvergenceWarning)
        made: Any = clone(model)
        return made.fit(values, outcomes)


def fit_calibrated(
    model: "BaseEstimator", values: F64, outcomes: NDArray[Any], groups: I64
) -> Model:
    """Fit a model so that what it gives a probability of p happens in a share p of the cases.

    A sigmoid is fitted to what the model says of examples of other groups than it was fitted on.

    Args:
        model: A model; a fitted copy is returned.
        values: Shape (example, attribute).
        outcomes: What is to be foretold, shape (example,).
        groups: Group of each example, same shape.

    Source:
        J. Platt, Probabilistic outputs for support vector machines, 1999.
    """
    from sklearn.calibration import CalibratedClassifierCV

    settings: dict[str, Any] = {
        "method": "sigmoid",
        "cv": folds(groups, NUM_FOLDS),
        "ensemble": False,
    }
    return fit(CalibratedClassifierCV(model, **settings), values, outcomes)


def probabilities(model: Model, values: F64) -> F64:
    """Probability of each class, shape (example, class)."""
    with one_thread():
        return np.asarray(model.predict_proba(values), dtype=np.float64)
