"""Supervised cuts of a number: borders between which the share of a class changes."""

import numpy as np

from overtaking.core.arrays import F64, I64, Mask

MAX_DEPTH = 3
"""Depth of cuts within cuts: at most seven in all."""


def supervised_cuts(values: F64, positive: Mask, depth: int = MAX_DEPTH) -> F64:
    """Borders between which the share of positives differs significantly.

    Args:
        values: One number of each example, finite, shape (example,).
        positive: Whether each is positive, same shape.
        depth: Number of times that a part may be cut again.

    Returns:
        The borders in order, halfway between two values that occur; may be empty.

    Source:
        U. M. Fayyad and K. B. Irani, Multi-interval discretization of continuous-valued attributes
        for classification learning, IJCAI 1993, 1022-1027: entropy, and the criterion of the
        minimum description length.
    """
    if not len(values):
        return np.zeros(0)
    order = np.argsort(values, kind="stable")
    ordered, hits = values[order], positive[order].astype(np.int64)
    starts = np.flatnonzero(np.diff(ordered, prepend=-np.inf) > 0.0)
    levels = ordered[starts]
    ends = np.append(starts[1:], len(ordered))
    total = np.concatenate([[0], ends])
    positives = np.concatenate([[0], np.cumsum(hits)[ends - 1]])
    found: list[int] = []
    _cut(total, positives, (0, len(levels)), depth, found)
    return np.array([(levels[n - 1] + levels[n]) / 2.0 for n in sorted(found)], dtype=np.float64)


def _cut(total: I64, positives: I64, part: tuple[int, int], depth: int, found: list[int]) -> None:
    """Cut the levels of a part in two, and these again, while the criterion holds.

    Args:
        total: Number of examples below each level, shape (level + 1,).
        positives: Number of positives below it, same shape.
        part: First level, and the one after the last.
        depth: Remaining depth.
        found: Receives the number of the level above each cut.
    """
    first, last = part
    if depth == 0 or last - first < 2:
        return
    index = _best(total[first : last + 1], positives[first : last + 1])
    if index is None:
        return
    middle = first + index
    found.append(middle)
    _cut(total, positives, (first, middle), depth - 1, found)
    _cut(total, positives, (middle, last), depth - 1, found)


def _best(total: I64, positives: I64) -> int | None:
    """The best cut of a part, None if its gain does not exceed its description length."""
    size, hits = total[-1] - total[0], positives[-1] - positives[0]
    low, low_hits = total[1:-1] - total[0], positives[1:-1] - positives[0]
    high, high_hits = size - low, hits - low_hits
    below, above = entropy(low_hits, low), entropy(high_hits, high)
    mean = (low * below + high * above) / size
    index = int(np.argmin(mean))
    whole = entropy(np.array([hits]), np.array([size]))[0]
    kinds = [_kinds(*pair) for pair in ((hits, size), (low_hits[index], low[index]))]
    kinds.append(_kinds(high_hits[index], high[index]))
    parts = kinds[0] * whole - kinds[1] * below[index] - kinds[2] * above[index]
    cost = (np.log2(size - 1) + np.log2(3.0 ** kinds[0] - 2.0) - parts) / size
    return index + 1 if whole - mean[index] > cost else None


def entropy(hits: I64, size: I64) -> F64:
    """Entropy of a share [bit], shape as given."""
    share = hits / size
    safe = np.clip(share, 1e-300, 1.0), np.clip(1.0 - share, 1e-300, 1.0)
    return -(share * np.log2(safe[0]) + (1.0 - share) * np.log2(safe[1]))


def _kinds(hits: np.int64, size: np.int64) -> int:
    """Number of classes that occur."""
    return int(hits > 0) + int(hits < size)
