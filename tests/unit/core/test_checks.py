"""Names and numbers that cannot be used are refused with what could be."""

import math

import pytest
from tests.support.integers import INTEGER_TYPES, NO_INTEGERS

from overtaking.core.errors import (
    ConfigError,
    check_choice,
    check_in_range,
    check_whole_number,
    whole_number,
)
from overtaking.core.progress import ProgressCounter


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    check_choice("svg", ("svg", "png"), what="--format", where="draw")
    with pytest.raises(ConfigError, match=r"^draw: --format: expected svg or png, got gif; choose"):
        check_choice("gif", ("svg", "png"), what="--format", where="draw")


@pytest.mark.parametrize("number", [0, -1, math.nan])
def test_a_number_that_is_too_small_is_refused(number: float) -> None:
    check_in_range(1, 1, what="--every", where="logic")
    with pytest.raises(ConfigError, match=r"^logic: --every: expected 1 frame or more, got"):
        check_in_range(number, 1, what="--every", where="logic", unit="frame")


@pytest.mark.parametrize("kind", INTEGER_TYPES)
def test_an_integer_of_any_library_becomes_one_of_python(kind: str) -> None:
    number = whole_number(INTEGER_TYPES[kind](7))
    assert (number, type(number)) == (7, int)
    assert check_whole_number(INTEGER_TYPES[kind](7), 7, 7, what="seed", where="sample") == 7


@pytest.mark.parametrize("value", [*NO_INTEGERS, None])
def test_a_flag_or_a_fraction_is_no_integer(value: object) -> None:
    assert whole_number(value) is None
    with pytest.raises(ConfigError, match=r"^sample: seed: expected 0 to 9, got"):
        check_whole_number(value, 0, 9, what="seed", where="sample")


@pytest.mark.parametrize("number", [-1, 10, 2**70])
def test_an_integer_out_of_its_range_is_refused(number: int) -> None:
    with pytest.raises(ConfigError, match=r"^sample: seed: expected 0 to 9, got"):
        check_whole_number(number, 0, 9, what="seed", where="sample")


def test_steps_of_several_parts_add_up() -> None:
    told: list[tuple[int, int]] = []
    step = ProgressCounter(5, lambda done, total: told.append((done, total)))
    step()
    step(3)
    assert told == [(1, 5), (4, 5)]
    ProgressCounter(1, None)()
