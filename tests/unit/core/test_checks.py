"""Names and numbers that cannot be used are refused with what could be."""

import math

import pytest

from overtaking.core.checks import check_least, check_name
from overtaking.core.errors import ConfigError
from overtaking.core.steps import Steps


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    check_name("svg", ("svg", "png"), what="--format", where="draw")
    with pytest.raises(ConfigError, match=r"^draw: --format: expected svg or png, got gif; choose"):
        check_name("gif", ("svg", "png"), what="--format", where="draw")


@pytest.mark.parametrize("number", [0, -1, math.nan])
def test_a_number_that_is_too_small_is_refused(number: float) -> None:
    check_least(1, 1, what="--every", where="logic")
    with pytest.raises(ConfigError, match=r"^logic: --every: expected 1 frame or more, got"):
        check_least(number, 1, what="--every", where="logic", unit="frame")


def test_steps_of_several_parts_add_up() -> None:
    told: list[tuple[int, int]] = []
    step = Steps(5, lambda done, total: told.append((done, total)))
    step()
    step(3)
    assert told == [(1, 5), (4, 5)]
    Steps(1, None)()
