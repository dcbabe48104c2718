"""What is counted agrees with its number."""

import pytest

from overtaking.core.representation import format_count


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0, "0 simulations"),
        (1, "1 simulation"),
        (2, "2 simulations"),
        (1_000_000, "1,000,000 simulations"),
    ],
)
def test_one_alone_is_singular(number: int, text: str) -> None:
    assert format_count(number, "simulation") == text
