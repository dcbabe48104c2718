"""Exact limits of the mean of a Poisson count."""

from __future__ import annotations

import math

CONFIDENCE = 0.95
_HALVINGS = 80


def poisson_limits(count: float) -> tuple[float, float]:
    """The exact 95 % confidence interval of the mean of a count.

    Args:
        count: The count, at least 0; the effective number of weighted events need not be whole.

    Source:
        F. Garwood, Fiducial limits for the Poisson distribution, Biometrika 28 (1936) 437-442; for
        weighted events M. P. Fay, E. J. Feuer, Statistics in Medicine 16 (1997) 791-801.
    """
    tail = 0.5 * (1.0 - CONFIDENCE)
    low = _gamma_quantile(count, tail) if count > 0.0 else 0.0
    return low, _gamma_quantile(count + 1.0, 1.0 - tail)


def _gamma_quantile(shape: float, share: float) -> float:
    low, high = 0.0, shape + 10.0 * math.sqrt(shape) + 10.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _gamma_share(shape, middle) < share else (low, middle)
    return 0.5 * (low + high)


def _gamma_share(shape: float, x: float) -> float:
    """The regularised lower incomplete gamma function, by its series.

    Source:
        Abramowitz and Stegun, Handbook of Mathematical Functions (1964), 6.5.29.
    """
    if x <= 0.0:
        return 0.0
    # Terms grow until their number is x - shape, and are negligible ten spreads later.
    terms = int(max(x - shape, 0.0) + 10.0 * math.sqrt(x + shape) + 50.0)
    log_x = math.log(x)
    return math.fsum(
        math.exp((shape + n) * log_x - x - math.lgamma(shape + n + 1.0)) for n in range(terms)
    )
