"""Confidence intervals of counted shares."""

import math

Z95 = 1.959963984540054  # The 97.5 % point of the normal distribution.


def wilson_interval(share: float, size: float) -> tuple[float, float]:
    """95 % confidence interval of a share.

    Args:
        share: The observed share, 0 to 1.
        size: Number of observations; the effective number if they are weighted.

    Returns:
        The limits; 0 and 1 without observations.

    Source:
        E. B. Wilson, Probable inference, the law of succession, and statistical inference,
        J. Am. Stat. Assoc. 22 (1927) 209-212.
    """
    if size <= 0.0:
        return 0.0, 1.0
    z2 = Z95**2 / size
    centre = (share + z2 / 2.0) / (1.0 + z2)
    reach = math.sqrt(share * (1.0 - share) * z2 + z2**2 / 4.0) / (1.0 + z2)
    return max(0.0, centre - reach), min(1.0, centre + reach)
