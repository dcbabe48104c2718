"""Which examples are learned from and which are kept to judge what was learned.

What comes from one root scenario or recording stays on one side: a model that has seen a twin knows
the answer.
"""

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.learning.extra import require_models

I64 = NDArray[np.int64]
Split = tuple[I64, I64]
"""Places of the examples to learn from, and of those to judge by."""

TEST_SHARE = 0.3


def split(groups: I64, seed: int, share: float = TEST_SHARE) -> Split:
    """Part the examples in two.

    Args:
        groups: Group of each example, shape (example,); at least two different ones.
        seed: Of the choice.
        share: Share of the groups that is kept to judge by.

    Raises:
        MissingExtraError: scikit-learn is not installed.
    """
    require_models()
    from sklearn.model_selection import GroupShuffleSplit

    parted = GroupShuffleSplit(n_splits=1, test_size=share, random_state=seed % 2**32)
    learned, kept = next(iter(parted.split(groups, groups=groups)))
    return learned.astype(np.int64), kept.astype(np.int64)


def folds(groups: I64, number: int) -> list[Split]:
    """Part the examples so that each is kept once, by groups.

    Args:
        groups: Group of each example, shape (example,).
        number: How often; fewer if there are fewer groups.
    """
    from sklearn.model_selection import GroupKFold

    parts = GroupKFold(n_splits=min(number, len(np.unique(groups))))
    return [
        (learned.astype(np.int64), kept.astype(np.int64))
        for learned, kept in parts.split(groups, groups=groups)
    ]
